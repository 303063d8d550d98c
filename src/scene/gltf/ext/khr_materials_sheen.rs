//! KHR_materials_sheen: fibres over the material, by colour and roughness.

use glam::Vec3;

use super::super::part::Part;
use super::extension::{Extension, Place};
use crate::error::Result;
use crate::scene::Material;

pub(super) const EXTENSION: Extension = Extension { name: "KHR_materials_sheen", place: Place::Material(read) };

fn read(part: &Part, material: &mut Material) -> Result<()> {
    material.sheen_color = part.color("sheenColorFactor", Vec3::ZERO, 1.0)?;
    material.sheen_roughness = part.factor("sheenRoughnessFactor", 0.0, (0.0, 1.0))?;
    Ok(())
}
