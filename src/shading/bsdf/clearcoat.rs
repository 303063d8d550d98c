//! Clearcoat: a smooth or rough dielectric layer of index 1.5 over any other surface (`KHR_materials_clearcoat`), sheen
//! included.
//!
//! The layer reflects by one GGX lobe with Schlick's F0 = 0.04, times its weight w. What it takes, the surface below
//! must give up: with E the albedo of the layer, the surface below is scaled by min(1 − wE(μo), 1 − wE(μi)). That
//! is the extension's mix by the layer's reflectance, at the more grazing of both directions: reciprocal, exact over a
//! mirror, never a gain; over a white diffuse base it loses at most 7 % (tests/suite/bsdf/clearcoat.rs). From inside a
//! solid the layer is not seen; light on its way out is scaled by 1 − wE of its direction outside, and what the layer
//! would send back inside is lost. Source: KHR_materials_clearcoat, section "Layering".
//!
//! The layer has its own normal: its cosines are those with it, whatever the normal of the surface below. Limit: of
//! directions below either horizon nothing is reflected.
//!
//! Directions in the shading frame, n = +z; `eval` includes the cosine; pdfs in sr⁻¹.

use glam::Vec3;

use super::albedo::{Complement, SpecularAlbedo};
use super::body::Body;
use super::fresnel::schlick;
use super::microfacet::{ALPHA_DELTA, Ggx, half_vector, reflect};
use super::model::{Bsdf, BsdfEval, BsdfSample, Extended, HIDDEN, Lobe, Tables, Textured};
use super::sheen::Sheen;
use crate::math::columns::array_column;
use crate::math::frame::Frame;
use crate::scene::Material;
use crate::shading::surface::Surface;

/// Reflectance at the normal of a layer of index 1.5 in air.
const F0: Vec3 = Vec3::splat(0.04);

/// The largest f32 below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// A layer and the surface below it.
#[derive(Clone, Copy, Debug)]
pub struct Clearcoat<'t> {
    weight: f32,
    ggx: Ggx,
    mirror: bool,
    /// 1 − E of a layer of weight 1.
    left: Complement<'t>,
    /// The layer's frame within the frame of the surface below.
    frame: Frame,
    base: Sheen<'t>,
}

impl<'t> Clearcoat<'t> {
    /// A layer of `weight` in [0, 1] and GGX `alpha` over `base`.
    #[inline(always)]
    pub fn over(base: impl Into<Sheen<'t>>, weight: f32, alpha: f32, tables: &'t SpecularAlbedo) -> Self {
        let mirror = alpha < ALPHA_DELTA;
        let left = tables.complement(if mirror { 0.0 } else { alpha }, F0.x, 1.0);
        let ggx = Ggx::isotropic(alpha.max(ALPHA_DELTA));
        Clearcoat { weight, ggx, mirror, left, frame: Frame::from_normal(Vec3::Z), base: base.into() }
    }

    /// The same with the layer's normal along `n`, a unit vector in the frame of the surface below.
    #[inline(always)]
    pub fn with_normal(self, n: Vec3) -> Self {
        Clearcoat { frame: Frame::from_normal(n), ..self }
    }

    /// What the layer leaves of light to or from `w`; all of it inside.
    #[inline(always)]
    fn left(&self, w: Vec3) -> f32 {
        if w.z > 0.0 { 1.0 - self.weight * (1.0 - self.left.at(self.frame.n.dot(w).max(0.0))) } else { 1.0 }
    }

    /// The layer's normal.
    pub fn normal(&self) -> Vec3 {
        self.frame.n
    }

    /// What the layer leaves to the surface below of light from `wi` to `wo`, from 0 to 1.
    #[inline(always)]
    pub fn left_of_both(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.left(wo).min(self.left(wi))
    }

