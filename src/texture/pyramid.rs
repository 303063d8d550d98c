//! Coarser levels of an image: each is half its predecessor, rounded down, and a texel is the mean over the area
//! that it covers, in linear values. Levels are stored as the image is, so that those of a tiled copy are the same
//! bits. Where a file's own levels end before the last, they are gone on with.

use std::ops::Range;

use super::color::{ColorSpace, SRGB_TO_LINEAR, linear_to_srgb};
use super::plane::Level;

/// A texel's sources along one axis: first and last texel, and the weights of those two; all between count 1.
struct Span {
    first: usize,
    last: usize,
    first_weight: f64,
    last_weight: f64,
}

impl Span {
    /// Of texel `i` of `to`, which cover `from`.
    fn of(i: usize, to: usize, from: usize) -> Span {
        let (begin, end) = (i * from, (i + 1) * from);
        let (first, last) = (begin / to, (end - 1) / to);
        let whole = to as f64;
        Span {
            first,
            last,
            first_weight: (((first + 1) * to).min(end) - begin) as f64 / whole,
            last_weight: (end - (last * to).max(begin)) as f64 / whole,
        }
    }

    fn weight(&self, i: usize) -> f64 {
        match i {
            _ if i == self.first => self.first_weight,
            _ if i == self.last => self.last_weight,
            _ => 1.0,
        }
    }
}

/// Every level below an image, or below the last of the levels that there are.
pub(super) fn complete<T: Copy>(
    size: (usize, usize),
    base: &[T],
    mut levels: Vec<Level<T>>,
    codec: impl Codec<T>,
) -> Vec<Level<T>> {
    loop {
        let (size, texels) = match levels.last() {
            Some((width, height, texels)) => ((*width, *height), texels.as_slice()),
            None => (size, base),
        };
        if size.0.max(size.1) <= 1 {
            return levels;
        }
        let level = halved(size, texels, codec);
        levels.push(level);
    }
}

/// How the texels of an image become linear values and back.
pub(super) trait Codec<T>: Copy {
    fn linear(self, texel: T) -> [f64; 4];
    fn coded(self, linear: [f64; 4]) -> T;
}

/// 8 bits, read in a colour space.
#[derive(Clone, Copy)]
pub(super) struct EightBits(pub(super) ColorSpace);

impl Codec<[u8; 4]> for EightBits {
    fn linear(self, [r, g, b, a]: [u8; 4]) -> [f64; 4] {
        let rgb = [r, g, b].map(|c| match self.0 {
            ColorSpace::Srgb => f64::from(SRGB_TO_LINEAR[usize::from(c)]),
            ColorSpace::Linear => f64::from(c) / 255.0,
        });
        [rgb[0], rgb[1], rgb[2], f64::from(a) / 255.0]
    }

    fn coded(self, [r, g, b, a]: [f64; 4]) -> [u8; 4] {
        let coded = |x: f64| (255.0 * x + 0.5) as u8;
        let rgb = [r, g, b].map(|x| coded(if self.0 == ColorSpace::Srgb { linear_to_srgb(x) } else { x }));
        [rgb[0], rgb[1], rgb[2], coded(a)]
    }
}

/// Floats that are linear already.
#[derive(Clone, Copy)]
pub(super) struct Floats;

impl Codec<[f32; 4]> for Floats {
    fn linear(self, texel: [f32; 4]) -> [f64; 4] {
        texel.map(f64::from)
    }

    fn coded(self, linear: [f64; 4]) -> [f32; 4] {
        linear.map(|x| x as f32)
    }
}

/// The next level of an image.
pub(super) fn halved<T: Copy>(size: (usize, usize), from: &[T], codec: impl Codec<T>) -> Level<T> {
    let to = next_size(size);
    let mut next = Vec::with_capacity(to.0 * to.1);
    average(size, 0..to.1, (0, from), codec, &mut next);
    (to.0, to.1, next)
}

/// As [`halved`] of an image that is not in memory: `rows` reads some of its rows.
#[cfg(feature = "oiio")]
pub(super) fn halved_from<T: Copy>(
    size: (usize, usize),
    codec: impl Codec<T>,
    mut rows: impl FnMut(Range<usize>) -> Result<Vec<T>, String>,
) -> Result<Level<T>, String> {
    /// Rows that are made at a time.
    const STEP: usize = 64;
    let to = next_size(size);
    let mut next = Vec::new();
    next.try_reserve_exact(to.0 * to.1).map_err(|_| "no memory for its coarser levels".to_owned())?;
    for first in (0..to.1).step_by(STEP) {
        let end = (first + STEP).min(to.1);
        let from = Span::of(first, to.1, size.1).first..Span::of(end - 1, to.1, size.1).last + 1;
        average(size, first..end, (from.start, &rows(from)?), codec, &mut next);
    }
    Ok((to.0, to.1, next))
}

fn next_size((width, height): (usize, usize)) -> (usize, usize) {
    ((width / 2).max(1), (height / 2).max(1))
}

/// Some rows of the next level. `from` are texels of the image, from the row on that is named.
fn average<T: Copy>(
    size: (usize, usize),
    rows: Range<usize>,
    (first_row, from): (usize, &[T]),
    codec: impl Codec<T>,
    next: &mut Vec<T>,
) {
    let (next_width, next_height) = next_size(size);
    let columns: Vec<Span> = (0..next_width).map(|i| Span::of(i, next_width, size.0)).collect();
    for row in rows {
        let rows = Span::of(row, next_height, size.1);
        for columns in &columns {
            let (mut sum, mut total) = ([0.0; 4], 0.0);
            for y in rows.first..=rows.last {
                for x in columns.first..=columns.last {
                    let weight = rows.weight(y) * columns.weight(x);
                    let value = codec.linear(from[(y - first_row) * size.0 + x]);
                    for c in 0..4 {
                        sum[c] += weight * value[c];
                    }
                    total += weight;
                }
            }
            next.push(codec.coded(sum.map(|sum| sum / total)));
        }
    }
}
