//! One block in packets of 1, 4, 8 and 16 rays. Sixteen are traced where they lie; narrower ones are copied out of the
//! block and their hits back into it. The lanes of `valid` alone reach Embree; they hold rays that it takes.

use super::abi::{self, Hits, Lanes, Query, RayHits, Rays, sys};
use super::grazing;
use super::scene::World;
use crate::backend::batch::{BLOCKED, Batch, INVALID_ID, LANES, RayBlock, RayHitBlock};
use crate::backend::past::{PastLanes, Without};
use crate::math::lanes::lanes_of;

/// Closest hits of sixteen rays, in narrower packets where the processor has none of sixteen.
#[inline(always)]
pub(super) fn closest16(world: &World, block: &mut RayHitBlock, valid: u16, query: &mut Query) {
    if world.width < 16 {
        closest8(world, block, valid, query);
    } else if valid != 0 {
        // SAFETY: the world's scene is committed and lives as long as `world`; the active lanes are valid.
        unsafe { abi::intersect16(world.raw(), &Lanes::from_bits(valid), block, query) };
    }
}

/// Closest hits in packets of eight, of four where the processor has none of eight.
#[inline(always)]
pub(super) fn closest8(world: &World, block: &mut RayHitBlock, valid: u16, query: &mut Query) {
    if world.width < 8 {
        closest4(world, block, valid, query);
    } else {
        // SAFETY: the world's scene is committed and lives as long as `world`; the active lanes are valid.
        closest_narrow::<8>(block, valid, |lanes, rays| unsafe { abi::intersect8(world.raw(), lanes, rays, query) });
    }
}

/// Closest hits in packets of four.
#[inline(always)]
pub(super) fn closest4(world: &World, block: &mut RayHitBlock, valid: u16, query: &mut Query) {
    // SAFETY: the world's scene is committed and lives as long as `world`; the active lanes are valid.
    closest_narrow::<4>(block, valid, |lanes, rays| unsafe { abi::intersect4(world.raw(), lanes, rays, query) });
}

/// Any hits of sixteen rays, as [`closest16`]: Embree writes −∞, which is [`BLOCKED`], and leaves inactive lanes as
/// they are.
#[inline(always)]
pub(super) fn any16(world: &World, block: &mut RayBlock, valid: u16, query: &mut Query) {
    if world.width < 16 {
        any8(world, block, valid, query);
    } else if valid != 0 {
        // SAFETY: the world's scene is committed and lives as long as `world`; the active lanes are valid.
        unsafe { abi::occluded16(world.raw(), &Lanes::from_bits(valid), block, query) };
    }
}

/// Any hits in packets of eight, as [`closest8`].
#[inline(always)]
pub(super) fn any8(world: &World, block: &mut RayBlock, valid: u16, query: &mut Query) {
    if world.width < 8 {
        any4(world, block, valid, query);
    } else {
        // SAFETY: the world's scene is committed and lives as long as `world`; the active lanes are valid.
        any_narrow::<8>(block, valid, |lanes, rays| unsafe { abi::occluded8(world.raw(), lanes, rays, query) });
    }
}

/// Any hits in packets of four.
#[inline(always)]
pub(super) fn any4(world: &World, block: &mut RayBlock, valid: u16, query: &mut Query) {
    // SAFETY: the world's scene is committed and lives as long as `world`; the active lanes are valid.
    any_narrow::<4>(block, valid, |lanes, rays| unsafe { abi::occluded4(world.raw(), lanes, rays, query) });
}

/// The packets of `N` rays of a block that have a ray in them: first lane and mask.
#[inline(always)]
fn packets<const N: usize>(valid: u16) -> impl Iterator<Item = (usize, u16)> {
    (0..LANES).step_by(N).map(move |first| (first, (valid >> first) & Rays::<N>::ALL)).filter(|(_, mask)| *mask != 0)
}

/// Closest hits in packets of `N`, each traced by `trace`.
#[inline(always)]
fn closest_narrow<const N: usize>(block: &mut RayHitBlock, valid: u16, mut trace: impl FnMut(&Lanes, &mut RayHits<N>)) {
    for (first, mask) in packets::<N>(valid) {
        let mut packet = RayHits { ray: Rays::gather(&block.ray, first), hit: Hits::NONE };
        trace(&Lanes::from_bits(mask), &mut packet);
        packet.scatter(block, first, mask);
    }
}

/// Any hits in packets of `N`, each traced by `trace`.
#[inline(always)]
fn any_narrow<const N: usize>(block: &mut RayBlock, valid: u16, mut trace: impl FnMut(&Lanes, &mut Rays<N>)) {
    for (first, mask) in packets::<N>(valid) {
        let mut packet = Rays::gather(block, first);
        trace(&Lanes::from_bits(mask), &mut packet);
        // An active ray had tfar ≥ 0, so a negative one is Embree's answer.
        for lane in lanes_of(mask) {
            if packet.tfar[lane] < 0.0 {
                block.tfar[first + lane] = BLOCKED;
            }
        }
    }
}

/// Closest hits, one ray a call.
#[inline(always)]
pub(super) fn closest1(world: &World, block: &mut RayHitBlock, valid: u16, query: &mut Query) {
    for lane in lanes_of(valid) {
        closest_lane(world, block, lane, query);
    }
}

