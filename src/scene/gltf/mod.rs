//! glTF 2.0 files (`.gltf`, `.glb`) to [`Scene`].
//!
//! The order is: document, node tree, materials, the meshes that the chosen scene shows, textures, then the placements
//! relative to [`Scene::origin`]. A broken or hostile file gives [`Error::InvalidScene`](crate::Error::InvalidScene)
//! with the JSON pointer of what is wrong; what is merely not simulated becomes a warning. Memory is bounded by what
//! the file holds, not by the numbers in it. Animations are read for a shutter alone ([`LoadOptions::shutter`]).
//! Limit: texture coordinates and colours that morph targets displace are those when the shutter opens.

mod accessor;
mod animation;
mod camera;
mod changing;
mod choice;
mod document;
mod ext;
mod image;
mod json;
mod looks;
mod material;
mod mesh;
mod meshes;
#[cfg(feature = "meshopt")]
mod meshopt;
mod morph;
mod moving;
mod node;
mod part;
mod placement;
mod pose;
mod references;
mod skin;
mod tangent;
mod topology;
mod uri;
mod uv;

use std::path::Path;

use glam::{DAffine3, DVec3};

use self::animation::Animations;
use self::document::Document;
use self::ext::{
    ext_lights_ies, ext_lights_image_based, khr_animation_pointer, khr_lights_punctual, khr_materials_variants,
};
use self::material::MaterialTable;
use self::node::Timeline;
use super::motion::{Motion, Track, Unmoved};
use super::{Dropped, LoadOptions, NodeId, Scene, geometry};
use crate::error::Result;

impl Scene {
    /// Loads a `.gltf` or `.glb` file with its buffers and images. A scene without any light is lit by a constant
    /// white environment, with a warning.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io), [`Error::InvalidScene`](crate::Error::InvalidScene),
    /// [`Error::UnsupportedExtension`](crate::Error::UnsupportedExtension) and [`Error::Image`](crate::Error::Image),
    /// each with the file and the JSON pointer of what is wrong.
    pub fn load(path: impl AsRef<Path>) -> Result<Scene> {
        Scene::load_with(path, &LoadOptions::default())
    }

    /// As [`load`](Self::load), under other options.
    ///
    /// # Errors
    /// As [`load`](Self::load); those of the environment name its file.
    pub fn load_with(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Scene> {
        Scene::read(Document::read(path.as_ref(), options.allow_outside)?, path.as_ref(), options, None)
    }

    /// The same file at another time: as [`load_with`](Self::load_with), where `earlier` was loaded from `path` under
    /// options that differ in the shutter alone. Textures and environment are not read again but shared.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn load_again(path: impl AsRef<Path>, options: &LoadOptions, earlier: &Scene) -> Result<Scene> {
        Scene::read(Document::read(path.as_ref(), options.allow_outside)?, path.as_ref(), options, Some(earlier))
    }

    /// As [`load_with`](Self::load_with), from the bytes of a `.glb` or `.gltf` file. `file` stands for it in messages;
    /// buffers and images that lie outside are looked for in its folder.
    ///
    /// # Errors
    /// As [`load_with`](Self::load_with).
    pub fn from_bytes(bytes: Vec<u8>, file: impl AsRef<Path>, options: &LoadOptions) -> Result<Scene> {
        Scene::read(Document::of_bytes(file.as_ref(), bytes, options.allow_outside)?, file.as_ref(), options, None)
    }

