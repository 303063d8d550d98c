//! Whether light paths pay, and how many: a small render of the same view, by random numbers that no picture uses.
//!
//! Light paths see what camera paths would lose on them. A path that light samples and BSDF samples find with densities
//! l and b adds f²·(b³ + l³)/(b² + l²)² to the second moment of a pixel under the power heuristic, and with light paths
//! of density t as well f²·(b³ + l³ + t³)/(b² + l² + t²)². Averaged over light paths, which find the path with density
//! t, both are known without waiting for a firefly. What else is noise is measured by the halves of the small render.
//! Light paths are taken if variance times rays falls by a tenth, or if only they find light that counts.
//!
//! The result is a function of scene, options, camera and shape of the picture: not of its seed, its size beyond the
//! small one's, its samples or the clock. Limit: the costs are numbers of rays.

use rayon::prelude::*;

use super::renderer::{self, Renderer};
use crate::camera::CameraRays;
use crate::error::Result;
use crate::film::Pixel;
use crate::plan::Features;
use crate::plan::options::Heuristic;
use crate::transport::counters::Counters;
use crate::transport::job::Job;
use crate::transport::light_paths::lit::LightPaths;
use crate::transport::light_paths::start::Batch;
use crate::transport::light_paths::trace::{self, Sink};
use crate::transport::parts::Wanted;
use crate::transport::path;
use crate::transport::raygen::Chunk;
use crate::transport::wave::Wave;
use crate::transport::world::World;

/// Pixels of the small render, at most.
const PIXELS: f64 = 4096.0;

/// Its samples.
const SAMPLES: u64 = 4;

/// Its seed: a domain of its own.
const SEED: u64 = 0x9D5E_7A11_5EED_0001;

/// Light paths for each pixel and sample that it may decide on.
const SHARES: [f64; 3] = [1.0 / 16.0, 0.25, 1.0];

/// Share of the picture's light from which on light that only light paths find has to be there.
const MISSED: f64 = 1e-3;

/// What light paths must leave of variance times rays.
pub(super) const GAIN: f64 = 0.9;

/// Camera paths keep ratios where there are light paths: what that costs, about.
const KEEPING: f64 = 1.1;

/// Share of the noisiest pixels that do not count: their noise is what light paths are asked about.
const TRIMMED: f64 = 0.01;

/// What a survey has found.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// Light paths for each pixel and sample; 0 if they do not pay.
    pub share: f32,
    /// Why.
    pub reason: String,
}

/// Second moments of what light paths have brought, relative to the pixels, for each pixel and sample.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    /// By BSDF and light samples alone.
    without: f64,
    /// With light paths of these shares.
    with: [f64; SHARES.len()],
    /// Radiance that only light paths find.
    missed: f64,
}

/// What a light path brings to a pixel.
struct Brought {
    pixel: usize,
    value: f64,
    others: [f64; 2],
}

struct Collect {
    width: usize,
    height: usize,
    brought: Vec<Brought>,
}

impl Sink for Collect {
    fn take(&mut self, light_path: &trace::Brought) {
        let &trace::Brought { film, rgb, others, .. } = light_path;
        let inside = film.x >= 0.0 && film.y >= 0.0;
        let (x, y) = (film.x as usize, film.y as usize);
        if inside && x < self.width && y < self.height && rgb.is_finite() {
            let (value, others) = (rgb.element_sum() / 3.0, others.map(f64::from));
            self.brought.push(Brought { pixel: y * self.width + x, value, others });
        }
    }
}

