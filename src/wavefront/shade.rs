//! Shading, sixteen lanes at a time: emission, roulette, a light sample, a BSDF sample. Survivors go to the next edge, shadow
//! rays to their batch. Every step is a branch-free loop over columns that LLVM turns into vector code, or a short loop over
//! lanes where something has to be looked up.
//!
//! How a surface scatters is the business of a kernel ([`Bsdfs`]); this page is the same for all of them. Kernels give the
//! same bits where more than one could serve, which tests hold them to.

use std::mem;

use super::Context;
use super::columns::{Lane, Lane3, Mask, ZERO, ZERO3, bits, get, set};
use super::footprint::{self, Cone};
use super::isa::Isa;
use super::light_sample::LightLanes;
use super::queue::Kind;
use super::shutter;
use super::state::{PathBlock, Paths, ShadowLanes, Shadows, Sums, Survivors, Wave};
use super::vertices::Vertices;
use crate::backend::batch::{LANES, RayHitBlock};
use crate::math::float;
use crate::plan::options::Strategy;
use crate::sampler::{Scheme, dims};
use crate::shading::mis;

/// The scattering functions of sixteen lanes.
pub trait Bsdfs<'c>: Sized {
    /// Whether unlit surfaces may be among the lanes.
    const UNLIT: bool;

    /// Looks the materials of the active lanes up. Switches off lanes that scatter nothing, and may replace shading normals.
    fn resolve(context: &Context<'c>, rays: &RayHitBlock, vertices: &mut Vertices, u_material: &Lane) -> Self;

    /// Active lanes for which a light sample can find anything; all of them if `at_deltas`.
    fn lit(&self, vertices: &Vertices, at_deltas: bool) -> Mask;

    /// Normals with which lights are chosen, 0 where light from both sides counts.
    fn receiver_n(&self, vertices: &Vertices) -> Lane3;

    /// f·|cos θ_i| and the density of `sample` for unit world directions; 0 where nothing can be scattered.
    fn eval(&self, vertices: &Vertices, wi: &Lane3) -> Scattered;

    /// Draws directions by `u[0]` (lobe), `u[1]`, `u[2]`: fills all of `to` but its origins, `to.beta` with weights f·|cos θ_i|/pdf. Returns
    /// the lanes that go on.
    fn sample(&self, context: &Context, vertices: &Vertices, u: &[Lane; 4], to: &mut Survivors) -> Mask;
}

/// What [`Bsdfs::eval`] finds.
#[repr(C, align(64))]
pub struct Scattered {
    /// f·|cos θ_i|, sr⁻¹.
    pub f_cos: Lane3,
    /// Density, sr⁻¹.
    pub pdf_sa: Lane,
}

/// Where a block's shadow rays, survivors and emission go.
struct Outputs<'w> {
    next: &'w mut Paths,
    shadows: &'w mut Shadows,
    sums: &'w mut Sums,
    /// Empty unless textures are averaged over the width of paths.
    cones: &'w mut [Cone],
}

/// Shades the lanes of one kind: dense blocks where they lie, then the queue. Returns how many paths the depth limit ended.
#[inline(always)]
pub fn run<'c, B: Bsdfs<'c>, S: Scheme, I: Isa>(context: &Context<'c>, wave: &mut Wave, kind: Kind, edge: u32) -> u64 {
    if context.only_kind.is_some_and(|only| only != kind) {
        return 0;
    }
    let blocks = wave.current.blocks();
    let queue = mem::take(&mut wave.queues[kind as usize]);
    let Wave { current, next, shadows, dense, sums, cones, times, .. } = wave;
    let mut outputs = Outputs { next, shadows, sums, cones };
    let mut capped = 0;
    for block in 0..blocks {
        let (of, lanes) = dense[block];
        if of == kind && lanes != 0 {
            let (rays, paths) = (&current.rays[block], &current.paths[block]);
            capped += shade_block::<B, S, I>(context, rays, paths, lanes, &mut outputs, edge);
        }
    }
    for lanes in queue.chunks(LANES) {
        let (mut rays, paths) = pack(current, lanes);
        if context.plan.features.shutter {
            shutter::stamp(times, &paths.slot, &mut rays.ray);
        }
        let lanes = (0xFFFFu32 >> (LANES - lanes.len())) as u16;
        capped += shade_block::<B, S, I>(context, &rays, &paths, lanes, &mut outputs, edge);
    }
    wave.queues[kind as usize] = queue;
    capped
}

