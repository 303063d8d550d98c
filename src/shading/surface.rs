//! The resolved material of one hit: which scattering function answers there, with its numbers filled in.
//!
//! A glTF material that is partly transmissive (0 < transmissionFactor < 1, or metallic > 0 as well) is a mixture of
//! metal, clear dielectric and opaque dielectric; one of them is drawn per hit, with the mixture's own weights, from a
//! random number that nothing else uses. Light sampling and BSDF sampling at that hit then see the same surface.
//!
//! Frames: opaque surfaces answer for wo.z > 0 only, so the caller turns their frame towards the viewer
//! ([`Surface::is_transmissive`] is false). A transmissive surface wants the outward frame: wo.z < 0 is inside.

use glam::Vec3;

use super::bsdf::dielectric::{Body, Dielectric};
use super::bsdf::fresnel::{MAX_INDEX, relative_index};
use super::bsdf::glossy::Glossy;
use super::bsdf::lambert::Lambert;
use super::bsdf::model::{Boundary, Bsdf, BsdfEval, BsdfSample, HIDDEN, Lobe, Tables, Textured};
use crate::math::columns::array_column;
use crate::scene::Material;

/// A surface ready to scatter.
#[derive(Clone, Copy, Debug)]
pub enum Surface<'t> {
    /// Scatters nothing: unlit, or black without a coat.
    Black,
    /// Perfectly diffuse.
    Lambert(Lambert),
    /// Opaque metallic-roughness.
    Glossy(Glossy<'t>),
    /// Clear, solid or thin-walled.
    Dielectric(Dielectric),
}

impl<'t> Surface<'t> {
    /// Resolves `material` with its textured factors at a hit. `u_material` chooses among the parts of a mixture;
    /// it is not read for a pure material.
    #[inline(always)]
    pub fn from_material(material: &Material, textured: Textured, tables: &Tables<'t>, u_material: f32) -> Self {
        if material.unlit {
            return Surface::Black;
        }
        Surface::resolve(&Boundary::of(material), textured, tables, u_material)
    }

    /// As [`from_material`](Self::from_material), of a lit material whose dielectric has such a surface at the hit.
    #[inline(always)]
    pub fn resolve(boundary: &Boundary, textured: Textured, tables: &Tables<'t>, u_material: f32) -> Self {
        let base_color = textured.base_color.clamp(Vec3::ZERO, Vec3::ONE);
        let mut metallic = textured.metallic.clamp(0.0, 1.0);
        let roughness = textured.roughness.clamp(0.0, 1.0);
        let alpha = roughness * roughness;

        if textured.exterior == HIDDEN {
            return Surface::Dielectric(Dielectric::NOTHING);
        }

        // Partly transmissive: metal with probability `metallic`, and of the rest the clear part by its factor.
        if boundary.transmission > 0.0 {
            if u_material < metallic {
                metallic = 1.0;
            } else if boundary.transmission >= 1.0 || u_material - metallic < (1.0 - metallic) * boundary.transmission {
                return Surface::Dielectric(Dielectric {
                    body: if boundary.solid { Body::Solid } else { Body::Thin },
                    eta: (relative_index(boundary.ior) / relative_index(textured.exterior)).min(MAX_INDEX),
                    alpha,
                    tint: base_color,
                    specular: boundary.specular,
                    specular_color: boundary.specular_color,
                });
            } else {
                metallic = 0.0;
            }
        }

        if metallic == 0.0 && boundary.specular == 0.0 {
            return if base_color == Vec3::ZERO {
                Surface::Black
            } else {
                Surface::Lambert(Lambert { albedo: base_color })
            };
        }
        let mut glossy = Glossy::with(boundary, &Textured { base_color, metallic, roughness, ..textured }, tables);
        glossy.look_up(tables);
        Surface::Glossy(glossy)
    }

