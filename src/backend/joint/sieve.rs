//! The rays of a batch that come near a volume, packed into blocks of their own.

use bytemuck::{cast_mut, cast_ref};

use super::volumes::Volumes;
use crate::backend::batch::{LANES, RayBlock, RayHitBlock, valid_lanes};
use crate::math::isa::Widened;
use crate::math::isa::moves::Moves;

/// A block with rays in it.
pub(super) trait HasRays: Copy {
    /// Nothing but misses.
    const EMPTY: Self;
    fn rays(&self) -> &RayBlock;
    fn rays_mut(&mut self) -> &mut RayBlock;
}

impl HasRays for RayBlock {
    const EMPTY: Self = RayBlock::EMPTY;

    #[inline(always)]
    fn rays(&self) -> &RayBlock {
        self
    }

    #[inline(always)]
    fn rays_mut(&mut self) -> &mut RayBlock {
        self
    }
}

impl HasRays for RayHitBlock {
    const EMPTY: Self = RayHitBlock::EMPTY;

    #[inline(always)]
    fn rays(&self) -> &RayBlock {
        &self.ray
    }

    #[inline(always)]
    fn rays_mut(&mut self) -> &mut RayBlock {
        &mut self.ray
    }
}

/// The rays that went through. A thread keeps it from batch to batch.
pub(super) struct Packed<B> {
    /// Blocks without gaps; more than are used.
    pub blocks: Vec<B>,
    /// Where each ray stands in the batch.
    from: Vec<[u32; LANES]>,
    /// Number of rays.
    pub len: usize,
}

impl<B: HasRays> Packed<B> {
    pub const fn new() -> Self {
        Packed { blocks: Vec::new(), from: Vec::new(), len: 0 }
    }

    /// Place in the batch of each packed ray, ascending.
    pub fn places(&self) -> impl Iterator<Item = usize> {
        self.from.as_flattened()[..self.len].iter().map(|&from| from as usize)
    }

    /// Makes room for `blocks` blocks and one that a move may touch.
    fn reserve(&mut self, blocks: usize) {
        if self.blocks.len() <= blocks {
            self.blocks.resize(blocks + 1, B::EMPTY);
            self.from.resize(blocks + 1, [0; LANES]);
        }
    }

    /// Appends the rays of `keep`, the first of which would have place `first`.
    #[inline(always)]
    fn append<M: Moves>(&mut self, ray: &RayBlock, keep: u16, first: u32) {
        let (block, at) = (self.len / LANES, self.len % LANES);
        let [here, after] = &mut self.blocks[block..block + 2] else { unreachable!("two blocks") };
        let (here, after) = (here.rays_mut(), after.rays_mut());
        let squeeze = |from: &[f32; LANES], here: &mut [f32; LANES], after: &mut [f32; LANES]| {
            M::squeeze(cast_ref(from), keep, at, cast_mut(here), cast_mut(after));
        };
        squeeze(&ray.org_x, &mut here.org_x, &mut after.org_x);
        squeeze(&ray.org_y, &mut here.org_y, &mut after.org_y);
        squeeze(&ray.org_z, &mut here.org_z, &mut after.org_z);
        squeeze(&ray.tnear, &mut here.tnear, &mut after.tnear);
        squeeze(&ray.dir_x, &mut here.dir_x, &mut after.dir_x);
        squeeze(&ray.dir_y, &mut here.dir_y, &mut after.dir_y);
        squeeze(&ray.dir_z, &mut here.dir_z, &mut after.dir_z);
        squeeze(&ray.time, &mut here.time, &mut after.time);
        squeeze(&ray.tfar, &mut here.tfar, &mut after.tfar);
        let [here, after] = &mut self.from[block..block + 2] else { unreachable!("two blocks") };
        M::squeeze(&std::array::from_fn(|i| first + i as u32), keep, at, here, after);
        self.len += keep.count_ones() as usize;
    }
}

/// Packs the first `len` rays of `blocks` that come near a volume.
pub(super) struct Sieve<'a, B> {
    pub volumes: &'a Volumes,
    pub blocks: &'a [B],
    pub len: usize,
    pub packed: &'a mut Packed<B>,
}

impl<B: HasRays> Widened for Sieve<'_, B> {
    type Output = ();

    #[inline(always)]
    fn run<M: Moves>(self) {
        let Sieve { volumes, blocks, len, packed } = self;
        packed.len = 0;
        packed.reserve(blocks.len());
        for (index, block) in blocks.iter().enumerate() {
            let ray = block.rays();
            let valid = valid_lanes(ray, (len - index * LANES).min(LANES));
            packed.append::<M>(ray, volumes.near(ray, valid), (index * LANES) as u32);
        }
    }
}
