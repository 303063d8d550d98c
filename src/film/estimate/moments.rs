//! What is summed over the pixels for the estimate of the error, and the 95 % intervals that the sums allow. Sums and
//! their order do not depend on threads: each row for itself, then one after the other.
//!
//! **Intervals.** relMSE: two halves of a pixel do not tell a firefly, of which each pixel around may have had
//! one, from a lamp that this pixel alone sees, in one half and not in the other. Relative to the surroundings
//! the first has to be a large error; the second is not. The ends of the interval are those of two sums: the
//! lower one takes the means of such pixels themselves for denominators, where v/m² is at most 1, and errs to the
//! low side if they are fireflies; the upper one takes the surroundings *without* the pixel, of which a square in
//! the denominator errs to the high side. Around each sum the limits of a sum of rare events of unequal weights,
//! by gamma distributions of its mean and variance; the upper one with one event more (Fay & Feuer 1997, Stat.
//! Med. 16:791), as large as the largest of as many pixels again would be in a tail of index k: 2^k of the
//! largest. No constant is fitted to a scene. Mean: Student's t with the degrees of freedom of the sum of the
//! variances (Satterthwaite 1946), the largest of them counted twice. Both are called unreliable where one pixel
//! has more than a tenth of the sum, or the kurtosis over pixels exceeds a tenth of their number (HARDCASES
//! §6.2).

use super::denominator::{Halves, reference, surroundings, surroundings_apart};
use super::error::{ErrorEstimate, NORMAL_95};
use crate::film::layer::beauty::Pixel;

/// Standard error of ln relMSE that covers the choice of the denominators in the limit of an error target, as a share
/// of the logarithm of the quotient of the estimate to the one with the pixels' own means. Fitted on cornell-box,
/// glass-caustics and env-object with the default filter, 200 seeds each at 24×24; held on the other shared scenes.
pub(crate) const DENOMINATOR_SHARE: f64 = 0.1;

/// Share of a sum, and of kurtosis in the number of pixels, above which an interval is called unreliable.
const UNRELIABLE: f64 = 0.1;

/// Mean of |z| of a normal z: √(2/π). Standard errors from one difference are too small by it on average.
const MEAN_ABSOLUTE_NORMAL: f64 = 0.797_884_560_802_865_4;

/// What one half of a pixel has met counts as not met by others that have less than its light over this.
pub(super) const BRIGHT: f64 = 3.0;

/// The variance of a pixel's mean, by channel and relative to what stands in for the converged pixel.
pub(super) struct Relative {
    pub variance: [f64; 3],
    /// To what lies between the pixel and its surroundings.
    pub relative: f64,
    /// To the pixel's own mean.
    own: f64,
    /// For the lower and the upper end of the interval: less and more than `relative` where one half has met what the
    /// other has not.
    pub ends: [f64; 2],
}

/// What a pixel of these halves, at column `x` and of the values `own`, has in relMSE.
#[inline(always)]
pub(super) fn relative_variance(
    halves: &Halves,
    columns: &[[f64; 4]],
    x: usize,
    own: &[f32; 4],
    epsilon: f64,
) -> Relative {
    let Halves { a, b, shares } = *halves;
    let around = surroundings(columns, x);
    let variance: [f64; 3] = std::array::from_fn(|c| (a[c] - b[c]).powi(2) * shares[0] * shares[1]);
    let reference = reference(a, b, around, variance);
    let to = |r: [f64; 3]| (0..3).fold(0.0, |sum, c| sum + quotient(variance[c], r[c], epsilon) / 3.0);
    let relative = to(reference);
    let to_own = to(std::array::from_fn(|c| shares[0] * a[c] + shares[1] * b[c]));
    let mut ends = [relative; 2];
    let light = |rgb: [f64; 3]| rgb[0] + rgb[1] + rgb[2];
    let (more, less) = (light(a).max(light(b)), light(a).min(light(b)));
    if more > BRIGHT * less.max(0.0) {
        ends[0] = to_own.min(relative);
        if let Some(apart) = surroundings_apart(columns, x, own)
            && more > BRIGHT * light(apart).max(0.0)
        {
            ends[1] = to(apart).max(relative);
        }
    }
    Relative { variance, relative, own: to_own, ends }
}

