//! KHR_materials_clearcoat: a dielectric layer over the material, with its own normal map or the normals of the mesh.

use super::super::part::Part;
use super::extension::{Extension, Place};
use crate::error::Result;
use crate::scene::Material;

pub(super) const EXTENSION: Extension = Extension { name: "KHR_materials_clearcoat", place: Place::Material(read) };

fn read(part: &Part, material: &mut Material) -> Result<()> {
    material.clearcoat = part.factor("clearcoatFactor", 0.0, (0.0, 1.0))?;
    material.clearcoat_roughness = part.factor("clearcoatRoughnessFactor", 0.0, (0.0, 1.0))?;
    let scale = part.number("clearcoatNormalTexture/scale", 1.0)?;
    material.clearcoat_normal_scale = part.document.finite(scale, &part.at("clearcoatNormalTexture/scale"))?;
    Ok(())
}
