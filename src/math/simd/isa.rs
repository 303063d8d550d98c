//! Instruction sets as types, kernels that are generic over them, and the portable one.

use super::x8::U32x8;
use crate::math::lanes::LANES;

/// An instruction set: moves between lanes that no compiler finds in a loop, and calls into code compiled for it.
///
/// AVX-512 stands behind this trait as a type that only [`widest`](super::dispatch::widest) names, once it has asked
/// the processor: who holds an `I: Isa` may run what is compiled for it.
pub trait Isa {
    /// Puts the lanes of `from` that `keep` marks behind one another, the first of them into lane `at` of `here` and
    /// what does not fit into the first lanes of `after`. Lanes before `at` keep their values; lanes behind the last
    /// one that was put have any value.
    fn squeeze(from: &[u32; LANES], keep: u16, at: usize, here: &mut [u32; LANES], after: &mut [u32; LANES]);

    /// The lanes that `keep` marks, in order; what follows them has any value.
    fn squeeze8(from: U32x8, keep: u8) -> [u32; 8];

    /// Rows to columns.
    fn transpose(rows: [&[f32; LANES]; LANES]) -> [[f32; LANES]; LANES];

    /// Runs `kernel` as compiled for this instruction set, as a function that is not inlined: more than one kernel is
    /// too much for an optimiser at a time.
    fn call<K: Kernel>(kernel: K) -> K::Output;
}

/// A computation that is compiled once per instruction set. `run` is to be `#[inline(always)]`, and all that it calls
/// in its loops, so that it is compiled into the function that [`Isa::call`] makes of it.
pub trait Kernel {
    /// What comes out.
    type Output;
    /// Computes it.
    fn run<I: Isa>(self) -> Self::Output;
}

/// The build's baseline: the portable fallback.
pub struct Baseline;

impl Isa for Baseline {
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
    fn squeeze8(from: U32x8, keep: u8) -> [u32; 8] {
        from.permuted(U32x8::of_bytes(KEPT[usize::from(keep)])).to_array()
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

    #[inline(never)]
    fn call<K: Kernel>(kernel: K) -> K::Output {
        kernel.run::<Self>()
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
