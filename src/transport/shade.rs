//! Shading, sixteen lanes at a time: emission, roulette, a light sample, a BSDF sample. Paths that go on are appended
//! to the next edge, shadow rays to their batch. Every step is a branch-free loop over columns that LLVM turns into
//! vector code, or a short loop over lanes where something has to be looked up.
//!
//! How a surface scatters is the business of a model, driven by [`kernel`]; this page is the same for all of them.
//! Models give the same bits where more than one could serve, which tests hold them to.

use std::marker::PhantomData;
use std::mem;

use glam::Vec3;

use super::connect::{LightLanes, Samples};
use super::kind::Kind;
use super::tape::{Event, LANE, Tape};
use super::vertex::End;
use super::vertices::Vertices;
use super::wave::{Path, PathBlock, Paths, RayLanes, Shadows, Sums, Wave};
use super::world::World;
use super::{emission, kernel, media, shutter, spectrum};
use crate::backend::batch::{LANES, RayHitBlock};
use crate::math::columns::{Column, Lane, ZERO, ZERO3, bits, get, set};
use crate::math::float;
use crate::math::simd::isa::{Isa, Kernel};
use crate::sampler::{Scheme, dims};
use crate::shading::bsdf::model::Bsdf;
use crate::shading::bsdf::models;
use crate::shading::cone::Cone;
use crate::shading::medium::{Boundary, Media};

/// Where a block's shadow rays, survivors and emission go.
struct Outputs<'w, T> {
    next: &'w mut Paths,
    shadows: &'w mut Shadows,
    sums: &'w mut Sums,
    /// Empty unless textures are averaged over the width of paths.
    cones: &'w mut [Cone],
    /// Empty unless there are dispersive solids.
    split: &'w mut [bool],
    /// Empty unless media are kept.
    media: &'w mut [Media],
    /// Empty unless media are kept and there are coincident faces.
    touching: &'w [Option<Boundary>],
    tape: &'w mut T,
}

