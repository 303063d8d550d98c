//! Owen-scrambled Sobol' points in sets of four dimensions, padded: f(index, seed, set) → four numbers, no state.
//!
//! Each set shuffles the index and scrambles its four dimensions with its own keys, so every set is a randomised
//! digital sequence (a (0,2)-sequence in its first two dimensions), and different sets are independent. A seed has
//! 2³² points; [`address`](super::address()) folds the bits above into the seed.
//!
//! The generator matrices need no table. A direction-number recurrence says that the shift operator E on columns obeys
//! p(E) = N, N a digit shift by deg p; squaring over GF(2) gives p(E²ᵏ) = N²ᵏ, so an index read as a polynomial
//! in E is divided by p(E¹⁶), p(E⁸), … in four or five steps of shifts and masks. For p = x + 1 that is the
//! Pascal butterfly. Sources: Joe and Kuo 2008 (direction numbers, file new-joe-kuo-6), Owen 1995 (scrambling), Laine
//! and Karras 2011 (a hash as scrambling), Burley 2020 (JCGT 9:4, shuffled padding), Vegdahl 2021 (multipliers of the
//! hash). Branch-free u32 arithmetic: a loop over 16 lanes vectorises.

use super::scheme::{Scheme, unit_float};

/// `--sampler sobol`.
#[derive(Clone, Copy, Debug)]
pub struct SobolScheme;

impl Scheme for SobolScheme {
    const WIDE: bool = true;

    #[inline(always)]
    fn sample_4d(index: u32, seed: [u32; 2], set: u32) -> [f32; 4] {
        sobol_4d(index, seed, set)
    }
}

/// Point `index` of dimension set `set`, scrambled by `seed`; each component in [0,1).
#[inline(always)]
pub fn sobol_4d(index: u32, seed: [u32; 2], set: u32) -> [f32; 4] {
    let keys = Keys::new(seed, set);
    // Shuffling is the scrambling of the bit-reversed index: aligned blocks of 2^m points stay blocks.
    let index = keys.scramble(index.reverse_bits(), 0).reverse_bits();
    // A dimension's digits come out of the matrices least significant first: what the scramble wants to read.
    let digits = [index, pascal_digits(index), quadratic_digits(index), cubic_digits(index)];
    std::array::from_fn(|d| unit_float(keys.scramble(digits[d], d as u32 + 1).reverse_bits()))
}

/// Scrambling keys of one (seed, set): 64 hashed bits, drawn out to five keys.
struct Keys {
    low: u32,
    high: u32,
}

impl Keys {
    /// Hashes the set into both words of the seed. For one set this is a bijection of the seed, for one seed distinct
    /// sets give distinct keys.
    #[inline(always)]
    fn new(seed: [u32; 2], set: u32) -> Self {
        let low = mix(seed[0] ^ set.wrapping_mul(0x9E37_79B1));
        let high = mix(seed[1] ^ low.rotate_left(16) ^ set);
        Keys { low, high }
    }

    /// Owen scrambling of `digits`, the first digit in the lowest bit: every bit is flipped by a hash of the bits
    /// below.
    #[inline(always)]
    fn scramble(&self, digits: u32, stream: u32) -> u32 {
        // Two keys of the stream: steps of odd constants (2³²/φ, 2³²/√2) through the hashed words.
        let offset = mix(self.low.wrapping_add(stream.wrapping_mul(0x9E37_79B9)) ^ self.high);
        let factor = self.high.wrapping_add(stream.wrapping_mul(0xB504_F335)) ^ (self.low >> 15);
        let mut x = digits;
        x ^= x.wrapping_mul(0x3D20_ADEA);
        x = x.wrapping_add(offset);
        x = x.wrapping_mul(factor | 1);
        x ^= x.wrapping_mul(0x0552_6C56);
        x ^ x.wrapping_mul(0x53A2_2864)
    }
}

/// A bijection of 32 bits that mixes them well: xor-shift, multiply, xor-shift, multiply, xor-shift, with the constants
/// that Wellons' search found least biased (`lowbias32`, 2018).
#[inline(always)]
fn mix(x: u32) -> u32 {
    let x = (x ^ (x >> 16)).wrapping_mul(0x7FEB_352D);
    let x = (x ^ (x >> 15)).wrapping_mul(0x846C_A68B);
    x ^ (x >> 16)
}

/// Second Sobol' dimension, p = x + 1, all m = 1: E¹⁶ = 1 + N¹⁶ and so on down. Digit i in bit i.
#[inline(always)]
fn pascal_digits(index: u32) -> u32 {
    let x = index ^ (index >> 16);
    let x = x ^ ((x >> 8) & 0x00FF_00FF);
    let x = x ^ ((x >> 4) & 0x0F0F_0F0F);
    let x = x ^ ((x >> 2) & 0x3333_3333);
    x ^ ((x >> 1) & 0x5555_5555)
}

/// Third Sobol' dimension, p = x² + x + 1 (s = 2, a = 1), m = 1, 3. Digit i in bit i.
///
/// A block of 2w coefficients is lo + E^w·hi (w = 16, 8, 4, 2) and E^w = E^(w/2) + 1 + N^(w/2). With hi = a +
/// E^(w/2)·b the product E^(w/2)·hi overflows by b, which is reduced once more: lo' = lo + hi + E^(w/2)(a + b) + b,
/// and the block above, which counts N^(w/2) (w digits up), becomes hi' = hi + b.
#[inline(always)]
fn quadratic_digits(index: u32) -> u32 {
    let x = quadratic_step::<16>(index, 0x0000_FFFF, 0x0000_00FF);
    let x = quadratic_step::<8>(x, 0x00FF_00FF, 0x000F_000F);
    let x = quadratic_step::<4>(x, 0x0F0F_0F0F, 0x0303_0303);
    let x = quadratic_step::<2>(x, 0x3333_3333, 0x1111_1111);
    // Two coefficients are left per block: v₀ = digit 0, v₁ = digits 0 and 1 (m = 3).
    x ^ ((x >> 1) & 0x5555_5555)
}