    /// f·|cos θ_i| and the density of `sample`; zero for delta lobes.
    #[inline(always)]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        match self {
            Surface::Black => BsdfEval::ZERO,
            Surface::Lambert(lambert) => lambert.value(wo, wi),
            Surface::Glossy(glossy) => glossy.value(wo, wi),
            Surface::Dielectric(dielectric) => dielectric.eval(wo, wi),
        }
    }

    /// The part of [`eval`](Self::eval) that the diffuse base reflects.
    pub fn diffuse(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        match self {
            Surface::Black | Surface::Dielectric(_) => Vec3::ZERO,
            Surface::Lambert(lambert) => lambert.diffuse_value(wo, wi),
            Surface::Glossy(glossy) => glossy.diffuse_value(wo, wi),
        }
    }

    /// Draws a direction; `u` = lobe, u, v. `None` ends the path: absorbed, or masked by the surface itself.
    #[inline(always)]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> Option<BsdfSample> {
        match self {
            Surface::Black => None,
            Surface::Lambert(lambert) => lambert.sampled(wo, u),
            Surface::Glossy(glossy) => glossy.sampled(wo, u),
            Surface::Dielectric(dielectric) => dielectric.sample(wo, u),
        }
    }

    /// Whether `eval` is zero for every pair, so that sampling a light is wasted.
    #[inline(always)]
    pub fn is_delta(&self) -> bool {
        match self {
            Surface::Black => true,
            Surface::Lambert(_) => false,
            Surface::Glossy(glossy) => glossy.is_delta(),
            Surface::Dielectric(dielectric) => dielectric.is_delta(),
        }
    }

    /// Largest albedo, about: it serves the choice between this surface and layers on it.
    #[inline(always)]
    pub fn albedo(&self) -> f32 {
        match self {
            Surface::Black => 0.0,
            Surface::Lambert(lambert) => lambert.albedo.max_element(),
            Surface::Glossy(_) | Surface::Dielectric(_) => 1.0,
        }
    }

    /// Whether light can arrive from the far side: the frame must then be the outward one.
    #[inline(always)]
    pub fn is_transmissive(&self) -> bool {
        matches!(self, Surface::Dielectric(_))
    }
}

array_column!(Surface<'_>);

impl<'t> Bsdf<'t> for Surface<'t> {
    const COLUMNS: bool = false;
    const TEXTURED: bool = true;
    const TRANSMITS: bool = true;
    const DELTAS: bool = true;
    const LAYERED: bool = false;
    const UNLIT: bool = true;

    type View = ();
    type Drawn = BsdfSample;

    #[inline(always)]
    fn new(material: &Material, textured: &Textured, tables: &Tables<'t>, u_material: f32) -> Self {
        Surface::from_material(material, *textured, tables, u_material)
    }

    #[inline(always)]
    fn idle(_: &Tables<'t>) -> Self {
        Surface::Black
    }

    #[inline(always)]
    fn outward(&self) -> bool {
        self.is_transmissive()
    }

    #[inline(always)]
    fn is_delta(&self) -> bool {
        self.is_delta()
    }

    #[inline(always)]
    fn view(&self, _: Vec3, _: f32) {}

    #[inline(always)]
    fn eval(&self, wo: Vec3, wi: Vec3, _: &(), _: f32) -> BsdfEval {
        self.eval(wo, wi)
    }

    fn diffuse(&self, wo: Vec3, wi: Vec3, _: &(), _: f32) -> Vec3 {
        self.diffuse(wo, wi)
    }

    #[inline(always)]
    fn draw(&self, wo: Vec3, u: [f32; 3], _: &()) -> BsdfSample {
        let refused = BsdfSample { wi: Vec3::ZERO, weight: Vec3::ZERO, pdf_sa: 0.0, eta: 1.0 };
        self.sample(wo, u).unwrap_or(refused)
    }

    #[inline(always)]
    fn wi(drawn: &BsdfSample) -> Vec3 {
        drawn.wi
    }

    #[inline(always)]
    fn weigh(&self, _: Vec3, drawn: &BsdfSample, _: &(), _: f32) -> BsdfSample {
        *drawn
    }

    fn name(&self) -> &'static str {
        match self {
            Surface::Black => "black",
            Surface::Lambert(_) => "lambert",
            Surface::Glossy(_) => "glossy",
            Surface::Dielectric(Dielectric { body: Body::Solid, .. }) => "dielectric",
            Surface::Dielectric(Dielectric { body: Body::Thin, .. }) => "thin",
        }
    }

    fn lobe(&self, wo: Vec3, u: f32, _: &(), reflected: bool) -> Lobe {
        match self {
            Surface::Black => Lobe::wide("none"),
            Surface::Lambert(lambert) => lambert.lobe(wo, u, &(), reflected),
            Surface::Glossy(glossy) => glossy.lobe(wo, u, &glossy.view(wo, glossy.below(wo.z)), reflected),
            Surface::Dielectric(glass) => glass.lobe(reflected),
        }
    }

    fn widest_alpha(&self) -> f32 {
        match self {
            Surface::Black => 1.0,
            Surface::Lambert(lambert) => lambert.widest_alpha(),
            Surface::Glossy(glossy) => glossy.widest_alpha(),
            Surface::Dielectric(glass) => glass.lobe(true).alpha,
        }
    }
}
