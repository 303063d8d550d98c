//! What a render tells while it runs. Times are rendering times: the clock is paused while a picture is shown.

use std::time::Duration;

use super::result::State;
use crate::accuracy::predict::Predicted;
use crate::film::Film;

/// Where a running render is; handed to the callback a few times a second.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
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
    /// What meeting the error target costs in all, if there is a target and the checks so far tell.
    pub predicted: Option<Predicted>,
}

/// A render after a pass: what `Renderer::render_watched` shows.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Snapshot<'a> {
    /// Rendering time so far, without what was spent on showing this.
    pub elapsed: Duration,
    /// Samples every pixel has.
    pub spp: u64,
    /// The picture.
    pub film: &'a Film,
}

/// Who keeps the state of a running render: [`Renderer::render_kept`](super::Renderer::render_kept).
pub trait Keeper {
    /// Whether it holds a copy of the state while the render goes on: memory for one is then seen to beforehand.
    fn keeps_copies(&self) -> bool {
        true
    }

    /// Whether it wants the state now; asked a few times a second.
    fn is_due(&mut self) -> bool;

    /// Takes a copy of the state, to be saved or shown. Workers within a pass go on meanwhile, and wait at its end.
    fn keep(&mut self, state: State);
}
