//! What the table of effects reads: a scene and options, as one camera sees them.

use std::collections::HashSet;

use glam::Vec3;

use crate::plan::options::RenderOptions;
use crate::scene::geometry::Geometry;
use crate::scene::{Facts, Material, Mesh, Scene};

/// A render that is asked for.
pub struct Asked<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Everything that was said about the render.
    pub options: &'a RenderOptions,
    /// Index of the camera that looks.
    pub camera: usize,
    /// The scene, flattened.
    pub geometry: &'a Geometry,
    /// Every mesh that is placed, once, in the order of its first placement.
    pub placed: Vec<Placed<'a>>,
}

/// A mesh that is placed.
#[derive(Clone, Copy)]
pub struct Placed<'a> {
    /// The mesh.
    pub mesh: &'a Mesh,
    /// Its material.
    pub material: &'a Material,
    /// What the material can do.
    pub facts: Facts,
}

impl<'a> Asked<'a> {
    /// Looks through the placements of `scene`.
    pub fn new(scene: &'a Scene, options: &'a RenderOptions, camera: usize, geometry: &'a Geometry) -> Self {
        let mut seen = HashSet::new();
        let mut placed = Vec::new();
        for instance in &scene.instances {
            let id = scene.material_of(instance);
            if seen.insert((instance.mesh.0, id.0)) {
                let (mesh, material) = (&scene.meshes[instance.mesh.index()], &scene.materials[id.index()]);
                placed.push(Placed { mesh, material, facts: Facts::with_textures(material, &scene.textures) });
            }
        }
        Asked { scene, options, camera, geometry, placed }
    }

    /// Where the camera stands as the shutter opens, and on its way until it closes.
    pub fn camera_places(&self) -> Vec<Vec3> {
        let steps = self.scene.motion.of_camera(self.camera).map_or(&[][..], |track| &track.steps);
        let on_its_way = steps.iter().map(|step| step.translation.into());
        std::iter::once(self.scene.cameras[self.camera].position()).chain(on_its_way).collect()
    }

    /// Whether light sampling takes part at all.
    pub fn samples_lights(&self) -> bool {
        self.options.strategy.techniques.light
    }
}