impl Renderer<'_> {
    /// Columns and rows of the small render.
    pub(super) fn survey_size(&self) -> (u32, u32) {
        small(self.plan.resolution, [0.0, PIXELS])
    }

    /// Surveys the scene as it is seen.
    ///
    /// # Errors
    /// Those of [`CameraRays::new`].
    pub(super) fn survey(&self) -> Result<Found> {
        let (plan, size) = (&self.plan, self.survey_size());
        let camera = CameraRays::new(&self.scene().cameras[plan.camera], size, plan.lens)?;
        let mut small = plan.clone();
        small.resolution = size;
        let camera_steps = renderer::camera_steps(self.scene(), &small)?;
        let full = self.job();
        let Some(light_paths) = full.world.light_paths else { return Ok(Found { share: 0.0, reason: String::new() }) };
        let mut features = *full.world.features;
        (features.first_hit, features.per_length, features.light_groups, features.lobes) = (false, false, false, false);
        let job = Job {
            world: World { features: &features, ..full.world },
            camera: &camera,
            camera_steps: &camera_steps,
            seed: SEED,
            columns: size.0,
            rows: size.1,
            layers: &[],
            ..full
        };

        let without = Features { light_paths: false, ..features };
        let alone = Job { world: World { features: &without, light_paths: None, ..job.world }, ..job };
        let (pixels, camera_rays) = self.pool.install(|| see(&alone, size, plan.wave));

        let count = u64::from(size.0) * u64::from(size.1);
        let per_sample = 1u64 << count.ilog2();
        let light_paths = LightPaths { per_sample: per_sample as f32, alone: true, ..light_paths };
        let lit = Job { world: World { light_paths: Some(light_paths), ..job.world }, ..job };
        let (brought, light_rays) = self.pool.install(|| throw(&lit, size, per_sample, plan.wave));

        let means = smoothed(&pixels, size);
        let whole = means.iter().sum::<f64>() / means.len() as f64;
        let per = 1.0 / (SAMPLES as f64 * count as f64);
        let mut moments = Moments::default();
        let survey_share = per_sample as f64 / count as f64;
        for path in &brought {
            let weight = per / (means[path.pixel].powi(2) + 1e-4 * whole * whole).max(f64::MIN_POSITIVE);
            moments.add(path, weight, survey_share, plan.strategy.heuristic);
            moments.missed += if path.others == [0.0; 2] { path.value * per } else { 0.0 };
        }
        let costs = [camera_rays as f64 * per, light_rays as f64 / (SAMPLES * per_sample) as f64];
        Ok(decide(&moments, rest(&pixels, &means, whole, SAMPLES), whole, costs))
    }
}

impl Moments {
    fn add(&mut self, path: &Brought, weight: f64, survey_share: f64, heuristic: Heuristic) {
        let [b, l] = path.others;
        let square = path.value * path.value * weight;
        // Times the density of the survey's light paths.
        let moment = |t: f64| match heuristic {
            Heuristic::Power => {
                let squares = b * b + l * l + t * t;
                (b * b * b + l * l * l + t * t * t) / (squares * squares)
            }
            Heuristic::Balance => 1.0 / (b + l + t),
        };
        if b + l > 0.0 {
            self.without += square * moment(0.0);
        }
        for (with, share) in self.with.iter_mut().zip(SHARES) {
            *with += square * moment(share / survey_share);
        }
    }
}

/// Camera samples of every pixel, and the rays that they took.
fn see(job: &Job, (width, height): (u32, u32), wave: usize) -> (Vec<Pixel>, u64) {
    let places: Vec<(u32, u32)> = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).collect();
    let per_chunk = (wave / SAMPLES as usize).max(1);
    let chunks: Vec<(Vec<Pixel>, u64)> = places
        .par_chunks(per_chunk)
        .map_init(
            || Wave::new(wave, &Wanted::default()),
            |wave, pixels| {
                let (mut sums, mut counters) = (vec![Pixel::default(); pixels.len()], Counters::default());
                let chunk = Chunk { pixels, first_sample: 0, samples: SAMPLES as usize };
                path::run(job, &chunk, wave, &mut sums, &mut counters);
                (sums, counters.rays())
            },
        )
        .collect();
    let rays = chunks.iter().map(|(_, rays)| rays).sum();
    (chunks.into_iter().flat_map(|(pixels, _)| pixels).collect(), rays)
}

/// What light paths bring, in their order, and the rays that they took.
fn throw(job: &Job, (width, height): (u32, u32), per_sample: u64, wave: usize) -> (Vec<Brought>, u64) {
    let paths = SAMPLES * per_sample;
    let batches: Vec<(Vec<Brought>, u64)> = (0..paths.div_ceil(wave as u64))
        .into_par_iter()
        .map_init(
            || trace::Desk::new(wave),
            |desk, number| {
                let first = number * wave as u64;
                let len = (paths - first).min(wave as u64) as usize;
                let mut sink = Collect { width: width as usize, height: height as usize, brought: Vec::new() };
                let mut counters = Counters::default();
                trace::run(job, &Batch { sample: 0, per_sample, first, len }, desk, &mut sink, &mut counters);
                (sink.brought, counters.rays())
            },
        )
        .collect();
    let rays = batches.iter().map(|(_, rays)| rays).sum();
    (batches.into_iter().flat_map(|(brought, _)| brought).collect(), rays)
}

