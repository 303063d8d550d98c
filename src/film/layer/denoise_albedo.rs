//! `denoise_albedo.R/G/B`: base colour for denoisers, of the first surface that is not a perfect mirror or smooth
//! glass: paths are followed through these as they are sampled, so that a pixel has the blend of what is reflected and
//! what is seen through. 1 where a path ends on such surfaces or leaves the scene behind them, 0 where a camera ray
//! meets nothing; mean over the pixel filter, by halves as the beauty. Source: Open Image Denoise's documentation,
//! "Albedos".

use super::kind::{Layer, Values, rgb};
use crate::plan::aov::{Aov, Gathers, Guide};

impl Aov {
    /// Base colour of the first surface that is no mirror or smooth glass.
    pub const DENOISE_ALBEDO: Aov = Aov::new("denoise_albedo", Gathers::Followed(Guide::Albedo));
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::DENOISE_ALBEDO,
    about: "base colour for denoisers, of what is seen in mirrors and through smooth glass",
    values: Values::Halves(3),
    channels: |_| rgb("denoise_albedo"),
};