/// The closest hit of one lane.
#[inline(always)]
fn closest_lane(world: &World, block: &mut RayHitBlock, lane: usize, query: &mut Query) {
    let mut one = sys::RTCRayHit { ray: single(&block.ray, lane), ..Default::default() };
    one.hit.geomID = INVALID_ID;
    one.hit.instID = [INVALID_ID];
    // SAFETY: the world's scene is committed and lives as long as `world`; the lane is valid.
    unsafe { abi::intersect1(world.raw(), &mut one, query) };
    if one.hit.geomID != INVALID_ID {
        block.ray.tfar[lane] = one.ray.tfar;
        block.hit.ng_x[lane] = one.hit.Ng_x;
        block.hit.ng_y[lane] = one.hit.Ng_y;
        block.hit.ng_z[lane] = one.hit.Ng_z;
        block.hit.u[lane] = one.hit.u;
        block.hit.v[lane] = one.hit.v;
        block.hit.prim[lane] = one.hit.primID;
        block.hit.geom[lane] = one.hit.geomID;
        block.hit.inst[lane] = one.hit.instID[0];
    }
}

/// Closest hits, one ray a call, without the triangles that each ray has passed; the number of invalid rays. Whatever
/// the query mode: a packet would ask for the lists of all its rays at every hit.
pub(super) fn closest_past(world: &World, batch: Batch<RayHitBlock>, past: PastLanes) -> u64 {
    let (mut query, mut first) = (Query::without(), 0);
    batch.for_each(|block, valid| {
        World::settle(&mut block.ray);
        for lane in lanes_of(valid) {
            let end = block.ray.tfar[lane];
            query.pass(past.of(first + lane));
            closest_lane(world, block, lane, &mut query);
            grazing::mend_one(world, block, lane, end, &mut query);
        }
        world.name_hits(block);
        first += LANES;
    })
}

/// Any hits, one ray a call.
#[inline(always)]
pub(super) fn any1(world: &World, block: &mut RayBlock, valid: u16, query: &mut Query) {
    for lane in lanes_of(valid) {
        let mut one = single(block, lane);
        // SAFETY: the world's scene is committed and lives as long as `world`; the lane is valid.
        unsafe { abi::occluded1(world.raw(), &mut one, query) };
        if one.tfar < 0.0 {
            block.tfar[lane] = BLOCKED;
        }
    }
}

/// One ray of a block, with every bit of the mask set.
#[inline(always)]
pub(super) fn single(block: &RayBlock, lane: usize) -> sys::RTCRay {
    sys::RTCRay {
        org_x: block.org_x[lane],
        org_y: block.org_y[lane],
        org_z: block.org_z[lane],
        tnear: block.tnear[lane],
        dir_x: block.dir_x[lane],
        dir_y: block.dir_y[lane],
        dir_z: block.dir_z[lane],
        time: block.time[lane],
        tfar: block.tfar[lane],
        mask: u32::MAX,
        ..Default::default()
    }
}

impl<const N: usize> Rays<N> {
    /// The mask of a packet with all lanes active.
    const ALL: u16 = ((1u32 << N) - 1) as u16;

    /// The `N` rays of `block` from lane `first` on, with every bit of the mask set.
    #[inline(always)]
    fn gather(block: &RayBlock, first: usize) -> Self {
        let column = |from: &[f32; LANES]| -> [f32; N] { std::array::from_fn(|lane| from[first + lane]) };
        Rays {
            org: [column(&block.org_x), column(&block.org_y), column(&block.org_z)],
            tnear: column(&block.tnear),
            dir: [column(&block.dir_x), column(&block.dir_y), column(&block.dir_z)],
            time: column(&block.time),
            tfar: column(&block.tfar),
            mask: [u32::MAX; N],
            id: [0; N],
            flags: [0; N],
        }
    }
}

impl<const N: usize> Hits<N> {
    /// No hit in any lane.
    const NONE: Self = Hits {
        ng: [[0.0; N]; 3],
        uv: [[0.0; N]; 2],
        prim: [INVALID_ID; N],
        geom: [INVALID_ID; N],
        inst: [INVALID_ID; N],
        inst_prim: [INVALID_ID; N],
    };
}

impl<const N: usize> RayHits<N> {
    /// Writes the hits of the lanes in `mask` into `block` from lane `first` on.
    #[inline(always)]
    fn scatter(&self, block: &mut RayHitBlock, first: usize, mask: u16) {
        for lane in lanes_of(mask) {
            block.ray.tfar[first + lane] = self.ray.tfar[lane];
            block.hit.ng_x[first + lane] = self.hit.ng[0][lane];
            block.hit.ng_y[first + lane] = self.hit.ng[1][lane];
            block.hit.ng_z[first + lane] = self.hit.ng[2][lane];
            block.hit.u[first + lane] = self.hit.uv[0][lane];
            block.hit.v[first + lane] = self.hit.uv[1][lane];
            block.hit.prim[first + lane] = self.hit.prim[lane];
            block.hit.geom[first + lane] = self.hit.geom[lane];
            block.hit.inst[first + lane] = self.hit.inst[lane];
        }
    }
}