    /// Reads a scene, sharing what does not depend on the shutter with `earlier`.
    fn read(mut document: Document, path: &Path, options: &LoadOptions, earlier: Option<&Scene>) -> Result<Scene> {
        let animation = choice::apply(&mut document, options)?;
        ext::check(&document, options.allow_missing_extensions)?;
        references::check(&document)?;
        let mut motion =
            Motion { shutter: options.shutter, animations: animation::spans(&document)?, ..Motion::default() };
        let mut same_textures = earlier;
        if let Some(shutter) = options.shutter {
            let pointed = animation::pointed(&document, animation, &moving::times_s(shutter))?;
            // What is animated besides nodes may be what is visible, and so which textures are read.
            same_textures = earlier.filter(|_| pointed.is_empty());
            motion.unmoved = khr_animation_pointer::apply(&mut document, pointed);
        }
        let timeline = Timeline {
            animations: &match options.shutter {
                Some(_) => Animations::read(&document, animation)?,
                None => Animations::default(),
            },
            times_s: options.shutter.map_or(vec![0.0], moving::times_s),
        };
        let graph = node::flatten(&document, &timeline)?;
        let nodes = &graph.placed;
        let mut materials = MaterialTable::read(&document, &meshes::materials_in_use(&document, nodes))?;
        let mut dropped = Dropped::default();
        let meshes = meshes::read(&document, &graph, &mut materials, &mut dropped)?;
        let ways = moving::ways(nodes, &meshes, &mut motion);
        if let Some(off) = meshes.off.as_ref() {
            let worst = motion.off.as_ref().map_or(0.0, |worst| worst.distance_m);
            motion.off = if off.distance_m > worst { Some(off.clone()) } else { motion.off };
        }
        for node in nodes.iter().filter(|node| node.morphs.is_some() && morph::paints(&document, node.mesh)) {
            let name = node.name.as_ref().unwrap_or(&node.pointer);
            let what = format!("colours and texture coordinates of the morph targets of node '{name}'");
            motion.unmoved.push(Unmoved { what, why: "they stay as the shutter opens".into() });
        }
        let placement = placement::place(&document, nodes, &ways, &meshes)?;
        motion.instances = placement.tracks;
        motion.animated = placement.animated;
        let origin = placement.origin;

        let mut scene = Scene {
            file: path.into(),
            instances: placement.instances,
            nodes: placement.nodes,
            origin,
            suggested_size: suggested_size(&document)?,
            dropped,
            scenes: choice::names(&document, "/scenes")?,
            variants: choice::names(&document, khr_materials_variants::LIST)?,
            ..Scene::default()
        };
        for (node, way) in nodes.iter().zip(&ways) {
            let light =
                node.light.map(|index| khr_lights_punctual::read(&document, node, index, origin)).transpose()?;
            let lamp = node.lamp.map(|index| ext_lights_ies::read(&document, node, index, origin)).transpose()?;
            for light in light.into_iter().chain(lamp) {
                scene.light_nodes.push(Some(NodeId(scene.nodes.len() as u32)));
                scene.nodes.push((*node.called).clone());
                scene.punctual.push(light);
            }
            if let Some(index) = node.camera {
                motion.cameras.extend(camera_track(scene.cameras.len(), way, origin));
                scene.cameras.push(camera::read(&document, node, index, origin)?);
            }
        }
        scene.motion = motion;
        warn_of_left_out(&document, dropped, options)?;
        if materials.materials.is_empty() {
            materials.default_material();
        }
        scene.meshes = meshes.list;
        if scene.cameras.is_empty() {
            // It stands still from frame to frame.
            let stood = earlier.and_then(|earlier| Some((earlier.cameras.first()?, earlier.origin)));
            scene.cameras.push(match stood {
                Some((camera, origin)) => camera.moved((origin - scene.origin).as_vec3()),
                None => scene.automatic_camera(),
            });
            document.warn("/cameras", "the scene has no camera; one that sees all of it is added");
        }
        // Materials are numbered as meshes ask for them, which the pose may change; textures as the file lists them.
        scene.materials = materials.materials;
        scene.textures = match same_textures {
            Some(earlier) => earlier.textures.clone(),
            None => materials.textures.decode(&document, options)?,
        };
        scene.fold_constant_textures();
        if same_textures.is_none() {
            scene.weave_textures();
        }
        let copies = geometry::copied_lamps(&scene);
        if copies > 0 {
            document.warn("/meshes", format!("{copies} emissive triangles repeat others exactly and are left out"));
        }
        // That of the command line takes the place of the file's.
        if options.environment.is_none() {
            scene.environment = match earlier {
                Some(earlier) => earlier.environment.clone(),
                None => ext_lights_image_based::read(&document, options)?,
            };
        }
        scene.warnings = document.take_warnings();
        scene.inputs = earlier.map_or_else(|| document.inputs(), |earlier| earlier.inputs.clone());
        scene.validate()?;
        // Whether a scene needs a light is decided once, not by how far its lamps have moved.
        if let (Some(earlier), true) = (earlier, options.environment.is_some() || options.fallback_light) {
            scene.environment.clone_from(&earlier.environment);
            return Ok(scene);
        }
        match &options.environment {
            Some(file) => scene.light_by(file, options)?,
            None if options.fallback_light => scene.ensure_light(),
            None => {}
        }
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

fn warn_of_left_out(document: &Document, dropped: Dropped, options: &LoadOptions) -> Result<()> {
    if dropped.degenerate_triangles > 0 {
        document.warn("/meshes", format!("{} triangles without area are left out", dropped.degenerate_triangles));
    }
    if dropped.points_and_lines > 0 {
        document.warn("/meshes", format!("{} points and lines are left out", dropped.points_and_lines));
    }
    let animations = document.table("animations")?.len();
    if options.shutter.is_none() && animations > 0 {
        let rest = "the scene is shown at rest; --at SECONDS shows it animated";
        let one = format!(", with --animation NAME by one of its {animations} animations, which info lists");
        document.warn("/animations", format!("{rest}{}", if animations > 1 { &one } else { "" }));
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
