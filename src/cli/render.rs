//! `pathspace render`: outputs are checked, the scene is loaded, rendered to the first limit or signal, and written.

use std::cell::RefCell;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use super::args::{Cli, RenderArgs};
use super::denoising::Filtered;
use super::html::render as html;
use super::job::{self, Fallback, Outputs, STREAM};
use super::keeping::{self, Keeping};
use super::live::watch::Watchers;
use super::output::{EXIT_FAULT, EXIT_NONFINITE, EXIT_OK, EXIT_TARGET_MISSED, print, to_json, write_stdout};
use super::progress::{self, PartOf, ProgressView};
use super::replay;
use super::report::{Verbosity, stderr_line};
use super::signal::Signals;
use super::terminal;
use super::waiting::Waiting;
use crate::error::{Error, Result};
use crate::film::Film;
use crate::film::atomic::write_atomically;
use crate::film::exr::ExrOptions;
use crate::film::look::Look;
use crate::film::oidn::Oidn;
use crate::film::tone::ToneMap;
use crate::machine;
use crate::plain::plain;
use crate::plan::record::PlanRecord;
use crate::render::checkpoint::Checkpoint;
use crate::render::{Progress, Render, RenderOptions, Renderer, Snapshot, StopReason};
use crate::stats::error_log::ErrorLog;
use crate::stats::{Seconds, Stats, bias};

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
    let signals = Signals::listen()?;
    job::check(&args.settings)?;
    let outputs = Outputs::check(args)?;
    let denoiser = args.denoise.open(args.settings.threads)?;
    Outputs::sweep([&outputs]);
    outputs.forget();
    warn(args, &outputs);
    render_to(args, &outputs, (&signals, denoiser.as_ref()), start)
}

/// Warns of what is given in vain.
pub(super) fn warn(args: &RenderArgs, outputs: &Outputs) {
    let verbosity = Verbosity::of(args.quiet, args.verbose);
    if let Some(option) = args.look.given().filter(|_| !outputs.has_previews()) {
        verbosity.note(format_args!("pathspace: warning: {option} applies to previews alone: add --png FILE.png"));
    }
    if let Some(asked) = args.settings.threads.filter(|&asked| machine::threads(asked as usize) < asked as usize) {
        let most = machine::threads(asked as usize);
        verbosity
            .note(format_args!("pathspace: warning: --threads {asked} is more than helps here: {most} are started"));
    }
    if let Some(resume) = args.production.resume.as_ref().filter(|_| outputs.checkpoint.is_none()) {
        let problem = "cannot be written over, what is added to its state is not saved; --checkpoint FILE saves it";
        verbosity.note(format_args!("pathspace: warning: {} {problem}", resume.display()));
    }
}

fn render_to(
    args: &RenderArgs,
    outputs: &Outputs,
    (signals, denoiser): (&Signals, Option<&Oidn>),
    start: Instant,
) -> Result<u8> {
    let verbosity = Verbosity::of(args.quiet, args.verbose);
    let earlier = keeping::earlier(args.production.resume.as_deref())?;
    // Before the scene is loaded, so that addresses that are taken or nobody answers at are known at once.
    let name = args.output.as_ref().unwrap_or(&args.scene).display().to_string();
    let watchers = &RefCell::new(Watchers::start(&args.live, args.report.is_some(), &name, verbosity)?);
    let waiting = Waiting::begin(verbosity, "loading");
    let scene = &job::load(&args.scene, &args.settings, Fallback::of(args))?;
    drop(waiting);
    outputs.spare(&scene.inputs)?;
    verbosity.warnings(&scene.warnings);
    let mut seconds = Seconds { load: start.elapsed().as_secs_f64(), ..Seconds::default() };

    let mut options = job::options(args, scene);
    keeping::settle(&mut options, &args.production, earlier.as_ref());
    options.check_memory_for(scene)?;
    let waiting = Waiting::begin(verbosity, "building");
    let frame_options = options.clone();
    let renderer = Renderer::new(scene, options)?;
    drop(waiting);
    seconds.build = renderer.build_time().as_secs_f64();
    verbosity.detail(renderer.record());
    verbosity.detail(renderer.need());
    let resume = args.production.resume.as_deref();
    let (options, key, part) = (frame_options, None, None);
    let frame = Frame { args, outputs, signals, options, resume, key, part, watchers, denoiser, seconds, start };
    render_frame(&renderer, frame, earlier)
}

