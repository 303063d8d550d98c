//! The texture slots of a material, declared once: loader, folding, weaving, validation and plan go over
//! [`Slot::ALL`]. A new slot is a variant, its row in `ROWS`, and its field in [`Material`].

use glam::Vec3;

use super::parameters::{Material, TextureSlot};
use crate::texture::ColorSpace;

/// A place for a texture in a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Slot {
    /// Multiplies base colour; its alpha multiplies alpha.
    BaseColor = 0,
    /// G multiplies roughness, B multiplies metallic.
    MetallicRoughness = 1,
    /// Multiplies emission.
    Emissive = 2,
    /// Tangent-space normal map.
    Normal = 3,
    /// R multiplies transmission.
    Transmission = 4,
    /// A multiplies the strength of dielectric reflection.
    Specular = 5,
    /// Multiplies the colour of dielectric reflection.
    SpecularColor = 6,
    /// R multiplies the clearcoat.
    Clearcoat = 7,
    /// G multiplies the clearcoat's roughness.
    ClearcoatRoughness = 8,
    /// Tangent-space normal map of the clearcoat.
    ClearcoatNormal = 9,
    /// Multiplies the colour of sheen.
    SheenColor = 10,
    /// A multiplies the roughness of sheen.
    SheenRoughness = 11,
    /// A multiplies 1 − roughness.
    Glossiness = 12,
    /// R and G turn the grain, B multiplies its strength.
    Anisotropy = 13,
    /// R multiplies the weight of the film.
    Iridescence = 14,
    /// G leads from the least to the largest thickness of the film.
    IridescenceThickness = 15,
    /// A multiplies diffuse transmission.
    DiffuseTransmission = 16,
    /// Multiplies its colour.
    DiffuseTransmissionColor = 17,
}

/// A texture with one value everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constant {
    /// Linear RGB.
    pub rgb: Vec3,
    /// Alpha as stored.
    pub alpha: f32,
}

/// What there is to know of a slot.
struct Row {
    slot: Slot,
    name: &'static str,
    member: &'static str,
    color_space: ColorSpace,
    /// Tangent-space normals: needs tangents.
    normal_map: bool,
    /// Looked up for shading at every hit, together with the others of which this is true.
    shades: bool,
    get: fn(&Material) -> Option<TextureSlot>,
    get_mut: fn(&mut Material) -> Option<&mut Option<TextureSlot>>,
    /// Multiplies a constant texture into the material's factors; false where no factor can say the same.
    fold: fn(&mut Material, Constant) -> bool,
}

/// The place of a texture in a part of the material that may be off: there is none then, unless it has one.
fn place(on: bool, texture: &mut Option<TextureSlot>) -> Option<&mut Option<TextureSlot>> {
    (on || texture.is_some()).then_some(texture)
}

