//! FLIP, the difference that a viewer sees when flipping between two images, in [0, 1] per pixel.
//!
//! LDR-FLIP: opponent colours are filtered by the eye's contrast sensitivity and compared in L*a*b* (HyAB distance with
//! the Hunt effect); edges and points of the achromatic channel are compared on their own; the feature difference
//! raises the colour difference. HDR-FLIP: the largest LDR-FLIP of each pixel over exposures from where the reference's
//! maximum reaches 85 % of the display (ACES curve of Narkowicz) to where its median does. Images leave and enter as
//! linear Rec.709, row-major; borders are extended by their edge pixels.
//!
//! Sources: Andersson et al. 2020 (PACM CGIT 3:2, LDR); Andersson et al. 2021 (EGSR, HDR), whose symbols the constants
//! carry. Checked against the authors' `flip-evaluator` 1.7. Viewing distance is theirs: 0.7 m from a display of 3840
//! pixels over 0.7 m, 67 pixels per degree.
//! Limit: a property of the displayed image, not an error bar; it has no unbiased estimator.

use rayon::prelude::*;

/// Pixels per degree of visual angle: distance × pixels per metre × π/180.
const PIXELS_PER_DEGREE: f32 = 0.7 * (3840.0 / 0.7) * (std::f32::consts::PI / 180.0);

/// Contrast sensitivity as sums of two Gaussians, (a₁, b₁, a₂, b₂) for the achromatic, red-green and
/// blue-yellow channel.
const CSF: [[f32; 4]; 3] = [[1.0, 0.0047, 0.0, 1e-5], [1.0, 0.0053, 0.0, 1e-5], [34.1, 0.04, 13.5, 0.025]];

/// Width of the feature detector, degrees.
const FEATURE_WIDTH: f32 = 0.082;

/// Exponent of the colour difference (q_c), share of the maximum below which it is compressed (p_c), and the value that
/// this share maps to (p_t).
const Q_C: f32 = 0.7;
const P_C: f32 = 0.4;
const P_T: f32 = 0.95;

/// Exponent of the feature difference.
const Q_F: f32 = 0.5;

/// Tone curve (k₀x² + k₁x + k₂)/(k₃x² + k₄x + k₅) of HDR-FLIP, with the exposure factor of 0.6 folded in.
const ACES: [f32; 6] = [0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.0, 0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14];

/// Display value that the brightest exposures bring the reference's median (and maximum) to.
const EXPOSURE_TARGET: f64 = 0.85;

/// XYZ from linear Rec.709, white of D65: from the primaries and white point of ITU-R BT.709.
const XYZ_FROM_RGB: [[f32; 3]; 3] =
    [[0.41238656, 0.3575915, 0.1804505], [0.21263682, 0.715183, 0.0721802], [0.01933062, 0.11919716, 0.9503726]];

/// Its inverse.
const RGB_FROM_XYZ: [[f32; 3]; 3] =
    [[3.2410033, -1.5373992, -0.4986159], [-0.9692243, 1.87593, 0.0415542], [0.0556394, -0.2040112, 1.057149]];

/// XYZ of white: row sums of [`XYZ_FROM_RGB`].
const WHITE: [f32; 3] = [0.95042854, 1.0, 1.0889004];

/// Mean HDR-FLIP of `image` against `reference`, both scene-linear, `width` pixels a row. Negative and non-finite
/// values count as black.
pub fn hdr_flip(image: &[[f32; 3]], reference: &[[f32; 3]], width: usize) -> f64 {
    mean(&hdr_flip_map(image, reference, width))
}

/// HDR-FLIP of each pixel, as [`hdr_flip`].
pub fn hdr_flip_map(image: &[[f32; 3]], reference: &[[f32; 3]], width: usize) -> Vec<f32> {
    assert_eq!(image.len(), reference.len(), "images of different size reached FLIP");
    if image.is_empty() {
        return Vec::new();
    }
    let detector = Detector::new();
    let exposures = exposures(reference);
    let mut worst = vec![0.0f32; image.len()];
    for stops in exposures {
        let gain = stops.exp2() as f32;
        let map = detector.difference(&tone_mapped(image, gain), &tone_mapped(reference, gain), width);
        for (worst, value) in worst.iter_mut().zip(map) {
            *worst = worst.max(value);
        }
    }
    worst
}

