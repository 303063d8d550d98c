//! `pathspace compare`: metrics of an image against a reference, and a verdict with the exit codes of OpenImageIO's
//! `idiff`: 0 ok, 1 warning, 2 failure, 3 different size, 4 a file cannot be read or written.

use std::path::Path;

use super::args::CompareArgs;
use super::html;
use super::output::{print, to_json};
use super::report::stderr_line;
use crate::accuracy::verdict::{self, Judgement, Thresholds, Verdict};
use crate::error::{Error, Result};
use crate::film::atomic::{check_writable, write_atomically};
use crate::film::exr::{Picture, read_exr};
use crate::film::look::Format;
use crate::film::png;
use crate::plain::plain;
use crate::plot::heat::HeatMap;

/// Exit code: the images have different windows.
const EXIT_DIFFERENT_SIZE: u8 = 3;
/// Exit code: an image cannot be read, or what was found cannot be written.
const EXIT_NO_FILE: u8 = 4;

/// Runs the command.
pub fn run(args: &CompareArgs) -> Result<u8> {
    match check_and_compare(args) {
        // 1 would be a verdict.
        Err(error @ (Error::Io { .. } | Error::Image { .. })) => {
            stderr_line(format_args!("pathspace: error: {error}"));
            Ok(EXIT_NO_FILE)
        }
        ended => ended,
    }
}

fn check_and_compare(args: &CompareArgs) -> Result<u8> {
    if let Some(path) = &args.output {
        if Format::of(path) != Some(Format::Png) {
            let problem = format!("{}: the name must end in .png", path.display());
            return Err(Error::Option { option: "--output", problem });
        }
        check_writable(path)?;
    }
    if let Some(path) = &args.html {
        if !path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("html")) {
            let problem = format!("{}: the name must end in .html", path.display());
            return Err(Error::Option { option: "--html", problem });
        }
        check_writable(path)?;
    }
    match (read(&args.image), read(&args.reference)) {
        (Ok(image), Ok(reference)) => compare(args, &image, &reference),
        (image, reference) => {
            for error in image.err().into_iter().chain(reference.err()) {
                stderr_line(format_args!("pathspace: error: {error}"));
            }
            Ok(EXIT_NO_FILE)
        }
    }
}

/// Reads an image; previews are refused by name.
fn read(path: &Path) -> Result<Picture> {
    if Format::of(path).is_some() {
        let problem = "only OpenEXR pictures are compared; a preview has lost what counts".into();
        return Err(Error::Image { path: path.into(), problem });
    }
    read_exr(path)
}

/// How far `image` is from `reference` in each pixel, relative to the reference, or to a tenth of its mean where that
/// is more. What is not finite is as far as can be.
fn difference(image: &Picture, reference: &Picture) -> HeatMap {
    let off =
        |(a, b): (&[f32; 3], &[f32; 3])| a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / 3.0;
    let off: Vec<f64> = image.rgb.iter().zip(&reference.rgb).map(off).collect();
    HeatMap::of(&html::picture::relative(&off, &reference.rgb))
}

fn compare(args: &CompareArgs, image: &Picture, reference: &Picture) -> Result<u8> {
    let thresholds = Thresholds::default()
        .fail(args.fail)
        .fail_percent(args.failpercent)
        .hard_fail(args.hardfail)
        .warn(args.warn)
        .warn_percent(args.warnpercent)
        .hard_warn(args.hardwarn);
    let Some(found) = verdict::judge(image, reference, &thresholds) else {
        let text = |p: &Picture| {
            let ((w, h), (x, y)) = (p.display, p.position);
            format!("{}x{}{x:+}{y:+} of {w}x{h}", p.width, p.height)
        };
        stderr_line(format_args!("pathspace: error: images differ in size: {}, {}", text(image), text(reference)));
        return Ok(EXIT_DIFFERENT_SIZE);
    };
    if args.output.is_some() || args.html.is_some() {
        let map = difference(image, reference);
        if let Some(path) = &args.output {
            let (width, height, bytes) = map.with_scale(image.width);
            let png = png::encode_rgb(&bytes, width as u32, height as u32);
            write_atomically(path, |writer| std::io::Write::write_all(writer, &png))?;
        }
        if let Some(path) = &args.html {
            let page = html::compare::page((&args.image, image), (&args.reference, reference), &map, &found);
            write_atomically(path, |writer| std::io::Write::write_all(writer, plain(&page).as_bytes()))?;
        }
    }
    print(&if args.json { to_json(&found) } else { text(&found) })?;
    for path in args.output.iter().chain(&args.html) {
        stderr_line(format_args!("wrote {}", path.display()));
    }
    Ok(match found.verdict {
        Verdict::Ok => 0,
        Verdict::Warning => 1,
        Verdict::Failure => 2,
    })
}

fn text(r: &Judgement) -> String {
    let ratio = r.mean_ratio.map(|ratio| ratio.map_or("-".into(), |ratio| format!("{ratio:.5}"))).join(" ");
    let nonfinite =
        if r.nonfinite_pixels > 0 { format!(", {} of them not finite", r.nonfinite_pixels) } else { String::new() };
    format!(
        "mse             {:.6e}\n\
         relmse          {:.6e}  (epsilon {:.3e})\n\
         relative_rmse   {:.3} %\n\
         relmse_trimmed  {:.6e}\n\
         flip            {:.5}\n\
         mean_ratio      {ratio}\n\
         max_difference  {:.6e}\n\
         failing         {} of {} pixels{nonfinite}\n\
         verdict         {}\n",
        r.mse,
        r.relmse,
        r.epsilon,
        100.0 * r.relmse.sqrt(),
        r.relmse_trimmed,
        r.flip,
        r.max_difference,
        r.failing_pixels,
        r.pixels,
        match r.verdict {
            Verdict::Ok => "ok",
            Verdict::Warning => "warning",
            Verdict::Failure => "failure",
        }
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::heat::heat;

    /// Oracle: the ends of the scale.
    #[test]
    fn pixels_that_are_no_number_are_the_worst() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let picture = |name: &str, value: f64| {
            let window = crate::render::Crop { x: 0, y: 0, width: 2, height: 1 };
            let mut film = crate::film::Film::new((2, 1), window);
            film.pixels.iter_mut().for_each(|pixel| pixel.add(0, [1.0; 3], 1.0, 1.0));
            film.pixels[1].sum[0][0] = value;
            let path = folder.path().join(name);
            film.write_exr(&path, &crate::film::exr::ExrOptions::default()).expect("a writable folder");
            read_exr(&path).expect("just written")
        };
        let (plain, broken) = (picture("a.exr", 1.0), picture("b.exr", f64::NAN));
        for (image, reference) in [(&broken, &plain), (&plain, &broken)] {
            assert_eq!(difference(image, reference).bytes, [heat(0.0), heat(1.0)].concat());
        }
    }
}
