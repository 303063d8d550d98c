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

impl GlossyParams {
    /// What the dielectric's coat leaves to its base.
    #[inline(always)]
    pub fn complement<'t>(&self, tables: &'t SpecularAlbedo) -> Complement<'t> {
        tables.complement(if self.alpha < ALPHA_DELTA { 0.0 } else { self.alpha }, self.f0.max_element(), self.f90)
    }
}

/// Mirror-like or GGX reflection over a diffuse base, mixed: everything but what the base gives up to the coat. Its functions have no
/// branches, for loops over lanes.
#[derive(Clone, Copy, Debug)]
pub struct Lobes {
    ggx: Ggx,
    mirror: bool,
    f0: Vec3,
    f90: f32,
    diffuse: Vec3,
}

/// A direction drawn from [`Lobes`], not yet weighed.
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    /// Unit direction; below the surface where the chosen facet reflects into it.
    pub wi: Vec3,
    /// Its facet.
    m: Vec3,
    /// Whether the mirror was chosen.
    mirrored: bool,
}

impl Lobes {
    /// Mixes the lobes.
    #[inline(always)]
    pub fn new(params: &GlossyParams) -> Self {
        let GlossyParams { base_color, metallic, alpha, f0, f90 } = *params;
        Lobes {
            ggx: Ggx::isotropic(alpha.max(ALPHA_DELTA)),
            mirror: alpha < ALPHA_DELTA,
            f0: f0 * (1.0 - metallic) + base_color * metallic,
            f90: f90 * (1.0 - metallic) + metallic,
            diffuse: base_color * (1.0 - metallic),
        }
    }

    /// Whether light sampling can find nothing: a mirror without a base.
    #[inline(always)]
    pub fn is_delta(&self) -> bool {
        self.mirror & (self.diffuse.x == 0.0) & (self.diffuse.y == 0.0) & (self.diffuse.z == 0.0)
    }

    /// Probability of the specular lobe for a viewer under `cos_o`, by estimated albedo. Never 0 where the lobe reflects at
    /// all. `below_o` is the coat's complement for the viewer.
    #[inline(always)]
    pub fn p_specular(&self, cos_o: f32, below_o: f32) -> f32 {
        let w = schlick_weight(cos_o).max(SCHLICK_AVERAGE);
        let specular = max_channel(self.f0 + (Vec3::splat(self.f90) - self.f0) * w);
        let diffuse = max_channel(self.diffuse) * below_o;
        let total = specular + diffuse;
        let p = specular / total;
        if total > 0.0 { p } else { 1.0 }
    }

    /// Value and density for directions above the surface with half vector `m`; the mirror is not part of it. `split` is what
    /// the coat leaves to the base.
    #[inline(always)]
    pub fn eval(&self, wo: Vec3, wi: Vec3, m: Vec3, split: f32, p_specular: f32) -> BsdfEval {
        let cosine = wi.z * FRAC_1_PI;
        let diffuse = self.diffuse * (cosine * split);
        let diffuse_pdf = (1.0 - p_specular) * cosine;
        let lobe = self.ggx.reflection(wo, wi, m);
        let specular = schlick(self.f0, self.f90, wo.dot(m)) * lobe.f_cos;
        let both = specular + diffuse;
        BsdfEval {
            f_cos: choose(self.mirror, diffuse, both),
            pdf_sa: if self.mirror { diffuse_pdf } else { p_specular * lobe.pdf_sa + diffuse_pdf },
        }
    }

    /// Draws a direction for a viewer above the surface; `u` = lobe, u, v.
    #[inline(always)]
    pub fn draw(&self, wo: Vec3, u: [f32; 3], p_specular: f32) -> Drawn {
        let specular = u[0] < p_specular;
        let m = self.ggx.sample_visible(wo, [u[1], u[2]]);
        let around = warp::cosine_hemisphere([u[1], u[2]]);
        let mirrored = specular & self.mirror;
        let wi = choose(specular, reflect(wo, m), around);
        let wi = choose(mirrored, Vec3::new(-wo.x, -wo.y, wo.z), wi);
        Drawn { wi, m: choose(specular, m, half_vector(wo, around)), mirrored }
    }

    /// Weight and density of a drawn direction. A density of 0: nothing can be scattered there.
    #[inline(always)]
    pub fn weigh(&self, wo: Vec3, drawn: &Drawn, split: f32, p_specular: f32) -> (Vec3, f32) {
        let eval = self.eval(wo, drawn.wi, drawn.m, split, p_specular);
        let mirrored = schlick(self.f0, self.f90, wo.z) / p_specular;
        let weight = choose(drawn.mirrored, mirrored, eval.f_cos / eval.pdf_sa);
        let above = drawn.wi.z > 0.0;
        let pdf_sa = if drawn.mirrored { f32::INFINITY } else { eval.pdf_sa };
        (weight, if above { pdf_sa } else { 0.0 })
    }
}

/// One of two vectors, component by component.
#[inline(always)]
fn choose(first: bool, a: Vec3, b: Vec3) -> Vec3 {
    let one = |a: f32, b: f32| if first { a } else { b };
    Vec3::new(one(a.x, b.x), one(a.y, b.y), one(a.z, b.z))
}

#[inline(always)]
fn max_channel(color: Vec3) -> f32 {
    color.x.max(color.y).max(color.z)
}

/// The lobes with what the coat leaves to the base.
#[derive(Clone, Copy, Debug)]
pub struct Glossy<'t> {
    lobes: Lobes,
    below: Complement<'t>,
}

impl<'t> Glossy<'t> {
    /// Mixes the lobes.
    #[inline(always)]
    pub fn new(params: &GlossyParams, tables: &'t SpecularAlbedo) -> Self {
        Glossy { lobes: Lobes::new(params), below: params.complement(tables) }
    }

    /// Whether light sampling can find nothing: a mirror without a base.
    #[inline(always)]
    pub fn is_delta(&self) -> bool {
        self.lobes.is_delta()
    }

    /// Whether `sample` takes the specular lobe for this viewer and this first number; for reports.
    pub fn takes_specular(&self, wo: Vec3, u: f32) -> bool {
        u < self.lobes.p_specular(wo.z, self.below.at(wo.z))
    }

    /// Whether the specular lobe is a mirror.
    pub fn is_mirror(&self) -> bool {
        self.lobes.mirror
    }

    /// Value and density for a pair of directions; the mirror is not part of it.
    #[inline(always)]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if !(wo.z > 0.0 && wi.z > 0.0) {
            return BsdfEval::ZERO;
        }
        let below_o = self.below.at(wo.z);
        let split = self.below.split(below_o, self.below.at(wi.z));
        self.lobes.eval(wo, wi, half_vector(wo, wi), split, self.lobes.p_specular(wo.z, below_o))
    }

    /// Draws a direction; `u` = lobe, u, v. `None` where the chosen facet reflects into the surface.
    #[inline(always)]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> Option<BsdfSample> {
        let seen = wo.z > 0.0;
        if !seen {
            return None;
        }
        let below_o = self.below.at(wo.z);
        let p_specular = self.lobes.p_specular(wo.z, below_o);
        let drawn = self.lobes.draw(wo, u, p_specular);
        let split = self.below.split(below_o, self.below.at(drawn.wi.z));
        let (weight, pdf_sa) = self.lobes.weigh(wo, &drawn, split, p_specular);
        (pdf_sa > 0.0).then_some(BsdfSample { wi: drawn.wi, weight, pdf_sa, eta: 1.0 })
    }
}