/// Mean LDR-FLIP of two images in display-linear values within [0, 1] (an sRGB image after decoding).
pub fn ldr_flip(image: &[[f32; 3]], reference: &[[f32; 3]], width: usize) -> f64 {
    assert_eq!(image.len(), reference.len(), "images of different size reached FLIP");
    mean(&Detector::new().difference(image, reference, width))
}

fn mean(map: &[f32]) -> f64 {
    map.iter().map(|&v| f64::from(v)).sum::<f64>() / map.len().max(1) as f64
}

/// Exposures of HDR-FLIP in stops, evenly spaced, about one a stop and at least two.
fn exposures(reference: &[[f32; 3]]) -> Vec<f64> {
    let [k0, k1, k2, k3, k4, k5] = ACES.map(f64::from);
    let t = EXPOSURE_TARGET;
    let (a, b, c) = (k0 - t * k3, k1 - t * k4, k2 - t * k5);
    let x_max = (-b + (b * b - 4.0 * a * c).sqrt()) / (2.0 * a);

    let luminance = |p: &[f32; 3]| (0..3).map(|c| XYZ_FROM_RGB[1][c] * shown(p[c])).sum::<f32>();
    let mut values: Vec<f32> = reference.iter().map(luminance).collect();
    values.sort_unstable_by(f32::total_cmp);
    // Of an even number the upper one, as the published implementation takes it.
    let median = values[values.len() / 2];
    // A median of zero would ask for infinite exposure.
    let floor = f64::from(f32::EPSILON);
    let (maximum, median) = (f64::from(values[values.len() - 1]).max(floor), f64::from(median).max(floor));
    let (start, stop) = ((x_max / maximum).log2(), (x_max / median).log2());
    let count = ((stop - start).ceil() as usize).max(2);
    (0..count).map(|i| start + (stop - start) * i as f64 / (count - 1) as f64).collect()
}

/// A value as it can be shown: negative and NaN are black.
fn shown(value: f32) -> f32 {
    if value.is_finite() { value.max(0.0) } else { 0.0 }
}

fn tone_mapped(image: &[[f32; 3]], gain: f32) -> Vec<[f32; 3]> {
    let [k0, k1, k2, k3, k4, k5] = ACES;
    let curve = |value: f32| {
        // The curve is flat far above 1; the bound keeps its squares finite.
        let x = (shown(value) * gain).min(1e15);
        ((k0 * x * x + k1 * x + k2) / (k3 * x * x + k4 * x + k5)).clamp(0.0, 1.0)
    };
    image.par_iter().map(|pixel| pixel.map(curve)).collect()
}

/// The kernels of both pipelines, one axis each (all are separable).
struct Detector {
    /// Contrast sensitivity of Y, Cx and the two terms of Cz.
    csf: [Vec<f32>; 4],
    /// Gaussian, first and second derivative, each normalised on its positive and negative side.
    feature: [Vec<f32>; 3],
    /// Largest possible colour difference: Hunt-adjusted green against blue.
    max_difference: f32,
}

impl Detector {
    fn new() -> Self {
        let hunt = |rgb| hunt_adjusted(lab(rgb));
        let max_difference = hyab(hunt([0.0, 1.0, 0.0]), hunt([0.0, 0.0, 1.0])).powf(Q_C);
        Detector { csf: csf_kernels(), feature: feature_kernels(), max_difference }
    }

