//! The resolved material of one hit: which scattering function answers there, with its numbers filled in.
//!
//! A glTF material that is partly transmissive (0 < transmissionFactor < 1, or metallic > 0 as well) is a mixture of
//! metal, clear dielectric and opaque dielectric; one of them is drawn per hit, with the mixture's own weights, from a
//! random number that nothing else uses. Light sampling and BSDF sampling at that hit then see the same surface.
//!
//! Frames: opaque surfaces answer for wo.z > 0 only, so the caller turns their frame towards the viewer
//! ([`Surface::is_transmissive`] is false). A transmissive surface wants the outward frame: wo.z < 0 is inside.

use glam::Vec3;

use super::bsdf::albedo::SpecularAlbedo;
use super::bsdf::dielectric::{Body, Dielectric, MAX_INDEX};
use super::bsdf::glossy::{Glossy, GlossyParams};
use super::bsdf::{BsdfEval, BsdfSample, lambert};
use crate::scene::Material;

/// Largest index of a coat that is told from infinity: F0 is then within 4e-4 of 1.
const MAX_IOR: f32 = 1e4;

/// Factors of a material after its textures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Textured {
    /// Linear base colour.
    pub base_color: Vec3,
    /// 0 dielectric … 1 metal.
    pub metallic: f32,
    /// glTF roughness; GGX alpha is its square.
    pub roughness: f32,
}

impl Textured {
    /// The factors of a material without textures.
    pub fn constant(material: &Material) -> Self {
        Textured { base_color: material.base_color, metallic: material.metallic, roughness: material.roughness }
    }
}

/// A surface ready to scatter.
#[derive(Clone, Copy, Debug)]
pub enum Surface<'t> {
    /// Scatters nothing: unlit, or black without a coat.
    Black,
    /// Perfectly diffuse.
    Lambert {
        /// Reflected fraction.
        albedo: Vec3,
    },
    /// Opaque metallic-roughness.
    Glossy(Glossy<'t>),
    /// Clear, solid or thin-walled.
    Dielectric(Dielectric),
}

impl<'t> Surface<'t> {
    /// Resolves `material` with its textured factors at a hit. `u_material` chooses among the parts of a mixture;
    /// it is not read for a pure material.
    #[inline(always)]
    pub fn from_material(material: &Material, textured: Textured, tables: &'t SpecularAlbedo, u_material: f32) -> Self {
        if material.unlit {
            return Surface::Black;
        }
        let base_color = textured.base_color.clamp(Vec3::ZERO, Vec3::ONE);
        let mut metallic = textured.metallic.clamp(0.0, 1.0);
        let roughness = textured.roughness.clamp(0.0, 1.0);
        let alpha = roughness * roughness;

        // Partly transmissive: metal with probability `metallic`, and of the rest the clear part by its factor.
        if material.transmission > 0.0 {
            if u_material < metallic {
                metallic = 1.0;
            } else if material.transmission >= 1.0 || u_material - metallic < (1.0 - metallic) * material.transmission {
                return Surface::Dielectric(Dielectric {
                    body: if material.thickness > 0.0 { Body::Solid } else { Body::Thin },
                    eta: index(material).min(MAX_INDEX),
                    alpha,
                    tint: base_color,
                    specular: material.specular,
                    specular_color: material.specular_color,
                });
            } else {
                metallic = 0.0;
            }
        }

        if metallic == 0.0 && material.specular == 0.0 {
            return if base_color == Vec3::ZERO { Surface::Black } else { Surface::Lambert { albedo: base_color } };
        }
        let params =
            GlossyParams { base_color, metallic, alpha, f0: reflectance_at_normal(material), f90: material.specular };
        Surface::Glossy(Glossy::new(&params, tables))
    }

    /// f·|cos θ_i| and the density of `sample`; zero for delta lobes.
    #[inline(always)]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        match self {
            Surface::Black => BsdfEval::ZERO,
            Surface::Lambert { albedo } => lambert::eval(*albedo, wo, wi),
            Surface::Glossy(glossy) => glossy.eval(wo, wi),
            Surface::Dielectric(dielectric) => dielectric.eval(wo, wi),
        }
    }

    /// Draws a direction; `u` = lobe, u, v. `None` ends the path: absorbed, or masked by the surface itself.
    #[inline(always)]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> Option<BsdfSample> {
        match self {
            Surface::Black => None,
            Surface::Lambert { albedo } => lambert::sample(*albedo, wo, [u[1], u[2]]),
            Surface::Glossy(glossy) => glossy.sample(wo, u),
            Surface::Dielectric(dielectric) => dielectric.sample(wo, u),
        }
    }

    /// Whether `eval` is zero for every pair, so that sampling a light is wasted.
    #[inline(always)]
    pub fn is_delta(&self) -> bool {
        match self {
            Surface::Black => true,
            Surface::Lambert { .. } => false,
            Surface::Glossy(glossy) => glossy.is_delta(),
            Surface::Dielectric(dielectric) => dielectric.is_delta(),
        }
    }

    /// Whether light can arrive from the far side: the frame must then be the outward one.
    #[inline(always)]
    pub fn is_transmissive(&self) -> bool {
        matches!(self, Surface::Dielectric(_))
    }
}