/// v/(r² + ε). A black pixel of a black image has no error: 0/0 is 0 here.
#[inline(always)]
fn quotient(v: f64, r: f64, epsilon: f64) -> f64 {
    if v > 0.0 && r * r + epsilon > 0.0 { v / (r * r + epsilon) } else { 0.0 }
}

/// Sum of values, of their squares, and the largest.
#[derive(Clone, Copy, Default)]
struct Sum {
    sum: f64,
    square: f64,
    largest: f64,
}

impl Sum {
    fn push(&mut self, value: f64) {
        self.sum += value;
        self.square += value * value;
        self.largest = self.largest.max(value);
    }

    fn add(&mut self, other: &Sum) {
        self.sum += other.sum;
        self.square += other.square;
        self.largest = self.largest.max(other.largest);
    }

    /// Variance of the sum of `n` independent values.
    fn variance(&self, n: f64) -> f64 {
        if n > 1.0 { (self.square - self.sum * self.sum / n).max(0.0) * n / (n - 1.0) } else { self.square }
    }

    /// Limit of the sum at `z` standard deviations of a normal distribution: of the gamma distribution of this mean and
    /// `variance`.
    fn limit(&self, variance: f64, z: f64) -> f64 {
        if self.sum > 0.0 { self.sum * gamma_limit(self.sum * self.sum / variance, z) } else { 0.0 }
    }
}

/// Quantile of the gamma distribution of mean 1 and this `shape`, at `z` standard deviations of a normal distribution
/// (Wilson & Hilferty 1931); of shapes of 1 and above within 3 % at the upper 97.5 %, and too low at the lower.
fn gamma_limit(shape: f64, z: f64) -> f64 {
    let ninth = 1.0 / (9.0 * shape);
    (1.0 - ninth + z * ninth.sqrt()).max(0.0).powi(3)
}

/// Sums over the pixels of a row, or over rows.
#[derive(Clone, Copy, Default)]
pub(super) struct Moments {
    /// Pixels with both halves.
    pub count: f64,
    /// Powers 1 to 4 of a pixel's relative variance.
    powers: [f64; 4],
    /// Largest relative variance of a pixel.
    largest: f64,
    /// Sums for the lower and the upper end.
    ends: [Sum; 2],
    /// Relative variances with the pixels' own means in the denominator.
    own: f64,
    /// Standard errors, mean over channels.
    stderr: f64,
    /// Variances per channel.
    variance: [Sum; 3],
}

impl Moments {
    /// Sums of the pixels of one row, of means `own`; `columns` holds the means summed over the rows around. What
    /// enters the upper end is appended to `values`.
    pub fn of_row(row: &[Pixel], own: &[[f32; 4]], columns: &[[f64; 4]], epsilon: f64, values: &mut Vec<f32>) -> Self {
        let mut sums = Moments::default();
        for (x, pixel) in row.iter().enumerate() {
            let Some(halves) = Halves::of(pixel) else { continue };
            let pixel = relative_variance(&halves, columns, x, &own[x], epsilon);
            for (sum, v) in sums.variance.iter_mut().zip(pixel.variance) {
                sum.push(v);
                sums.stderr += v.sqrt() / (3.0 * MEAN_ABSOLUTE_NORMAL);
            }
            let (relative, square) = (pixel.relative, pixel.relative * pixel.relative);
            for (sum, power) in sums.powers.iter_mut().zip([relative, square, square * relative, square * square]) {
                *sum += power;
            }
            sums.ends.iter_mut().zip(pixel.ends).for_each(|(sum, value)| sum.push(value));
            values.push(pixel.ends[1] as f32);
            sums.count += 1.0;
            sums.largest = sums.largest.max(relative);
            sums.own += pixel.own;
        }
        sums
    }

    /// Adds the sums of other pixels.
    pub fn add(&mut self, other: &Moments) {
        self.count += other.count;
        self.largest = self.largest.max(other.largest);
        self.own += other.own;
        self.stderr += other.stderr;
        self.powers.iter_mut().zip(other.powers).for_each(|(sum, power)| *sum += power);
        self.ends.iter_mut().zip(&other.ends).for_each(|(sum, other)| sum.add(other));
        self.variance.iter_mut().zip(&other.variance).for_each(|(sum, other)| sum.add(other));
    }

