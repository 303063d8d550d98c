//! Ids of names (`film/cryptomatte.rs`), worked out once for the layers that are asked for; what was met is looked up
//! by the instance that it belongs to.

use crate::film::cryptomatte::id_of;
use crate::film::layer;
use crate::film::layer::kind::Values;
use crate::plan::Aov;
use crate::scene::Scene;

/// For each layer of ids, that of every instance of the scene; empty unless asked for.
#[derive(Clone, Debug, Default)]
pub struct Names {
    /// Of the node that places it.
    pub objects: Vec<u32>,
    /// Of what it is made of.
    pub materials: Vec<u32>,
    /// Of the topmost node above it.
    pub assets: Vec<u32>,
}

impl Names {
    /// Of `scene`, for `aovs`.
    pub fn new(scene: &Scene, aovs: &[Aov]) -> Names {
        let ids = |aov: Aov| match layer::find(aov).values {
            Values::Ids(name) if aovs.contains(&aov) => {
                (0..scene.instances.len()).map(|instance| id_of(&name(scene, instance))).collect()
            }
            _ => Vec::new(),
        };
        Names { objects: ids(Aov::CRYPTO_OBJECT), materials: ids(Aov::CRYPTO_MATERIAL), assets: ids(Aov::CRYPTO_ASSET) }
    }
}
