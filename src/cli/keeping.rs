//! The state of a render on the command line: saved each so often and at the end, gone on with, and the picture so far
//! on SIGUSR1.
//!
//! A checkpoint is written by a thread of its own, from a copy of the film, while the workers go on. One that cannot be
//! written leaves the last good one as it is and does not end the render: the process says so at once and exits with 1
//! in the end, unless the last one could be written.

use std::path::{Path, PathBuf};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::production::ProductionArgs;
use super::report::stderr_line;
use super::signal::Signals;
use crate::error::{Error, Result};
use crate::render::checkpoint::{About, Checkpoint};
use crate::render::identity::MAY_DIFFER;
use crate::render::{Keeper, Render, RenderOptions, Renderer, State};

/// Reads the state to go on from, if there is one.
///
/// # Errors
/// As [`Checkpoint::restore`].
pub fn earlier(path: Option<&Path>) -> Result<Option<Checkpoint>> {
    path.map(Checkpoint::restore).transpose()
}

/// Settles which samples are rendered: by the command line, else as the earlier render was to do.
pub fn settle(options: &mut RenderOptions, args: &ProductionArgs, earlier: Option<&Checkpoint>) {
    if let Some(earlier) = earlier {
        let goal = earlier.about.goal;
        options.sample_start = earlier.render.film.first_sample;
        if options.spp.is_none() && options.time.is_none() && options.error.is_none() {
            (options.spp, options.error, options.min_spp) = (goal.spp, goal.error, goal.min_spp);
        }
    }
    if let Some((start, end)) = args.sample_range {
        (options.sample_start, options.spp) = (start, Some(end - start));
    }
}

/// A line about a state that has all samples already that are `asked` for.
pub fn complete(asked: Option<u64>, earlier: &Checkpoint, path: &Path) -> Option<String> {
    let (has, asked) = (earlier.render.samples(), asked?);
    (has >= asked).then(|| {
        let more = if has > asked { format!(", more than the {asked} asked for") } else { String::new() };
        format!("{} has {has} samples per pixel already{more}: its picture is written as it is", path.display())
    })
}

/// What belongs to the states of `renderer`, which goes on from `earlier`, read from that file; `None` where none is
/// `saved` or read.
///
/// # Errors
/// [`Error::Option`] naming what differs, unless it is accepted.
pub fn about(
    renderer: &Renderer,
    (args, saved): (&ProductionArgs, bool),
    earlier: Option<(&Checkpoint, &Path)>,
) -> Result<Option<About>> {
    if !saved && earlier.is_none() {
        return Ok(None);
    }
    let mut about = About::of(renderer)?;
    let Some((earlier, path)) = earlier else { return Ok(Some(about)) };
    about.accepted.clone_from(&earlier.about.accepted);
    // One that has more than it was asked for now is complete all the same.
    about.goal.spp = about.goal.spp.map(|asked| asked.max(earlier.render.film.spp().min));
    for (name, there, here) in earlier.about.identity.differences(&about.identity) {
        if args.accept_different.contains(&name) {
            about.accepted.push_str(&format!("{name}: {there}, then {here}\n"));
            continue;
        }
        let hint = match MAY_DIFFER.contains(&name.as_str()) {
            true => format!("; --accept-different {name} goes on all the same"),
            false => String::new(),
        };
        let problem = format!("{}: its {name} is {there}, here it is {here}{hint}", path.display());
        return Err(Error::Option { option: "--resume", problem });
    }
    Ok(Some(about))
}

/// Keeps the state of one render.
pub struct Keeping<'k> {
    signals: &'k Signals,
    /// How often, and where.
    every: Option<(Duration, PathBuf)>,
    about: Option<About>,
    /// Writes the picture of a render that goes on.
    show: &'k dyn Fn(&Render),
    saved: Instant,
    shown: bool,
    writer: Option<JoinHandle<Result<()>>>,
    /// Whether it was said that a checkpoint could not be written.
    told: bool,
}

impl<'k> Keeping<'k> {
    /// Saves as `every` says.
    pub fn new(
        signals: &'k Signals,
        every: Option<(Duration, PathBuf)>,
        about: Option<About>,
        show: &'k dyn Fn(&Render),
    ) -> Self {
        Keeping { signals, every, about, show, saved: Instant::now(), shown: true, writer: None, told: false }
    }

    /// Saves the last state, that of `render`.
    ///
    /// # Errors
    /// The reason why it could not be written. It is not told yet if the second value is false.
    pub fn finish(mut self, render: &Render) -> Result<(), (Error, bool)> {
        self.collect(true);
        match (&self.every, &self.about) {
            (Some((_, path)), Some(about)) if render.film.spp().max > 0 => {
                about.save(render, path).map_err(|error| (error, self.told))
            }
            _ => Ok(()),
        }
    }

    /// Looks how the last write ended; waits for it if it must.
    fn collect(&mut self, wait: bool) {
        let Some(writer) = self.writer.take_if(|writer| wait || writer.is_finished()) else { return };
        let ended = writer
            .join()
            .unwrap_or_else(|_| Err(Error::io(self.path(), "write", std::io::Error::other("the writer failed"))));
        if let Err(error) = ended {
            self.tell(&error);
        }
    }

    /// Says that a checkpoint could not be written, once.
    fn tell(&mut self, error: &Error) {
        if !std::mem::replace(&mut self.told, true) {
            stderr_line(format_args!(
                "pathspace: error: {error}; the render goes on, the last good checkpoint is kept"
            ));
        }
    }

    fn path(&self) -> &Path {
        self.every.as_ref().map_or(Path::new(""), |(_, path)| path)
    }
}

impl Keeper for Keeping<'_> {
    fn keeps_copies(&self) -> bool {
        self.every.is_some()
    }

    fn is_due(&mut self) -> bool {
        self.collect(false);
        self.shown = !self.signals.take_request();
        let save = self.every.as_ref().is_some_and(|(every, _)| self.saved.elapsed() >= *every);
        !self.shown || (save && self.writer.is_none())
    }

    fn keep(&mut self, state: State) {
        if !state.has_samples() {
            return;
        }
        if !std::mem::replace(&mut self.shown, true) {
            (self.show)(&state.clone().into_render());
        }
        let (Some((every, path)), Some(about)) = (&self.every, &self.about) else { return };
        if self.saved.elapsed() < *every || self.writer.is_some() {
            return;
        }
        self.saved = Instant::now();
        let (about, path) = (about.clone(), path.clone());
        let writer = thread::Builder::new().name("checkpoint".into()).spawn(move || about.save_state(&state, &path));
        match writer {
            Ok(writer) => self.writer = Some(writer),
            Err(source) => self.tell(&Error::io(self.path(), "write", source)),
        }
    }
}
