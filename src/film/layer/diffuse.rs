//! `diffuse.R/G/B`: radiance that the diffuse base of the first surface after the camera reflects, whatever its light
//! did before. With `emission`, `glossy`, `transmission` and `volume` the beauty.
//!
//! Defined by the scattering function: the share of its diffuse term in f, by channel, of all light that is reflected
//! there from one direction, however that direction was drawn. So no layer depends on the strategy.

use super::kind::{Layer, Values, rgb};
use crate::plan::aov::{Aov, Gathers, Lobes};

impl Aov {
    /// Light that the diffuse base of the first surface reflects.
    pub const DIFFUSE: Aov = Aov::new("diffuse", Gathers::Scattered(Lobes::Diffuse));
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::DIFFUSE,
    about: "light that the diffuse base of the first surface reflects",
    values: Values::Mean(3),
    channels: |_| rgb("diffuse"),
};
