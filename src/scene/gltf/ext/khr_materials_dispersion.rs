//! KHR_materials_dispersion: solids whose index of refraction depends on the wavelength.

use super::super::part::Part;
use super::extension::{Extension, Place};
use crate::error::Result;
use crate::scene::Material;

pub(super) const EXTENSION: Extension = Extension { name: "KHR_materials_dispersion", place: Place::Material(read) };

fn read(part: &Part, material: &mut Material) -> Result<()> {
    material.dispersion = part.factor("dispersion", 0.0, (0.0, f32::MAX))?;
    Ok(())
}
