//! Texture look-ups: what [`scene::Texture`](crate::scene::Texture) is at a texture coordinate, in linear values.
//!
//! Source: glTF 2.0 §3.8.4: v = 0 is the top row, texel centres lie at (i + ½)/width. sRGB is decoded before filtering.
//! Coordinates that are not finite are taken as 0. Limits: no minification filter; a coordinate of 10⁶ keeps only four bits
//! of its fraction in f32, so that such textures look blocky.

mod srgb;

use glam::{Vec2, Vec4};

use crate::scene::{ColorSpace, Texture, Wrap};
pub use srgb::SRGB_TO_LINEAR;

/// Value of a texture at `uv`: RGB in linear units, alpha as stored, all within 0 and 1.
#[inline]
pub fn lookup(texture: &Texture, uv: Vec2) -> Vec4 {
    let x = texel_coordinate(uv.x, texture.width, texture.wrap_u);
    let y = texel_coordinate(uv.y, texture.height, texture.wrap_v);
    if !texture.bilinear {
        let (column, row) =
            (wrapped(x.floor(), texture.width, texture.wrap_u), wrapped(y.floor(), texture.height, texture.wrap_v));
        return texel(texture, column, row);
    }
    // Texel centres lie half a texel inside.
    let (x, y) = (x - 0.5, y - 0.5);
    let (left, top) = (x.floor(), y.floor());
    let columns = [wrapped(left, texture.width, texture.wrap_u), wrapped(left + 1.0, texture.width, texture.wrap_u)];
    let rows = [wrapped(top, texture.height, texture.wrap_v), wrapped(top + 1.0, texture.height, texture.wrap_v)];
    let (right_weight, bottom_weight) = (x - left, y - top);
    let upper = texel(texture, columns[0], rows[0]).lerp(texel(texture, columns[1], rows[0]), right_weight);
    let lower = texel(texture, columns[0], rows[1]).lerp(texel(texture, columns[1], rows[1]), right_weight);
    upper.lerp(lower, bottom_weight)
}

/// `t` folded to one period and scaled to texels: [0, size], or [0, 2·size] when mirrored.
#[inline(always)]
fn texel_coordinate(t: f32, size: usize, wrap: Wrap) -> f32 {
    let t = if t.is_finite() { t } else { 0.0 };
    let folded = match wrap {
        // Rounding may yield the period itself (−1e-9 gives 1): `wrapped` folds that column, too.
        Wrap::Repeat => t - t.floor(),
        Wrap::MirroredRepeat => t - 2.0 * (0.5 * t).floor(),
        Wrap::ClampToEdge => t.clamp(0.0, 1.0),
    };
    folded * size as f32
}

/// Column or row of the texel numbered `place`, an integer from −1 to the period: one step outside at most, so that no
/// division is needed.
#[inline(always)]
fn wrapped(place: f32, size: usize, wrap: Wrap) -> usize {
    let (place, size) = (place as i64, size as i64);
    let period = if wrap == Wrap::MirroredRepeat { 2 * size } else { size };
    let folded = match wrap {
        Wrap::ClampToEdge => place.clamp(0, size - 1),
        _ if place < 0 => place + period,
        _ if place >= period => place - period,
        _ => place,
    };
    // The second half of a mirrored period runs backwards.
    if folded < size { folded as usize } else { (period - 1 - folded) as usize }
}

#[inline(always)]
fn texel(texture: &Texture, column: usize, row: usize) -> Vec4 {
    const STEP: f32 = 1.0 / 255.0;
    let [r, g, b, a] = texture.texels[row * texture.width + column];
    let rgb = match texture.color_space {
        ColorSpace::Srgb => [r, g, b].map(|channel| SRGB_TO_LINEAR[usize::from(channel)]),
        ColorSpace::Linear => [r, g, b].map(|channel| f32::from(channel) * STEP),
    };
    Vec4::new(rgb[0], rgb[1], rgb[2], f32::from(a) * STEP)
}
