//! The error of a filter, measured by the film alone. A half A of the samples is filtered to D(A); the other half B
//! knows nothing of it, so E|D(A) − B|² = E|D(A) − T|² + Var B with T the true picture, and Var B is estimated from the
//! halves as elsewhere. What is left is the filter's whole error at half the samples, its bias and the noise that it
//! leaves, without a reference. Either half is filtered, and the mean of both is taken. Unbiased as far as the filter
//! sees nothing of B; each value may come out below 0.
//!
//! relMSE is relative to D(A), of which the judge knows nothing either. What stands in for T in the estimate of the
//! unfiltered picture (`denominator`) knows of B, and is small where B is dark by chance: it would make the error of a
//! good filter many times too large.

use serde::Serialize;

use super::denominator::{Halves, RELMSE_EPSILON};
use crate::error::Result;
use crate::film::store::Film;

/// What filtering half of the samples brings, mean over pixels and channels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FilteredError {
    /// Samples per pixel of a half, mean.
    pub spp: f64,
    /// Measured relMSE of a half that was filtered, relative to the filtered half.
    pub relmse: f64,
    /// Its standard error from the spread over pixels.
    pub relmse_stderr: f64,
    /// Estimated relMSE of a half as it is, relative to the same.
    pub unfiltered_relmse: f64,
    /// Measured mean squared error of a half that was filtered, radiance².
    pub mse: f64,
    /// Its standard error.
    pub mse_stderr: f64,
    /// Estimated mean squared error of a half as it is.
    pub unfiltered_mse: f64,
}

/// Mean and standard error of independent values.
#[derive(Clone, Copy, Default)]
struct Sum {
    n: f64,
    sum: f64,
    square: f64,
}

impl Sum {
    fn add(&mut self, value: f64) {
        *self = Sum { n: self.n + 1.0, sum: self.sum + value, square: self.square + value * value };
    }

    fn mean(&self) -> f64 {
        self.sum / self.n
    }

    fn stderr(&self) -> f64 {
        let variance = (self.square / self.n - self.mean().powi(2)).max(0.0);
        (variance / (self.n - 1.0).max(1.0)).sqrt()
    }
}

