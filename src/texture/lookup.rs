//! Look-ups of one point, in linear values.
//!
//! Source: the sRGB curve is decoded before anything is averaged (glTF 2.0 §3.9.2: "To achieve correct filtering, the
//! transfer function SHOULD be decoded before performing linear interpolation").

use glam::{Vec2, Vec4};

use super::color::{ColorSpace, linear, srgb};
use super::stats::count_lookup;
use super::taps::Taps;
use super::texels::{Texels, Texture};
use super::udim;

/// Value of a texture at `uv`: RGB in linear units, alpha as stored; all within 0 and 1 unless the image holds floats.
#[inline]
pub fn lookup(texture: &Texture, uv: Vec2) -> Vec4 {
    count_lookup();
    lookup_base(texture, uv)
}

/// [`lookup`] that is not counted.
#[inline(always)]
fn lookup_base(texture: &Texture, uv: Vec2) -> Vec4 {
    match (&texture.texels, texture.color_space) {
        (Texels::Eight(plane), ColorSpace::Linear) => Taps::new(texture.sampler(), texture.width, texture.height, uv)
            .mix(|x, y| linear(plane.at(y * texture.width + x))),
        (Texels::Eight(plane), ColorSpace::Srgb) => Taps::new(texture.sampler(), texture.width, texture.height, uv)
            .mix(|x, y| srgb(plane.at(y * texture.width + x))),
        (Texels::Float(plane), _) => Taps::new(texture.sampler(), texture.width, texture.height, uv)
            .mix(|x, y| Vec4::from_array(plane.at(y * texture.width + x))),
        _ => lookup_elsewhere(texture, uv),
    }
}

/// As [`lookup`], averaged over a width in texture coordinates: the two levels of the pyramid between whose texels it
/// lies, mixed in proportion (trilinear). [`Texture::make_levels`] was called before; without levels it is [`lookup`].
pub fn lookup_filtered(texture: &Texture, uv: Vec2, width: f32) -> Vec4 {
    if let Texels::Udim(udim) = &texture.texels {
        return udim.at(uv).map_or(udim::ABSENT, |(page, uv)| lookup_filtered(page, uv, width));
    }
    // Texels along the width, in the mean over directions. NaN and what is smaller than a texel need no average.
    let texels = width * ((texture.width * texture.height) as f32).sqrt();
    let coarsest = texture.coarsest_level();
    if !(texels > 1.0) || coarsest == 0 {
        return lookup(texture, uv);
    }
    count_lookup();
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
            let taps = Taps::new(texture.sampler(), *width, *height, uv);
            match texture.color_space {
                ColorSpace::Linear => taps.mix(|x, y| linear(texels[y * width + x])),
                ColorSpace::Srgb => taps.mix(|x, y| srgb(texels[y * width + x])),
            }
        }
        Texels::Float(plane) => {
            let (width, height, texels) = &plane.levels()[coarser];
            Taps::new(texture.sampler(), *width, *height, uv).mix(|x, y| Vec4::from_array(texels[y * width + x]))
        }
        Texels::Stored(stored) => stored.lookup_level(texture.sampler(), texture.color_space, level, uv),
        Texels::Udim(_) => lookup(texture, uv),
    }
}

/// As [`lookup`], for texels that are not in memory or in several images.
#[inline(never)]
fn lookup_elsewhere(texture: &Texture, uv: Vec2) -> Vec4 {
    match &texture.texels {
        Texels::Stored(stored) => stored.lookup_level(texture.sampler(), texture.color_space, 0, uv),
        Texels::Udim(udim) => match udim.at(uv) {
            Some((page, uv)) => lookup(page, uv),
            None => udim::ABSENT,
        },
        _ => unreachable!("texels in memory are looked up above"),
    }
}
