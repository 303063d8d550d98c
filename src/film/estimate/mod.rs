//! What a film says of its own error, from nothing but the film: relMSE against the converged picture, and the standard
//! error of the picture's mean, each with a 95 % interval.
//!
//! **Variance.** The variance v of a pixel's mean comes from its two halves and is unbiased for Sobol' points as for
//! independent samples, because the halves are independent scrambles (`tests/suite/estimate.rs` shows what the formula
//! for independent samples makes of Sobol' points). One degree of freedom a pixel; pictures have many pixels.
//!
//! **Two halves, not more.** Measured at equal samples on the shared scenes (24×24): four replicates instead of two raise
//! relMSE by 2 to 11 % at 128 samples per pixel, for Sobol' points know nothing of each other across replicates, and
//! double the film. The spread of the estimate falls by 10 to 35 % only, because few pixels hold most of the variance, and
//! its bias, which is in the denominators, stays.
//!
//! **relMSE** = mean over pixels and channels of v/(R² + ε), ε = 0.01·mean(I)² (DESIGN §9). The reference R is not there. The
//! pixel's own mean is no substitute: one that caught a rare bright sample has a large v *and* a large mean, and dividing
//! the one by the other hides exactly the error that is largest (0.1 to 0.9 of the true relMSE). The pixels around are
//! none where lights and edges are: 0.5 to 200 times. R is therefore taken as Lee's filter (1980) takes it, between the mean p
//! of the 5×5 pixels around and the pixel's own value h, here the harmonic mean of its halves, which a bright sample in
//! one of them does not raise:
//!
//!   R = p + w·(h − p),  w = max(0, 1 − Σv/Σ(h − p)²), sums over the channels.
//!
//! Where the difference to the surroundings is noise, R is the surroundings; at an edge that stands out of the noise it is
//! the pixel. The error of this is of second order in the noise, so that it vanishes with the samples.
//!
//! **Intervals.** relMSE: normal in its logarithm, with the spread over pixels, which are independent, and with
//! `DENOMINATOR_SHARE` of the logarithm by which the choice of the denominators matters. Mean: Student's t with
//! the degrees of freedom of the sum of the variances (Satterthwaite), the largest of them counted twice. Both are called unreliable where one pixel has more
//! than a tenth of the sum, or the kurtosis over pixels exceeds a tenth of their number (HARDCASES §6.2).
//!
//! Limits: light that no sample has found yet is missing from picture and estimate alike. Bias has no part in it.

use rayon::prelude::*;

use super::{Film, Pixel};

/// ε of relMSE as a fraction of the squared mean of the reference (DESIGN §9).
pub const RELMSE_EPSILON: f64 = 0.01;

/// Two-sided 95 % point of the normal distribution.
const NORMAL_95: f64 = 1.959964;

/// Pixels to each side whose mean stands in for the reference.
const SURROUNDINGS: usize = 2;

/// Standard error of ln relMSE that stands for the choice of the denominators, as a share of the logarithm of the
/// quotient of the estimate to the one with the pixels' own means. Measured on the shared scenes: ln(true/estimate) is
/// −0.1 to 0.4 of it; at 0.3 the intervals cover what they say (`tests/suite/estimate.rs`).
const DENOMINATOR_SHARE: f64 = 0.3;

/// Share of a sum, and of kurtosis in the number of pixels, above which an interval is called unreliable.
const UNRELIABLE: f64 = 0.1;

/// Mean of |z| of a normal z: √(2/π). Standard errors from one difference are too small by it on average.
const MEAN_ABSOLUTE_NORMAL: f64 = 0.797_884_560_802_865_4;

/// What a film says of its own error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorEstimate {
    /// Estimated relMSE.
    pub relmse: f64,
    /// Standard error of `relmse` from its spread over the pixels, which are independent.
    pub relmse_stderr: f64,
    /// Standard error of ln `relmse` for the choice of the denominators.
    pub denominator_error: f64,
    /// Interval that covers `relmse` with 95 %: normal in its logarithm, so that it stays positive.
    pub interval: [f64; 2],
    /// ε = 0.01·mean(I)², the mean over pixels and channels.
    pub epsilon: f64,
    /// Mean over pixels and channels of the standard error of the pixel, in units of radiance.
    pub stderr_mean: f64,
    /// Mean of the picture per channel, in units of radiance.
    pub mean: [f64; 3],
    /// Its standard error.
    pub mean_stderr: [f64; 3],
    /// Interval that covers the mean of the converged picture with 95 %.
    pub mean_interval: [[f64; 2]; 3],
    /// Share of the pixel with the largest in `relmse`.
    pub largest_share: f64,
    /// Whether the spread over pixels is known well enough for the intervals to keep their word: no pixel carries a tenth,
    /// and kurtosis is below a tenth of the number of pixels.
    pub reliable: bool,
}

