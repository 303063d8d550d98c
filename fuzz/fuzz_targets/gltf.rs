//! Bytes as a scene file: whatever they are, loading ends with a scene or an error, without a panic, and what loads can
//! be made ready for tracing. The loader reads files, so the bytes are written to one first.

#![no_main]

use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use libfuzzer_sys::fuzz_target;
use pathspace::scene::geometry::Geometry;
use pathspace::shading::light::Lights;
use pathspace::scene::{LoadOptions, Shutter};
use pathspace::{Error, Scene};

/// Triangles of a scene that is worth making ready: the rest of the time is better spent on other bytes.
const MOST_TRIANGLES: u64 = 10_000;

fuzz_target!(|bytes: &[u8]| {
    let file = file();
    overwrite(file, bytes).expect("the folder of temporary files can be written");
    // With a shutter, so that animations are read.
    let shutter = Some(Shutter::new(0.25, 0.75).expect("a shutter"));
    match Scene::load_with(file, &LoadOptions::default().shutter(shutter)) {
        Ok(scene) => {
            scene.validate().expect("a scene that loads keeps its promises");
            if scene.triangle_count() <= MOST_TRIANGLES {
                let mut geometry = Geometry::build(&scene);
                if let Ok(lights) = Lights::build(&scene, &geometry) {
                    lights.assign(&mut geometry);
                }
            }
        }
        // An error is one line that names the file.
        Err(error) => {
            let line = error.to_string();
            assert!(!line.contains('\n'), "{line}");
            assert!(matches!(error, Error::Io { .. }) || line.contains("pathspace-fuzz"), "{line}");
        }
    }
});

/// Writes the file anew. It is cut to its length last: a file that is emptied first is flushed to disk by ext4 as it is
/// closed, which makes a tenth of the rate.
fn overwrite(file: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut open = OpenOptions::new().write(true).create(true).truncate(false).open(file)?;
    open.write_all(bytes)?;
    open.set_len(bytes.len() as u64)
}

/// A file of this process alone, in the folder of temporary files. Its name says neither .gltf nor .glb: the bytes do.
fn file() -> &'static Path {
    static FILE: OnceLock<PathBuf> = OnceLock::new();
    FILE.get_or_init(|| std::env::temp_dir().join(format!("pathspace-fuzz-{}", std::process::id())))
}
