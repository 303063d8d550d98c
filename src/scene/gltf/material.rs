//! Materials: glTF metallic-roughness and the KHR extensions that pathspace reads. Everything else that a material asks for
//! becomes a warning that names the material.
//!
//! Source: glTF 2.0 §5.19–5.22 and the KHR_materials_* specifications. Factors outside their range are clamped with a warning;
//! infinite ones are errors.

use std::collections::HashMap;

use glam::Vec3;
use gltf::json;

use super::super::{AlphaMode, ColorSpace, Material, MaterialId, TextureSlot};
use super::document::Document;
use super::image::TextureTable;
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
    WithoutNormalMap,
    /// It has vertex colours.
    VertexColors,
    /// It has vertex colours and no texture coordinates.
    VertexColorsAlone,
}

impl MaterialTable {
    /// Reads all of `/materials`.
    pub(super) fn read(document: &Document) -> Result<MaterialTable> {
        let mut table = MaterialTable {
            materials: Vec::new(),
            textures: TextureTable::default(),
            channels: Vec::new(),
            default: None,
            variants: HashMap::new(),
        };
        for index in 0..document.table("materials")?.len() {
            let pointer = format!("/materials/{index}");
            let source: json::Material = document.element("materials", index, &pointer)?;
            let name = source.name.clone().unwrap_or_else(|| format!("material {index}"));
            let mut channels = Vec::new();
            let textures = &mut table.textures;
            let material = Reader { document, textures, channels: &mut channels, pointer, name }.read(&source)?;
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
            let original = self.materials[material.index()].clone();
            self.materials.push(match variant {
                Variant::WithoutNormalMap => Material { normal_texture: None, ..original },
                Variant::VertexColors => Material { vertex_colors: true, ..original },
                Variant::VertexColorsAlone => Material {
                    vertex_colors: true,
                    base_color_texture: None,
                    metallic_roughness_texture: None,
                    normal_texture: None,
                    emissive_texture: None,
                    ..original
                },
            });
            self.channels.push(self.channels[material.index()].clone());
            MaterialId(self.materials.len() as u32 - 1)
        })
    }

    /// The channels of texture coordinates that `material` reads.
    pub(super) fn channels(&self, material: MaterialId) -> &[UvChannel] {
        &self.channels[material.index()]
    }
}

struct Reader<'d, 't> {
    document: &'d Document,
    textures: &'t mut TextureTable,
    channels: &'t mut Vec<UvChannel>,
    pointer: String,
    name: String,
}

impl Reader<'_, '_> {
    fn read(mut self, source: &json::Material) -> Result<Material> {
        let pbr = &source.pbr_metallic_roughness;
        let [red, green, blue, alpha] = pbr.base_color_factor.0;
        let specification = Material::default();
        let mut material = Material {
            base_color: self.color([red, green, blue], "pbrMetallicRoughness/baseColorFactor", 1.0)?,
            base_alpha: self.factor(alpha, "pbrMetallicRoughness/baseColorFactor", 0.0, 1.0)?,
            metallic: self.factor(pbr.metallic_factor.0, "pbrMetallicRoughness/metallicFactor", 0.0, 1.0)?,
            roughness: self.factor(pbr.roughness_factor.0, "pbrMetallicRoughness/roughnessFactor", 0.0, 1.0)?,
            emissive: self.color(source.emissive_factor.0, "emissiveFactor", f32::MAX)?,
            double_sided: source.double_sided,
            name: self.name.clone(),
            ..specification
        };
        material.base_color_texture =
            self.slot(pbr.base_color_texture.as_ref(), ColorSpace::Srgb, "pbrMetallicRoughness/baseColorTexture")?;
        material.metallic_roughness_texture = self.slot(
            pbr.metallic_roughness_texture.as_ref(),
            ColorSpace::Linear,
            "pbrMetallicRoughness/metallicRoughnessTexture",
        )?;
        material.emissive_texture = self.slot(source.emissive_texture.as_ref(), ColorSpace::Srgb, "emissiveTexture")?;
        if let Some(normal) = &source.normal_texture {
            material.normal_scale = self.document.finite(normal.scale, &self.at("normalTexture/scale"))?;
            material.normal_texture =
                self.texture(normal.index.value(), normal.tex_coord, ColorSpace::Linear, "normalTexture")?;
        }
        material.occlusion_texture = source.occlusion_texture.is_some();
        material.alpha_mode = match self.document.checked(source.alpha_mode, &self.at("alphaMode"))? {
            json::material::AlphaMode::Opaque => AlphaMode::Opaque,
            json::material::AlphaMode::Mask => {
                let cutoff = source.alpha_cutoff.unwrap_or_default().0;
                AlphaMode::Mask { cutoff: self.document.finite(cutoff, &self.at("alphaCutoff"))? }
            }
            json::material::AlphaMode::Blend => AlphaMode::Blend,
        };
        if let Some(extensions) = &source.extensions {
            self.extensions(extensions, &mut material)?;
        }
        if !material.emissive.is_finite() {
            return Err(self
                .document
                .error(&self.pointer, "expected a finite product of emissiveFactor and emissiveStrength"));
        }
        Ok(material)
    }

