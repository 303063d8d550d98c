//! Materials: glTF metallic-roughness, with the textures that `scene::material::slot` lists and the extensions of
//! `ext`. Everything else that a material asks for becomes a warning that names the material.
//!
//! Source: glTF 2.0 §5.19–5.22. Factors outside their range are clamped with a warning; infinite ones are errors.

use std::collections::{HashMap, HashSet};

use gltf::json;
use serde_json::Value;

use super::super::{AlphaMode, Material, MaterialId, Slot, TextureSlot};
use super::document::Document;
use super::ext::{self, khr_materials_pbr_specular_glossiness, khr_texture_transform};
use super::image::TextureTable;
use super::part::Part;
use super::uv::UvChannel;
use crate::error::Result;

/// The materials read so far and the textures they ask for.
pub(super) struct MaterialTable {
    pub(super) materials: Vec<Material>,
    pub(super) textures: TextureTable,
    /// What each of `materials` reads of the texture coordinates; a slot's `uv_set` is a place in it.
    channels: Vec<Vec<UvChannel>>,
    default: Option<MaterialId>,
    variants: HashMap<(MaterialId, Variant), MaterialId>,
}

/// How a mesh can need another material than the file's.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Variant {
    /// It has no tangents.
    WithoutTangents,
    /// It has vertex colours.
    VertexColors,
    /// It has vertex colours and no texture coordinates.
    VertexColorsAlone,
}

impl MaterialTable {
    /// Reads those of `/materials` that are in use; the others are there with their names alone, and what they refer to
    /// is neither read nor missed.
    pub(super) fn read(document: &Document, in_use: &HashSet<usize>) -> Result<MaterialTable> {
        let mut table = MaterialTable {
            materials: Vec::new(),
            textures: TextureTable::default(),
            channels: Vec::new(),
            default: None,
            variants: HashMap::new(),
        };
        for index in 0..document.table("materials")?.len() {
            let pointer = format!("/materials/{index}");
            if !in_use.contains(&index) {
                let name = document.value(&format!("{pointer}/name")).and_then(Value::as_str);
                let name = name.map_or_else(|| format!("material {index}"), str::to_owned);
                table.materials.push(Material { name, ..Material::default() });
                table.channels.push(Vec::new());
                continue;
            }
            let source: json::Material = document.element("materials", index, &pointer)?;
            let name = source.name.clone().unwrap_or_else(|| format!("material {index}"));
            let mut channels = Vec::new();
            let textures = &mut table.textures;
            let part = Part { document, material: &pointer, name: &name, path: String::new() };
            let material = Reader { document, textures, channels: &mut channels, part }.read(&source)?;
            table.materials.push(material);
            table.channels.push(channels);
        }
        Ok(table)
    }

    /// glTF's default material, appended when it is first needed.
    pub(super) fn default_material(&mut self) -> MaterialId {
        *self.default.get_or_insert_with(|| {
            self.materials.push(Material::default());
            self.channels.push(Vec::new());
            MaterialId(self.materials.len() as u32 - 1)
        })
    }

    /// A copy of `material` for meshes that need it otherwise, made when it is first needed.
    pub(super) fn variant(&mut self, material: MaterialId, variant: Variant) -> MaterialId {
        *self.variants.entry((material, variant)).or_insert_with(|| {
            let mut copy = self.materials[material.index()].clone();
            let drops = |slot: Slot| match variant {
                Variant::WithoutTangents => slot.is_normal_map(),
                Variant::VertexColors => false,
                Variant::VertexColorsAlone => true,
            };
            for slot in Slot::ALL.into_iter().filter(|&slot| drops(slot)) {
                if let Some(texture) = slot.of_mut(&mut copy) {
                    *texture = None;
                }
            }
            if variant == Variant::WithoutTangents {
                copy.anisotropy = 0.0;
            }
            copy.vertex_colors |= variant != Variant::WithoutTangents;
            self.materials.push(copy);
            self.channels.push(self.channels[material.index()].clone());
            MaterialId(self.materials.len() as u32 - 1)
        })
    }

    /// Whether one mesh serves two materials of the file: they are alike, and read the same texture coordinates.
    pub(super) fn may_share(&self, a: MaterialId, b: MaterialId) -> bool {
        let material = |id: MaterialId| self.materials.get(id.index());
        material(a).zip(material(b)).is_some_and(|(a, b)| a.may_share(b)) && self.channels(a) == self.channels(b)
    }

