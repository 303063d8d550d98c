//! `volume.R/G/B`: radiance of paths that a medium scatters before they meet a surface: fog, or a solid that the camera
//! is in or sees through a boundary without an edge. Media beyond the first surface have no part in it.

use super::kind::{Layer, Values, rgb};
use crate::plan::aov::{Aov, Gathers, Lobes};

impl Aov {
    /// Light that a medium scatters before the first surface.
    pub const VOLUME: Aov = Aov::new("volume", Gathers::Scattered(Lobes::Volume));
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::VOLUME,
    about: "light that a medium scatters before the first surface",
    values: Values::Mean(3),
    channels: |_| rgb("volume"),
};
