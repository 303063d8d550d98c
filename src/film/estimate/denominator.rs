//! What stands in for the converged pixel R in the denominators of relMSE, from the film alone; units of radiance.
//!
//! The pixel's own mean is no substitute: one that caught a rare bright sample has a large v *and* a large mean, and
//! dividing the one by the other hides exactly the error that is largest (0.1 to 0.9 of the true relMSE). The pixels
//! around are none where lights and edges are: 0.5 to 200 times. R is therefore taken as Lee's filter (1980) takes it,
//! between the mean p of the 5×5 pixels around and the pixel's own value h, here the harmonic mean of its halves,
//! which a bright sample in one of them does not raise:
//!
//!   R = p + w·(h − p),  w = max(0, 1 − Σv/Σ(h − p)²), sums over the channels.
//!
//! Where the difference to the surroundings is noise, R is the surroundings; at an edge that stands out of the noise it
//! is the pixel. The error of this is of second order in the noise, so that it vanishes with the samples.

use crate::film::layer::beauty::Pixel;

/// ε of relMSE as a fraction of the squared mean of the reference.
pub const RELMSE_EPSILON: f64 = 0.01;

/// Pixels to each side whose mean stands in for the reference.
const SURROUNDINGS: usize = 2;

/// Means of R, G, B and a 1 for a pixel with samples, zeros for others.
pub(super) fn sampled_mean(pixel: &Pixel) -> [f32; 4] {
    let [r, g, b, _] = pixel.mean();
    if pixel.samples() > 0 { [r as f32, g as f32, b as f32, 1.0] } else { [0.0; 4] }
}

/// Sums `own` over the rows around row `y`, column by column.
pub(super) fn sum_columns(own: &[[f32; 4]], y: usize, columns: &mut [[f64; 4]]) {
    let width = columns.len();
    let rows = y.saturating_sub(SURROUNDINGS)..(y + SURROUNDINGS + 1).min(own.len() / width);
    columns.fill([0.0; 4]);
    for row in own[rows.start * width..rows.end * width].chunks_exact(width) {
        for (sum, value) in columns.iter_mut().zip(row) {
            *sum = plus(*sum, value.map(f64::from));
        }
    }
}

/// The means of a pixel's halves, and what each contributes to the pixel.
pub(super) struct Halves {
    /// Mean of R, G, B over the even samples, and over the odd ones.
    pub a: [f64; 3],
    pub b: [f64; 3],
    /// Shares of the halves in the samples.
    pub shares: [f64; 2],
}

impl Halves {
    /// `None` until both halves have samples.
    #[inline(always)]
    pub fn of(pixel: &Pixel) -> Option<Self> {
        let [n0, n1] = pixel.n.map(|n| n as f64);
        if n0 == 0.0 || n1 == 0.0 {
            return None;
        }
        let (inverse, total) = ([1.0 / n0, 1.0 / n1], 1.0 / (n0 + n1));
        let mean = |half: usize| std::array::from_fn(|c| pixel.sum[half][c] * inverse[half]);
        Some(Halves { a: mean(0), b: mean(1), shares: [n0 * total, n1 * total] })
    }
}

/// Mean of R, G, B over the sampled pixels around column `x` and in it.
#[inline(always)]
pub(super) fn surroundings(columns: &[[f64; 4]], x: usize) -> [f64; 3] {
    let around = &columns[x.saturating_sub(SURROUNDINGS)..(x + SURROUNDINGS + 1).min(columns.len())];
    let sum = around.iter().fold([0.0; 4], |sum, value| plus(sum, *value));
    let inverse = 1.0 / sum[3];
    std::array::from_fn(|c| sum[c] * inverse)
}

/// The same without the pixel itself, whose own values are `own`; `None` where there is no other.
#[inline(always)]
pub(super) fn surroundings_apart(columns: &[[f64; 4]], x: usize, own: &[f32; 4]) -> Option<[f64; 3]> {
    let around = &columns[x.saturating_sub(SURROUNDINGS)..(x + SURROUNDINGS + 1).min(columns.len())];
    let sum = around.iter().fold([0.0; 4], |sum, value| plus(sum, *value));
    let others = sum[3] - f64::from(own[3]);
    (others > 0.5).then(|| std::array::from_fn(|c| (sum[c] - f64::from(own[c])) / others))
}

/// What stands in for the converged pixel of halves `a` and `b`: between the surroundings and the harmonic mean of the
/// halves, by Lee's weight.
#[inline(always)]
pub(super) fn reference(a: [f64; 3], b: [f64; 3], around: [f64; 3], variance: [f64; 3]) -> [f64; 3] {
    let own: [f64; 3] = std::array::from_fn(|c| {
        let product = a[c] * b[c];
        if product > 0.0 { 2.0 * product / (a[c] + b[c]) } else { 0.0 }
    });
    let (mut noise, mut difference) = (0.0, 0.0);
    for c in 0..3 {
        noise += variance[c];
        difference += (own[c] - around[c]).powi(2);
    }
    let weight = if difference > noise { 1.0 - noise / difference } else { 0.0 };
    std::array::from_fn(|c| around[c] + weight * (own[c] - around[c]))
}

#[inline(always)]
fn plus(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Film;
    use crate::plan::options::Crop;

    #[test]
    fn surroundings_stop_at_the_border_and_at_pixels_without_samples() {
        let mut film = Film::new((7, 4), Crop { x: 0, y: 0, width: 7, height: 4 });
        for (i, pixel) in film.pixels.iter_mut().enumerate() {
            pixel.add(0, [i as f32, 1.0, 0.0], 1.0, 1.0);
        }
        film.pixels[1] = Default::default();
        let own: Vec<[f32; 4]> = film.pixels.iter().map(sampled_mean).collect();
        let mut columns = [[0.0; 4]; 7];
        sum_columns(&own, 0, &mut columns);
        // Corner: columns and rows 0 to 2 without the pixel that has no samples.
        let expected: f64 = [0, 2, 7, 8, 9, 14, 15, 16].iter().map(|&i| f64::from(i)).sum();
        assert_eq!(surroundings(&columns, 0), [expected * 0.125, 1.0, 0.0]);
        sum_columns(&own, 1, &mut columns);
        assert_eq!(columns.iter().map(|c| c[3]).collect::<Vec<_>>(), [4.0, 3.0, 4.0, 4.0, 4.0, 4.0, 4.0]);
    }

    #[test]
    fn the_reference_is_the_pixel_at_an_edge_and_the_surroundings_under_a_bright_sample() {
        let of = |a: f64, b: f64| {
            let variance = f64::powi(a - b, 2) / 4.0;
            reference([a; 3], [b; 3], [1.0; 3], [variance; 3])[0]
        };
        // An edge: 10 ± 0.1 among ones. A bright sample: one half is as dark as the surroundings.
        assert!((of(10.1, 9.9) - 10.0).abs() < 0.02, "{}", of(10.1, 9.9));
        assert_eq!(of(1000.0, 1.0), 1.0);
        assert_eq!(of(0.0, 0.0), 0.0);
    }
}
