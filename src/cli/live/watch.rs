//! Everybody who sees a render, as the render sees them: called between passes and from the progress callback, both on
//! its thread.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::args::LiveArgs;
use super::frame::Frame;
use super::http::Server;
use super::layers::{self, Layer};
use super::page::{Bytes, Request, Shared, ViewChange};
use super::tev::Tev;
use crate::cli::args::Cli;
use crate::cli::replay::story;
use crate::cli::report::Verbosity;
use crate::cli::words;
use crate::error::Result;
use crate::film::Film;
use crate::film::look::Look;
use crate::plan::Bias;
use crate::render::{Crop, Render, Renderer, Snapshot};
use crate::stats::bias::ledger;
use crate::stats::curve::ErrorCurve;

/// Share of a render's time that showing it may take.
const SHARE: f64 = 0.01;

/// Options that the page says itself, and that say who sees it.
const OF_THE_PAGE: [&str; 5] = ["address", "serve", "serve_anywhere", "exposure", "tone_map"];

/// Options in the place of which the page puts its own: once the camera was moved, the lens changed, the environment
/// turned.
const OF_THE_VIEW: [&[&str]; 3] =
    [&["camera_orbit", "look_at"], &["aperture_radius", "focus_distance"], &["env_rotation"]];

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
    /// What was said in the place of [`OF_THE_VIEW`].
    said: [String; 3],
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
    /// Where it stood when nobody had moved it.
    home: Option<ViewChange>,
    /// Layers that can be shown, and names of those that only another render has.
    layers: Vec<Layer>,
    beyond: Vec<&'static str>,
    /// The ledger of biases: of the plan, and once the render has ended as it was measured.
    bias: Vec<Bias>,
    /// The command line that renders the same, but for what a view can change, and what it says of that.
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
        Ok(Page { shared, state: State { command: command(None), ..State::default() }, said: Default::default() })
    }

    /// It shows views from now on, of `size` and `spp` samples per pixel, at first as of `home`, lit by the `studio` or
    /// not and by `techniques` although nobody asked for them. The command line is that of a render.
    pub fn shows_views(
        &mut self,
        (width, height): (u32, u32),
        spp: u64,
        (studio, techniques): (bool, &str),
        home: ViewChange,
    ) {
        let mut rest = given(&["width", "height", "size", "spp"], None);
        self.said = OF_THE_VIEW.map(|of| {
            let (said, others) =
                std::mem::take(&mut rest).into_iter().partition(|(option, _)| of.contains(&option.as_str()));
            rest = others;
            words::line(&said)
        });
        let env = if studio { " --env studio" } else { "" };
        let rest = words::line(&rest);
        self.state.command = format!("pathspace render{rest} --size {width}x{height} --spp {spp}{env}{techniques}");
        self.state.home = Some(home);
    }

    /// The end of the command line that renders `view`.
    fn tail(&self, view: &ViewChange) -> String {
        let ViewChange { azimuth, elevation, distance, target: [x, y, z], aperture, .. } = view;
        let home = self.state.home.as_ref().unwrap_or(view);
        let [camera, lens, turn] = &self.said;
        let mut tail = match view.stands_as(home) {
            true => camera.clone(),
            false => format!(" --camera-orbit={azimuth},{elevation},{distance} --look-at={x},{y},{z}"),
        };
        tail += &match view.sees_as(home) {
            true => lens.clone(),
            false if *aperture > 0.0 => format!(" --aperture-radius {aperture} --focus-distance {distance}"),
            false => String::new(),
        };
        tail += &match view.rotation.filter(|_| !view.is_lit_as(home)) {
            Some(degrees) => format!(" --env-rotation={degrees}"),
            None => turn.clone(),
        };
        if !view.layers.is_empty() {
            tail += &format!(" --aov {}", view.layers.join(","));
        }
        tail
    }

    /// Requests of clients.
    pub fn shared(&self) -> &Shared {
        &self.shared
    }

    /// A render by `renderer` begins, of `window` of the picture in the end, from a camera that can be moved or not.
    pub fn begin(&mut self, renderer: &Renderer, window: Crop, view: Option<ViewChange>) {
        let camera = view.as_ref().map_or(String::new(), |view| self.tail(view));
        let (plan, state) = (renderer.plan(), &mut self.state);
        state.scene = renderer.scene().file.display().to_string();
        state.full = [window.width, window.height];
        state.origin = [window.x, window.y];
        state.target = plan.limits.error;
        state.camera = camera;
        state.beyond = if view.is_some() { layers::beyond(plan) } else { Vec::new() };
        state.view = view;
        let mut record = renderer.record();
        state.bias = std::mem::take(&mut record.bias);
        state.plan = record.to_string();
        (state.curve, state.done) = (ErrorCurve::default(), false);
    }

    /// Shows a frame of `film`, which `renderer` makes.
    pub fn show(&mut self, renderer: &Renderer, film: &Film, elapsed: Duration, spp: u64) {
        if self.state.curve.points().is_empty() {
            self.state.layers = layers::of(renderer.plan(), film);
        }
        self.state.version += 1;
        self.shared.show(Frame::of(film).bytes());
        let error = film.error_estimate().map(|estimate| estimate.relmse.sqrt());
        (self.state.spp, self.state.seconds, self.state.error) = (spp, elapsed.as_secs_f64(), error);
        self.state.curve.push(elapsed, spp, error);
        self.tell();
    }

    /// Says that a render by `renderer` has ended.
    pub fn done(&mut self, renderer: &Renderer, render: &Render) {
        self.state.done = true;
        self.state.bias = ledger(renderer.plan(), render);
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

    /// Answers those who want what is made of the film: layers, and the picture as OpenEXR.
    pub fn answer(&self, renderer: &Renderer, film: &Film) {
        self.answer_layers(renderer, film);
        self.answer_exr(renderer, film);
    }

    fn answer_layers(&self, renderer: &Renderer, film: &Film) {
        let mut made: Vec<(usize, Bytes)> = Vec::new();
        for request in self.shared.take(|request| matches!(request, Request::Layer { .. })) {
            let Request::Layer { number, reply } = request else { continue };
            // A layer that is not there is told by the end of the channel.
            let Some(layer) = self.state.layers.get(number) else { continue };
            let earlier = made.iter().find(|(of, _)| *of == number).map(|(_, file)| file.clone());
            let file = earlier.unwrap_or_else(|| {
                made.push((number, layers::file(layer, renderer.plan(), film)));
                made[made.len() - 1].1.clone()
            });
            let _ = reply.try_send(file);
        }
    }

    /// The picture is written once for all that wait.
    fn answer_exr(&self, renderer: &Renderer, film: &Film) {
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

    /// The render begins, of that `frame` of a sequence; `look` is what a preview looks like.
    pub fn begin(&mut self, renderer: &Renderer, look: &Look, frame: Option<u32>) {
        (self.look, self.spent) = (look.clone(), Duration::ZERO);
        self.curve = self.curve.take().map(|_| ErrorCurve::default());
        if let Some(page) = &mut self.page {
            page.begin(renderer, renderer.plan().window, None);
            page.state.command = command(frame);
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
        self.show_now(renderer, snapshot.film, snapshot.elapsed, snapshot.spp, false);
        if let Some(page) = &self.page {
            page.answer(renderer, snapshot.film);
        }
        if !first {
            self.spent += started.elapsed();
        }
    }

    /// The render has ended: the last frame is shown whatever it takes.
    pub fn finish(&mut self, renderer: &Renderer, render: &Render) {
        self.show_now(renderer, &render.film, render.render_time, render.film.spp().min, true);
        if let Some(page) = &mut self.page {
            page.answer(renderer, &render.film);
            page.done(renderer, render);
        }
    }

    /// How the error of the picture at hand has fallen.
    pub fn curve(&self) -> Option<&ErrorCurve> {
        self.curve.as_ref()
    }

    fn show_now(&mut self, renderer: &Renderer, film: &Film, elapsed: Duration, spp: u64, last: bool) {
        if let Some(curve) = &mut self.curve {
            curve.push(elapsed, spp, film.error_estimate().map(|estimate| estimate.relmse.sqrt()));
        }
        if let Some(page) = &mut self.page {
            page.show(renderer, film, elapsed, spp);
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

/// Options by their names, each with its words.
type Given = Vec<(String, Vec<String>)>;

/// This command line as one that renders, of a sequence that `frame` alone, but for what the page says itself.
fn command(frame: Option<u32>) -> String {
    format!("pathspace render{}", words::line(&given(&[], frame)))
}

fn given(left_out: &[&str], frame: Option<u32>) -> Given {
    let mut given = Cli::given();
    if let Some(frame) = frame {
        given = words::of_frame(given, frame);
    }
    given.retain(|(option, _)| !OF_THE_PAGE.contains(&option.as_str()) && !left_out.contains(&option.as_str()));
    given
}
