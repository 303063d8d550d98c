//! Hits on an edge, traced again one by one.
//!
//! At an edge that two triangles share both report a hit (ROBUST: weights from −2⁻²³ on count), often at the same
//! distance; the one that is tested first stays. A packet visits the hierarchy in an order that all its rays have a
//! part in, so which of the two a ray meets depended on its neighbours, and with them on how samples are divided into
//! passes: 30 of 286 renders of adjacent quads differed by one sample (3.13.5, packets of 4, 8, 16). A single ray
//! depends on itself alone. So a hit with a weight below [`EDGE`] is traced again as one.
//!
//! Limits: triangles that share an edge and differ in area by more than 2⁹, as the ray sees them, may both report a
//! hit that is not this near to the edge of the smaller one; coincident faces are not looked for.

use super::abi::Query;
use super::grazing::Ends;
use super::packet;
use super::scene::World;
use crate::backend::batch::{INVALID_ID, LANES, RayHitBlock};
use crate::math::lanes::lanes_of;

/// Weight of a corner below which a hit lies on the edge opposite to it. One in 5000 rays is traced again.
const EDGE: f32 = 1.0 / (1 << 14) as f32;

/// Mends the hits of traced blocks, in which instances have their numbers already.
#[inline(always)]
pub(super) fn mend(world: &World, blocks: &mut [RayHitBlock], ends: &Ends, query: &mut Query) {
    for (index, block) in blocks.iter_mut().enumerate() {
        let hit = &block.hit;
        let mut near = [0u32; LANES];
        for i in 0..LANES {
            let least = hit.u[i].min(hit.v[i]).min(1.0 - hit.u[i] - hit.v[i]);
            near[i] = u32::from((hit.geom[i] != INVALID_ID) & (least < EDGE));
        }
        let mask = near.iter().enumerate().fold(0u16, |mask, (lane, &bit)| mask | (bit as u16) << lane);
        if mask != 0 {
            again(world, block, mask, (index, ends), query);
        }
    }
}

/// Traces the lanes of `mask` again, each alone.
#[cold]
fn again(world: &World, block: &mut RayHitBlock, mask: u16, (index, ends): (usize, &Ends), query: &mut Query) {
    for lane in lanes_of(mask) {
        block.ray.tfar[lane] = ends.get(index * LANES + lane);
        (block.hit.geom[lane], block.hit.inst[lane]) = (INVALID_ID, INVALID_ID);
    }
    packet::closest1(world, block, mask, query);
    for lane in lanes_of(mask) {
        world.name_hit(block, lane);
    }
}
