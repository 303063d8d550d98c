//! The frame figure: how much of a render's time its own rays would take alone.
//!
//! tracing efficiency = (time of the frame's rays traced bare, each class in its best query mode) / (time of the
//! render), both wall times of the same threads in the same process. The bare time is that of the recorded waves, class
//! by class scaled to the frame's own counts of rays. Render and replay alternate, so that a machine that grows slower
//! or faster slows both; the figure is the median over the pairs.
//!
//! The same ratio in processor time stands beside it: time that other processes took from the threads is not in it, but
//! neither is the time in which this render leaves a thread idle.

use std::time::Instant;

use rayon::ThreadPool;
use serde::Serialize;

use super::rates::median;
use super::record::{RayClass, Recording};
use super::replay::{self, Bare};
use crate::backend::Backend;
use crate::error::Result;
use crate::machine::processor_seconds;
use crate::render::{Render, Renderer};

/// Numbers of one frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Frame {
    /// Samples per pixel.
    pub spp: u64,
    /// Wall time of the render, seconds; median over the pairs.
    pub render_s: f64,
    /// Wall time of its rays traced bare, seconds; median.
    pub bare_trace_s: f64,
    /// Median over the pairs of bare / render.
    pub tracing_efficiency: f64,
    /// 10⁶ camera paths per second; from the median time.
    pub mpaths_per_s: f64,
    /// Columns and rows.
    pub resolution: [u32; 2],
    /// Threads of render and replay.
    pub threads: usize,
    /// Backend of both.
    pub backend: &'static str,
    /// Query modes of the render: camera, bounce, shadow.
    pub modes_render: [&'static str; 3],
    /// Query modes of the bare rays: the best of each class.
    pub modes_bare: [&'static str; 3],
    /// Rays of the frame: camera, bounce, shadow.
    pub rays: [u64; 3],
    /// One wave of this many was replayed.
    pub recorded_one_in: u64,
    /// Pairs of render and replay.
    pub pairs: usize,
    /// Smallest and largest efficiency of a pair.
    pub tracing_efficiency_range: [f64; 2],
    /// Median over the pairs of bare / render in processor time; `null` where the system does not say.
    pub tracing_efficiency_cpu: Option<f64>,
    /// Processor time that the renders got, of what their threads could have used; below 0.9 the machine was busy with
    /// other things and wall times say little. `null` where the system does not say.
    pub processor_share: Option<f64>,
}

/// One pair.
struct Pair {
    render_s: f64,
    bare_s: f64,
    efficiency_cpu: Option<f64>,
    share: Option<f64>,
}

/// Renders and replays `pairs` times in turn, or until the deadline, once at least. `best` traces the bare rays;
/// `modes_bare` names its modes.
pub fn measure(
    renderer: &Renderer,
    best: &dyn Backend,
    recording: &Recording,
    pool: &ThreadPool,
    (pairs, deadline): (usize, Option<Instant>),
) -> Result<Frame> {
    let waves: Vec<_> = recording.waves.iter().map(Vec::as_slice).collect();
    let mut list = Vec::new();
    let mut last = None;
    for pair in 0..pairs.max(1) {
        if pair > 0 && deadline.is_some_and(|deadline| Instant::now() > deadline) {
            break;
        }
        let (render, render_cpu) = timed(|| renderer.render());
        let render = render?;
        let (bare, bare_cpu) = timed(|| replay::replay(best, &waves, None, pool));
        let (thread_seconds, scale) = whole_frame(&bare, &render);
        // Of the processor time of the replay, the copying's share is not the rays'.
        let share = bare.seconds.iter().sum::<f64>() / (bare.seconds.iter().sum::<f64>() + bare.copy_seconds);
        let render_s = render.render_time.as_secs_f64();
        let threads = pool.current_num_threads() as f64;
        list.push(Pair {
            render_s,
            bare_s: thread_seconds / threads,
            share: render_cpu.map(|cpu| cpu / (render_s * threads)),
            efficiency_cpu: render_cpu.zip(bare_cpu).map(|(render, bare)| bare * share * scale / render),
        });
        last = Some(render);
    }
    let render = last.expect("at least one pair was run");
    let column = |value: fn(&Pair) -> f64| median(&mut list.iter().map(value).collect::<Vec<_>>());
    let ratios: Vec<f64> = list.iter().map(|pair| pair.bare_s / pair.render_s).collect();
    let mut cpu: Vec<f64> = list.iter().filter_map(|pair| pair.efficiency_cpu).collect();
    let render_s = column(|pair| pair.render_s);
    let modes = |backend: &dyn Backend| {
        let info = backend.info();
        [info.rays_coherent, info.rays_incoherent, info.rays_shadow]
    };
    Ok(Frame {
        spp: render.film.spp().max,
        render_s,
        bare_trace_s: column(|pair| pair.bare_s),
        tracing_efficiency: median(&mut ratios.clone()),
        mpaths_per_s: render.counters.paths as f64 * 1e-6 / render_s,
        resolution: [renderer.plan().resolution.0, renderer.plan().resolution.1],
        threads: pool.current_num_threads(),
        backend: renderer.backend_info().kind.name(),
        modes_render: modes(renderer.backend()),
        modes_bare: modes(best),
        rays: rays_of(&render),
        recorded_one_in: recording.stride,
        pairs: list.len(),
        tracing_efficiency_range: [
            ratios.iter().copied().fold(f64::INFINITY, f64::min),
            ratios.iter().copied().fold(0.0, f64::max),
        ],
        tracing_efficiency_cpu: (cpu.len() == list.len()).then(|| median(&mut cpu)),
        processor_share: (cpu.len() == list.len())
            .then(|| median(&mut list.iter().filter_map(|pair| pair.share).collect::<Vec<_>>())),
    })
}

/// Thread-seconds of all rays of the frame, and the factor by which that exceeds those replayed.
fn whole_frame(bare: &Bare, render: &Render) -> (f64, f64) {
    let counts = rays_of(render);
    let per_class = |class: RayClass| {
        let class = class as usize;
        if bare.rays[class] == 0 { 0.0 } else { bare.seconds[class] / bare.rays[class] as f64 * counts[class] as f64 }
    };
    let seconds: f64 = RayClass::ALL.into_iter().map(per_class).sum();
    (seconds, seconds / bare.seconds.iter().sum::<f64>())
}

fn rays_of(render: &Render) -> [u64; 3] {
    let counters = &render.counters;
    [counters.rays_camera, counters.rays_bounce, counters.rays_shadow]
}

/// A result, and the processor time of the process that it took.
fn timed<T>(work: impl FnOnce() -> T) -> (T, Option<f64>) {
    let before = processor_seconds();
    let result = work();
    (result, before.zip(processor_seconds()).map(|(before, after)| after - before))
}