/// Sums over the pixels of a row, or over rows.
#[derive(Clone, Copy, Default)]
struct Sums {
    /// Pixels with both halves.
    count: f64,
    /// Powers 1 to 4 of a pixel's relative variance.
    powers: [f64; 4],
    /// Largest relative variance of a pixel.
    largest: f64,
    /// Relative variances with the pixels' own means in the denominator.
    own: f64,
    /// Standard errors, mean over channels.
    stderr: f64,
    /// Variances per channel, and their squares.
    variance: [f64; 3],
    variance_square: [f64; 3],
    /// The largest variance.
    variance_largest: [f64; 3],
}

impl Sums {
    fn add(&mut self, other: &Sums) {
        self.count += other.count;
        self.largest = self.largest.max(other.largest);
        self.own += other.own;
        self.stderr += other.stderr;
        for (sum, value) in self.powers.iter_mut().zip(other.powers) {
            *sum += value;
        }
        for c in 0..3 {
            self.variance[c] += other.variance[c];
            self.variance_square[c] += other.variance_square[c];
            self.variance_largest[c] = self.variance_largest[c].max(other.variance_largest[c]);
        }
    }
}

impl Film {
    /// Estimates the film's error against the converged picture, on the current pool of threads; the result does not
    /// depend on their number. `None` until both halves of a pixel have samples.
    pub fn error_estimate(&self) -> Option<ErrorEstimate> {
        let width = (self.window.width as usize).max(1);
        let own: Vec<[f32; 4]> = self.pixels.par_iter().map(sampled_mean).collect();
        let mean = self.mean();
        let epsilon = RELMSE_EPSILON * ((mean[0] + mean[1] + mean[2]) / 3.0).powi(2);
        // Rows are summed each by itself, then in order: the same bits for any number of threads.
        let rows = self.pixels.par_chunks_exact(width).enumerate().map_init(
            || vec![[0.0; 4]; width],
            |columns, (y, row)| {
                sum_columns(&own, y, columns);
                row_sums(row, columns, epsilon)
            },
        );
        let mut sums = Sums::default();
        for row in rows.collect::<Vec<_>>() {
            sums.add(&row);
        }
        (sums.count > 0.0).then(|| sums.estimate(mean, epsilon))
    }
}

/// Means of R, G, B and a 1 for a pixel with samples, zeros for others.
fn sampled_mean(pixel: &Pixel) -> [f32; 4] {
    let [r, g, b, _] = pixel.mean();
    if pixel.samples() > 0 { [r as f32, g as f32, b as f32, 1.0] } else { [0.0; 4] }
}

/// Sums `own` over the rows around row `y`, column by column.
fn sum_columns(own: &[[f32; 4]], y: usize, columns: &mut [[f64; 4]]) {
    let width = columns.len();
    let rows = y.saturating_sub(SURROUNDINGS)..(y + SURROUNDINGS + 1).min(own.len() / width);
    columns.fill([0.0; 4]);
    for row in own[rows.start * width..rows.end * width].chunks_exact(width) {
        for (sum, value) in columns.iter_mut().zip(row) {
            *sum = plus(*sum, value.map(f64::from));
        }
    }
}

/// Sums of the pixels of one row; `columns` holds the means summed over the rows around.
fn row_sums(row: &[Pixel], columns: &[[f64; 4]], epsilon: f64) -> Sums {
    let mut sums = Sums::default();
    for (x, pixel) in row.iter().enumerate() {
        let Some(Halves { a, b, shares }) = Halves::of(pixel) else { continue };
        let variance: [f64; 3] = std::array::from_fn(|c| (a[c] - b[c]).powi(2) * shares[0] * shares[1]);
        let reference = reference(a, b, surroundings(columns, x), variance);
        let (mut relative, mut own, mut stderr) = (0.0, 0.0, 0.0);
        for c in 0..3 {
            let v = variance[c];
            let mean = shares[0] * a[c] + shares[1] * b[c];
            // A black pixel of a black image has no error: 0/0 is 0 here.
            let quotient = |r: f64| if v > 0.0 && r * r + epsilon > 0.0 { v / (r * r + epsilon) } else { 0.0 };
            relative += quotient(reference[c]) / 3.0;
            own += quotient(mean) / 3.0;
            stderr += v.sqrt();
            sums.variance[c] += v;
            sums.variance_square[c] += v * v;
            sums.variance_largest[c] = sums.variance_largest[c].max(v);
        }
        let square = relative * relative;
        for (sum, power) in sums.powers.iter_mut().zip([relative, square, square * relative, square * square]) {
            *sum += power;
        }
        sums.count += 1.0;
        sums.largest = sums.largest.max(relative);
        sums.own += own;
        sums.stderr += stderr / (3.0 * MEAN_ABSOLUTE_NORMAL);
    }
    sums
}

