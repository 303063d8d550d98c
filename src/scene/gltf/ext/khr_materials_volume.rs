//! KHR_materials_volume: transmitting surfaces that bound a solid which absorbs. A thickness above 0 says that there is
//! an inside; its value and its texture are for renderers that do not trace light through the geometry ("Thickness" in
//! the extension's text) and not read: light goes as far as the geometry says.

use glam::Vec3;

use super::super::part::Part;
use super::extension::{Extension, Place};
use crate::error::Result;
use crate::scene::Material;

pub(super) const EXTENSION: Extension = Extension { name: "KHR_materials_volume", place: Place::Material(read) };

fn read(part: &Part, material: &mut Material) -> Result<()> {
    material.thickness = part.factor("thicknessFactor", 0.0, (0.0, f32::MAX))?;
    material.attenuation_color = part.color("attenuationColor", Vec3::ONE, 1.0)?;
    material.thickness_texture = part.document.value(&part.at("thicknessTexture")).is_some();
    let distance_m = part.number("attenuationDistance", f32::INFINITY)?;
    material.attenuation_distance_m = distance_m;
    if distance_m.is_nan() || distance_m <= 0.0 {
        part.warn(&format!("attenuationDistance {distance_m} is not above 0; absorption is left out"));
        material.attenuation_distance_m = f32::INFINITY;
    }
    Ok(())
}