impl Film {
    /// Measures the error of `filter`, which gets the number of a half and gives its picture, filtered: R, G, B of the
    /// window. `None` until every pixel has samples in both halves.
    ///
    /// # Errors
    /// Those of `filter`.
    pub fn filtered_error(
        &self,
        mut filter: impl FnMut(usize) -> Result<Vec<[f32; 3]>>,
    ) -> Result<Option<FilteredError>> {
        if self.pixels.is_empty() || self.pixels.iter().any(|pixel| pixel.n.contains(&0)) {
            return Ok(None);
        }
        let filtered = [filter(0)?, filter(1)?];
        let mean = self.mean();
        let epsilon = RELMSE_EPSILON * ((mean[0] + mean[1] + mean[2]) / 3.0).powi(2);
        let (mut sums, mut samples) = ([Sum::default(); 4], 0.0);
        for (p, pixel) in self.pixels.iter().enumerate() {
            let Some(Halves { a, b, shares }) = Halves::of(pixel) else { continue };
            let mut values = [0.0; 4];
            for (half, judge) in [b, a].into_iter().enumerate() {
                for c in 0..3 {
                    let made = f64::from(filtered[half][p][c]);
                    // E(A − B)² = σ²·(1/n₀ + 1/n₁), of which either half has its σ²/n.
                    let square = (a[c] - b[c]).powi(2);
                    let error = (made - judge[c]).powi(2) - square * shares[half];
                    let before = square * shares[1 - half];
                    let size = made * made + epsilon;
                    let relative = |error: f64| if size > 0.0 { error / size } else { 0.0 };
                    for (sum, value) in values.iter_mut().zip([relative(error), relative(before), error, before]) {
                        *sum += value / 6.0;
                    }
                }
            }
            sums.iter_mut().zip(values).for_each(|(sum, value)| sum.add(value));
            samples += pixel.samples() as f64 / 2.0;
        }
        let [relative, unfiltered, error, before] = sums;
        Ok(Some(FilteredError {
            spp: samples / relative.n,
            relmse: relative.mean(),
            relmse_stderr: relative.stderr(),
            unfiltered_relmse: unfiltered.mean(),
            mse: error.mean(),
            mse_stderr: error.stderr(),
            unfiltered_mse: before.mean(),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::layer::beauty::Pixel;
    use crate::film::noise::Pcg;
    use crate::plan::options::Crop;

    const SIDE: usize = 96;

    /// A picture that is `bright` in every third column and `dark` elsewhere, with uniform noise of width 1 in
    /// `samples` of each half.
    fn stripes(seed: u64, [dark, bright]: [f32; 2], samples: [usize; 2]) -> Film {
        let size = SIDE as u32;
        let mut film = Film::new((size, size), Crop { x: 0, y: 0, width: size, height: size });
        let mut random = Pcg(seed);
        for (p, pixel) in film.pixels.iter_mut().enumerate() {
            let value = if (p % SIDE).is_multiple_of(3) { bright } else { dark };
            for half in 0..2 {
                (0..samples[half]).for_each(|_| pixel.add(half, [value + random.next() - 0.5; 3], 1.0, 1.0));
            }
        }
        film
    }

    /// Means over the 3×3 pixels around, on a torus.
    fn box_blur(film: &Film, half: usize) -> Vec<[f32; 3]> {
        let mean = |pixel: &Pixel, c: usize| pixel.sum[half][c] / pixel.n[half] as f64;
        let around = |p: usize, c: usize| {
            let (x, y) = (p % SIDE, p / SIDE);
            let near = |v: usize, d: usize| (v + SIDE + d - 1) % SIDE;
            let cells = (0..9).map(|i| &film.pixels[near(y, i / 3) * SIDE + near(x, i % 3)]);
            (cells.map(|pixel| mean(pixel, c)).sum::<f64>() / 9.0) as f32
        };
        (0..SIDE * SIDE).map(|p| [0, 1, 2].map(|c| around(p, c))).collect()
    }

    /// Closed form: a box blur of three columns makes all of stripes their mean m, and leaves a ninth of the noise, so
    /// its error is (2(m − dark)² + (bright − m)²)/3 + Var A/9; uniform noise has 1/12 a sample. The limit of 4.9 of
    /// the measured standard errors alarms falsely 10⁻⁶ each, and is a twentieth of the error at most.
    #[test]
    fn the_error_of_a_box_blur_is_its_bias_and_the_noise_that_it_leaves() {
        for (seed, [dark, bright], samples) in
            [(1, [1.0f32, 1.0], [4, 4]), (2, [1.0, 2.0], [4, 4]), (3, [1.0, 1.5], [6, 2]), (4, [0.5, 0.5], [1, 1])]
        {
            let film = stripes(seed, [dark, bright], samples);
            let error = film.filtered_error(|half| Ok(box_blur(&film, half))).expect("no filter fails");
            let error = error.expect("both halves have samples");
            let m = f64::from(2.0 * dark + bright) / 3.0;
            let bias = (2.0 * (m - f64::from(dark)).powi(2) + (f64::from(bright) - m).powi(2)) / 3.0;
            let noise = samples.map(|n| 1.0 / 12.0 / n as f64);
            let unfiltered = (noise[0] + noise[1]) / 2.0;
            let expected = bias + unfiltered / 9.0;
            let off = error.mse - expected;
            assert!(off.abs() < 4.9 * error.mse_stderr, "{bias} and {noise:?}: {error:?}, expected {expected}");
            assert!(error.mse_stderr < 0.1 * expected.max(unfiltered), "sees too little: {error:?}");
            // One degree of freedom a pixel, three equal channels: √2/96 of it.
            assert!((error.unfiltered_mse / unfiltered - 1.0).abs() < 4.9 * 0.0148, "{error:?}, expected {unfiltered}");
            assert_eq!(error.spp, (samples[0] + samples[1]) as f64 / 2.0);
        }
    }

    /// A filter that does nothing has the error of its half: relMSE as well as MSE, within 4.9 standard errors.
    #[test]
    fn no_filter_has_the_error_of_no_filter() {
        let film = stripes(5, [1.0, 3.0], [4, 4]);
        let half =
            |half: usize| film.pixels.iter().map(move |pixel| [0, 1, 2].map(|c| (pixel.sum[half][c] / 4.0) as f32));
        let error = film.filtered_error(|of| Ok(half(of).collect())).expect("no filter fails").expect("has samples");
        assert!((error.mse - error.unfiltered_mse).abs() < 1e-6, "{error:?}");
        assert!((error.relmse - error.unfiltered_relmse).abs() < 1e-6, "{error:?}");
        // What the film estimates of all its samples is half of that.
        let variance: f64 = film.pixels.iter().filter_map(Pixel::variance).flatten().sum();
        let whole = variance / (3 * SIDE * SIDE) as f64;
        assert!((error.unfiltered_mse / whole - 2.0).abs() < 1e-9, "{error:?}, {whole}");
    }

    /// relMSE is relative to the filtered picture. Oracle: one that is 2 everywhere, beside which every error is
    /// divided by 4 + ε.
    #[test]
    fn relative_errors_are_relative_to_the_filtered_picture() {
        let film = stripes(7, [1.0, 3.0], [4, 4]);
        let error = film.filtered_error(|_| Ok(vec![[2.0; 3]; SIDE * SIDE])).expect("no filter fails");
        let error = error.expect("both halves have samples");
        let mean = film.mean();
        let size = 4.0 + RELMSE_EPSILON * ((mean[0] + mean[1] + mean[2]) / 3.0).powi(2);
        for (relative, absolute) in [
            (error.relmse, error.mse),
            (error.relmse_stderr, error.mse_stderr),
            (error.unfiltered_relmse, error.unfiltered_mse),
        ] {
            assert!((relative * size / absolute - 1.0).abs() < 1e-9, "{error:?}");
        }
    }

    #[test]
    fn a_pixel_without_both_halves_is_no_measure() {
        let mut film = stripes(6, [1.0, 1.0], [1, 1]);
        film.pixels[7].n[1] = 0;
        assert_eq!(film.filtered_error(|_| unreachable!("nothing to filter")).expect("no filter fails"), None);
    }
}
