//! Opaque and translucent glTF surfaces with all that extensions add to them: a grain, a thin film, and light that the
//! diffuse base lets through (`KHR_materials_anisotropy`, `_iridescence`, `_diffuse_transmission`).
//!
//! As `glossy`: one GGX lobe with the Fresnel terms of metal and dielectric mixed, over a diffuse base that gets what
//! the dielectric's coat leaves. The base reflects the fraction 1 − t of its light by its colour and lets t through
//! by another (the thin-walled model of the extension: both sides are alike, directions behind are diffuse).
//!
//! What a coat takes is tabulated for surfaces without grain. With one, each direction uses the alpha that its own
//! azimuth shows, √(αx²cos²φ + αy²sin²φ), and the hemisphere √(αxαy): nothing is gained but 1 % (tested).
//! Under a film, the table is asked with a reflectance at the normal that bounds the film's at any angle by Schlick's
//! formula: nothing is gained, and light is lost where the film reflects less.
//!
//! Directions in the frame of the grain, n = +z; where light passes, wo.z < 0 is behind. `eval` includes |cos|; pdfs
//! in sr⁻¹.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::albedo::SpecularAlbedo;
use super::finish::{Fine, Finish};
use super::fresnel::{SCHLICK_AVERAGE, schlick, schlick_weight};
use super::glossy::GlossyParams;
use super::microfacet::{ALPHA_DELTA, half_vector, reflect};
use super::model::{BsdfEval, BsdfSample, Lobe};
use crate::math::warp;

/// What the base lets through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Through {
    /// Fraction of the light below the coat, from 0 to 1.
    pub fraction: f32,
    /// Its colour.
    pub color: Vec3,
}

impl Through {
    /// Nothing.
    pub const NOTHING: Through = Through { fraction: 0.0, color: Vec3::ZERO };
}

/// See the module.
#[derive(Clone, Copy, Debug)]
pub struct Translucent<'t> {
    params: GlossyParams,
    finish: Fine,
    through: Through,
    /// Largest reflectance at the normal of the dielectric's coat, as the table is asked.
    coat_f0: f32,
    tables: &'t SpecularAlbedo,
}

/// Cosines by which the reflectance of films is bounded.
const BOUNDED_AT: [f32; 5] = [1.0, 0.85, 0.7, 0.5, 0.3];

impl<'t> Translucent<'t> {
    /// A surface of these parameters, whose alpha `finish` replaces.
    #[inline(always)]
    pub fn new(params: GlossyParams, finish: Fine, through: Through, tables: &'t SpecularAlbedo) -> Self {
        let GlossyParams { f0, f90, .. } = params;
        let mut coat_f0 = f0.max_element();
        if finish.film.weight > 0.0 && f90 > 0.0 {
            // What Schlick's formula would need at the normal to reflect as much as the film does.
            let needed = |cos: f32| {
                let w = schlick_weight(cos);
                let film = finish.reflectance(schlick(f0 / f90, 1.0, cos), cos, f0 / f90).max_element();
                (film - w) / (1.0 - w)
            };
            coat_f0 = BOUNDED_AT.into_iter().map(needed).fold(f0.max_element() / f90, f32::max).min(1.0) * f90;
        }
        Translucent { params, finish, through, coat_f0, tables }
    }

    #[inline(always)]
    fn is_mirror(&self) -> bool {
        self.finish.alpha() < ALPHA_DELTA
    }

    /// What the lobe of its facets is made of.
    pub fn lobe_of_facets(&self) -> (&GlossyParams, Fine) {
        (&self.params, self.finish)
    }

    /// Whether light passes: the frame is then the outward one.
    #[inline(always)]
    pub fn is_transmissive(&self) -> bool {
        self.through.fraction > 0.0
    }

    /// Colours of the base: reflected, let through.
    #[inline(always)]
    fn base(&self) -> [Vec3; 2] {
        let share = 1.0 - self.params.metallic;
        let t = self.through.fraction;
        [self.params.base_color * (share * (1.0 - t)), self.through.color * (share * t)]
    }

    /// Whether `eval` is zero for every pair.
    #[inline(always)]
    pub fn is_delta(&self) -> bool {
        self.is_mirror() && self.base() == [Vec3::ZERO; 2]
    }

    /// Reflectance of the dielectric's coat at a facet.
    #[inline(always)]
    fn coat(&self, cos: f32) -> Vec3 {
        let GlossyParams { f0, f90, .. } = self.params;
        if f90 == 0.0 {
            return Vec3::ZERO;
        }
        // KHR_materials_specular scales what the film reflects, too.
        let plain = schlick(f0 / f90, 1.0, cos);
        self.finish.reflectance(plain, cos, f0 / f90) * f90
    }

    /// Reflectance of metal and dielectric together.
    #[inline(always)]
    fn fresnel(&self, cos: f32) -> Vec3 {
        let GlossyParams { metallic, base_color, .. } = self.params;
        let metal = || self.finish.reflectance(schlick(base_color, 1.0, cos), cos, base_color);
        match metallic {
            0.0 => self.coat(cos),
            1.0 => metal(),
            _ => self.coat(cos).lerp(metal(), metallic),
        }
    }

    /// What the coat leaves to the base of light to or from `w`, above the surface.
    #[inline(always)]
    fn left(&self, w: Vec3) -> f32 {
        let alpha = if self.is_mirror() { 0.0 } else { self.finish.alpha_towards(w) };
        self.tables.complement(alpha, self.coat_f0, self.params.f90).at(w.z)
    }

