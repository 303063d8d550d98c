//! What a study finds: its runs, the price list, and everything together. Errors are relative, times in seconds. Filled
//! by [`measure`](super::measure), read by the report.

use super::classes::Classes;
use super::clock::Cost;
use super::effects::{EffectRow, Shown};
use super::reference::{Difference, Reference};
use super::settings::Setting;
use crate::accuracy::predict::{Point, Predicted, Prediction};
use crate::film::Film;
use crate::film::layer::bounces::LENGTHS;

/// One finished run of a setting.
#[derive(Clone, Debug)]
pub struct Run {
    /// Which of the setting's runs of this number of samples; equal numbers of all settings share a seed.
    pub index: usize,
    /// Samples per pixel.
    pub spp: u64,
    /// What it took.
    pub cost: Cost,
    /// How it differs from the reference.
    pub difference: Difference,
    /// HDR-FLIP against the reference: of the largest runs only.
    pub flip: Option<f64>,
    /// Samples that were not finite.
    pub nonfinite: u64,
    /// Paths ended by the depth limit.
    pub capped_paths: u64,
    /// Camera, bounce and shadow rays.
    pub rays: [u64; 3],
}

/// A setting and what was measured of it.
#[derive(Clone, Debug)]
pub struct Series {
    /// What was rendered.
    pub setting: Setting,
    /// Finished runs, in order of time.
    pub runs: Vec<Run>,
    /// Pictures of the runs with the most samples, by [`Run::index`].
    pub pictures: Vec<Vec<f32>>,
}

/// A target of the price list.
#[derive(Clone, Copy, Debug)]
pub struct Price {
    /// Relative RMSE.
    pub error: f64,
    /// What the pilot says it costs.
    pub predicted: Predicted,
    /// What a run of that many samples took and reached.
    pub measured: Option<Measured>,
}

/// A run for the price list.
#[derive(Clone, Copy, Debug)]
pub struct Measured {
    /// Samples per pixel.
    pub spp: u64,
    /// Wall time in all, fixed costs included.
    pub seconds: f64,
    /// relMSE against the reference, the reference's own subtracted; `None` without a reference.
    pub relmse: Option<f64>,
    /// The film's own estimate of its relMSE and its 95 % interval.
    pub estimated: Option<(f64, [f64; 2])>,
    /// Energy of the processor while it rendered, joules, where that can be read.
    pub joules: Option<f64>,
}

/// Everything that was measured.
#[derive(Debug)]
pub struct Study {
    /// Load and build of the default setting, seconds.
    pub fixed_s: f64,
    /// Wall time that the film takes to estimate its error once, seconds: at the pilot's last look.
    pub estimate_s: Option<f64>,
    /// Points of the pilot.
    pub pilot: Vec<Point>,
    /// What they say.
    pub prediction: Option<Prediction>,
    /// The price list.
    pub prices: Vec<Price>,
    /// Pictures of those that were measured, in their order.
    pub price_pictures: Vec<Vec<f32>>,
    /// What everything is compared with.
    pub reference: Option<Reference>,
    /// Samples per pixel of each run of the reference; 0 for a given one.
    pub reference_spp: u64,
    /// The default first, then techniques and knobs.
    pub series: Vec<Series>,
    /// Mean radiance by number of edges, a run each ([`LENGTHS`] entries; the last holds all longer paths).
    pub lengths: Vec<[f64; LENGTHS]>,
    /// Samples per pixel of the largest runs.
    pub top_spp: u64,
    /// Finished rounds of two runs.
    pub rounds: usize,
    /// Wall time of the last of them.
    pub round_s: f64,
    /// The first of the largest runs of the default setting.
    pub film: Option<Film>,
    /// Where the noise comes from, where that was asked for.
    pub classes: Option<Classes>,
    /// Prices of effects, where they were asked for.
    pub effects: Vec<EffectRow>,
    /// Those with the largest errors.
    pub shown: Vec<Shown>,
    /// Whether the observer broke it off.
    pub interrupted: bool,
    /// Wall time from `started` to the last run.
    pub seconds: f64,
}

impl Study {
    /// Nothing measured yet. `fixed_s`: load and build of the default setting, seconds; `settings` with the default
    /// first.
    pub(super) fn new(fixed_s: f64, reference: Option<Reference>, settings: Vec<Setting>) -> Self {
        let series = |setting| Series { setting, runs: Vec::new(), pictures: Vec::new() };
        Study {
            fixed_s,
            estimate_s: None,
            pilot: Vec::new(),
            prediction: None,
            prices: Vec::new(),
            price_pictures: Vec::new(),
            reference,
            reference_spp: 0,
            series: settings.into_iter().map(series).collect(),
            lengths: Vec::new(),
            top_spp: 0,
            rounds: 0,
            round_s: 0.0,
            film: None,
            classes: None,
            effects: Vec::new(),
            shown: Vec::new(),
            interrupted: false,
            seconds: 0.0,
        }
    }
}
