//! Random numbers, addressed rather than consumed: f(pixel, sample, dimension set, seed) → four numbers in [0,1).
//!
//! A film pixel keeps two halves of independent scrambles: sample s belongs to half s mod 2 and is that half's point
//! s div 2 ([`address`]). The half, the pixel and the index bits above 2³² go into a 64-bit seed ([`pixel_seed`]); the
//! low 32 bits of the index and the number of the set ([`dims`]) go to a [`Scheme`]. Nothing repeats within 2⁶³ samples a
//! pixel and 2³² sets; each run of 2³² points of a half is a fresh scramble.

pub mod dims;
pub mod independent;
pub mod sobol;

use std::fmt;
use std::str::FromStr;

pub use independent::IndependentScheme;
pub use sobol::SobolScheme;

pub use crate::plan::options::SamplerKind;

impl SamplerKind {
    /// Every sampler, in the order of the help text.
    pub const ALL: [SamplerKind; 2] = [SamplerKind::Sobol, SamplerKind::Independent];

    /// Name on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            SamplerKind::Sobol => "sobol",
            SamplerKind::Independent => "independent",
        }
    }
}

impl fmt::Display for SamplerKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for SamplerKind {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        SamplerKind::ALL
            .into_iter()
            .find(|kind| kind.name() == s)
            .ok_or_else(|| format!("'{s}' is not one of sobol, independent"))
    }
}

/// A sampler as a type, so that loops over lanes are compiled for it.
pub trait Scheme {
    /// Whether renders in production use it, so that loops over lanes are compiled for wider registers as well.
    const WIDE: bool;

    /// Point `index` of dimension set `set` under the seed of [`pixel_seed`]; each component in [0,1).
    fn sample_4d(index: u32, seed: [u32; 2], set: u32) -> [f32; 4];
}

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

/// Seed of one half of one pixel. `pixel` is x + width·y over the full image (< 2⁶³), so crops and tiles see the same
/// numbers; `half` and `high` come from [`address`].
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

/// The top 24 bits as a float in [0,1): exact, and never 1 (HARDCASES R01).
#[inline(always)]
pub fn unit_float(bits: u32) -> f32 {
    /// 2⁻²⁴: a 24-bit integer is exact in f32, and so is its product with a power of two.
    const SCALE: f32 = 1.0 / (1 << 24) as f32;
    // By way of i32, whose conversion is one instruction.
    (bits >> 8) as i32 as f32 * SCALE
}
