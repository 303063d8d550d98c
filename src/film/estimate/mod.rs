//! The film's estimate of its error, from the film alone: relMSE against the converged picture, and the standard error
//! of the picture's mean, each with a 95 % interval.
//!
//! **Variance.** The variance v of a pixel's mean comes from its two halves and is unbiased for Sobol' points as for
//! independent samples, because the halves are independent scrambles (`tests/suite/estimate.rs` shows what the formula
//! for independent samples makes of Sobol' points). One degree of freedom a pixel; pictures have many pixels.
//!
//! **Two halves, not more.** Measured at equal samples on the shared scenes (24×24): four replicates instead of two
//! raise relMSE by 2 to 11 % at 128 samples per pixel, for Sobol' points know nothing of each other across replicates,
//! and double the film. The spread of the estimate falls by 10 to 35 % only, because few pixels hold most of the
//! variance, and its bias, which is in the denominators, stays.
//!
//! **relMSE** = mean over pixels and channels of v/(R² + ε), ε = 0.01·mean(I)². The reference R is not
//! there; `denominator` says what stands in for it, `moments` what the sums over pixels say and how far they are to be
//! trusted.
//!
//! Limits: light that no sample has found yet is missing from picture and estimate alike; `tail` says how much that may
//! be, and how far the estimate is to be trusted. Bias has no part in it.

mod denominator;
mod error;
mod filtered;
mod moments;
mod tail;

use rayon::prelude::*;

use self::denominator::{sampled_mean, sum_columns};
use self::moments::Moments;
use super::store::Film;
use crate::math::pareto;

pub use self::denominator::RELMSE_EPSILON;
pub use self::error::ErrorEstimate;
pub use self::filtered::FilteredError;
pub(crate) use self::moments::DENOMINATOR_SHARE;
pub use self::tail::{Tail, Verdict};

