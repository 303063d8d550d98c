//! KHR_materials_specular: strength and colour of the dielectric coat.

use glam::Vec3;

use super::super::part::Part;
use super::extension::{Extension, Place};
use crate::error::Result;
use crate::scene::Material;

pub(super) const EXTENSION: Extension = Extension { name: "KHR_materials_specular", place: Place::Material(read) };

fn read(part: &Part, material: &mut Material) -> Result<()> {
    material.specular = part.factor("specularFactor", 1.0, (0.0, 1.0))?;
    material.specular_color = part.color("specularColorFactor", Vec3::ONE, f32::MAX)?;
    Ok(())
}
