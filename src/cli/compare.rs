//! `pathspace compare`: metrics of an image against a reference, and a verdict with the exit codes and thresholds of
//! OpenImageIO's `idiff`: 0 ok, 1 warning, 2 failure, 3 different size, 4 not readable.
//!
//! A pixel fails (or warns) when one of its channels differs by more than the threshold. Alpha takes part when both
//! images have it. Pixels that are not finite in either image fail.

use serde::Serialize;

use super::args::CompareArgs;
use super::report::stderr_line;
use super::{print, to_json};
use crate::accuracy::{flip, metrics};
use crate::error::Result;
use crate::film::exr::{Picture, read_exr};

/// How two images compare; the discriminants are the exit codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Verdict {
    Ok = 0,
    Warning = 1,
    Failure = 2,
    DifferentSize = 3,
    NotReadable = 4,
}

/// What `compare --json` prints.
#[derive(Serialize)]
struct Record {
    mse: f64,
    relmse: f64,
    relmse_trimmed: f64,
    epsilon: f64,
    flip: f64,
    mean_ratio: [Option<f64>; 3],
    max_difference: f64,
    pixels: usize,
    failing_pixels: usize,
    warning_pixels: usize,
    nonfinite_pixels: usize,
    verdict: Verdict,
}

/// Runs the command.
pub fn run(args: &CompareArgs) -> Result<u8> {
    let verdict = match (read_exr(&args.image), read_exr(&args.reference)) {
        (Ok(image), Ok(reference)) => judge(args, &image, &reference)?,
        (image, reference) => {
            for error in image.err().into_iter().chain(reference.err()) {
                stderr_line(format_args!("pathspace: error: {error}"));
            }
            Verdict::NotReadable
        }
    };
    Ok(verdict as u8)
}

fn judge(args: &CompareArgs, image: &Picture, reference: &Picture) -> Result<Verdict> {
    let place = |p: &Picture| (p.display, p.position, p.width, p.height);
    if place(image) != place(reference) {
        let text = |p: &Picture| {
            let ((w, h), (x, y)) = (p.display, p.position);
            format!("{}x{}{x:+}{y:+} of {w}x{h}", p.width, p.height)
        };
        stderr_line(format_args!("pathspace: error: images differ in size: {}, {}", text(image), text(reference)));
        return Ok(Verdict::DifferentSize);
    }
    let differences = differences(image, reference);
    let count = |threshold: f32| differences.iter().filter(|d| **d > f64::from(threshold)).count();
    let (failing_pixels, warning_pixels) = (count(args.fail), count(args.warn));
    let max_difference = differences.iter().copied().fold(0.0, f64::max);

    // Too many pixels above the soft threshold, or one above the hard one.
    let exceeds = |pixels: usize, percent: f32, hard: Option<f32>| {
        pixels as f64 > f64::from(percent) / 100.0 * differences.len() as f64
            || hard.is_some_and(|limit| max_difference > f64::from(limit))
    };
    let verdict = if exceeds(failing_pixels, args.failpercent, args.hardfail) {
        Verdict::Failure
    } else if exceeds(warning_pixels, args.warnpercent, args.hardwarn) {
        Verdict::Warning
    } else {
        Verdict::Ok
    };
    let m = metrics::compare(&image.rgb, &reference.rgb);
    let record = Record {
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
    };
    print(&if args.json { to_json(&record) } else { text(&record) })?;
    Ok(verdict)
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

fn text(r: &Record) -> String {
    let ratio = r.mean_ratio.map(|ratio| ratio.map_or("-".into(), |ratio| format!("{ratio:.5}"))).join(" ");
    let nonfinite =
        if r.nonfinite_pixels > 0 { format!(", {} of them not finite", r.nonfinite_pixels) } else { String::new() };
    format!(
        "mse             {:.6e}\n\
         relmse          {:.6e}  (epsilon {:.3e})\n\
         relmse_trimmed  {:.6e}\n\
         flip            {:.5}\n\
         mean_ratio      {ratio}\n\
         max_difference  {:.6e}\n\
         failing         {} of {} pixels{nonfinite}\n\
         verdict         {}\n",
        r.mse,
        r.relmse,
        r.epsilon,
        r.relmse_trimmed,
        r.flip,
        r.max_difference,
        r.failing_pixels,
        r.pixels,
        match r.verdict {
            Verdict::Ok => "ok",
            Verdict::Warning => "warning",
            _ => "failure",
        }
    )
}
