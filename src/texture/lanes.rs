//! Look-ups of many points at once, in columns: first where every texel lies, then all texels, then arithmetic. The
//! loads of one point depend on nothing that another point reads, so the waits for memory overlap; most of a look-up is
//! such a wait.
//!
//! Images of 8 bits in memory are read here, with the numbers of [`lookup`]; points in other ones are looked up by it.

use glam::Vec2;

use super::color::{ColorSpace, SRGB_TO_LINEAR};
use super::lookup::lookup;
use super::plane::Plane;
use super::stats::count_lookups;
use super::taps::{Pair, Wrap};
use super::texels::{Texels, Texture};

/// What lanes without an image read.
const NOTHING: &[[u8; 4]] = &[[0; 4]];

/// The images of `N` lanes as columns.
struct Planes<'a, const N: usize> {
    texels: [&'a [[u8; 4]]; N],
    /// Of [`Plane`].
    stride: [u32; N],
    offset: [u32; N],
    width: [i32; N],
    height: [i32; N],
    wrap_u: [u32; N],
    wrap_v: [u32; N],
    bilinear: [u32; N],
}

/// R, G and B of [`lookup`] for each lane that has a texture; any value in the others. `color_space` is that of most of
/// the textures.
#[inline(always)]
pub fn lookup_lanes<const N: usize>(
    textures: &[Option<&Texture>; N],
    color_space: ColorSpace,
    u: &[f32; N],
    v: &[f32; N],
) -> [[f32; N]; 3] {
    let mut planes = Planes {
        texels: [NOTHING; N],
        stride: [1; N],
        offset: [0; N],
        width: [1; N],
        height: [1; N],
        wrap_u: [Wrap::Repeat as u32; N],
        wrap_v: [Wrap::Repeat as u32; N],
        bilinear: [0; N],
    };
    let (mut here, mut elsewhere) = (0, false);
    for i in 0..N {
        let Some(texture) = textures[i] else { continue };
        let Some(plane) = in_columns(texture, color_space) else {
            elsewhere = true;
            continue;
        };
        planes.texels[i] = &plane.base;
        (planes.stride[i], planes.offset[i]) = (plane.stride as u32, plane.offset as u32);
        (planes.width[i], planes.height[i]) = (texture.width as i32, texture.height as i32);
        (planes.wrap_u[i], planes.wrap_v[i]) = (texture.wrap_u as u32, texture.wrap_v as u32);
        planes.bilinear[i] = u32::from(texture.bilinear);
        here += 1;
    }
    count_lookups(here);
    let mut rgb = planes.mix(color_space, u, v);
    if elsewhere {
        for i in 0..N {
            let Some(texture) = textures[i] else { continue };
            if in_columns(texture, color_space).is_none() {
                let value = lookup(texture, Vec2::new(u[i], v[i]));
                (rgb[0][i], rgb[1][i], rgb[2][i]) = (value.x, value.y, value.z);
            }
        }
    }
    rgb
}

/// The image of a texture that is looked up in columns: 8 bits a channel, in memory, numbered by 32 bits.
#[inline(always)]
fn in_columns(texture: &Texture, color_space: ColorSpace) -> Option<&Plane<[u8; 4]>> {
    match &texture.texels {
        Texels::Eight(plane) => {
            (texture.color_space == color_space && plane.base.len() <= u32::MAX as usize).then_some(plane)
        }
        _ => None,
    }
}

impl<const N: usize> Planes<'_, N> {
    #[inline(always)]
    fn mix(&self, color_space: ColorSpace, u: &[f32; N], v: &[f32; N]) -> [[f32; N]; 3] {
        // Numbers of the four texels: top left, top right, bottom left, bottom right.
        let mut places = [[0u32; N]; 4];
        let (mut right, mut bottom) = ([0.0; N], [0.0; N]);
        for i in 0..N {
            let x = Pair::new(u[i], self.width[i], self.wrap_u[i], self.bilinear[i]);
            let y = Pair::new(v[i], self.height[i], self.wrap_v[i], self.bilinear[i]);
            let (left, beside) = (x.first as u32, x.second as u32);
            let (upper, lower) = (y.first as u32 * self.width[i] as u32, y.second as u32 * self.width[i] as u32);
            let place = |column: u32, row: u32| (row + column) * self.stride[i] + self.offset[i];
            places[0][i] = place(left, upper);
            places[1][i] = place(beside, upper);
            places[2][i] = place(left, lower);
            places[3][i] = place(beside, lower);
            (right[i], bottom[i]) = (x.weight, y.weight);
        }
        let mut taps = [[0u32; N]; 4];
        for i in 0..N {
            for k in 0..4 {
                taps[k][i] = u32::from_le_bytes(self.texels[i][places[k][i] as usize]);
            }
        }
        let mut rgb = [[0.0; N]; 3];
        for (c, mixed) in rgb.iter_mut().enumerate() {
            let values = taps.map(|taps| decode(&taps, 8 * c as u32, color_space));
            for i in 0..N {
                let upper = values[0][i] * (1.0 - right[i]) + values[1][i] * right[i];
                let lower = values[2][i] * (1.0 - right[i]) + values[3][i] * right[i];
                mixed[i] = upper * (1.0 - bottom[i]) + lower * bottom[i];
            }
        }
        rgb
    }
}

