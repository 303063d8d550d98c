//! A small glTF that tests bend: JSON with members to set or remove, and a buffer to append to.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

/// A glTF in memory.
#[derive(Clone)]
pub struct Fixture {
    pub json: Value,
    pub binary: Vec<u8>,
}

impl Fixture {
    /// A unit quad of two triangles (accessor 0: positions, 1: 16-bit indices, 2: texture coordinates), a camera, a
    /// material.
    pub fn quad() -> Fixture {
        let mut fixture = Fixture {
            json: json!({
                "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
                "nodes": [{"mesh": 0, "name": "quad"}, {"camera": 0, "translation": [0.5, 0.5, 3.0]}],
                "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}],
                "materials": [{"name": "plain"}],
                "meshes": [{"primitives": [
                    {"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1, "material": 0}
                ]}],
                "accessors": [], "bufferViews": [], "buffers": [{"uri": "scene.bin", "byteLength": 0}]
            }),
            binary: Vec::new(),
        };
        fixture.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0], "VEC3");
        let indices: Vec<u8> = [0u16, 1, 2, 0, 2, 3].iter().flat_map(|index| index.to_le_bytes()).collect();
        fixture.accessor(&indices, 5123, "SCALAR", 6);
        fixture.floats(&[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0], "VEC2");
        fixture
    }

    /// Appends an accessor of floats; returns its index.
    pub fn floats(&mut self, values: &[f32], kind: &str) -> usize {
        let components =
            ["SCALAR", "VEC2", "VEC3", "VEC4"].iter().position(|name| *name == kind).expect("a vector type") + 1;
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(&bytes, 5126, kind, values.len() / components)
    }

    /// Appends bytes, a view of them, and an accessor; returns the accessor's index.
    pub fn accessor(&mut self, bytes: &[u8], component_type: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        let accessors = self.json["accessors"].as_array_mut().expect("the fixture has accessors");
        accessors.push(json!({"bufferView": view, "componentType": component_type, "type": kind, "count": count}));
        accessors.len() - 1
    }

    /// Appends bytes and a view of them; returns the view's index.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let offset = self.binary.len();
        self.binary.extend_from_slice(bytes);
        self.json["buffers"][0]["byteLength"] = self.binary.len().into();
        let views = self.json["bufferViews"].as_array_mut().expect("the fixture has views");
        views.push(json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}));
        views.len() - 1
    }

    /// Sets the member at `pointer`, making objects on the way.
    pub fn set(mut self, pointer: &str, value: Value) -> Fixture {
        let mut place = &mut self.json;
        for name in pointer.split('/').skip(1) {
            place = match name.parse::<usize>() {
                Ok(index) if place.is_array() => &mut place[index],
                _ => &mut place[name],
            };
        }
        *place = value;
        self
    }

    /// Writes `scene.gltf` and `scene.bin`; returns the path of the former.
    pub fn write(&self, directory: &Path) -> PathBuf {
        std::fs::write(directory.join("scene.bin"), &self.binary).expect("a temporary directory can be written");
        write(directory, "scene.gltf", self.json.to_string().as_bytes())
    }

    /// The same as a GLB.
    pub fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"][0].as_object_mut().expect("the fixture has a buffer").remove("uri");
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut binary = self.binary.clone();
        binary.resize(binary.len().next_multiple_of(4), 0);
        let mut glb = b"glTF".to_vec();
        let word = |glb: &mut Vec<u8>, word: usize| glb.extend_from_slice(&(word as u32).to_le_bytes());
        word(&mut glb, 2);
        word(&mut glb, 12 + 8 + text.len() + 8 + binary.len());
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &binary)] {
            word(&mut glb, chunk.len());
            glb.extend_from_slice(kind);
            glb.extend_from_slice(chunk);
        }
        glb
    }
}

/// Writes a file into a temporary directory.
pub fn write(directory: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = directory.join(name);
    std::fs::write(&path, bytes).expect("a temporary directory can be written");
    path
}
