//! The loop over edges: batches of paths advance one edge at a time, and each verb is a file.
//!
//! All paths of a wave have the same number of edges, so the depth, its dimension sets and its roulette are the same
//! for all lanes. A worker owns its wave; nothing is shared but the read-only job, so the picture depends on neither
//! threads nor tiles: a pixel's samples are added in pairs.

use std::marker::PhantomData;

use super::counters::Counters;
use super::job::Job;
use super::light_paths::ratio;
use super::raygen::Chunk;
use super::tape::{Event, LANE, Silent, Tape};
use super::vertex::{End, Met, Vertex, triple};
use super::wave::Wave;
use super::world::World;
use super::{
    accumulate, classify, coincident, departure, first_hit, followed, pass_through, raygen, shade, shutter, volume,
};
use crate::backend::Coherence;
use crate::backend::batch::valid_lanes;
use crate::film::Pixel;
use crate::math::columns::get;
use crate::math::simd::dispatch;
use crate::math::simd::isa::{Baseline, Isa, Kernel};
use crate::sampler::{Scheme, WithScheme};
use crate::texture;

/// Renders the samples of `chunk` (which must fit the wave) into `pixels`, one per pixel of the chunk.
pub fn run(job: &Job, chunk: &Chunk, wave: &mut Wave, pixels: &mut [Pixel], counters: &mut Counters) {
    job.sampler.with(Rendered { job, chunk, wave, output: Output { pixels, counters } })
}

/// [`run`] for a wave of one path, which is written down. In the baseline, which gives the same bits.
pub fn told<T: Tape>(job: &Job, chunk: &Chunk, wave: &mut Wave, output: Output, tape: &mut T) {
    job.sampler.with(Told { job, chunk, wave, output, tape })
}

struct Rendered<'w, 'j> {
    job: &'w Job<'j>,
    chunk: &'w Chunk<'w>,
    wave: &'w mut Wave,
    output: Output<'w>,
}

impl WithScheme for Rendered<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Scheme>(self) {
        let Rendered { job, chunk, wave, output } = self;
        let wide = S::WIDE && job.avx512;
        dispatch::widest(wide, Loop::<S, _> { job, chunk, wave, output, tape: &mut Silent, of: PhantomData })
    }
}

struct Told<'w, 'j, T> {
    job: &'w Job<'j>,
    chunk: &'w Chunk<'w>,
    wave: &'w mut Wave,
    output: Output<'w>,
    tape: &'w mut T,
}

impl<T: Tape> WithScheme for Told<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Scheme>(self) {
        let Told { job, chunk, wave, output, tape } = self;
        Baseline::call(Loop::<S, T> { job, chunk, wave, output, tape, of: PhantomData })
    }
}

/// Where samples and counts go.
pub struct Output<'w> {
    /// One per pixel of the chunk.
    pub pixels: &'w mut [Pixel],
    /// Counts of this worker.
    pub counters: &'w mut Counters,
}

/// The loop, compiled once per instruction set.
struct Loop<'w, 'j, S, T> {
    job: &'w Job<'j>,
    chunk: &'w Chunk<'w>,
    wave: &'w mut Wave,
    output: Output<'w>,
    tape: &'w mut T,
    of: PhantomData<S>,
}

impl<S: Scheme, T: Tape> Kernel for Loop<'_, '_, S, T> {
    type Output = ();

    /// Everything below is inlined here, but for kernels and queries.
    #[inline(always)]
    fn run<I: Isa>(self) {
        let Loop { job, chunk, wave, output: Output { pixels, counters }, tape, .. } = self;
        let world = &job.world;
        raygen::run::<S>(job, chunk, wave);
        counters.paths += chunk.len() as u64;
        let mut edge = 1;
        while wave.current.len > 0 {
            wave.next.len = 0;
            wave.shadows.len = 0;
            wave.shadows.media.clear();
            wave.shadows.origins.clear();
            wave.shadows.starts.clear();
            trace::<S>(job, wave, (edge, coherence(edge)), counters);
            if edge == 1 {
                if world.features.light_paths {
                    ratio::start(job, wave);
                }
                let blocks = wave.current.blocks();
                raygen::start_at_origin(&mut wave.current.rays[..blocks]);
            }
            if edge == 1 && world.features.first_hit {
                first_hit::gather(job, wave);
            }
            if world.features.followed {
                followed::arrive(job, wave, edge);
            }
            tape.note(|| Event::Vertex(Box::new(arrival(world, wave, edge))));
            if world.features.scattering {
                volume::run::<S, T>(job, wave, edge, counters, tape);
            }
            if edge == 1 && world.features.first_hit {
                first_hit::see_through(job, wave);
            }
            classify::run(world, wave, edge, tape);
            counters.capped_paths += shade::run::<S, I, T>(world, wave, edge, tape);
            tape.note(|| Event::Gathered(wave.sums.gathered[0].radiance, edge - 1));
            if wave.shadows.len > 0 {
                trace_shadows(job, wave, edge, counters);
                tape.note(|| Event::Shadow(wave.shadows.light(LANE)));
                accumulate::shadows(wave, edge + 1);
            }
            if world.learns {
                let Wave { log, sums, .. } = wave;
                log.settle(|slot| sums.gathered[slot as usize].radiance);
            }
            tape.note(|| Event::Gathered(wave.sums.gathered[0].radiance, edge));
            std::mem::swap(&mut wave.current, &mut wave.next);
            edge += 1;
        }
        counters.truncated.merge(&std::mem::take(&mut wave.sums.truncated));
        counters.texture_lookups += texture::take_lookups();
        accumulate::samples(chunk, wave, pixels, counters);
    }
}

