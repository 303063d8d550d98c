//! `glossy.R/G/B`: radiance that the first surface after the camera reflects by anything but its diffuse base
//! (`diffuse` has that and says how they are told apart): mirrors and facets of metals, coats and glass, clearcoats,
//! sheen.

use super::kind::{Layer, Values, rgb};
use crate::plan::aov::{Aov, Gathers, Lobes};

impl Aov {
    /// Light that the first surface reflects otherwise.
    pub const GLOSSY: Aov = Aov::new("glossy", Gathers::Scattered(Lobes::Glossy));
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::GLOSSY,
    about: "light that the first surface reflects otherwise: by metals, coats, glass, sheen",
    values: Values::Mean(3),
    channels: |_| rgb("glossy"),
};