/// Means over 5 × 5 pixels, of all channels.
pub(super) fn smoothed(pixels: &[Pixel], (width, height): (u32, u32)) -> Vec<f64> {
    let (width, height) = (width as usize, height as usize);
    let value = |p: usize| pixels[p].mean()[..3].iter().sum::<f64>() / 3.0;
    let mean = |p: usize| {
        let (x, y) = (p % width, p / width);
        let (mut sum, mut n) = (0.0, 0.0);
        for y in y.saturating_sub(2)..(y + 3).min(height) {
            for x in x.saturating_sub(2)..(x + 3).min(width) {
                (sum, n) = (sum + value(y * width + x), n + 1.0);
            }
        }
        sum / n
    };
    (0..pixels.len()).map(mean).collect()
}

/// Columns and rows of a picture like this one with about as many pixels, within these bounds.
pub(super) fn small((width, height): (u32, u32), [least, most]: [f64; 2]) -> (u32, u32) {
    let all = f64::from(width) * f64::from(height);
    let scale = (all.clamp(least, most) / all).sqrt();
    let side = |pixels: u32| ((f64::from(pixels) * scale) as u32).max(1);
    (side(width), side(height))
}

/// Relative variance of one of `samples` samples of a pixel without its largest values.
pub(super) fn rest(pixels: &[Pixel], means: &[f64], whole: f64, samples: u64) -> f64 {
    let of = |(pixel, mean): (&Pixel, &f64)| {
        let variance = pixel.variance().map_or(0.0, |channels| channels.iter().sum::<f64>() / 3.0);
        samples as f64 * variance / (mean * mean + 1e-4 * whole * whole).max(f64::MIN_POSITIVE)
    };
    let mut values: Vec<f64> = pixels.iter().zip(means).map(of).collect();
    values.sort_by(f64::total_cmp);
    let kept = values.len() - (values.len() as f64 * TRIMMED).ceil() as usize;
    values[..kept].iter().sum::<f64>() / values.len() as f64
}

/// The share under which variance times rays is least. `rest` is the variance that light paths do not change, `whole`
/// the mean of the picture, `costs` are rays of a camera sample and of a light path.
fn decide(moments: &Moments, rest: f64, whole: f64, [camera, light]: [f64; 2]) -> Found {
    let without = (rest + moments.without) * camera;
    let with = |number: usize| (rest + moments.with[number]) * (KEEPING * camera + SHARES[number] * light);
    let best = (0..SHARES.len()).min_by(|&a, &b| with(a).total_cmp(&with(b))).unwrap_or(0);
    let missed = moments.missed / (whole + moments.missed).max(f64::MIN_POSITIVE);
    let percent = |x: f64| format!("{:.0} %", 100.0 * x);
    let left = with(best) / without.max(f64::MIN_POSITIVE);
    let rays = SHARES[best] * light / camera.max(f64::MIN_POSITIVE);
    if missed > MISSED {
        let reason = format!("only they find {} of the light", percent(missed));
        Found { share: SHARES[best] as f32, reason }
    } else if left < GAIN {
        let reason = format!("they leave {} of variance times rays, for {} more rays", percent(left), percent(rays));
        Found { share: SHARES[best] as f32, reason }
    } else {
        Found { share: 0.0, reason: "they would not make it cheaper".into() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: by hand.
    #[test]
    fn light_paths_are_taken_where_they_pay() {
        let rare = Brought { pixel: 0, value: 1.0, others: [1e-3, 0.0] };
        let common = Brought { pixel: 0, value: 1.0, others: [1e3, 0.0] };
        let only = Brought { pixel: 0, value: 1.0, others: [0.0, 0.0] };
        let found = |path: &Brought| {
            let mut moments = Moments::default();
            moments.add(path, 1.0, 1.0, Heuristic::Power);
            moments.missed = if path.others == [0.0; 2] { 0.5 } else { 0.0 };
            decide(&moments, 1.0, 1.0, [10.0, 3.0])
        };
        assert!(found(&rare).share > 0.0 && found(&rare).reason.contains("variance"));
        assert_eq!(found(&common).share, 0.0);
        assert!(found(&only).share > 0.0 && found(&only).reason.contains("33 %"));
    }
}
