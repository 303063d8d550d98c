//! KHR_materials_emissive_strength: a factor of `emissiveFactor`, so that emission can exceed 1.

use super::super::part::Part;
use super::extension::{Extension, Place};
use crate::error::Result;
use crate::scene::Material;

pub(super) const EXTENSION: Extension =
    Extension { name: "KHR_materials_emissive_strength", place: Place::Material(read) };

fn read(part: &Part, material: &mut Material) -> Result<()> {
    material.emissive *= part.factor("emissiveStrength", 1.0, (0.0, f32::MAX))?;
    if !material.emissive.is_finite() {
        let problem = "expected a finite product of emissiveFactor and emissiveStrength";
        return Err(part.document.error(part.material, problem));
    }
    Ok(())
}
