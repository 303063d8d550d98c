//! How many samples per pixel the next pass takes, how far a render is, and whether its time is up. Passes double until
//! one takes about [`PASS_SECONDS`], so that limits and the callback are looked at a few times a second.
//!
//! The clock decides where passes end, never what is in them: a pixel's samples are numbered and added in ascending order
//! whatever the passes, so a render to a number of samples has the same bits on any machine.

use std::time::{Duration, Instant};

use crate::accuracy::predict::Predicted;
use crate::plan::Limits;

/// Samples per pixel when no limit is given.
pub const DEFAULT_SPP: u64 = 64;

/// Most samples per pixel in one pass: short enough for a progress report each second on ordinary images.
const PASS_SAMPLES: u64 = 64;

/// Passes aim at this wall time, so that limits and the callback are looked at a few times a second.
const PASS_SECONDS: f64 = 0.4;

/// Rendering time: stands while the picture is shown.
pub(super) struct Clock {
    start: Instant,
    stood: Duration,
}

impl Clock {
    /// Runs from now on.
    pub fn start() -> Self {
        Clock { start: Instant::now(), stood: Duration::ZERO }
    }

    /// What it shows.
    pub fn elapsed(&self) -> Duration {
        self.start.elapsed() - self.stood
    }

    /// Stands while `showing` runs.
    pub fn stand(&mut self, showing: impl FnOnce()) {
        let stopped = Instant::now();
        showing();
        self.stood += stopped.elapsed();
    }
}

/// The lengths of passes under a plan's limits.
pub(super) struct Schedule {
    /// Samples per pixel at which the render ends; `u64::MAX` when something else ends it.
    spp: u64,
    time: Option<Duration>,
    /// Samples per pixel of the pass to come, or of the one that runs.
    samples: u64,
    /// Rendering time when the last pass had ended.
    last: Duration,
}

impl Schedule {
    /// [`DEFAULT_SPP`] samples per pixel when `limits` names no limit.
    pub fn new(limits: &Limits) -> Self {
        let endless = limits.spp.is_none() && limits.time.is_none() && limits.error.is_none();
        let spp = limits.spp.unwrap_or(if endless { DEFAULT_SPP } else { u64::MAX });
        Schedule { spp, time: limits.time, samples: 1, last: Duration::ZERO }
    }

    /// Samples per pixel of the pass after `done`; `None` when all that were asked for are done.
    pub fn pass(&mut self, done: u64) -> Option<u64> {
        self.samples = self.samples.min(self.spp.saturating_sub(done));
        (self.samples > 0).then_some(self.samples)
    }

    /// Takes down that a pass has ended at `elapsed`, with `done` samples per pixel. The next one does not go beyond
    /// `next_look` samples per pixel, where the error is looked at.
    pub fn passed(&mut self, done: u64, elapsed: Duration, next_look: Option<u64>) {
        let left = self.time.map(|time| time.saturating_sub(elapsed));
        self.samples = next_pass(self.samples, elapsed - self.last, left, done);
        if let Some(look) = next_look {
            self.samples = self.samples.min(look - done);
        }
        self.last = elapsed;
    }

    /// Whether the time that was given is over.
    pub fn time_is_up(&self, elapsed: Duration) -> bool {
        self.time.is_some_and(|time| elapsed >= time)
    }

    /// Fraction of the work done, in [0, 1], by whichever limit is nearest, at `spp` samples per pixel.
    pub fn fraction(&self, spp: f64, elapsed: Duration, predicted: Option<Predicted>) -> f64 {
        let by_spp = spp / self.spp as f64;
        let by_time = self.time.map_or(0.0, |time| elapsed.as_secs_f64() / time.as_secs_f64());
        let by_error = predicted.map_or(0.0, |p| spp / p.spp);
        by_spp.max(by_time).max(by_error).min(1.0)
    }
}

/// Samples of the next pass: doubles until a pass takes long enough, shrinks to fit the time that is left. Always even
/// after the first two, so that both halves of the film have the same number.
fn next_pass(last: u64, took: Duration, left: Option<Duration>, done: u64) -> u64 {
    if done == 1 {
        return 1;
    }
    let per_sample = took.as_secs_f64() / last as f64;
    let mut seconds = PASS_SECONDS;
    if let Some(left) = left {
        seconds = seconds.min(left.as_secs_f64());
    }
    let fitting = if per_sample > 0.0 { (seconds / per_sample) as u64 } else { u64::MAX };
    let samples = fitting.min(2 * last).clamp(2, PASS_SAMPLES);
    samples & !1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits(spp: Option<u64>, time: Option<f64>) -> Limits {
        Limits { spp, time: time.map(Duration::from_secs_f64), error: None, min_spp: 2 }
    }

    /// Passes under `limits` when a sample takes `seconds`, until a limit is met.
    fn passes(limits: &Limits, seconds: f64, looks: &[u64]) -> Vec<u64> {
        let mut schedule = Schedule::new(limits);
        let (mut done, mut passes) = (0, Vec::new());
        while let Some(samples) = schedule.pass(done) {
            passes.push(samples);
            done += samples;
            let elapsed = Duration::from_secs_f64(done as f64 * seconds);
            if schedule.time_is_up(elapsed) {
                break;
            }
            schedule.passed(done, elapsed, looks.iter().copied().find(|&look| look > done));
        }
        passes
    }

    /// Oracle: sums and durations written by hand. Deterministic: the clock is an argument.
    #[test]
    fn passes_double_up_to_their_time_and_end_at_the_limit() {
        assert_eq!(passes(&limits(None, None), 1e-6, &[]), [1, 1, 2, 4, 8, 16, 32]);
        assert_eq!(passes(&limits(Some(200), None), 1e-6, &[]), [1, 1, 2, 4, 8, 16, 32, 64, 64, 8]);
        // 0.4 s are six samples of 0.066 s; an odd number that was asked for is kept.
        assert_eq!(passes(&limits(Some(21), None), 0.066, &[]), [1, 1, 2, 4, 6, 6, 1]);
        // Passes do not leap over a look at the error.
        assert_eq!(
            passes(&limits(Some(64), None), 1e-6, &[4, 8, 18, 32, 64]),
            [1, 1, 2, 4, 8, 2, 4, 8, 2, 4, 8, 16, 4]
        );
        // One second: the last passes shrink to fit it.
        assert_eq!(passes(&limits(None, Some(1.0)), 0.066, &[]), [1, 1, 2, 4, 6, 2]);
    }

    /// Oracle: the definition.
    #[test]
    fn the_nearest_limit_says_how_far_a_render_is() {
        let schedule = Schedule::new(&limits(Some(100), Some(10.0)));
        let at = |spp, seconds| schedule.fraction(spp, Duration::from_secs_f64(seconds), None);
        assert_eq!([at(25.0, 1.0), at(25.0, 4.0), at(100.0, 11.0)], [0.25, 0.4, 1.0]);
    }
}
