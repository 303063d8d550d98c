//! Every decision of a render, resolved once from scene and options.

use std::fmt;
use std::time::Duration;

use glam::Vec3;
use serde::Serialize;

use super::aov::Aov;
use super::bias::{self, Bias};
use super::effects::asked::Asked;
use super::effects::table::{self, Effects, Features};
use super::effects::{guide, light_paths};
use super::light_groups::{self, LightGroups};
use super::options::{
    CameraChoice, Crop, FilterKind, Fog, Lens, LightPaths, RenderOptions, Roulette, SamplerKind, Strategy,
};
use super::view::view_of;
use crate::backend::select::{self, Choice};
use crate::backend::{BackendKind, BackendOptions, QueryMode};
use crate::error::{Error, Result};
use crate::machine;
use crate::math::simd::detect;
use crate::scene::Scene;
use crate::scene::geometry::Geometry;

/// Paths that one worker advances together. The columns of a wave (about 300 B a path with its two ray batches) then
/// stay inside 1 MiB of L2.
pub const WAVE: usize = 2048;

/// Light paths for each pixel and sample unless the options say otherwise.
const AUTO_SHARE: f32 = 0.25;

/// Largest image side, pixels.
pub const MAX_SIDE: u32 = 1 << 16;

/// Largest number of path edges that may be asked for.
pub const MAX_DEPTH: u32 = 1 << 16;

/// Query mode of each ray class.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RayModes {
    /// Camera rays (coherent).
    pub camera: QueryMode,
    /// Rays after a scattering (incoherent).
    pub bounce: QueryMode,
    /// Shadow rays.
    pub shadow: QueryMode,
}

/// When a render ends: the first of these that is met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Samples per pixel.
    pub spp: Option<u64>,
    /// Wall time.
    pub time: Option<Duration>,
    /// Estimated √relMSE.
    pub error: Option<f64>,
    /// Samples per pixel before `error` is checked.
    pub min_spp: u64,
}

/// Every decision of a render.
#[derive(Clone, Debug)]
pub struct RenderPlan {
    /// Full image: columns, rows.
    pub resolution: (u32, u32),
    /// The pixels that are rendered.
    pub window: Crop,
    /// Index into `Scene::cameras`.
    pub camera: usize,
    /// Finite aperture; `None` is a pinhole.
    pub lens: Option<Lens>,
    /// A medium that fills the scene, and the sphere that it fills.
    pub fog: Option<FogSphere>,
    /// Pixel filter.
    pub filter: FilterKind,
    /// When to end.
    pub limits: Limits,
    /// Seed of every random number.
    pub seed: u64,
    /// Index of every pixel's first sample.
    pub sample_start: u64,
    /// Worker threads, ≥ 1.
    pub threads: usize,
    /// Largest number of path edges.
    pub max_depth: u32,
    /// Russian roulette.
    pub roulette: Roulette,
    /// First path vertex at which roulette may end a path; 1 is the first surface.
    pub roulette_start: u32,
    /// How light is found: techniques, and the heuristic that weighs them.
    pub strategy: Strategy,
    /// Light paths for each pixel and sample; 0 without.
    pub light_paths: f32,
    /// Why so many.
    pub light_paths_reason: String,
    /// Name of the file of the survey that says so, where one was read or written.
    pub survey: Option<String>,
    /// Whether what they can find is left to them.
    pub light_paths_alone: bool,
    /// What tells the guide from others, and where it guides; `None` without one.
    pub guide: Option<GuideRecord>,
    /// Why there is one, or none.
    pub guide_reason: String,
    /// What the ledger says of punctual light without them.
    unfound: Option<String>,
    /// Random numbers.
    pub sampler: SamplerKind,
    /// Ray backend.
    pub backend: BackendKind,
    /// Why it is that one.
    pub backend_reason: String,
    /// The choice, where none was asked for.
    chosen: Option<Choice>,
    /// Query mode of each ray class.
    pub rays: RayModes,
    /// Instruction set to pin.
    pub isa: Option<String>,
    /// Whether shading runs in AVX-512: the processor has it and no narrower instruction set is pinned.
    pub avx512: bool,
    /// Robust traversal.
    pub robust: bool,
    /// Paths of one wave.
    pub wave: usize,
    /// The gates that the stages read.
    pub features: Features,
    /// The same for people and programs.
    pub effects: Effects,
    /// Layers besides the beauty.
    pub aovs: Vec<Aov>,
    /// The groups of lights; none unless they are asked for.
    pub light_groups: LightGroups,
    /// Whether the film keeps the images by path length, whatever layers are asked for.
    pub per_length: bool,
    /// Names of the stages that run, in order.
    pub stages: Vec<&'static str>,
    /// Known biases, the depth limit first.
    pub bias: Vec<Bias>,
    /// Largest radiance that can arrive anywhere, by channel, W·sr⁻¹·m⁻²; `None` where nothing bounds it.
    pub radiance_bound: Option<[f64; 3]>,
}

