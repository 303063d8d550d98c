//! `UV.U/V`: texture coordinates, channel 0, of what the pixel's centre shows, as the file has them (V down); 0 where
//! there are none.
//!
//! Limit: coordinates are kept for meshes whose material reads a texture; others have none here.

use super::kind::{Layer, Values, components};
use crate::plan::aov::{Aov, Gathers};

impl Aov {
    /// Texture coordinates through the pixel's centre.
    pub const UV: Aov = Aov::new("UV", Gathers::Centre);
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::UV,
    about: "texture coordinates there, of what has textures",
    values: Values::Once { missing: [0.0; 3] },
    channels: |_| components("UV", &["U", "V"]),
};
