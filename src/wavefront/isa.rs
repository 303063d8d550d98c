//! The widest instruction set at run time: the build's baseline is AVX2, and processors with AVX-512 run the same source
//! compiled for it. Sixteen lanes are then one register, and the moves that no compiler finds in a loop are `math::isa::moves`.
//!
//! Rust never contracts a product and a sum by itself and no stage reorders a sum, so both give the same bits.

use super::queue::Kind;
use super::raygen::Chunk;
use super::shade::{self, Bsdfs};
use super::state::Wave;
use super::{Context, Counters, run_inline};
use crate::film::Pixel;
pub use crate::math::isa::moves::Baseline;
use crate::math::isa::moves::Moves;
use crate::sampler::Scheme;

/// What is compiled by instruction set.
pub trait Isa: Moves {
    /// [`shade::run`] as a function of its own: one kernel is enough for an optimiser at a time.
    fn shade<'c, B: Bsdfs<'c>, S: Scheme>(context: &Context<'c>, wave: &mut Wave, kind: Kind, edge: u32) -> u64;
}

impl Isa for Baseline {
    #[inline(never)]
    fn shade<'c, B: Bsdfs<'c>, S: Scheme>(context: &Context<'c>, wave: &mut Wave, kind: Kind, edge: u32) -> u64 {
        shade::run::<B, S, Self>(context, wave, kind, edge)
    }
}

/// [`super::run`] in the widest instruction set that the plan allows.
pub fn run<S: Scheme>(
    context: &Context,
    chunk: &Chunk,
    wave: &mut Wave,
    pixels: &mut [Pixel],
    counters: &mut Counters,
) {
    #[cfg(target_arch = "x86_64")]
    if S::WIDE && context.plan.avx512 {
        // SAFETY: the plan says so only where `math::isa::has_avx512` is true.
        return unsafe { avx512::run::<S>(context, chunk, wave, pixels, counters) };
    }
    run_inline::<S, Baseline>(context, chunk, wave, pixels, counters)
}

#[cfg(target_arch = "x86_64")]
mod avx512 {
    use super::*;
    use crate::math::isa::moves::Avx512;

    #[target_feature(enable = "avx512f,avx512bw,avx512cd,avx512dq,avx512vl,avx512vbmi,gfni")]
    pub fn run<S: Scheme>(
        context: &Context,
        chunk: &Chunk,
        wave: &mut Wave,
        pixels: &mut [Pixel],
        counters: &mut Counters,
    ) {
        run_inline::<S, Avx512>(context, chunk, wave, pixels, counters)
    }

    impl Isa for Avx512 {
        #[inline(always)]
        fn shade<'c, B: Bsdfs<'c>, S: Scheme>(context: &Context<'c>, wave: &mut Wave, kind: Kind, edge: u32) -> u64 {
            // SAFETY: as for [`Avx512`]: reached through [`run`] alone, which the processor can run.
            unsafe { shade::<B, S>(context, wave, kind, edge) }
        }
    }

    #[inline(never)]
    #[target_feature(enable = "avx512f,avx512bw,avx512cd,avx512dq,avx512vl,avx512vbmi,gfni")]
    fn shade<'c, B: Bsdfs<'c>, S: Scheme>(context: &Context<'c>, wave: &mut Wave, kind: Kind, edge: u32) -> u64 {
        crate::wavefront::shade::run::<B, S, Avx512>(context, wave, kind, edge)
    }
}
