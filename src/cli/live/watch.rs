//! Everybody who sees a render, as the render sees them: called between passes and from the progress callback, both on
//! its thread.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::args::LiveArgs;
use super::frame::Frame;
use super::http::Server;
use super::page::{Request, Shared, ViewChange};
use super::tev::Tev;
use crate::cli::args::Cli;
use crate::cli::replay::story;
use crate::cli::report::Verbosity;
use crate::cli::words;
use crate::error::Result;
use crate::film::Film;
use crate::film::look::Look;
use crate::render::{Crop, Render, Renderer, Snapshot};
use crate::stats::curve::ErrorCurve;

/// Share of a render's time that showing it may take.
const SHARE: f64 = 0.01;

/// Options that the page says itself, and that say who sees it.
const OF_THE_PAGE: [&str; 5] = ["address", "serve", "serve_anywhere", "exposure", "tone_map"];

/// Options in the place of which the page puts its own, once the camera was moved.
const OF_THE_CAMERA: [&str; 4] = ["camera_orbit", "look_at", "aperture_radius", "focus_distance"];

/// Who sees a render.
pub struct Watchers {
    preview: Option<(PathBuf, Duration)>,
    look: Look,
    written: Option<Instant>,
    tev: Option<Tev>,
    page: Option<Page>,
    /// What a report shows of the error.
    curve: Option<ErrorCurve>,
    verbosity: Verbosity,
    version: u64,
    /// What showing the picture at hand and answering clients has taken, besides the very first frame.
    spent: Duration,
}

/// The page of a render.
pub struct Page {
    shared: Arc<Shared>,
    state: State,
}

/// What the page is told, JSON.
#[derive(Default, Serialize)]
struct State {
    version: u64,
    scene: String,
    /// Columns and rows of what is shown once it is complete, and where it lies in the full picture.
    full: [u32; 2],
    origin: [u32; 2],
    spp: u64,
    seconds: f64,
    /// Estimated relative error.
    error: Option<f64>,
    target: Option<f64>,
    curve: ErrorCurve,
    done: bool,
    /// Where the camera stands, if it can be moved.
    view: Option<ViewChange>,
    /// The command line that renders the same, but for the camera, and what it says of that.
    command: String,
    camera: String,
    plan: String,
}

impl Page {
    /// Serves the page.
    ///
    /// # Errors
    /// As [`Server::start`].
    pub fn start(address: &str, anywhere: bool, verbosity: Verbosity) -> Result<Self> {
        let shared = Arc::new(Shared::default());
        shared.tell(serde_json::to_string(&State::default()).unwrap_or_default());
        let server = Server::start(address, anywhere, shared.clone())?;
        verbosity.note(format_args!("see it at {}", server.url));
        let (command, camera) = command(&[]);
        Ok(Page { shared, state: State { command, camera, ..State::default() } })
    }

    /// The command line that it shows is the one of a view of `size` and `spp` samples per pixel, which is lit by the
    /// `studio` or not although nobody asked for it.
    pub fn renders(&mut self, (width, height): (u32, u32), spp: u64, studio: bool) {
        let (command, camera) = command(&["width", "height", "size", "spp"]);
        let env = if studio { " --env studio" } else { "" };
        self.state.command = format!("{command} --size {width}x{height} --spp {spp}{env}");
        self.state.camera = camera;
    }

    /// Requests of clients.
    pub fn shared(&self) -> &Shared {
        &self.shared
    }

    /// A render by `renderer` begins, of `window` of the picture in the end, from a camera that can be moved or not.
    pub fn begin(&mut self, renderer: &Renderer, window: Crop, view: Option<ViewChange>) {
        let (plan, state) = (renderer.plan(), &mut self.state);
        state.scene = renderer.scene().file.display().to_string();
        state.full = [window.width, window.height];
        state.origin = [window.x, window.y];
        state.target = plan.limits.error;
        state.view = view;
        state.plan = renderer.record().to_string();
        (state.curve, state.done) = (ErrorCurve::default(), false);
    }

    /// Shows a frame of `film`.
    pub fn show(&mut self, film: &Film, elapsed: Duration, spp: u64) {
        self.state.version += 1;
        self.shared.show(Frame::of(film).bytes());
        let error = film.error_estimate().map(|estimate| estimate.relmse.sqrt());
        (self.state.spp, self.state.seconds, self.state.error) = (spp, elapsed.as_secs_f64(), error);
        self.state.curve.push(elapsed, spp, error);
        self.tell();
    }

    /// Says that the render has ended.
    pub fn done(&mut self) {
        self.state.done = true;
        self.tell();
    }

    fn tell(&self) {
        self.shared.tell(serde_json::to_string(&self.state).unwrap_or_default());
    }

    /// The last view that was asked for.
    pub fn take_view(&self) -> Option<ViewChange> {
        let views = self.shared.take(|request| matches!(request, Request::Look(_)));
        views.into_iter().rev().find_map(|request| if let Request::Look(view) = request { Some(view) } else { None })
    }

    /// Answers those who want the path of a sample.
    pub fn answer_replays(&self, renderer: &Renderer) {
        for request in self.shared.take(|request| matches!(request, Request::Replay { .. })) {
            let Request::Replay { pixel, sample, reply } = request else { continue };
            let text = renderer.replay(pixel, sample).map_or_else(|error| error.to_string(), |replay| story(&replay));
            // A client that has gone needs no answer.
            let _ = reply.try_send(Arc::new(text.into_bytes()));
        }
    }

