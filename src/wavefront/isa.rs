//! The widest instruction set at run time: the build's baseline is AVX2, and processors with AVX-512 run the same source
//! compiled for it. Sixteen lanes are then one register, and masks are masks.
//!
//! Rust never contracts a product and a sum by itself and no stage reorders a sum, so both give the same bits.

use super::raygen::Chunk;
use super::state::Wave;
use super::{Context, Counters, run_inline};
use crate::film::Pixel;
use crate::sampler::Scheme;

/// [`super::run`] in the widest instruction set that the plan allows.
pub fn run<S: Scheme>(
    context: &Context,
    chunk: &Chunk,
    wave: &mut Wave,
    pixels: &mut [Pixel],
    counters: &mut Counters,
) {
    #[cfg(target_arch = "x86_64")]
    if context.plan.avx512 {
        // SAFETY: the plan says so only where `math::isa::has_avx512` is true.
        return unsafe { run_avx512::<S>(context, chunk, wave, pixels, counters) };
    }
    run_inline::<S>(context, chunk, wave, pixels, counters)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512cd,avx512dq,avx512vl,avx512vbmi,gfni")]
fn run_avx512<S: Scheme>(
    context: &Context,
    chunk: &Chunk,
    wave: &mut Wave,
    pixels: &mut [Pixel],
    counters: &mut Counters,
) {
    run_inline::<S>(context, chunk, wave, pixels, counters)
}
