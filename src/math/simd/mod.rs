//! Vector code: what is compiled once for the build's baseline and once for AVX-512, and how the better of the two is
//! called.
//!
//! Kernels are loops over sixteen lanes that LLVM vectorises, generic over the instruction set ([`isa::Isa`]), which
//! supplies the few moves that no compiler finds in a loop. [`dispatch::widest`] runs a kernel by what the processor
//! has. Rust never contracts a product and a sum into one rounding and no kernel reorders a sum, so both give the same
//! bits.

#[cfg(target_arch = "x86_64")]
mod avx512;
pub mod detect;
pub mod dispatch;
pub mod isa;
pub mod prefetch;
pub mod x8;