/// Copies scattered lanes into one block.
fn pack(current: &Paths, lanes: &[u32]) -> (RayHitBlock, PathBlock) {
    let (mut rays, mut paths) = (RayHitBlock::EMPTY, PathBlock::EMPTY);
    for (to, &lane) in lanes.iter().enumerate() {
        let (block, i) = (lane as usize / LANES, lane as usize % LANES);
        let from = &current.rays[block];
        rays.ray.set(to, from.ray.org(i), from.ray.dir(i), from.ray.tfar[i]);
        rays.hit.u[to] = from.hit.u[i];
        rays.hit.v[to] = from.hit.v[i];
        rays.hit.prim[to] = from.hit.prim[i];
        rays.hit.geom[to] = from.hit.geom[i];
        rays.hit.inst[to] = from.hit.inst[i];
        paths.set(to, &current.paths[block].get(i));
    }
    (rays, paths)
}

#[inline(always)]
fn shade_block<'c, B: Bsdfs<'c>, S: Scheme, I: Isa>(
    context: &Context<'c>,
    rays: &RayHitBlock,
    paths: &PathBlock,
    lanes: u16,
    outputs: &mut Outputs,
    edge: u32,
) -> u64 {
    let plan = context.plan;
    let mut vertices = Vertices::gather::<I>(context, rays, paths, lanes);
    if plan.features.footprints {
        vertices.width = footprint::widths(outputs.cones, rays, paths, lanes);
    }
    if plan.features.absorption {
        vertices.absorb(context, rays, paths);
    }
    if B::UNLIT {
        vertices.show_unlit(context, rays, paths, outputs.sums, edge);
    }
    if plan.features.area_lights {
        vertices.emit(context, rays, paths, outputs.sums, edge);
    }
    if edge >= plan.max_depth {
        return vertices.cap(context, paths, outputs.sums);
    }

    // A path that cannot return its cost is ended before its material is looked up.
    let u_light = random::<S>(paths, dims::light(edge));
    vertices.roulette(context, &paths.eta_scale, &u_light[3], edge);
    let u_bsdf = random::<S>(paths, dims::bsdf(edge));
    let bsdfs = B::resolve(context, rays, &mut vertices, &u_bsdf[3]);
    if plan.samples_lights() {
        let lit = bsdfs.lit(&vertices, plan.features.lights_at_deltas);
        if bits(&lit) != 0 {
            let n = bsdfs.receiver_n(&vertices);
            let mut light = LightLanes::sample::<I>(context, &lit, &vertices.receivers(), &n, &u_light);
            shadow_rays::<_, I>(context, &vertices, &bsdfs, &lit, &mut light, paths, outputs.shadows);
        }
    }
    scatter::<_, I>(context, &vertices, &bsdfs, paths, &u_bsdf, outputs);
    0
}

