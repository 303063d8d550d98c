//! What a render tells: while it runs ([`Progress`], [`Checkpoint`], [`Forecast`]) and when it has ended ([`Render`] and
//! its [`StopReason`]). Records without behaviour; times are rendering times, in which the clock stands while a picture
//! is shown.

use std::time::Duration;

use crate::accuracy::predict::Predicted;
use crate::film::Film;
use crate::film::aov::FirstHit;
use crate::film::lengths::LengthSums;
use crate::plan::options::Crop;
use crate::wavefront::Counters;

/// Where a running render is; handed to the callback between passes.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Since the first pass began.
    pub elapsed: Duration,
    /// Samples every pixel has by now.
    pub spp: u64,
    /// Fraction of the work done, in [0, 1], by whichever limit is nearest.
    pub fraction: f64,
    /// Estimated relMSE so far; `None` until both halves have samples.
    pub relmse: Option<f64>,
    /// Rays traced so far, all classes.
    pub rays: u64,
    /// What meeting the error target costs in all, if there is a target and the looks so far tell.
    pub predicted: Option<Predicted>,
}

/// A render after a pass: what [`Renderer::render_watched`](super::Renderer::render_watched) shows.
#[derive(Clone, Copy, Debug)]
pub struct Checkpoint<'a> {
    /// Rendering time so far, without what was spent on showing this.
    pub elapsed: Duration,
    /// Samples every pixel has.
    pub spp: u64,
    /// The picture.
    pub film: &'a Film,
}

/// A prediction and when it was made.
#[derive(Clone, Copy, Debug, PartialEq)]
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
pub enum StopReason {
    /// The samples asked for are done.
    Spp,
    /// Time is up.
    Time,
    /// The error target is met.
    Error,
    /// The callback broke off (a signal, on the command line).
    Callback,
}

impl StopReason {
    /// Spelling in the statistics' `stop`.
    pub fn name(self) -> &'static str {
        match self {
            StopReason::Spp => "spp",
            StopReason::Time => "time",
            StopReason::Error => "error",
            StopReason::Callback => "signal",
        }
    }
}

/// A finished (or stopped) render.
#[derive(Debug)]
pub struct Render {
    /// The picture: sums and counts per pixel.
    pub film: Film,
    /// What was traced.
    pub counters: Counters,
    /// One image per path length, if asked for.
    pub lengths: Option<LengthSums>,
    /// What camera rays meet first, one entry a pixel of the window, if asked for.
    pub first_hits: Option<Vec<FirstHit>>,
    /// Wall time of the passes.
    pub render_time: Duration,
    /// Why it ended.
    pub stop: StopReason,
    /// What the pilot of a render with an error target predicted.
    pub forecast: Option<Forecast>,
}

impl Render {
    /// A render before its first pass: a film without samples, nothing traced.
    pub(super) fn unbegun(resolution: (u32, u32), window: Crop) -> Self {
        Render {
            film: Film::new(resolution, window),
            counters: Counters::default(),
            lengths: None,
            first_hits: None,
            render_time: Duration::ZERO,
            stop: StopReason::Spp,
            forecast: None,
        }
    }
}