/// The means of a pixel's halves, and what each contributes to the pixel.
struct Halves {
    a: [f64; 3],
    b: [f64; 3],
    /// Shares of the halves in the samples.
    shares: [f64; 2],
}

impl Halves {
    /// `None` until both halves have samples.
    #[inline(always)]
    fn of(pixel: &Pixel) -> Option<Self> {
        let [n0, n1] = pixel.n.map(|n| n as f64);
        if n0 == 0.0 || n1 == 0.0 {
            return None;
        }
        let (inverse, total) = ([1.0 / n0, 1.0 / n1], 1.0 / (n0 + n1));
        let mean = |half: usize| std::array::from_fn(|c| pixel.sum[half][c] * inverse[half]);
        Some(Halves { a: mean(0), b: mean(1), shares: [n0 * total, n1 * total] })
    }
}

/// Mean of R, G, B over the sampled pixels around column `x` and in it.
#[inline(always)]
fn surroundings(columns: &[[f64; 4]], x: usize) -> [f64; 3] {
    let around = &columns[x.saturating_sub(SURROUNDINGS)..(x + SURROUNDINGS + 1).min(columns.len())];
    let sum = around.iter().fold([0.0; 4], |sum, value| plus(sum, *value));
    let inverse = 1.0 / sum[3];
    std::array::from_fn(|c| sum[c] * inverse)
}

/// What stands in for the converged pixel of halves `a` and `b`: between the surroundings and the harmonic mean of the
/// halves, by Lee's weight.
#[inline(always)]
fn reference(a: [f64; 3], b: [f64; 3], around: [f64; 3], variance: [f64; 3]) -> [f64; 3] {
    let own: [f64; 3] = std::array::from_fn(|c| {
        let product = a[c] * b[c];
        if product > 0.0 { 2.0 * product / (a[c] + b[c]) } else { 0.0 }
    });
    let (mut noise, mut difference) = (0.0, 0.0);
    for c in 0..3 {
        noise += variance[c];
        difference += (own[c] - around[c]).powi(2);
    }
    let weight = if difference > noise { 1.0 - noise / difference } else { 0.0 };
    std::array::from_fn(|c| around[c] + weight * (own[c] - around[c]))
}

#[inline(always)]
fn plus(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}

impl Sums {
    /// The estimate of a picture with this `mean`.
    fn estimate(&self, mean: [f64; 4], epsilon: f64) -> ErrorEstimate {
        let n = self.count;
        let [relmse, m2, m3, m4] = self.powers.map(|sum| sum / n);
        // Central moments over the pixels.
        let spread = (m2 - relmse * relmse).max(0.0);
        let fourth = m4 - 4.0 * relmse * m3 + 6.0 * relmse * relmse * m2 - 3.0 * relmse.powi(4);
        let relmse_stderr = if n > 1.0 { (spread / (n - 1.0)).sqrt() } else { relmse };
        let positive = relmse > 0.0;
        let kurtosis_share = if spread > 0.0 { fourth / (spread * spread) / n } else { 0.0 };
        let largest_share = if positive { self.largest / self.powers[0] } else { 0.0 };
        let own = self.own / n;
        let denominator_error = if positive && own > 0.0 { DENOMINATOR_SHARE * (relmse / own).ln().abs() } else { 0.0 };
        let log_error = if positive { (relmse_stderr / relmse).hypot(denominator_error) } else { 0.0 };
        let factor = (NORMAL_95 * log_error).exp();
        let mean = [mean[0], mean[1], mean[2]];
        let mean_stderr = self.variance.map(|sum| sum.sqrt() / n);
        ErrorEstimate {
            relmse,
            relmse_stderr,
            denominator_error,
            interval: [relmse / factor, relmse * factor],
            epsilon,
            stderr_mean: self.stderr / n,
            mean,
            mean_stderr,
            mean_interval: std::array::from_fn(|c| {
                // As if one more pixel like the largest had been missed: rare events come in small numbers.
                let widened = (self.variance[c] + self.variance_largest[c]).sqrt() / n;
                let half = student_95(self.degrees(c)) * widened;
                [mean[c] - half, mean[c] + half]
            }),
            largest_share,
            reliable: n > 1.0 && largest_share <= UNRELIABLE && kurtosis_share <= UNRELIABLE,
        }
    }

    /// Degrees of freedom of the sum of the variances of channel `c`: 2·(Σv)²/Var(Σv), the variance from the spread over
    /// pixels.
    fn degrees(&self, c: usize) -> f64 {
        let (sum, square) = (self.variance[c], self.variance_square[c]);
        let spread = square - sum * sum / self.count;
        if spread > 0.0 { 2.0 * sum * sum / spread } else { f64::INFINITY }
    }
}

