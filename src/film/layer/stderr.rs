//! `stderr.R/G/B`: estimated standard error of the pixel's mean, radiance: the square root of `variance`.

use super::kind::{Layer, Values, rgb};
use super::variance;
use crate::plan::aov::{Aov, Gathers};

impl Aov {
    /// Estimated standard error of each pixel's mean.
    pub const STDERR: Aov = Aov::new("stderr", Gathers::Nothing);
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::STDERR,
    about: "its square root, the standard error",
    values: Values::Beauty(|pixel| variance::of_pixel(pixel).map(f64::sqrt)),
    channels: |_| rgb("stderr"),
};