    fn extensions(&mut self, extensions: &json::extensions::material::Material, material: &mut Material) -> Result<()> {
        if let Some(strength) = &extensions.emissive_strength {
            let member = "extensions/KHR_materials_emissive_strength/emissiveStrength";
            material.emissive *= self.factor(strength.emissive_strength.0, member, 0.0, f32::MAX)?;
        }
        if let Some(specular) = &extensions.specular {
            let member = |name: &str| format!("extensions/KHR_materials_specular/{name}");
            material.specular = self.factor(specular.specular_factor.0, &member("specularFactor"), 0.0, 1.0)?;
            material.specular_color =
                self.color(specular.specular_color_factor.0, &member("specularColorFactor"), f32::MAX)?;
            self.ignored_texture(specular.specular_texture.is_some(), "specularTexture");
            self.ignored_texture(specular.specular_color_texture.is_some(), "specularColorTexture");
        }
        if let Some(ior) = &extensions.ior {
            // 0 stands for a mirror of every colour in files converted from specular-glossiness; it is clamped like the rest.
            material.ior = self.factor(ior.ior.0, "extensions/KHR_materials_ior/ior", 1.0, f32::MAX)?;
        }
        if let Some(transmission) = &extensions.transmission {
            let member = "extensions/KHR_materials_transmission/transmissionFactor";
            material.transmission = self.factor(transmission.transmission_factor.0, member, 0.0, 1.0)?;
            self.ignored_texture(transmission.transmission_texture.is_some(), "transmissionTexture");
        }
        if let Some(volume) = &extensions.volume {
            let member = |name: &str| format!("extensions/KHR_materials_volume/{name}");
            material.thickness = self.factor(volume.thickness_factor.0, &member("thicknessFactor"), 0.0, f32::MAX)?;
            material.attenuation_color = self.color(volume.attenuation_color.0, &member("attenuationColor"), 1.0)?;
            self.ignored_texture(volume.thickness_texture.is_some(), "thicknessTexture");
            let distance = volume.attenuation_distance.0;
            material.attenuation_distance_m = distance;
            if distance.is_nan() || distance <= 0.0 {
                self.warn(&format!("attenuationDistance {distance} is not above 0; absorption is left out"));
                material.attenuation_distance_m = f32::INFINITY;
            }
        }
        material.unlit = extensions.unlit.is_some();
        for name in extensions.others.keys() {
            self.warn(&format!("{name} is not supported and ignored"));
        }
        Ok(())
    }

    fn slot(
        &mut self,
        info: Option<&json::texture::Info>,
        color_space: ColorSpace,
        member: &str,
    ) -> Result<Option<TextureSlot>> {
        match info {
            Some(info) => self.texture(info.index.value(), info.tex_coord, color_space, member),
            None => Ok(None),
        }
    }

    fn texture(
        &mut self,
        index: usize,
        uv_set: u32,
        color_space: ColorSpace,
        member: &str,
    ) -> Result<Option<TextureSlot>> {
        let pointer = self.at(member);
        let channel = UvChannel::read(self.document, uv_set, &pointer)?;
        if let Some(extensions) =
            self.document.value(&format!("{pointer}/extensions")).and_then(|value| value.as_object())
        {
            for name in extensions.keys().filter(|name| *name != "KHR_texture_transform") {
                self.warn(&format!("{name} of {member} is not supported and ignored"));
            }
        }
        let texture = self.textures.request(self.document, index, color_space, &format!("{pointer}/index"))?;
        let Some(texture) = texture else { return Ok(None) };
        let place = self.channels.iter().position(|known| *known == channel).unwrap_or_else(|| {
            self.channels.push(channel);
            self.channels.len() - 1
        });
        Ok(Some(TextureSlot { texture, uv_set: place as u32 }))
    }

    fn ignored_texture(&self, present: bool, member: &str) {
        if present {
            self.warn(&format!("{member} is not supported and ignored; its factor is used alone"));
        }
    }

    fn color(&self, color: [f32; 3], member: &str, most: f32) -> Result<Vec3> {
        let mut clamped = [0.0; 3];
        for (channel, value) in clamped.iter_mut().zip(color) {
            *channel = self.factor(value, member, 0.0, most)?;
        }
        Ok(clamped.into())
    }

    /// A factor in its range: clamped with a warning, an error if it is not finite.
    fn factor(&self, value: f32, member: &str, least: f32, most: f32) -> Result<f32> {
        let value = self.document.finite(value, &self.at(member))?;
        let clamped = value.clamp(least, most);
        if clamped != value {
            self.warn(&format!("{member} {value} is out of range and clamped to {clamped}"));
        }
        Ok(clamped)
    }

    fn at(&self, member: &str) -> String {
        format!("{}/{member}", self.pointer)
    }

    fn warn(&self, what: &str) {
        self.document.warn(format!("material \"{}\"", self.name), what);
    }
}