impl ErrorEstimate {
    /// 95 % interval of relMSE from the spread over pixels alone, the denominators taken as they are.
    pub fn spread_interval(&self) -> [f64; 2] {
        if self.relmse > 0.0 {
            let factor = (NORMAL_95 * self.relmse_stderr / self.relmse).exp();
            [self.relmse / factor, self.relmse * factor]
        } else {
            [0.0; 2]
        }
    }

    /// Limit that the relMSE of *this* picture stays below with the confidence of `quantiles` standard deviations. Wider
    /// than the interval of the expected relMSE: the picture's own error scatters as the estimate does, and
    /// independently of it. The pixel with the largest share is counted twice, as if one more like it had been missed.
    pub fn picture_limit(&self, quantiles: f64) -> f64 {
        if self.relmse > 0.0 {
            let scatter = std::f64::consts::SQRT_2 * self.relmse_stderr / self.relmse;
            let missed = 1.0 + self.largest_share;
            self.relmse * missed * (quantiles * scatter.hypot(self.denominator_error)).exp()
        } else {
            self.relmse
        }
    }
}

/// Two-sided 95 % point of Student's t with `degrees` > 0, at least 3 taken: Fisher's expansion to the third order, within
/// 1 % of the exact value.
fn student_95(degrees: f64) -> f64 {
    let (z, nu) = (NORMAL_95, degrees.max(3.0));
    let z2 = z * z;
    let first = z * (z2 + 1.0) / 4.0;
    let second = z * (5.0 * z2 * z2 + 16.0 * z2 + 3.0) / 96.0;
    let third = z * (3.0 * z2.powi(3) + 19.0 * z2 * z2 + 17.0 * z2 - 15.0) / 384.0;
    z + first / nu + second / (nu * nu) + third / nu.powi(3)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::render::Crop;

    fn full(width: u32, height: u32) -> Film {
        Film::new((width, height), Crop { x: 0, y: 0, width, height })
    }

    /// PCG-XSH-RR 64/32 with the increment of the reference's default stream; test noise only.
    pub(in crate::film) struct Pcg(pub u64);

    impl Pcg {
        pub fn next(&mut self) -> f32 {
            let old = self.0;
            self.0 = old.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let bits = (((old >> 18) ^ old) >> 27) as u32;
            (bits.rotate_right((old >> 59) as u32) >> 8) as f32 / (1 << 24) as f32
        }
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

    #[test]
    fn surroundings_stop_at_the_border_and_at_pixels_without_samples() {
        let mut film = full(7, 4);
        for (i, pixel) in film.pixels.iter_mut().enumerate() {
            pixel.add(0, [i as f32, 1.0, 0.0], 1.0, 1.0);
        }
        film.pixels[1] = Default::default();
        let own: Vec<[f32; 4]> = film.pixels.iter().map(sampled_mean).collect();
        let mut columns = [[0.0; 4]; 7];
        sum_columns(&own, 0, &mut columns);
        // Corner: columns and rows 0 to 2 without the pixel that has no samples.
        let expected: f64 = [0, 2, 7, 8, 9, 14, 15, 16].iter().map(|&i| f64::from(i)).sum();
        assert_eq!(surroundings(&columns, 0), [expected * 0.125, 1.0, 0.0]);
        sum_columns(&own, 1, &mut columns);
        assert_eq!(columns.iter().map(|c| c[3]).collect::<Vec<_>>(), [4.0, 3.0, 4.0, 4.0, 4.0, 4.0, 4.0]);
    }

    #[test]
    fn the_reference_is_the_pixel_at_an_edge_and_the_surroundings_under_a_bright_sample() {
        let of = |a: f64, b: f64| {
            let variance = f64::powi(a - b, 2) / 4.0;
            reference([a; 3], [b; 3], [1.0; 3], [variance; 3])[0]
        };
        // An edge: 10 ± 0.1 among ones. A bright sample: one half is as dark as the surroundings.
        assert!((of(10.1, 9.9) - 10.0).abs() < 0.02, "{}", of(10.1, 9.9));
        assert_eq!(of(1000.0, 1.0), 1.0);
        assert_eq!(of(0.0, 0.0), 0.0);
    }

    #[test]
    fn points_of_student_s_t_are_those_of_the_tables() {
        for (degrees, t) in [(3.0, 3.182), (5.0, 2.571), (10.0, 2.228), (30.0, 2.042), (f64::INFINITY, 1.960)] {
            assert!((student_95(degrees) / t - 1.0).abs() < 0.01, "{degrees}: {}", student_95(degrees));
        }
    }

    #[test]
    fn the_mean_and_its_interval_are_those_of_known_noise() {
        // Uniform noise of width 1 around 0.5 over 4 samples: the mean of 4096 pixels has s.e. √(1/12/4/4096); its own
        // relative spread is 1.6 % (√(2/4096)/2), limit 5 of them.
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
