//! `--reference` and `--error-log`: after every pass a line with the true error against a reference and what the render
//! itself says of it. The clock of the render is paused meanwhile.
//!
//! Columns: `seconds` of rendering, `spp`, then against the reference `mse`, `relmse`, `relmse_trimmed` (as `compare`
//! defines them; the reference's own noise is in them), then the film's own `estimated_relmse`, its 95 % interval
//! `estimated_low`, `estimated_high`, and `limit`, the relMSE that the picture stays below with 99 %. The last four are
//! empty until both halves of the film have samples.

use std::fmt::Write;
use std::path::Path;

use crate::accuracy::metrics;
use crate::error::{Error, Result};
use crate::film::Film;
use crate::film::atomic::write_atomically;
use crate::film::exr::{Picture, read_exr};
use crate::plan::RenderPlan;
use crate::render::Snapshot;
use crate::render::stopping::LIMIT_SIGMAS;

/// Lines so far, and what they compare with.
pub struct ErrorLog {
    /// Pixels of the window.
    reference: Vec<[f32; 3]>,
    text: String,
}

impl ErrorLog {
    /// Reads the reference for what `plan` renders. It may show more than the window, not less.
    ///
    /// # Errors
    /// As [`read_exr`]; [`Error::Option`] where the reference is of another size or does not cover the window.
    pub fn open(path: &Path, plan: &RenderPlan) -> Result<Self> {
        let reference = window_of(&read_exr(path)?, plan).map_err(|problem| Error::Option {
            option: "--reference",
            problem: format!("{}: {problem}", path.display()),
        })?;
        let text =
            "seconds,spp,mse,relmse,relmse_trimmed,estimated_relmse,estimated_low,estimated_high,limit\n".to_string();
        Ok(ErrorLog { reference, text })
    }

    /// Adds the line of a pass.
    pub fn add(&mut self, snapshot: &Snapshot) {
        let m = metrics::compare(&rgb(snapshot.film), &self.reference);
        let seconds = snapshot.elapsed.as_secs_f64();
        let _ = write!(self.text, "{seconds:.6},{},{:e},{:e},{:e}", snapshot.spp, m.mse, m.relmse, m.relmse_trimmed);
        let _ = match snapshot.film.error_estimate() {
            Some(e) => {
                let [low, high] = e.interval;
                writeln!(self.text, ",{:e},{low:e},{high:e},{:e}", e.relmse, e.picture_limit(LIMIT_SIGMAS))
            }
            None => writeln!(self.text, ",,,,"),
        };
    }

    /// Writes the lines, all or nothing.
    pub fn write(&self, path: &Path) -> Result<()> {
        write_atomically(path, |writer| std::io::Write::write_all(writer, self.text.as_bytes()))
    }
}

/// The film's means as an EXR would hold them.
fn rgb(film: &Film) -> Vec<[f32; 3]> {
    let stored = |pixel: &crate::film::Pixel| {
        let [r, g, b, _] = pixel.mean();
        [r as f32, g as f32, b as f32]
    };
    film.pixels.iter().map(stored).collect()
}

/// The reference's pixels where the plan renders, or what is wrong with it.
fn window_of(picture: &Picture, plan: &RenderPlan) -> std::result::Result<Vec<[f32; 3]>, String> {
    let (width, height) = plan.resolution;
    if picture.display != (width as usize, height as usize) {
        let (w, h) = picture.display;
        return Err(format!("it is {w}x{h} pixels; expected {width}x{height}, the size of this render"));
    }
    let window = plan.window;
    let columns = i64::from(window.x) - picture.position.0;
    let rows = i64::from(window.y) - picture.position.1;
    let inside = |start: i64, length: u32, all: usize| start >= 0 && start + i64::from(length) <= all as i64;
    if !inside(columns, window.width, picture.width) || !inside(rows, window.height, picture.height) {
        return Err("it does not cover the window that is rendered".into());
    }
    let mut pixels = Vec::with_capacity(window.width as usize * window.height as usize);
    for y in 0..window.height as usize {
        let start = (rows as usize + y) * picture.width + columns as usize;
        pixels.extend_from_slice(&picture.rgb[start..start + window.width as usize]);
    }
    let odd = pixels.iter().filter(|pixel| !pixel.iter().all(|c| c.is_finite())).count();
    if odd > 0 {
        return Err(format!("{odd} of its pixels are not finite; nothing can be held against them"));
    }
    Ok(pixels)
}
