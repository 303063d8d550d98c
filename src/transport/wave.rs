//! The columns of one wave: paths in flight, their rays, their shadow rays, and what the camera samples have gathered.
//!
//! Blocks of 16 lanes everywhere, so that the ray columns are Embree's packets as they stand. A path keeps its `slot`
//! (its camera sample) for life; its position among the lanes changes as ended paths are squeezed out.

use glam::Vec3;

use super::kind::{KINDS, Kind};
use super::log::Log;
use super::parts::{Origin, Parts, Wanted};
use super::passing::{Passing, Pending};
use super::start::Start;
use super::truncation::Truncated;
use crate::backend::batch::{BLOCKED, LANES, RayBlock, RayHitBlock};
use crate::math::columns::{Column, Lane, Movable, ZERO, columns};
use crate::math::simd::isa::Isa;
use crate::plan::Features;
use crate::plan::aov::Guide;
use crate::sampler::Scheme;
use crate::shading::cone::Cone;
use crate::shading::medium::{Boundary, Media};

columns! {
    moved by Carried;
    /// What a path carries besides its ray.
    #[derive(Debug)]
    pub struct Path as PathBlock {
        /// Throughput f/p so far, by channel.
        beta: Vec3,
        /// Product of η² over the refractions so far; roulette takes it out of the throughput.
        eta_scale: f32 => transmission,
        /// Pdf (sr⁻¹) with which the last BSDF sample chose `ray.dir`; read by emission MIS. Infinite after a mirror
        /// and on camera rays.
        last_pdf_sa: f32,
        /// Normal with which the last vertex sampled lights (0 on transmissive surfaces); read by emission MIS.
        last_n: Vec3 => normal,
        /// Camera sample of this path within the wave.
        slot: u32,
        /// Low word of the sampler's pixel seed.
        seed_lo: u32,
        /// High word of the sampler's pixel seed.
        seed_hi: u32,
        /// Sample index within the pixel's half.
        index: u32,
    }
}

impl Path {
    /// A path that has been nowhere.
    pub(super) const NEW: Path = Path {
        beta: Vec3::ONE,
        eta_scale: 1.0,
        last_pdf_sa: f32::INFINITY,
        last_n: Vec3::ZERO,
        slot: 0,
        seed_lo: 0,
        seed_hi: 0,
        index: 0,
    };
}

impl Default for PathBlock {
    /// Sixteen new paths.
    #[inline(always)]
    fn default() -> Self {
        Path::NEW.splat()
    }
}

impl PathBlock {
    /// Four numbers a lane: those of a scheme that is known when this is compiled. A path to its function (not a
    /// closure) is called for each lane instead of being taken in and vectorised: 700 instructions an edge of Sobol'
    /// points.
    #[inline(always)]
    pub(super) fn random_of<S: Scheme>(&self, set: u32) -> [Lane; 4] {
        self.random(
            set,
            #[inline(always)]
            |index, seed, set| S::sample_4d(index, seed, set),
        )
    }

    /// Four numbers a lane: those that `numbers` has at its path's index and seed in the set `set` (`sampler/dims.rs`).
    #[inline(always)]
    pub(super) fn random(&self, set: u32, numbers: impl Fn(u32, [u32; 2], u32) -> [f32; 4]) -> [Lane; 4] {
        let mut u = [ZERO; 4];
        for i in 0..LANES {
            let point = numbers(self.index[i], [self.seed_lo[i], self.seed_hi[i]], set);
            for d in 0..4 {
                u[d][i] = point[d];
            }
        }
        u
    }
}

columns! {
    moved by ();
    /// What an unblocked shadow ray adds.
    #[derive(Debug)]
    pub struct ShadowLight as ShadowBlock {
        /// Radiance to add, by channel.
        radiance: Vec3,
        /// Camera sample it belongs to.
        slot: u32,
    }
}

