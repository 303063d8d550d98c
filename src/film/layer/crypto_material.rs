//! `crypto_material`: what is met first, told apart by the name of its material (`cryptomatte.rs`).

use super::kind::{Layer, Values};
use crate::film::cryptomatte;
use crate::plan::aov::{Aov, Gathers};
use crate::scene::Scene;

impl Aov {
    /// Cryptomatte by the name of its material.
    pub const CRYPTO_MATERIAL: Aov = Aov::new("crypto_material", Gathers::FirstHit);
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::CRYPTO_MATERIAL,
    about: "cryptomatte by the name of its material",
    values: Values::Ids(Scene::material_name),
    channels: |_| cryptomatte::channels("crypto_material"),
};
