//! What a render has come to when it ends: the film, counts, and why it ended.

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use crate::accuracy::predict::Predicted;
use crate::error::{Error, Result};
use crate::film::Film;
use crate::film::blocks::Blocks;
use crate::film::splats::Splats;
use crate::transport::counters::Counters;

/// A prediction and when it was made.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Forecast {
    /// Seconds of rendering by then.
    pub after_seconds: f64,
    /// Samples per pixel by then.
    pub after_spp: u64,
    /// What was predicted for the whole render.
    pub predicted: Predicted,
}

/// Why a render ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StopReason {
    /// The samples asked for are done.
    Spp,
    /// Time is up.
    Time,
    /// The error target is met.
    Error,
    /// The callback broke off (a signal, on the command line).
    Callback,
    /// A worker failed: [`Render::fault`] says where. What the others had rendered is kept.
    Fault,
    /// A texture could not be read any more: [`Scene::check_textures`](crate::Scene::check_textures) says which. The
    /// picture is as it was before.
    Texture,
}

impl StopReason {
    /// Spelling in the statistics' `stop`.
    pub fn name(self) -> &'static str {
        match self {
            StopReason::Spp => "spp",
            StopReason::Time => "time",
            StopReason::Error => "error",
            StopReason::Callback => "signal",
            StopReason::Fault => "fault",
            StopReason::Texture => "texture",
        }
    }
}

/// Where a worker failed, which is a fault of this library or of one below it.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Fault {
    /// First pixel of the tile, in the full image.
    pub tile: (u32, u32),
    /// A pixel of the full image whose sample fails again; the first of those at hand, where none does.
    pub pixel: (u32, u32),
    /// Its sample.
    pub sample: u64,
    /// Whether that sample fails when it is rendered alone.
    pub repeats: bool,
    /// What the worker said.
    pub problem: String,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ((left, top), (x, y)) = (self.tile, self.pixel);
        let when = if self.repeats { "at" } else { "from, though not when it is rendered alone," };
        write!(f, "a worker failed in the tile at {left},{top} {when} pixel {x},{y} sample {}: ", self.sample)?;
        f.write_str(&self.problem)
    }
}

/// What passes add up.
#[derive(Clone, Debug)]
pub(super) struct Totals {
    /// All layers.
    pub film: Blocks,
    /// What light paths have found for the beauty; shared while they are traced.
    pub splats: Option<Arc<Splats>>,
    /// What was traced for them.
    pub counters: Counters,
}

/// The state of a running render: a [`Render`] whose blocks of samples are not added up to a picture yet.
#[derive(Clone, Debug)]
pub struct State {
    pub(super) totals: Totals,
    pub(super) render_time: Duration,
    /// As of a [`Render`].
    pub(super) check: Option<(f64, u64)>,
}

impl Totals {
    /// The picture.
    pub fn picture(&self) -> Cow<'_, Film> {
        let Some(splats) = &self.splats else { return self.film.total() };
        let mut film = self.film.total().into_owned();
        splats.add_to(&mut film);
        Cow::Owned(film)
    }

    /// The picture, and its parts where it is not one block of camera samples alone.
    pub fn finish(self) -> (Film, Vec<Film>, Option<Arc<Splats>>) {
        let (mut film, mut blocks) = self.film.finish();
        if let Some(splats) = &self.splats {
            if blocks.is_empty() {
                blocks.push(film.clone());
            }
            splats.add_to(&mut film);
        }
        (film, blocks, self.splats)
    }
}

impl State {
    /// Whether any pixel has a sample.
    pub fn has_samples(&self) -> bool {
        self.totals.film.films()[0].spp().max > 0
    }

    /// With the picture so far.
    pub fn into_render(self) -> Render {
        let State { totals, render_time, check } = self;
        let (counters, stop) = (totals.counters.clone(), StopReason::Callback);
        let (film, blocks, splats) = totals.finish();
        Render { film, blocks, splats, counters, render_time, stop, check, forecast: None, fault: None }
    }
}

/// A finished (or stopped) render.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Render {
    /// The picture: all layers that were asked for.
    pub film: Film,
    /// Its blocks of samples, of which it is the sum, from the largest to the smallest; none where it is one block.
    pub(super) blocks: Vec<Film>,
    /// What light paths have added to it.
    pub(super) splats: Option<Arc<Splats>>,
    /// What was traced.
    pub counters: Counters,
    /// Wall time of the passes.
    pub render_time: Duration,
    /// Why it ended.
    pub stop: StopReason,
    /// The error target, and at how many samples per pixel it is checked next.
    pub(super) check: Option<(f64, u64)>,
    /// What the pilot of a render with an error target predicted.
    pub forecast: Option<Forecast>,
    /// Where a worker failed, if one has.
    pub fault: Option<Fault>,
}

impl Render {
    /// A render before its first pass: nothing is traced yet.
    pub(super) fn before(film: Film) -> Self {
        Render {
            film,
            blocks: Vec::new(),
            splats: None,
            counters: Counters::default(),
            render_time: Duration::ZERO,
            stop: StopReason::Spp,
            check: None,
            forecast: None,
            fault: None,
        }
    }

    /// Samples that every pixel has, with all their light paths.
    pub(crate) fn samples(&self) -> u64 {
        let of_lights = self.splats.as_ref().map_or(u64::MAX, |splats| splats.samples());
        self.film.spp().min.min(of_lights)
    }

    /// The same, at its end: all samples are done.
    pub(super) fn complete(self) -> Self {
        Render { stop: StopReason::Spp, ..self }
    }

    /// Whether no worker failed.
    ///
    /// # Errors
    /// [`Error::Backend`] with the [`fault`](Self::fault).
    pub fn check_fault(&self) -> Result<()> {
        match &self.fault {
            Some(fault) => Err(Error::Backend { backend: "render", problem: fault.to_string() }),
            None => Ok(()),
        }
    }

    /// What passes add up, to be gone on with.
    pub(super) fn into_totals(self) -> Totals {
        let blocks = if self.blocks.is_empty() { vec![self.film] } else { self.blocks };
        Totals { film: Blocks::of(blocks), splats: self.splats, counters: self.counters }
    }
}
