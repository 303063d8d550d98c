//! Moves between sixteen lanes that no compiler finds in a loop, written out for processors with AVX-512.

use crate::math::lanes::LANES;

/// Moves between lanes, by instruction set.
pub trait Moves {
    /// Puts the lanes of `from` that `keep` marks behind one another, the first of them into lane `at` of `here` and what
    /// does not fit into the first lanes of `after`. Lanes before `at` keep their values; lanes behind the last one that was put
    /// have any value.
    fn squeeze(from: &[u32; LANES], keep: u16, at: usize, here: &mut [u32; LANES], after: &mut [u32; LANES]);

    /// Rows to columns.
    fn transpose(rows: [&[f32; LANES]; LANES]) -> [[f32; LANES]; LANES];
}

/// What every processor can do.
pub struct Baseline;

impl Moves for Baseline {
    #[inline(always)]
    fn squeeze(from: &[u32; LANES], keep: u16, at: usize, here: &mut [u32; LANES], after: &mut [u32; LANES]) {
        let mut to = at;
        for i in 0..LANES {
            // Written before it is known whether the lane stays: no branch to guess.
            let column = if to < LANES { &mut *here } else { &mut *after };
            column[to % LANES] = from[i];
            to += usize::from(keep >> i & 1);
        }
    }

    #[inline(always)]
    fn transpose(rows: [&[f32; LANES]; LANES]) -> [[f32; LANES]; LANES] {
        let mut columns = [[0.0; LANES]; LANES];
        for (i, row) in rows.iter().enumerate() {
            for c in 0..LANES {
                columns[c][i] = row[c];
            }
        }
        columns
    }
}

/// Registers of sixteen lanes. To be named only where the processor is known to have AVX-512: by [`super::widest`] and by the kernels
/// of the wavefront behind the same question. Builds with debug assertions ask in every move.
#[cfg(target_arch = "x86_64")]
pub(crate) struct Avx512;

#[cfg(target_arch = "x86_64")]
mod avx512 {
    use std::arch::x86_64::*;

    use super::*;
    use crate::math::isa::has_avx512;

    impl Moves for Avx512 {
        #[inline(always)]
        fn squeeze(from: &[u32; LANES], keep: u16, at: usize, here: &mut [u32; LANES], after: &mut [u32; LANES]) {
            debug_assert!(has_avx512());
            // SAFETY: see [`Avx512`].
            unsafe { squeeze(from, keep, at, here, after) }
        }

        #[inline(always)]
        fn transpose(rows: [&[f32; LANES]; LANES]) -> [[f32; LANES]; LANES] {
            debug_assert!(has_avx512());
            // SAFETY: see [`Avx512`].
            unsafe { transpose(rows) }
        }
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

    /// Pairs, then quadruples of 32 bits within the quarters of the registers, then the quarters.
    #[inline]
    #[target_feature(enable = "avx512f")]
    fn transpose(rows: [&[f32; LANES]; LANES]) -> [[f32; LANES]; LANES] {
        // A closure in the place of the loop may stay a call.
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
        // SAFETY: sixteen numbers of 32 bits are behind the reference; no alignment is asked.
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
    }
}
