//! The library's front door: a scene and options in, a film and statistics out. Runs passes of samples over tiles on a
//! pool of its own, calls back between passes, and stops when the first of the limits is met.

use std::ops::ControlFlow;
use std::time::Duration;

use crate::backend::BackendInfo;
use crate::error::Result;
use crate::film::Film;
use crate::plan::RenderPlan;
use crate::scene::Scene;
use crate::wavefront::Counters;

pub use crate::plan::options::{CameraChoice, Crop, FilterKind, Lens, RenderOptions, Roulette, SamplerKind, Strategy};

/// Where a running render is; handed to the callback between passes.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Since the first pass began.
    pub elapsed: Duration,
    /// Samples every pixel has by now.
    pub spp: u64,
    /// Fraction of the work done, in [0,1], by whichever limit is nearest.
    pub fraction: f64,
    /// Estimated relMSE so far; `None` until both halves have samples.
    pub relmse: Option<f64>,
    /// Rays traced so far, all classes.
    pub rays: u64,
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
    /// Wall time of the passes.
    pub render_time: Duration,
    /// Why it ended.
    pub stop: StopReason,
}

/// A scene made ready: plan, acceleration structure, light tables.
pub struct Renderer<'a> {
    scene: &'a Scene,
}

impl<'a> Renderer<'a> {
    /// Resolves the options against the scene and builds the backend.
    ///
    /// # Errors
    /// [`Error::Option`](crate::Error::Option) for options out of range, [`Error::Backend`](crate::Error::Backend)
    /// when the backend cannot be built.
    pub fn new(scene: &'a Scene, _options: RenderOptions) -> Result<Self> {
        Ok(Renderer { scene })
    }

    /// The resolved decisions.
    pub fn plan(&self) -> &RenderPlan {
        let _ = self.scene;
        unimplemented!("filled in by the integrator's branch")
    }

    /// The backend that traces.
    pub fn backend_info(&self) -> &BackendInfo {
        unimplemented!("filled in by the integrator's branch")
    }

    /// Wall time of building the acceleration structure and the light tables.
    pub fn build_time(&self) -> Duration {
        unimplemented!("filled in by the integrator's branch")
    }

    /// Renders to the first limit that is met.
    pub fn render(&self) -> Result<Render> {
        self.render_with(|_| ControlFlow::Continue(()))
    }

    /// Renders, calling `progress` on this thread between passes and at least a few times a second.
    pub fn render_with(&self, _progress: impl FnMut(&Progress) -> ControlFlow<()>) -> Result<Render> {
        unimplemented!("filled in by the integrator's branch")
    }
}
