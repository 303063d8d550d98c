//! Materials as the file states them: glTF 2.0 metallic-roughness with the KHR extensions that pathspace reads.
//! Factors are linear Rec.709. What is simulated of them is the plan's decision.

use glam::Vec3;

use super::super::ids::TextureId;
use super::alpha::AlphaMode;

/// A texture bound to a material slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureSlot {
    /// The texture (image and sampler).
    pub texture: TextureId,
    /// Which channel of the mesh's texture coordinates it reads: 0 is [`Mesh::uvs`](crate::scene::Mesh::uvs), above it
    /// [`Mesh::more_uvs`](crate::scene::Mesh::more_uvs). Transforms of KHR_texture_transform are already applied there.
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
    /// Whether [`Mesh::colors`](crate::scene::Mesh::colors) are multiplied into base colour and alpha.
    pub vertex_colors: bool,
    /// Whether the file has an `occlusionTexture`; recorded, because light transport computes occlusion itself.
    pub occlusion_texture: bool,
    /// `metallicFactor` in [0, 1].
    pub metallic: f32,
    /// `roughnessFactor` in [0, 1]; GGX alpha is its square.
    pub roughness: f32,
    /// Linear texture whose A multiplies 1 − `roughness`: the glossiness of KHR_materials_pbrSpecularGlossiness.
    pub glossiness_texture: Option<TextureSlot>,
    /// Linear texture: G multiplies roughness, B multiplies metallic.
    pub metallic_roughness_texture: Option<TextureSlot>,
    /// Tangent-space normal map (linear).
    pub normal_texture: Option<TextureSlot>,
    /// `normalTexture.scale`, multiplies x and y of the decoded normal.
    pub normal_scale: f32,
    /// `emissiveFactor` × `emissiveStrength`: radiance of the front side, and of the back of what is `double_sided`.
    pub emissive: Vec3,
    /// sRGB texture multiplied into `emissive`.
    pub emissive_texture: Option<TextureSlot>,
    /// `KHR_materials_specular.specularFactor` in [0, 1]. 0 with metallic 0 is an exact Lambert surface.
    pub specular: f32,
    /// Linear texture whose A multiplies `specular`.
    pub specular_texture: Option<TextureSlot>,
    /// `KHR_materials_specular.specularColorFactor`, ≥ 0.
    pub specular_color: Vec3,
    /// sRGB texture multiplied into `specular_color`.
    pub specular_color_texture: Option<TextureSlot>,
    /// `KHR_materials_ior.ior`, ≥ 1, or 0 for a surface that reflects as a whole what is not tinted away.
    pub ior: f32,
    /// `KHR_materials_transmission.transmissionFactor` in [0, 1].
    pub transmission: f32,
    /// Linear texture whose R multiplies `transmission`.
    pub transmission_texture: Option<TextureSlot>,
    /// `KHR_materials_volume.thicknessFactor` ≥ 0; 0 means thin-walled, above 0 a solid dielectric.
    pub thickness: f32,
    /// Whether the file has a `thicknessTexture`; recorded, because light goes as far as the geometry says.
    pub thickness_texture: bool,
    /// `KHR_materials_dispersion.dispersion` ≥ 0: 20 over the Abbe number of a solid; 0 is none.
    pub dispersion: f32,
    /// Colour that white light has after `attenuation_distance_m` inside a solid dielectric.
    pub attenuation_color: Vec3,
    /// Metres; infinite means no absorption.
    pub attenuation_distance_m: f32,
    /// `KHR_materials_volume_scatter.multiscatterColor` in [0, 1]: colour that a thick medium shows; 0 only absorbs.
    pub multiscatter_color: Vec3,
    /// `KHR_materials_volume_scatter.scatterAnisotropy` in (−1, 1): mean cosine of scattering.
    pub scatter_anisotropy: f32,
    /// `KHR_materials_clearcoat.clearcoatFactor` in [0, 1].
    pub clearcoat: f32,
    /// Linear texture whose R multiplies `clearcoat`.
    pub clearcoat_texture: Option<TextureSlot>,
    /// `KHR_materials_clearcoat.clearcoatRoughnessFactor` in [0, 1]; GGX alpha is its square.
    pub clearcoat_roughness: f32,
    /// Linear texture whose G multiplies `clearcoat_roughness`.
    pub clearcoat_roughness_texture: Option<TextureSlot>,
    /// Tangent-space normal map (linear) of the clearcoat; without one it has the normals of the mesh.
    pub clearcoat_normal_texture: Option<TextureSlot>,
    /// `clearcoatNormalTexture.scale`, multiplies x and y of the decoded normal.
    pub clearcoat_normal_scale: f32,
    /// `KHR_materials_anisotropy.anisotropyStrength` in [0, 1]; needs tangents.
    pub anisotropy: f32,
    /// `KHR_materials_anisotropy.anisotropyRotation`, radians, counter-clockwise from the tangent.
    pub anisotropy_rotation_rad: f32,
    /// Linear texture: R and G are a direction, by which the grain is turned besides; B multiplies `anisotropy`.
    pub anisotropy_texture: Option<TextureSlot>,
    /// `KHR_materials_iridescence.iridescenceFactor` in [0, 1].
    pub iridescence: f32,
    /// Linear texture whose R multiplies `iridescence`.
    pub iridescence_texture: Option<TextureSlot>,
    /// `KHR_materials_iridescence.iridescenceIor`, ≥ 1.
    pub iridescence_ior: f32,
    /// `KHR_materials_iridescence.iridescenceThicknessMinimum` and `Maximum`, nm: the film is as thick as the second
    /// says where there is no texture.
    pub iridescence_thickness_nm: [f32; 2],
    /// Linear texture whose G leads from the first thickness to the second.
    pub iridescence_thickness_texture: Option<TextureSlot>,
    /// `KHR_materials_diffuse_transmission.diffuseTransmissionFactor` in [0, 1].
    pub diffuse_transmission: f32,
    /// Linear texture whose A multiplies `diffuse_transmission`.
    pub diffuse_transmission_texture: Option<TextureSlot>,
    /// `KHR_materials_diffuse_transmission.diffuseTransmissionColorFactor` in [0, 1].
    pub diffuse_transmission_color: Vec3,
    /// sRGB texture multiplied into `diffuse_transmission_color`.
    pub diffuse_transmission_color_texture: Option<TextureSlot>,
    /// `KHR_materials_sheen.sheenColorFactor` in [0, 1]; 0 is no sheen.
    pub sheen_color: Vec3,
    /// sRGB texture multiplied into `sheen_color`.
    pub sheen_color_texture: Option<TextureSlot>,
    /// `KHR_materials_sheen.sheenRoughnessFactor` in [0, 1].
    pub sheen_roughness: f32,
    /// Linear texture whose A multiplies `sheen_roughness`.
    pub sheen_roughness_texture: Option<TextureSlot>,
    /// `KHR_materials_unlit`: shows its base colour and neither receives nor scatters light.
    pub unlit: bool,
    /// glTF `doubleSided`: whether the back emits, too. Both sides scatter light either way.
    pub double_sided: bool,
}

