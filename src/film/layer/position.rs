//! `P.X/Y/Z`: world position of what the pixel's centre shows, metres; 0 where it shows nothing.

use super::kind::{Layer, Values, xyz};
use crate::plan::aov::{Aov, Gathers};

impl Aov {
    /// World position through the pixel's centre, metres.
    pub const POSITION: Aov = Aov::new("P", Gathers::Centre);
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::POSITION,
    about: "world position there, metres",
    values: Values::Once { missing: [0.0; 3] },
    channels: |_| xyz("P"),
};
