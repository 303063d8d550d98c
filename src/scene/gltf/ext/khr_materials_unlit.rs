//! KHR_materials_unlit: the surface shows its base colour and neither receives nor scatters light.

use super::super::part::Part;
use super::extension::{Extension, Place};
use crate::error::Result;
use crate::scene::Material;

pub(super) const EXTENSION: Extension = Extension { name: "KHR_materials_unlit", place: Place::Material(read) };

fn read(_part: &Part, material: &mut Material) -> Result<()> {
    material.unlit = true;
    Ok(())
}