    /// The error map of two display-linear images.
    fn difference(&self, image: &[[f32; 3]], reference: &[[f32; 3]], width: usize) -> Vec<f32> {
        let (a, b) = (self.seen(image, width), self.seen(reference, width));
        let pixels = a.lab.par_iter().zip(&b.lab).zip(a.features.par_iter().zip(&b.features));
        pixels
            .map(|((lab_a, lab_b), (f_a, f_b))| {
                let color = self.redistributed(hyab(*lab_a, *lab_b).powf(Q_C));
                let feature = (f_a[0] - f_b[0]).abs().max((f_a[1] - f_b[1]).abs()) * std::f32::consts::FRAC_1_SQRT_2;
                color.powf(1.0 - feature.powf(Q_F).min(1.0))
            })
            .collect()
    }

    /// Colour differences mapped to [0, 1], small ones to the larger part of it.
    fn redistributed(&self, difference: f32) -> f32 {
        let knee = P_C * self.max_difference;
        if difference < knee {
            P_T / knee * difference
        } else {
            P_T + (difference - knee) / (self.max_difference - knee) * (1.0 - P_T)
        }
    }

    /// What of an image reaches the viewer.
    fn seen(&self, image: &[[f32; 3]], width: usize) -> Seen {
        let opponent: Vec<[f32; 3]> = image.par_iter().map(|&rgb| ycxcz(rgb)).collect();
        let [y, cx, cz1, cz2] = &self.csf;
        let columns =
            filter_rows(&opponent, width, y.len(), |k, [l, x, z]| [y[k] * l, cx[k] * x, cz1[k] * z, cz2[k] * z]);
        let filtered = filter_columns(&columns, width, y.len(), |k, [l, x, z1, z2]| {
            [y[k] * l, cx[k] * x, cz1[k] * z1 + cz2[k] * z2, 0.0]
        });
        let lab = filtered.par_iter().map(|&[l, x, z, _]| hunt_adjusted(lab(rgb_of([l, x, z])))).collect();

        let [g, d1, d2] = &self.feature;
        let grey: Vec<[f32; 3]> = opponent.par_iter().map(|c| [(c[0] + 16.0) / 116.0, 0.0, 0.0]).collect();
        let columns = filter_rows(&grey, width, g.len(), |k, [v, _, _]| [g[k] * v, d1[k] * v, d2[k] * v, 0.0]);
        let derivatives = filter_columns(&columns, width, g.len(), |k, [smooth, first, second, _]| {
            [g[k] * first, d1[k] * smooth, g[k] * second, d2[k] * smooth]
        });
        let features = derivatives.par_iter().map(|d| [d[0].hypot(d[1]), d[2].hypot(d[3])]).collect();
        Seen { lab, features }
    }
}

/// An image as the metric sees it.
struct Seen {
    /// Filtered, Hunt-adjusted L*a*b*.
    lab: Vec<[f32; 3]>,
    /// Magnitudes of edges and points.
    features: Vec<[f32; 2]>,
}

/// Sums `taps` values along each row; `tap` weighs the value that tap `k` reads.
fn filter_rows(
    image: &[[f32; 3]],
    width: usize,
    taps: usize,
    tap: impl Fn(usize, [f32; 3]) -> [f32; 4] + Sync,
) -> Vec<[f32; 4]> {
    let radius = taps / 2;
    let mut out = vec![[0.0f32; 4]; image.len()];
    out.par_chunks_mut(width).zip(image.par_chunks(width)).for_each(|(out, row)| {
        for (x, sum) in out.iter_mut().enumerate() {
            for k in 0..taps {
                let from = (x + k).saturating_sub(radius).min(width - 1);
                add(sum, tap(k, row[from]));
            }
        }
    });
    out
}

/// Sums `taps` values along each column.
fn filter_columns(
    image: &[[f32; 4]],
    width: usize,
    taps: usize,
    tap: impl Fn(usize, [f32; 4]) -> [f32; 4] + Sync,
) -> Vec<[f32; 4]> {
    let (radius, height) = (taps / 2, image.len() / width);
    let mut out = vec![[0.0f32; 4]; image.len()];
    out.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for k in 0..taps {
            let from = (y + k).saturating_sub(radius).min(height - 1);
            for (sum, &value) in out.iter_mut().zip(&image[from * width..(from + 1) * width]) {
                add(sum, tap(k, value));
            }
        }
    });
    out
}

