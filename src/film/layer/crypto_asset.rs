//! `crypto_asset`: what is met first, told apart by the name of the topmost node above it (`cryptomatte.rs`).

use super::kind::{Layer, Values};
use crate::film::cryptomatte;
use crate::plan::aov::{Aov, Gathers};
use crate::scene::Scene;

impl Aov {
    /// Cryptomatte by the name of the topmost node above it.
    pub const CRYPTO_ASSET: Aov = Aov::new("crypto_asset", Gathers::FirstHit);
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::CRYPTO_ASSET,
    about: "cryptomatte by the name of the topmost node above it",
    values: Values::Ids(Scene::asset_name),
    channels: |_| cryptomatte::channels("crypto_asset"),
};
