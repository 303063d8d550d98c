//! Packets of 1, 4, 8 and 16 rays. Sixteen are traced where they lie; narrower ones are copied out of their block and
//! the hits back into it. Only lanes that [`World::valid_lanes`] accepts reach Embree.

use super::abi::{self, Hits, Lanes, Query, RayHits, Rays, sys};
use super::scene::World;
use crate::backend::batch::{BLOCKED, INVALID_ID, LANES, RayBlock, RayHitBlock};

/// Lanes of each block of a batch that hold its first `len` rays.
#[inline(always)]
pub(super) fn lanes_of(block: usize, len: usize) -> usize {
    (len - block * LANES).min(LANES)
}

/// The lanes of a bit mask.
#[inline(always)]
pub(super) fn active(mask: u16) -> impl Iterator<Item = usize> {
    (0..LANES).filter(move |lane| (mask >> lane) & 1 != 0)
}

/// Closest hits, 16 at a time, in place.
pub(super) fn closest16(world: &World, blocks: &mut [RayHitBlock], len: usize, query: &mut Query) -> u64 {
    let mut invalid = 0;
    for (index, block) in blocks.iter_mut().enumerate() {
        let lanes = lanes_of(index, len);
        let valid = world.valid_lanes(&mut block.ray, lanes);
        invalid += lanes as u64 - u64::from(valid.count_ones());
        block.clear_hits();
        closest_block(world, block, valid, query);
    }
    invalid
}

/// One block of `closest16`; its hits are cleared.
#[inline(always)]
pub(super) fn closest_block(world: &World, block: &mut RayHitBlock, valid: u16, query: &mut Query) {
    if valid != 0 {
        // SAFETY: the world's scene is committed and lives as long as `world`; the active lanes are valid.
        unsafe { abi::intersect16(world.raw(), &Lanes::from_bits(valid), block, query) };
        world.name_instances(block);
    }
}

/// Any hits, 16 at a time, in place: Embree writes −∞, which is [`BLOCKED`], and leaves inactive lanes alone.
pub(super) fn any16(world: &World, blocks: &mut [RayBlock], len: usize, query: &mut Query) -> u64 {
    let mut invalid = 0;
    for (index, block) in blocks.iter_mut().enumerate() {
        let lanes = lanes_of(index, len);
        let valid = world.valid_lanes(block, lanes);
        invalid += lanes as u64 - u64::from(valid.count_ones());
        if valid != 0 {
            // SAFETY: the world's scene is committed and lives as long as `world`; the active lanes are valid.
            unsafe { abi::occluded16(world.raw(), &Lanes::from_bits(valid), block, query) };
        }
    }
    invalid
}

/// Closest hits in packets of `N`, each traced by `trace`.
pub(super) fn closest_narrow<const N: usize>(
    world: &World,
    blocks: &mut [RayHitBlock],
    len: usize,
    mut trace: impl FnMut(&Lanes, &mut RayHits<N>),
) -> u64 {
    let mut invalid = 0;
    for (index, block) in blocks.iter_mut().enumerate() {
        let lanes = lanes_of(index, len);
        let valid = world.valid_lanes(&mut block.ray, lanes);
        invalid += lanes as u64 - u64::from(valid.count_ones());
        block.clear_hits();
        for first in (0..LANES).step_by(N) {
            let mask = (valid >> first) & Rays::<N>::ALL;
            if mask != 0 {
                let mut packet = RayHits { ray: Rays::gather(&block.ray, first), hit: Hits::NONE };
                trace(&Lanes::from_bits(mask), &mut packet);
                packet.scatter(block, first, mask);
            }
        }
        world.name_instances(block);
    }
    invalid
}

/// Any hits in packets of `N`, each traced by `trace`.
pub(super) fn any_narrow<const N: usize>(
    world: &World,
    blocks: &mut [RayBlock],
    len: usize,
    mut trace: impl FnMut(&Lanes, &mut Rays<N>),
) -> u64 {
    let mut invalid = 0;
    for (index, block) in blocks.iter_mut().enumerate() {
        let lanes = lanes_of(index, len);
        let valid = world.valid_lanes(block, lanes);
        invalid += lanes as u64 - u64::from(valid.count_ones());
        for first in (0..LANES).step_by(N) {
            let mask = (valid >> first) & Rays::<N>::ALL;
            if mask != 0 {
                let mut packet = Rays::gather(block, first);
                trace(&Lanes::from_bits(mask), &mut packet);
                // An active ray had tfar ≥ 0, so a negative one is Embree's answer.
                for lane in active(mask) {
                    if packet.tfar[lane] < 0.0 {
                        block.tfar[first + lane] = BLOCKED;
                    }
                }
            }
        }
    }
    invalid
}

/// Closest hits, one ray a call.
pub(super) fn closest1(world: &World, blocks: &mut [RayHitBlock], len: usize, query: &mut Query) -> u64 {
    let mut invalid = 0;
    for (index, block) in blocks.iter_mut().enumerate() {
        let lanes = lanes_of(index, len);
        let valid = world.valid_lanes(&mut block.ray, lanes);
        invalid += lanes as u64 - u64::from(valid.count_ones());
        block.clear_hits();
        for lane in active(valid) {
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
        world.name_instances(block);
    }
    invalid
}

/// Any hits, one ray a call.
pub(super) fn any1(world: &World, blocks: &mut [RayBlock], len: usize, query: &mut Query) -> u64 {
    let mut invalid = 0;
    for (index, block) in blocks.iter_mut().enumerate() {
        let lanes = lanes_of(index, len);
        let valid = world.valid_lanes(block, lanes);
        invalid += lanes as u64 - u64::from(valid.count_ones());
        for lane in active(valid) {
            let mut one = single(block, lane);
            // SAFETY: the world's scene is committed and lives as long as `world`; the lane is valid.
            unsafe { abi::occluded1(world.raw(), &mut one, query) };
            if one.tfar < 0.0 {
                block.tfar[lane] = BLOCKED;
            }
        }
    }
    invalid
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
        for lane in active(mask) {
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
