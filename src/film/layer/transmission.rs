//! `transmission.R/G/B`: radiance that comes through the first surface after the camera, refracted, straight through a
//! thin wall, or diffusely. What rays pass without an edge (alpha, boundaries between equal indices) is not meant.

use super::kind::{Layer, Values, rgb};
use crate::plan::aov::{Aov, Gathers, Lobes};

impl Aov {
    /// Light that comes through the first surface.
    pub const TRANSMISSION: Aov = Aov::new("transmission", Gathers::Scattered(Lobes::Transmission));
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::TRANSMISSION,
    about: "light that comes through the first surface",
    values: Values::Mean(3),
    channels: |_| rgb("transmission"),
};
