//! `pathspace render`: outputs are checked, the scene is loaded, rendered to the first limit or signal, and written.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Instant;

use super::args::RenderArgs;
use super::error_log::ErrorLog;
use super::info::PlanRecord;
use super::job::{self, EnvironmentRequest, Outputs};
use super::progress::{self, ProgressView};
use super::replay;
use super::report::Verbosity;
use super::signal::Signals;
use super::{EXIT_NONFINITE, EXIT_OK, EXIT_TARGET_MISSED, to_json};
use crate::error::{Error, Result};
use crate::film::Film;
use crate::film::aov::{self, Sources};
use crate::film::atomic::write_atomically;
use crate::film::exr::{ExrOptions, ViewMatrices};
use crate::render::{Progress, Render, Renderer, StopReason};
use crate::scene::Scene;
use crate::stats::{Inputs, Seconds, Stats, bias};

/// Runs the command.
pub fn run(args: &RenderArgs) -> Result<u8> {
    if let Some(pixel) = args.pixel {
        return replay::run(args, pixel);
    }
    let result = render(args);
    if let Err(error) = &result {
        progress::failed(args.progress, error);
    }
    result
}

fn render(args: &RenderArgs) -> Result<u8> {
    let start = Instant::now();
    let verbosity = Verbosity::of(args.quiet, args.verbose);
    let signals = Signals::listen()?;
    job::check(&args.settings)?;
    let outputs = Outputs::check(args)?;

    let scene = &job::load(
        &args.scene,
        EnvironmentRequest::of(&args.settings.environment),
        args.settings.textures,
        args.settings.shutter,
    )?;
    verbosity.warnings(&scene.warnings);
    let mut seconds = Seconds { load: start.elapsed().as_secs_f64(), ..Seconds::default() };

    let options = job::options(args, scene);
    job::check_memory(&options)?;
    let renderer = Renderer::new(scene, options.clone())?;
    seconds.build = renderer.build_time().as_secs_f64();
    let record = PlanRecord::of(renderer.plan(), renderer.backend_info());
    verbosity.detail(&record);

    let mut log = match &args.reference {
        Some(path) => Some(ErrorLog::open(path, renderer.plan())?),
        None => None,
    };
    let mut view = ProgressView::new(args.progress, verbosity, options.error);
    let progress = |p: &Progress| {
        view.update(p);
        match signals.exit_code() {
            Some(_) => ControlFlow::Break(()),
            None => ControlFlow::Continue(()),
        }
    };
    let render = match &mut log {
        Some(log) => renderer.render_watched(progress, |checkpoint| log.add(checkpoint))?,
        None => renderer.render_with(progress)?,
    };
    view.finish(&render);
    seconds.render = render.render_time.as_secs_f64();

    let writing = Instant::now();
    let written = if render.film.spp().max > 0 {
        let exr = exr_options(args, scene, &render, &renderer, &record);
        write_pictures(&outputs, &render.film, &exr, args.exposure)?
    } else {
        verbosity.note("pathspace: warning: stopped before the first sample; no picture was written");
        Vec::new()
    };
    if let (Some(log), Some(path)) = (&log, &outputs.error_log) {
        log.write(path)?;
    }
    seconds.write = writing.elapsed().as_secs_f64();
    seconds.total = start.elapsed().as_secs_f64();

    let backend = renderer.backend_info();
    let inputs = Inputs { scene, options: &options, plan: renderer.plan(), backend, render: &render, seconds };
    let mut stats = Stats::new(&inputs);
    if args.half {
        stats.bias.push(bias::half(&render.film));
    }
    if let Some(path) = &outputs.stats {
        write_atomically(path, |writer| std::io::Write::write_all(writer, to_json(&stats).as_bytes()))?;
    }
    verbosity.summary(&stats, &written);
    let exit = exit_code(&render, &stats, options.error, signals.exit_code());
    if exit == EXIT_TARGET_MISSED {
        verbosity.note("pathspace: warning: stopped before the error target was met");
    }
    view.completed(&stats, exit);
    Ok(exit)
}

/// A signal first (the picture is not what was asked for), then samples that are not finite, then a missed target.
fn exit_code(render: &Render, stats: &Stats, target: Option<f64>, signal: Option<u8>) -> u8 {
    let reached = |target: f64| stats.error.is_some_and(|error| error.limit <= target);
    match (render.stop, signal) {
        (StopReason::Callback, Some(code)) => code,
        _ if render.counters.nonfinite > 0 => EXIT_NONFINITE,
        (StopReason::Error, _) => EXIT_OK,
        _ if target.is_some_and(|target| !reached(target)) => EXIT_TARGET_MISSED,
        _ => EXIT_OK,
    }
}

fn exr_options(
    args: &RenderArgs,
    scene: &Scene,
    render: &Render,
    renderer: &Renderer,
    record: &PlanRecord,
) -> ExrOptions {
    let backend = renderer.backend_info();
    let sources = Sources {
        film: &render.film,
        lengths: render.lengths.as_ref(),
        first_hits: render.first_hits.as_deref(),
        max_depth: renderer.plan().max_depth,
    };
    ExrOptions {
        channels: aov::channels(&renderer.plan().aovs, &sources),
        half: args.half,
        render_seconds: Some(render.render_time.as_secs_f64()),
        view: Some(view_matrices(renderer, scene)),
        seed: Some(args.settings.seed),
        sample_range: Some((0, render.film.spp().min)),
        backend: Some(format!("{} {}", backend.kind.name(), backend.version)),
        isa: Some(backend.isa.clone()),
        plan: serde_json::to_string(record).ok(),
    }
}

fn view_matrices(renderer: &Renderer, scene: &Scene) -> ViewMatrices {
    let camera = renderer.camera();
    ViewMatrices {
        world_to_camera: camera.world_to_camera(scene.origin),
        world_to_ndc: camera.world_to_ndc(scene.origin),
    }
}

fn write_pictures(outputs: &Outputs, film: &Film, exr: &ExrOptions, exposure_ev: f32) -> Result<Vec<PathBuf>> {
    if let Some(path) = &outputs.exr {
        film.write_exr(path, exr)?;
    }
    for path in &outputs.pngs {
        film.write_png(path, exposure_ev)?;
    }
    Ok::<_, Error>(outputs.exr.iter().chain(&outputs.pngs).cloned().collect())
}
