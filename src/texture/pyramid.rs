//! Coarser levels of an image: each is half its predecessor, rounded down, and a texel is the mean over the area that it
//! covers, in linear values. Levels are stored as the image is, so that those of a tiled copy are the same bits.

use super::ColorSpace;
use super::plane::Level;
use super::srgb::{SRGB_TO_LINEAR, linear_to_srgb, srgb_to_linear};

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

/// Every level below an image of that size, by `next`.
pub(super) fn levels<T>(
    size: (usize, usize),
    base: &[T],
    next: impl Fn((usize, usize), &[T]) -> Level<T>,
) -> Vec<Level<T>> {
    let mut levels: Vec<Level<T>> = Vec::new();
    loop {
        let (size, texels) = match levels.last() {
            Some((width, height, texels)) => ((*width, *height), texels.as_slice()),
            None => (size, base),
        };
        if size.0.max(size.1) <= 1 {
            return levels;
        }
        let level = next(size, texels);
        levels.push(level);
    }
}

/// The next level of an image of 8 bits.
pub(super) fn halved_eight(width: usize, height: usize, from: &[[u8; 4]], color_space: ColorSpace) -> Level<[u8; 4]> {
    let linear = |[r, g, b, a]: [u8; 4]| {
        let rgb = [r, g, b].map(|c| match color_space {
            ColorSpace::Srgb => f64::from(SRGB_TO_LINEAR[usize::from(c)]),
            ColorSpace::Linear => f64::from(c) / 255.0,
        });
        [rgb[0], rgb[1], rgb[2], f64::from(a) / 255.0]
    };
    let to = next_size(width, height);
    let mut next = Vec::with_capacity(to.0 * to.1);
    average(
        (width, height),
        to,
        |i| linear(from[i]),
        |[r, g, b, a]| {
            let coded = |x: f64| (255.0 * x + 0.5) as u8;
            let rgb = [r, g, b].map(|x| coded(if color_space == ColorSpace::Srgb { linear_to_srgb(x) } else { x }));
            next.push([rgb[0], rgb[1], rgb[2], coded(a)]);
        },
    );
    (to.0, to.1, next)
}

/// The next level of an image of floats. `encoded` says that colours are encoded by the sRGB curve.
pub(super) fn halved_float(width: usize, height: usize, from: &[[f32; 4]], encoded: bool) -> Level<[f32; 4]> {
    let linear = |t: [f32; 4]| match encoded {
        true => [srgb_to_linear(t[0]), srgb_to_linear(t[1]), srgb_to_linear(t[2]), t[3]].map(f64::from),
        false => t.map(f64::from),
    };
    let to = next_size(width, height);
    let mut next = Vec::with_capacity(to.0 * to.1);
    average(
        (width, height),
        to,
        |i| linear(from[i]),
        |[r, g, b, a]| {
            let rgb = [r, g, b].map(|x| if encoded { linear_to_srgb(x) } else { x });
            next.push([rgb[0], rgb[1], rgb[2], a].map(|x| x as f32));
        },
    );
    (to.0, to.1, next)
}

fn next_size(width: usize, height: usize) -> (usize, usize) {
    ((width / 2).max(1), (height / 2).max(1))
}

fn average(
    (width, height): (usize, usize),
    (next_width, next_height): (usize, usize),
    texel: impl Fn(usize) -> [f64; 4],
    mut put: impl FnMut([f64; 4]),
) {
    let columns: Vec<Span> = (0..next_width).map(|i| Span::of(i, next_width, width)).collect();
    for row in 0..next_height {
        let rows = Span::of(row, next_height, height);
        for columns in &columns {
            let (mut sum, mut total) = ([0.0; 4], 0.0);
            for y in rows.first..=rows.last {
                for x in columns.first..=columns.last {
                    let weight = rows.weight(y) * columns.weight(x);
                    let value = texel(y * width + x);
                    for c in 0..4 {
                        sum[c] += weight * value[c];
                    }
                    total += weight;
                }
            }
            put(sum.map(|sum| sum / total));
        }
    }
}
