//! What no compiler finds in a loop, by instruction set: putting chosen lanes behind one another, and asking for memory before
//! it is needed. The walk is compiled once for the build's baseline and once for AVX-512, with the same bits.

use super::eight::U8;
use super::flight::{self, Goal};
use super::hierarchy::Hierarchy;

/// Moves between lanes, by instruction set.
pub(super) trait Isa {
    /// The lanes that `keep` marks, in order; what follows them has any value.
    fn squeezed(from: U8, keep: u8) -> [u32; 8];
}

/// What every processor can do.
pub(super) struct Baseline;

impl Isa for Baseline {
    #[inline(always)]
    fn squeezed(from: U8, keep: u8) -> [u32; 8] {
        from.permuted(U8::of_bytes(KEPT[usize::from(keep)])).to_array()
    }
}

/// The lanes that a mask marks, ascending; 0 behind them.
static KEPT: [[u8; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut count) = (0, 0);
        while lane < 8 {
            if mask >> lane & 1 == 1 {
                table[mask][count] = lane;
                count += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    table
};

/// [`flight::run`] with AVX-512 if `wide` and the processor has it, else with the baseline.
pub(super) fn run<G: Goal>(wide: bool, hierarchy: &Hierarchy, blocks: &mut [G::Block], len: usize) -> u64 {
    #[cfg(target_arch = "x86_64")]
    if wide && crate::math::isa::has_avx512() {
        // SAFETY: the processor has the extensions.
        return unsafe { avx512::run::<G>(hierarchy, blocks, len) };
    }
    let _ = wide;
    flight::run::<G, Baseline>(hierarchy, blocks, len)
}

#[cfg(target_arch = "x86_64")]
mod avx512 {
    use std::arch::x86_64::*;

    use super::*;

    /// Registers with masks. Used in [`run`] alone, which is called only where the processor has them.
    struct Avx512;

    #[target_feature(enable = "avx512f,avx512bw,avx512cd,avx512dq,avx512vl,avx512vbmi,gfni")]
    pub fn run<G: Goal>(hierarchy: &Hierarchy, blocks: &mut [G::Block], len: usize) -> u64 {
        flight::run::<G, Avx512>(hierarchy, blocks, len)
    }

    impl Isa for Avx512 {
        #[inline(always)]
        fn squeezed(from: U8, keep: u8) -> [u32; 8] {
            // SAFETY: see [`Avx512`].
            unsafe { squeezed(from, keep) }
        }
    }

    #[inline]
    #[target_feature(enable = "avx512f,avx512vl")]
    fn squeezed(from: U8, keep: u8) -> [u32; 8] {
        bytemuck::cast(_mm256_maskz_compress_epi32(keep, bytemuck::cast(from.to_array())))
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        /// Oracle: the baseline, over every mask (exact).
        #[test]
        fn squeezes_as_the_baseline_does() {
            if !crate::math::isa::has_avx512() {
                return;
            }
            let from = U8::of(std::array::from_fn(|i| 100 + i as u32));
            for keep in 0..=u8::MAX {
                let kept = keep.count_ones() as usize;
                assert_eq!(Avx512::squeezed(from, keep)[..kept], Baseline::squeezed(from, keep)[..kept], "{keep:08b}");
            }
        }
    }
}
