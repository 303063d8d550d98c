//! Numbers: frames, warps, tables, error bounds. Nothing here knows of scenes or rays' meaning.

pub mod angle;
pub mod float;
pub mod frame;
#[allow(unsafe_code)] // Fence 4 of 5: calls into code compiled for AVX-512.
pub mod isa;
pub mod lanes;
pub mod table;
pub mod warp;
