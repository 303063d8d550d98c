//! `emission.R/G/B`: radiance of paths of one edge: lamps, unlit surfaces and the environment as the camera sees them.
//! With `direct` and `indirect` the beauty.

use super::kind::{Layer, Values, rgb};
use crate::plan::aov::{Aov, Gathers};

impl Aov {
    /// Light seen as it was emitted.
    pub const EMISSION: Aov = Aov::new("emission", Gathers::Edges { least: 1, most: 1 });
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::EMISSION,
    about: "light seen as it was emitted",
    values: Values::Mean(3),
    channels: |_| rgb("emission"),
};
