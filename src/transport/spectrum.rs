//! Wavelengths of paths that meet dispersive solids. A path has one from its first such vertex on; its number is
//! addressed, so that nothing but whether it counts already has to be kept. Scenes without such solids have none.

use super::vertices::Vertices;
use super::wave::PathBlock;
use super::world::World;
use crate::backend::batch::LANES;
use crate::math::columns::{Lane, get, set};
use crate::shading::dispersion;

/// Gives the lanes that are at a dispersive solid their wavelength, by the numbers `u`, and weighs those that had none
/// so far. `split` says which paths have one, by camera sample.
#[inline(never)]
pub fn arrive(world: &World, vertices: &mut Vertices, paths: &PathBlock, u: &Lane, split: &mut [bool]) {
    for i in (0..LANES).filter(|&i| vertices.active[i] != 0) {
        if world.scene.materials[vertices.material[i] as usize].disperses() {
            vertices.wavelength_nm[i] = dispersion::wavelength_nm(u[i]);
            if !std::mem::replace(&mut split[paths.slot[i] as usize], true) {
                let beta = get(&vertices.beta, i) * dispersion::weight(vertices.wavelength_nm[i]);
                set(&mut vertices.beta, i, beta);
            }
        }
    }
}
