//! `pathspace accuracy`: what accuracy costs in time for one scene. Loads it, runs the study within the budget, prints
//! the tables on stdout and writes the report where a folder is named. Progress goes to stderr.

use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::args::AccuracyArgs;
use super::job::{self, Fallback};
use super::output::{EXIT_OK, print, to_json};
use super::report::Verbosity;
use super::signal::Signals;
use super::waiting::Waiting;
use crate::backend::BackendInfo;
use crate::error::{Error, Result};
use crate::film::atomic::{check_writable, write_atomically};
use crate::film::exr::read_exr;
use crate::machine::Processor;
use crate::render::{RenderOptions, Renderer};
use crate::study::findings::Study;
use crate::study::measure::{self, Request};
use crate::study::reference::Reference;
use crate::study::renderers::Step;
use crate::study::report::{Report, Setup};
use crate::study::{html, picture, settings, table};

/// Runs the command.
pub fn run(args: &AccuracyArgs) -> Result<u8> {
    let started = Instant::now();
    let verbosity = Verbosity::of(args.quiet, false);
    let signals = Signals::listen()?;
    job::check(&args.settings)?;
    let outputs = args.output.as_deref().map(Outputs::prepare).transpose()?;
    let given = args.reference.as_deref().map(|path| read_exr(path).map(|picture| (path, picture))).transpose()?;

    let waiting = Waiting::begin(verbosity, "loading");
    let scene = &job::load(&args.scene, &args.settings, Fallback::White)?;
    drop(waiting);
    verbosity.warnings(&scene.warnings);
    let load_s = started.elapsed().as_secs_f64();
    let full = job::settings(&args.settings, scene);
    let mut base = full.clone();
    if !args.settings.is_sized() {
        base = picture::sized(base, given.as_ref().map(|(_, picture)| picture));
    }
    base.check_memory()?;
    let renderer = Renderer::new(scene, RenderOptions { spp: Some(1), ..base.clone() })?;
    let machine = (renderer.plan().threads, backend_text(renderer.backend_info()));
    // The plan's choice is held through the study, so that techniques differ from it in what they say they do.
    base.backend = Some(renderer.plan().backend);
    drop(renderer);
    let reference = given.as_ref().map(|(path, picture)| Reference::of_picture(path, picture, &base)).transpose()?;
    verbosity.note(format_args!(
        "accuracy: {}x{} pixels, {:.0} s; a signal keeps what is measured",
        base.width,
        base.height,
        args.budget.as_secs_f64()
    ));

    signals.defer();
    let AccuracyArgs { budget, effects, classes, .. } = *args;
    let request = Request { base, budget, full: args.full, effects, reference, classes, load_s };
    let mut shown = String::new();
    let study = measure::run(scene, &request, started, &mut |step: &Step| {
        if step.what != shown {
            shown = step.what.into();
            verbosity.note(format_args!("accuracy: {:5.1} s  {shown}", step.elapsed.as_secs_f64()));
        }
        if signals.exit_code().is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;

    let setup = setup(args, &request, machine, (full.width, full.height), &study);
    let report = Report::new(&study, setup, args.reference.as_ref().map(|path| path.display().to_string()));
    print(&table::text(&report))?;
    if let Some(outputs) = outputs {
        outputs.write(&report, &study)?;
        verbosity.note(format_args!("wrote {}", outputs.html.display()));
    }
    scene.check_textures()?;
    Ok(if study.interrupted { signals.exit_code().unwrap_or(EXIT_OK) } else { EXIT_OK })
}

fn setup(
    args: &AccuracyArgs,
    request: &Request,
    (threads, backend): (usize, String),
    (render_width, render_height): (u32, u32),
    study: &Study,
) -> Setup {
    let base = &request.base;
    let window = base.crop.map_or((base.width, base.height), |crop| (crop.width, crop.height));
    Setup {
        version: env!("CARGO_PKG_VERSION").into(),
        scene: args.scene.display().to_string(),
        resolution: [window.0, window.1],
        render_resolution: base.crop.map_or([render_width, render_height], |crop| [crop.width, crop.height]),
        threads,
        cpu: Processor::detect().name,
        backend,
        options: settings::describe(base) + &without(&args.settings.without),
        load: load_per_processor(),
        budget_s: request.budget.as_secs_f64(),
        seconds: study.seconds,
        fixed_s: study.fixed_s,
        estimate_s: study.estimate_s,
        seeds: [base.seed, base.seed.wrapping_add(1), measure::reference_seed(base.seed)],
        price_per_core_hour: args.price_per_core_hour,
    }
}

/// What is left out, in the spelling of the command line.
fn without(names: &[String]) -> String {
    if names.is_empty() { String::new() } else { format!(" --without {}", names.join(",")) }
}

fn backend_text(info: &BackendInfo) -> String {
    format!(
        "{} {} ({}; camera {}, bounce {}, shadow {})",
        info.kind.name(),
        info.version,
        info.isa,
        info.rays_coherent,
        info.rays_incoherent,
        info.rays_shadow
    )
}

/// Runnable processes per processor over the last minute.
fn load_per_processor() -> Option<f64> {
    let text = fs::read_to_string("/proc/loadavg").ok()?;
    let load: f64 = text.split_whitespace().next()?.parse().ok()?;
    Some(load / std::thread::available_parallelism().ok()?.get() as f64)
}

/// The files of a report.
struct Outputs {
    html: PathBuf,
    json: PathBuf,
    csv: PathBuf,
}

impl Outputs {
    /// Makes the folder, if it is not there, and makes sure that the files can be written.
    fn prepare(folder: &Path) -> Result<Self> {
        fs::create_dir_all(folder).map_err(|source| Error::io(folder, "create", source))?;
        let file = |name: &str| folder.join(name);
        let outputs = Outputs { html: file("report.html"), json: file("report.json"), csv: file("report.csv") };
        for path in [&outputs.html, &outputs.json, &outputs.csv] {
            check_writable(path)?;
        }
        Ok(outputs)
    }

    fn write(&self, report: &Report, study: &Study) -> Result<()> {
        let texts =
            [(&self.json, to_json(report)), (&self.csv, table::csv(report)), (&self.html, html::page(report, study))];
        for (path, text) in texts {
            write_atomically(path, |writer| std::io::Write::write_all(writer, text.as_bytes()))?;
        }
        Ok(())
    }
}
