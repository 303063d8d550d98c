//! `denoise_normal.X/Y/Z`: shading normal for denoisers, with normal maps, turned to where the path comes from, in the
//! world: of the surface whose colour `denoise_albedo` shows; where a path ends on mirrors and smooth glass, of the
//! first of these. Mean over the pixel filter, by halves as the beauty, 0 where a camera ray meets nothing.

use super::kind::{Layer, Values, xyz};
use crate::plan::aov::{Aov, Gathers, Guide};

impl Aov {
    /// Shading normal of the first surface that is no mirror or smooth glass.
    pub const DENOISE_NORMAL: Aov = Aov::new("denoise_normal", Gathers::Followed(Guide::Normal));
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::DENOISE_NORMAL,
    about: "its shading normal, with normal maps",
    values: Values::Halves(3),
    channels: |_| xyz("denoise_normal"),
};
