//! `motion.X/Y`: how far what the pixel's centre shows as the shutter opens goes on the film until it closes, pixels,
//! to the right and upwards: by the motion of the camera, of the surface, or of both. Where no surface is met, of what
//! is infinitely far off. 0 where nothing moves, and for what is behind the camera in the end.

use super::kind::{Layer, Values, components};
use crate::plan::aov::{Aov, Gathers};

impl Aov {
    /// Way on the film over the shutter of what the pixel's centre shows, pixels.
    pub const MOTION: Aov = Aov::new("motion", Gathers::Centre);
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::MOTION,
    about: "its way on the film from shutter open to close, pixels to the right and up",
    values: Values::Once { missing: [0.0; 3] },
    channels: |_| components("motion", &["X", "Y"]),
};
