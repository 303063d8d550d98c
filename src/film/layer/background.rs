//! `background.R/G/B`: radiance of the environment where camera rays see it with nothing before it but what they pass
//! through, which takes its share; mean over the pixel filter. The beauty less this layer is the scene without its
//! background, premultiplied by `coverage.Y`.

use super::kind::{Layer, Values, rgb};
use crate::plan::aov::{Aov, Gathers};

impl Aov {
    /// Environment that is seen directly.
    pub const BACKGROUND: Aov = Aov::new("background", Gathers::FirstHit);
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::BACKGROUND,
    about: "environment where it is seen directly, a part of the beauty",
    values: Values::Mean(3),
    channels: |_| rgb("background"),
};
