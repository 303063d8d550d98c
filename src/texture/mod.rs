//! Textures: decoding, where texels are kept, and look-ups in linear values.
//!
//! Source: glTF 2.0 §3.8.4: v = 0 is the top row, texel centres lie at (i + ½)/width. The sRGB curve is decoded before anything is
//! averaged (§3.9.2: "To achieve correct filtering, the transfer function SHOULD be decoded before performing linear interpolation").
//! Coordinates that are not finite are taken as 0. Limit: a coordinate of 10⁶ keeps only four bits of its fraction in f32, so
//! that such textures look blocky.

mod crates;
pub mod decode;
mod lanes;
pub mod load;
#[cfg(feature = "oiio")]
#[allow(unsafe_code)] // Fence 2 of 5: the shim over OpenImageIO.
pub mod oiio;
mod plane;
mod pyramid;
#[cfg(feature = "oiio")]
mod scratch;
mod srgb;
mod stats;
#[cfg(feature = "oiio")]
pub mod stored;
mod texels;
pub mod udim;
mod weave;

use glam::{Vec2, Vec4};

pub use lanes::lookup_lanes;
pub use plane::Plane;
pub use srgb::SRGB_TO_LINEAR;
pub use stats::{TextureStats, take_lookups};
pub use texels::{ColorSpace, Rows, Texels, Texture, Wrap};
pub use weave::weave;

/// Value of a texture at `uv`: RGB in linear units, alpha as stored; all within 0 and 1 unless the image holds floats.
#[inline]
pub fn lookup(texture: &Texture, uv: Vec2) -> Vec4 {
    stats::count_lookup();
    lookup_base(texture, uv)
}

/// [`lookup`] that is not counted.
#[inline(always)]
fn lookup_base(texture: &Texture, uv: Vec2) -> Vec4 {
    match (&texture.texels, texture.color_space) {
        (Texels::Eight(plane), ColorSpace::Linear) => {
            Taps::new(texture, texture.width, texture.height, uv).mix(|x, y| linear(plane.at(y * texture.width + x)))
        }
        (Texels::Eight(plane), ColorSpace::Srgb) => {
            Taps::new(texture, texture.width, texture.height, uv).mix(|x, y| srgb(plane.at(y * texture.width + x)))
        }
        (Texels::Float(plane), _) => Taps::new(texture, texture.width, texture.height, uv)
            .mix(|x, y| Vec4::from_array(plane.at(y * texture.width + x))),
        _ => lookup_elsewhere(texture, uv),
    }
}

/// As [`lookup`], averaged over a width in texture coordinates: the two levels of the pyramid between whose texels it lies, mixed
/// in proportion (trilinear). [`Texture::make_levels`] was called before; without levels it is [`lookup`].
pub fn lookup_filtered(texture: &Texture, uv: Vec2, width: f32) -> Vec4 {
    if let Texels::Udim(udim) = &texture.texels {
        return udim.at(uv).map_or(udim::Udim::ABSENT, |(page, uv)| lookup_filtered(page, uv, width));
    }
    // Texels along the width, in the mean over directions. NaN and what is smaller than a texel need no average.
    let texels = width * ((texture.width * texture.height) as f32).sqrt();
    let coarsest = texture.coarsest_level();
    if !(texels > 1.0) || coarsest == 0 {
        return lookup(texture, uv);
    }
    stats::count_lookup();
    let level = texels.log2().min(coarsest as f32);
    let finer = level as usize;
    let value = lookup_level(texture, finer, uv);
    let rest = level - finer as f32;
    if rest > 0.0 { value.lerp(lookup_level(texture, finer + 1, uv), rest) } else { value }
}