    /// The estimate of a picture with this `mean`; `k` is the index of the tail of what enters the upper end.
    pub fn estimate(&self, mean: [f64; 4], epsilon: f64, k: f64) -> ErrorEstimate {
        let n = self.count;
        let [low, high] = &self.ends;
        let sum = Sum { sum: self.powers[0], square: self.powers[1], largest: self.largest };
        let relmse = sum.sum / n;
        let own = self.own / n;
        let positive = relmse > 0.0;
        let denominator_error = if positive && own > 0.0 { DENOMINATOR_SHARE * (relmse / own).ln().abs() } else { 0.0 };
        let largest_share = if positive { sum.largest / sum.sum } else { 0.0 };
        let missed = high.largest * k.max(0.0).exp2();
        let more = Sum { sum: high.sum + missed, ..*high };
        let ends =
            [low.limit(low.variance(n), -NORMAL_95) / n, more.limit(high.variance(n) + missed * missed, NORMAL_95) / n];
        let mean = [mean[0], mean[1], mean[2]];
        let mean_stderr = self.variance.map(|v| v.sum.sqrt() / n);
        ErrorEstimate {
            relmse,
            relmse_stderr: sum.variance(n).sqrt() / n,
            denominator_error,
            interval: [ends[0].min(relmse), ends[1].max(relmse)],
            epsilon,
            stderr_mean: self.stderr / n,
            mean,
            mean_stderr,
            mean_interval: std::array::from_fn(|c| {
                // As if one more pixel like the largest had been missed: rare events come in small numbers.
                let widened = (self.variance[c].sum + self.variance[c].largest).sqrt() / n;
                let half = student_95(self.degrees(c)) * widened;
                [mean[c] - half, mean[c] + half]
            }),
            largest_share,
            reliable: n > 1.0 && largest_share <= UNRELIABLE && self.kurtosis_share() <= UNRELIABLE,
        }
    }

    /// Kurtosis over the pixels as a share of their number.
    fn kurtosis_share(&self) -> f64 {
        let [m1, m2, m3, m4] = self.powers.map(|sum| sum / self.count);
        let spread = (m2 - m1 * m1).max(0.0);
        let fourth = m4 - 4.0 * m1 * m3 + 6.0 * m1 * m1 * m2 - 3.0 * m1.powi(4);
        if spread > 0.0 { fourth / (spread * spread) / self.count } else { 0.0 }
    }

    /// Degrees of freedom of the sum of the variances of channel `c`: 2·(Σv)²/Var(Σv), the variance from the spread
    /// over pixels.
    fn degrees(&self, c: usize) -> f64 {
        let Sum { sum, square, .. } = self.variance[c];
        let spread = square - sum * sum / self.count;
        if spread > 0.0 { 2.0 * sum * sum / spread } else { f64::INFINITY }
    }
}

/// Two-sided 95 % point of Student's t with `degrees` > 0, at least 3 taken: Fisher's expansion to the third order,
/// within 1 % of the exact value.
fn student_95(degrees: f64) -> f64 {
    let (z, nu) = (NORMAL_95, degrees.max(3.0));
    let z2 = z * z;
    let first = z * (z2 + 1.0) / 4.0;
    let second = z * (5.0 * z2 * z2 + 16.0 * z2 + 3.0) / 96.0;
    let third = z * (3.0 * z2.powi(3) + 19.0 * z2 * z2 + 17.0 * z2 - 15.0) / 384.0;
    z + first / nu + second / (nu * nu) + third / nu.powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: quantiles of χ² with 2, 4, 20 and 200 degrees of freedom over those, from tables.
    #[test]
    fn limits_of_gamma_distributions_are_those_of_the_tables() {
        for (shape, low, high) in
            [(1.0, 0.0253, 3.689), (2.0, 0.1211, 2.786), (10.0, 0.4795, 1.7085), (100.0, 0.8136, 1.2053)]
        {
            let [from, to] = [-NORMAL_95, NORMAL_95].map(|z| gamma_limit(shape, z));
            assert!((to / high - 1.0).abs() < 0.03, "{shape}: {to}");
            assert!(from < 1.02 * low && from > low - 0.02, "{shape}: {from}");
        }
    }

    #[test]
    fn points_of_student_s_t_are_those_of_the_tables() {
        for (degrees, t) in [(3.0, 3.182), (5.0, 2.571), (10.0, 2.228), (30.0, 2.042), (f64::INFINITY, 1.960)] {
            assert!((student_95(degrees) / t - 1.0).abs() < 0.01, "{degrees}: {}", student_95(degrees));
        }
    }
}
