//! The beauty: the unnamed channels `R`, `G`, `B`, `A` of every picture, scene-linear Rec.709 radiance and coverage
//! (premultiplied), as f64 sums in two halves of independent scrambles.
//!
//! Means are exact to the last bits of f64 for any number of samples (HARDCASES M08); negative values, which filters
//! with negative lobes make at edges, are kept. Values that are not finite never enter: the caller counts them and adds
//! zero instead.

use crate::film::pairwise;

/// Names of the channels, in the order of [`Pixel::mean`].
pub const CHANNELS: [&str; 4] = ["R", "G", "B", "A"];

/// Sums of one pixel. Half `h` holds the samples whose index has parity `h`; the halves use independent scrambles of
/// the sampler, so a quarter of the squared difference of their means is an unbiased estimate of the variance of the
/// pixel (HARDCASES §6.2).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Sums of R, G, B radiance and of coverage, both times the filter's signed weight, by half.
    pub sum: [[f64; 4]; 2],
    /// Number of samples by half.
    pub n: [u64; 2],
}

impl Pixel {
    /// Adds one sample to half `half` (0 or 1): radiance and coverage, both weighted by the filter.
    #[inline(always)]
    pub fn add(&mut self, half: usize, rgb: [f32; 3], weight: f32, coverage: f32) {
        debug_assert!(
            rgb.iter().all(|c| c.is_finite()) && weight.is_finite() && coverage.is_finite(),
            "a sample that is not finite reached the film: {rgb:?} × {weight}, coverage {coverage}"
        );
        let weight = f64::from(weight);
        let sum = &mut self.sum[half];
        for (sum, value) in sum.iter_mut().zip([rgb[0], rgb[1], rgb[2], coverage]) {
            *sum += weight * f64::from(value);
        }
        self.n[half] += 1;
    }

    /// The pixel of samples `first`, `first` + 1, …, each weighted R, G, B and coverage, added as a render adds them.
    pub fn of_samples(first: u64, samples: &[[f64; 4]]) -> Self {
        let mut pixel = Pixel::default();
        for half in 0..2 {
            let skipped = (first as usize ^ half) & 1;
            let n = (samples.len() + 1 - skipped) / 2;
            pixel.set_sum(half, pairwise::sum(n, |i| samples[skipped + 2 * i]), n as u64);
        }
        pixel
    }

    /// Makes half `half` the sum of `n` samples: what [`add`](Self::add) adds for each.
    #[inline(always)]
    pub(crate) fn set_sum(&mut self, half: usize, sum: [f64; 4], n: u64) {
        debug_assert!(sum.iter().all(|c| c.is_finite()), "samples that are not finite reached the film: {sum:?}");
        // Not −0, which a weight below 0 makes of black.
        self.sum[half] = sum.map(|value| value + 0.0);
        self.n[half] = n;
    }

    /// Adds the samples of another film's pixel. The order in which parts are merged is the order of the sums: keep it
    /// fixed where bits matter.
    pub fn merge(&mut self, other: &Pixel) {
        for half in 0..2 {
            for c in 0..4 {
                self.sum[half][c] += other.sum[half][c];
            }
            self.n[half] += other.n[half];
        }
    }

    /// Number of samples.
    pub fn samples(&self) -> u64 {
        self.n[0] + self.n[1]
    }

    /// Mean of R, G, B and coverage over all samples; 0 without samples.
    pub fn mean(&self) -> [f64; 4] {
        let n = self.samples().max(1) as f64;
        std::array::from_fn(|c| (self.sum[0][c] + self.sum[1][c]) / n)
    }

    /// Unbiased estimate of the variance of [`mean`](Self::mean) per colour channel, from one difference of halves:
    /// (A − B)²·n₀n₁/n², which is (A − B)²/4 for equal halves. `None` until both halves have samples.
    pub fn variance(&self) -> Option<[f64; 3]> {
        let [n0, n1] = self.n.map(|n| n as f64);
        if n0 == 0.0 || n1 == 0.0 {
            return None;
        }
        let share = (n0 / (n0 + n1)) * (n1 / (n0 + n1));
        Some(std::array::from_fn(|c| (self.sum[0][c] / n0 - self.sum[1][c] / n1).powi(2) * share))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::noise::Pcg;

    #[test]
    fn variance_is_unbiased_for_equal_and_unequal_halves() {
        // Oracle: a uniform variable has variance 1/12, its mean over n samples 1/(12 n). 20000 pixels, one degree of
        // freedom each: s.e. of the mean estimate is √(2/20000) = 1 %; the limit of 5 s.e. alarms falsely
        // 6·10⁻⁷.
        for (n0, n1) in [(4, 4), (7, 1), (5, 4)] {
            let mut random = Pcg(42);
            let trials = 20_000;
            let mut sum = 0.0;
            for _ in 0..trials {
                let mut pixel = Pixel::default();
                for i in 0..n0 + n1 {
                    pixel.add(usize::from(i >= n0), [random.next(); 3], 1.0, 1.0);
                }
                sum += pixel.variance().expect("both halves have samples")[1];
            }
            let expected = 1.0 / 12.0 / f64::from(n0 + n1);
            assert!((sum / f64::from(trials) / expected - 1.0).abs() < 0.05, "{n0} {n1}: {sum}");
        }
        assert_eq!(Pixel { n: [3, 0], ..Default::default() }.variance(), None);
    }
}
