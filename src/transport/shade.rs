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
use super::directions::Mixture;
use super::kind::Kind;
use super::light_paths::ratio;
use super::log::Log;
use super::start::Start;
use super::tape::{Event, LANE, Tape};
use super::vertex::End;
use super::vertices::Vertices;
use super::wave::{Path, PathBlock, Paths, RayLanes, Shadows, Sums, Wave};
use super::world::World;
use super::{departure, directions, emission, followed, kernel, lobes, media, origin, shutter, spectrum};
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
    /// Empty unless there are light paths.
    ratios: &'w mut [f32],
    /// Empty unless there is a guide.
    guided: &'w mut [f32],
    /// Empty unless there are dispersive solids.
    split: &'w mut [bool],
    /// Empty unless media are kept.
    media: &'w mut [Media],
    /// Empty unless solids may lie in each other.
    starts: &'w mut [Start],
    /// Empty unless media are kept and there are coincident faces.
    touching: &'w [Option<Boundary>],
    log: &'w mut Log,
    tape: &'w mut T,
    /// Edges of the paths up to here.
    edge: u32,
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
        let Wave { current, next, shadows, dense, sums, ratios, guided, cones, split, .. } = wave;
        let Wave { times, media, starts, touching, log, .. } = wave;
        let mut outputs =
            Outputs { next, shadows, sums, cones, ratios, guided, split, media, starts, touching, log, tape, edge };
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
            truncated += shade_block::<B, S, I, T>(world, from, lanes, &mut outputs);
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
) -> u64 {
    let ((rays, paths), edge) = (from, outputs.edge);
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
        emission::emit(world, &vertices, from, (outputs.sums, outputs.ratios, edge), outputs.tape);
    }
    if edge >= world.max_depth {
        if vertices.active[LANE] != 0 {
            outputs.tape.note(|| Event::End(Some(End::DepthLimit)));
        }
        return vertices.truncate(world, paths, outputs.sums);
    }

    // A path that cannot return its cost is ended before its material is looked up.
    let u_light = paths.random_of::<S>(dims::light(edge));
    let scaled;
    let scale = if world.features.guide {
        scaled = directions::unguided(paths, outputs.guided);
        &scaled
    } else {
        &paths.eta_scale
    };
    vertices.roulette(world, scale, &u_light[3], edge, outputs.tape);
    if B::EXTENDED && world.features.dispersion {
        let u = paths.random_of::<S>(dims::TIME);
        spectrum::arrive(world, &mut vertices, paths, &u[1], outputs.split);
    }
    let u_bsdf = paths.random_of::<S>(dims::bsdf(edge));
    let told = T::ON && vertices.active[LANE] != 0;
    let bsdfs = kernel::Lanes::<B>::resolve(world, rays, &mut vertices, &u_bsdf[3]);
    if told {
        bsdfs.tell(&vertices, outputs.tape);
    }
    if world.features.followed {
        followed::note(&vertices, &bsdfs.lit(&vertices, false), paths, outputs.sums, edge);
    }
    let mixture = if world.features.guide { Mixture::at(world, &vertices, &bsdfs) } else { Mixture::NONE };
    if world.samples_lights() {
        let lit = bsdfs.lit(&vertices, world.features.lights_at_deltas);
        if bits(&lit) != 0 {
            let n = bsdfs.receiver_n(&vertices);
            let mut light = LightLanes::sample::<I>(world, &lit, &vertices.receivers(), &n, &u_light);
            let mut scattered = bsdfs.eval(&vertices, &light.wi);
            if world.features.guide {
                mixture.weigh(world, &light.wi, &mut scattered.pdf_sa);
            }
            if world.features.light_paths && edge > 1 {
                ratio::share(world, (&vertices, &bsdfs), from, (&mut light, &scattered, &lit), outputs.ratios);
            }
            let mut samples = Samples { vertices: &vertices, scattered: &scattered, lit: &lit, from, origins: None };
            if world.features.light_groups | world.features.lobes {
                let mut origins = origin::of_samples(world, &lit, (&light.number, &light.pdf_sa));
                if edge == 1 && world.features.lobes {
                    let firsts = lobes::of_light(&bsdfs, &vertices, &light.wi, &scattered);
                    origins.iter_mut().zip(firsts).for_each(|(origin, first)| origin.first = Some(first));
                }
                samples.origins = Some(origins);
            }
            let media = (&*outputs.media, outputs.touching);
            light.shadow_rays::<I, T>(world, &samples, (outputs.shadows, media), outputs.tape);
        }
    }
    scatter::<B, I, T>(world, (&vertices, edge), (&bsdfs, &mixture), (rays, paths, &u_bsdf), outputs);
    0
}

/// BSDF samples; appends the paths that continue.
#[inline(always)]
fn scatter<'c, B: Bsdf<'c>, I: Isa, T: Tape>(
    world: &World<'c>,
    (vertices, edge): (&Vertices, u32),
    (bsdfs, mixture): (&kernel::Lanes<'c, B>, &Mixture),
    (from, paths, u): (&RayHitBlock, &PathBlock, &[Lane; 4]),
    outputs: &mut Outputs<T>,
) {
    let mut rays = RayLanes { org: ZERO3, dir: ZERO3 };
    let last_n = bsdfs.receiver_n(vertices);
    let mut to = PathBlock { beta: ZERO3, last_pdf_sa: ZERO, last_n, ..*paths };
    let rest;
    let u_bsdf = if world.features.guide {
        rest = mixture.rest(u);
        &rest
    } else {
        u
    };
    let mut keep = bsdfs.sample(vertices, u_bsdf, (&mut rays, &mut to), outputs.tape);
    if world.features.guide {
        let lanes = (&mut rays, &mut to, &mut keep);
        let drawn = mixture.redirect(world, (vertices, bsdfs), u, lanes, outputs.guided);
        if T::ON && mixture.mixes(LANE) && keep[LANE] & vertices.active[LANE] != 0 {
            let mut told = bsdfs.told(vertices, [u_bsdf[0][LANE], 1.0], &rays.dir, &to);
            if drawn >> LANE & 1 == 1 {
                told.lobe = "guide";
            }
            outputs.tape.note(|| Event::Scattering(told));
        }
        if world.learns {
            mixture.note((vertices, bsdfs), (&rays, &to), &keep, outputs.log);
        }
    }
    for i in 0..LANES {
        let wi = get(&rays.dir, i);
        set(&mut rays.org, i, float::spawn_origin(get(&vertices.p, i), get(&vertices.n_g, i), vertices.error[i], wi));
    }
    let drawn = T::ON && keep[LANE] != 0;
    if world.features.light_paths {
        for i in 0..LANES {
            keep[i] *= u32::from(vertices.active[i] != 0);
        }
        let lanes = (&rays.dir, &to, &keep);
        ratio::advance(world, (vertices, bsdfs), (from, paths), lanes, (outputs.ratios, edge));
    }
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
    if world.features.lobes && outputs.edge == 1 {
        let firsts = lobes::of_drawn(bsdfs, vertices, &rays.dir, &to.last_pdf_sa);
        for i in (0..LANES).filter(|&i| keep[i] != 0) {
            outputs.sums.parts.scatter_first(paths.slot[i], firsts[i]);
        }
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
    if world.features.exact_starts {
        let lanes = (&paths.slot, bits(&keep));
        departure::depart(world, vertices, from, lanes, (&mut rays.org, &rays.dir), outputs.starts);
    }
    outputs.next.append::<I>(&rays, &to, bits(&keep), world.carried);
}
