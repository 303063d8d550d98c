//! `indirect.R/G/B`: radiance of paths of three edges and more: light that was scattered at least twice. With
//! `emission` and `direct` the beauty.

use super::kind::{Layer, Values, rgb};
use crate::plan::aov::{Aov, Gathers};

impl Aov {
    /// Light after two scatterings and more.
    pub const INDIRECT: Aov = Aov::new("indirect", Gathers::Edges { least: 3, most: usize::MAX });
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::INDIRECT,
    about: "light after two scatterings and more",
    values: Values::Mean(3),
    channels: |_| rgb("indirect"),
};
