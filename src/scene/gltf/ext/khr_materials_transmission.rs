//! KHR_materials_transmission: the fraction of light that a dielectric's surface lets through.

use super::super::part::Part;
use super::extension::{Extension, Place};
use crate::error::Result;
use crate::scene::Material;

pub(super) const EXTENSION: Extension = Extension { name: "KHR_materials_transmission", place: Place::Material(read) };

fn read(part: &Part, material: &mut Material) -> Result<()> {
    material.transmission = part.factor("transmissionFactor", 0.0, (0.0, 1.0))?;
    Ok(())
}
