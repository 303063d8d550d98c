//! KHR_materials_anisotropy: specular lobes with a grain, along the tangents of the mesh. A mesh that can have no
//! tangents shows the material without grain.

use super::super::part::Part;
use super::extension::{Extension, Place};
use crate::error::Result;
use crate::scene::Material;

pub(super) const EXTENSION: Extension = Extension { name: "KHR_materials_anisotropy", place: Place::Material(read) };

fn read(part: &Part, material: &mut Material) -> Result<()> {
    material.anisotropy = part.factor("anisotropyStrength", 0.0, (0.0, 1.0))?;
    material.anisotropy_rotation_rad = part.factor("anisotropyRotation", 0.0, (f32::MIN, f32::MAX))?;
    Ok(())
}
