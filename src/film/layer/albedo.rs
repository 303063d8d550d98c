//! `albedo.R/G/B`: base colour of what is met first, with texture and vertex colours; mean over the pixel filter.

use super::kind::{Layer, Values, rgb};
use crate::plan::aov::{Aov, Gathers};

impl Aov {
    /// Base colour of what is met first.
    pub const ALBEDO: Aov = Aov::new("albedo", Gathers::FirstHit);
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::ALBEDO,
    about: "base colour of what is met first",
    values: Values::Mean(3),
    channels: |_| rgb("albedo"),
};
