//! `spp.Y`: samples of each pixel. They differ where time or a signal ended the render within a pass.

use super::kind::{Layer, Values, components};
use crate::plan::aov::{Aov, Gathers};

impl Aov {
    /// Samples of each pixel.
    pub const SPP: Aov = Aov::new("spp", Gathers::Nothing);
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::SPP,
    about: "samples of each pixel",
    values: Values::Beauty(|pixel| [pixel.samples() as f64; 3]),
    channels: |_| components("spp", &["Y"]),
};
