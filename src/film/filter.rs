//! Pixel filters, sampled by importance (filled in by its owner).

pub use crate::plan::options::FilterKind;

/// A point drawn from a filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterSample {
    /// Offset from the pixel's centre, in pixels.
    pub dx: f32,
    /// Offset from the pixel's centre, in pixels (down).
    pub dy: f32,
    /// Signed weight with expectation 1; exactly 1 for filters without negative lobes.
    pub weight: f32,
}
