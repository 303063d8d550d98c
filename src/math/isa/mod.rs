//! What the processor can do beyond the build's baseline.

pub mod moves;

use self::moves::{Baseline, Moves};

/// Whether this processor has the AVX-512 extensions that the wavefront is compiled for a second time.
#[cfg(target_arch = "x86_64")]
pub fn has_avx512() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512cd")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512vbmi")
        && is_x86_feature_detected!("gfni")
}

/// Other processors have one path.
#[cfg(not(target_arch = "x86_64"))]
pub fn has_avx512() -> bool {
    false
}

/// Name of what [`widest`] runs, as Embree spells it.
pub fn name(wide: bool) -> &'static str {
    match (wide, cfg!(target_arch = "x86_64")) {
        (true, _) => "avx512",
        (false, true) => "avx2",
        (false, false) => std::env::consts::ARCH,
    }
}

/// A computation that is compiled twice: for the build's baseline and for AVX-512. `run` is to be `#[inline(always)]`, and all that
/// it calls in its loops.
pub trait Widened {
    /// What comes out.
    type Output;
    /// Computes it, with the moves of the instruction set that it is compiled for.
    fn run<M: Moves>(self) -> Self::Output;
}

/// Runs `work` as compiled for AVX-512 if `wide` and the processor has it, else for the baseline.
#[inline(always)]
pub fn widest<W: Widened>(wide: bool, work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if wide && has_avx512() {
        // SAFETY: the processor has the extensions.
        return unsafe { avx512(work) };
    }
    let _ = wide;
    baseline(work)
}

#[inline(never)]
fn baseline<W: Widened>(work: W) -> W::Output {
    work.run::<Baseline>()
}

#[cfg(target_arch = "x86_64")]
#[inline(never)]
#[target_feature(enable = "avx512f,avx512bw,avx512cd,avx512dq,avx512vl,avx512vbmi,gfni")]
fn avx512<W: Widened>(work: W) -> W::Output {
    work.run::<moves::Avx512>()
}

/// Bytes of a cache line.
const LINE: usize = 64;

/// Asks for `LINES` cache lines from `at` on, before they are read. It need not be a place that may be read.
#[inline(always)]
pub fn fetch<const LINES: usize>(at: *const u8) {
    #[cfg(target_arch = "x86_64")]
    for line in 0..LINES {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a prefetch reads nothing that the program sees, and no address is forbidden.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(at.wrapping_add(line * LINE).cast()) };
    }
    let _ = (at, LINE);
}
