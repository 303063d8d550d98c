//! AVX-512: sixteen lanes are one register, and compressing, expanding and transposing are instructions.

use std::arch::x86_64::*;

use super::detect::has_avx512;
use super::isa::{Isa, Kernel};
use super::x8::U32x8;
use crate::math::lanes::LANES;

/// Registers of sixteen lanes. Named by [`super::dispatch`] alone, once [`has_avx512`] said yes; kernels get it as
/// their type parameter from there. Builds with debug assertions ask in every move.
pub(super) struct Avx512;

impl Isa for Avx512 {
    #[inline(always)]
    fn squeeze(from: &[u32; LANES], keep: u16, at: usize, here: &mut [u32; LANES], after: &mut [u32; LANES]) {
        debug_assert!(has_avx512());
        // SAFETY: see [`Avx512`].
        unsafe { squeeze(from, keep, at, here, after) }
    }

    #[inline(always)]
    fn squeeze8(from: U32x8, keep: u8) -> [u32; 8] {
        debug_assert!(has_avx512());
        // SAFETY: see [`Avx512`].
        unsafe { squeeze8(from, keep) }
    }

    #[inline(always)]
    fn transpose(rows: [&[f32; LANES]; LANES]) -> [[f32; LANES]; LANES] {
        debug_assert!(has_avx512());
        // SAFETY: see [`Avx512`].
        unsafe { transpose(rows) }
    }

    #[inline(always)]
    fn call<K: Kernel>(kernel: K) -> K::Output {
        debug_assert!(has_avx512());
        // SAFETY: see [`Avx512`].
        unsafe { call(kernel) }
    }
}

/// The features that [`has_avx512`] asks for.
#[inline(never)]
#[target_feature(enable = "avx512f,avx512bw,avx512cd,avx512dq,avx512vl,avx512vbmi,gfni")]
fn call<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx512>()
}

#[inline]
#[target_feature(enable = "avx512f")]
fn squeeze(from: &[u32; LANES], keep: u16, at: usize, here: &mut [u32; LANES], after: &mut [u32; LANES]) {
    let kept = _mm512_maskz_compress_epi32(keep, load(from));
    let behind = (0xFFFFu32 << at) as u16;
    store(here, _mm512_mask_expand_epi32(load(here), behind, kept));
    let rest = ((0xFFFF_0000u32 >> at) & 0xFFFF) as u16;
    store(after, _mm512_maskz_compress_epi32(rest, kept));
}

#[inline]
#[target_feature(enable = "avx512f,avx512vl")]
fn squeeze8(from: U32x8, keep: u8) -> [u32; 8] {
    bytemuck::cast(_mm256_maskz_compress_epi32(keep, bytemuck::cast(from.to_array())))
}

