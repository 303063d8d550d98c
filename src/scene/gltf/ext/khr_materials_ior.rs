//! KHR_materials_ior: index of refraction of dielectrics. 0, which the text has for files converted from
//! specular-glossiness, makes Fresnel's term 1 in every direction, so that KHR_materials_specular alone says how much
//! is reflected: nothing is transmitted. Other values below 1 are clamped to it.

use super::super::part::Part;
use super::extension::{Extension, Place};
use crate::error::Result;
use crate::scene::Material;

pub(super) const EXTENSION: Extension = Extension { name: "KHR_materials_ior", place: Place::Material(read) };

fn read(part: &Part, material: &mut Material) -> Result<()> {
    material.ior = match part.number("ior", 1.5)? {
        0.0 => 0.0,
        ior => part.in_range(ior, "ior", (1.0, f32::MAX))?,
    };
    Ok(())
}