impl Film {
    /// Estimates the film's error against the converged picture, on the current pool of threads; the result does not
    /// depend on their number. `None` until both halves of a pixel have samples.
    pub fn error_estimate(&self) -> Option<ErrorEstimate> {
        let width = (self.window.width as usize).max(1);
        let own: Vec<[f32; 4]> = self.pixels.par_iter().map(sampled_mean).collect();
        let mean = self.mean();
        let epsilon = RELMSE_EPSILON * ((mean[0] + mean[1] + mean[2]) / 3.0).powi(2);
        // Each row is summed, then the rows in order: the same bits for any number of threads.
        let rows = self.pixels.par_chunks_exact(width).zip(own.par_chunks_exact(width)).enumerate().map_init(
            || vec![[0.0; 4]; width],
            |columns, (y, (row, of_row))| {
                sum_columns(&own, y, columns);
                let mut values = Vec::with_capacity(width);
                (Moments::of_row(row, of_row, columns, epsilon, &mut values), values)
            },
        );
        let (mut sums, mut values) = (Moments::default(), Vec::new());
        for (row, of_row) in rows.collect::<Vec<_>>() {
            sums.add(&row);
            values.extend(of_row);
        }
        let k = pareto::tail(&mut values).map_or(0.0, |tail| tail.k);
        (sums.count > 0.0).then(|| sums.estimate(mean, epsilon, k))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::noise::Pcg;
    use crate::plan::options::Crop;

    fn full(width: u32, height: u32) -> Film {
        Film::new((width, height), Crop { x: 0, y: 0, width, height })
    }

    #[test]
    fn the_estimate_is_the_true_error_of_mild_noise() {
        // Pixels of means 1 to 3 with uniform noise of relative width 0.4 over 16 samples; oracle: the definition of
        // relMSE with the known means, whose expectation is v/(R² + ε) averaged. 4096 pixels, 3 equal channels: s.e.
        // of the estimate is √(2/4096) = 2.2 % (the known ratio); limit 5 s.e., false alarms 6·10⁻⁷.
        let mut random = Pcg(7);
        let mut film = full(64, 64);
        let mut expected = 0.0;
        let epsilon = 0.01 * 4.0;
        for (i, pixel) in film.pixels.iter_mut().enumerate() {
            let mean = 1.0 + 2.0 * i as f32 / 4095.0;
            for s in 0..16 {
                pixel.add(s & 1, [mean * (1.0 + 0.4 * (random.next() - 0.5)); 3], 1.0, 1.0);
            }
            let r2 = f64::from(mean).powi(2);
            expected += r2 * 0.16 / 12.0 / 16.0 / (r2 + epsilon) / 4096.0;
        }
        let estimate = film.error_estimate().expect("both halves have samples");
        assert!((estimate.relmse / expected - 1.0).abs() < 5.0 * 0.0221, "{estimate:?} for {expected}");
        assert!((estimate.relmse_stderr / expected - 0.0221).abs() < 0.003, "{estimate:?}");
        assert!(estimate.interval[0] < estimate.relmse && estimate.relmse < estimate.interval[1]);
        assert!((estimate.epsilon / epsilon - 1.0).abs() < 0.01);
    }

    #[test]
    fn rare_bright_samples_do_not_hide_their_error() {
        // A light found by one sample in 20: v = 19/16 for a mean of 1, true relMSE 19/16/1.01. Two effects are left:
        // the noise of the surroundings (their relative variance is 1.19/24 = 5 %, which raises the estimate by about
        // three times that) and its own spread of some 5 %. A denominator of the pixel's own mean gives less than half.
        let mut random = Pcg(11);
        let mut film = full(64, 64);
        for pixel in &mut film.pixels {
            for s in 0..16 {
                let radiance = if random.next() < 0.05 { 20.0 } else { 0.0 };
                pixel.add(s & 1, [radiance; 3], 1.0, 1.0);
            }
        }
        let ratio = film.error_estimate().expect("both halves have samples").relmse / (19.0 / 16.0 / 1.01);
        assert!((0.9..1.45).contains(&ratio), "{ratio}");
    }

    /// `films` of 32×32 pixels of a ground of 1 with noise of width 0.2, to whose halves `more` adds: how many of the
    /// intervals hold `expected`, and the mean of estimate over expected.
    fn held(films: u64, expected: f64, more: impl Fn(&mut Pcg, usize) -> f32) -> (u64, f64) {
        let (mut hold, mut ratio) = (0, 0.0);
        for seed in 0..films {
            let mut random = Pcg(100 + seed);
            let mut film = full(32, 32);
            for (p, pixel) in film.pixels.iter_mut().enumerate() {
                for half in 0..2 {
                    let value = 1.0 + 0.2 * (random.next() - 0.5) + more(&mut random, p);
                    pixel.add(half, [value; 3], 1.0, 1.0);
                }
            }
            let estimate = film.error_estimate().expect("both halves have samples");
            hold += u64::from(estimate.interval[0] <= expected && expected <= estimate.interval[1]);
            ratio += estimate.relmse / expected / films as f64;
        }
        (hold, ratio)
    }

    /// Lamps in sixteen pixels apart, of which a half sees 100 with a chance of 1/6 to 5/6. Oracle: the halves are
    /// independent, V = q(1 − q)·100²/2 beside the noise's 1/600, R = 1 + 100·q. At least 93 of 100 intervals hold;
    /// a true 95 % has fewer with a chance of 12 %, and seeds are fixed. Taken for fireflies, they would be some
    /// hundred times that.
    #[test]
    fn lamps_that_half_of_the_halves_see_are_no_fireflies() {
        let chance = |p: usize| {
            let lamp = p % 8 == 3 && (p / 32) % 8 == 5;
            if lamp { (p / 8 % 5 + 1) as f64 / 6.0 } else { 0.0 }
        };
        let mean = (0..1024).map(|p| 1.0 + 100.0 * chance(p)).sum::<f64>() / 1024.0;
        let relative = |p: usize| {
            let q = chance(p);
            (q * (1.0 - q) * 5000.0 + 1.0 / 600.0) / ((1.0 + 100.0 * q).powi(2) + 0.01 * mean * mean)
        };
        let expected = (0..1024).map(relative).sum::<f64>() / 1024.0;
        let more = |random: &mut Pcg, p: usize| if f64::from(random.next()) < chance(p) { 100.0 } else { 0.0 };
        let (hold, ratio) = held(100, expected, more);
        assert!(hold >= 93, "{hold} of 100, {ratio}");
    }

    /// Fireflies anywhere: a half has one with a chance of 1 % to 10 %, of 20 to 200. Oracle as above. Own means in the
    /// denominators would say a hundredth.
    #[test]
    fn the_intervals_of_fireflies_hold() {
        for chance in [0.01f64, 0.03, 0.1] {
            let (size, square) = (110.0, (200f64.powi(3) - 20f64.powi(3)) / (3.0 * 180.0));
            let variance = (chance * square - (chance * size).powi(2)) / 2.0 + 1.0 / 600.0;
            let expected = variance / (1.01 * (1.0 + chance * size).powi(2));
            let more = |random: &mut Pcg, _: usize| {
                if f64::from(random.next()) < chance { 20.0 + 180.0 * random.next() } else { 0.0 }
            };
            let (hold, ratio) = held(100, expected, more);
            assert!(hold >= 93, "{chance}: {hold} of 100, {ratio}");
        }
    }

    #[test]
    fn the_mean_and_its_interval_are_those_of_known_noise() {
        // Uniform noise of width 1 around 0.5 over 4 samples: the mean of 4096 pixels has s.e. √(1/12/4/4096); its
        // own relative spread is 1.6 % (√(2/4096)/2), limit 5 of them.
        let mut random = Pcg(3);
        let mut film = full(64, 64);
        for pixel in &mut film.pixels {
            for s in 0..4 {
                pixel.add(s & 1, [random.next(), 0.5, 0.0], 1.0, 1.0);
            }
        }
        let estimate = film.error_estimate().expect("both halves have samples");
        let expected = (1.0f64 / 12.0 / 4.0 / 4096.0).sqrt();
        assert!((estimate.mean_stderr[0] / expected - 1.0).abs() < 0.08, "{estimate:?}");
        let [low, high] = estimate.mean_interval[0];
        assert!(((high - low) / (2.0 * 1.96 * expected) - 1.0).abs() < 0.08, "{estimate:?}");
        assert_eq!((estimate.mean[1], estimate.mean_interval[1]), (0.5, [0.5, 0.5]));
        assert!(estimate.reliable, "{estimate:?}");
    }

    #[test]
    fn a_pixel_that_carries_the_error_makes_it_unreliable() {
        let mut film = full(64, 64);
        for (i, pixel) in film.pixels.iter_mut().enumerate() {
            let wide = if i == 77 { 1.0 } else { 0.01 };
            pixel.add(0, [1.0 + wide; 3], 1.0, 1.0);
            pixel.add(1, [1.0 - wide; 3], 1.0, 1.0);
        }
        let estimate = film.error_estimate().expect("both halves have samples");
        assert!(!estimate.reliable && estimate.largest_share > 0.5, "{estimate:?}");
        assert!(estimate.picture_limit(1.645) > estimate.interval[1], "{estimate:?}");
    }

    #[test]
    fn constant_and_black_films_have_no_error() {
        let mut film = full(3, 2);
        assert_eq!(film.error_estimate(), None);
        for (i, pixel) in film.pixels.iter_mut().enumerate() {
            for s in 0..4 {
                pixel.add(s & 1, [if i < 3 { 2.0 } else { 0.0 }; 3], 1.0, 1.0);
            }
        }
        let estimate = film.error_estimate().expect("both halves have samples");
        assert_eq!((estimate.relmse, estimate.interval), (0.0, [0.0, 0.0]));
        for pixel in &mut film.pixels {
            pixel.sum = Default::default();
        }
        assert_eq!(film.error_estimate().map(|e| e.relmse), Some(0.0));
        // A single pixel is its own reference: halves 1 and 3 make v = 1 of a mean of 2.
        let mut single = full(1, 1);
        single.pixels[0].add(0, [1.0; 3], 1.0, 1.0);
        single.pixels[0].add(1, [3.0; 3], 1.0, 1.0);
        let relmse = single.error_estimate().expect("both halves have samples").relmse;
        assert!((relmse - 1.0 / (4.0 + 0.04)).abs() < 1e-12, "{relmse}");
    }
}
