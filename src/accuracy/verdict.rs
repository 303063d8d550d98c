//! An image compared with a reference: metrics, and a verdict by the thresholds of OpenImageIO's `idiff`.
//!
//! A pixel fails (or warns) when one of its channels differs by more than the threshold. Alpha takes part when both
//! images have it. Pixels that are not finite in either image fail.

use serde::Serialize;

use super::{flip, metrics};
use crate::film::exr::Picture;
use crate::setters::setters;

/// What may differ how much. By default a channel may differ by 1e-6.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Thresholds {
    /// A pixel fails where a channel differs by more.
    pub fail: f32,
    /// Percentage of pixels that may fail.
    pub fail_percent: f32,
    /// No channel of any pixel may differ by more.
    pub hard_fail: Option<f32>,
    /// A pixel warns where a channel differs by more.
    pub warn: f32,
    /// Percentage of pixels that may warn.
    pub warn_percent: f32,
    /// One channel of one pixel that differs by more is a warning.
    pub hard_warn: Option<f32>,
}

impl Default for Thresholds {
    fn default() -> Self {
        Thresholds { fail: 1e-6, fail_percent: 0.0, hard_fail: None, warn: 1e-6, warn_percent: 0.0, hard_warn: None }
    }
}

impl Thresholds {
    setters! {
        fail: = f32,
        fail_percent: = f32,
        hard_fail: into Option<f32>,
        warn: = f32,
        warn_percent: = f32,
        hard_warn: into Option<f32>,
    }
}

/// How two images compare.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Verdict {
    /// Within all thresholds.
    Ok,
    /// Beyond those of warnings.
    Warning,
    /// Beyond those of failures.
    Failure,
}

/// What [`judge`] finds; what `compare --json` prints.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Judgement {
    /// Mean squared error.
    pub mse: f64,
    /// Relative mean squared error.
    pub relmse: f64,
    /// The same without the worst pixels.
    pub relmse_trimmed: f64,
    /// ε of the two above.
    pub epsilon: f64,
    /// HDR-FLIP at 67 pixels per degree.
    pub flip: f64,
    /// mean(I)/mean(R) per channel; `None` where the reference is black.
    pub mean_ratio: [Option<f64>; 3],
    /// Largest difference of a channel.
    pub max_difference: f64,
    /// Pixels of each image.
    pub pixels: usize,
    /// Pixels beyond [`Thresholds::fail`].
    pub failing_pixels: usize,
    /// Pixels beyond [`Thresholds::warn`].
    pub warning_pixels: usize,
    /// Pixels that are not finite.
    pub nonfinite_pixels: usize,
    /// What follows.
    pub verdict: Verdict,
}

/// Compares two pictures; `None` where their windows differ.
///
/// ```
/// use pathspace::accuracy::verdict::{Thresholds, Verdict, judge};
/// use pathspace::film::{Film, exr};
/// # let folder = tempfile::tempdir().expect("a temporary folder");
/// # let path = folder.path().join("picture.exr");
/// # let film = Film::new((64, 64), pathspace::render::Crop { x: 0, y: 0, width: 64, height: 64 });
/// # film.write_exr(&path, &exr::ExrOptions::default())?;
/// let picture = exr::read_exr(&path)?;
/// let found = judge(&picture, &picture, &Thresholds::default().fail(0.1)).expect("one size");
/// assert_eq!((found.mse, found.verdict), (0.0, Verdict::Ok));
/// # Ok::<(), pathspace::Error>(())
/// ```
pub fn judge(image: &Picture, reference: &Picture, thresholds: &Thresholds) -> Option<Judgement> {
    let place = |p: &Picture| (p.display, p.position, p.width, p.height);
    if place(image) != place(reference) {
        return None;
    }
    let differences = differences(image, reference);
    let count = |threshold: f32| differences.iter().filter(|d| **d > f64::from(threshold)).count();
    let (failing_pixels, warning_pixels) = (count(thresholds.fail), count(thresholds.warn));
    let max_difference = differences.iter().copied().fold(0.0, f64::max);

    // Too many pixels above the soft threshold, or one above the hard one.
    let exceeds = |pixels: usize, percent: f32, hard: Option<f32>| {
        pixels as f64 > f64::from(percent) / 100.0 * differences.len() as f64
            || hard.is_some_and(|limit| max_difference > f64::from(limit))
    };
    let verdict = if exceeds(failing_pixels, thresholds.fail_percent, thresholds.hard_fail) {
        Verdict::Failure
    } else if exceeds(warning_pixels, thresholds.warn_percent, thresholds.hard_warn) {
        Verdict::Warning
    } else {
        Verdict::Ok
    };
    let m = metrics::compare(&image.rgb, &reference.rgb);
    Some(Judgement {
        mse: m.mse,
        relmse: m.relmse,
        relmse_trimmed: m.relmse_trimmed,
        epsilon: m.epsilon,
        flip: flip::hdr_flip(&image.rgb, &reference.rgb, image.width),
        mean_ratio: m.mean_ratio,
        max_difference,
        pixels: differences.len(),
        failing_pixels,
        warning_pixels,
        nonfinite_pixels: m.nonfinite,
        verdict,
    })
}

/// Per pixel the largest difference of a channel; infinite where a value is not finite.
fn differences(image: &Picture, reference: &Picture) -> Vec<f64> {
    let difference = |a: f32, b: f32| {
        if a.is_finite() && b.is_finite() { (f64::from(a) - f64::from(b)).abs() } else { f64::INFINITY }
    };
    let mut list: Vec<f64> = image
        .rgb
        .iter()
        .zip(&reference.rgb)
        .map(|(a, b)| (0..3).map(|c| difference(a[c], b[c])).fold(0.0, f64::max))
        .collect();
    if let (Some(a), Some(b)) = (&image.alpha, &reference.alpha) {
        for ((d, &a), &b) in list.iter_mut().zip(a).zip(b) {
            *d = d.max(difference(a, b));
        }
    }
    list
}
