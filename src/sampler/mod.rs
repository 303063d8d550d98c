//! Random numbers, addressed rather than consumed: f(pixel, sample, dimension set, seed) → four numbers in [0,1).

pub mod dims;

pub use crate::plan::options::SamplerKind;
