//! What a sampler is to the kernels: a type, so that their loops over lanes are compiled for it.

/// A sampler as a type, so that loops over lanes are compiled for it.
pub trait Scheme {
    /// Whether renders in production use it, so that loops over lanes are compiled for wider registers as well.
    const WIDE: bool;

    /// Point `index` of dimension set `set` under the seed of `pixel_seed`; each component in [0,1).
    fn sample_4d(index: u32, seed: [u32; 2], set: u32) -> [f32; 4];
}

/// The top 24 bits as a float in [0,1): exact, and never 1 (HARDCASES R01).
#[inline(always)]
pub fn unit_float(bits: u32) -> f32 {
    /// 2⁻²⁴: a 24-bit integer is exact in f32, and so is its product with a power of two.
    const SCALE: f32 = 1.0 / (1 << 24) as f32;
    // By way of i32, whose conversion is one instruction.
    (bits >> 8) as i32 as f32 * SCALE
}
