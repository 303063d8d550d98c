//! The one place where dimension sets are numbered. A set is four numbers; an effect that is off never shifts the
//! numbers of another.

/// Pixel x, pixel y, lens u, lens v.
pub const CAMERA: u32 = 0;
/// Shutter time, three spare.
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
