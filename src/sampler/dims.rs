//! The one place where dimension sets are numbered. A set is four numbers; an effect that is off never shifts the
//! numbers of another.

/// Pixel x, pixel y, lens u, lens v.
pub const CAMERA: u32 = 0;
/// Of a light path: light, point u, point v, ball that it is aimed at. (They have seeds of their own.)
pub const LIGHT: u32 = 0;
/// Shutter time, wavelength; direction u, direction v of a light path.
pub const TIME: u32 = 1;
/// Sets that each bounce owns.
pub const PER_BOUNCE: u32 = 2;

/// Light choice, light u, light v, roulette of the bounce at path vertex `vertex` (1 is the first surface).
#[inline(always)]
pub fn light(vertex: u32) -> u32 {
    PER_BOUNCE * vertex
}

/// Lobe choice, BSDF u, BSDF v, material choice of the bounce at path vertex `vertex`.
#[inline(always)]
pub fn bsdf(vertex: u32) -> u32 {
    PER_BOUNCE * vertex + 1
}

/// Sets for surfaces that are there by chance: this bit, the vertex before them, and a quarter of their number on the
/// edge.
const ALPHA: u32 = 1 << 31;
/// Bits of that quarter; the vertex takes the 16 between.
const ALPHA_BITS: u32 = 15;

/// Surfaces that one ray can pass with separate random numbers; the next one counts as met.
pub const MOST_PASSED: u32 = 4 << ALPHA_BITS;

/// Sets for distances in media: this bit, the vertex before them, and the number of the stretch on the edge.
const MEDIUM: u32 = 1 << 30;
/// Bits of that number; the vertex takes the 16 above.
const MEDIUM_BITS: u32 = 14;

/// Number of the last stretch of an edge, up to what the path meets.
pub const LAST_STRETCH: u32 = (1 << MEDIUM_BITS) - 1;

/// Choice of a channel and a distance in stretch `number` of the way to path vertex `vertex`, two spare. Stretches
/// beyond the number of bits share a set.
#[inline(always)]
pub fn medium(vertex: u32, number: u32) -> u32 {
    let number = if number == LAST_STRETCH { number } else { number % LAST_STRETCH };
    MEDIUM | (vertex - 1) << MEDIUM_BITS | number
}

/// Set, and number within it, that decides whether a ray meets surface `passed` (from 0) of the way to path vertex
/// `vertex`. Each surface has its own number. `None` from [`MOST_PASSED`] on.
#[inline(always)]
pub fn alpha(vertex: u32, passed: u32) -> Option<(u32, usize)> {
    let set = ALPHA | (vertex - 1) << ALPHA_BITS | passed >> 2;
    (passed < MOST_PASSED).then_some((set, passed as usize % 4))
}
