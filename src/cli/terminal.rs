//! A picture in the terminal (`render --show`): half blocks, two pixels a cell, in 24-bit colour (ISO 8613-6). Cells
//! are taken to be twice as high as wide, and pictures are made smaller, never larger, by means of linear light over
//! whole pixels. What less than half covers in a transparent picture shows the terminal's own background.

use std::fmt::Write;

use super::output::write_stdout;
use crate::error::Result;
use crate::film::Film;
use crate::film::look::{Look, Preview, srgb_byte, srgb_value};

/// Columns and rows where the terminal does not say.
const USUAL: (usize, usize) = (80, 24);

/// Draws the film on stdout.
///
/// # Errors
/// As [`Look::preview`]; those of stdout.
pub fn show(film: &Film, look: &Look) -> Result<()> {
    let (columns, rows) = rustix::termios::tcgetwinsize(std::io::stdout())
        .ok()
        .map(|size| (usize::from(size.ws_col), usize::from(size.ws_row)))
        .filter(|(columns, rows)| *columns > 0 && *rows > 1)
        .unwrap_or(USUAL);
    // The last row is the prompt's.
    write_stdout(drawn(&look.preview(film)?, columns, rows - 1).as_bytes())
}

/// A colour, or nothing.
type Half = Option<[u8; 3]>;

/// The picture within so many columns and rows, a line for each row.
fn drawn(preview: &Preview, columns: usize, rows: usize) -> String {
    let (width, height) = (preview.width as usize, preview.height as usize);
    let scale = (columns as f64 / width as f64).min(2.0 * rows as f64 / height as f64).min(1.0);
    let side = |side: usize| ((side as f64 * scale).round() as usize).max(1);
    let (w, h) = (side(width), side(height));
    let mut text = String::new();
    for y in (0..h).step_by(2) {
        let mut colors = (None, None);
        for x in 0..w {
            let at = |y: usize| if y < h { mean(preview, (x, y), (w, h)) } else { None };
            let (cell, front, back) = match (at(y), at(y + 1)) {
                (None, None) => (' ', None, None),
                (None, below) => ('▄', below, None),
                (above, below) => ('▀', above, below),
            };
            if let Some([r, g, b]) = front.filter(|_| colors.0 != front) {
                _ = write!(text, "\x1b[38;2;{r};{g};{b}m");
                colors.0 = front;
            }
            if colors.1 != back {
                _ = match back {
                    Some([r, g, b]) => write!(text, "\x1b[48;2;{r};{g};{b}m"),
                    None => write!(text, "\x1b[49m"),
                };
                colors.1 = back;
            }
            text.push(cell);
        }
        text.push_str("\x1b[0m\n");
    }
    text
}

/// What the pixel `(x, y)` of a picture of `w × h` shows of a larger one.
fn mean(preview: &Preview, (x, y): (usize, usize), (w, h): (usize, usize)) -> Half {
    let (width, height) = (preview.width as usize, preview.height as usize);
    let channels = if preview.alpha { 4 } else { 3 };
    let range = |i: usize, of: usize, side: usize| i * side / of..((i + 1) * side).div_ceil(of);
    let (mut sum, mut covered, mut pixels) = ([0.0; 3], 0.0, 0.0);
    for row in range(y, h, height) {
        for column in range(x, w, width) {
            let pixel = &preview.bytes[(row * width + column) * channels..][..channels];
            let cover = pixel.get(3).map_or(1.0, |alpha| f64::from(*alpha) / 255.0);
            (0..3).for_each(|c| sum[c] += cover * srgb_value(pixel[c]));
            (covered, pixels) = (covered + cover, pixels + 1.0);
        }
    }
    (2.0 * covered >= pixels).then(|| sum.map(|value| srgb_byte(value / covered)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::look::Backdrop;
    use crate::film::tone::ToneMap;
    use crate::render::Crop;

    /// Two columns of four rows: black, white; white, white; nothing; nothing, in linear values.
    fn film() -> Film {
        let mut film = Film::new((2, 3), Crop { x: 0, y: 0, width: 2, height: 3 });
        let values = [0.0, 1.0, 1.0, 1.0, 0.0, 0.0];
        film.pixels.iter_mut().zip(values).for_each(|(pixel, value)| pixel.add(0, [value; 3], 1.0, 1.0));
        film
    }

    /// Oracle: written by hand. A row that is left over has nothing below; the mean of black and white is code 188.
    #[test]
    fn pictures_are_drawn_in_half_blocks() {
        let preview = Look::default().tone_map(ToneMap::Clip).backdrop(Backdrop::Seen).preview(&film()).expect("seen");
        let (black, white) = ("0;0;0m", "255;255;255m");
        assert_eq!(
            drawn(&preview, 80, 24),
            format!("\x1b[38;2;{black}\x1b[48;2;{white}▀\x1b[38;2;{white}▀\x1b[0m\n\x1b[38;2;{black}▀▀\x1b[0m\n")
        );
        // One column: three rows become two of half the width.
        assert_eq!(drawn(&preview, 1, 24).matches('▀').count(), 1);
        let mixed = Preview { height: 1, bytes: preview.bytes[..6].to_vec(), ..preview.clone() };
        assert_eq!(drawn(&mixed, 1, 9), "\x1b[38;2;188;188;188m▀\x1b[0m\n");
        let clear = Preview { height: 2, alpha: true, bytes: [[0; 4], [0; 4], [9; 4], [255; 4]].concat(), ..preview };
        assert_eq!(drawn(&clear, 80, 24), " \x1b[38;2;255;255;255m▄\x1b[0m\n");
    }
}
