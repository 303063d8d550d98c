//! What a render can be told: plain values, read once by [`RenderPlan`](super::RenderPlan). Nothing below the plan sees
//! them.

use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

use super::aov::Aov;
use super::light_groups::LightGroup;
use crate::backend::select::Pins;
use crate::backend::{BackendKind, QueryMode};
use crate::setters::setters;

/// A stage, or a part of one, that can be made to run although nothing calls for it: for tests that it changes nothing,
/// and for counts of what it would cost. The constants are those of the table of effects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Gate(pub(super) &'static str);

impl Gate {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        self.0
    }
}

/// The filters of `--filter`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
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
    /// No filter: one ray through the pixel's centre. What `verify` compares; not on the command line, because its
    /// pictures alias.
    Point,
}

/// The samplers of `--sampler`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum SamplerKind {
    /// Owen-scrambled Sobol points, padded in sets of four dimensions.
    Sobol,
    /// Independent uniform numbers.
    Independent,
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
#[non_exhaustive]
pub enum CameraChoice {
    /// The first one.
    First,
    /// By its position in the scene's list.
    Index(usize),
    /// By its name.
    Name(String),
}

/// How the techniques of a path are weighted against each other (multiple importance sampling).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Heuristic {
    /// Power heuristic with exponent 2 (Veach 1997, §9.2.4).
    #[default]
    Power,
    /// Balance heuristic.
    Balance,
}

/// The techniques that find light. One that is off neither draws directions for it nor takes part in the weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Techniques {
    /// Emission that rays drawn from the BSDF meet. Without it such emission counts only where light sampling cannot
    /// find it: seen directly, or through a mirror.
    pub bsdf: bool,
    /// Directions drawn from the lights. Without it punctual lights contribute nothing.
    pub light: bool,
}

impl Techniques {
    /// Every technique.
    pub const ALL: Techniques = Techniques { bsdf: true, light: true };
}

/// How light is found: which techniques, and the heuristic that weighs them where more than one finds the same path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Strategy {
    /// Weights of the techniques.
    pub heuristic: Heuristic,
    /// Techniques that take part.
    pub techniques: Techniques,
}

impl Strategy {
    /// All techniques, by the power heuristic.
    pub const MIS: Strategy = Strategy { heuristic: Heuristic::Power, techniques: Techniques::ALL };
    /// All techniques, by the balance heuristic.
    pub const MIS_BALANCE: Strategy = Strategy { heuristic: Heuristic::Balance, techniques: Techniques::ALL };
    /// BSDF sampling alone.
    pub const BSDF: Strategy = Strategy { techniques: Techniques { bsdf: true, light: false }, ..Strategy::MIS };
    /// Light sampling alone, wherever it can find a light.
    pub const LIGHT: Strategy = Strategy { techniques: Techniques { bsdf: false, light: true }, ..Strategy::MIS };

    /// The same with other techniques, if there are any.
    #[must_use]
    pub fn with(self, techniques: Option<Techniques>) -> Self {
        Strategy { techniques: techniques.unwrap_or(self.techniques), ..self }
    }

    /// Spelling on the command line.
    pub fn name(self) -> &'static str {
        match (self.techniques, self.heuristic) {
            (Techniques { bsdf: true, light: true }, Heuristic::Power) => "mis",
            (Techniques { bsdf: true, light: true }, Heuristic::Balance) => "mis-balance",
            (Techniques { bsdf: true, light: false }, _) => "bsdf",
            (Techniques { bsdf: false, light: true }, _) => "light",
            (Techniques { bsdf: false, light: false }, _) => "none",
        }
    }
}

impl Default for Strategy {
    fn default() -> Self {
        Strategy::MIS
    }
}

impl fmt::Display for Strategy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Whether light paths take part: paths from the lights, aimed at mirrors, glass and smooth metal, that are connected
/// with the camera. (They find what [`Techniques`] find by luck, and what those do not: light of punctual lights by way
/// of mirrors and smooth glass.)
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum LightPaths {
    /// Where the scene calls for them and they pay.
    #[default]
    Auto,
    /// Never.
    Off,
    /// Wherever the scene calls for them: so many for each pixel and sample, in (0, 1].
    Share(f32),
    /// The same, and what they can find is left to them: for comparisons.
    Alone(f32),
}

/// Whether a guide takes part: directions from which light was seen to come, learnt cell by cell in a survey before the
/// first sample, and mixed with those of the BSDF.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Guiding {
    /// Where a survey says that it pays.
    #[default]
    Auto,
    /// Never.
    Off,
    /// In every cell in which it pays.
    On,
}

/// How textures are looked up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
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

/// Who meets the backs of surfaces whose material is not `doubleSided`. (Boundaries of solids are there from both
/// sides.)
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Backfaces {
    /// Every ray.
    #[default]
    Show,
    /// Every ray but those from the camera, which pass them.
    Hide,
    /// No ray.
    HideAll,
}

impl Backfaces {
    /// Spelling on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Backfaces::Show => "show",
            Backfaces::Hide => "hide",
            Backfaces::HideAll => "hide-all",
        }
    }
}

/// Whether paths are ended at random.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Roulette {
    /// Never.
    Off,
    /// Survival by throughput·η², see `shading::roulette`.
    On,
    /// The same survival probability at every bounce; for tests of the estimator's variance.
    Constant(f32),
}

/// A homogeneous medium that fills the sphere around the scene and the camera, where no solid is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fog {
    /// Attenuation, m⁻¹, > 0.
    pub sigma_t: f32,
    /// Share of it that scatters, in [0, 1].
    pub albedo: f32,
    /// Mean cosine of scattering, in (−1, 1).
    pub g: f32,
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