columns! {
    moved by ();
    /// A ray on its way into a batch.
    #[derive(Debug)]
    pub struct Ray as RayLanes {
        /// Origin.
        org: Vec3,
        /// Unit direction.
        dir: Vec3,
    }
}

impl RayLanes {
    /// Puts the lanes that `keep` marks behind one another into two blocks of a batch.
    #[inline(always)]
    fn append<I: Isa>(&self, keep: u16, at: usize, [here, after]: [&mut RayBlock; 2]) {
        let squeeze = |from: &Lane, here: &mut Lane, after: &mut Lane| f32::squeeze::<I>(from, keep, at, here, after);
        squeeze(&self.org[0], &mut here.org_x, &mut after.org_x);
        squeeze(&self.org[1], &mut here.org_y, &mut after.org_y);
        squeeze(&self.org[2], &mut here.org_z, &mut after.org_z);
        squeeze(&self.dir[0], &mut here.dir_x, &mut after.dir_x);
        squeeze(&self.dir[1], &mut here.dir_y, &mut after.dir_y);
        squeeze(&self.dir[2], &mut here.dir_z, &mut after.dir_z);
    }
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
        Paths { rays: vec![RayHitBlock::EMPTY; blocks], paths: vec![PathBlock::default(); blocks], len: 0 }
    }

    /// Appends the lanes that `keep` marks; columns that are not `carried` are not moved.
    #[inline(always)]
    pub fn append<I: Isa>(&mut self, rays: &RayLanes, paths: &PathBlock, keep: u16, carried: Carried) {
        let (block, at) = (self.len / LANES, self.len % LANES);
        let ([here, after, ..], [path, path_after, ..]) = (&mut self.rays[block..], &mut self.paths[block..]) else {
            unreachable!("a wave has a block more than it fills");
        };
        rays.append::<I>(keep, at, [&mut here.ray, &mut after.ray]);
        // Lanes that are overwritten later may have any end.
        here.ray.tfar[at..].fill(f32::INFINITY);
        after.ray.tfar = [f32::INFINITY; LANES];
        paths.squeeze::<I>(keep, at, [path, path_after], carried);
        self.len += keep.count_ones() as usize;
    }

    /// Appends one path.
    pub fn push(&mut self, org: Vec3, dir: Vec3, path: Path) {
        let (block, i) = (self.len / LANES, self.len % LANES);
        let ray = &mut self.rays[block].ray;
        ray.set(i, org, dir, f32::INFINITY);
        Path::set(&mut self.paths[block], i, path);
        self.len += 1;
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
    /// `eta_scale`: something transmits.
    pub transmission: bool,
}

/// Shadow rays with what they carry, in lanes `0..len`.
pub struct Shadows {
    /// The rays.
    pub rays: Vec<RayBlock>,
    /// What they add if unblocked.
    pub carried: Vec<ShadowBlock>,
    /// What is around each where it starts; empty unless they pass boundaries.
    pub media: Vec<Media>,
    /// The light of each; empty unless layers tell lights apart.
    pub origins: Vec<Origin>,
    /// Where each starts; empty unless solids may lie in each other.
    pub starts: Vec<Start>,
    /// Lanes in use.
    pub len: usize,
}

impl Shadows {
    /// Appends the lanes that `keep` marks, as [`Paths::append`] does. `tfar` are the rays' lengths, metres.
    #[inline(always)]
    pub fn append<I: Isa>(&mut self, rays: &RayLanes, tfar: &Lane, light: &ShadowBlock, keep: u16) {
        let (block, at) = (self.len / LANES, self.len % LANES);
        let ([here, after, ..], [carried, carried_after, ..]) = (&mut self.rays[block..], &mut self.carried[block..])
        else {
            unreachable!("a wave has a block more than it fills");
        };
        rays.append::<I>(keep, at, [here, after]);
        f32::squeeze::<I>(tfar, keep, at, &mut here.tfar, &mut after.tfar);
        light.squeeze::<I>(keep, at, [carried, carried_after], ());
        self.len += keep.count_ones() as usize;
    }

