//! KHR_materials_diffuse_transmission: a diffuse base that lets light pass. Limit: with KHR_materials_volume, the
//! inside is not entered: light leaves the other side of the same point, and nothing is absorbed.

use glam::Vec3;

use super::super::part::Part;
use super::extension::{Extension, Place};
use crate::error::Result;
use crate::scene::Material;

pub(super) const EXTENSION: Extension =
    Extension { name: "KHR_materials_diffuse_transmission", place: Place::Material(read) };

fn read(part: &Part, material: &mut Material) -> Result<()> {
    material.diffuse_transmission = part.factor("diffuseTransmissionFactor", 0.0, (0.0, 1.0))?;
    material.diffuse_transmission_color = part.color("diffuseTransmissionColorFactor", Vec3::ONE, 1.0)?;
    Ok(())
}
