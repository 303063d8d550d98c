//! What is known of a running render's error. A look costs a pass over the film, so looks are few.
//!
//! With an error target they are those of its [`Watch`], which depend on nothing but the film and the number of samples,
//! so that the same input stops at the same sample. For a mere report the error is estimated each [`ESTIMATE_INTERVAL`],
//! less often where that would take more than a fiftieth of the time.

use std::time::{Duration, Instant};

use super::outcome::Forecast;
use super::target::Watch;
use crate::accuracy::predict::Predicted;
use crate::film::estimate::ErrorEstimate;
use crate::plan::RenderPlan;

/// How often the error is estimated for the report alone.
const ESTIMATE_INTERVAL: Duration = Duration::from_secs(1);

/// Least time between two estimates for the report, in times that one takes: 2 % of the time at most.
const ESTIMATE_COST: u32 = 50;

/// The pilot of an error target ends after this time, but not before these samples per pixel (below, the estimate is not
/// good enough to go by), and at the second number at the latest. The prediction of that moment is kept and held against
/// what the render took.
const PILOT: (Duration, u64, u64) = (Duration::from_secs(2), 32, 128);

/// The looks at one render.
pub(super) struct Looks {
    target: Option<Watch>,
    /// Estimated relMSE at the last look.
    pub relmse: Option<f64>,
    /// What meeting the target costs in all, as of the last look.
    pub predicted: Option<Predicted>,
    /// What was predicted when the pilot ended.
    pub forecast: Option<Forecast>,
    /// Rendering time of the last estimate, and how long to wait before the next one for the report.
    estimated: Duration,
    interval: Duration,
}

impl Looks {
    /// Nothing is known yet.
    pub fn new(plan: &RenderPlan) -> Self {
        let pixels = u64::from(plan.window.width) * u64::from(plan.window.height);
        Looks {
            target: plan.limits.error.map(|error| Watch::new(error, plan.limits.min_spp, pixels, plan.sampler)),
            relmse: None,
            predicted: None,
            forecast: None,
            estimated: Duration::ZERO,
            interval: ESTIMATE_INTERVAL,
        }
    }

    /// Samples per pixel at which the target is looked at next.
    pub fn next(&self) -> Option<u64> {
        self.target.as_ref().map(Watch::next)
    }

    /// Looks, if it is time to, after `done` samples per pixel and `elapsed` of rendering; `estimate` asks the film.
    /// Returns whether the target is met.
    pub fn look(&mut self, done: u64, elapsed: Duration, estimate: impl FnOnce() -> Option<ErrorEstimate>) -> bool {
        if let Some(target) = self.target.as_mut().filter(|target| done == target.next()) {
            let estimate = estimate();
            (self.relmse, self.estimated) = (estimate.map(|e| e.relmse), elapsed);
            let met = target.look(done, elapsed.as_secs_f64(), estimate);
            self.predicted = target.predicted();
            let pilot_over = (elapsed >= PILOT.0 && done >= PILOT.1) || done >= PILOT.2;
            if let (None, true, false, Some(predicted)) = (self.forecast, pilot_over, met, self.predicted) {
                let after_seconds = elapsed.as_secs_f64();
                self.forecast = Some(Forecast { after_seconds, after_spp: done, predicted });
            }
            return met;
        }
        if elapsed - self.estimated >= self.interval {
            let begun = Instant::now();
            self.relmse = estimate().map(|e| e.relmse);
            let took = begun.elapsed();
            self.estimated = elapsed + took;
            self.interval = ESTIMATE_INTERVAL.max(took * ESTIMATE_COST);
        }
        false
    }
}
