//! The alpha mode of each material, resolved once per render.

use crate::scene::{AlphaMode, Scene};

/// See the module.
#[derive(Clone, Debug, Default)]
pub struct AlphaTable {
    /// One entry a material; empty where no surface lets a ray pass.
    modes: Vec<AlphaMode>,
}

impl AlphaTable {
    /// Of all materials of the scene.
    pub fn new(scene: &Scene) -> Self {
        let modes: Vec<_> = scene.materials.iter().map(|material| material.effective_alpha(&scene.textures)).collect();
        let opaque = modes.iter().all(|mode| *mode == AlphaMode::Opaque);
        AlphaTable { modes: if opaque { Vec::new() } else { modes } }
    }

    /// Of one material.
    #[inline(always)]
    pub fn mode(&self, material: u32) -> AlphaMode {
        self.modes.get(material as usize).copied().unwrap_or_default()
    }
}
