//! Opaque glTF metallic-roughness: one GGX lobe over a diffuse base.
//!
//! Schlick's reflectance is linear in F0 and F90 and metal and coat share one distribution of normals, so the mix by
//! `metallic` of a metal (F0 = base colour, F90 = 1) and a dielectric coat is a single lobe with mixed F0 and F90. The
//! base is scaled by (1−E(μo))(1−E(μi))/(1−E_avg), E the albedo of the coat's lobe: reciprocal, and nothing is gained or
//! lost between coat and base (Kelemen and Szirmay-Kalos 2001; a coloured coat weighs by its largest channel, as
//! KHR_materials_specular asks). Single scattering: a metal loses what its facets shadow.
//!
//! Directions in the shading frame, n = +z; `eval` includes the cosine; pdfs in sr⁻¹. A viewer at or below the horizon
//! sees nothing. Below [`ALPHA_DELTA`] the specular lobe is a mirror, which `eval` cannot see.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::albedo::{Complement, SpecularAlbedo};
use super::fresnel::{SCHLICK_AVERAGE, schlick, schlick_weight};
use super::microfacet::{ALPHA_DELTA, Ggx, half_vector, reflect};
use super::{BsdfEval, BsdfSample};
use crate::math::warp;

/// What the surface is made of at a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlossyParams {
    /// Diffuse colour of the dielectric and F0 of the metal.
    pub base_color: Vec3,
    /// 0 dielectric … 1 metal.
    pub metallic: f32,
    /// GGX alpha.
    pub alpha: f32,
    /// Reflectance of the dielectric at the normal.
    pub f0: Vec3,
    /// Reflectance of the dielectric at grazing.
    pub f90: f32,
}

/// The lobes, mixed and ready to evaluate.
#[derive(Clone, Copy, Debug)]
pub struct Glossy<'t> {
    ggx: Ggx,
    mirror: bool,
    f0: Vec3,
    f90: f32,
    diffuse: Vec3,
    below: Complement<'t>,
}

impl<'t> Glossy<'t> {
    /// Mixes the lobes.
    #[inline(always)]
    pub fn new(params: &GlossyParams, tables: &'t SpecularAlbedo) -> Self {
        let GlossyParams { base_color, metallic, alpha, f0, f90 } = *params;
        let mirror = alpha < ALPHA_DELTA;
        let coat = f0.max_element();
        Glossy {
            ggx: Ggx::isotropic(alpha.max(ALPHA_DELTA)),
            mirror,
            f0: f0 * (1.0 - metallic) + base_color * metallic,
            f90: f90 * (1.0 - metallic) + metallic,
            diffuse: base_color * (1.0 - metallic),
            below: tables.complement(if mirror { 0.0 } else { alpha }, coat, f90),
        }
    }

    /// Whether light sampling can find nothing: a mirror without a base.
    #[inline(always)]
    pub fn is_delta(&self) -> bool {
        self.mirror && self.diffuse == Vec3::ZERO
    }

    /// Probability of the specular lobe for this viewer, by estimated albedo. Never 0 where the lobe reflects at all.
    #[inline(always)]
    fn p_specular(&self, cos_o: f32, below_o: f32) -> f32 {
        let w = schlick_weight(cos_o).max(SCHLICK_AVERAGE);
        let specular = (self.f0 + (Vec3::splat(self.f90) - self.f0) * w).max_element();
        let diffuse = self.diffuse.max_element() * below_o;
        let total = specular + diffuse;
        if total > 0.0 { specular / total } else { 1.0 }
    }

    /// Whether `sample` takes the specular lobe for this viewer and this first number; for reports.
    pub fn takes_specular(&self, wo: Vec3, u: f32) -> bool {
        u < self.p_specular(wo.z, self.below.at(wo.z))
    }

    /// Whether the specular lobe is a mirror.
    pub fn is_mirror(&self) -> bool {
        self.mirror
    }

    /// Value and density for a pair of directions; the mirror is not part of it.
    #[inline(always)]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if !(wo.z > 0.0 && wi.z > 0.0) {
            return BsdfEval::ZERO;
        }
        let below_o = self.below.at(wo.z);
        self.eval_above(wo, wi, half_vector(wo, wi), below_o, self.p_specular(wo.z, below_o))
    }

    #[inline(always)]
    fn eval_above(&self, wo: Vec3, wi: Vec3, m: Vec3, below_o: f32, p_specular: f32) -> BsdfEval {
        let cosine = wi.z * FRAC_1_PI;
        let diffuse = self.diffuse * (cosine * self.below.split(below_o, self.below.at(wi.z)));
        let diffuse_pdf = (1.0 - p_specular) * cosine;
        if self.mirror {
            return BsdfEval { f_cos: diffuse, pdf_sa: diffuse_pdf };
        }
        let lobe = self.ggx.reflection(wo, wi, m);
        let specular = schlick(self.f0, self.f90, wo.dot(m)) * lobe.f_cos;
        BsdfEval { f_cos: specular + diffuse, pdf_sa: p_specular * lobe.pdf_sa + diffuse_pdf }
    }

    /// Draws a direction; `u` = lobe, u, v. `None` where the chosen facet reflects into the surface.
    #[inline(always)]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> Option<BsdfSample> {
        let seen = wo.z > 0.0;
        if !seen {
            return None;
        }
        let below_o = self.below.at(wo.z);
        let p_specular = self.p_specular(wo.z, below_o);
        let (wi, m) = if u[0] < p_specular {
            if self.mirror {
                let weight = schlick(self.f0, self.f90, wo.z) / p_specular;
                let wi = Vec3::new(-wo.x, -wo.y, wo.z);
                return Some(BsdfSample { wi, weight, pdf_sa: f32::INFINITY, eta: 1.0 });
            }
            let m = self.ggx.sample_visible(wo, [u[1], u[2]]);
            (reflect(wo, m), m)
        } else {
            let wi = warp::cosine_hemisphere([u[1], u[2]]);
            (wi, half_vector(wo, wi))
        };
        let above = wi.z > 0.0;
        if !above {
            return None;
        }
        let eval = self.eval_above(wo, wi, m, below_o, p_specular);
        (eval.pdf_sa > 0.0).then(|| BsdfSample { wi, weight: eval.f_cos / eval.pdf_sa, pdf_sa: eval.pdf_sa, eta: 1.0 })
    }
}
