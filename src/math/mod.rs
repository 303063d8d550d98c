//! Numbers: frames, warps, tables, error bounds. Nothing here knows of scenes or rays' meaning.

pub mod angle;
pub mod columns;
pub mod float;
pub mod frame;
pub(crate) mod hash;
pub mod lanes;
pub mod pareto;
pub mod quad;
#[allow(unsafe_code)] // Fence 3 of 5: instructions by name, and calls into code compiled for AVX-512.
pub mod simd;
pub mod table;
pub mod warp;
