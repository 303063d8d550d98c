//! Materials as the file states them: glTF 2.0 metallic-roughness with the KHR extensions that pathspace reads.
//! Factors are linear Rec.709. What is simulated of them is the plan's decision.

use glam::Vec3;

use super::alpha::AlphaMode;
use super::ids::TextureId;

/// A texture bound to a material slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureSlot {
    /// The texture (image and sampler).
    pub texture: TextureId,
    /// Which channel of the mesh's texture coordinates it reads: 0 is [`Mesh::uvs`](super::Mesh::uvs), above it
    /// [`Mesh::more_uvs`](super::Mesh::more_uvs). Transforms of KHR_texture_transform are already applied there.
    pub uv_set: u32,
}

/// One glTF material. Defaults are those of the specification.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file, or `material N`.
    pub name: String,
    /// `baseColorFactor` RGB in [0, 1].
    pub base_color: Vec3,
    /// sRGB texture multiplied into `base_color`; its alpha into `base_alpha`.
    pub base_color_texture: Option<TextureSlot>,
    /// `baseColorFactor` A in [0, 1]; read as `alpha_mode` says.
    pub base_alpha: f32,
    /// `alphaMode` with its cutoff.
    pub alpha_mode: AlphaMode,
    /// Whether [`Mesh::colors`](super::Mesh::colors) are multiplied into base colour and alpha.
    pub vertex_colors: bool,
    /// Whether the file has an `occlusionTexture`; recorded, because light transport computes occlusion itself.
    pub occlusion_texture: bool,
    /// `metallicFactor` in [0, 1].
    pub metallic: f32,
    /// `roughnessFactor` in [0, 1]; GGX alpha is its square.
    pub roughness: f32,
    /// Linear texture: G multiplies roughness, B multiplies metallic.
    pub metallic_roughness_texture: Option<TextureSlot>,
    /// Tangent-space normal map (linear).
    pub normal_texture: Option<TextureSlot>,
    /// `normalTexture.scale`, multiplies x and y of the decoded normal.
    pub normal_scale: f32,
    /// `emissiveFactor` × `emissiveStrength`: radiance of the front side.
    pub emissive: Vec3,
    /// sRGB texture multiplied into `emissive`.
    pub emissive_texture: Option<TextureSlot>,
    /// `KHR_materials_specular.specularFactor` in [0, 1]. 0 with metallic 0 is an exact Lambert surface.
    pub specular: f32,
    /// `KHR_materials_specular.specularColorFactor`, ≥ 0.
    pub specular_color: Vec3,
    /// `KHR_materials_ior.ior`, ≥ 1.
    pub ior: f32,
    /// `KHR_materials_transmission.transmissionFactor` in [0, 1].
    pub transmission: f32,
    /// `KHR_materials_volume.thicknessFactor` ≥ 0; 0 means thin-walled, above 0 a solid dielectric.
    pub thickness: f32,
    /// Colour that white light has after `attenuation_distance_m` inside a solid dielectric.
    pub attenuation_color: Vec3,
    /// Metres; infinite means no absorption.
    pub attenuation_distance_m: f32,
    /// `KHR_materials_unlit`: shows its base colour and neither receives nor scatters light.
    pub unlit: bool,
    /// glTF `doubleSided`; recorded, both sides are shaded either way.
    pub double_sided: bool,
}

impl Default for Material {
    fn default() -> Self {
        Material {
            name: "default".into(),
            base_color: Vec3::ONE,
            base_color_texture: None,
            base_alpha: 1.0,
            alpha_mode: AlphaMode::Opaque,
            vertex_colors: false,
            occlusion_texture: false,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            emissive: Vec3::ZERO,
            emissive_texture: None,
            specular: 1.0,
            specular_color: Vec3::ONE,
            ior: 1.5,
            transmission: 0.0,
            thickness: 0.0,
            attenuation_color: Vec3::ONE,
            attenuation_distance_m: f32::INFINITY,
            unlit: false,
            double_sided: false,
        }
    }
}

impl Material {
    /// Number of channels of texture coordinates that the slots read.
    pub fn uv_channels(&self) -> usize {
        self.slots().into_iter().flatten().map(|slot| slot.uv_set as usize + 1).max().unwrap_or(0)
    }

    /// Every texture slot, filled or not.
    pub fn slots(&self) -> [Option<TextureSlot>; 4] {
        [self.base_color_texture, self.metallic_roughness_texture, self.normal_texture, self.emissive_texture]
    }

    /// Whether any slot is textured, so that texture coordinates are needed.
    pub fn reads_textures(&self) -> bool {
        self.slots().iter().any(Option::is_some)
    }

    /// The most that the surface can reflect of light from any direction, by channel: the base colour of an exact Lambert
    /// surface (textures only lower it), 1 where there is a metal, a coat or transmission, 0 for unlit.
    pub fn reflectance_bound(&self) -> Vec3 {
        let lambert = self.metallic == 0.0 && self.specular == 0.0 && self.transmission == 0.0;
        match (self.unlit, lambert) {
            (true, _) => Vec3::ZERO,
            (false, true) => self.base_color,
            (false, false) => Vec3::ONE,
        }
    }

    /// Whether the surface can emit light by itself (area light).
    pub fn is_emissive(&self) -> bool {
        !self.unlit && self.emissive.max_element() > 0.0
    }
}