/// What is known of a guide.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct GuideRecord {
    /// Its cells.
    pub cells: usize,
    /// Those of them that guide.
    pub guiding: usize,
    /// Digest of its numbers.
    pub digest: u64,
}

/// Fog and where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FogSphere {
    /// The medium.
    pub medium: Fog,
    /// Centre of the scene's bounds, metres.
    pub center: Vec3,
    /// Radius around what there is to see and the camera, metres.
    pub radius_m: f32,
}

impl FogSphere {
    /// Around the scene and all places of the camera, of which there is one at least.
    pub(crate) fn new(medium: Fog, geometry: &Geometry, places: &[Vec3]) -> FogSphere {
        let (low, high) = geometry.bounds;
        let center = if low.x > high.x { places[0] } else { 0.5 * low + 0.5 * high };
        let distances = places.iter().map(|place| place.distance(center));
        FogSphere { medium, center, radius_m: distances.fold(geometry.bounding_radius(), f32::max) }
    }

    /// Where a ray enters and leaves it, metres; an end before the start where it passes by.
    pub fn met_by(&self, org: Vec3, dir: Vec3) -> [f32; 2] {
        let to = (self.center - org).as_dvec3();
        let along = to.dot(dir.as_dvec3());
        let across2 = to.length_squared() - along * along;
        let half2 = f64::from(self.radius_m) * f64::from(self.radius_m) - across2;
        if half2 < 0.0 { [0.0, -1.0] } else { [(along - half2.sqrt()) as f32, (along + half2.sqrt()) as f32] }
    }
}

impl RenderPlan {
    /// Resolves `options` against `scene` and its flattened geometry.
    ///
    /// # Errors
    /// [`Error::Option`] for anything out of range, naming the option and what is accepted; [`Error::InvalidScene`] for
    /// a motion that cannot be traced.
    pub fn new(scene: &Scene, geometry: &Geometry, options: &RenderOptions) -> Result<Self> {
        Self::resolve(scene, geometry, options, None)
    }

