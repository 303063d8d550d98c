//! `variance.R/G/B`: estimated variance of the pixel's mean, radiance². Unbiased, one degree of freedom
//! ([`Pixel::variance`]); 0 until both halves have samples.

use super::beauty::Pixel;
use super::kind::{Layer, Values, rgb};
use crate::plan::aov::{Aov, Gathers};

impl Aov {
    /// Estimated variance of each pixel's mean.
    pub const VARIANCE: Aov = Aov::new("variance", Gathers::Nothing);
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::VARIANCE,
    about: "estimated variance of each pixel's mean",
    values: Values::Beauty(of_pixel),
    channels: |_| rgb("variance"),
};

/// By colour channel.
pub(super) fn of_pixel(pixel: &Pixel) -> [f64; 3] {
    pixel.variance().unwrap_or_default()
}
