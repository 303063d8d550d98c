//! Independent uniform numbers by a counter-based hash: f(index, seed, set) → four numbers, no state.
//!
//! The 128-bit block (index, seed, set) goes through a bijection of 32-bit multiplies, adds and shifts, so distinct
//! addresses give distinct blocks: nothing repeats over 2³² indices, 2⁶⁴ seeds and 2³² sets. Built like the
//! `pcg4d` hash of Jarzynski and Olano 2020 (JCGT 9:3), with its cross-multiplication run twice and a multiply between.
//! Branch-free u32 arithmetic: a loop over lanes vectorises.

use super::scheme::{Scheme, unit_float};

/// `--sampler independent`.
#[derive(Clone, Copy, Debug)]
pub struct IndependentScheme;

impl Scheme for IndependentScheme {
    const WIDE: bool = false;

    #[inline(always)]
    fn sample_4d(index: u32, seed: [u32; 2], set: u32) -> [f32; 4] {
        independent_4d(index, seed, set).map(unit_float)
    }
}

/// Four hashed 32-bit words of an address.
#[inline(always)]
pub fn independent_4d(index: u32, seed: [u32; 2], set: u32) -> [u32; 4] {
    // The LCG constants of Knuth (Numerical Recipes' `ranqd1`): low entropy inputs leave the small numbers.
    let mut v = [index, seed[0], seed[1], set].map(|x| x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    cross_multiply(&mut v);
    v = v.map(|x| (x ^ (x >> 16)).wrapping_mul(0x9E37_79B1));
    cross_multiply(&mut v);
    v.map(|x| x ^ (x >> 16))
}

/// Adds to each word a product of two others; each line can be undone, so the whole is a bijection.
#[inline(always)]
fn cross_multiply(v: &mut [u32; 4]) {
    v[0] = v[0].wrapping_add(v[1].wrapping_mul(v[3]));
    v[1] = v[1].wrapping_add(v[2].wrapping_mul(v[0]));
    v[2] = v[2].wrapping_add(v[0].wrapping_mul(v[1]));
    v[3] = v[3].wrapping_add(v[1].wrapping_mul(v[2]));
}