/// Shades the hits of all kinds, one kernel after another. Returns how many paths the depth limit ended.
#[inline(always)]
pub fn run<S: Scheme, I: Isa, T: Tape>(world: &World, wave: &mut Wave, edge: u32, tape: &mut T) -> u64 {
    let mut truncated = 0;
    macro_rules! shade {
        ($($(#[$doc:meta])* $Kind:ident: $Model:ty, $condition:expr;)*) => {$(
            if world.only_kind.is_none_or(|only| only == Kind::$Kind) {
                let (kind, of) = (Kind::$Kind, PhantomData::<($Model, S)>);
                truncated += I::call(Shade { world, wave: &mut *wave, kind, edge, tape: &mut *tape, of });
            }
        )*};
    }
    models!(shade);
    truncated
}

/// The kernel of one kind, as a function: one is enough for an optimiser at a time.
struct Shade<'w, 'c, B, S, T> {
    world: &'w World<'c>,
    wave: &'w mut Wave,
    kind: Kind,
    edge: u32,
    tape: &'w mut T,
    of: PhantomData<(B, S)>,
}

impl<'c, B: Bsdf<'c>, S: Scheme, T: Tape> Kernel for Shade<'_, 'c, B, S, T> {
    type Output = u64;

    /// Dense blocks are shaded where they lie, then the queue is.
    #[inline(always)]
    fn run<I: Isa>(self) -> u64 {
        let Shade { world, wave, kind, edge, tape, .. } = self;
        let blocks = wave.current.blocks();
        let queue = mem::take(&mut wave.queues[kind as usize]);
        let Wave { current, next, shadows, dense, sums, cones, split, times, media, touching, .. } = wave;
        let mut outputs = Outputs { next, shadows, sums, cones, split, media, touching, tape };
        let mut truncated = 0;
        // One call of the kernel for both: it is inlined, and large.
        let mut packed;
        for number in 0..blocks + queue.len().div_ceil(LANES) {
            let (from, lanes) = if number < blocks {
                let (of, lanes) = dense[number];
                if of != kind || lanes == 0 {
                    continue;
                }
                ((&current.rays[number], &current.paths[number]), lanes)
            } else {
                let rest = &queue[(number - blocks) * LANES..];
                let lanes = &rest[..rest.len().min(LANES)];
                packed = pack(current, lanes);
                if world.features.shutter {
                    shutter::stamp(times, &packed.1.slot, &mut packed.0.ray);
                }
                ((&packed.0, &packed.1), (0xFFFFu32 >> (LANES - lanes.len())) as u16)
            };
            truncated += shade_block::<B, S, I, T>(world, from, lanes, &mut outputs, edge);
        }
        wave.queues[kind as usize] = queue;
        truncated
    }
}

/// Copies scattered lanes into one block.
fn pack(current: &Paths, lanes: &[u32]) -> (RayHitBlock, PathBlock) {
    let (mut rays, mut paths) = (RayHitBlock::EMPTY, PathBlock::default());
    for (to, &lane) in lanes.iter().enumerate() {
        let (block, i) = (lane as usize / LANES, lane as usize % LANES);
        let from = &current.rays[block];
        rays.ray.set(to, from.ray.org(i), from.ray.dir(i), from.ray.tfar[i]);
        rays.hit.u[to] = from.hit.u[i];
        rays.hit.v[to] = from.hit.v[i];
        rays.hit.prim[to] = from.hit.prim[i];
        rays.hit.geom[to] = from.hit.geom[i];
        rays.hit.inst[to] = from.hit.inst[i];
        Path::set(&mut paths, to, Path::get(&current.paths[block], i));
    }
    (rays, paths)
}

#[inline(always)]
fn shade_block<'c, B: Bsdf<'c>, S: Scheme, I: Isa, T: Tape>(
    world: &World<'c>,
    from: (&RayHitBlock, &PathBlock),
    lanes: u16,
    outputs: &mut Outputs<T>,
    edge: u32,
) -> u64 {
    let (rays, paths) = from;
    let mut vertices = Vertices::gather::<I>(world, rays, paths, lanes);
    if world.features.footprints {
        vertices.widen(outputs.cones, rays, paths);
    }
    let mut left = Vec3::ONE;
    if world.features.media {
        left = media::arrive(world, &mut vertices, from, outputs.media, outputs.touching);
    }
    if T::ON {
        vertices.tell(world, rays, left, outputs.tape);
    }
    if B::UNLIT {
        emission::show_unlit(world, &mut vertices, from, (outputs.sums, edge), outputs.tape);
    }
    if world.features.area_lights {
        emission::emit(world, &vertices, from, (outputs.sums, edge), outputs.tape);
    }
    if edge >= world.max_depth {
        if vertices.active[LANE] != 0 {
            outputs.tape.note(|| Event::End(Some(End::DepthLimit)));
        }
        return vertices.truncate(world, paths, outputs.sums);
    }

    // A path that cannot return its cost is ended before its material is looked up.
    let u_light = random::<S>(paths, dims::light(edge));
    vertices.roulette(world, &paths.eta_scale, &u_light[3], edge, outputs.tape);
    if B::EXTENDED && world.features.dispersion {
        let u = random::<S>(paths, dims::TIME);
        spectrum::arrive(world, &mut vertices, paths, &u[1], outputs.split);
    }
    let u_bsdf = random::<S>(paths, dims::bsdf(edge));
    let told = T::ON && vertices.active[LANE] != 0;
    let bsdfs = kernel::Lanes::<B>::resolve(world, rays, &mut vertices, &u_bsdf[3]);
    if told {
        bsdfs.tell(&vertices, outputs.tape);
    }
    if world.samples_lights() {
        let lit = bsdfs.lit(&vertices, world.features.lights_at_deltas);
        if bits(&lit) != 0 {
            let n = bsdfs.receiver_n(&vertices);
            let mut light = LightLanes::sample::<I>(world, &lit, &vertices.receivers(), &n, &u_light);
            let scattered = bsdfs.eval(&vertices, &light.wi);
            let samples = Samples { vertices: &vertices, scattered: &scattered, lit: &lit, from };
            let media = (&*outputs.media, outputs.touching);
            light.shadow_rays::<I, T>(world, &samples, (outputs.shadows, media), outputs.tape);
        }
    }
    scatter::<B, I, T>(world, &vertices, &bsdfs, (rays, paths, &u_bsdf), outputs);
    0
}

/// BSDF samples; appends the paths that continue.
#[inline(always)]
fn scatter<'c, B: Bsdf<'c>, I: Isa, T: Tape>(
    world: &World<'c>,
    vertices: &Vertices,
    bsdfs: &kernel::Lanes<'c, B>,
    (from, paths, u): (&RayHitBlock, &PathBlock, &[Lane; 4]),
    outputs: &mut Outputs<T>,
) {
    let mut rays = RayLanes { org: ZERO3, dir: ZERO3 };
    let last_n = bsdfs.receiver_n(vertices);
    let mut to = PathBlock { beta: ZERO3, last_pdf_sa: ZERO, last_n, ..*paths };
    let mut keep = bsdfs.sample(vertices, u, (&mut rays, &mut to), outputs.tape);
    for i in 0..LANES {
        let wi = get(&rays.dir, i);
        set(&mut rays.org, i, float::spawn_origin(get(&vertices.p, i), get(&vertices.n_g, i), vertices.error[i], wi));
    }
    let drawn = T::ON && keep[LANE] != 0;
    for i in 0..LANES {
        let mut dead = true;
        for c in 0..3 {
            to.beta[c][i] *= vertices.beta[c][i];
            // A throughput that is NaN continues, to be counted.
            dead &= to.beta[c][i] <= 0.0;
        }
        keep[i] &= vertices.active[i] & u32::from(!dead);
    }
    if T::ON && vertices.active[LANE] != 0 {
        let refused = if drawn { End::NothingCarried } else { End::Refused };
        outputs.tape.note(|| Event::End((keep[LANE] == 0).then_some(refused)));
    }
    if world.features.footprints {
        for i in (0..LANES).filter(|&i| keep[i] != 0) {
            let cone = &mut outputs.cones[paths.slot[i] as usize];
            *cone = cone.scattered(vertices.width[i], to.last_pdf_sa[i]);
        }
    }
    if world.features.media {
        media::depart(world, vertices, (from, paths), (&rays.dir, &keep), outputs.media, outputs.touching);
    }
    outputs.next.append::<I>(&rays, &to, bits(&keep), world.carried);
}

/// One set of four numbers per lane.
#[inline(always)]
fn random<S: Scheme>(paths: &PathBlock, set: u32) -> [Lane; 4] {
    let mut u = [ZERO; 4];
    for i in 0..LANES {
        let point = S::sample_4d(paths.index[i], [paths.seed_lo[i], paths.seed_hi[i]], set);
        for d in 0..4 {
            u[d][i] = point[d];
        }
    }
    u
}
