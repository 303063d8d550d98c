//! Whole batches a call: Embree 3's streams, a loop over packets on Embree 4, which has none.
//!
//! A stream has no lane mask, so only runs of blocks whose sixteen rays are all valid go into one; the other blocks (the
//! tail, those with an invalid ray) are traced as packets between the runs.

use super::abi::{self, HAS_STREAMS, Query};
use super::packet::{any_block, closest_block, lanes_of};
use super::scene::World;
use crate::backend::batch::{RayBlock, RayHitBlock};

/// What runs when a stream is asked for, as the reports spell it.
pub(super) const EFFECTIVE: &str = if HAS_STREAMS { "stream" } else { "packet-loop" };

/// Closest hits.
pub(super) fn closest(world: &World, blocks: &mut [RayHitBlock], len: usize, query: &mut Query) -> u64 {
    let (mut invalid, mut run) = (0, 0);
    for index in 0..blocks.len() {
        let lanes = lanes_of(index, len);
        let valid = world.valid_lanes(&blocks[index].ray, lanes);
        invalid += lanes as u64 - u64::from(valid.count_ones());
        blocks[index].clear_hits();
        if valid != u16::MAX {
            closest_run(world, &mut blocks[run..index], query);
            closest_block(world, &mut blocks[index], valid, query);
            run = index + 1;
        }
    }
    closest_run(world, &mut blocks[run..], query);
    invalid
}

/// Blocks without a gap, hits cleared.
fn closest_run(world: &World, blocks: &mut [RayHitBlock], query: &mut Query) {
    if !blocks.is_empty() {
        // SAFETY: the world's scene is committed and lives as long as `world`; all lanes of these blocks are valid.
        unsafe { abi::intersect_stream(world.raw(), blocks, query) };
        blocks.iter_mut().for_each(|block| world.name_instances(block));
    }
}

/// Any hits.
pub(super) fn any(world: &World, blocks: &mut [RayBlock], len: usize, query: &mut Query) -> u64 {
    let (mut invalid, mut run) = (0, 0);
    for index in 0..blocks.len() {
        let lanes = lanes_of(index, len);
        let valid = world.valid_lanes(&blocks[index], lanes);
        invalid += lanes as u64 - u64::from(valid.count_ones());
        if valid != u16::MAX {
            any_run(world, &mut blocks[run..index], query);
            any_block(world, &mut blocks[index], valid, query);
            run = index + 1;
        }
    }
    any_run(world, &mut blocks[run..], query);
    invalid
}

/// Blocks without a gap.
fn any_run(world: &World, blocks: &mut [RayBlock], query: &mut Query) {
    if !blocks.is_empty() {
        // SAFETY: the world's scene is committed and lives as long as `world`; all lanes of these blocks are valid.
        unsafe { abi::occluded_stream(world.raw(), blocks, query) };
    }
}