    /// Resolves other options for the same scene and geometry. The choice of a backend, which none of them changes, is
    /// not made again.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn again(&self, scene: &Scene, geometry: &Geometry, options: &RenderOptions) -> Result<Self> {
        Self::resolve(scene, geometry, options, self.chosen.as_ref())
    }

    fn resolve(scene: &Scene, geometry: &Geometry, options: &RenderOptions, known: Option<&Choice>) -> Result<Self> {
        let resolution = (options.width, options.height);
        for (option, side) in [("--width", options.width), ("--height", options.height)] {
            if side == 0 || side > MAX_SIDE {
                return refuse(option, format!("{side} pixels; accepted are 1 to {MAX_SIDE}"));
            }
        }
        if !(1..=MAX_DEPTH).contains(&options.max_depth) {
            return refuse("--max-depth", format!("{}; accepted are 1 to {MAX_DEPTH} edges", options.max_depth));
        }
        if options.spp == Some(0) {
            return refuse("--spp", "0 samples make no picture; at least 1".into());
        }
        if let Some(error) = options.error.filter(|e| !(*e > 0.0 && e.is_finite())) {
            return refuse("--error", format!("{error}; a relative error above 0 is needed, 1% or 0.01"));
        }
        if let Some(lens) = options.lens {
            if !(lens.radius_m > 0.0 && lens.radius_m.is_finite()) {
                return refuse("--aperture-radius", format!("{} m; a finite length above 0 is needed", lens.radius_m));
            }
            if !(lens.focus_m > 0.0) {
                return refuse("--focus-distance", format!("{} m; a length above 0 is needed", lens.focus_m));
            }
        }
        if let Some(fog) = options.fog {
            let within = fog.sigma_t > 0.0 && fog.sigma_t.is_finite() && (0.0..=1.0).contains(&fog.albedo);
            if !(within && fog.g > -1.0 && fog.g < 1.0) {
                let problem = format!(
                    "{},{},{}; an attenuation above 0 per metre, an albedo in [0, 1], an anisotropy in (-1, 1)",
                    fog.sigma_t, fog.albedo, fog.g
                );
                return refuse("--fog", problem);
            }
        }
        if !options.strategy.techniques.bsdf && !options.strategy.techniques.light {
            return refuse("--strategy", "it leaves no technique that finds light".into());
        }
        if let Roulette::Constant(q) = options.roulette
            && !(q > 0.0 && q <= 1.0)
        {
            return refuse("--roulette", format!("survival {q}; accepted are values in (0, 1]"));
        }
        light_groups::check(&options.light_groups)?;
        scene.validate_motion()?;
        let camera = resolve_camera(scene, &options.camera)?;
        let fastest = || known.cloned().unwrap_or_else(|| select::fastest(geometry, || view_of(scene, geometry)));
        let choice = select::select(options.backend, geometry, fastest, options.pins())?;

        let asked = Asked::new(scene, options, camera, geometry);
        let (mut features, effects) = table::find(&asked);
        let lens = options.lens.filter(|_| features.lens);
        table::force(&mut features, &options.forced, &asked);
        let share = match options.light_paths {
            LightPaths::Off => 0.0,
            LightPaths::Auto => AUTO_SHARE,
            LightPaths::Share(share) | LightPaths::Alone(share) => share,
        };
        let forced = matches!(options.light_paths, LightPaths::Share(_) | LightPaths::Alone(_));
        if forced && !(share > 0.0 && share <= 1.0) {
            return refuse("--techniques", format!("{share} light paths for a sample; accepted are shares in (0, 1]"));
        }
        if let Some(why) = light_paths::refusal(&asked).filter(|_| forced && light_paths::wanted(&asked)) {
            return refuse("--techniques", format!("no light paths where {why}"));
        }
        let mode = |auto| options.rays.or(choice.kind.only_mode()).unwrap_or(auto);
        let rays = RayModes {
            camera: mode(QueryMode::Packet16),
            bounce: mode(QueryMode::Packet16),
            shadow: mode(QueryMode::Packet16),
        };
        Ok(RenderPlan {
            resolution,
            window: resolve_window(resolution, options.crop)?,
            camera,
            lens,
            fog: options.fog.map(|fog| FogSphere::new(fog, geometry, &asked.camera_places())),
            filter: options.filter,
            limits: Limits {
                spp: options.spp,
                time: options.time,
                error: options.error,
                min_spp: options.min_spp.max(2),
            },
            seed: options.seed,
            sample_start: options.sample_start,
            threads: machine::threads(options.threads),
            max_depth: options.max_depth,
            roulette: options.roulette,
            roulette_start: options.roulette_start,
            strategy: options.strategy,
            light_paths: if features.light_paths { share } else { 0.0 },
            light_paths_reason: light_paths::reason(&asked),
            survey: None,
            unfound: bias::unfound(&asked, features.nested, false),
            light_paths_alone: matches!(options.light_paths, LightPaths::Alone(_)),
            guide: None,
            guide_reason: guide::reason(&asked),
            sampler: options.sampler,
            backend: choice.kind,
            chosen: options.backend.is_none().then(|| choice.clone()),
            backend_reason: choice.reason,
            rays,
            isa: options.isa.clone(),
            avx512: detect::is_wide(options.isa.as_deref()),
            robust: options.robust,
            wave: WAVE,
            stages: table::stages(&features),
            features,
            effects,
            aovs: options.aovs.clone(),
            light_groups: match features.light_groups {
                true => LightGroups::resolve(scene, &options.light_groups)?,
                false => LightGroups::default(),
            },
            per_length: options.per_length,
            bias: bias::ledger(&asked, &features),
            radiance_bound: bias::radiance_bound(scene).filter(|_| options.fog.is_none()),
        })
    }

    /// Takes this guide, or none, if there were to be one.
    pub(crate) fn set_guide(&mut self, guide: Option<GuideRecord>, reason: String) {
        self.features.guide &= guide.is_some();
        self.guide = guide.filter(|_| self.features.guide);
        self.guide_reason = reason;
        self.stages = table::stages(&self.features);
    }

    /// Options of the backend.
    pub fn backend_options(&self) -> BackendOptions {
        BackendOptions {
            incoherent: self.rays.bounce,
            coherent: self.rays.camera,
            shadow: self.rays.shadow,
            robust: self.robust,
            passes: self.features.passes(1),
            isa: self.isa.clone(),
            build_threads: self.threads,
        }
    }

    /// Light paths as they are recorded: "0.25", "0.25 alone", "off".
    pub(crate) fn light_paths_text(&self) -> String {
        match (self.features.light_paths, self.light_paths_alone) {
            (false, _) => "off".into(),
            (true, false) => self.light_paths.to_string(),
            (true, true) => format!("{} alone", self.light_paths),
        }
    }

    /// Takes so many light paths for each pixel and sample, if there were to be any.
    pub(crate) fn set_light_paths(&mut self, share: f32, reason: String) {
        let planned = self.features.light_paths;
        self.features.light_paths &= share > 0.0;
        self.light_paths = if self.features.light_paths { share } else { 0.0 };
        self.light_paths_reason = reason;
        if let Some(what) = self.unfound.take().filter(|_| planned && !self.features.light_paths) {
            let way = what.split(" is found by").next().unwrap_or(&what);
            self.bias.retain(|bias| !bias.what.starts_with(way));
            self.bias.push(Bias::unmeasured(what));
        }
        self.stages = table::stages(&self.features);
    }

    /// Whether emitters are sampled from surfaces at all.
    #[inline(always)]
    pub fn samples_lights(&self) -> bool {
        self.features.light_sampling
    }
}