fn lookup_level(texture: &Texture, level: usize, uv: Vec2) -> Vec4 {
    let Some(coarser) = level.checked_sub(1) else { return lookup_base(texture, uv) };
    match &texture.texels {
        Texels::Eight(plane) => {
            let (width, height, texels) = &plane.levels()[coarser];
            let taps = Taps::new(texture, *width, *height, uv);
            match texture.color_space {
                ColorSpace::Linear => taps.mix(|x, y| linear(texels[y * width + x])),
                ColorSpace::Srgb => taps.mix(|x, y| srgb(texels[y * width + x])),
            }
        }
        Texels::Float(plane) => {
            let (width, height, texels) = &plane.levels()[coarser];
            Taps::new(texture, *width, *height, uv).mix(|x, y| Vec4::from_array(texels[y * width + x]))
        }
        #[cfg(feature = "oiio")]
        Texels::Stored(stored) => stored.lookup_level(texture, level, uv),
        Texels::Udim(_) => lookup(texture, uv),
    }
}

/// As [`lookup`], for texels that are not in memory or in several images.
#[inline(never)]
fn lookup_elsewhere(texture: &Texture, uv: Vec2) -> Vec4 {
    match &texture.texels {
        #[cfg(feature = "oiio")]
        Texels::Stored(stored) => stored.lookup(texture, uv),
        Texels::Udim(udim) => match udim.at(uv) {
            Some((page, uv)) => lookup(page, uv),
            None => udim::Udim::ABSENT,
        },
        _ => unreachable!("texels in memory are looked up above"),
    }
}

#[inline(always)]
fn linear(texel: [u8; 4]) -> Vec4 {
    const STEP: f32 = 1.0 / 255.0;
    Vec4::from_array(texel.map(f32::from)) * STEP
}

#[inline(always)]
fn srgb([r, g, b, a]: [u8; 4]) -> Vec4 {
    const STEP: f32 = 1.0 / 255.0;
    let [r, g, b] = [r, g, b].map(|channel| SRGB_TO_LINEAR[usize::from(channel)]);
    Vec4::new(r, g, b, f32::from(a) * STEP)
}

/// The texels that a look-up reads, and their weights.
#[derive(Clone, Copy, Debug)]
struct Taps {
    columns: [usize; 2],
    rows: [usize; 2],
    /// Of the second column and of the second row; 0 without interpolation.
    right_weight: f32,
    bottom_weight: f32,
    bilinear: bool,
}

impl Taps {
    /// For a level of that size.
    #[inline(always)]
    fn new(texture: &Texture, width: usize, height: usize, uv: Vec2) -> Self {
        let bilinear = u32::from(texture.bilinear);
        let x = Pair::new(uv.x, width as i32, texture.wrap_u as u32, bilinear);
        let y = Pair::new(uv.y, height as i32, texture.wrap_v as u32, bilinear);
        Taps {
            columns: [x.first as usize, x.second as usize],
            rows: [y.first as usize, y.second as usize],
            right_weight: x.weight,
            bottom_weight: y.weight,
            bilinear: texture.bilinear,
        }
    }

    /// The weighted mean of what `texel` says.
    #[inline(always)]
    fn mix(&self, texel: impl Fn(usize, usize) -> Vec4) -> Vec4 {
        let ([left, right], [top, bottom]) = (self.columns, self.rows);
        if !self.bilinear {
            return texel(left, top);
        }
        let upper = texel(left, top).lerp(texel(right, top), self.right_weight);
        let lower = texel(left, bottom).lerp(texel(right, bottom), self.right_weight);
        upper.lerp(lower, self.bottom_weight)
    }
}

/// The two columns or the two rows that a look-up reads, each at least 0 and below the size. Without branches, and all in
/// 32 bits, so that loops over many coordinates become vector code.
#[derive(Clone, Copy, Debug)]
struct Pair {
    first: i32,
    second: i32,
    /// Of the second; 0 without interpolation, where both are the same.
    weight: f32,
}

impl Pair {
    /// At the coordinate `t` of an image of `size` columns or rows, 1 to [`decode::MOST_TEXELS`]. `wrap` is a [`Wrap`];
    /// `bilinear` is 1 or 0.
    #[inline(always)]
    fn new(t: f32, size: i32, wrap: u32, bilinear: u32) -> Self {
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

/// Column or row of the texel numbered `place`, an integer from −1 to the period: one step outside at most, so that no
/// division is needed.
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