#[inline(always)]
fn add(sum: &mut [f32; 4], value: [f32; 4]) {
    for (sum, value) in sum.iter_mut().zip(value) {
        *sum += value;
    }
}

/// One axis of the contrast sensitivity kernels, normalised so that each channel's two-dimensional sum is 1.
fn csf_kernels() -> [Vec<f32>; 4] {
    use std::f32::consts::PI;
    let widest = CSF.iter().flat_map(|c| [c[1], c[3]]).fold(0.0, f32::max);
    let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
    let gaussian = |b: f32| -> Vec<f32> {
        (-radius..=radius).map(|i| (-PI * PI * (i as f32 / PIXELS_PER_DEGREE).powi(2) / b).exp()).collect()
    };
    let scaled = |kernel: Vec<f32>, factor: f32| kernel.iter().map(|v| v * factor).collect::<Vec<f32>>();
    let normalised = |kernel: Vec<f32>| {
        let sum: f32 = kernel.iter().sum();
        scaled(kernel, 1.0 / sum)
    };
    let [a1, b1, a2, b2] = CSF[2];
    let (wide, narrow) = (gaussian(b1), gaussian(b2));
    let square_of_sum = |kernel: &[f32]| kernel.iter().sum::<f32>().powi(2);
    let (wide_weight, narrow_weight) = (a1 * (PI / b1).sqrt(), a2 * (PI / b2).sqrt());
    let total = wide_weight * square_of_sum(&wide) + narrow_weight * square_of_sum(&narrow);
    [
        normalised(gaussian(CSF[0][1])),
        normalised(gaussian(CSF[1][1])),
        scaled(wide, (wide_weight / total).sqrt()),
        scaled(narrow, (narrow_weight / total).sqrt()),
    ]
}

/// One axis of the feature detectors: the Gaussian sums to 1; positive weights of a derivative sum to 1, negative to
/// −1.
fn feature_kernels() -> [Vec<f32>; 3] {
    let sigma = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE;
    let radius = (3.0 * sigma).ceil() as i32;
    let kernel = |weight: &dyn Fn(f32) -> f32| -> Vec<f32> {
        let raw: Vec<f32> = (-radius..=radius)
            .map(|i| weight(i as f32) * (-(i as f32).powi(2) / (2.0 * sigma * sigma)).exp())
            .collect();
        let positive: f32 = raw.iter().filter(|v| **v > 0.0).sum();
        let negative: f32 = -raw.iter().filter(|v| **v < 0.0).sum::<f32>();
        raw.iter()
            .map(|&v| {
                if v > 0.0 {
                    v / positive
                } else if v < 0.0 {
                    v / negative
                } else {
                    0.0
                }
            })
            .collect()
    };
    [kernel(&|_| 1.0), kernel(&|x| -x), kernel(&|x| (x / sigma).powi(2) - 1.0)]
}

fn multiply(m: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|r| m[r][0] * v[0] + m[r][1] * v[1] + m[r][2] * v[2])
}

