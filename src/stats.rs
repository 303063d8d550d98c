//! Statistics of a render as JSON, schema 1. Keys and their order are a contract: keys may be added behind the others,
//! never renamed. Units are in the names; times are wall seconds, rates are 10⁶ per second of `seconds.render`.

pub mod bias;
#[doc(hidden)]
pub mod curve;
pub mod denoise;
pub mod error_log;

use serde::Serialize;

use self::denoise::DenoiseStats;
use crate::backend::BackendInfo;
use crate::film::estimate::{Tail, Verdict};
use crate::math::simd::detect;
use crate::plan::{Bias, Effects};
use crate::render::stopping::{LIMIT_CONFIDENCE, LIMIT_SIGMAS};
use crate::render::{Render, Renderer};
use crate::room;
use crate::scene::{Scene, Texels};
use crate::texture::TextureStats;
use crate::transport::counters::Counters;

/// Version of the keys below.
pub const SCHEMA: u32 = 1;

/// Everything `--stats` writes.
///
/// ```
/// # let scene = pathspace::Scene::load("scenes/cornell-box/scene.gltf")?;
/// # let renderer = pathspace::Renderer::new(&scene, pathspace::RenderOptions::new(8, 8).spp(2))?;
/// use pathspace::stats::{Seconds, Stats};
/// let render = renderer.render()?;
/// let stats = Stats::new(&renderer, &render, Seconds::of(&renderer, &render));
/// assert_eq!((stats.stop, stats.paths), ("spp", 128));
/// # Ok::<(), pathspace::Error>(())
/// ```
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Stats {
    /// [`SCHEMA`].
    pub schema: u32,
    /// "render".
    pub command: &'static str,
    /// What was loaded.
    pub scene: SceneStats,
    /// Wall times.
    pub seconds: Seconds,
    /// Columns and rows of the full image.
    pub resolution: [u32; 2],
    /// Samples per pixel that were rendered.
    pub spp: SppStats,
    /// Seed of every random number.
    pub seed: u64,
    /// Worker threads.
    pub threads: usize,
    /// Camera paths begun.
    pub paths: u64,
    /// Rays by class.
    pub rays: RayStats,
    /// Millions of camera paths per second.
    pub mpaths_per_s: f64,
    /// Millions of rays of all classes per second.
    pub mrays_per_s: f64,
    /// Largest resident memory of the process so far, bytes; `null` where the system does not say.
    pub peak_rss_bytes: Option<u64>,
    /// Samples that were not finite and entered the film as 0.
    pub nonfinite: u64,
    /// "spp", "time", "error" or "signal".
    pub stop: &'static str,
    /// What traced.
    pub backend: BackendStats,
    /// What the scene asks for, and what was done about it.
    pub effects: Effects,
    /// Known biases with what they removed; the depth limit first.
    pub bias: Vec<Bias>,
    /// The film's estimate of its own error; `null` until both halves of the film have samples.
    pub error: Option<ErrorStats>,
    /// The first non-finite samples: pixel of the full image, sample index, bounce; `render --pixel` replays them.
    pub nonfinite_first: Vec<NonFiniteStats>,
    /// Rays refused because a component was NaN, infinite or out of range.
    pub invalid_rays: u64,
    /// Paths ended by the depth limit.
    pub capped_paths: u64,
    /// Fingerprint of the film's sums, hexadecimal: equal films have equal hashes.
    pub film_hash: String,
    /// What the pilot of an error target predicted; `null` without a target, or when it was met before the pilot ended.
    pub prediction: Option<PredictionStats>,
    /// Textures: how often they were looked up, and what the tile cache did.
    pub textures: TextureRecord,
    /// Instruction set of shading: what the processor has at run time ("avx512"), else what this binary was compiled
    /// for.
    pub isa: &'static str,
    /// What `peak_rss_bytes` was expected to be before the hierarchy was built.
    pub memory_need_bytes: u64,
    /// The tail of the estimate of the error; `null` where the film is too small to have one.
    pub tail: Option<TailStats>,
    /// The filtered picture beside this one; `null` unless it was asked for.
    pub denoised: Option<DenoiseStats>,
}

