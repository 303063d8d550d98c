//! `pathspace bench`: what the ray backends do with a scene's own rays, and how near a render comes to them.
//!
//! A frame is rendered once through a backend that [records](record) its rays. Each backend and query mode is then
//! validated against the others and [timed](rates) by class of rays, and the [frame figure](frame) sets the time of the
//! bare rays against that of the render. Rates are 10⁶ rays per second of wall time.
//!
//! Limits: the rays are those of the default or chosen camera and size; other processes on the machine slow what is
//! measured while they run, ratios less than digits.

pub mod agree;
pub mod chart;
pub mod frame;
pub mod playback;
pub mod rates;
pub mod record;
pub mod replay;
pub mod suite;

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::backend::{BackendKind, QueryMode, select};
use crate::error::{Error, Result};
use crate::machine::Processor;
use crate::render::{Progress, RenderOptions, Renderer};
use crate::scene::Scene;
use crate::setters::setters;
use agree::{Agreement, DISTANCE_TOLERANCE};
use frame::Frame;
use rates::{BackendRates, Setup};
use record::{RayClass, Recording};

/// Bytes of rays that are kept of a frame.
const RECORDING_BYTES: usize = 256 << 20;

/// What is measured.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct BenchOptions {
    /// The frame, the backend that renders it, threads and instruction set. Only the samples may stop it.
    pub render: RenderOptions,
    /// Pairs of render and replay behind the frame figure, ≥ 1.
    pub pairs: usize,
    /// Wall time for everything, about: less is measured as it needs.
    pub time: Option<Duration>,
}

impl BenchOptions {
    /// Five pairs with the frame of these options.
    pub fn new(render: RenderOptions) -> Self {
        BenchOptions { render, pairs: 5, time: None }
    }

    setters! {
        pairs: = usize,
        time: into Option<Duration>,
    }
}

/// Everything that was measured; what `bench --json` prints.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Report {
    /// Where.
    pub machine: Machine,
    /// The backends of this build, without those in `skipped`.
    pub backends: Vec<BackendRates>,
    /// Backends against the first of them, which the render used; sums over the others.
    pub agreement: AgreementReport,
    /// Render against bare rays.
    pub frame: Frame,
    /// The frame's rays by the other backends, in their own best modes.
    pub elsewhere: Vec<Elsewhere>,
    /// The scene.
    pub scene: SceneRecord,
    /// Backends that were not measured.
    pub skipped: Vec<Skipped>,
    /// This program's version.
    pub pathspace: &'static str,
}

/// Where it was measured.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Machine {
    /// The processor.
    pub cpu: String,
    /// Its widest vector instructions; what each backend uses stands with the backend.
    pub isa: &'static str,
    /// Threads of the render and of the second set of rates.
    pub threads: usize,
}

/// Backends against each other.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct AgreementReport {
    /// Sums over `against`.
    #[serde(flatten)]
    pub total: Agreement,
    /// Distances are different when they are further apart than this fraction of the larger of the distance and the
    /// largest coordinate of the ray's origin.
    pub distance_tolerance: f32,
    /// The backend that the others are held to, in its first mode.
    pub reference: &'static str,
    /// One by one.
    pub against: Vec<Against>,
}

/// One backend against the reference.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Against {
    /// Which.
    pub name: &'static str,
    /// The counts.
    #[serde(flatten)]
    pub agreement: Agreement,
}

/// What was rendered.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct SceneRecord {
    /// The file.
    pub file: String,
    /// Triangles over all placements.
    pub triangles: u64,
}

/// The rays of the frame traced bare by another backend than the render's.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Elsewhere {
    /// Which.
    pub name: &'static str,
    /// Wall time with all threads by its best rate for each class, seconds.
    pub bare_trace_s: f64,
    /// That over the time of the render.
    pub of_render: f64,
}

/// A backend that was not measured.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Skipped {
    /// Which.
    pub name: &'static str,
    /// Why.
    pub why: String,
}