    /// Appends a ray of direction `dir` up to `end_m`, and what it adds.
    pub fn push(&mut self, (org, dir, end_m): (Vec3, Vec3, f32), light: ShadowLight) {
        let (block, i) = (self.len / LANES, self.len % LANES);
        self.rays[block].set(i, org, dir, end_m);
        ShadowLight::set(&mut self.carried[block], i, light);
        self.len += 1;
    }

    /// Blocks in use.
    pub fn blocks(&self) -> usize {
        self.len.div_ceil(LANES)
    }
}

impl Shadows {
    /// What the shadow ray of a lane adds; `None` if it is blocked.
    pub fn light(&self, lane: usize) -> Option<[f32; 3]> {
        let (block, i) = (lane / LANES, lane % LANES);
        let radiance = self.carried[block].radiance.map(|channel| channel[i]);
        (self.rays[block].tfar[i] != BLOCKED).then_some(radiance)
    }
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

/// Everything one worker advances together. Allocated once a worker; what few scenes need is empty until one needs it
/// and then grows to the size of the rest.
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
    /// Rays that continue behind surfaces which they pass; empty where no surface lets any pass.
    pub passing: Passing,
    /// What the camera samples have gathered.
    pub sums: Sums,
    /// Densities of light paths over those of the paths, by camera sample (`light_paths/ratio.rs`); empty unless there
    /// are light paths.
    pub ratios: Vec<f32>,
    /// Densities with which directions of the paths were chosen over those of BSDFs, by camera sample; empty unless
    /// there is a guide.
    pub guided: Vec<f32>,
    /// Widths of the paths, by camera sample; empty unless textures are averaged over them.
    pub cones: Vec<Cone>,
    /// Which paths have one wavelength, by camera sample; empty unless there are dispersive solids.
    pub split: Vec<bool>,
    /// Times of the paths, fractions of the shutter, by camera sample; empty unless something moves.
    pub times: Vec<f32>,
    /// The solids around the paths, by camera sample; empty unless the plan keeps them.
    pub media: Vec<Media>,
    /// Where the paths start their next edge, by camera sample; empty unless solids may lie in each other.
    pub starts: Vec<Start>,
    /// Boundaries of second solids where the paths of this edge end, by camera sample; empty unless media are kept and
    /// there are coincident faces.
    pub touching: Vec<Option<Boundary>>,
    /// How far the paths of this edge got that collided before a boundary which they pass, metres, by lane; infinite
    /// for the others, empty unless media scatter and rays pass boundaries.
    pub collisions: Vec<f32>,
    /// Lanes of each block of `current` whose paths collided; empty unless media scatter.
    pub gone: Vec<u16>,
    /// Scatterings, where a survey asks for them.
    pub log: Log,
}

/// What a camera sample comes to through mirrors and smooth glass, as denoisers are told: see `followed.rs`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Followed {
    /// Base colour of the surface.
    pub albedo: [f32; 3],
    /// Its shading normal.
    pub normal: [f32; 3],
    /// That of the first surface.
    pub first: [f32; 3],
    /// Edge of the path at whose end the surface is; the next one after a mirror or smooth glass.
    pub edge: u32,
}

impl Followed {
    /// What `guide` names.
    pub fn of(&self, guide: Guide) -> [f32; 3] {
        match guide {
            Guide::Albedo => self.albedo,
            Guide::Normal => self.normal,
        }
    }
}

/// Where radiance goes.
pub struct Sums {
    /// One entry a camera sample.
    pub gathered: Vec<Gathered>,
    /// The same in parts, for the layers that are shares of it.
    pub parts: Parts,
    /// What camera samples meet first, an entry a layer that shows it; empty unless asked for.
    pub first_hits: Vec<[f32; 3]>,
    /// What camera samples come to through mirrors and smooth glass; empty unless asked for.
    pub followed: Vec<Followed>,
    /// What the paths that the depth limit ended could still have carried.
    pub truncated: Truncated,
}

