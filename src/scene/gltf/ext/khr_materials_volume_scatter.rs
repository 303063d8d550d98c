//! KHR_materials_volume_scatter (draft): solids that scatter inside. `multiscatterColor` (newer drafts:
//! `multiscatterColorFactor`) is the albedo of many scatterings, `scatterAnisotropy` the mean cosine. Limit: factors
//! only.

use glam::Vec3;

use super::super::part::Part;
use super::extension::{Extension, Place};
use crate::error::Result;
use crate::scene::Material;

pub(super) const EXTENSION: Extension =
    Extension { name: "KHR_materials_volume_scatter", place: Place::Material(read) };

fn read(part: &Part, material: &mut Material) -> Result<()> {
    let color = part.color("multiscatterColor", Vec3::ZERO, 1.0)?;
    material.multiscatter_color = part.color("multiscatterColorFactor", color, 1.0)?;
    material.scatter_anisotropy = part.factor("scatterAnisotropy", 0.0, (-1.0, 1.0))?;
    if part.document.value(&part.at("multiscatterColorTexture")).is_some() {
        part.warn("multiscatterColorTexture is not supported and ignored");
    }
    Ok(())
}
