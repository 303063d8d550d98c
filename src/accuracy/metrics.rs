//! Metrics of a linear image I against a reference R (all means in f64, denominators from the reference only):
//!
//! * MSE: mean over pixels and channels of (I − R)².
//! * relMSE: mean of (I − R)²/(R² + ε) with ε = 0.01·mean(R)², scale-free.
//! * trimmed relMSE: the same after dropping the 0.1 % of pixels with the largest share.
//! * mean ratio: mean(I)/mean(R) per channel; a clamp or a lost light shows here first.
//!
//! Pixels that are not finite in either image are left out of every metric and counted.

use crate::film::estimate::RELMSE_EPSILON;

/// Fraction of pixels that trimmed relMSE drops.
pub const TRIM: f64 = 1e-3;

/// What [`compare`] finds.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Metrics {
    /// Mean squared error.
    pub mse: f64,
    /// Relative mean squared error.
    pub relmse: f64,
    /// The same without the worst pixels.
    pub relmse_trimmed: f64,
    /// ε of the two above.
    pub epsilon: f64,
    /// mean(I)/mean(R) per channel; `None` where the reference is black.
    pub mean_ratio: [Option<f64>; 3],
    /// Pixels left out because they are not finite.
    pub nonfinite: usize,
}

/// Compares `image` with `reference`, pixel by pixel; both have the same number of pixels.
///
/// ```
/// use pathspace::accuracy::metrics::compare;
/// let found = compare(&[[1.0, 2.0, 3.0], [1.5, 2.0, 3.0]], &[[1.0, 2.0, 3.0]; 2]);
/// assert!((found.mse - 0.25 / 6.0).abs() < 1e-12 && found.mean_ratio[0] == Some(1.25));
/// ```
pub fn compare(image: &[[f32; 3]], reference: &[[f32; 3]]) -> Metrics {
    assert_eq!(image.len(), reference.len(), "images of different size reached the metrics");
    let finite = |pixel: &[f32; 3]| pixel.iter().all(|c| c.is_finite());
    let pairs: Vec<_> = image.iter().zip(reference).filter(|(i, r)| finite(i) && finite(r)).collect();
    let n = pairs.len().max(1) as f64;

    let (mut image_sum, mut reference_sum) = ([0.0f64; 3], [0.0f64; 3]);
    for (i, r) in &pairs {
        for c in 0..3 {
            image_sum[c] += f64::from(i[c]);
            reference_sum[c] += f64::from(r[c]);
        }
    }
    let mean = reference_sum.iter().sum::<f64>() / (3.0 * n);
    let epsilon = RELMSE_EPSILON * mean * mean;

    let mut mse = 0.0;
    let mut relative: Vec<f64> = Vec::with_capacity(pairs.len());
    for (i, r) in &pairs {
        let mut share = 0.0;
        for c in 0..3 {
            let squared = (f64::from(i[c]) - f64::from(r[c])).powi(2);
            mse += squared / (3.0 * n);
            // Equal black pixels of a black reference have no error: 0/0 is 0 here.
            if squared > 0.0 {
                share += squared / (f64::from(r[c]).powi(2) + epsilon) / 3.0;
            }
        }
        relative.push(share);
    }
    let relmse = relative.iter().sum::<f64>() / n;
    relative.sort_unstable_by(f64::total_cmp);
    let kept = (relative.len() as f64 * (1.0 - TRIM)).round() as usize;
    let relmse_trimmed = relative[..kept].iter().sum::<f64>() / kept.max(1) as f64;

    let mean_ratio = std::array::from_fn(|c| (reference_sum[c] != 0.0).then(|| image_sum[c] / reference_sum[c]));
    Metrics { mse, relmse, relmse_trimmed, epsilon, mean_ratio, nonfinite: image.len() - pairs.len() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metrics_of_a_small_image_match_the_definition_by_hand() {
        // Oracle: by hand. R = 1 everywhere but one pixel of 3; one pixel of 1000 is off by 0.5, another by 3.
        let mut reference = vec![[1.0f32; 3]; 1000];
        let mut image = reference.clone();
        image[7] = [1.5; 3];
        image[8][1] = 4.0;
        let m = compare(&image, &reference);
        assert!((m.epsilon - 0.01).abs() < 1e-12 && m.nonfinite == 0);
        assert!((m.mse - (0.25 * 3.0 + 9.0) / 3000.0).abs() < 1e-12, "{m:?}");
        assert!((m.relmse - m.mse / 1.01).abs() < 1e-12);
        // The worst of 1000 pixels (9/3 against 0.25) is dropped.
        assert!((m.relmse_trimmed - 0.25 / 1.01 / 999.0).abs() < 1e-12, "{m:?}");
        assert!((m.mean_ratio[1].expect("not black") - 1003.5 / 1000.0).abs() < 1e-12);

        // Scale-free: both images times 8 leave relMSE alone and multiply MSE by 64.
        let scale = |list: &[[f32; 3]]| list.iter().map(|p| p.map(|v| 8.0 * v)).collect::<Vec<_>>();
        let scaled = compare(&scale(&image), &scale(&reference));
        assert!((scaled.relmse - m.relmse).abs() < 1e-15 && (scaled.mse - 64.0 * m.mse).abs() < 1e-12);

        // Pixels that are not finite are counted, not spread.
        reference[0][2] = f32::INFINITY;
        image[1][0] = f32::NAN;
        let m = compare(&image, &reference);
        assert!(m.nonfinite == 2 && m.mse.is_finite() && m.relmse.is_finite());
    }

    #[test]
    fn equal_images_have_no_error_even_when_black() {
        let m = compare(&[[0.0; 3]; 4], &[[0.0; 3]; 4]);
        assert_eq!((m.mse, m.relmse, m.relmse_trimmed, m.mean_ratio), (0.0, 0.0, 0.0, [None; 3]));
        assert_eq!(compare(&[], &[]).mse, 0.0);
    }
}