/// One row a slot, in the order of [`Slot`].
const ROWS: &[Row; Slot::COUNT] = &[
    Row {
        slot: Slot::BaseColor,
        name: "base-colour-textures",
        member: "pbrMetallicRoughness/baseColorTexture",
        color_space: ColorSpace::Srgb,
        normal_map: false,
        shades: true,
        get: |material| material.base_color_texture,
        get_mut: |material| Some(&mut material.base_color_texture),
        // Alpha is not a factor of the colour.
        fold: |material, constant| {
            let folds = constant.alpha == 1.0;
            if folds {
                material.base_color *= constant.rgb;
            }
            folds
        },
    },
    Row {
        slot: Slot::MetallicRoughness,
        name: "metallic-roughness-textures",
        member: "pbrMetallicRoughness/metallicRoughnessTexture",
        color_space: ColorSpace::Linear,
        normal_map: false,
        shades: true,
        get: |material| material.metallic_roughness_texture,
        get_mut: |material| Some(&mut material.metallic_roughness_texture),
        fold: |material, constant| {
            material.roughness *= constant.rgb.y;
            material.metallic *= constant.rgb.z;
            true
        },
    },
    Row {
        slot: Slot::Emissive,
        name: "emissive-textures",
        member: "emissiveTexture",
        color_space: ColorSpace::Srgb,
        normal_map: false,
        shades: false,
        get: |material| material.emissive_texture,
        get_mut: |material| Some(&mut material.emissive_texture),
        fold: |material, constant| {
            material.emissive *= constant.rgb;
            true
        },
    },
    Row {
        slot: Slot::Normal,
        name: "normal-maps",
        member: "normalTexture",
        color_space: ColorSpace::Linear,
        normal_map: true,
        shades: true,
        get: |material| material.normal_texture,
        get_mut: |material| Some(&mut material.normal_texture),
        fold: |_, constant| constant.is_flat_normal(),
    },
    Row {
        slot: Slot::Transmission,
        name: "transmission-textures",
        member: "extensions/KHR_materials_transmission/transmissionTexture",
        color_space: ColorSpace::Linear,
        normal_map: false,
        shades: false,
        get: |material| material.transmission_texture,
        get_mut: |material| place(material.transmission > 0.0, &mut material.transmission_texture),
        fold: |material, constant| {
            material.transmission *= constant.rgb.x;
            true
        },
    },
    Row {
        slot: Slot::Specular,
        name: "specular-textures",
        member: "extensions/KHR_materials_specular/specularTexture",
        color_space: ColorSpace::Linear,
        normal_map: false,
        shades: false,
        get: |material| material.specular_texture,
        get_mut: |material| place(material.specular > 0.0, &mut material.specular_texture),
        fold: |material, constant| {
            material.specular *= constant.alpha;
            true
        },
    },
    Row {
        slot: Slot::SpecularColor,
        name: "specular-colour-textures",
        member: "extensions/KHR_materials_specular/specularColorTexture",
        color_space: ColorSpace::Srgb,
        normal_map: false,
        shades: false,
        get: |material| material.specular_color_texture,
        get_mut: |material| place(material.specular > 0.0, &mut material.specular_color_texture),
        fold: |material, constant| {
            material.specular_color *= constant.rgb;
            true
        },
    },
    Row {
        slot: Slot::Clearcoat,
        name: "clearcoat-textures",
        member: "extensions/KHR_materials_clearcoat/clearcoatTexture",
        color_space: ColorSpace::Linear,
        normal_map: false,
        shades: false,
        get: |material| material.clearcoat_texture,
        get_mut: |material| place(material.clearcoat > 0.0, &mut material.clearcoat_texture),
        fold: |material, constant| {
            material.clearcoat *= constant.rgb.x;
            true
        },
    },
    Row {
        slot: Slot::ClearcoatRoughness,
        name: "clearcoat-roughness-textures",
        member: "extensions/KHR_materials_clearcoat/clearcoatRoughnessTexture",
        color_space: ColorSpace::Linear,
        normal_map: false,
        shades: false,
        get: |material| material.clearcoat_roughness_texture,
        get_mut: |material| place(material.clearcoat > 0.0, &mut material.clearcoat_roughness_texture),
        fold: |material, constant| {
            material.clearcoat_roughness *= constant.rgb.y;
            true
        },
    },
    Row {
        slot: Slot::ClearcoatNormal,
        name: "clearcoat-normal-maps",
        member: "extensions/KHR_materials_clearcoat/clearcoatNormalTexture",
        color_space: ColorSpace::Linear,
        normal_map: true,
        shades: false,
        get: |material| material.clearcoat_normal_texture,
        get_mut: |material| place(material.clearcoat > 0.0, &mut material.clearcoat_normal_texture),
        fold: |_, constant| constant.is_flat_normal(),
    },
    Row {
        slot: Slot::SheenColor,
        name: "sheen-colour-textures",
        member: "extensions/KHR_materials_sheen/sheenColorTexture",
        color_space: ColorSpace::Srgb,
        normal_map: false,
        shades: false,
        get: |material| material.sheen_color_texture,
        get_mut: |material| place(material.has_sheen(), &mut material.sheen_color_texture),
        fold: |material, constant| {
            material.sheen_color *= constant.rgb;
            true
        },
    },
    Row {
        slot: Slot::SheenRoughness,
        name: "sheen-roughness-textures",
        member: "extensions/KHR_materials_sheen/sheenRoughnessTexture",
        color_space: ColorSpace::Linear,
        normal_map: false,
        shades: false,
        get: |material| material.sheen_roughness_texture,
        get_mut: |material| place(material.has_sheen(), &mut material.sheen_roughness_texture),
        fold: |material, constant| {
            material.sheen_roughness *= constant.alpha;
            true
        },
    },
    Row {
        slot: Slot::Glossiness,
        name: "glossiness-textures",
        member: "extensions/KHR_materials_pbrSpecularGlossiness/specularGlossinessTexture",
        color_space: ColorSpace::Linear,
        normal_map: false,
        shades: false,
        get: |material| material.glossiness_texture,
        get_mut: |material| place(material.roughness < 1.0, &mut material.glossiness_texture),
        fold: |material, constant| {
            material.roughness = 1.0 - (1.0 - material.roughness) * constant.alpha;
            true
        },
    },
    Row {
        slot: Slot::Anisotropy,
        name: "anisotropy-textures",
        member: "extensions/KHR_materials_anisotropy/anisotropyTexture",
        color_space: ColorSpace::Linear,
        normal_map: false,
        shades: false,
        get: |material| material.anisotropy_texture,
        get_mut: |material| place(material.anisotropy > 0.0, &mut material.anisotropy_texture),
        fold: |material, constant| {
            let [x, y] = [constant.rgb.x, constant.rgb.y].map(|code| code * 2.0 - 1.0);
            material.anisotropy_rotation_rad += y.atan2(x);
            material.anisotropy *= constant.rgb.z;
            true
        },
    },
    Row {
        slot: Slot::Iridescence,
        name: "iridescence-textures",
        member: "extensions/KHR_materials_iridescence/iridescenceTexture",
        color_space: ColorSpace::Linear,
        normal_map: false,
        shades: false,
        get: |material| material.iridescence_texture,
        get_mut: |material| place(material.iridescence > 0.0, &mut material.iridescence_texture),
        fold: |material, constant| {
            material.iridescence *= constant.rgb.x;
            true
        },
    },
    Row {
        slot: Slot::IridescenceThickness,
        name: "iridescence-thickness-textures",
        member: "extensions/KHR_materials_iridescence/iridescenceThicknessTexture",
        color_space: ColorSpace::Linear,
        normal_map: false,
        shades: false,
        get: |material| material.iridescence_thickness_texture,
        get_mut: |material| place(material.iridescence > 0.0, &mut material.iridescence_thickness_texture),
        fold: |material, constant| {
            let [least, most] = material.iridescence_thickness_nm;
            material.iridescence_thickness_nm = [least + (most - least) * constant.rgb.y; 2];
            true
        },
    },
    Row {
        slot: Slot::DiffuseTransmission,
        name: "diffuse-transmission-textures",
        member: "extensions/KHR_materials_diffuse_transmission/diffuseTransmissionTexture",
        color_space: ColorSpace::Linear,
        normal_map: false,
        shades: false,
        get: |material| material.diffuse_transmission_texture,
        get_mut: |material| place(material.diffuse_transmission > 0.0, &mut material.diffuse_transmission_texture),
        fold: |material, constant| {
            material.diffuse_transmission *= constant.alpha;
            true
        },
    },
    Row {
        slot: Slot::DiffuseTransmissionColor,
        name: "diffuse-transmission-colour-textures",
        member: "extensions/KHR_materials_diffuse_transmission/diffuseTransmissionColorTexture",
        color_space: ColorSpace::Srgb,
        normal_map: false,
        shades: false,
        get: |material| material.diffuse_transmission_color_texture,
        get_mut: |material| {
            place(material.diffuse_transmission > 0.0, &mut material.diffuse_transmission_color_texture)
        },
        fold: |material, constant| {
            material.diffuse_transmission_color *= constant.rgb;
            true
        },
    },
];