/// Textures of a render.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TextureRecord {
    /// Look-ups, of one to four texels each.
    pub lookups: u64,
    /// Bytes of texels in memory besides the cache.
    pub held_bytes: u64,
    /// The tile cache; zeros where everything is in memory.
    #[serde(flatten)]
    pub cache: TextureStats,
}

impl TextureRecord {
    fn of(scene: &Scene, counters: &Counters) -> Self {
        let (mut seen, mut held_bytes): (Vec<&Texels>, u64) = (Vec::new(), 0);
        for texture in &scene.textures {
            if !seen.iter().any(|texels| texels.shares(&texture.texels)) {
                seen.push(&texture.texels);
                held_bytes += texture.texels.bytes();
            }
        }
        let cache = scene.texture_tiles().map(|tiles| tiles.stats()).unwrap_or_default();
        TextureRecord { lookups: counters.texture_lookups, held_bytes, cache }
    }
}

/// Counts of a scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct SceneStats {
    /// The file.
    pub file: String,
    /// Triangles over all placements.
    pub triangles: u64,
    /// Placements of meshes.
    pub instances: usize,
    /// Materials.
    pub materials: usize,
    /// Emissive triangles, punctual lights and the environment: everything that light sampling chooses from.
    pub lights: u64,
    /// Textures.
    pub textures: usize,
}

/// Wall times in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Seconds {
    /// Reading and checking the scene and its images.
    pub load: f64,
    /// Acceleration structure and light tables.
    pub build: f64,
    /// Passes of samples.
    pub render: f64,
    /// Writing pictures.
    pub write: f64,
    /// From the start of the process's work to the end of writing.
    pub total: f64,
}

/// Samples per pixel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SppStats {
    /// Of the pixel with the fewest.
    pub min: u64,
    /// Mean.
    pub mean: f64,
    /// Of the pixel with the most.
    pub max: u64,
}

/// Rays by class.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct RayStats {
    /// Camera rays.
    pub camera: u64,
    /// Rays after a scattering.
    pub bounce: u64,
    /// Shadow rays.
    pub shadow: u64,
}

/// What traced.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct BackendStats {
    /// "embree", "obvhs", "flat", "flat+obvhs" or "brute".
    pub name: &'static str,
    /// Version of the library behind it.
    pub version: String,
    /// Instruction set that ran.
    pub isa: String,
    /// Effective query mode; where the ray classes differ, `camera/bounce/shadow`.
    pub rays: String,
    /// Bytes of the acceleration structure, as far as the backend knows.
    pub bvh_bytes: u64,
    /// Why it is this backend.
    pub reason: String,
}

/// The estimate of the error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ErrorStats {
    /// Estimated relMSE.
    pub relmse: f64,
    /// Mean over pixels and channels of the pixel's standard error, in units of radiance.
    pub stderr_mean: f64,
    /// Confidence level of `interval`.
    pub confidence: f64,
    /// Interval that covers relMSE with that confidence.
    pub interval: [f64; 2],
    /// ε of relMSE.
    pub epsilon: f64,
    /// Mean of the picture per channel, in units of radiance.
    pub mean: [f64; 3],
    /// Its standard error.
    pub mean_stderr: [f64; 3],
    /// Interval that covers the mean of the converged picture with the confidence above.
    pub mean_interval: [[f64; 2]; 3],
    /// Share of `relmse` that the pixel with the largest has.
    pub largest_share: f64,
    /// False where few pixels carry the error, so that the intervals may miss more often than they say.
    pub reliable: bool,
    /// Relative RMSE (√relMSE) that this picture stays below with `limit_confidence`.
    pub limit: f64,
    /// Confidence of `limit`.
    pub limit_confidence: f64,
    /// Relative RMSE that was asked for, if any.
    pub target: Option<f64>,
}