impl Material {
    /// Whether all factors are finite; the distance of attenuation may be infinite.
    pub fn is_finite(&self) -> bool {
        let colors = [
            self.base_color,
            self.emissive,
            self.specular_color,
            self.attenuation_color,
            self.multiscatter_color,
            self.sheen_color,
            self.diffuse_transmission_color,
        ];
        let factors = [
            self.base_alpha,
            self.metallic,
            self.roughness,
            self.specular,
            self.ior,
            self.transmission,
            self.thickness,
            self.dispersion,
            self.scatter_anisotropy,
            self.clearcoat,
            self.clearcoat_roughness,
            self.clearcoat_normal_scale,
            self.anisotropy,
            self.anisotropy_rotation_rad,
            self.iridescence,
            self.iridescence_ior,
            self.iridescence_thickness_nm[0],
            self.iridescence_thickness_nm[1],
            self.diffuse_transmission,
            self.sheen_roughness,
        ];
        colors.iter().all(|color| color.is_finite()) && factors.iter().all(|factor| factor.is_finite())
    }
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
            glossiness_texture: None,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            emissive: Vec3::ZERO,
            emissive_texture: None,
            specular: 1.0,
            specular_texture: None,
            specular_color: Vec3::ONE,
            specular_color_texture: None,
            ior: 1.5,
            transmission: 0.0,
            transmission_texture: None,
            thickness: 0.0,
            thickness_texture: false,
            dispersion: 0.0,
            attenuation_color: Vec3::ONE,
            attenuation_distance_m: f32::INFINITY,
            multiscatter_color: Vec3::ZERO,
            scatter_anisotropy: 0.0,
            clearcoat: 0.0,
            clearcoat_texture: None,
            clearcoat_roughness: 0.0,
            clearcoat_roughness_texture: None,
            clearcoat_normal_texture: None,
            clearcoat_normal_scale: 1.0,
            anisotropy: 0.0,
            anisotropy_rotation_rad: 0.0,
            anisotropy_texture: None,
            iridescence: 0.0,
            iridescence_texture: None,
            iridescence_ior: 1.3,
            iridescence_thickness_nm: [100.0, 400.0],
            iridescence_thickness_texture: None,
            diffuse_transmission: 0.0,
            diffuse_transmission_texture: None,
            diffuse_transmission_color: Vec3::ONE,
            diffuse_transmission_color_texture: None,
            sheen_color: Vec3::ZERO,
            sheen_color_texture: None,
            sheen_roughness: 0.0,
            sheen_roughness_texture: None,
            unlit: false,
            double_sided: false,
        }
    }
}
