//! KHR_materials_iridescence: a thin film on the specular lobes.

use super::super::part::Part;
use super::extension::{Extension, Place};
use crate::error::Result;
use crate::scene::Material;

pub(super) const EXTENSION: Extension = Extension { name: "KHR_materials_iridescence", place: Place::Material(read) };

fn read(part: &Part, material: &mut Material) -> Result<()> {
    material.iridescence = part.factor("iridescenceFactor", 0.0, (0.0, 1.0))?;
    material.iridescence_ior = part.factor("iridescenceIor", 1.3, (1.0, f32::MAX))?;
    let least = part.factor("iridescenceThicknessMinimum", 100.0, (0.0, f32::MAX))?;
    let most = part.factor("iridescenceThicknessMaximum", 400.0, (0.0, f32::MAX))?;
    material.iridescence_thickness_nm = [least, most];
    Ok(())
}
