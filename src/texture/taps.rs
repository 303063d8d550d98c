//! Which texels a look-up reads, and their weights.
//!
//! Source: glTF 2.0 §3.8.4: v = 0 is the top row, texel centres lie at (i + ½)/width. Coordinates that are not finite
//! are taken as 0. Limit: a coordinate of 10⁶ keeps only four bits of its fraction in f32, so that such textures look
//! blocky.

use glam::{Vec2, Vec4};

/// How texture coordinates outside [0,1) are folded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// glTF 10497.
    Repeat,
    /// glTF 33648.
    MirroredRepeat,
    /// glTF 33071.
    ClampToEdge,
}

/// How coordinates become texels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sampler {
    pub(super) wrap_u: Wrap,
    pub(super) wrap_v: Wrap,
    pub(super) bilinear: bool,
}

/// The texels that a look-up reads, and their weights.
#[derive(Clone, Copy, Debug)]
pub(super) struct Taps {
    pub(super) columns: [usize; 2],
    pub(super) rows: [usize; 2],
    /// Of the second column and of the second row; 0 without interpolation.
    right_weight: f32,
    bottom_weight: f32,
    bilinear: bool,
}

impl Taps {
    /// For a level of that size.
    #[inline(always)]
    pub(super) fn new(sampler: Sampler, width: usize, height: usize, uv: Vec2) -> Self {
        let bilinear = u32::from(sampler.bilinear);
        let x = Pair::new(uv.x, width as i32, sampler.wrap_u as u32, bilinear);
        let y = Pair::new(uv.y, height as i32, sampler.wrap_v as u32, bilinear);
        Taps {
            columns: [x.first as usize, x.second as usize],
            rows: [y.first as usize, y.second as usize],
            right_weight: x.weight,
            bottom_weight: y.weight,
            bilinear: sampler.bilinear,
        }
    }

    /// The weighted mean of what `texel` says.
    #[inline(always)]
    pub(super) fn mix(&self, texel: impl Fn(usize, usize) -> Vec4) -> Vec4 {
        let ([left, right], [top, bottom]) = (self.columns, self.rows);
        if !self.bilinear {
            return texel(left, top);
        }
        let upper = texel(left, top).lerp(texel(right, top), self.right_weight);
        let lower = texel(left, bottom).lerp(texel(right, bottom), self.right_weight);
        upper.lerp(lower, self.bottom_weight)
    }
}

/// The two columns or the two rows that a look-up reads, each at least 0 and below the size. Without branches, and all
/// in 32 bits, so that loops over many coordinates become vector code.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    pub(super) first: i32,
    pub(super) second: i32,
    /// Of the second; 0 without interpolation, where both are the same.
    pub(super) weight: f32,
}

impl Pair {
    /// At the coordinate `t` of an image of `size` columns or rows, 1 to [`MOST_TEXELS`](super::encoded::MOST_TEXELS).
    /// `wrap` is a [`Wrap`]; `bilinear` is 1 or 0.
    #[inline(always)]
    pub(super) fn new(t: f32, size: i32, wrap: u32, bilinear: u32) -> Self {
        let x = texel_coordinate(t, size, wrap);
        // Texel centres lie half a texel inside.
        let shifted = if bilinear != 0 { x - 0.5 } else { x };
        let floor = shifted.floor();
        let place = floor as i32;
        Pair {
            first: wrapped(place, size, wrap),
            second: wrapped(place + bilinear as i32, size, wrap),
            weight: if bilinear != 0 { shifted - floor } else { 0.0 },
        }
    }
}

/// `t` folded to one period and scaled to texels: [0, size], or [0, 2·size] when mirrored.
#[inline(always)]
fn texel_coordinate(t: f32, size: i32, wrap: u32) -> f32 {
    let t = if t.abs() < f32::INFINITY { t } else { 0.0 };
    // Rounding may yield the period itself (−1e-9 gives 1): `wrapped` folds that column, too.
    let repeated = t - t.floor();
    let mirrored = t - 2.0 * (0.5 * t).floor();
    let clamped = t.clamp(0.0, 1.0);
    let folded = if wrap == Wrap::Repeat as u32 { repeated } else { clamped };
    let folded = if wrap == Wrap::MirroredRepeat as u32 { mirrored } else { folded };
    folded * size as f32
}

/// Column or row of the texel numbered `place`, an integer from −1 to the period: one step outside at most, so that
/// no division is needed.
#[inline(always)]
fn wrapped(place: i32, size: i32, wrap: u32) -> i32 {
    let period = if wrap == Wrap::MirroredRepeat as u32 { 2 * size } else { size };
    let above = if place >= period { place - period } else { place };
    let folded = if place < 0 { place + period } else { above };
    // The second half of a mirrored period runs backwards.
    let folded = if folded < size { folded } else { period - 1 - folded };
    // Not `clamp`, whose check of the bounds is a branch.
    if wrap == Wrap::ClampToEdge as u32 { place.max(0).min(size - 1) } else { folded }
}