/// The lobes of an opaque material with its textured factors. Without metal and coat they are Lambert's exactly, up to the rounding of
/// a weight: what [`Surface::from_material`] tells apart.
#[inline(always)]
pub fn opaque(material: &Material, textured: &Textured) -> GlossyParams {
    let roughness = textured.roughness.clamp(0.0, 1.0);
    GlossyParams {
        base_color: textured.base_color.clamp(Vec3::ZERO, Vec3::ONE),
        metallic: textured.metallic.clamp(0.0, 1.0),
        alpha: roughness * roughness,
        f0: reflectance_at_normal(material),
        f90: material.specular,
    }
}

/// `ior` as a relative index; 0 is KHR_materials_ior's spelling of infinity.
#[inline(always)]
fn index(material: &Material) -> f32 {
    if material.ior >= 1.0 { material.ior.min(MAX_IOR) } else { MAX_IOR }
}

/// F0 of the dielectric coat (KHR_materials_specular).
#[inline(always)]
fn reflectance_at_normal(material: &Material) -> Vec3 {
    let n = index(material);
    let root = (n - 1.0) / (n + 1.0);
    (material.specular_color * (root * root)).min(Vec3::ONE) * material.specular
}

/// What a hit on a material can turn out to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MaterialKind {
    /// Scatters nothing and is not unlit: an emitter with base colour 0, or a black body.
    Black,
    /// Shows its base colour and scatters nothing.
    Unlit,
    /// [`Surface::Lambert`].
    Lambert,
    /// [`Surface::Glossy`].
    Glossy,
    /// [`Surface::Dielectric`] with a solid body.
    Dielectric,
    /// [`Surface::Dielectric`] with a thin wall.
    Thin,
}

impl MaterialKind {
    /// Every kind, in the order in which plans list them.
    pub const ALL: [MaterialKind; 6] = [
        MaterialKind::Black,
        MaterialKind::Unlit,
        MaterialKind::Lambert,
        MaterialKind::Glossy,
        MaterialKind::Dielectric,
        MaterialKind::Thin,
    ];

    /// Spelling in plans and statistics.
    pub fn name(self) -> &'static str {
        match self {
            MaterialKind::Black => "black",
            MaterialKind::Unlit => "unlit",
            MaterialKind::Lambert => "lambert",
            MaterialKind::Glossy => "glossy",
            MaterialKind::Dielectric => "dielectric",
            MaterialKind::Thin => "thin",
        }
    }
}

/// A set of kinds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MaterialKinds(u8);

impl MaterialKinds {
    /// The kinds that hits on `material` can take, over every value its textures may have.
    pub fn of(material: &Material) -> Self {
        let mut kinds = MaterialKinds::default();
        if material.unlit {
            kinds.insert(MaterialKind::Unlit);
            return kinds;
        }
        // Textures multiply factors, so a factor of 0 stays 0 and any other may become 0.
        let textured_metal = material.metallic_roughness_texture.is_some();
        let metal = material.metallic > 0.0;
        let all_metal = material.metallic >= 1.0 && !textured_metal;
        if material.transmission > 0.0 && !all_metal {
            kinds.insert(if material.thickness > 0.0 { MaterialKind::Dielectric } else { MaterialKind::Thin });
        }
        let opaque_dielectric = !all_metal && material.transmission < 1.0;
        if metal || (opaque_dielectric && material.specular > 0.0) {
            kinds.insert(MaterialKind::Glossy);
        }
        if opaque_dielectric && material.specular == 0.0 && (!metal || textured_metal || material.transmission > 0.0) {
            let black = material.base_color == Vec3::ZERO;
            kinds.insert(if black { MaterialKind::Black } else { MaterialKind::Lambert });
        }
        kinds
    }

    /// Adds a kind.
    pub fn insert(&mut self, kind: MaterialKind) {
        self.0 |= 1 << kind as u8;
    }

    /// Whether the set holds `kind`.
    pub fn contains(self, kind: MaterialKind) -> bool {
        self.0 & (1 << kind as u8) != 0
    }

    /// Both sets together.
    pub fn union(self, other: Self) -> Self {
        MaterialKinds(self.0 | other.0)
    }

    /// The kinds in the order of [`MaterialKind::ALL`].
    pub fn iter(self) -> impl Iterator<Item = MaterialKind> {
        MaterialKind::ALL.into_iter().filter(move |&kind| self.contains(kind))
    }
}
