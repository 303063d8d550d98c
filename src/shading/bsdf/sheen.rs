//! Sheen: fibres over any other surface, which scatter most at grazing angles (`KHR_materials_sheen`).
//!
//! The lobe is the colour c times that of `sheen_albedo`. What it takes, the surface below gives up: that is scaled by
//! min(1 − cE(μo), 1 − cE(μi)), c the largest channel of the colour and E the lobe's directional albedo (section
//! "Albedo-scaling technique"). Both are reciprocal. The extension's lobe returns up to 17 times what it gets where the
//! roughness is below 0.25 and the cosine below 0.05; it is divided by max(1, cE(μo), cE(μi)), which is 1 elsewhere.
//! From inside a solid the fibres are not seen.
//!
//! Directions in the shading frame, n = +z; `eval` includes the cosine; pdfs in sr⁻¹. Limit: a roughness below
//! [`MIRROR_ROUGHNESS`] leaves no fibres: the lobe's limit reflects nothing but at the horizon.

use glam::Vec3;

use super::body::Body;
use super::model::{BsdfEval, BsdfSample, Lobe};
use super::sheen_albedo::{SheenAlbedo, fibres};
use crate::math::warp;
use crate::scene::material::facts::MIRROR_ROUGHNESS;

/// The largest f32 below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;
/// Fibres over a surface.
#[derive(Clone, Copy, Debug)]
pub struct Sheen<'t> {
    color: Vec3,
    /// Largest channel of the colour; 0 without fibres.
    largest: f32,
    roughness: f32,
    /// There where there are fibres.
    table: Option<&'t SheenAlbedo>,
    /// What is below.
    pub base: Body<'t>,
}

impl<'t> Sheen<'t> {
    /// Fibres of a colour from 0 to 1 and a glTF roughness over `base`; none without a table.
    #[inline(always)]
    pub fn over(base: impl Into<Body<'t>>, color: Vec3, roughness: f32, table: Option<&'t SheenAlbedo>) -> Self {
        let color = color.clamp(Vec3::ZERO, Vec3::ONE);
        let table = table.filter(|_| roughness >= MIRROR_ROUGHNESS && color.max_element() > 0.0);
        let largest = if table.is_some() { color.max_element() } else { 0.0 };
        Sheen { color, largest, roughness, table, base: base.into() }
    }

    /// Largest albedo of the lobe for light to or from `w`; 0 inside.
    #[inline(always)]
    fn taken(&self, w: Vec3) -> f32 {
        match self.table {
            Some(table) if w.z > 0.0 => self.largest * table.at(w.z, self.roughness),
            _ => 0.0,
        }
    }

    /// What the fibres leave to the surface below of light from `wi` to `wo`, from 0 to 1.
    #[inline(always)]
    fn left(taken_o: f32, taken_i: f32) -> f32 {
        (1.0 - taken_o.max(taken_i)).max(0.0)
    }

    /// The same, of two directions.
    #[inline(always)]
    pub fn left_of_both(&self, wo: Vec3, wi: Vec3) -> f32 {
        if self.table.is_none() { 1.0 } else { Self::left(self.taken(wo), self.taken(wi)) }
    }

    /// Probability with which the fibres are sampled: 0 where they are not seen, else above 0.
    #[inline(always)]
    fn p_fibres(&self, wo: Vec3, taken_o: f32) -> f32 {
        if self.table.is_none() || !(wo.z > 0.0) {
            return 0.0;
        }
        // A lobe that takes little may take more of some directions than its mean says.
        let layer = taken_o.min(1.0).max(0.05 * self.largest);
        layer / (layer + (1.0 - taken_o).max(0.0) * self.base.albedo())
    }

    /// Largest albedo of the whole, about: it serves the choice between lobes.
    #[inline(always)]
    pub fn albedo(&self) -> f32 {
        self.base.albedo().max(self.largest)
    }

    /// Whether there are any fibres.
    pub fn has_fibres(&self) -> bool {
        self.table.is_some()
    }

    /// Whether `eval` is zero for every pair.
    #[inline(always)]
    pub fn is_delta(&self) -> bool {
        self.table.is_none() && self.base.is_delta()
    }

    /// f·|cos θ_i| and the density of `sample`.
    #[inline(always)]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        let base = self.base.eval(wo, wi);
        if self.table.is_none() {
            return base;
        }
        let (taken_o, taken_i) = (self.taken(wo), self.taken(wi));
        let p_fibres = self.p_fibres(wo, taken_o);
        let mut f_cos = base.f_cos * Self::left(taken_o, taken_i);
        let mut pdf_sa = base.pdf_sa * (1.0 - p_fibres);
        if wo.z > 0.0 && wi.z > 0.0 {
            f_cos += self.color * (fibres(wo, wi, self.roughness) / taken_o.max(taken_i).max(1.0));
            pdf_sa += warp::UNIFORM_HEMISPHERE_PDF * p_fibres;
        }
        BsdfEval { f_cos, pdf_sa }
    }

    /// The part of [`eval`](Self::eval) that the diffuse base reflects.
    pub fn diffuse(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let base = self.base.diffuse(wo, wi);
        if self.table.is_none() { base } else { base * Self::left(self.taken(wo), self.taken(wi)) }
    }

    /// Draws a direction; `u` = lobe, u, v.
    #[inline(always)]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> Option<BsdfSample> {
        if self.table.is_none() {
            return self.base.sample(wo, u);
        }
        let taken_o = self.taken(wo);
        let p_fibres = self.p_fibres(wo, taken_o);
        let sample = if u[0] < p_fibres {
            let wi = warp::uniform_hemisphere([u[1], u[2]]);
            BsdfSample { wi, weight: Vec3::ZERO, pdf_sa: warp::UNIFORM_HEMISPHERE_PDF, eta: 1.0 }
        } else {
            // What lies above is uniform again.
            let u_base = ((u[0] - p_fibres) / (1.0 - p_fibres)).min(BELOW_ONE);
            let sample = self.base.sample(wo, [u_base, u[1], u[2]])?;
            if sample.pdf_sa == f32::INFINITY {
                let scale = Self::left(taken_o, self.taken(sample.wi)) / (1.0 - p_fibres);
                return Some(BsdfSample { weight: sample.weight * scale, ..sample });
            }
            sample
        };
        let BsdfEval { f_cos, pdf_sa } = self.eval(wo, sample.wi);
        let usable = pdf_sa > 0.0 && pdf_sa < f32::INFINITY;
        usable.then(|| BsdfSample { weight: f_cos / pdf_sa, pdf_sa, ..sample })
    }

    /// The lobe that a sample came from, for reports; else the number that chose within the surface below.
    pub fn lobe(&self, wo: Vec3, u: f32) -> Result<Lobe, f32> {
        let p_fibres = self.p_fibres(wo, self.taken(wo));
        if u < p_fibres { Ok(Lobe::wide("sheen")) } else { Err(((u - p_fibres) / (1.0 - p_fibres)).min(BELOW_ONE)) }
    }

    /// [`Lobe::alpha`] of its widest lobe, for reports.
    pub fn widest_alpha(&self) -> f32 {
        if self.table.is_some() { 1.0 } else { self.base.widest_alpha() }
    }
}

impl<'t, B: Into<Body<'t>>> From<B> for Sheen<'t> {
    fn from(base: B) -> Self {
        Sheen::over(base, Vec3::ZERO, 0.0, None)
    }
}
