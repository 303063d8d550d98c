//! What a scene's rays begin at and go to, for the choice of a backend, which knows no materials.

use glam::Vec3;

use crate::backend::count::draw::View;
use crate::scene::geometry::Geometry;
use crate::scene::{PunctualKind, Scene};

/// Lamps that are kept; of more, every so many-th.
const LAMPS: usize = 64;

/// The first camera and the lights of a scene.
pub fn view_of(scene: &Scene, geometry: &Geometry) -> View {
    let mut lamps = emissive(scene, geometry);
    let stride = lamps.len().div_ceil(LAMPS).max(1);
    lamps = lamps.into_iter().step_by(stride).collect();
    let is_far = |kind: &PunctualKind| matches!(kind, PunctualKind::Directional);
    let near = scene.punctual.iter().filter(|light| !is_far(&light.kind));
    lamps.extend(near.take(LAMPS).map(|light| [light.position; 3]));
    let sky = scene.environment.is_some() || scene.punctual.iter().any(|light| is_far(&light.kind));
    View { camera: scene.cameras.first().cloned(), lamps, sky }
}

/// Corners of the triangles that shine; those that are sampled lie in the world mesh.
fn emissive(scene: &Scene, geometry: &Geometry) -> Vec<[Vec3; 3]> {
    let shines: Vec<bool> = scene.materials.iter().map(|material| material.is_emissive()).collect();
    let Some(mesh) = geometry.meshes.first().filter(|_| shines.contains(&true)) else { return Vec::new() };
    let first = mesh.first_triangle as usize;
    let records = &geometry.triangles[first..first + mesh.indices.len()];
    let shining = records.iter().filter(|triangle| shines[triangle.material as usize]);
    shining
        .map(|triangle| {
            let [v0, e1, e2] = [triangle.v0, triangle.e1, triangle.e2].map(Vec3::from);
            [v0, v0 + e1, v0 + e2]
        })
        .collect()
}
