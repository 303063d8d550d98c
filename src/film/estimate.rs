//! What a film says of its own error: relMSE against the converged image, from nothing but the film.
//!
//! relMSE = mean over pixels and channels of v/(R² + ε). The variance v of a pixel's mean comes from its two halves and is
//! unbiased. The reference R is not there; the mean of the 24 pixels around stands in for it, never the pixel itself: a
//! pixel that caught a rare bright sample has a large v *and* a large mean, and dividing the one by the other hides
//! exactly the error that is largest. ε = 0.01·mean(I)² (DESIGN §9).
//!
//! Measured against the references of the shared scenes (without interior), estimate over true relMSE: 1.03 to 1.38 at 4
//! samples per pixel, 0.96 to 1.05 at 16, 0.95 to 1.02 at 64. With the pixel's own mean it was 0.07 to 0.39, 0.13 to
//! 0.88 and 0.34 to 1.01.
//! Limits: the interval states the spread over pixels, not the bias above; light that no sample has found yet is missing.

use super::{Film, Pixel};

/// ε of relMSE as a fraction of the squared mean of the reference (DESIGN §9).
pub const RELMSE_EPSILON: f64 = 0.01;

/// Two-sided 95 % point of the normal distribution.
const NORMAL_95: f64 = 1.959964;

/// Pixels to each side whose mean stands in for the reference. 1 leaves too much noise at few samples (up to 7 times
/// the true relMSE at 4 samples per pixel), 3 smears edges (0.91 at 64).
const SURROUNDINGS: usize = 2;

/// What a film says of its own error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorEstimate {
    /// Estimated relMSE.
    pub relmse: f64,
    /// Standard error of `relmse`, from its spread over the pixels, which are independent.
    pub relmse_stderr: f64,
    /// Interval that covers `relmse` with 95 %: normal in its logarithm, so that it stays positive.
    pub interval: [f64; 2],
    /// ε = 0.01·mean(I)², the mean over pixels and channels.
    pub epsilon: f64,
    /// Mean over pixels and channels of the standard error of the pixel, in units of radiance.
    pub stderr_mean: f64,
}

impl Film {
    /// Estimates the film's relMSE against the converged image. `None` until both halves of a pixel have samples.
    pub fn error_estimate(&self) -> Option<ErrorEstimate> {
        let mean = self.mean();
        let epsilon = RELMSE_EPSILON * ((mean[0] + mean[1] + mean[2]) / 3.0).powi(2);
        let own = self.sampled_means();
        let width = self.window.width as usize;
        let (mut columns, mut count) = (vec![[0.0; 4]; width], 0u64);
        let (mut sum, mut square, mut stderr) = (0.0, 0.0, 0.0);
        for (y, row) in self.pixels.chunks_exact(width).enumerate() {
            sum_columns(&own, y, &mut columns);
            for (x, pixel) in row.iter().enumerate() {
                let Some(variance) = pixel.variance() else { continue };
                let mean = own[y * width + x];
                let reference = surroundings(&columns, x, mean);
                let mut relative = 0.0;
                for c in 0..3 {
                    // A black pixel of a black image has no error: 0/0 is 0 here.
                    let scale = reference[c] * reference[c] + epsilon;
                    if variance[c] > 0.0 && scale > 0.0 {
                        relative += variance[c] / scale / 3.0;
                    }
                    stderr += variance[c].sqrt() / 3.0;
                }
                count += 1;
                sum += relative;
                square += relative * relative;
            }
        }
        if count == 0 {
            return None;
        }
        let n = count as f64;
        let relmse = sum / n;
        let spread = if count > 1 { ((square - sum * relmse) / (n - 1.0)).max(0.0) } else { 0.0 };
        let relmse_stderr = (spread / n).sqrt();
        let factor = if relmse > 0.0 { (NORMAL_95 * relmse_stderr / relmse).exp() } else { 1.0 };
        let interval = [relmse / factor, relmse * factor];
        Some(ErrorEstimate { relmse, relmse_stderr, interval, epsilon, stderr_mean: stderr / n })
    }

    /// Means of R, G, B and a 1 for every pixel with samples, zeros for the others.
    fn sampled_means(&self) -> Vec<[f64; 4]> {
        let mean = |pixel: &Pixel| {
            let [r, g, b, _] = pixel.mean();
            if pixel.samples() > 0 { [r, g, b, 1.0] } else { [0.0; 4] }
        };
        self.pixels.iter().map(mean).collect()
    }
}

/// Sums `own` over the rows around row `y`, column by column.
fn sum_columns(own: &[[f64; 4]], y: usize, columns: &mut [[f64; 4]]) {
    let width = columns.len();
    let rows = y.saturating_sub(SURROUNDINGS)..(y + SURROUNDINGS + 1).min(own.len() / width);
    columns.fill([0.0; 4]);
    for row in own[rows.start * width..rows.end * width].chunks_exact(width) {
        for (sum, value) in columns.iter_mut().zip(row) {
            *sum = plus(*sum, *value);
        }
    }
}

/// Mean of R, G, B over the sampled pixels around column `x`, without the pixel itself, whose own mean is `own`; that
/// mean where nothing is around.
#[inline(always)]
fn surroundings(columns: &[[f64; 4]], x: usize, own: [f64; 4]) -> [f64; 3] {
    let around = &columns[x.saturating_sub(SURROUNDINGS)..(x + SURROUNDINGS + 1).min(columns.len())];
    let sum = around.iter().fold(own.map(|v| -v), |sum, value| plus(sum, *value));
    let from = if sum[3] > 0.0 { sum } else { own };
    std::array::from_fn(|c| from[c] / from[3])
}

#[inline(always)]
fn plus(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
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
    fn surroundings_stop_at_the_border_and_leave_out_the_pixel() {
        let mut film = full(7, 4);
        for (i, pixel) in film.pixels.iter_mut().enumerate() {
            pixel.add(0, [i as f32, 1.0, 0.0], 1.0, 1.0);
        }
        film.pixels[1] = Default::default();
        let own = film.sampled_means();
        let mut columns = [[0.0; 4]; 7];
        sum_columns(&own, 0, &mut columns);
        // Corner: columns and rows 0 to 2 without itself and without the pixel that has no samples.
        let expected: f64 = [2, 7, 8, 9, 14, 15, 16].iter().map(|&i| f64::from(i)).sum();
        assert_eq!(surroundings(&columns, 0, own[0]), [expected / 7.0, 1.0, 0.0]);
        sum_columns(&own, 1, &mut columns);
        assert_eq!(columns.iter().map(|c| c[3]).collect::<Vec<_>>(), [4.0, 3.0, 4.0, 4.0, 4.0, 4.0, 4.0]);
        // Alone with itself, a pixel is its own reference.
        assert_eq!(surroundings(&[own[9]], 0, own[9]), [9.0, 1.0, 0.0]);
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
