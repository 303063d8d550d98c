//! Where the numbers of a sample come from: its half, its index there, and the seed of its pixel.

/// Where a sample of a pixel comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Address {
    /// 0 or 1: which half of the film it is added to.
    pub half: u32,
    /// Low 32 bits of its index within the half.
    pub index: u32,
    /// The bits above.
    pub high: u32,
}

/// Half and index of global sample `sample`. Whole runs of 2^(m+1) samples give each half a run of 2^m points.
#[inline(always)]
pub fn address(sample: u64) -> Address {
    let index = sample >> 1;
    Address { half: (sample & 1) as u32, index: index as u32, high: (index >> 32) as u32 }
}

/// Seed of one half of one pixel. `pixel` is x + width·y over the full image (< 2⁶³), so crops and tiles see the
/// same numbers; `half` and `high` come from [`address`].
///
/// For one `seed` and `high` this is a bijection of (pixel, half): no two pixels share a seed at any resolution.
#[inline(always)]
pub fn pixel_seed(seed: u64, pixel: u64, half: u32, high: u32) -> [u32; 2] {
    debug_assert!(half < 2 && pixel < 1 << 63, "pixel {pixel}, half {half}");
    let place = (pixel << 1) | u64::from(half);
    // The seed is mixed first: seeds 0, 1, 2, … must not be neighbouring pixels of each other.
    let word = mix64(place ^ mix64(seed.wrapping_add(0x9E37_79B9_7F4A_7C15)));
    let word = mix64(word ^ u64::from(high).wrapping_mul(0xD1B5_4A32_D192_ED03));
    [word as u32, (word >> 32) as u32]
}

/// A bijection of 64 bits: Stafford's variant 13 of the MurmurHash3 finaliser, as in SplitMix64 (Steele et al. 2014).
#[inline(always)]
fn mix64(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}
