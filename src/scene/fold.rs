//! Textures that have one value everywhere become factors of their materials, so that nothing looks them up.
//!
//! How a constant texture folds is up to its slot (`material::slot`). Images that are still read together afterwards
//! are laid side by side.

use std::collections::HashSet;

use super::material::slot::Constant;
use super::{MaterialId, Scene, Slot, Texture};
use crate::texture::{Texels, lookup, take_lookups, weave};

impl Scene {
    /// Folds what is constant, but for materials of meshes without texture coordinates: those show no texture. The list
    /// of textures stays as it is.
    pub(super) fn fold_constant_textures(&mut self) {
        let values: Vec<Option<Constant>> = self.textures.iter().map(constant).collect();
        let bare = self.instances.iter().filter(|instance| self.meshes[instance.mesh.index()].uvs.is_none());
        let bare: HashSet<MaterialId> = bare.map(|instance| self.material_of(instance)).collect();
        let folded = self.materials.iter_mut().enumerate();
        for (_, material) in folded.filter(|(index, _)| !bare.contains(&MaterialId(*index as u32))) {
            for slot in Slot::ALL {
                let value = slot.of(material).and_then(|texture| *values.get(texture.texture.index())?);
                if let Some(value) = value {
                    slot.fold(material, value);
                }
            }
        }
    }

    /// Weaves the texels of images that a material reads at the same point.
    pub(super) fn weave_textures(&mut self) {
        for material in &self.materials {
            let shading = material.textures().filter(|(slot, _)| slot.shades());
            let together: Vec<usize> = shading.map(|(_, texture)| texture.texture.index()).collect();
            weave(&mut self.textures, &together);
        }
    }
}

/// What a look-up gives anywhere, if that is one value.
fn constant(texture: &Texture) -> Option<Constant> {
    if matches!(texture.texels, Texels::Udim(_)) {
        return None;
    }
    texture.texels.constant()?;
    let value = lookup(texture, glam::Vec2::splat(0.5));
    // Not a look-up of the render.
    take_lookups();
    Some(Constant { rgb: value.truncate(), alpha: value.w })
}
