//! The columns of one wave: paths in flight, their rays, their shadow rays, and what the camera samples have gathered.
//!
//! Blocks of 16 lanes everywhere, so that the ray columns are Embree's packets as they stand. A path keeps its `slot`
//! (its camera sample) for life; its position among the lanes changes as ended paths are squeezed out.

use bytemuck::{cast_mut, cast_ref};
use glam::Vec3;

use super::alpha::Passing;
use super::capped::Capped;
use super::columns::{Lane, Lane3};
use super::footprint::Cone;
use super::isa::Isa;
use super::queue::{KINDS, Kind};
use crate::backend::batch::{LANES, RayBlock, RayHitBlock};
use crate::film::lengths::LENGTHS;

/// No solid dielectric around a path.
pub const NO_MEDIUM: u32 = u32::MAX;

/// What a path carries besides its ray, 16 lanes.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
pub struct PathBlock {
    /// Throughput f/p so far, by channel.
    pub beta: [[f32; LANES]; 3],
    /// Product of η² over the refractions so far; roulette takes it out of the throughput.
    pub eta_scale: [f32; LANES],
    /// Pdf (sr⁻¹) with which the last BSDF sample chose `ray.dir`; read by emission MIS. Infinite after a mirror and on
    /// camera rays.
    pub last_pdf_sa: [f32; LANES],
    /// Normal with which the last vertex sampled lights (0 on transmissive surfaces); read by emission MIS.
    pub last_n: [[f32; LANES]; 3],
    /// Camera sample of this path within the wave.
    pub slot: [u32; LANES],
    /// Low word of the sampler's pixel seed.
    pub seed_lo: [u32; LANES],
    /// High word of the sampler's pixel seed.
    pub seed_hi: [u32; LANES],
    /// Sample index within the pixel's half.
    pub index: [u32; LANES],
    /// Material of the solid dielectric that the ray runs in, or [`NO_MEDIUM`]; read by absorption.
    pub medium: [u32; LANES],
}

/// One path as plain numbers.
#[derive(Clone, Copy)]
pub struct PathLane {
    /// See [`PathBlock::beta`].
    pub beta: Vec3,
    /// See [`PathBlock::eta_scale`].
    pub eta_scale: f32,
    /// See [`PathBlock::last_pdf_sa`].
    pub last_pdf_sa: f32,
    /// See [`PathBlock::last_n`].
    pub last_n: Vec3,
    /// See [`PathBlock::slot`].
    pub slot: u32,
    /// Both words of the pixel seed.
    pub seed: [u32; 2],
    /// See [`PathBlock::index`].
    pub index: u32,
    /// See [`PathBlock::medium`].
    pub medium: u32,
}

impl PathBlock {
    /// Sixteen paths of nothing.
    pub const EMPTY: PathBlock = PathBlock {
        beta: [[0.0; LANES]; 3],
        eta_scale: [1.0; LANES],
        last_pdf_sa: [0.0; LANES],
        last_n: [[0.0; LANES]; 3],
        slot: [0; LANES],
        seed_lo: [0; LANES],
        seed_hi: [0; LANES],
        index: [0; LANES],
        medium: [NO_MEDIUM; LANES],
    };

    /// Gathers one lane.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> PathLane {
        PathLane {
            beta: Vec3::new(self.beta[0][lane], self.beta[1][lane], self.beta[2][lane]),
            eta_scale: self.eta_scale[lane],
            last_pdf_sa: self.last_pdf_sa[lane],
            last_n: Vec3::new(self.last_n[0][lane], self.last_n[1][lane], self.last_n[2][lane]),
            slot: self.slot[lane],
            seed: [self.seed_lo[lane], self.seed_hi[lane]],
            index: self.index[lane],
            medium: self.medium[lane],
        }
    }

    /// Scatters one lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, path: &PathLane) {
        for c in 0..3 {
            self.beta[c][lane] = path.beta[c];
            self.last_n[c][lane] = path.last_n[c];
        }
        self.eta_scale[lane] = path.eta_scale;
        self.last_pdf_sa[lane] = path.last_pdf_sa;
        self.slot[lane] = path.slot;
        self.seed_lo[lane] = path.seed[0];
        self.seed_hi[lane] = path.seed[1];
        self.index[lane] = path.index;
        self.medium[lane] = path.medium;
    }
}

/// What an unblocked shadow ray adds, 16 lanes.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
pub struct ShadowBlock {
    /// Radiance to add, by channel.
    pub radiance: [[f32; LANES]; 3],
    /// Camera sample it belongs to.
    pub slot: [u32; LANES],
}

impl ShadowBlock {
    const EMPTY: ShadowBlock = ShadowBlock { radiance: [[0.0; LANES]; 3], slot: [0; LANES] };
}

/// Paths with their rays, in lanes `0..len`.
pub struct Paths {
    /// Rays and, after tracing, hits.
    pub rays: Vec<RayHitBlock>,
    /// The rest of the path state.
    pub paths: Vec<PathBlock>,
    /// Lanes in use.
    pub len: usize,
}