/// What one picture is made of besides its renderer.
pub(super) struct Frame<'f> {
    pub args: &'f RenderArgs,
    pub outputs: &'f Outputs,
    pub signals: &'f Signals,
    /// The renderer's.
    pub options: RenderOptions,
    /// Where its earlier state is from.
    pub resume: Option<&'f Path>,
    /// Who sees it while it runs.
    pub watchers: &'f RefCell<Watchers>,
    /// What filters it.
    pub denoiser: Option<&'f Oidn>,
    /// Fingerprint for its EXR.
    pub key: Option<String>,
    /// Which one of a sequence it is.
    pub part: Option<PartOf>,
    /// Times so far.
    pub seconds: Seconds,
    /// When the work for it began.
    pub start: Instant,
}

/// Renders and writes one picture, from `earlier` if there is such a state; returns the exit code.
pub(super) fn render_frame(renderer: &Renderer, frame: Frame, earlier: Option<Checkpoint>) -> Result<u8> {
    let Frame { args, outputs, signals, options, resume, watchers, denoiser, key, part, mut seconds, start } = frame;
    let verbosity = Verbosity::of(args.quiet, args.verbose);
    // A first look asks for no error: it takes what it gets in its time.
    let target = options.error.filter(|_| args.error.is_some() || !args.quick);
    let resumed = earlier.is_some();
    let about =
        keeping::about(renderer, (&args.production, outputs.checkpoint.is_some()), earlier.as_ref().zip(resume))?;
    if let Some((earlier, path)) = earlier.as_ref().zip(resume) {
        keeping::complete(renderer.plan().limits.spp, earlier, path)
            .into_iter()
            .for_each(|line| verbosity.note(format_args!("{line}")));
    }
    let accepted = about.as_ref().map(|about| about.accepted.clone()).filter(|accepted| !accepted.is_empty());
    // What previews alone had gathered is not the EXR's.
    let plan = match args.look.layers().is_empty() {
        true => None,
        false => {
            let options = options.aovs(args.layers());
            let plan = renderer.plan().again(renderer.scene(), renderer.geometry(), &options)?;
            serde_json::to_string(&PlanRecord::of(&plan, renderer.backend_info())).ok()
        }
    };
    let exr_of = |render: &Render| {
        let exr = renderer.exr_options(render).half(args.half).reproducible(args.reproducible);
        let mut exr = args.exr.apply(exr);
        if plan.is_some() {
            exr.channels = render.film.channels(&args.layers(), renderer.plan().max_depth);
            exr.plan.clone_from(&plan);
        }
        // One that was broken off is not the picture that was asked for.
        let whole = !matches!(render.stop, StopReason::Callback | StopReason::Fault | StopReason::Texture);
        exr.accepted(accepted.clone()).key(key.clone().filter(|_| whole))
    };
    let curve = if args.quick { ToneMap::Neutral } else { ToneMap::Clip };
    let look = &if outputs.has_previews() { args.look.look(renderer, curve) } else { Look::default() };
    // Several pictures on stdout would be none.
    let pictures = Outputs { stdout: false, ..outputs.clone() };
    let show = |render: &Render| {
        let mut so_far = Files::default();
        so_far.pictures(&pictures, &render.film, &exr_of(render), (look, verbosity));
        so_far.written.iter().for_each(|path| verbosity.note(format_args!("wrote {path} so far")));
        so_far.failed.iter().for_each(|e| stderr_line(format_args!("pathspace: error: {e}; the render goes on")));
    };

    watchers.borrow_mut().begin(renderer, look, part.map(|part| part.frame));

    let mut log = match &args.reference {
        Some(path) => Some(ErrorLog::open(path, renderer.plan())?),
        None => None,
    };
    signals.defer();
    let mut view = ProgressView::new(args.progress, verbosity, target, part);
    let progress = |p: &Progress| {
        view.update(p);
        watchers.borrow_mut().meanwhile(renderer, p.elapsed);
        match signals.exit_code() {
            Some(_) => ControlFlow::Break(()),
            None => ControlFlow::Continue(()),
        }
    };
    let mut keeping = Keeping::new(signals, outputs.checkpoint.clone(), about, &show);
    let watching = log.is_some() || !watchers.borrow().is_empty();
    let mut watch = |snapshot: &Snapshot| {
        log.iter_mut().for_each(|log| log.add(snapshot));
        watchers.borrow_mut().show(renderer, snapshot);
    };
    let watch = watching.then_some(&mut watch as &mut dyn FnMut(&Snapshot));
    let render = renderer.render_kept(earlier.map(|earlier| earlier.render), progress, watch, &mut keeping)?;
    watchers.borrow_mut().finish(renderer, &render);
    view.finish(&render);
    seconds.render = render.render_time.as_secs_f64();

    let writing = Instant::now();
    let kept = keeping.finish(&render);
    let (mut files, saved, mut filtered) = (Files::default(), kept.is_ok(), None);
    if let Err((error, false)) = kept {
        files.failed.push(error);
    }
    if render.film.spp().max > 0 {
        if render.film.spp().min == 0 {
            verbosity.note("pathspace: warning: stopped before every pixel had a sample; those without are black");
        }
        let mut exr = exr_of(&render);
        let filter = |filter: &Oidn| Filtered::of(&render.film, filter);
        filtered = denoiser.and_then(|denoiser| filter(denoiser).map_err(|error| files.failed.push(error)).ok());
        filtered.iter().for_each(|filtered| filtered.add_to(&mut exr));
        let look = &filtered.as_ref().map_or_else(|| look.clone(), |filtered| filtered.shown_by(look));
        files.pictures(outputs, &render.film, &exr, (look, verbosity));
        if outputs.show {
            files.failed.extend(terminal::show(&render.film, look).err());
        }
    } else {
        verbosity.note("pathspace: warning: stopped before the first sample; no picture was written");
    }
    if let (Some(log), Some(path)) = (&log, &outputs.error_log) {
        files.add(path, log.write(path));
    }
    seconds.write = writing.elapsed().as_secs_f64();
    seconds.total = start.elapsed().as_secs_f64();

    let mut stats = Stats::new(renderer, &render, seconds);
    if args.half {
        stats.bias.push(bias::half(&render.film));
    }
    stats.denoised = filtered.map(|filtered| filtered.stats);
    stats.bias.extend(stats.denoised.as_ref().map(bias::denoised));
    match &outputs.stats {
        Some(path) if path == Path::new(STREAM) => files.failed.extend(print(&to_json(&stats)).err()),
        Some(path) => files.add(path, write_text(path, &to_json(&stats))),
        None => {}
    }
    if let Some(path) = outputs.report.as_deref().filter(|_| render.film.spp().max > 0) {
        let watchers = watchers.borrow();
        let (curve, given, frame) = (watchers.curve(), Cli::given(), part.map(|part| part.frame));
        let shown = html::Shown { stats: &stats, look, aovs: &args.layers(), curve, resumed, given, frame };
        let page = html::page(renderer, &render, &shown);
        files.add(path, page.and_then(|page| keep(path, verbosity, |path| write_text(path, &plain(&page)))));
    }
    if let Some((_, path)) = outputs.checkpoint.as_ref().filter(|_| saved && render.film.spp().max > 0) {
        files.written.push(path.display().to_string());
    }
    verbosity.summary(&stats, &files.written, args.production.sample_range);
    if let Some(fault) = &render.fault {
        stderr_line(format_args!("pathspace: error: {fault}"));
    }
    for fault in renderer.scene().texture_tiles().map(|tiles| tiles.faults()).unwrap_or_default() {
        let severity = if render.stop == StopReason::Texture { "error" } else { "warning" };
        stderr_line(format_args!("pathspace: {severity}: {fault}"));
    }
    let exit = exit_code(&render, &stats, target, signals.exit_code());
    // What is not there weighs more than how the render ended. The command ends with one error, which is told then.
    if let Some(last) = files.failed.pop() {
        files.failed.iter().for_each(|error| stderr_line(format_args!("pathspace: error: {error}")));
        return Err(last);
    }
    let exit = if saved { exit } else { EXIT_FAULT };
    if exit == EXIT_TARGET_MISSED {
        verbosity.note("pathspace: warning: stopped before the error target was met");
    }
    let exit = if args.production.best_effort && exit == EXIT_TARGET_MISSED { EXIT_OK } else { exit };
    view.completed(&stats, exit);
    Ok(exit)
}