/// The tail of the estimate: whether it is to be trusted, and what may have been missed.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TailStats {
    /// In words: "tame", "heavy: k=0.6", "not to be trusted: k=0.9".
    pub verdict: String,
    /// Index of the largest contributions of pixels to relMSE: ½ and above have no finite variance.
    pub k: f64,
    /// Its standard error.
    pub k_stderr: f64,
    /// Index from which nothing is to be trusted.
    pub k_limit: f64,
    /// Pixels whose contributions were fitted.
    pub pixels: usize,
    /// Share of the picture's light that came from events met once; as much is expected from those not met yet.
    pub unseen_share: f64,
    /// Its upper bound (95 %).
    pub unseen_at_most: f64,
}

impl TailStats {
    /// Whether intervals and predictions hold.
    pub fn is_tame(&self) -> bool {
        self.verdict == Verdict::Tame.name()
    }

    /// Of a film's tail.
    pub fn of(tail: &Tail) -> Self {
        TailStats {
            verdict: tail.words(),
            k: tail.k,
            k_stderr: tail.k_stderr,
            k_limit: tail.k_limit,
            pixels: tail.pixels,
            unseen_share: tail.unseen,
            unseen_at_most: tail.unseen_at_most,
        }
    }
}

/// What the pilot of a render with an error target predicted, and what the render took.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PredictionStats {
    /// Seconds of rendering after which it was made.
    pub after_s: f64,
    /// Samples per pixel by then.
    pub after_spp: u64,
    /// Predicted seconds of rendering in all.
    pub seconds: f64,
    /// Their 95 % interval.
    pub seconds_interval: [f64; 2],
    /// Predicted samples per pixel.
    pub spp: f64,
    /// Their 95 % interval.
    pub spp_interval: [f64; 2],
    /// Seconds of rendering that it took.
    pub taken_s: f64,
    /// Samples per pixel that it took.
    pub taken_spp: u64,
    /// Whether the pilot's tail leaves but the lower ends of the intervals.
    pub at_least: bool,
    /// What is to be said of it then.
    pub caution: Option<&'static str>,
}

/// Where a non-finite sample was met.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct NonFiniteStats {
    /// Pixel of the full image.
    pub pixel: [u32; 2],
    /// Sample index.
    pub sample: u64,
    /// Scatterings of the path whose contribution was not finite; 0 for light seen directly. `null` where a replay of
    /// the sample is finite.
    pub bounce: Option<u32>,
}

impl SceneStats {
    /// Counts `scene`.
    pub fn of(scene: &Scene) -> Self {
        let emissive = |instance: &crate::scene::Instance| {
            let mesh = &scene.meshes[instance.mesh.index()];
            let emits = scene.materials.get(scene.material_of(instance).index()).is_some_and(|m| m.is_emissive());
            if emits { mesh.triangles.len() as u64 } else { 0 }
        };
        let surfaces: u64 = scene.instances.iter().map(emissive).sum();
        SceneStats {
            file: scene.file.display().to_string(),
            triangles: scene.triangle_count(),
            instances: scene.instances.len(),
            materials: scene.materials.len(),
            lights: surfaces + scene.punctual.len() as u64 + u64::from(scene.environment.is_some()),
            textures: scene.textures.len(),
        }
    }
}

impl Seconds {
    /// What a renderer and its render tell: the times of building and rendering, and their sum.
    pub fn of(renderer: &Renderer, render: &Render) -> Self {
        let (build, render) = (renderer.build_time().as_secs_f64(), render.render_time.as_secs_f64());
        Seconds { build, render, total: build + render, ..Seconds::default() }
    }
}

impl BackendStats {
    /// What `info` says, and why the plan took it.
    pub fn of(info: &BackendInfo, reason: &str) -> Self {
        let (camera, bounce, shadow) = (info.rays_coherent, info.rays_incoherent, info.rays_shadow);
        let same = camera == bounce && bounce == shadow;
        BackendStats {
            name: info.kind.name(),
            version: info.version.clone(),
            isa: info.isa.clone(),
            rays: if same { camera.to_string() } else { format!("{camera}/{bounce}/{shadow}") },
            bvh_bytes: info.bvh_bytes,
            reason: reason.into(),
        }
    }
}

