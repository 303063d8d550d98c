//! glTF 2.0 files (`.gltf`, `.glb`) to [`Scene`].
//!
//! The order is: document, node tree, materials, the meshes that the chosen scene shows, textures, then the placements relative
//! to [`Scene::origin`]. A broken or hostile file gives [`Error::InvalidScene`](crate::Error::InvalidScene) with the JSON pointer of what is wrong; what is merely not
//! simulated becomes a warning. Memory is bounded by what the file holds, not by the numbers in it.
//! Animations are read for a shutter alone ([`LoadOptions::shutter`]). Limits: no skins, morph targets, compression extensions.

mod accessor;
mod animation;
mod camera;
mod document;
mod image;
mod json;
mod light;
mod material;
mod mesh;
mod moving;
mod node;
mod placement;
mod tangent;
mod topology;
mod uri;
mod uv;

use std::collections::HashMap;
use std::path::Path;

use glam::{DAffine3, DVec3};

use self::animation::Animations;
use self::document::Document;
use self::material::MaterialTable;
use self::node::{Placed, Timeline};
use super::motion::{Motion, Track};
use super::{Dropped, LoadOptions, Mesh, MeshId, Scene, geometry};
use crate::error::Result;

impl Scene {
    /// Loads a `.gltf` or `.glb` file with its buffers and images.
    pub fn load(path: impl AsRef<Path>) -> Result<Scene> {
        Scene::load_with(path, &LoadOptions::default())
    }

    /// As [`load`](Self::load), under other options.
    pub fn load_with(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Scene> {
        let document = Document::read(path.as_ref())?;
        let timeline = Timeline {
            animations: &match options.shutter {
                Some(_) => Animations::read(&document)?,
                None => Animations::default(),
            },
            times_s: options.shutter.map_or(vec![0.0], moving::times_s),
        };
        let nodes = node::flatten(&document, &timeline)?;
        let mut materials = MaterialTable::read(&document)?;
        let mut dropped = Dropped::default();
        let meshes = read_meshes(&document, &nodes, &mut materials, &mut dropped)?;
        let mut motion = Motion {
            shutter: options.shutter,
            animations: animation::spans(&document)?,
            unmoved: timeline.animations.unmoved.clone(),
            ..Motion::default()
        };
        let ways = moving::ways(&nodes, &meshes, &mut motion);
        let placement = placement::place(&document, &nodes, &ways, &meshes)?;
        motion.instances = placement.tracks;
        let origin = placement.origin;

        let mut scene = Scene {
            file: path.as_ref().into(),
            instances: placement.instances,
            origin,
            suggested_size: suggested_size(&document)?,
            dropped,
            ..Scene::default()
        };
        for (node, way) in nodes.iter().zip(&ways) {
            if let Some(index) = node.light {
                scene.punctual.push(light::read(&document, node, index, origin)?);
            }
            if let Some(index) = node.camera {
                motion.cameras.extend(camera_track(scene.cameras.len(), way, origin));
                scene.cameras.push(camera::read(&document, node, index, origin)?);
            }
        }
        scene.motion = motion;
        if scene.cameras.is_empty() {
            scene.cameras.push(camera::framed(placement.least, placement.most));
            document.warn("/cameras", "the scene has no camera; one that sees all of it is added");
        }
        warn_of_left_out(&document, dropped, options)?;
        if materials.materials.is_empty() {
            materials.default_material();
        }
        scene.meshes = meshes.list;
        scene.materials = materials.materials;
        scene.textures = materials.textures.decode(&document, options)?;
        scene.fold_constant_textures();
        scene.weave_textures();
        let copies = geometry::copied_lamps(&scene);
        if copies > 0 {
            document.warn("/meshes", format!("{copies} emissive triangles repeat others exactly and are left out"));
        }
        scene.warnings = document.take_warnings();
        scene.validate()?;
        Ok(scene)
    }
}

/// The track of the camera of that number, if its node moves along `way` and has an orientation everywhere.
fn camera_track(index: usize, way: &[DAffine3], origin: DVec3) -> Option<Track> {
    let steps: Vec<_> = way.iter().map(|pose| camera::placed(pose, origin)).collect::<Option<_>>()?;
    let track = Track { index, steps };
    // A node that carries a mesh as well is judged by the mesh.
    let moves = track.steps.iter().any(|step| *step != track.steps[0]) && track.problem().is_none();
    moves.then_some(track)
}

/// The meshes in use: one for each primitive, grouped by the glTF mesh that holds them.
struct Meshes {
    list: Vec<Mesh>,
    of_gltf_mesh: HashMap<usize, Vec<MeshId>>,
}

/// Reads every mesh that a node shows, in the order of the nodes.
fn read_meshes(
    document: &Document,
    nodes: &[Placed],
    materials: &mut MaterialTable,
    dropped: &mut Dropped,
) -> Result<Meshes> {
    let mut meshes = Meshes { list: Vec::new(), of_gltf_mesh: HashMap::new() };
    for (index, node) in nodes.iter().filter_map(|node| Some((node.mesh?, node))) {
        if meshes.of_gltf_mesh.contains_key(&index) {
            continue;
        }
        let source: gltf::json::Mesh = document.element("meshes", index, &format!("{}/mesh", node.pointer))?;
        let name = source.name.clone().unwrap_or_else(|| format!("mesh {index}"));
        let mut ids = Vec::with_capacity(source.primitives.len());
        for (place, primitive) in source.primitives.iter().enumerate() {
            let pointer = format!("/meshes/{index}/primitives/{place}");
            let place = mesh::Place { pointer: &pointer, name: format!("{name}/primitive {place}") };
            if let Some(mesh) = mesh::read(document, primitive, place, materials, dropped)? {
                ids.push(MeshId(meshes.list.len() as u32));
                meshes.list.push(mesh);
            }
        }
        meshes.of_gltf_mesh.insert(index, ids);
    }
    if meshes.list.is_empty() {
        let problem = format!(
            "expected at least one triangle with an area in the scene, found none ({} without)",
            dropped.degenerate_triangles
        );
        return Err(document.error("/meshes", problem));
    }
    Ok(meshes)
}

fn warn_of_left_out(document: &Document, dropped: Dropped, options: &LoadOptions) -> Result<()> {
    if dropped.degenerate_triangles > 0 {
        document.warn("/meshes", format!("{} triangles without area are left out", dropped.degenerate_triangles));
    }
    if dropped.points_and_lines > 0 {
        document.warn("/meshes", format!("{} points and lines are left out", dropped.points_and_lines));
    }
    if options.shutter.is_none() && !document.table("animations")?.is_empty() {
        document.warn(
            "/animations",
            "animations run with a shutter only (--shutter OPEN,CLOSE); the scene is shown at rest",
        );
    }
    Ok(())
}

/// `extras.render` of the chosen scene: `{width, height}`.
fn suggested_size(document: &Document) -> Result<Option<(u32, u32)>> {
    let Some(scene) = node::chosen_scene(document)? else { return Ok(None) };
    let side = |name: &str| {
        let value = document.value(&format!("{scene}/extras/render/{name}"))?.as_u64()?;
        u32::try_from(value).ok().filter(|&side| side > 0)
    };
    Ok(side("width").zip(side("height")))
}