/// Everything a render can be told. `Default` is what the command line does without flags. Fields are read and set
/// directly or, in a chain, by the method of the same name.
///
/// ```
/// use pathspace::{RenderOptions, SamplerKind, Strategy};
/// let options = RenderOptions::new(640, 480).spp(256).seed(7).sampler(SamplerKind::Independent);
/// let light = options.clone().strategy(Strategy::LIGHT).max_depth(2);
/// assert_eq!((options.max_depth, light.max_depth), (64, 2));
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
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
    /// Index of every pixel's first sample: renders with one seed that cover different ranges of samples add up to the
    /// render of all of them.
    pub sample_start: u64,
    /// Worker threads; 0 means all that the process may use.
    pub threads: usize,
    /// Finite aperture, if any.
    pub lens: Option<Lens>,
    /// A medium that fills the scene, if any.
    pub fog: Option<Fog>,
    /// Pixel filter.
    pub filter: FilterKind,
    /// Largest number of path edges (1 is directly seen emission).
    pub max_depth: u32,
    /// Russian roulette.
    pub roulette: Roulette,
    /// First path vertex (1 is the first surface) at which [`Roulette::On`] may end a path.
    pub roulette_start: u32,
    /// How light is found.
    pub strategy: Strategy,
    /// Whether light paths take part.
    pub light_paths: LightPaths,
    /// The survey that [`LightPaths::Auto`] goes by: read where the file is there, else made and written to it. `None`
    /// makes one for each renderer.
    pub survey: Option<PathBuf>,
    /// Whether a guide takes part.
    pub guiding: Guiding,
    /// Where the random numbers come from.
    pub sampler: SamplerKind,
    /// How textures are looked up.
    pub texture_filter: TextureFilter,
    /// Whether light that normal maps send below the surface goes to its mirror image above, and facets that face away
    /// are turned to the viewer. Off, that light is lost.
    pub fold_normals: bool,
    /// Whether light that rough metals and glass scatter between their facets is given back.
    pub multiscatter: bool,
    /// Who meets the backs of one-sided surfaces.
    pub backfaces: Backfaces,
    /// Ray backend; `None` takes the fastest of this build for the scene ([`select`](crate::backend::select)). `rays`,
    /// `isa` and `robust` do not change it: where it cannot honour one of them, the plan refuses.
    pub backend: Option<BackendKind>,
    /// Query mode to pin for every ray class; `None` lets the plan choose.
    pub rays: Option<QueryMode>,
    /// Instruction set to pin.
    pub isa: Option<String>,
    /// Robust traversal. Off only as a measured choice: Embree then loses rays between triangles.
    pub robust: bool,
    /// Whether one film per path length is kept; [`Aov::BOUNCES`] asks for it too, and
    /// layers by path length for their share of it.
    pub per_length: bool,
    /// Layers besides the beauty.
    pub aovs: Vec<Aov>,
    /// What [`Aov::LIGHT_GROUPS`] is by, besides the groups that the scene names.
    pub light_groups: Vec<LightGroup>,
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
            fog: None,
            filter: FilterKind::BlackmanHarris,
            max_depth: 64,
            roulette: Roulette::On,
            roulette_start: ROULETTE_START,
            strategy: Strategy::MIS,
            light_paths: LightPaths::Auto,
            survey: None,
            guiding: Guiding::Auto,
            sampler: SamplerKind::Sobol,
            texture_filter: TextureFilter::Exact,
            fold_normals: true,
            multiscatter: false,
            backfaces: Backfaces::Show,
            backend: None,
            rays: None,
            isa: None,
            robust: true,
            per_length: false,
            aovs: Vec::new(),
            light_groups: Vec::new(),
            forced: Vec::new(),
        }
    }
}

impl RenderOptions {
    /// Defaults for an image of this size.
    pub fn new(width: u32, height: u32) -> Self {
        RenderOptions { width, height, ..Default::default() }
    }

    /// Sets columns and rows of the full image.
    pub fn size(mut self, width: u32, height: u32) -> Self {
        (self.width, self.height) = (width, height);
        self
    }

    /// What the backend is held to.
    pub fn pins(&self) -> Pins<'_> {
        Pins { rays: self.rays, isa: self.isa.as_deref(), robust: self.robust }
    }

    /// Sets the number of samples per pixel.
    pub fn spp(mut self, spp: u64) -> Self {
        self.spp = Some(spp);
        self
    }

    /// Pins an instruction set by its name, or none.
    pub fn isa<'n>(mut self, isa: impl Into<Option<&'n str>>) -> Self {
        self.isa = isa.into().map(String::from);
        self
    }

    setters! {
        crop: into Option<Crop>,
        time: into Option<Duration>,
        error: into Option<f64>,
        min_spp: = u64,
        camera: = CameraChoice,
        seed: = u64,
        sample_start: = u64,
        threads: = usize,
        lens: into Option<Lens>,
        fog: into Option<Fog>,
        filter: = FilterKind,
        max_depth: = u32,
        roulette: = Roulette,
        roulette_start: = u32,
        strategy: = Strategy,
        light_paths: = LightPaths,
        survey: into Option<PathBuf>,
        guiding: = Guiding,
        sampler: = SamplerKind,
        texture_filter: = TextureFilter,
        fold_normals: = bool,
        multiscatter: = bool,
        backfaces: = Backfaces,
        backend: into Option<BackendKind>,
        rays: into Option<QueryMode>,
        robust: = bool,
        per_length: = bool,
        aovs: into Vec<Aov>,
        light_groups: into Vec<LightGroup>,
        forced: into Vec<Gate>,
    }
}
