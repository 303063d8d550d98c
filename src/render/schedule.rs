//! Where passes and epochs end, how far a render is, and until when it may run.
//!
//! **Passes end at sample counts**, never by the clock: at powers of two up to [`PASS_SAMPLES`], then at its multiples,
//! at checks of the error (an eighth of a power of two apart, `stopping.rs`), and at the number of samples that was
//! asked for. The powers of two are epochs: what is learnt from samples may be used from the next epoch on, so that it
//! depends on the input alone. The clock, an error target and signals *end* a render, inside a pass as well: a tile is
//! rendered wholly or not at all, so that a pixel's sample count does not depend on its values.
//!
//! A pixel's samples are numbered and added in pairs whatever the passes (`film/blocks.rs`), so a render to a number of
//! samples has the same bits on any machine.

use std::time::{Duration, Instant};

use crate::accuracy::predict::Predicted;
use crate::plan::Limits;

/// Samples per pixel when no limit is given.
pub const DEFAULT_SPP: u64 = 64;

/// Most samples per pixel in one pass; a power of two. Waves are full from 8 samples on, and tiles are short enough for
/// the clock.
pub(super) const PASS_SAMPLES: u64 = 64;

/// Samples per pixel that end a render under `limits`, if any do: [`DEFAULT_SPP`] when they name no limit.
pub(super) fn samples(limits: &Limits) -> Option<u64> {
    let endless = limits.time.is_none() && limits.error.is_none();
    limits.spp.or(endless.then_some(DEFAULT_SPP))
}

/// Rendering time: paused while the picture is shown.
pub(super) struct Clock {
    start: Instant,
    paused: Duration,
}

impl Clock {
    /// Runs from now on.
    pub fn start() -> Self {
        Clock { start: Instant::now(), paused: Duration::ZERO }
    }

    /// Time since the start without the pauses.
    pub fn elapsed(&self) -> Duration {
        self.start.elapsed() - self.paused
    }

    /// Pauses while `showing` runs.
    pub fn pause(&mut self, showing: impl FnOnce()) {
        let stopped = Instant::now();
        showing();
        self.paused += stopped.elapsed();
    }
}

/// The passes under a plan's limits.
pub(super) struct Schedule {
    /// Samples per pixel at which the render ends; `u64::MAX` when something else ends it.
    spp: u64,
    time: Option<Duration>,
}

impl Schedule {
    /// The passes under `limits`.
    pub fn new(limits: &Limits) -> Self {
        Schedule { spp: samples(limits).unwrap_or(u64::MAX), time: limits.time }
    }

    /// Samples per pixel at the end of the pass after `done`, which does not go beyond the error's `next_check`; `None`
    /// when all that were asked for are done.
    pub fn next(&self, done: u64, next_check: Option<u64>) -> Option<u64> {
        let grid = match done {
            0..PASS_SAMPLES => (done + 1).next_power_of_two(),
            _ => (done / PASS_SAMPLES + 1) * PASS_SAMPLES,
        };
        let check = next_check.filter(|&check| check > done).unwrap_or(u64::MAX);
        (done < self.spp).then_some(grid.min(check).min(self.spp))
    }

    /// When the time that was given is over, after `elapsed` of it.
    pub fn deadline(&self, elapsed: Duration) -> Option<Instant> {
        self.time.and_then(|time| Instant::now().checked_add(time.saturating_sub(elapsed)))
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

#[cfg(test)]
mod tests {
    use super::*;

    fn limits(spp: Option<u64>, time: Option<f64>) -> Limits {
        Limits { spp, time: time.map(Duration::from_secs_f64), error: None, min_spp: 2 }
    }

    /// Ends of the passes under `limits` from `done` on, with checks of the error at `checks`, eleven at most.
    fn ends(limits: &Limits, mut done: u64, checks: &[u64]) -> Vec<u64> {
        let schedule = Schedule::new(limits);
        let next = || {
            done = schedule.next(done, checks.iter().copied().find(|&check| check > done))?;
            Some(done)
        };
        std::iter::from_fn(next).take(11).collect()
    }

    /// Oracle: written by hand. Deterministic: no clock has a part in it.
    #[test]
    fn passes_end_at_powers_of_two_and_their_subdivisions() {
        assert_eq!(ends(&limits(None, None), 0, &[]), [1, 2, 4, 8, 16, 32, 64]);
        assert_eq!(ends(&limits(Some(200), None), 0, &[]), [1, 2, 4, 8, 16, 32, 64, 128, 192, 200]);
        assert_eq!(ends(&limits(None, Some(1.0)), 0, &[]), [1, 2, 4, 8, 16, 32, 64, 128, 192, 256, 320]);
        // An odd number that was asked for is kept, and gone on from.
        assert_eq!(ends(&limits(Some(21), None), 0, &[]), [1, 2, 4, 8, 16, 21]);
        assert_eq!(ends(&limits(Some(200), None), 21, &[]), [32, 64, 128, 192, 200]);
        assert_eq!(ends(&limits(Some(21), None), 21, &[]), [0u64; 0]);
        // Passes do not leap over a check of the error.
        assert_eq!(ends(&limits(Some(90), None), 0, &[4, 8, 18, 32, 64, 72]), [1, 2, 4, 8, 16, 18, 32, 64, 72, 90]);
    }

    /// Oracle: the definition.
    #[test]
    fn the_nearest_limit_says_how_far_a_render_is() {
        let schedule = Schedule::new(&limits(Some(100), Some(10.0)));
        let at = |spp, seconds| schedule.fraction(spp, Duration::from_secs_f64(seconds), None);
        assert_eq!([at(25.0, 1.0), at(25.0, 4.0), at(100.0, 11.0)], [0.25, 0.4, 1.0]);
    }
}
