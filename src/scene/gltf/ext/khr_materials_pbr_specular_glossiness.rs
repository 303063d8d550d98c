//! KHR_materials_pbrSpecularGlossiness: the older model, read as metallic-roughness without metal. It takes the place
//! of `pbrMetallicRoughness`, whose members are then for other readers.
//!
//! KHR_materials_ior has the index 0 for this conversion: Fresnel's term is 1, so that KHR_materials_specular alone
//! says F0. Specular colour, diffuse colour and 1 − glossiness are then F0, base colour and roughness, texel by
//! texel. What is left below is the base's share here (see `shading::bsdf::glossy`) where the extension has 1 −
//! max(F0) for every direction.

use glam::Vec3;

use super::super::part::Part;
use super::extension::{Extension, Place};
use crate::error::Result;
use crate::scene::{Material, Slot};

pub(super) const EXTENSION: Extension =
    Extension { name: "KHR_materials_pbrSpecularGlossiness", place: Place::Material(read) };

/// Where its textures stand.
const DIFFUSE: &str = "extensions/KHR_materials_pbrSpecularGlossiness/diffuseTexture";

fn read(part: &Part, material: &mut Material) -> Result<()> {
    material.base_color = part.color_of_four("diffuseFactor", Vec3::ONE)?;
    material.base_alpha = part.factor("diffuseFactor/3", 1.0, (0.0, 1.0))?;
    material.metallic = 0.0;
    material.roughness = 1.0 - part.factor("glossinessFactor", 1.0, (0.0, 1.0))?;
    material.ior = 0.0;
    material.specular = 1.0;
    material.specular_color = part.color("specularFactor", Vec3::ONE, 1.0)?;
    Ok(())
}

/// Where the texture of a slot stands in a material that has the extension.
pub(crate) fn member(slot: Slot) -> Option<&'static str> {
    match slot {
        Slot::BaseColor => Some(DIFFUSE),
        Slot::SpecularColor | Slot::Glossiness => Some(Slot::Glossiness.member()),
        Slot::MetallicRoughness | Slot::Specular => None,
        other => Some(other.member()),
    }
}

/// Whether the material that `part` is has the extension.
pub(crate) fn is_used(part: &Part) -> bool {
    part.document.value(&part.at(&format!("extensions/{}", EXTENSION.name))).is_some()
}