const _: () = {
    let mut i = 0;
    while i < Slot::COUNT {
        assert!(ROWS[i].slot as usize == i && Slot::ALL[i] as usize == i, "one row a slot, in order");
        i += 1;
    }
};

impl Slot {
    /// Number of slots.
    pub const COUNT: usize = 18;

    /// Every slot.
    pub const ALL: [Slot; Slot::COUNT] = [
        Slot::BaseColor,
        Slot::MetallicRoughness,
        Slot::Emissive,
        Slot::Normal,
        Slot::Transmission,
        Slot::Specular,
        Slot::SpecularColor,
        Slot::Clearcoat,
        Slot::ClearcoatRoughness,
        Slot::ClearcoatNormal,
        Slot::SheenColor,
        Slot::SheenRoughness,
        Slot::Glossiness,
        Slot::Anisotropy,
        Slot::Iridescence,
        Slot::IridescenceThickness,
        Slot::DiffuseTransmission,
        Slot::DiffuseTransmissionColor,
    ];

    #[inline(always)]
    fn row(self) -> &'static Row {
        &ROWS[self as usize]
    }

    /// Name in plans: "normal-maps".
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// Path of its texture information in a glTF material: "pbrMetallicRoughness/baseColorTexture".
    pub fn member(self) -> &'static str {
        self.row().member
    }

    /// How its texels map to linear values.
    pub fn color_space(self) -> ColorSpace {
        self.row().color_space
    }

    /// Whether its texels are tangent-space normals, for which meshes need tangents.
    pub fn is_normal_map(self) -> bool {
        self.row().normal_map
    }

    /// Whether it is looked up at every hit that is shaded, together with the others of which this is true: their
    /// texels are kept side by side.
    pub fn shades(self) -> bool {
        self.row().shades
    }

    /// The texture that `material` has here.
    #[inline(always)]
    pub fn of(self, material: &Material) -> Option<TextureSlot> {
        (self.row().get)(material)
    }

    /// Where `material` keeps the texture; `None` where it has no such part (an extension that it does not use).
    pub fn of_mut(self, material: &mut Material) -> Option<&mut Option<TextureSlot>> {
        (self.row().get_mut)(material)
    }

    /// Takes a texture out that is `constant` everywhere and makes it a factor; leaves it where no factor can say the
    /// same.
    pub fn fold(self, material: &mut Material, constant: Constant) {
        if (self.row().fold)(material, constant)
            && let Some(texture) = self.of_mut(material)
        {
            *texture = None;
        }
    }
}

