//! `crypto_object`: what is met first, told apart by the name of the node that places it (`cryptomatte.rs`).

use super::kind::{Layer, Values};
use crate::film::cryptomatte;
use crate::plan::aov::{Aov, Gathers};
use crate::scene::Scene;

impl Aov {
    /// Cryptomatte by the name of the node that places it.
    pub const CRYPTO_OBJECT: Aov = Aov::new("crypto_object", Gathers::FirstHit);
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::CRYPTO_OBJECT,
    about: "cryptomatte by the name of the node that places it",
    values: Values::Ids(Scene::object_name),
    channels: |_| cryptomatte::channels("crypto_object"),
};
