//! `Z`: distance along the view axis to what the pixel's centre shows, metres; the largest f32 where it shows nothing.

use super::kind::{Layer, Values};
use crate::plan::aov::{Aov, Gathers};

impl Aov {
    /// Distance along the view axis through the pixel's centre, metres.
    pub const DEPTH: Aov = Aov::new("Z", Gathers::Centre);
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::DEPTH,
    about: "depth along the view axis through the pixel's centre, metres",
    values: Values::Once { missing: [f32::MAX; 3] },
    channels: |_| vec![("Z".into(), 0)],
};
