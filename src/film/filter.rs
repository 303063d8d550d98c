//! Pixel filters, sampled by importance (filled in by its owner).

/// The filters of `--filter`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FilterKind {
    /// Box of 1 pixel.
    Box,
    /// Tent of radius 1.
    Tent,
    /// Gaussian, standard deviation 0.5, cut at radius 1.5.
    Gaussian,
    /// Blackman-Harris of radius 1.5.
    BlackmanHarris,
    /// Mitchell-Netravali (1/3, 1/3), radius 2; has negative lobes, weights are signed.
    Mitchell,
}

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
