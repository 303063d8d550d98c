//! Estimates of a running render's error. An estimate costs a pass over the film, so they are few.
//!
//! With an error target they are the checks of its [`StoppingRule`], which depend on nothing but the film and the
//! number of samples, so that the same input stops at the same sample. For the report alone the error is estimated each
//! [`ESTIMATE_INTERVAL`] at the ends of passes, less often where that would take more than a fiftieth of the time.

use std::time::{Duration, Instant};

use super::result::Forecast;
use super::stopping::StoppingRule;
use crate::accuracy::predict::Predicted;
use crate::film::estimate::{ErrorEstimate, Tail};
use crate::plan::RenderPlan;

/// How often the error is estimated for the report alone.
const ESTIMATE_INTERVAL: Duration = Duration::from_secs(1);

/// Least time between two estimates for the report, in times that one takes: 2 % of the time at most.
const ESTIMATE_COST: u32 = 50;

/// The pilot of an error target ends after this time, but not before these samples per pixel (below, the estimate is
/// not good enough to go by), and at the second number at the latest. The prediction of that moment is kept and
/// compared with what the render took.
const PILOT: (Duration, u64, u64) = (Duration::from_secs(2), 32, 128);

/// The error of one render as its passes end.
pub(super) struct ErrorMonitor {
    rule: Option<StoppingRule>,
    target: Option<f64>,
    /// Estimated relMSE when last estimated.
    pub relmse: Option<f64>,
    /// What meeting the target costs in all, as of the last check.
    pub predicted: Option<Predicted>,
    /// What was predicted when the pilot ended.
    pub forecast: Option<Forecast>,
    /// Rendering time of the last estimate, and how long to wait before the next one for the report.
    estimated: Duration,
    interval: Duration,
}

impl ErrorMonitor {
    /// For a render that goes on from `done` samples per pixel, where `check` was the error target and the next look
    /// at it.
    pub fn new(plan: &RenderPlan, done: u64, check: Option<(f64, u64)>) -> Self {
        let pixels = u64::from(plan.window.width) * u64::from(plan.window.height);
        let rule = |error| {
            let mut rule = StoppingRule::new(error, plan.limits.min_spp, pixels, plan.sampler);
            rule.go_on(done, check.filter(|(target, _)| *target == error).map(|(_, next)| next));
            rule
        };
        ErrorMonitor {
            rule: plan.limits.error.map(rule),
            target: plan.limits.error,
            relmse: None,
            predicted: None,
            forecast: None,
            estimated: Duration::ZERO,
            interval: ESTIMATE_INTERVAL,
        }
    }

    /// Samples per pixel at which the target is checked next.
    pub fn next_check(&self) -> Option<u64> {
        self.rule.as_ref().map(StoppingRule::next_check)
    }

    /// The target and its next check, to be gone on with.
    pub fn check(&self) -> Option<(f64, u64)> {
        self.target.zip(self.next_check())
    }

    /// Estimates the error if it is time to, after `done` samples per pixel and `elapsed` of rendering; `estimate` and
    /// `tail` ask the film. Returns whether the target is met.
    pub fn pass_ended(
        &mut self,
        done: u64,
        elapsed: Duration,
        estimate: impl FnOnce() -> Option<ErrorEstimate>,
        tail: impl FnOnce() -> Option<Tail>,
    ) -> bool {
        if let Some(rule) = self.rule.as_mut().filter(|rule| done == rule.next_check()) {
            let estimate = estimate();
            (self.relmse, self.estimated) = (estimate.map(|e| e.relmse), elapsed);
            let met = rule.check(done, elapsed.as_secs_f64(), estimate);
            self.predicted = rule.predicted();
            if !met {
                let verdict = tail().map(|tail| tail.verdict());
                self.predicted = self.predicted.map(|predicted| predicted.under(verdict));
            }
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
