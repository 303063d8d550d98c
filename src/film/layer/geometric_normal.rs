//! `Ng.X/Y/Z`: unit normal of the triangle that is met first, turned to the viewer, in the world; mean over the pixel
//! filter.

use super::kind::{Layer, Values, xyz};
use crate::plan::aov::{Aov, Gathers};

impl Aov {
    /// Geometric normal of what is met first, in the world.
    pub const GEOMETRIC_NORMAL: Aov = Aov::new("Ng", Gathers::FirstHit);
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::GEOMETRIC_NORMAL,
    about: "its geometric normal, turned to the viewer, in the world",
    values: Values::Mean(3),
    channels: |_| xyz("Ng"),
};
