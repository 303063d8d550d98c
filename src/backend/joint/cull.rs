//! Culling: the faces first, then the rays that still come near a volume, packed into blocks without gaps.

use bytemuck::{cast_mut, cast_ref};

use super::volumes::Volumes;
use crate::backend::batch::{Batch, Block, LANES, RayBlock};
use crate::backend::flat::{Faces, Meets};
use crate::backend::past::Without;
use crate::math::simd::isa::{Isa, Kernel};

/// The rays that were not culled. A thread keeps it from batch to batch.
pub(super) struct Packed<B> {
    /// Blocks without gaps; more than are used.
    pub blocks: Vec<B>,
    /// Where each ray stands in the batch.
    from: Vec<[u32; LANES]>,
    /// Number of rays.
    pub len: usize,
    /// Room for what they have passed.
    pub passed: Vec<u32>,
}

impl<B: Block> Packed<B> {
    pub const fn new() -> Self {
        Packed { blocks: Vec::new(), from: Vec::new(), len: 0, passed: Vec::new() }
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
    fn append<I: Isa>(&mut self, ray: &RayBlock, keep: u16, first: u32) {
        let (block, at) = (self.len / LANES, self.len % LANES);
        let [here, after] = &mut self.blocks[block..block + 2] else { unreachable!("two blocks") };
        let (here, after) = (here.rays_mut(), after.rays_mut());
        let squeeze = |from: &[f32; LANES], here: &mut [f32; LANES], after: &mut [f32; LANES]| {
            I::squeeze(cast_ref(from), keep, at, cast_mut(here), cast_mut(after));
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
        I::squeeze(&std::array::from_fn(|i| first + i as u32), keep, at, here, after);
        self.len += keep.count_ones() as usize;
    }
}

/// Traces the rays of a batch against the faces, and packs those that still come near a volume; the number of invalid
/// rays. Where a face blocks a ray, its segment ends at −∞, before every volume.
pub(super) struct Cull<'a, B, W> {
    pub faces: &'a Faces,
    pub volumes: &'a Volumes,
    pub batch: Batch<'a, B>,
    pub packed: &'a mut Packed<B>,
    pub without: W,
}

impl<B: Meets, W: Without> Kernel for Cull<'_, B, W> {
    type Output = u64;

    #[inline(always)]
    fn run<I: Isa>(self) -> u64 {
        let Cull { faces, volumes, mut batch, packed, without } = self;
        packed.len = 0;
        packed.reserve(batch.blocks.len());
        while let Some((index, block, valid)) = batch.next_block() {
            block.meet::<I>(faces, valid, (index * LANES, without));
            let near = volumes.near(block.rays(), valid);
            packed.append::<I>(block.rays(), near, (index * LANES) as u32);
        }
        batch.invalid()
    }
}