impl Paths {
    fn new(capacity: usize) -> Self {
        // `append` writes whole blocks, the one behind the last as well.
        let blocks = capacity / LANES + 2;
        Paths { rays: vec![RayHitBlock::EMPTY; blocks], paths: vec![PathBlock::EMPTY; blocks], len: 0 }
    }

    /// Appends the lanes that `keep` marks. `old` is where they come from; what is the same for all lanes or not called
    /// for is not moved (`features` of the plan say what is).
    #[inline(always)]
    pub fn append<I: Isa>(&mut self, from: &Survivors, old: &PathBlock, keep: u16, carried: Carried) {
        let (block, at) = (self.len / LANES, self.len % LANES);
        let ([here, after, ..], [path, path_after, ..]) = (&mut self.rays[block..], &mut self.paths[block..]) else {
            unreachable!("a wave has a block more than it fills");
        };
        let squeeze = |from: &Lane, here: &mut Lane, after: &mut Lane| {
            I::squeeze(cast_ref(from), keep, at, cast_mut(here), cast_mut(after));
        };
        squeeze(&from.org[0], &mut here.ray.org_x, &mut after.ray.org_x);
        squeeze(&from.org[1], &mut here.ray.org_y, &mut after.ray.org_y);
        squeeze(&from.org[2], &mut here.ray.org_z, &mut after.ray.org_z);
        squeeze(&from.dir[0], &mut here.ray.dir_x, &mut after.ray.dir_x);
        squeeze(&from.dir[1], &mut here.ray.dir_y, &mut after.ray.dir_y);
        squeeze(&from.dir[2], &mut here.ray.dir_z, &mut after.ray.dir_z);
        // Lanes that are overwritten later may have any end.
        here.ray.tfar[at..].fill(f32::INFINITY);
        after.ray.tfar = [f32::INFINITY; LANES];
        for c in 0..3 {
            squeeze(&from.beta[c], &mut path.beta[c], &mut path_after.beta[c]);
        }
        squeeze(&from.last_pdf_sa, &mut path.last_pdf_sa, &mut path_after.last_pdf_sa);
        if carried.normal {
            for c in 0..3 {
                squeeze(&from.last_n[c], &mut path.last_n[c], &mut path_after.last_n[c]);
            }
        }
        if carried.medium {
            squeeze(&from.eta_scale, &mut path.eta_scale, &mut path_after.eta_scale);
        }
        let squeeze = |from: &[u32; LANES], here: &mut [u32; LANES], after: &mut [u32; LANES]| {
            I::squeeze(from, keep, at, here, after);
        };
        squeeze(&old.slot, &mut path.slot, &mut path_after.slot);
        squeeze(&old.seed_lo, &mut path.seed_lo, &mut path_after.seed_lo);
        squeeze(&old.seed_hi, &mut path.seed_hi, &mut path_after.seed_hi);
        squeeze(&old.index, &mut path.index, &mut path_after.index);
        if carried.medium {
            squeeze(&from.medium, &mut path.medium, &mut path_after.medium);
        }
        self.len += keep.count_ones() as usize;
    }

    /// Blocks in use.
    pub fn blocks(&self) -> usize {
        self.len.div_ceil(LANES)
    }
}

/// What a path has to carry besides the columns that all need; the plan knows. A column that is not carried keeps the
/// value of a fresh path in every lane.
#[derive(Clone, Copy, Debug)]
pub struct Carried {
    /// `last_n`: the choice of a light depends on the receiver.
    pub normal: bool,
    /// `eta_scale` and `medium`: something transmits.
    pub medium: bool,
}

/// Sixteen scattered paths, what changed of them: columns for [`Paths::append`].
#[repr(C, align(64))]
pub struct Survivors {
    /// Origins of the next rays.
    pub org: Lane3,
    /// Their unit directions.
    pub dir: Lane3,
    /// See [`PathBlock::beta`].
    pub beta: Lane3,
    /// See [`PathBlock::last_pdf_sa`].
    pub last_pdf_sa: Lane,
    /// See [`PathBlock::last_n`].
    pub last_n: Lane3,
    /// See [`PathBlock::eta_scale`].
    pub eta_scale: Lane,
    /// See [`PathBlock::medium`].
    pub medium: [u32; LANES],
}

/// Shadow rays with what they carry, in lanes `0..len`.
pub struct Shadows {
    /// The rays.
    pub rays: Vec<RayBlock>,
    /// What they add if unblocked.
    pub carried: Vec<ShadowBlock>,
    /// Lanes in use.
    pub len: usize,
}

