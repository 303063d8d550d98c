//! The library's front door: a scene and options in, a film and statistics out. Runs passes of samples over tiles on a
//! pool of its own, calls back between passes, and stops when the first of the limits is met.

use std::ops::ControlFlow;
use std::time::Duration;

use crate::backend::{BackendInfo, BackendKind, QueryMode};
use crate::error::Result;
use crate::film::Film;
use crate::film::filter::FilterKind;
use crate::plan::RenderPlan;
use crate::sampler::SamplerKind;
use crate::scene::Scene;
use crate::wavefront::Counters;

/// Rectangle of pixels inside the full image, in pixels from its top left corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crop {
    /// Left column.
    pub x: u32,
    /// Top row.
    pub y: u32,
    /// Columns, > 0.
    pub width: u32,
    /// Rows, > 0.
    pub height: u32,
}

/// Which camera of the scene looks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CameraChoice {
    /// The first one.
    First,
    /// By its position in the scene's list.
    Index(usize),
    /// By its name.
    Name(String),
}

/// How light sampling and BSDF sampling are combined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Strategy {
    /// Both, weighted by the power heuristic with exponent 2 (Veach 1997, §9.2.4).
    MisPower,
    /// Both, weighted by the balance heuristic.
    MisBalance,
    /// Emitters are found by BSDF sampling alone (punctual lights, which it cannot find, contribute nothing).
    BsdfOnly,
    /// Emitters are found by light sampling alone, wherever it can find them (not through a mirror).
    LightOnly,
}

/// Whether paths are ended at random.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Roulette {
    /// Never.
    Off,
    /// Survival by throughput·η², see `shading::roulette`.
    On,
    /// The same survival probability at every bounce; for tests of the estimator's variance.
    Constant(f32),
}

/// A finite aperture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Aperture radius, metres, > 0.
    pub radius_m: f32,
    /// Distance of the plane in focus along the view axis, metres, > 0.
    pub focus_m: f32,
}

/// Everything a render can be told. `Default` is what the command line does without flags.
#[derive(Clone, Debug)]
pub struct RenderOptions {
    /// Columns of the full image.
    pub width: u32,
    /// Rows of the full image.
    pub height: u32,
    /// Part of the image to render; `None` is all of it.
    pub crop: Option<Crop>,
    /// Samples per pixel at which to stop.
    pub spp: Option<u64>,
    /// Wall time at which to stop.
    pub time: Option<Duration>,
    /// Estimated relative RMSE (√relMSE) at which to stop.
    pub error: Option<f64>,
    /// Samples per pixel before the error target may stop the render.
    pub min_spp: u64,
    /// The camera.
    pub camera: CameraChoice,
    /// Seed of every random number.
    pub seed: u64,
    /// Worker threads; 0 means all that the process may use.
    pub threads: usize,
    /// Finite aperture, if any.
    pub lens: Option<Lens>,
    /// Pixel filter.
    pub filter: FilterKind,
    /// Largest number of path edges (1 is directly seen emission).
    pub max_depth: u32,
    /// Russian roulette.
    pub roulette: Roulette,
    /// MIS or one of the single strategies.
    pub strategy: Strategy,
    /// Where the random numbers come from.
    pub sampler: SamplerKind,
    /// Ray backend; `None` takes the fastest of this build.
    pub backend: Option<BackendKind>,
    /// Query mode for every ray class; `None` lets the plan choose.
    pub rays: Option<QueryMode>,
    /// Instruction set to pin.
    pub isa: Option<String>,
    /// Whether one film per path length is kept.
    pub per_length: bool,
}

impl Default for RenderOptions {
    fn default() -> Self {
        RenderOptions {
            width: 1280,
            height: 720,
            crop: None,
            spp: None,
            time: None,
            error: None,
            min_spp: 16,
            camera: CameraChoice::First,
            seed: 0,
            threads: 0,
            lens: None,
            filter: FilterKind::BlackmanHarris,
            max_depth: 64,
            roulette: Roulette::On,
            strategy: Strategy::MisPower,
            sampler: SamplerKind::Sobol,
            backend: None,
            rays: None,
            isa: None,
            per_length: false,
        }
    }
}

impl RenderOptions {
    /// Defaults for an image of this size.
    pub fn new(width: u32, height: u32) -> Self {
        RenderOptions { width, height, ..Default::default() }
    }

    /// Sets the number of samples per pixel.
    pub fn spp(mut self, spp: u64) -> Self {
        self.spp = Some(spp);
        self
    }
}

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