/// Pairs, then quadruples of 32 bits within the quarters of the registers, then the quarters.
#[inline]
#[target_feature(enable = "avx512f")]
fn transpose(rows: [&[f32; LANES]; LANES]) -> [[f32; LANES]; LANES] {
    // A closure instead of the loop may stay a call.
    let mut r = [_mm512_setzero_ps(); LANES];
    for (register, row) in r.iter_mut().zip(rows) {
        *register = _mm512_castsi512_ps(load(bytemuck::cast_ref(row)));
    }
    let pd = |x| _mm512_castps_pd(x);
    let mut quads = [_mm512_setzero_ps(); LANES];
    for k in (0..LANES).step_by(4) {
        let (a, b) = (_mm512_unpacklo_ps(r[k], r[k + 1]), _mm512_unpackhi_ps(r[k], r[k + 1]));
        let (c, d) = (_mm512_unpacklo_ps(r[k + 2], r[k + 3]), _mm512_unpackhi_ps(r[k + 2], r[k + 3]));
        quads[k] = _mm512_castpd_ps(_mm512_unpacklo_pd(pd(a), pd(c)));
        quads[k + 1] = _mm512_castpd_ps(_mm512_unpackhi_pd(pd(a), pd(c)));
        quads[k + 2] = _mm512_castpd_ps(_mm512_unpacklo_pd(pd(b), pd(d)));
        quads[k + 3] = _mm512_castpd_ps(_mm512_unpackhi_pd(pd(b), pd(d)));
    }
    // Quarter q of quads[k + j] now holds column 4q + j of rows k to k + 3.
    let mut columns = [[0.0; LANES]; LANES];
    for j in 0..4 {
        let [a, b, c, d] = [quads[j], quads[4 + j], quads[8 + j], quads[12 + j]];
        let (ab_even, ab_odd) = (_mm512_shuffle_f32x4::<0x88>(a, b), _mm512_shuffle_f32x4::<0xDD>(a, b));
        let (cd_even, cd_odd) = (_mm512_shuffle_f32x4::<0x88>(c, d), _mm512_shuffle_f32x4::<0xDD>(c, d));
        let quarters = [
            _mm512_shuffle_f32x4::<0x88>(ab_even, cd_even),
            _mm512_shuffle_f32x4::<0x88>(ab_odd, cd_odd),
            _mm512_shuffle_f32x4::<0xDD>(ab_even, cd_even),
            _mm512_shuffle_f32x4::<0xDD>(ab_odd, cd_odd),
        ];
        for (q, column) in quarters.into_iter().enumerate() {
            store(bytemuck::cast_mut(&mut columns[4 * q + j]), _mm512_castps_si512(column));
        }
    }
    columns
}

#[inline]
#[target_feature(enable = "avx512f")]
fn load(from: &[u32; LANES]) -> __m512i {
    // SAFETY: sixteen numbers of 32 bits are behind the reference; no alignment is required.
    unsafe { _mm512_loadu_si512(from.as_ptr().cast()) }
}

#[inline]
#[target_feature(enable = "avx512f")]
fn store(to: &mut [u32; LANES], value: __m512i) {
    // SAFETY: as above.
    unsafe { _mm512_storeu_si512(to.as_mut_ptr().cast(), value) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::simd::isa::Baseline;

    /// Oracle: the baseline, over every start and pseudo-random masks (exact).
    #[test]
    fn moves_agree_with_the_baseline() {
        if !has_avx512() {
            return;
        }
        let from: [u32; LANES] = std::array::from_fn(|i| 100 + i as u32);
        for at in 0..LANES {
            for round in 0..200u32 {
                let keep = match round {
                    0 => 0,
                    1 => u16::MAX,
                    _ => (round.wrapping_mul(0x9E37_79B9) >> 13) as u16,
                };
                let (mut here, mut after) = ([[7u32; LANES]; 2], [[9u32; LANES]; 2]);
                Baseline::squeeze(&from, keep, at, &mut here[0], &mut after[0]);
                Avx512::squeeze(&from, keep, at, &mut here[1], &mut after[1]);
                let end = at + keep.count_ones() as usize;
                assert_eq!(here[0][..end.min(LANES)], here[1][..end.min(LANES)], "at {at}, keep {keep:016b}");
                let over = end.saturating_sub(LANES);
                assert_eq!(after[0][..over], after[1][..over], "at {at}, keep {keep:016b}");
            }
        }
        let rows: [[f32; LANES]; LANES] = std::array::from_fn(|r| std::array::from_fn(|c| (r * 16 + c) as f32));
        assert_eq!(Avx512::transpose(rows.each_ref()), Baseline::transpose(rows.each_ref()));
    }

    /// Oracle: the baseline, over every mask (exact).
    #[test]
    fn eight_lanes_agree_with_the_baseline() {
        if !has_avx512() {
            return;
        }
        let from = U32x8::of(std::array::from_fn(|i| 100 + i as u32));
        for keep in 0..=u8::MAX {
            let kept = keep.count_ones() as usize;
            assert_eq!(Avx512::squeeze8(from, keep)[..kept], Baseline::squeeze8(from, keep)[..kept], "{keep:08b}");
        }
    }
}