/// Linearised opponent colours: Y in [−16, 100], Cx red-green, Cz blue-yellow.
fn ycxcz(rgb: [f32; 3]) -> [f32; 3] {
    let xyz = multiply(&XYZ_FROM_RGB, rgb);
    let [x, y, z] = std::array::from_fn(|c| xyz[c] / WHITE[c]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Back from opponent colours, clipped to what the display shows.
fn rgb_of([l, cx, cz]: [f32; 3]) -> [f32; 3] {
    let y = (l + 16.0) / 116.0;
    let xyz = [WHITE[0] * (y + cx / 500.0), WHITE[1] * y, WHITE[2] * (y - cz / 200.0)];
    multiply(&RGB_FROM_XYZ, xyz).map(|v| v.clamp(0.0, 1.0))
}

/// CIE 1976 L*a*b* of linear Rec.709.
fn lab(rgb: [f32; 3]) -> [f32; 3] {
    const DELTA: f32 = 6.0 / 29.0;
    let xyz = multiply(&XYZ_FROM_RGB, rgb);
    let [x, y, z] = std::array::from_fn(|c| {
        let t = xyz[c] / WHITE[c];
        if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Hunt effect: differences in chroma show less where it is dark.
fn hunt_adjusted([l, a, b]: [f32; 3]) -> [f32; 3] {
    [l, 0.01 * l * a, 0.01 * l * b]
}

/// HyAB distance: city-block in lightness, Euclidean in chroma.
fn hyab(a: [f32; 3], b: [f32; 3]) -> f32 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 48;
    const HEIGHT: usize = 40;

    fn picture(value: impl Fn(i32, i32, i32) -> f32) -> Vec<[f32; 3]> {
        let place = |i: usize| ((i % WIDTH) as i32, (i / WIDTH) as i32);
        (0..WIDTH * HEIGHT).map(|i| [0, 1, 2].map(|c| value(place(i).0, place(i).1, c))).collect()
    }

    fn pattern(x: i32, y: i32, slope: i32) -> i32 {
        (x * 4 + y * 2 * slope) % 224 + (x / 8 + y / 8) % 2 * 24
    }

    /// An sRGB code in 256ths, decoded.
    fn decoded(code: i32) -> f32 {
        let v = code.clamp(0, 256) as f32 / 256.0;
        if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
    }

    fn high_range(x: i32, y: i32, c: i32) -> f32 {
        ((16 + (y * 5 + c * 3) % 17) as f32 / 16.0) * ((x / 6 - 4) as f32).exp2()
    }

    #[test]
    fn values_agree_with_the_published_implementation() {
        // Oracle: flip-evaluator 1.7 (PyPI) on the same procedural images, f32 as here. Deterministic; the limit is the
        // rounding of two different summation orders.
        let reference = picture(|x, y, c| decoded(pattern(x, y, c + 1)));
        let noisy =
            picture(|x, y, c| decoded(pattern(x, y, c + 1) + (x * 73 + y * 151 + c * 57 + x * y * 31) % 33 - 16));
        let shifted = picture(|x, y, c| decoded(pattern((x - 2).max(0), y, 3 - c)));
        let bright = picture(high_range);
        let fireflies =
            picture(|x, y, c| high_range(x, y, c) * 1.125 * if (x * 7 + y * 11) % 61 == 0 { 16.0 } else { 1.0 });
        let found = [
            ldr_flip(&noisy, &reference, WIDTH),
            ldr_flip(&shifted, &reference, WIDTH),
            hdr_flip(&fireflies, &bright, WIDTH),
            hdr_flip(&bright, &fireflies, WIDTH),
        ];
        for (found, expected) in found.into_iter().zip([0.08933491, 0.59387791, 0.18774419, 0.22838697]) {
            assert!((found - expected).abs() < 2e-5, "{found} for {expected}");
        }
        assert_eq!(exposures(&bright).len(), 4);
        let ends = [-2.840394, 0.8677118];
        assert!((exposures(&bright)[0] - ends[0]).abs() < 1e-4 && (exposures(&bright)[3] - ends[1]).abs() < 1e-4);
    }

    #[test]
    fn equal_images_do_not_differ_and_extremes_stay_finite() {
        let bright = picture(high_range);
        assert_eq!(hdr_flip(&bright, &bright, WIDTH), 0.0);
        let broken = picture(|x, _, c| if x == c { f32::NAN } else { f32::MAX });
        let black = vec![[0.0; 3]; WIDTH * HEIGHT];
        for pair in [[&broken, &bright], [&bright, &broken], [&black, &bright], [&bright, &black]] {
            let flip = hdr_flip(pair[0], pair[1], WIDTH);
            assert!((0.0..=1.0).contains(&flip), "{flip}");
        }
        assert_eq!(hdr_flip(&[], &[], 0), 0.0);
        // Black against white is the largest difference that a display can show.
        let white = ldr_flip(&black, &vec![[1.0; 3]; WIDTH * HEIGHT], WIDTH);
        assert!((0.9..=1.0).contains(&white), "{white}");
    }
}