/// Linear values of the channel that begins at bit `shift`.
#[inline(always)]
fn decode<const N: usize>(texels: &[u32; N], shift: u32, color_space: ColorSpace) -> [f32; N] {
    const STEP: f32 = 1.0 / 255.0;
    let mut values = [0.0; N];
    for i in 0..N {
        let code = texels[i] >> shift & 0xFF;
        values[i] = match color_space {
            ColorSpace::Srgb => SRGB_TO_LINEAR[code as usize],
            ColorSpace::Linear => code as i32 as f32 * STEP,
        };
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 16;

    fn texture(texels: Texels, (width, height): (usize, usize), color_space: ColorSpace) -> Texture {
        let (wrap_u, wrap_v) = (Wrap::Repeat, Wrap::Repeat);
        Texture { name: String::new(), width, height, texels, color_space, wrap_u, wrap_v, bilinear: true }
    }

    /// Oracle: one look-up after the other, every bit, over sizes, wraps, filters, kinds of texels, and coordinates at
    /// and beyond the edges, of any size or none. Deterministic.
    #[test]
    fn lanes_are_look_ups() {
        let wraps = [Wrap::Repeat, Wrap::MirroredRepeat, Wrap::ClampToEdge];
        let mut state = 1u32;
        let mut next = || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            state.rotate_right(13) ^ state
        };
        let mut textures = Vec::new();
        for size in [(1, 1), (2, 3), (5, 4), (64, 64), (17, 1)] {
            let eight: Vec<[u8; 4]> = (0..size.0 * size.1).map(|_| next().to_le_bytes()).collect();
            let floats: Vec<[f32; 4]> = eight.iter().map(|texel| texel.map(|c| f32::from(c) * 0.37)).collect();
            for color_space in [ColorSpace::Srgb, ColorSpace::Linear] {
                textures.push(texture(eight.clone().into(), size, color_space));
                textures.push(texture(floats.clone().into(), size, color_space));
            }
        }
        let special = [0.0, -0.0, 1.0, 0.5, -1e-9, 1.0 - f32::EPSILON / 2.0, 2.0, -1.0, 1e9, f32::NAN, f32::INFINITY];
        for round in 0..4000 {
            let mut coordinate = || match next() % 3 {
                0 => special[next() as usize % special.len()],
                _ => next() as f32 / u32::MAX as f32 * 6.0 - 3.0,
            };
            let u: [f32; N] = std::array::from_fn(|_| coordinate());
            let v: [f32; N] = std::array::from_fn(|_| coordinate());
            let sampled: [Texture; N] = std::array::from_fn(|_| Texture {
                wrap_u: wraps[next() as usize % 3],
                wrap_v: wraps[next() as usize % 3],
                bilinear: next() % 3 > 0,
                ..textures[next() as usize % textures.len()].clone()
            });
            let lanes: [Option<&Texture>; N] = std::array::from_fn(|i| (next() % 4 > 0).then_some(&sampled[i]));
            for color_space in [ColorSpace::Srgb, ColorSpace::Linear] {
                let rgb = lookup_lanes(&lanes, color_space, &u, &v);
                for (i, texture) in lanes.iter().enumerate() {
                    let Some(texture) = texture else { continue };
                    let expected = lookup(texture, Vec2::new(u[i], v[i])).truncate().to_array();
                    let found = [rgb[0][i], rgb[1][i], rgb[2][i]];
                    assert_eq!(found.map(f32::to_bits), expected.map(f32::to_bits), "{round}: {} {}", u[i], v[i]);
                }
            }
        }
    }
}
