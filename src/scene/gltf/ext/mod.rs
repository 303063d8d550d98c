//! glTF extensions, one file each: `ext/<name>.rs` says what is read of it and what is not. [`ALL`] lists them; a file
//! may require these and no others.
//!
//! A new extension of materials: its file here and its line in [`ALL`], its numbers in `scene::material::parameters`,
//! its textures in `scene::material::slot`.

pub(super) mod ext_lights_ies;
pub(super) mod ext_lights_image_based;
pub(super) mod ext_mesh_gpu_instancing;
#[cfg(feature = "meshopt")]
mod ext_meshopt_compression;
pub(super) mod ext_texture_webp;
mod extension;
pub(super) mod khr_animation_pointer;
#[cfg(feature = "draco")]
pub(super) mod khr_draco_mesh_compression;
pub(super) mod khr_lights_punctual;
mod khr_materials_anisotropy;
mod khr_materials_clearcoat;
mod khr_materials_diffuse_transmission;
mod khr_materials_dispersion;
mod khr_materials_emissive_strength;
mod khr_materials_ior;
mod khr_materials_iridescence;
pub(super) mod khr_materials_pbr_specular_glossiness;
mod khr_materials_sheen;
mod khr_materials_specular;
mod khr_materials_transmission;
mod khr_materials_unlit;
pub(super) mod khr_materials_variants;
mod khr_materials_volume;
mod khr_materials_volume_scatter;
mod khr_mesh_quantization;
pub(super) mod khr_node_visibility;
#[cfg(feature = "basisu")]
pub(super) mod khr_texture_basisu;
pub(super) mod khr_texture_transform;
mod texture_source;

use serde_json::Value;

use self::extension::{Extension, Place};
use super::document::Document;
use super::json::one_line;
use super::part::Part;
use crate::error::{Error, Result};
use crate::scene::Material;

/// Every extension that is read.
const ALL: &[Extension] = &[
    ext_lights_ies::EXTENSION,
    ext_lights_image_based::EXTENSION,
    ext_mesh_gpu_instancing::EXTENSION,
    #[cfg(feature = "meshopt")]
    ext_meshopt_compression::EXT,
    #[cfg(feature = "meshopt")]
    ext_meshopt_compression::KHR,
    ext_texture_webp::EXTENSION,
    khr_animation_pointer::EXTENSION,
    #[cfg(feature = "draco")]
    khr_draco_mesh_compression::EXTENSION,
    khr_lights_punctual::EXTENSION,
    khr_materials_anisotropy::EXTENSION,
    khr_materials_clearcoat::EXTENSION,
    khr_materials_diffuse_transmission::EXTENSION,
    khr_materials_dispersion::EXTENSION,
    khr_materials_emissive_strength::EXTENSION,
    khr_materials_ior::EXTENSION,
    khr_materials_iridescence::EXTENSION,
    khr_materials_pbr_specular_glossiness::EXTENSION,
    khr_materials_sheen::EXTENSION,
    khr_materials_specular::EXTENSION,
    khr_materials_transmission::EXTENSION,
    khr_materials_unlit::EXTENSION,
    khr_materials_variants::EXTENSION,
    khr_materials_volume::EXTENSION,
    khr_materials_volume_scatter::EXTENSION,
    khr_mesh_quantization::EXTENSION,
    khr_node_visibility::EXTENSION,
    #[cfg(feature = "basisu")]
    khr_texture_basisu::EXTENSION,
    khr_texture_transform::EXTENSION,
];

/// Whether an extension is read.
pub(super) fn is_known(name: &str) -> bool {
    ALL.iter().any(|extension| extension.name == name)
}

/// Refuses a file that requires what is not supported, but for extensions of materials if `some_may_miss`; warns of
/// those and of what it uses besides.
pub(super) fn check(document: &Document, some_may_miss: bool) -> Result<()> {
    for name in document.table("extensionsRequired")? {
        let name =
            name.as_str().ok_or_else(|| document.error("/extensionsRequired", "expected names of extensions"))?;
        if !is_known(name) && some_may_miss && name.contains("_materials_") {
            let fate = "is required and not supported; its materials are shown without it";
            document.warn("/extensionsRequired", format!("{} {fate}", one_line(name)));
        } else if !is_known(name) {
            return Err(Error::UnsupportedExtension { file: document.file.clone(), extension: one_line(name) });
        }
    }
    // Extensions of materials are named with their material, later.
    for name in document.table("extensionsUsed")?.iter().filter_map(Value::as_str) {
        if !is_known(name) && !name.starts_with("KHR_materials_") && !name.starts_with("KHR_texture_") {
            document.warn("/extensionsUsed", format!("{name} is not supported and ignored"));
        }
    }
    Ok(())
}

/// Reads the extensions of the material that `part` is; warns of those that are not supported.
pub(super) fn read_material(part: &Part, material: &mut Material) -> Result<()> {
    let extensions = part.at("extensions");
    for extension in ALL {
        let Place::Material(read) = extension.place else { continue };
        match part.document.value(&format!("{extensions}/{}", extension.name)) {
            None => continue,
            Some(Value::Object(_)) => {}
            Some(_) => {
                let pointer = format!("{extensions}/{}", extension.name);
                return Err(part.document.error(pointer, "expected an object"));
            }
        }
        read(&Part { path: format!("extensions/{}/", extension.name), ..*part }, material)?;
    }
    for name in unknown(part.document, &extensions, |place| matches!(place, Place::Material(_))) {
        part.warn(&format!("{name} is not supported and ignored"));
    }
    Ok(())
}

/// Names of the extensions of a texture information, the object `member` of the material that `part` is, that are not
/// supported there; with a warning each.
pub(super) fn warn_of_texture_info(part: &Part, member: &str) {
    let extensions = part.at(&format!("{member}/extensions"));
    for name in unknown(part.document, &extensions, |place| matches!(place, Place::TextureInfo)) {
        part.warn(&format!("{name} of {member} is not supported and ignored"));
    }
}

/// Names in the object at `pointer` that are no extension of such a place.
fn unknown<'d>(document: &'d Document, pointer: &str, fits: fn(Place) -> bool) -> impl Iterator<Item = &'d String> {
    let names = document.value(pointer).and_then(Value::as_object).into_iter().flat_map(|members| members.keys());
    names.filter(move |name| !ALL.iter().any(|extension| extension.name == **name && fits(extension.place)))
}