    #[inline(always)]
    fn mean_alpha(&self) -> f32 {
        if self.is_mirror() { 0.0 } else { self.finish.mean_alpha() }
    }

    /// What the coat leaves to the base of light between two directions above the surface.
    #[inline(always)]
    fn split(&self, o: Vec3, i: Vec3) -> f32 {
        let f90 = self.params.f90;
        if f90 == 0.0 {
            return 1.0;
        }
        self.tables.complement(self.mean_alpha(), self.coat_f0, f90).split(self.left(o), self.left(i))
    }

    /// Probabilities of reflection by the facets and, of the rest, of diffuse reflection: by estimated albedos.
    #[inline(always)]
    fn shares(&self, o: Vec3) -> [f32; 2] {
        let GlossyParams { f0, f90, base_color, metallic, .. } = self.params;
        let w = schlick_weight(o.z).max(SCHLICK_AVERAGE);
        let (f0, f90) = (f0.lerp(base_color, metallic), f90 + (1.0 - f90) * metallic);
        let film = if self.finish.film.weight > 0.0 { self.fresnel(o.z).max_element() } else { 0.0 };
        let specular = (f0 + (Vec3::splat(f90) - f0) * w).max_element().max(film);
        let [reflected, passed] = self.base().map(|color| color.max_element());
        let base = (reflected + passed) * if f90 > 0.0 { self.left(o) } else { 1.0 };
        let share = |a: f32, b: f32| if a + b > 0.0 { a / (a + b) } else { 1.0 };
        [share(specular, base), share(reflected, passed)]
    }

    /// Value and density; the mirror is not part of it.
    #[inline(always)]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        let side = if wo.z < 0.0 { -1.0 } else { 1.0 };
        let flip = Vec3::new(1.0, 1.0, side);
        let (o, i) = (wo * flip, wi * flip);
        let behind = i.z < 0.0;
        if !(o.z > 0.0) || i.z == 0.0 || !self.is_transmissive() && (side < 0.0 || behind) {
            return BsdfEval::ZERO;
        }
        let [p_specular, p_reflected] = self.shares(o);
        let [reflected, passed] = self.base();
        let above = Vec3::new(i.x, i.y, i.z.abs());
        let cosine = above.z * FRAC_1_PI;
        let split = self.split(o, above);
        let p_side = if behind { 1.0 - p_reflected } else { p_reflected };
        let mut f_cos = if behind { passed } else { reflected } * (cosine * split);
        let mut pdf_sa = (1.0 - p_specular) * p_side * cosine;
        if !behind && !self.is_mirror() {
            let m = half_vector(o, i);
            let lobe = self.finish.ggx().reflection(o, i, m);
            f_cos += self.fresnel(o.dot(m)) * lobe.f_cos;
            pdf_sa += p_specular * lobe.pdf_sa;
        }
        BsdfEval { f_cos, pdf_sa }
    }

    /// The part of [`eval`](Self::eval) that the base reflects; what it lets through is no part of it.
    pub fn diffuse(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let flip = Vec3::new(1.0, 1.0, if wo.z < 0.0 { -1.0 } else { 1.0 });
        let (o, i) = (wo * flip, wi * flip);
        if !(o.z > 0.0 && i.z > 0.0) || flip.z < 0.0 && !self.is_transmissive() {
            return Vec3::ZERO;
        }
        self.base()[0] * (i.z * FRAC_1_PI * self.split(o, i))
    }

    /// Draws a direction; `u` = lobe, u, v.
    #[inline(always)]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> Option<BsdfSample> {
        let side = if wo.z < 0.0 { -1.0 } else { 1.0 };
        let flip = Vec3::new(1.0, 1.0, side);
        let o = wo * flip;
        if !(o.z > 0.0) || side < 0.0 && !self.is_transmissive() {
            return None;
        }
        let [p_specular, p_reflected] = self.shares(o);
        let i = if u[0] < p_specular {
            if self.is_mirror() {
                let (i, weight) = (Vec3::new(-o.x, -o.y, o.z), self.fresnel(o.z) / p_specular);
                return Some(BsdfSample { wi: i * flip, weight, pdf_sa: f32::INFINITY, eta: 1.0 });
            }
            let i = reflect(o, self.finish.ggx().sample_visible(o, [u[1], u[2]]));
            if !(i.z > 0.0) {
                return None;
            }
            i
        } else {
            let around = warp::cosine_hemisphere([u[1], u[2]]);
            let behind = u[0] - p_specular >= (1.0 - p_specular) * p_reflected;
            if behind { -around } else { around }
        };
        let wi = i * flip;
        let BsdfEval { f_cos, pdf_sa } = self.eval(wo, wi);
        let usable = pdf_sa > 0.0 && pdf_sa < f32::INFINITY;
        usable.then(|| BsdfSample { wi, weight: f_cos / pdf_sa, pdf_sa, eta: 1.0 })
    }

    /// The lobe that a sample came from, for reports.
    pub fn lobe(&self, wo: Vec3, u: f32, reflected: bool) -> Lobe {
        let o = Vec3::new(wo.x, wo.y, wo.z.abs());
        match (u < self.shares(o)[0], reflected) {
            (true, _) => Lobe::specular(self.finish.alpha()),
            (false, true) => Lobe::wide("diffuse base"),
            (false, false) => Lobe::wide("diffuse transmission"),
        }
    }

    /// [`Lobe::alpha`] of its widest lobe, for reports.
    pub fn widest_alpha(&self) -> f32 {
        if self.base() == [Vec3::ZERO; 2] { Lobe::specular(self.finish.alpha()).alpha } else { 1.0 }
    }
}
