//! The one place that chooses between instruction sets.

#[cfg(target_arch = "x86_64")]
use super::avx512::Avx512;
#[cfg(target_arch = "x86_64")]
use super::detect::has_avx512;
use super::isa::{Baseline, Isa, Kernel};

/// Runs `kernel` as compiled for AVX-512 if `wide` and the processor has it, else for the baseline.
#[inline(always)]
pub fn widest<K: Kernel>(wide: bool, kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if wide && has_avx512() {
        return Avx512::call(kernel);
    }
    let _ = wide;
    Baseline::call(kernel)
}