    /// The channels of texture coordinates that `material` reads.
    pub(super) fn channels(&self, material: MaterialId) -> &[UvChannel] {
        &self.channels[material.index()]
    }
}

/// Reads a material's own members, its extensions, and its textures.
struct Reader<'d, 't> {
    document: &'d Document,
    textures: &'t mut TextureTable,
    channels: &'t mut Vec<UvChannel>,
    /// The material as an object.
    part: Part<'d>,
}

impl Reader<'_, '_> {
    fn read(mut self, source: &json::Material) -> Result<Material> {
        let mut material = self.factors(source)?;
        ext::read_material(&self.part, &mut material)?;
        if material.ior == 0.0 && material.transmission > 0.0 {
            self.part.warn("ior 0 reflects everything: nothing is transmitted");
            material.transmission = 0.0;
        }
        let glossy = khr_materials_pbr_specular_glossiness::is_used(&self.part);
        for slot in Slot::ALL {
            let member = if glossy {
                khr_materials_pbr_specular_glossiness::member(slot)
            } else {
                (slot != Slot::Glossiness).then_some(slot.member())
            };
            let Some(member) = member else { continue };
            let info = self.document.value(&self.part.at(member));
            if let Some((info, place)) = info.zip(slot.of_mut(&mut material)) {
                *place = self.texture(slot, member, info)?;
            }
        }
        Ok(material)
    }

    fn factors(&self, source: &json::Material) -> Result<Material> {
        let (document, part) = (self.document, &self.part);
        let pbr = &source.pbr_metallic_roughness;
        let [red, green, blue, alpha] = pbr.base_color_factor.0;
        let base_color = "pbrMetallicRoughness/baseColorFactor";
        let unit = (0.0, 1.0);
        let alpha_mode = match document.checked(source.alpha_mode, &part.at("alphaMode"))? {
            json::material::AlphaMode::Opaque => AlphaMode::Opaque,
            json::material::AlphaMode::Mask => {
                let cutoff = source.alpha_cutoff.unwrap_or_default().0;
                AlphaMode::Mask { cutoff: document.finite(cutoff, &part.at("alphaCutoff"))? }
            }
            json::material::AlphaMode::Blend => AlphaMode::Blend,
        };
        let normal_scale = source.normal_texture.as_ref().map_or(1.0, |normal| normal.scale);
        Ok(Material {
            base_color: part.color_in_range([red, green, blue], base_color, 1.0)?,
            base_alpha: part.in_range(alpha, base_color, unit)?,
            metallic: part.in_range(pbr.metallic_factor.0, "pbrMetallicRoughness/metallicFactor", unit)?,
            roughness: part.in_range(pbr.roughness_factor.0, "pbrMetallicRoughness/roughnessFactor", unit)?,
            emissive: part.color_in_range(source.emissive_factor.0, "emissiveFactor", f32::MAX)?,
            normal_scale: document.finite(normal_scale, &part.at("normalTexture/scale"))?,
            occlusion_texture: source.occlusion_texture.is_some(),
            double_sided: source.double_sided,
            alpha_mode,
            name: part.name.into(),
            ..Material::default()
        })
    }

    /// The texture of a slot, as its texture information `info` says; `None`, with a warning, if its image is in a
    /// format of an extension.
    fn texture(&mut self, slot: Slot, member: &str, info: &Value) -> Result<Option<TextureSlot>> {
        let pointer = self.part.at(member);
        let info: json::texture::Info = self.document.typed(info, &pointer)?;
        let channel = khr_texture_transform::channel(self.document, info.tex_coord, &pointer)?;
        ext::warn_of_texture_info(&self.part, member);
        let from = format!("{pointer}/index");
        let texture = self.textures.request(self.document, info.index.value(), slot, &from)?;
        let Some(texture) = texture else { return Ok(None) };
        let place = self.channels.iter().position(|known| *known == channel).unwrap_or_else(|| {
            self.channels.push(channel);
            self.channels.len() - 1
        });
        Ok(Some(TextureSlot { texture, uv_set: place as u32 }))
    }
}
