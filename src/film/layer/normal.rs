//! `N.X/Y/Z`: unit shading normal of what is met first (before normal maps), turned to the viewer, in the world; mean
//! over the pixel filter.

use super::kind::{Layer, Values, xyz};
use crate::plan::aov::{Aov, Gathers};

impl Aov {
    /// Shading normal of what is met first, in the world.
    pub const NORMAL: Aov = Aov::new("N", Gathers::FirstHit);
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::NORMAL,
    about: "its shading normal, turned to the viewer, in the world",
    values: Values::Mean(3),
    channels: |_| xyz("N"),
};
