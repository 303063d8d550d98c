//! What pictures are compared with: independent long runs of the same renderer with different seeds, or a picture that
//! is given. relMSE has its denominators from here alone: 1/(R² + ε), ε = 0.01·mean(R)².
//!
//! The runs' own spread is an unbiased estimate of the reference's own error; it is stated and subtracted. Of a given
//! picture it is not known, unless the caller knows it: what is then measured as bias contains it.

use serde::Serialize;

use super::runs::{self, Interval};
use crate::film::Film;
use crate::film::estimate::RELMSE_EPSILON;

/// R, G, B of each pixel of a film, one after the other, as a file would hold them.
pub fn values(film: &Film) -> Vec<f32> {
    film.pixels.iter().flat_map(|pixel| pixel.mean().into_iter().take(3)).map(|v| v as f32).collect()
}

/// A picture that is taken as the truth.
#[derive(Clone, Debug)]
pub struct Reference {
    /// R, G, B of each pixel.
    pub values: Vec<f64>,
    /// Weight of each squared difference in relMSE: 1/(R² + ε), over the number of values.
    pub weights: Vec<f64>,
    /// ε of relMSE.
    pub epsilon: f64,
    /// Mean over pixels and channels.
    pub mean: f64,
    /// Means of the single runs.
    pub run_means: Vec<f64>,
    /// relMSE of the reference itself; `None` where it is not known.
    pub own_relmse: Option<Interval>,
}

/// How one picture differs from the reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// relMSE, the reference's own subtracted: may come out negative near the reference's limit.
    pub relmse: f64,
    /// Mean over pixels and channels, not relative.
    pub mean: f64,
    /// Relative error that 50, 95 and 99.9 % of the pixels stay below.
    pub percentiles: [f64; 3],
    /// Share of the worst pixel in relMSE, before subtraction.
    pub largest_share: f64,
}

impl Reference {
    /// From at least two independent runs.
    pub fn of_runs(runs: &[Vec<f32>]) -> Self {
        let n = runs.len() as f64;
        let mut mean = vec![0.0; runs[0].len()];
        for run in runs {
            mean.iter_mut().zip(run).for_each(|(sum, v)| *sum += f64::from(*v) / n);
        }
        let mut reference = Reference::of_values(mean, None);
        reference.run_means = runs.iter().map(|run| mean_of(run.iter().map(|v| f64::from(*v)))).collect();
        // Σ(rₖ − r̄)²/(K(K − 1)), one term a run.
        let spread = |run: &Vec<f32>| -> f64 {
            let pairs = run.iter().zip(&reference.values).zip(&reference.weights);
            pairs.map(|((v, r), w)| w * (f64::from(*v) - r).powi(2)).sum::<f64>() / (n - 1.0)
        };
        reference.own_relmse = runs::mean(&runs.iter().map(spread).collect::<Vec<f64>>());
        reference
    }

    /// A given picture and its own relMSE, if that is known.
    pub fn of_values(values: Vec<f64>, own_relmse: Option<Interval>) -> Self {
        let mean = mean_of(values.iter().copied());
        let epsilon = RELMSE_EPSILON * mean * mean;
        let n = values.len() as f64;
        // A black value of a black picture has no scale; there is no error to weigh either.
        let weight = |r: &f64| if r * r + epsilon > 0.0 { 1.0 / (r * r + epsilon) / n } else { 0.0 };
        let weights = values.iter().map(weight).collect();
        Reference { weights, epsilon, mean, run_means: vec![mean], own_relmse, values }
    }

    /// relMSE of the reference itself, 0 where it is not known.
    pub fn own(&self) -> f64 {
        self.own_relmse.map_or(0.0, |own| own.value)
    }

    /// Squared relative error of each pixel of `image`: its share of relMSE times the number of pixels.
    pub fn relative_squares(&self, image: &[f32]) -> Vec<f64> {
        let pixels = image.len() as f64 / 3.0;
        let square = |i: usize| pixels * self.weights[i] * (f64::from(image[i]) - self.values[i]).powi(2);
        (0..image.len() / 3).map(|p| square(3 * p) + square(3 * p + 1) + square(3 * p + 2)).collect()
    }

    /// Holds `image` against the reference.
    pub fn difference(&self, image: &[f32]) -> Difference {
        let mut squares = self.relative_squares(image);
        let sum: f64 = squares.iter().sum();
        squares.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| squares[((squares.len() - 1) as f64 * share).round() as usize].sqrt();
        let largest = squares.last().copied().unwrap_or(0.0);
        Difference {
            relmse: sum / squares.len() as f64 - self.own(),
            mean: mean_of(image.iter().map(|v| f64::from(*v))),
            percentiles: [0.5, 0.95, 0.999].map(at),
            largest_share: if sum > 0.0 { largest / sum } else { 0.0 },
        }
    }
}

fn mean_of(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = values.len().max(1) as f64;
    values.sum::<f64>() / n
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_follow_the_definition_by_hand() {
        // R = 1 but for one pixel of 3; ε = 0.01·mean².
        let mut values = vec![1.0; 30];
        values[..3].fill(3.0);
        let reference = Reference::of_values(values, None);
        assert!((reference.mean - 1.2).abs() < 1e-12 && (reference.epsilon - 0.0144).abs() < 1e-12);
        let mut image = vec![1.0f32; 30];
        image[..3].fill(4.0);
        image[3] = 1.5;
        let d = reference.difference(&image);
        let (first, second) = (1.0 / 9.0144, 0.25 / 1.0144 / 3.0);
        assert!((d.relmse - (first + second) / 10.0).abs() < 1e-12, "{d:?}");
        assert!((d.largest_share - first / (first + second)).abs() < 1e-12);
        assert!((d.mean - (27.0 + 12.0 + 0.5) / 30.0).abs() < 1e-12);
        assert_eq!(d.percentiles[0], 0.0);
        assert!((d.percentiles[2] - first.sqrt()).abs() < 1e-12);
    }

    /// Oracle: runs of known variance. Four runs of mean 1 and uniform noise of width 0.4: the mean's variance is
    /// 0.16/12/4 over 1.01; 3000 values give 4 %, the limit is five of that.
    #[test]
    fn the_references_own_error_is_the_variance_of_its_mean() {
        let mut state = 9u64;
        let mut noise = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            0.8 + 0.4 * ((state >> 40) as f32 / (1u64 << 24) as f32)
        };
        let runs: Vec<Vec<f32>> = (0..4).map(|_| (0..3000).map(|_| noise()).collect()).collect();
        let reference = Reference::of_runs(&runs);
        let expected = 0.16 / 12.0 / 4.0 / 1.01;
        assert!((reference.own() / expected - 1.0).abs() < 0.2, "{} for {expected}", reference.own());
        assert_eq!(reference.run_means.len(), 4);
        // A picture that is the truth differs from it by that much, which is taken off again.
        let truth = reference.difference(&[1.0; 3000]);
        assert!(truth.relmse.abs() < 0.2 * expected, "{truth:?}");
    }
}