impl Stats {
    /// Gathers the statistics of `render`, a render by `renderer`.
    pub fn new(renderer: &Renderer, render: &Render, seconds: Seconds) -> Self {
        let (scene, plan, backend) = (renderer.scene(), renderer.plan(), renderer.backend_info());
        let (film, counters) = (&render.film, &render.counters);
        let spp = film.spp();
        let rays =
            RayStats { camera: counters.rays_camera, bounce: counters.rays_bounce, shadow: counters.rays_shadow };
        let per_second = |count: u64| if seconds.render > 0.0 { count as f64 * 1e-6 / seconds.render } else { 0.0 };
        Stats {
            schema: SCHEMA,
            command: "render",
            scene: SceneStats::of(scene),
            seconds,
            resolution: [film.resolution.0, film.resolution.1],
            spp: SppStats { min: spp.min, mean: spp.mean, max: spp.max },
            seed: plan.seed,
            threads: plan.threads,
            paths: counters.paths,
            rays,
            mpaths_per_s: per_second(counters.paths),
            mrays_per_s: per_second(rays.camera + rays.bounce + rays.shadow),
            peak_rss_bytes: room::most_resident(),
            nonfinite: counters.nonfinite,
            stop: render.stop.name(),
            backend: BackendStats::of(backend, &plan.backend_reason),
            effects: plan.effects.clone(),
            bias: bias::ledger(plan, render),
            error: film.error_estimate().map(|e| ErrorStats {
                relmse: e.relmse,
                stderr_mean: e.stderr_mean,
                confidence: 0.95,
                interval: e.interval,
                epsilon: e.epsilon,
                mean: e.mean,
                mean_stderr: e.mean_stderr,
                mean_interval: e.mean_interval,
                largest_share: e.largest_share,
                reliable: e.reliable,
                limit: e.picture_limit(LIMIT_SIGMAS).sqrt(),
                limit_confidence: LIMIT_CONFIDENCE,
                target: plan.limits.error,
            }),
            nonfinite_first: counters
                .nonfinite_first
                .iter()
                .map(|n| NonFiniteStats { pixel: [n.pixel.0, n.pixel.1], sample: n.sample, bounce: n.bounce })
                .collect(),
            invalid_rays: counters.invalid_rays,
            capped_paths: counters.capped_paths,
            film_hash: format!("{:016x}", film.hash()),
            prediction: render.forecast.map(|forecast| PredictionStats {
                after_s: forecast.after_seconds,
                after_spp: forecast.after_spp,
                seconds: forecast.predicted.seconds,
                seconds_interval: forecast.predicted.seconds_interval,
                spp: forecast.predicted.spp,
                spp_interval: forecast.predicted.spp_interval,
                taken_s: seconds.render,
                taken_spp: spp.min,
                at_least: forecast.predicted.caution().is_some(),
                caution: forecast.predicted.caution(),
            }),
            textures: TextureRecord::of(scene, counters),
            isa: detect::name(plan.avx512),
            memory_need_bytes: renderer.need().total_bytes,
            tail: film.tail().as_ref().map(TailStats::of),
            denoised: None,
        }
    }
}

impl Stats {
    /// Whether the picture is known to be within a relative RMSE of `target`, with the confidence of
    /// [`ErrorStats::limit`].
    pub fn meets(&self, target: f64) -> bool {
        self.error.is_some_and(|error| error.limit <= target)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::BackendKind;

    fn info(shadow: &'static str) -> BackendInfo {
        BackendInfo {
            kind: BackendKind::Brute,
            version: "0.1.0".into(),
            isa: "scalar".into(),
            rays_incoherent: "single",
            rays_coherent: "single",
            rays_shadow: shadow,
            bvh_bytes: 0,
            triangles: 0,
        }
    }

    #[test]
    fn modes_are_joined_only_where_they_differ() {
        assert_eq!(BackendStats::of(&info("single"), "asked for").rays, "single");
        assert_eq!(BackendStats::of(&info("packet16"), "asked for").rays, "single/single/packet16");
    }
}
