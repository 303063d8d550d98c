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
use crate::cli::replay::story;
use crate::cli::report::Verbosity;
use crate::error::Result;
use crate::film::Film;
use crate::film::look::Look;
use crate::render::{Render, Renderer, Snapshot};

/// Share of a render's time that showing it may take.
const SHARE: f64 = 0.01;

/// Most points of the page's curve.
const MOST_POINTS: usize = 400;

/// Who sees a render.
pub struct Watchers {
    preview: Option<(PathBuf, Duration)>,
    look: Look,
    written: Option<Instant>,
    tev: Option<Tev>,
    page: Option<Page>,
    verbosity: Verbosity,
    version: u64,
    /// What showing frames has taken, besides the first.
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
    /// Seconds and error, pass by pass.
    curve: Vec<[f64; 2]>,
    done: bool,
    /// Where the camera stands, if it can be moved.
    view: Option<ViewChange>,
    /// The command line that renders the same, but for the view.
    command: String,
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
        Ok(Page { shared, state: State { command: command(), ..State::default() } })
    }

    /// Requests of clients.
    pub fn shared(&self) -> &Shared {
        &self.shared
    }

    /// A render by `renderer` begins, of a picture of `full` columns and rows in the end, from a camera that can be
    /// moved or not.
    pub fn begin(&mut self, renderer: &Renderer, full: [u32; 2], view: Option<ViewChange>) {
        let (plan, state) = (renderer.plan(), &mut self.state);
        state.scene = renderer.scene().file.display().to_string();
        state.full = full;
        state.origin = [plan.window.x, plan.window.y];
        state.target = plan.limits.error;
        state.view = view;
        state.plan = renderer.record().to_string();
        (state.curve, state.done) = (Vec::new(), false);
    }

    /// Shows a frame of `film`.
    pub fn show(&mut self, film: &Film, elapsed: Duration, spp: u64) {
        self.state.version += 1;
        self.shared.show(Frame::of(film, self.state.version));
        let error = film.error_estimate().map(|estimate| estimate.relmse.sqrt());
        (self.state.spp, self.state.seconds, self.state.error) = (spp, elapsed.as_secs_f64(), error);
        if let Some(error) = error.filter(|error| error.is_finite()) {
            self.state.curve.push([elapsed.as_secs_f64(), error]);
            if self.state.curve.len() > MOST_POINTS {
                let mut number = 0;
                self.state.curve.retain(|_| (number += 1, number % 2 == 0).1);
            }
        }
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
            let _ = reply.try_send(text.into_bytes());
        }
    }

    /// Answers those who want the picture as OpenEXR.
    pub fn answer_exr(&self, renderer: &Renderer, film: &Film) {
        for request in self.shared.take(|request| matches!(request, Request::Exr { .. })) {
            let Request::Exr { reply } = request else { continue };
            let path = std::env::temp_dir().join(format!("pathspace-view-{}.exr", std::process::id()));
            let written = film.write_exr(&path, &renderer.exr_of(film));
            let bytes = written.ok().and_then(|()| std::fs::read(&path).ok());
            let _ = std::fs::remove_file(&path);
            // Without a file the client is told so by the end of its wait.
            let _ = bytes.map(|bytes| reply.try_send(bytes));
        }
    }
}

impl Watchers {
    /// Connects everybody whom `args` name; tev shows the picture as `name`.
    ///
    /// # Errors
    /// Of addresses and connections.
    pub fn start(args: &LiveArgs, name: &str, verbosity: Verbosity) -> Result<Self> {
        let page = |address: &String| Page::start(address, args.serve_anywhere, verbosity);
        Ok(Watchers {
            preview: args.preview.clone().map(|path| (path, args.every)),
            look: Look::default(),
            written: None,
            tev: args.display_server.as_deref().map(|address| Tev::connect(address, name)).transpose()?,
            page: args.serve.as_ref().map(page).transpose()?,
            verbosity,
            version: 0,
            spent: Duration::ZERO,
        })
    }

    /// Whether there is nobody.
    pub fn is_empty(&self) -> bool {
        self.preview.is_none() && self.tev.is_none() && self.page.is_none()
    }

    /// The render begins; `look` is what a preview looks like.
    pub fn begin(&mut self, renderer: &Renderer, look: &Look) {
        self.look = look.clone();
        if let Some(page) = &mut self.page {
            let window = renderer.plan().window;
            page.begin(renderer, [window.width, window.height], None);
        }
    }

    /// Called a few times a second.
    pub fn meanwhile(&self, renderer: &Renderer) {
        if let Some(page) = &self.page {
            page.answer_replays(renderer);
        }
    }

    /// A pass has ended.
    pub fn show(&mut self, renderer: &Renderer, snapshot: &Snapshot) {
        let affordable = self.spent.as_secs_f64() <= SHARE * snapshot.elapsed.as_secs_f64();
        if affordable || self.version == 0 {
            let (started, first) = (Instant::now(), self.version == 0);
            self.version += 1;
            self.show_now(snapshot.film, snapshot.elapsed, snapshot.spp, false);
            if !first {
                self.spent += started.elapsed();
            }
        }
        if let Some(page) = &self.page {
            page.answer_exr(renderer, snapshot.film);
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

    fn show_now(&mut self, film: &Film, elapsed: Duration, spp: u64, last: bool) {
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
            && let Err(error) = tev.show(&Frame::of(film, self.version))
        {
            self.verbosity.note(format_args!("pathspace: warning: tev is left behind: {error}"));
            self.tev = None;
        }
    }
}

/// This command line as one that renders: without what serves.
fn command() -> String {
    let mut words = std::env::args().skip(1).peekable();
    let mut line = String::from("pathspace render");
    words.next_if(|word| word == "view" || word == "render");
    let mut value_follows = false;
    for word in words {
        let skipped = std::mem::replace(&mut value_follows, word == "--address");
        if skipped || value_follows || word.starts_with("--serve") || word.starts_with("--address=") {
            continue;
        }
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_./,:=%+#".contains(c);
        line.push(' ');
        match !word.is_empty() && word.chars().all(plain) {
            true => line.push_str(&word),
            false => line.push_str(&format!("'{}'", word.replace('\'', r"'\''"))),
        }
    }
    line
}