/// Measures `scene`. `step` gets the name of the next step, to show progress.
///
/// # Errors
/// Those of [`Renderer::new`]; [`Error::Option`] for a scene too large for its backend; [`Error::Backend`] when two
/// query modes of one backend do not agree.
pub fn run(scene: &Scene, options: &BenchOptions, mut step: impl FnMut(&str)) -> Result<Report> {
    let start = Instant::now();
    let mut renderer = Renderer::new(scene, options.render.clone())?;
    if let Some(time) = options.time {
        step("looking for samples that fit into the time");
        let spp = samples_within(&renderer, time.mul_f64(0.5 / (options.pairs.max(1) + 2) as f64))?;
        let render = RenderOptions { spp: Some(spp), ..options.render.clone() };
        renderer.retarget(&render)?;
    }
    step("recording the rays of a frame");
    let plan = renderer.plan();
    if let Some(why) = rates::refusal(plan.backend, renderer.geometry()) {
        return Err(Error::Option { option: "--backend", problem: format!("{}: {why}", plan.backend.name()) });
    }
    let (recording, _) = Recording::of(&renderer, RECORDING_BYTES)?;

    let mut pools = vec![replay::pool(1)?];
    if plan.threads > 1 {
        pools.push(replay::pool(plan.threads)?);
    }
    let asked = plan.backend_options();
    let setup = Setup { geometry: renderer.geometry(), recording: &recording, pools: &pools, options: &asked };
    // The renderer's backend comes first: it is the reference of the others.
    let mut kinds = vec![plan.backend];
    let small = Some(BackendKind::Flat).filter(|_| select::few_faces(renderer.geometry()).is_some());
    kinds.extend(BackendKind::available().iter().copied().chain(small).filter(|kind| *kind != plan.backend));
    let (mut backends, mut skipped) = (Vec::new(), Vec::new());
    for kind in kinds {
        if let Some(why) = rates::refusal(kind, renderer.geometry()) {
            skipped.push(Skipped { name: kind.name(), why });
            continue;
        }
        if !backends.is_empty() && options.time.is_some_and(|time| start.elapsed() > time / 2) {
            skipped.push(Skipped { name: kind.name(), why: "no time was left for it (--time)".into() });
            continue;
        }
        step(&format!("validating and timing {}", kind.name()));
        backends.push((kind, rates::measure(kind, &setup)?));
    }

    step("timing the frame against its bare rays");
    let deadline = options.time.and_then(|time| start.checked_add(time));
    let pairs = (options.pairs, deadline);
    let frame = frame_figure(&renderer, &backends, &recording, &pools[pools.len() - 1], pairs)?;
    let elsewhere = backends[1..].iter().map(|(_, rates)| elsewhere(rates, &frame)).collect();
    let agreement = agreement(&backends, &renderer, &recording);
    let processor = Processor::detect();
    Ok(Report {
        machine: Machine { cpu: processor.name.clone(), isa: processor.isa(), threads: plan.threads },
        backends: backends.into_iter().map(|(_, rates)| rates).collect(),
        agreement,
        frame,
        elsewhere,
        scene: SceneRecord { file: scene.file.display().to_string(), triangles: scene.triangle_count() },
        skipped,
        pathspace: env!("CARGO_PKG_VERSION"),
    })
}

/// Samples of a frame that take about this time: those that were asked for, or a power of two.
fn samples_within(renderer: &Renderer, time: Duration) -> Result<u64> {
    let is_late = |progress: &Progress| progress.elapsed >= time;
    let frame = renderer
        .render_with(|progress| if is_late(progress) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })?;
    let spp = frame.film.spp();
    Ok(if spp.min == spp.max { spp.max } else { 1 << (spp.mean.max(1.0) as u64).ilog2() })
}

/// Holds every backend to the first, on rays that both have traced.
fn agreement(backends: &[(BackendKind, BackendRates)], renderer: &Renderer, recording: &Recording) -> AgreementReport {
    let (first, reference) = &backends[0];
    let geometry = renderer.geometry();
    let (mut total, mut against) = (Agreement::default(), Vec::new());
    for (kind, rates) in &backends[1..] {
        // Brute has traced fewer waves: then it is the reference that traces those.
        let waves = rates::waves(*kind, geometry, recording);
        let counts = if waves.len() == rates::waves(*first, geometry, recording).len() {
            Agreement::of(&waves, &rates.outcomes, &reference.outcomes)
        } else {
            Agreement::of(&waves, &rates.outcomes, &replay::outcomes(renderer.backend(), &waves))
        };
        total.merge(&counts);
        against.push(Against { name: rates.name, agreement: counts });
    }
    AgreementReport { total, distance_tolerance: DISTANCE_TOLERANCE, reference: reference.name, against }
}

/// The frame's rays by the rates of another backend.
fn elsewhere(rates: &BackendRates, frame: &Frame) -> Elsewhere {
    let time = |(class, count): (RayClass, u64)| {
        let of_class = rates.rays.iter().filter(|rate| rate.class == class.name() && rate.threads == frame.threads);
        let best = of_class.map(|rate| rate.mrays_per_s).fold(0.0, f64::max);
        if count == 0 { 0.0 } else { count as f64 * 1e-6 / best }
    };
    let bare_trace_s = RayClass::ALL.into_iter().zip(frame.rays).map(time).sum();
    Elsewhere { name: rates.name, bare_trace_s, of_render: bare_trace_s / frame.render_s }
}

/// The frame figure with the fastest mode of each class, by the rates with all threads.
fn frame_figure(
    renderer: &Renderer,
    backends: &[(BackendKind, BackendRates)],
    recording: &Recording,
    pool: &rayon::ThreadPool,
    pairs: (usize, Option<Instant>),
) -> Result<Frame> {
    let plan = renderer.plan();
    let threads = pool.current_num_threads();
    let rates = backends.iter().find(|(kind, _)| *kind == plan.backend).map(|(_, rates)| rates);
    let fastest = |class: RayClass, planned: QueryMode| {
        let rates = rates.iter().flat_map(|rates| &rates.rays);
        let best = rates
            .filter(|rate| rate.class == class.name() && rate.threads == threads)
            .max_by(|a, b| a.mrays_per_s.total_cmp(&b.mrays_per_s));
        best.and_then(|rate| rate.mode.parse().ok()).unwrap_or(planned)
    };
    let planned = plan.backend_options();
    let mut best = planned.clone();
    best.coherent = fastest(RayClass::Camera, planned.coherent);
    best.incoherent = fastest(RayClass::Bounce, planned.incoherent);
    best.shadow = fastest(RayClass::Shadow, planned.shadow);
    // The renderer's own hierarchy serves where it runs in these modes: two would share the caches.
    if best == planned {
        return frame::measure(renderer, renderer.backend(), recording, pool, pairs);
    }
    let other = select::build(plan.backend, renderer.geometry(), &best)?;
    frame::measure(renderer, other.as_ref(), recording, pool, pairs)
}