impl Shadows {
    /// Appends the lanes that `keep` marks, as [`Paths::append`] does.
    #[inline(always)]
    pub fn append<I: Isa>(&mut self, from: &ShadowLanes, slot: &[u32; LANES], keep: u16) {
        let (block, at) = (self.len / LANES, self.len % LANES);
        let ([here, after, ..], [carried, carried_after, ..]) = (&mut self.rays[block..], &mut self.carried[block..])
        else {
            unreachable!("a wave has a block more than it fills");
        };
        let squeeze = |from: &Lane, here: &mut Lane, after: &mut Lane| {
            I::squeeze(cast_ref(from), keep, at, cast_mut(here), cast_mut(after));
        };
        squeeze(&from.org[0], &mut here.org_x, &mut after.org_x);
        squeeze(&from.org[1], &mut here.org_y, &mut after.org_y);
        squeeze(&from.org[2], &mut here.org_z, &mut after.org_z);
        squeeze(&from.dir[0], &mut here.dir_x, &mut after.dir_x);
        squeeze(&from.dir[1], &mut here.dir_y, &mut after.dir_y);
        squeeze(&from.dir[2], &mut here.dir_z, &mut after.dir_z);
        squeeze(&from.tfar, &mut here.tfar, &mut after.tfar);
        for c in 0..3 {
            squeeze(&from.radiance[c], &mut carried.radiance[c], &mut carried_after.radiance[c]);
        }
        I::squeeze(slot, keep, at, &mut carried.slot, &mut carried_after.slot);
        self.len += keep.count_ones() as usize;
    }

    /// Blocks in use.
    pub fn blocks(&self) -> usize {
        self.len.div_ceil(LANES)
    }
}

/// Sixteen shadow rays and what they carry: columns for [`Shadows::append`].
#[repr(C, align(64))]
pub struct ShadowLanes {
    /// Origins.
    pub org: Lane3,
    /// Unit directions.
    pub dir: Lane3,
    /// Lengths, metres.
    pub tfar: Lane,
    /// What an unblocked ray adds.
    pub radiance: Lane3,
}

/// What one camera sample has gathered.
#[derive(Clone, Copy, Default)]
pub struct Gathered {
    /// Radiance, by channel.
    pub radiance: [f32; 3],
    /// 1 where the camera ray met a surface or a visible environment.
    pub coverage: f32,
    /// Signed weight of the pixel filter.
    pub weight: f32,
}

/// Everything one worker advances together. Allocated once a worker, never grown.
pub struct Wave {
    /// Paths of this edge.
    pub current: Paths,
    /// Survivors, for the next edge.
    pub next: Paths,
    /// Shadow rays of this edge.
    pub shadows: Shadows,
    /// Lanes of `current` that hit a surface to be shaded, by kind of material.
    pub queues: [Vec<u32>; KINDS],
    /// Lanes of each block of `current` that are shaded where they lie, and their kind.
    pub dense: Vec<(Kind, u16)>,
    /// Rays that go on behind surfaces which they pass; empty where no surface lets any pass.
    pub passing: Passing,
    /// What the camera samples have gathered.
    pub sums: Sums,
    /// Widths of the paths, by camera sample; empty unless textures are averaged over them.
    pub cones: Vec<Cone>,
    /// Times of the paths, fractions of the shutter, by camera sample; empty unless something moves.
    pub times: Vec<f32>,
}

/// Where radiance goes.
pub struct Sums {
    /// One entry a camera sample.
    pub gathered: Vec<Gathered>,
    /// Radiance by camera sample and number of edges; empty unless asked for.
    pub per_length: Vec<[[f32; 3]; LENGTHS]>,
    /// What the paths that the depth limit ended could still have carried.
    pub capped: Capped,
}

impl Wave {
    /// Columns for `capacity` paths; `per_length` adds one accumulator per path length to each sample.
    pub fn new(capacity: usize, per_length: bool) -> Self {
        let blocks = capacity / LANES + 2;
        Wave {
            current: Paths::new(capacity),
            next: Paths::new(capacity),
            shadows: Shadows { rays: vec![RayBlock::EMPTY; blocks], carried: vec![ShadowBlock::EMPTY; blocks], len: 0 },
            queues: std::array::from_fn(|_| Vec::with_capacity(capacity)),
            dense: vec![(Kind::Lambert, 0); blocks],
            passing: Passing::default(),
            sums: Sums {
                gathered: vec![Gathered::default(); capacity],
                per_length: if per_length { vec![[[0.0; 3]; LENGTHS]; capacity] } else { Vec::new() },
                capped: Capped::default(),
            },
            cones: Vec::new(),
            times: Vec::new(),
        }
    }

    /// Paths that fit.
    pub fn capacity(&self) -> usize {
        self.sums.gathered.len()
    }

    /// See [`Sums::add`].
    #[inline(always)]
    pub fn add(&mut self, slot: u32, edge: u32, radiance: Vec3) {
        self.sums.add(slot, edge, radiance);
    }
}

impl Sums {
    /// Adds radiance to a camera sample, and to the image of paths with `edge` edges if those are kept.
    #[inline(always)]
    pub fn add(&mut self, slot: u32, edge: u32, radiance: Vec3) {
        let sum = &mut self.gathered[slot as usize].radiance;
        for c in 0..3 {
            sum[c] += radiance[c];
        }
        if let Some(terms) = self.per_length.get_mut(slot as usize) {
            let term = &mut terms[(edge as usize).min(LENGTHS - 1)];
            for c in 0..3 {
                term[c] += radiance[c];
            }
        }
    }
}