/// Next-event estimation of the lanes of `lit`; appends the shadow rays that could carry something.
#[inline(always)]
fn shadow_rays<'c, B: Bsdfs<'c>, I: Isa>(
    context: &Context<'c>,
    vertices: &Vertices,
    bsdfs: &B,
    lit: &Mask,
    light: &mut LightLanes,
    paths: &PathBlock,
    shadows: &mut Shadows,
) {
    let scattered = bsdfs.eval(vertices, &light.wi);
    // The heuristic is chosen once, outside the loop. A delta light counts as one that the BSDF never finds.
    match context.plan.strategy {
        Strategy::MisPower => weigh(vertices, &scattered, lit, light, mis::power_weight),
        Strategy::MisBalance => weigh(vertices, &scattered, lit, light, mis::balance_weight),
        Strategy::LightOnly => weigh(vertices, &scattered, lit, light, |_, _| 1.0),
        Strategy::BsdfOnly => return,
    }
    let mut rays = ShadowLanes { org: ZERO3, dir: ZERO3, tfar: ZERO, radiance: light.radiance };
    let mut keep: Mask = [0; LANES];
    for i in 0..LANES {
        let wi = get(&light.wi, i);
        let origin = float::spawn_origin(get(&vertices.p, i), get(&vertices.n_g, i), vertices.error[i], wi);
        let segment = float::segment_to(origin, get(&light.target, i), get(&light.normal, i), light.error[i]);
        let finite = light.infinite[i] == 0;
        set(&mut rays.org, i, origin);
        rays.dir[0][i] = if finite { segment.dir.x } else { wi.x };
        rays.dir[1][i] = if finite { segment.dir.y } else { wi.y };
        rays.dir[2][i] = if finite { segment.dir.z } else { wi.z };
        let end = if finite { segment.tfar } else { f32::MAX };
        let carried = light.radiance[0][i].max(light.radiance[1][i]).max(light.radiance[2][i]);
        keep[i] = u32::from(end > 0.0) & u32::from(end < f32::INFINITY) & u32::from(carried > 0.0);
        rays.tfar[i] = if finite { end } else { f32::INFINITY };
    }
    shadows.append::<I>(&rays, &paths.slot, bits(&keep));
}

/// Turns the radiance of each light sample into what its shadow ray carries; 0 where nothing can arrive.
#[inline(always)]
fn weigh(
    vertices: &Vertices,
    scattered: &Scattered,
    lit: &Mask,
    light: &mut LightLanes,
    heuristic: impl Fn(f32, f32) -> f32,
) {
    for i in 0..LANES {
        let weight = heuristic(light.pdf_sa[i], scattered.pdf_sa[i] * light.shared[i]);
        let usable = (light.pdf_sa[i] > 0.0) & (lit[i] != 0);
        let factor = if usable { weight / light.pdf_sa[i] } else { 0.0 };
        for c in 0..3 {
            light.radiance[c][i] = vertices.beta[c][i] * scattered.f_cos[c][i] * light.radiance[c][i] * factor;
        }
    }
}

/// BSDF samples; appends the paths that go on.
#[inline(always)]
fn scatter<'c, B: Bsdfs<'c>, I: Isa>(
    context: &Context<'c>,
    vertices: &Vertices,
    bsdfs: &B,
    paths: &PathBlock,
    u: &[Lane; 4],
    outputs: &mut Outputs,
) {
    let mut to = Survivors {
        org: ZERO3,
        dir: ZERO3,
        beta: ZERO3,
        last_pdf_sa: ZERO,
        last_n: bsdfs.receiver_n(vertices),
        eta_scale: paths.eta_scale,
        medium: paths.medium,
    };
    let mut keep = bsdfs.sample(context, vertices, u, &mut to);
    for i in 0..LANES {
        let wi = get(&to.dir, i);
        set(&mut to.org, i, float::spawn_origin(get(&vertices.p, i), get(&vertices.n_g, i), vertices.error[i], wi));
    }
    for i in 0..LANES {
        let mut dead = true;
        for c in 0..3 {
            to.beta[c][i] *= vertices.beta[c][i];
            // A throughput that is NaN goes on, to be counted.
            dead &= to.beta[c][i] <= 0.0;
        }
        keep[i] &= vertices.active[i] & u32::from(!dead);
    }
    if context.plan.features.footprints {
        footprint::scatter(outputs.cones, vertices, paths, &to.last_pdf_sa, &keep);
    }
    outputs.next.append::<I>(&to, paths, bits(&keep), context.carried);
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
