//! Asking for memory before it is read.

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