impl Constant {
    /// A normal map that tilts nothing: x and y one of the two codes nearest to ½, which 8 bits cannot say exactly.
    fn is_flat_normal(&self) -> bool {
        let half = |x: f32| (x - 0.5).abs() < 0.6 / 255.0;
        half(self.rgb.x) && half(self.rgb.y) && self.rgb.z == 1.0
    }
}

impl Material {
    /// One that has every part.
    #[cfg(test)]
    pub(crate) fn all_parts() -> Material {
        Material {
            roughness: 0.5,
            transmission: 1.0,
            clearcoat: 1.0,
            sheen_color: Vec3::ONE,
            sheen_roughness: 1.0,
            anisotropy: 1.0,
            iridescence: 1.0,
            diffuse_transmission: 1.0,
            ..Material::default()
        }
    }

    /// The textures it has, in the order of [`Slot::ALL`].
    #[inline(always)]
    pub fn textures(&self) -> impl Iterator<Item = (Slot, TextureSlot)> {
        Slot::ALL.into_iter().filter_map(|slot| Some((slot, slot.of(self)?)))
    }

    /// Whether any slot is textured, so that texture coordinates are needed.
    #[inline(always)]
    pub fn reads_textures(&self) -> bool {
        self.textures().next().is_some()
    }

    /// Whether a texture of an extension changes how the surface scatters.
    pub fn reads_extension_textures(&self) -> bool {
        self.textures().any(|(slot, _)| slot as usize >= Slot::Transmission as usize)
    }

    /// The channel of texture coordinates along which meshes need tangents: that of a normal map, or of the texture of
    /// a grain, or the first for a grain without texture.
    pub fn tangent_channel(&self) -> Option<u32> {
        let map = self.textures().find_map(|(slot, texture)| slot.is_normal_map().then_some(texture.uv_set));
        let grain = || self.anisotropy_texture.map_or(0, |texture| texture.uv_set);
        map.or_else(|| (self.anisotropy > 0.0).then(grain))
    }

    /// Number of channels of texture coordinates that the slots read.
    pub fn uv_channels(&self) -> usize {
        self.textures().map(|(_, texture)| texture.uv_set as usize + 1).max().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::ids::TextureId;
    use super::*;

    /// Every row reads what it writes, and nothing else. Deterministic.
    #[test]
    fn rows_are_of_their_slots() {
        for slot in Slot::ALL {
            let mut material = Material::all_parts();
            assert!(!material.reads_textures());
            let texture = TextureSlot { texture: TextureId(7), uv_set: 2 };
            *slot.of_mut(&mut material).expect("every part is there") = Some(texture);
            assert_eq!(material.textures().collect::<Vec<_>>(), [(slot, texture)]);
            assert_eq!(material.uv_channels(), 3);
        }
    }
}