/// A signal first (the picture is not what was asked for), then samples that are not finite, then a missed target.
fn exit_code(render: &Render, stats: &Stats, target: Option<f64>, signal: Option<u8>) -> u8 {
    match (render.stop, signal) {
        (StopReason::Callback, Some(code)) => code,
        (StopReason::Fault | StopReason::Texture, _) => EXIT_FAULT,
        _ if render.counters.nonfinite > 0 => EXIT_NONFINITE,
        (StopReason::Error, _) => EXIT_OK,
        _ if target.is_some_and(|target| !stats.meets(target)) => EXIT_TARGET_MISSED,
        _ => EXIT_OK,
    }
}

/// The files of a render: what was written, and the errors of what was not. One that fails keeps no other from being
/// written.
#[derive(Default)]
struct Files {
    written: Vec<String>,
    failed: Vec<Error>,
}

impl Files {
    fn add(&mut self, path: &Path, result: Result<()>) {
        match result {
            Ok(()) => self.written.push(path.display().to_string()),
            Err(error) => self.failed.push(error),
        }
    }

    fn pictures(&mut self, outputs: &Outputs, film: &Film, exr: &ExrOptions, (look, verbosity): (&Look, Verbosity)) {
        if let Some(path) = &outputs.exr {
            self.add(path, keep(path, verbosity, |path| film.write_exr(path, exr)));
        }
        for path in &outputs.previews {
            self.add(path, keep(path, verbosity, |path| film.write_preview(path, look)));
        }
        if outputs.stdout {
            let written = look.preview(film).and_then(|preview| write_stdout(&preview.png()));
            self.add(Path::new("stdout"), written);
        }
    }
}

fn write_text(path: &Path, text: &str) -> Result<()> {
    write_atomically(path, |writer| std::io::Write::write_all(writer, text.as_bytes()))
}

/// Writes a picture that may have taken days to where it was asked for, else anywhere: its folder is made again if it
/// has vanished, and the folder of temporary files takes what no other does.
fn keep(path: &Path, verbosity: Verbosity, write: impl Fn(&Path) -> Result<()>) -> Result<()> {
    let Err(error) = write(path) else { return Ok(()) };
    let folder = path.parent().filter(|folder| *folder != Path::new("") && !folder.exists());
    if let Some(folder) = folder
        && std::fs::create_dir_all(folder).is_ok()
        && write(path).is_ok()
    {
        verbosity.note(format_args!("pathspace: warning: {} had vanished and was made again", folder.display()));
        return Ok(());
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let elsewhere = std::env::temp_dir().join(format!("pathspace-{}-{name}", std::process::id()));
    match (error, write(&elsewhere)) {
        (Error::Io { path, action, source }, Ok(())) => {
            let problem = format!("{source}; it was written to {} instead", elsewhere.display());
            Err(Error::Io { path, action, source: std::io::Error::new(source.kind(), problem) })
        }
        (error, _) => Err(error),
    }
}