/// One division of [`quadratic_digits`]; the masks select W and W/2 bits at the foot of each block.
#[inline(always)]
fn quadratic_step<const W: u32>(x: u32, low: u32, quarter: u32) -> u32 {
    let hi = (x >> W) & low;
    let b = (hi >> (W / 2)) & quarter;
    // (a + b)·E^(W/2).
    let shifted = ((hi ^ b) & quarter) << (W / 2);
    x ^ hi ^ shifted ^ b ^ (b << W)
}

/// Fourth Sobol' dimension, p = x³ + x + 1 (s = 3, a = 1), m = 1, 3, 1. Digit i in bit i.
///
/// As [`quadratic_digits`] with E^(3w) = E^w + 1 + N^w for w = 8, 4, 2, 1: blocks are 24, 12, 6 and 3 wide. What lies
/// above 3w coefficients is hi = a + E^(2w)·b: lo' = lo + hi + E^w·(a + b) + b, hi' = hi + b.
#[inline(always)]
fn cubic_digits(index: u32) -> u32 {
    // Only 8 coefficients lie above the 24th: nothing overflows.
    let hi = index >> 24;
    let x = index ^ hi ^ (hi << 8);
    // The masks select the low 3w bits of each block of 6w, the low 2w, the low w. The topmost block is cut at bit 31.
    let x = cubic_step::<4>(x, [0x0000_0FFF, 0x0000_00FF, 0x0000_000F]);
    let x = cubic_step::<2>(x, [0x3F03_F03F, 0x0F00_F00F, 0x0300_3003]);
    let x = cubic_step::<1>(x, [0xC71C_71C7, 0xC30C_30C3, 0x4104_1041]);
    // Three coefficients are left per block: v₀ = digit 0, v₁ = digits 0 and 1 (m = 3), v₂ = digit 2 (m = 1).
    x ^ ((x >> 1) & 0x4924_9249)
}

/// One division of [`cubic_digits`]; `masks` select 3W, 2W and W bits at the foot of each block.
#[inline(always)]
fn cubic_step<const W: u32>(x: u32, masks: [u32; 3]) -> u32 {
    let hi = (x >> (3 * W)) & masks[0];
    let b = (hi >> (2 * W)) & masks[2];
    let shifted = ((hi ^ b) & masks[1]) << W;
    x ^ hi ^ shifted ^ b ^ (b << (3 * W))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Digits (first one in bit 0) of point `index` from the direction-number recurrence of a primitive polynomial of
    /// degree s with inner coefficients `a` and initial numbers `m`: the textbook form.
    fn digits_by_recurrence(index: u32, a: u32, m: &[u32]) -> u32 {
        let s = m.len();
        let mut v: Vec<u32> = m.iter().enumerate().map(|(i, m)| m << (31 - i)).collect();
        for i in s..32 {
            let mut next = v[i - s] ^ (v[i - s] >> s);
            for k in 1..s {
                if a >> (s - 1 - k) & 1 == 1 {
                    next ^= v[i - k];
                }
            }
            v.push(next);
        }
        (0..32).filter(|i| index >> i & 1 == 1).fold(0, |x, i| x ^ v[i]).reverse_bits()
    }

    /// Oracle: the recurrence with the numbers of new-joe-kuo-6 (d = 2, 3, 4). The maps are linear, so the 32 unit
    /// vectors decide; random indices check that they are.
    #[test]
    fn digit_maps_are_the_joe_kuo_matrices() {
        let units = (0..32).map(|i| 1u32 << i);
        let others = (0..1000u32).map(|i| i.wrapping_mul(0x9E37_79B1) ^ (i << 7));
        for index in units.chain(others) {
            assert_eq!(pascal_digits(index), digits_by_recurrence(index, 0, &[1]), "{index:#x}");
            assert_eq!(quadratic_digits(index), digits_by_recurrence(index, 1, &[1, 3]), "{index:#x}");
            assert_eq!(cubic_digits(index), digits_by_recurrence(index, 1, &[1, 3, 1]), "{index:#x}");
        }
    }

    /// Oracle: what makes a hash an Owen scrambling. Flipping bit b changes no bit below b, always changes bit b, and
    /// each higher bit in half of all cases (binomial, 4096 keys and inputs: 6.5 standard deviations, 1e-10 each).
    #[test]
    fn scramble_is_nested_and_avalanches_upwards() {
        const N: u32 = 4096;
        for b in 0..31u32 {
            let mut flips = [0u32; 32];
            for i in 0..N {
                let keys = Keys::new([i, 77], 5);
                let x = mix(i ^ 0xABCD);
                let change = keys.scramble(x, 2) ^ keys.scramble(x ^ (1 << b), 2);
                assert_eq!(change & ((1 << b) - 1), 0, "a lower bit changed");
                assert_eq!(change >> b & 1, 1, "bit {b} lost");
                for (bit, count) in flips.iter_mut().enumerate() {
                    *count += change >> bit & 1;
                }
            }
            for (bit, &count) in flips.iter().enumerate().skip(b as usize + 1) {
                let z = (f64::from(count) - f64::from(N) / 2.0) / (f64::from(N) / 4.0).sqrt();
                assert!(z.abs() < 6.5, "bit {b} flips bit {bit} {count} times of {N}");
            }
        }
    }
}
