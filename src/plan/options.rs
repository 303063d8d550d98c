//! What a render can be told: plain values, read once by [`RenderPlan`](super::RenderPlan). Nothing below the plan sees them.

use std::time::Duration;

use super::effects::Gate;
use crate::backend::{BackendKind, QueryMode};

/// The filters of `--filter`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FilterKind {
    /// Box of 1 pixel.
    Box,
    /// Tent of radius 1.
    Tent,
    /// Gaussian, standard deviation 0.5, cut at radius 1.5.
    Gaussian,
    /// Blackman-Harris of radius 1.5.
    BlackmanHarris,
    /// Mitchell-Netravali (1/3, 1/3), radius 2; has negative lobes, weights are signed.
    Mitchell,
    /// No filter: one ray through the pixel's centre. What `verify` compares; not on the command line, because its pictures
    /// alias.
    Point,
}

/// The samplers of `--sampler`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SamplerKind {
    /// Owen-scrambled Sobol points, padded in sets of four dimensions.
    Sobol,
    /// Independent uniform numbers.
    Independent,
}

/// Extra outputs of `--aov`; `film::aov` makes their channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Aov {
    /// Estimated variance of each pixel's mean.
    Variance,
    /// Its square root.
    Stderr,
    /// Samples of each pixel.
    Spp,
    /// One image per number of scatterings.
    Bounces,
    /// Base colour of what is met first.
    Albedo,
    /// Shading normal there, in the world.
    Normal,
    /// Distance along the view axis to it, metres.
    Depth,
    /// World position of it, metres.
    Position,
}

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

/// How textures are looked up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum TextureFilter {
    /// As the file's sampler magnifies, at every distance: what the scene says, to the last texel.
    #[default]
    Exact,
    /// Averaged over the width of the path, by pyramids: less noise from fine patterns, and a bias.
    Trilinear,
}

impl TextureFilter {
    /// Spelling on the command line.
    pub fn name(self) -> &'static str {
        match self {
            TextureFilter::Exact => "exact",
            TextureFilter::Trilinear => "trilinear",
        }
    }
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

/// Default of [`RenderOptions::roulette_start`]: paths that carry much survive by the rule itself.
pub const ROULETTE_START: u32 = 1;

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
    /// Index of every pixel's first sample: renders with one seed that cover different ranges of samples add up to the render
    /// of all of them.
    pub sample_start: u64,
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
    /// First path vertex (1 is the first surface) at which [`Roulette::On`] may end a path.
    pub roulette_start: u32,
    /// MIS or one of the single strategies.
    pub strategy: Strategy,
    /// Where the random numbers come from.
    pub sampler: SamplerKind,
    /// How textures are looked up.
    pub texture_filter: TextureFilter,
    /// Ray backend; `None` takes the fastest of this build for the scene ([`BackendKind::fastest`]), or the first of
    /// [`BackendKind::available`] if `rays`, `isa` or `robust` ask for something that only Embree has.
    pub backend: Option<BackendKind>,
    /// Query mode for every ray class; `None` lets the plan choose.
    pub rays: Option<QueryMode>,
    /// Instruction set to pin.
    pub isa: Option<String>,
    /// Robust traversal. Off only as a measured choice: Embree then loses rays between triangles.
    pub robust: bool,
    /// Whether one film per path length is kept; `Aov::Bounces` asks for it too.
    pub per_length: bool,
    /// Extra outputs.
    pub aovs: Vec<Aov>,
    /// Stages that run although nothing calls for them; the picture stays the same. For tests and benches.
    pub forced: Vec<Gate>,
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
            sample_start: 0,
            threads: 0,
            lens: None,
            filter: FilterKind::BlackmanHarris,
            max_depth: 64,
            roulette: Roulette::On,
            roulette_start: ROULETTE_START,
            strategy: Strategy::MisPower,
            sampler: SamplerKind::Sobol,
            texture_filter: TextureFilter::Exact,
            backend: None,
            rays: None,
            isa: None,
            robust: true,
            per_length: false,
            aovs: Vec::new(),
            forced: Vec::new(),
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