/// The vertex of a path that is written down, before anything is decided there.
fn arrival(world: &World, wave: &Wave, edge: u32) -> Vertex {
    let (ray, hit) = (&wave.current.rays[0].ray, wave.current.rays[0].hit(LANE));
    // `tfar` of a ray that was refused is as it was: infinite.
    let refused = hit.is_none() && valid_lanes(ray, 1) == 0;
    Vertex {
        edge,
        origin_m: (ray.org(LANE).as_dvec3() + world.scene.origin).into(),
        direction: triple(ray.dir(LANE)),
        throughput: triple(get(&wave.current.paths[0].beta, LANE)),
        met: Met::Infinity,
        emission: None,
        roulette: None,
        light: None,
        scattering: None,
        end: Some(if refused { End::InvalidRay } else { End::LeftScene }),
        gathered: triple(wave.sums.gathered[0].radiance),
    }
}

/// Rays from the camera lie close to each other; rays after a scattering do not.
#[inline(always)]
fn coherence(edge: u32) -> Coherence {
    if edge == 1 { Coherence::Coherent } else { Coherence::Incoherent }
}

/// Finds what the paths meet at the end of edge `edge`.
#[inline(always)]
pub fn trace<S: Scheme>(job: &Job, wave: &mut Wave, (edge, hint): (u32, Coherence), counters: &mut Counters) {
    let features = job.world.features;
    if features.shutter && edge > 1 {
        shutter::stamp_paths(&wave.times, &mut wave.current);
    }
    if features.exact_starts && edge > 1 {
        return trace_from_vertices::<S>(job, wave, edge, counters);
    }
    let current = &mut wave.current;
    let (len, blocks) = (current.len, current.blocks());
    *counters.rays_of(edge) += len as u64;
    counters.invalid_rays += job.backend.closest_hit(&mut current.rays[..blocks], len, hint);
    if features.passes(edge) {
        let traced = pass_through::closest::<S>(job, wave, edge, counters);
        *counters.rays_of(edge) += traced;
    } else if features.coincident {
        coincident::settle_paths(&job.world, wave);
    }
}

/// [`trace`] for paths that start exactly where they left surfaces.
#[inline(never)]
fn trace_from_vertices<S: Scheme>(job: &Job, wave: &mut Wave, edge: u32, counters: &mut Counters) {
    departure::set_out(&wave.starts, &mut wave.media, &mut wave.current, &mut wave.passing);
    let (len, blocks) = (wave.current.len, wave.current.blocks());
    let past = &wave.passing.past;
    counters.invalid_rays += job.backend.closest_hit_past(&mut wave.current.rays[..blocks], len, past);
    let traced = pass_through::closest::<S>(job, wave, edge, counters);
    *counters.rays_of(edge) += len as u64 + traced;
    departure::count_from_vertices(&wave.starts, &mut wave.media, &mut wave.current, &mut wave.collisions);
}

/// Finds out which shadow rays of the vertices at the end of edge `edge` are blocked.
#[inline(always)]
fn trace_shadows(job: &Job, wave: &mut Wave, edge: u32, counters: &mut Counters) {
    let features = job.world.features;
    if features.shutter {
        shutter::stamp_shadows(&wave.times, &mut wave.shadows);
    }
    if features.shadows_pass() {
        counters.rays_shadow += pass_through::shadows(job, wave, counters);
        return;
    }
    let shadows = &mut wave.shadows;
    let (len, blocks) = (shadows.len, shadows.blocks());
    counters.rays_shadow += len as u64;
    counters.invalid_rays += job.backend.any_hit(&mut shadows.rays[..blocks], len, coherence(edge));
}
