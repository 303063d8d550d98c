//! Textures that have one value everywhere become factors of their materials, so that nothing looks them up.
//!
//! A base colour keeps its texture where the texture's alpha is below 1: alpha is not a factor of the colour. A normal map
//! is left out where it is flat, x and y one of the two codes nearest to ½, which 8 bits cannot say exactly.
//!
//! Images that are still read together afterwards are laid side by side.

use glam::Vec3;

use super::{Scene, Texture, TextureSlot};
use crate::texture::{Texels, lookup, take_lookups, weave};

impl Scene {
    /// Folds what is constant. The list of textures stays as it is.
    pub(super) fn fold_constant_textures(&mut self) {
        let values: Vec<Option<Constant>> = self.textures.iter().map(Constant::of).collect();
        let value =
            |slot: Option<TextureSlot>| slot.and_then(|slot| values.get(slot.texture.index()).copied().flatten());
        for material in &mut self.materials {
            if let Some(constant) = value(material.base_color_texture).filter(|constant| constant.alpha == 1.0) {
                material.base_color *= constant.rgb;
                material.base_color_texture = None;
            }
            if let Some(constant) = value(material.metallic_roughness_texture) {
                material.roughness *= constant.rgb.y;
                material.metallic *= constant.rgb.z;
                material.metallic_roughness_texture = None;
            }
            if let Some(constant) = value(material.emissive_texture) {
                material.emissive *= constant.rgb;
                material.emissive_texture = None;
            }
            if value(material.normal_texture).is_some_and(|constant| constant.is_flat_normal()) {
                material.normal_texture = None;
            }
        }
    }
}

impl Scene {
    /// Weaves the texels of images that a material reads at the same point.
    pub(super) fn weave_textures(&mut self) {
        for material in &self.materials {
            let slots = [material.base_color_texture, material.metallic_roughness_texture, material.normal_texture];
            let together: Vec<usize> = slots.into_iter().flatten().map(|slot| slot.texture.index()).collect();
            weave(&mut self.textures, &together);
        }
    }
}

/// What a look-up gives anywhere.
#[derive(Clone, Copy)]
struct Constant {
    rgb: Vec3,
    alpha: f32,
}

impl Constant {
    fn of(texture: &Texture) -> Option<Constant> {
        if matches!(texture.texels, Texels::Udim(_)) {
            return None;
        }
        texture.texels.constant()?;
        let value = lookup(texture, glam::Vec2::splat(0.5));
        // Not a look-up of the render.
        take_lookups();
        Some(Constant { rgb: value.truncate(), alpha: value.w })
    }

    fn is_flat_normal(&self) -> bool {
        let half = |x: f32| (x - 0.5).abs() < 0.6 / 255.0;
        half(self.rgb.x) && half(self.rgb.y) && self.rgb.z == 1.0
    }
}
