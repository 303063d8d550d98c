//! Where radiance begins, as far as layers tell lights apart. Asked only where a layer does.
//!
//! Limit: two halves of a parallelogram on different nodes are one light (`shading/light/area.rs`), of the group of the
//! first.

use super::parts::Origin;
use super::world::World;
use crate::backend::batch::{LANES, RayHitBlock};
use crate::math::columns::{Lane, Mask};

/// Of an emissive or unlit surface that the path in lane `i` meets; `light` is its number, if it has one.
#[inline(never)]
pub fn of_surface(world: &World, rays: &RayHitBlock, i: usize, light: u32) -> Origin {
    if !world.features.light_groups {
        return Origin::default();
    }
    match world.lights.triangle(light) {
        Some(_) => of_light(world, light),
        None => {
            let owner = world.geometry.owners.of(rays.hit.inst[i], rays.hit.prim[i]);
            Origin { group: world.groups.of_instance(owner), first: None }
        }
    }
}

/// Of the environment.
pub fn of_environment(world: &World) -> Origin {
    Origin { group: world.groups.of_environment(), first: None }
}

/// Of the light of that number.
fn of_light(world: &World, light: u32) -> Origin {
    let first_punctual = world.lights.areas().len();
    let group = match (world.lights.triangle(light), (light as usize).checked_sub(first_punctual)) {
        (Some(triangle), _) => world.groups.of_instance(world.geometry.owners.of(u32::MAX, triangle)),
        (None, Some(index)) if index < world.lights.counts().punctual => world.groups.of_punctual(index),
        _ => world.groups.of_environment(),
    };
    Origin { group, first: None }
}

/// Of a sample of the light of that number.
#[inline(never)]
pub fn of_sample(world: &World, light: u32) -> Origin {
    if world.features.light_groups { of_light(world, light) } else { Origin::default() }
}

/// The same for the lanes of `lit`, whose samples have these densities; those of density 0 are none.
#[inline(never)]
pub fn of_samples(world: &World, lit: &Mask, (light, pdf_sa): (&[u32; LANES], &Lane)) -> [Origin; LANES] {
    std::array::from_fn(|i| match lit[i] != 0 && pdf_sa[i] > 0.0 {
        true => of_sample(world, light[i]),
        false => Origin::default(),
    })
}