impl Wave {
    /// Columns for `capacity` paths, whose radiance is kept in parts as `wanted`.
    pub fn new(capacity: usize, wanted: &Wanted) -> Self {
        let blocks = capacity / LANES + 2;
        Wave {
            current: Paths::new(capacity),
            next: Paths::new(capacity),
            shadows: Shadows {
                rays: vec![RayBlock::EMPTY; blocks],
                carried: vec![ShadowLight { radiance: Vec3::ZERO, slot: 0 }.splat(); blocks],
                media: Vec::new(),
                origins: Vec::new(),
                starts: Vec::new(),
                len: 0,
            },
            queues: std::array::from_fn(|_| Vec::with_capacity(capacity)),
            dense: vec![(Kind::Lambert, 0); blocks],
            passing: Passing::default(),
            sums: Sums {
                gathered: vec![Gathered::default(); capacity],
                parts: Parts::new(capacity, wanted),
                first_hits: Vec::new(),
                followed: Vec::new(),
                truncated: Truncated::default(),
            },
            ratios: Vec::new(),
            guided: Vec::new(),
            cones: Vec::new(),
            split: Vec::new(),
            times: Vec::new(),
            media: Vec::new(),
            starts: Vec::new(),
            touching: Vec::new(),
            collisions: Vec::new(),
            gone: Vec::new(),
            log: Log::default(),
        }
    }

    /// Bytes of the columns of a wave for `capacity` paths, with those that these features need.
    pub fn bytes(capacity: usize, wanted: &Wanted, features: &Features) -> u64 {
        let if_on = |on: bool, bytes: usize| if on { bytes } else { 0 };
        let paths = 2 * (size_of::<RayHitBlock>() + size_of::<PathBlock>());
        let block = paths + size_of::<RayBlock>() + size_of::<ShadowBlock>() + size_of::<(Kind, u16)>();
        let passes = features.passes(1) | features.passes(2) | features.shadows_pass() | features.exact_starts;
        let passing = size_of::<RayHitBlock>() + LANES * (size_of::<Pending>() + size_of::<u32>());
        let gone = if_on(features.scattering, size_of::<u16>());
        let followed = if_on(wanted.followed, size_of::<Followed>());
        let origin = if_on(features.light_groups | features.lobes, size_of::<Origin>());
        let path = KINDS * size_of::<u32>() + size_of::<Gathered>() + wanted.bytes() + followed + origin;
        let rare = if_on(features.media, 2 * size_of::<Media>())
            + if_on(features.exact_starts, 2 * size_of::<Start>())
            + if_on(features.media && features.coincident, size_of::<Option<Boundary>>())
            + if_on(features.scattering && features.boundaries, size_of::<f32>())
            + if_on(features.light_paths, size_of::<f32>())
            + if_on(features.guide, size_of::<f32>())
            + if_on(features.footprints, size_of::<Cone>())
            + if_on(features.dispersion, size_of::<bool>())
            + if_on(features.shutter, size_of::<f32>())
            + if_on(features.first_hit, size_of::<[f32; 3]>());
        ((capacity / LANES + 2) * (block + if_on(passes, passing) + gone) + capacity * (path + rare)) as u64
    }

    /// Paths that fit.
    pub fn capacity(&self) -> usize {
        self.sums.gathered.len()
    }
}

impl Sums {
    /// Adds radiance to a camera sample, and to its parts if there are any: that of a path of `edge` edges, which began
    /// at `origin`.
    #[inline(always)]
    pub fn add(&mut self, slot: u32, edge: u32, origin: impl FnOnce() -> Origin, radiance: Vec3) {
        let sum = &mut self.gathered[slot as usize].radiance;
        for c in 0..3 {
            sum[c] += radiance[c];
        }
        if self.parts.any() {
            self.parts.add(slot, edge, origin(), radiance);
        }
    }
}
