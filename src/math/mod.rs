//! Numbers: frames, warps, tables, error bounds. Nothing here knows of scenes or rays' meaning.

pub mod angle;
pub mod float;
pub mod frame;
pub mod isa;
pub mod lanes;
pub mod table;
pub mod warp;
