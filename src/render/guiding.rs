//! The survey that a guide is learnt in: small renders of the same view, by random numbers that no picture uses, each
//! guided by what those before it have learnt.
//!
//! Rounds double what is known. The last ones prove the guide: records that it has not seen choose the share of each
//! cell, and variance times rays of a small render, without its noisiest pixels, decides whether it pays. The guide is
//! then frozen: a function of scene, options, camera and shape of the picture, not of its seed, its size beyond that of
//! the small renders, its samples or the clock; records are in the order of pixels and samples, whatever the threads.
//!
//! Limit: costs are numbers of rays, and [`KEEPING`] for what guiding costs beside them.

use rayon::prelude::*;

use super::identity::Identity;
use super::renderer::{self, Renderer};
use super::survey::{GAIN, rest, small, smoothed};
use crate::camera::CameraRays;
use crate::error::Result;
use crate::film::Pixel;
use crate::math::hash::mix;
use crate::plan::{GuideRecord, RenderPlan};
use crate::shading::guide::{Guide, Record};
use crate::transport::counters::Counters;
use crate::transport::job::Job;
use crate::transport::light_paths::lit::LightPaths;
use crate::transport::parts::Wanted;
use crate::transport::path;
use crate::transport::raygen::Chunk;
use crate::transport::wave::Wave;
use crate::transport::world::World;

/// Pixels of the small renders, about: the picture's, within these bounds.
const PIXELS: [f64; 2] = [1024.0, 4096.0];

/// Samples of the rounds of which the guide learns.
const ROUNDS: [u64; 4] = [4, 4, 8, 8];

/// Samples of the round that proves it.
const PROOF: u64 = 8;

/// Samples of the rounds that are compared.
const COMPARED: u64 = ROUNDS[0];

/// Seed of the first round; others follow.
const SEED: u64 = 0x9D5E_7A11_5EED_1000;

/// What guiding costs beside rays: assumed, and more than the 1.04 that cornell-box takes, so that a guide that would
/// gain little is left out.
const KEEPING: f64 = 1.15;

/// What a guide of the first round, of a sixth of all samples, must leave so that the others follow: half of [`GAIN`].
const PROMISE: f64 = 0.95;

/// What a survey has found.
#[derive(Clone)]
pub(super) struct Found {
    /// The guide, if it pays.
    pub guide: Option<Guide>,
    /// Why.
    pub reason: String,
}

/// A small render.
struct Seen {
    pixels: Vec<Pixel>,
    rays: u64,
    records: Vec<Record>,
}

impl Renderer<'_> {
    /// What a guide depends on besides what every survey does.
    pub(super) fn settings_of_guide(&self, asked: bool) -> Identity {
        let asked = if asked { "asked for" } else { "where it pays" };
        let values = [("guide", asked.to_string()), ("light-paths", self.plan.light_paths_text())];
        Identity { values: values.map(|(name, value)| (name.to_string(), value)).to_vec() }
    }

    /// Learns a guide for the scene as it is seen. One that is `asked` for guides wherever a cell gains by it.
    ///
    /// # Errors
    /// Those of [`CameraRays::new`].
    pub(super) fn learn(&self, asked: bool) -> Result<Found> {
        let (width, height) = self.plan.resolution;
        let all = f64::from(width) * f64::from(height);
        let mut plan = self.plan.clone();
        plan.resolution = small((width, height), PIXELS);
        let plan = &plan;
        let camera = CameraRays::new(&self.scene().cameras[plan.camera], plan.resolution, plan.lens)?;
        let camera_steps = renderer::camera_steps(self.scene(), plan)?;
        let mut features = plan.features;
        (features.first_hit, features.per_length, features.light_groups, features.lobes) = (false, false, false, false);
        let full = self.job();
        let pixels = f64::from(plan.resolution.0) * f64::from(plan.resolution.1);
        let share = pixels / all;
        let light_paths = full.world.light_paths;
        let light_paths = light_paths.map(|of| LightPaths { per_sample: of.per_sample * share as f32, ..of });
        let world = World { features: &features, light_paths, learns: true, ..full.world };
        let job = Job {
            camera: &camera,
            camera_steps: &camera_steps,
            columns: plan.resolution.0,
            rows: plan.resolution.1,
            layers: &[],
            world,
            ..full
        };
        let mut seed = SEED;
        let mut see = |guide: &Guide, samples: u64| {
            let world = World { directions: Some(guide), ..job.world };
            let job = Job { world, seed, ..job };
            seed += 1;
            self.pool.install(|| see(&job, plan, samples))
        };

        let mut guide = Guide::learn(&[]).with_share(0.0);
        let (mut records, mut without) = (Vec::new(), 0.0);
        for (round, samples) in ROUNDS.into_iter().enumerate() {
            let seen = see(&guide, samples);
            records.extend_from_slice(&seen.records);
            match round {
                0 => without = cost(&seen, plan.resolution),
                1 if !asked && !(cost(&seen, plan.resolution) < PROMISE * without) => {
                    return Ok(Found { guide: None, reason: "it would not make it cheaper".into() });
                }
                _ => {}
            }
            guide = Guide::learn(&records);
        }
        guide.prove(&see(&guide, PROOF).records);
        let left = KEEPING * cost(&see(&guide, COMPARED), plan.resolution) / without;
        let reason = format!("it leaves {:.0} % of variance times cost", 100.0 * left);
        let pays = guide.cells().1 > 0 && (asked || left < GAIN);
        Ok(Found { guide: pays.then_some(guide), reason })
    }
}

impl Found {
    /// What the plan records of the guide.
    pub fn record(&self) -> Option<GuideRecord> {
        self.guide.as_ref().map(|guide| {
            let (cells, guiding) = guide.cells();
            let digest = guide.bits().fold(0, |digest, bits| mix(digest, bits.into()));
            GuideRecord { cells, guiding, digest }
        })
    }
}

/// Relative variance of a sample without the noisiest pixels, times its rays.
fn cost(seen: &Seen, size: (u32, u32)) -> f64 {
    let means = smoothed(&seen.pixels, size);
    let whole = means.iter().sum::<f64>() / means.len() as f64;
    rest(&seen.pixels, &means, whole, COMPARED) * seen.rays as f64
}

/// Camera samples of every pixel, in the order of pixels.
fn see(job: &Job, plan: &RenderPlan, samples: u64) -> Seen {
    let (width, height) = plan.resolution;
    let places: Vec<(u32, u32)> = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).collect();
    let chunks: Vec<Seen> = places
        .par_chunks((plan.wave / samples as usize).max(1))
        .map_init(
            || Wave::new(plan.wave, &Wanted::default()),
            |wave, places| {
                let (mut pixels, mut counters) = (vec![Pixel::default(); places.len()], Counters::default());
                let chunk = Chunk { pixels: places, first_sample: 0, samples: samples as usize };
                path::run(job, &chunk, wave, &mut pixels, &mut counters);
                let Wave { log, sums, .. } = wave;
                let records = log.take(|slot| sums.gathered[slot as usize].radiance).collect();
                Seen { pixels, rays: counters.rays(), records }
            },
        )
        .collect();
    let rays = chunks.iter().map(|chunk| chunk.rays).sum();
    let (mut pixels, mut records) = (Vec::new(), Vec::new());
    for chunk in chunks {
        pixels.extend(chunk.pixels);
        records.extend(chunk.records);
    }
    Seen { pixels, rays, records }
}
