//! `direct.R/G/B`: radiance of paths of two edges: light that was scattered once, by whatever lobe, a mirror's too.
//! With `emission` and `indirect` the beauty.

use super::kind::{Layer, Values, rgb};
use crate::plan::aov::{Aov, Gathers};

impl Aov {
    /// Light after one scattering.
    pub const DIRECT: Aov = Aov::new("direct", Gathers::Edges { least: 2, most: 2 });
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::DIRECT,
    about: "light after one scattering",
    values: Values::Mean(3),
    channels: |_| rgb("direct"),
};