impl fmt::Display for RenderPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let join = |list: &[String]| if list.is_empty() { "none".to_string() } else { list.join(", ") };
        writeln!(f, "simulated  {}", join(&self.effects.simulated))?;
        for ignored in &self.effects.ignored {
            writeln!(f, "ignored    {}: {}", ignored.what, ignored.why)?;
        }
        writeln!(f, "stages     {}", self.stages.join(" → "))?;
        writeln!(f, "backend    {}: {}", self.backend.name(), self.backend_reason)?;
        writeln!(
            f,
            "rays       {} with camera {}, bounce {}, shadow {}",
            self.backend.name(),
            self.rays.camera,
            self.rays.bounce,
            self.rays.shadow
        )?;
        writeln!(f, "wave       {} paths", self.wave)?;
        for bias in &self.bias {
            writeln!(f, "bias       {}", bias.what)?;
        }
        Ok(())
    }
}

fn refuse<T>(option: &'static str, problem: String) -> Result<T> {
    Err(Error::Option { option, problem })
}

fn resolve_camera(scene: &Scene, choice: &CameraChoice) -> Result<usize> {
    let names = || scene.cameras.iter().map(|c| format!("'{}'", c.name)).collect::<Vec<_>>().join(", ");
    match choice {
        CameraChoice::First if !scene.cameras.is_empty() => Ok(0),
        CameraChoice::First => refuse("--camera", "the scene has no camera".into()),
        CameraChoice::Index(i) if *i < scene.cameras.len() => Ok(*i),
        CameraChoice::Index(i) => {
            refuse("--camera", format!("index {i}; the scene has {}: {}", scene.cameras.len(), names()))
        }
        CameraChoice::Name(name) => match scene.cameras.iter().position(|c| c.name == *name) {
            Some(i) => Ok(i),
            None => refuse("--camera", format!("'{name}' is none of the scene's cameras: {}", names())),
        },
    }
}

fn resolve_window(resolution: (u32, u32), crop: Option<Crop>) -> Result<Crop> {
    let full = Crop { x: 0, y: 0, width: resolution.0, height: resolution.1 };
    let Some(crop) = crop else { return Ok(full) };
    let fits = |start: u32, size: u32, side: u32| size > 0 && start.checked_add(size).is_some_and(|end| end <= side);
    if fits(crop.x, crop.width, full.width) && fits(crop.y, crop.height, full.height) {
        Ok(crop)
    } else {
        refuse(
            "--crop",
            format!(
                "{}x{}+{}+{} does not lie inside the image of {}x{} pixels",
                crop.width, crop.height, crop.x, crop.y, full.width, full.height
            ),
        )
    }
}