    /// What is below all layers.
    pub fn body(&self) -> &Body<'t> {
        &self.base.base
    }

    /// What all layers leave to it of light from `wi` to `wo`, from 0 to 1.
    #[inline(always)]
    pub fn left_to_body(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.left_of_both(wo, wi) * self.base.left_of_both(wo, wi)
    }

    #[inline(always)]
    fn takes_layer(u: f32, p_layer: f32) -> bool {
        u < p_layer
    }
}

array_column!(Clearcoat<'_>);

impl<'t> Bsdf<'t> for Clearcoat<'t> {
    const COLUMNS: bool = false;
    const TEXTURED: bool = true;
    const TRANSMITS: bool = true;
    const DELTAS: bool = true;
    const LAYERED: bool = false;
    const EXTENDED: bool = true;

    /// Probability with which the layer is sampled, by estimated albedos: 0 where it is not seen, else above 0.
    type View = f32;
    type Drawn = BsdfSample;

    #[inline(always)]
    fn new(material: &Material, textured: &Textured, tables: &Tables<'t>, u_material: f32) -> Self {
        Self::extended(material, textured, &Extended::constant(material, Vec3::Z), tables, u_material)
    }

    #[inline(never)]
    fn extended(_: &Material, textured: &Textured, extended: &Extended, tables: &Tables<'t>, u_material: f32) -> Self {
        // 1 − (1 − r) is not r.
        let glossiness = extended.glossiness;
        let dull = 1.0 - (1.0 - textured.roughness) * glossiness;
        let roughness = if glossiness < 1.0 { dull } else { textured.roughness };
        let textured = Textured { roughness, ..*textured };
        let base = Body::resolve(extended, textured, tables, u_material);
        let Extended { clearcoat, clearcoat_roughness: roughness, .. } = *extended;
        // A boundary within another solid is not there, nor what is on it.
        let there = textured.exterior != HIDDEN;
        let base = Sheen::over(base, extended.sheen_color, extended.sheen_roughness, tables.sheen.filter(|_| there));
        let weight = if there { clearcoat } else { 0.0 };
        let layer = Clearcoat::over(base, weight, roughness * roughness, tables.albedo);
        Clearcoat { frame: Frame { t: extended.tangent, n: extended.clearcoat_n, ..layer.frame }, ..layer }
    }

    #[inline(never)]
    fn orient(&mut self, frame: &Frame) {
        // Until now the layer's frame held its normal and the grain in the world.
        let Frame { t: tangent, n, .. } = self.frame;
        self.base.base.orient(frame, tangent);
        // It is on the viewer's side; the frame of a surface that transmits points outwards.
        let n = frame.to_local(n);
        *self = self.with_normal(if self.outward() && n.z < 0.0 { -n } else { n });
    }

    #[inline(always)]
    fn idle(tables: &Tables<'t>) -> Self {
        Clearcoat::over(Surface::Black, 0.0, 0.0, tables.albedo)
    }

    #[inline(always)]
    fn outward(&self) -> bool {
        self.base.base.is_transmissive()
    }

    #[inline(always)]
    fn is_delta(&self) -> bool {
        self.mirror && self.base.is_delta()
    }

    #[inline(never)]
    fn view(&self, wo: Vec3, _: f32) -> f32 {
        let left = self.left(wo);
        let layer = 1.0 - left;
        if layer > 0.0 { layer / (layer + left * self.base.albedo()) } else { 0.0 }
    }

    #[inline(never)]
    fn eval(&self, wo: Vec3, wi: Vec3, &p_layer: &f32, _: f32) -> BsdfEval {
        let base = self.base.eval(wo, wi);
        let mut f_cos = base.f_cos * self.left_of_both(wo, wi);
        let mut pdf_sa = base.pdf_sa * (1.0 - p_layer);
        if !self.mirror && wo.z > 0.0 && wi.z > 0.0 {
            let (o, i) = (self.frame.to_local(wo), self.frame.to_local(wi));
            if o.z > 0.0 && i.z > 0.0 {
                let m = half_vector(o, i);
                let lobe = self.ggx.reflection(o, i, m);
                f_cos += schlick(F0, 1.0, o.dot(m)) * (self.weight * lobe.f_cos);
                pdf_sa += p_layer * lobe.pdf_sa;
            }
        }
        BsdfEval { f_cos, pdf_sa }
    }

    fn diffuse(&self, wo: Vec3, wi: Vec3, _: &f32, _: f32) -> Vec3 {
        self.base.diffuse(wo, wi) * self.left_of_both(wo, wi)
    }

    #[inline(never)]
    fn draw(&self, wo: Vec3, u: [f32; 3], &p_layer: &f32) -> BsdfSample {
        let refused = BsdfSample { wi: Vec3::ZERO, weight: Vec3::ZERO, pdf_sa: 0.0, eta: 1.0 };
        if Self::takes_layer(u[0], p_layer) {
            let o = self.frame.to_local(wo);
            let m = if self.mirror { Vec3::Z } else { self.ggx.sample_visible(o, [u[1], u[2]]) };
            let i = reflect(o, m);
            let wi = self.frame.to_world(i);
            if !(o.z > 0.0 && i.z > 0.0 && wi.z > 0.0) {
                return refused;
            }
            if self.mirror {
                let weight = schlick(F0, 1.0, o.z) * (self.weight / p_layer);
                return BsdfSample { wi, weight, pdf_sa: f32::INFINITY, eta: 1.0 };
            }
            // Weighed with the surface below; 1 stands for a direction that there is.
            return BsdfSample { wi, pdf_sa: 1.0, ..refused };
        }
        // What lies above p_layer is uniform again.
        let u_base = ((u[0] - p_layer) / (1.0 - p_layer)).min(BELOW_ONE);
        let Some(sample) = self.base.sample(wo, [u_base, u[1], u[2]]) else { return refused };
        let scale = self.left_of_both(wo, sample.wi) / (1.0 - p_layer);
        BsdfSample { weight: sample.weight * scale, ..sample }
    }

    #[inline(always)]
    fn wi(drawn: &BsdfSample) -> Vec3 {
        drawn.wi
    }

    #[inline(never)]
    fn weigh(&self, wo: Vec3, drawn: &BsdfSample, p_layer: &f32, split: f32) -> BsdfSample {
        if self.weight == 0.0 || drawn.pdf_sa == 0.0 || drawn.pdf_sa == f32::INFINITY {
            return *drawn;
        }
        let BsdfEval { f_cos, pdf_sa } = self.eval(wo, drawn.wi, p_layer, split);
        let usable = pdf_sa > 0.0 && pdf_sa < f32::INFINITY;
        let (weight, pdf_sa) = if usable { (f_cos / pdf_sa, pdf_sa) } else { (Vec3::ZERO, 0.0) };
        BsdfSample { weight, pdf_sa, ..*drawn }
    }

    fn name(&self) -> &'static str {
        match (self.weight > 0.0, self.base.has_fibres()) {
            (true, _) => "clearcoat",
            (false, true) => "sheen",
            (false, false) => self.base.base.name(),
        }
    }

    fn lobe(&self, wo: Vec3, u: f32, &p_layer: &f32, reflected: bool) -> Lobe {
        match (Self::takes_layer(u, p_layer), self.mirror) {
            (true, true) => Lobe { name: "smooth clearcoat", alpha: 0.0 },
            (true, false) => Lobe { name: "rough clearcoat", alpha: self.ggx.alpha.x },
            (false, _) => {
                let u = ((u - p_layer) / (1.0 - p_layer)).min(BELOW_ONE);
                self.base.lobe(wo, u).unwrap_or_else(|u| self.base.base.lobe(wo, u, reflected))
            }
        }
    }

    fn widest_alpha(&self) -> f32 {
        let layer = if self.mirror || self.weight == 0.0 { 0.0 } else { self.ggx.alpha.x };
        layer.max(self.base.widest_alpha())
    }
}