    /// Answers those who want the picture as OpenEXR, which is made once for all that wait.
    pub fn answer_exr(&self, renderer: &Renderer, film: &Film) {
        let requests = self.shared.take(|request| matches!(request, Request::Exr { .. }));
        if requests.is_empty() {
            return;
        }
        let path = std::env::temp_dir().join(format!("pathspace-view-{}.exr", std::process::id()));
        let written = film.write_exr(&path, &renderer.exr_of(film));
        let bytes = written.ok().and_then(|()| std::fs::read(&path).ok()).map(Arc::new);
        let _ = std::fs::remove_file(&path);
        for request in requests {
            let Request::Exr { reply } = request else { continue };
            // Without a file the client is told so by the end of the channel.
            let _ = bytes.clone().map(|bytes| reply.try_send(bytes));
        }
    }
}

impl Watchers {
    /// Connects everybody whom `args` name; tev shows the picture as `name`. For a `report` the error is noted down.
    ///
    /// # Errors
    /// Of addresses and connections.
    pub fn start(args: &LiveArgs, report: bool, name: &str, verbosity: Verbosity) -> Result<Self> {
        let page = |address: &String| Page::start(address, args.serve_anywhere, verbosity);
        Ok(Watchers {
            preview: args.preview.clone().map(|path| (path, args.every)),
            look: Look::default(),
            written: None,
            tev: args.display_server.as_deref().map(|address| Tev::connect(address, name)).transpose()?,
            page: args.serve.as_ref().map(page).transpose()?,
            curve: report.then(ErrorCurve::default),
            verbosity,
            version: 0,
            spent: Duration::ZERO,
        })
    }

    /// Whether there is nobody.
    pub fn is_empty(&self) -> bool {
        self.preview.is_none() && self.tev.is_none() && self.page.is_none() && self.curve.is_none()
    }

    /// The render begins; `look` is what a preview looks like.
    pub fn begin(&mut self, renderer: &Renderer, look: &Look) {
        (self.look, self.spent) = (look.clone(), Duration::ZERO);
        self.curve = self.curve.take().map(|_| ErrorCurve::default());
        if let Some(page) = &mut self.page {
            page.begin(renderer, renderer.plan().window, None);
        }
    }

    /// Called a few times a second, after `elapsed` of rendering.
    pub fn meanwhile(&mut self, renderer: &Renderer, elapsed: Duration) {
        if let Some(page) = self.page.as_ref().filter(|_| self.is_affordable(elapsed)) {
            let started = Instant::now();
            page.answer_replays(renderer);
            self.spent += started.elapsed();
        }
    }

    /// Whether what was shown so far has taken no more than its share of `elapsed`.
    fn is_affordable(&self, elapsed: Duration) -> bool {
        self.spent.as_secs_f64() <= SHARE * elapsed.as_secs_f64()
    }

    /// A pass has ended.
    pub fn show(&mut self, renderer: &Renderer, snapshot: &Snapshot) {
        let (started, first) = (Instant::now(), self.version == 0);
        if !first && !self.is_affordable(snapshot.elapsed) {
            return;
        }
        self.version += 1;
        self.show_now(snapshot.film, snapshot.elapsed, snapshot.spp, false);
        if let Some(page) = &self.page {
            page.answer_exr(renderer, snapshot.film);
        }
        if !first {
            self.spent += started.elapsed();
        }
    }

    /// The render has ended: the last frame is shown whatever it takes.
    pub fn finish(&mut self, renderer: &Renderer, render: &Render) {
        self.show_now(&render.film, render.render_time, render.film.spp().min, true);
        if let Some(page) = &mut self.page {
            page.answer_exr(renderer, &render.film);
            page.done();
        }
    }

    /// How the error of the picture at hand has fallen.
    pub fn curve(&self) -> Option<&ErrorCurve> {
        self.curve.as_ref()
    }

    fn show_now(&mut self, film: &Film, elapsed: Duration, spp: u64, last: bool) {
        if let Some(curve) = &mut self.curve {
            curve.push(elapsed, spp, film.error_estimate().map(|estimate| estimate.relmse.sqrt()));
        }
        if let Some(page) = &mut self.page {
            page.show(film, elapsed, spp);
        }
        if let Some((path, every)) = &self.preview
            && (last || self.written.is_none_or(|written| written.elapsed() >= *every))
        {
            self.written = Some(Instant::now());
            if let Err(error) = film.write_preview(path, &self.look) {
                self.verbosity.note(format_args!("pathspace: warning: the preview is given up: {error}"));
                self.preview = None;
            }
        }
        if let Some(tev) = self.tev.as_mut().filter(|tev| last || tev.is_due())
            && let Err(error) = tev.show(&Frame::of(film))
        {
            self.verbosity.note(format_args!("pathspace: warning: tev is left behind: {error}"));
            self.tev = None;
        }
    }
}

/// This command line as one that renders, but for the options `left_out` and those that the page says itself; and what
/// it says of the camera.
fn command(left_out: &[&str]) -> (String, String) {
    let mut given = Cli::given();
    given.retain(|(option, _)| !OF_THE_PAGE.contains(&option.as_str()) && !left_out.contains(&option.as_str()));
    let (camera, rest): (Vec<_>, Vec<_>) =
        given.into_iter().partition(|(option, _)| OF_THE_CAMERA.contains(&option.as_str()));
    (format!("pathspace render{}", words::line(&rest)), words::line(&camera))
}
