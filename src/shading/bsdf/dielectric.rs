//! Clear dielectrics: a solid whose surface reflects and refracts, and a thin wall that light passes straight.
//!
//! Outward frame: wo.z > 0 is outside, wo.z < 0 inside a solid; both sides of a thin wall are alike. Exact Fresnel; the
//! tint (glTF base colour) multiplies light at each crossing, reflection is untinted but for KHR_materials_specular.
//! Radiance convention: crossing into relative index η weighs by 1/η². `eval` includes |cos|; pdfs in sr⁻¹.
//!
//! Rough: Walter et al. 2007 with separable Smith masking and visible normals; the side is chosen by the facet's own
//! reflectance. The thin wall follows KHR_materials_transmission: one interface, no internal bounces, the transmitted
//! lobe is the reflected one mirrored through the wall. A surface whose lobes f32 half vectors cannot resolve is
//! smooth.
//!
//! Limit: `specular` < 1 takes light from reflection and gives it to transmission; where nothing can be transmitted
//! (total reflection) it has no effect, because the light has nowhere else to go.

use glam::Vec3;

use super::finish::{Fine, Finish};
use super::fresnel::{self, Interface};
use super::microfacet::{ALPHA_DELTA, half_vector, reflect};
use super::model::{BsdfEval, BsdfSample, Lobe};

/// Least alpha·|η−1| at which a refracting lobe counts as rough: the half vector of two refracted f32 directions
/// has a relative error of about 2⁻²³/|η−1|, which is then a hundredth of alpha.
const REFRACTION_DELTA: f32 = 1e-5;

/// Whether light crosses a wall or enters a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Body {
    /// Refracts; the other side is the inside.
    Solid,
    /// Lets light pass straight; both sides are outside.
    Thin,
}

/// A clear dielectric surface at a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dielectric<F: Finish = f32> {
    /// Solid or thin-walled.
    pub body: Body,
    /// n(inside)/n(outside), at most [`fresnel::MAX_INDEX`].
    pub eta: f32,
    /// GGX alpha, or what there is instead.
    pub alpha: F,
    /// Colour of what is transmitted.
    pub tint: Vec3,
    /// KHR_materials_specular's factor: scales reflection.
    pub specular: f32,
    /// KHR_materials_specular's colour: scales reflection at the normal.
    pub specular_color: Vec3,
}

/// Where light goes at one facet.
#[derive(Clone, Copy, Debug)]
struct Split {
    interface: Interface,
    /// Reflected fraction by channel.
    reflected: Vec3,
    /// Its largest channel: the probability of reflecting. The rest is transmitted.
    p_reflect: f32,
}

impl Dielectric {
    /// A boundary between a medium and itself.
    pub const NOTHING: Dielectric = Dielectric {
        body: Body::Solid,
        eta: 1.0,
        alpha: 0.0,
        tint: Vec3::ONE,
        specular: 1.0,
        specular_color: Vec3::ONE,
    };

    /// The same with another finish.
    #[inline(always)]
    pub fn finished(self, finish: Fine) -> Dielectric<Fine> {
        let Dielectric { body, eta, tint, specular, specular_color, .. } = self;
        Dielectric { body, eta, alpha: finish, tint, specular, specular_color }
    }
}

impl<F: Finish> Dielectric<F> {
    /// Whether light sampling can find nothing.
    #[inline(always)]
    pub fn is_delta(&self) -> bool {
        let alpha = self.alpha.alpha();
        alpha < ALPHA_DELTA || (self.body == Body::Solid && alpha * (self.eta - 1.0).abs() < REFRACTION_DELTA)
    }

    /// The lobe that a sample came from, for reports.
    pub fn lobe(&self, reflected: bool) -> Lobe {
        let name = match (reflected, self.body, self.is_delta()) {
            (true, _, true) => "smooth reflection",
            (true, _, false) => "rough reflection",
            (false, Body::Solid, true) => "smooth refraction",
            (false, Body::Solid, false) => "rough refraction",
            (false, Body::Thin, true) => "smooth transmission",
            (false, Body::Thin, false) => "rough transmission",
        };
        Lobe { name, alpha: if self.is_delta() { 0.0 } else { self.alpha.alpha() } }
    }

    /// Reflectance at a facet seen at `cos` ≥ 0 from the side of `wo`.
    #[inline(always)]
    fn split(&self, wo: Vec3, cos: f32) -> Split {
        let inside = self.body == Body::Solid && wo.z < 0.0;
        self.split_signed(if inside { -cos } else { cos })
    }

    /// Reflectance at a facet; `cos` > 0 is seen from outside, < 0 from inside.
    #[inline(always)]
    fn split_signed(&self, cos: f32) -> Split {
        let interface = fresnel::dielectric(cos, self.eta);
        let f = interface.reflectance;
        // F runs from F0 to 1; the tint acts on the F0 end of that scale and leaves white specular exactly F.
        let root = (self.eta - 1.0) / (self.eta + 1.0);
        let f0 = root * root;
        let towards_normal = ((1.0 - f) / (1.0 - f0).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
        let shift = ((self.specular_color * f0).min(Vec3::ONE) - Vec3::splat(f0)) * towards_normal;
        let outer = if cos < 0.0 { interface.cos_t } else { cos };
        let plain = Vec3::splat(f) + shift;
        let finished = self.alpha.reflectance(plain, outer, (self.specular_color * f0).min(Vec3::ONE));
        let partial = (self.specular * finished).clamp(Vec3::ZERO, Vec3::ONE);
        let reflected = if f < 1.0 { partial } else { Vec3::ONE };
        Split { interface, reflected, p_reflect: reflected.max_element() }
    }

    /// Value and density for a pair of directions; zero if the surface is smooth.
    #[inline(always)]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if self.is_delta() || wo.z == 0.0 || wi.z == 0.0 {
            return BsdfEval::ZERO;
        }
        // Work above the surface, whichever side the viewer is on.
        let side = if wo.z < 0.0 { -1.0 } else { 1.0 };
        let flip = Vec3::new(1.0, 1.0, side);
        let (o, i) = (wo * flip, wi * flip);
        if i.z > 0.0 {
            let m = half_vector(o, i);
            self.reflected(wo, o, i, m)
        } else if self.body == Body::Thin {
            let mirrored = Vec3::new(i.x, i.y, -i.z);
            self.transmitted_thin(wo, o, mirrored, half_vector(o, mirrored))
        } else {
            self.refracted(wo, wi)
        }
    }

    #[inline(always)]
    fn reflected(&self, wo: Vec3, o: Vec3, i: Vec3, m: Vec3) -> BsdfEval {
        let split = self.split(wo, shared_cosine(o, i, m));
        let lobe = self.alpha.ggx().reflection(o, i, m);
        BsdfEval { f_cos: split.reflected * lobe.f_cos, pdf_sa: split.p_reflect * lobe.pdf_sa }
    }

    /// `mirrored` is the transmitted direction reflected back through the wall.
    #[inline(always)]
    fn transmitted_thin(&self, wo: Vec3, o: Vec3, mirrored: Vec3, m: Vec3) -> BsdfEval {
        let through = 1.0 - self.split(wo, shared_cosine(o, mirrored, m)).p_reflect;
        let lobe = self.alpha.ggx().reflection(o, mirrored, m);
        BsdfEval { f_cos: self.tint * (through * lobe.f_cos), pdf_sa: through * lobe.pdf_sa }
    }

    /// Written for the pair as the outside and the inside see it, whoever the viewer is: h = outer + η·inner and the
    /// cosines with it are then the same numbers there and back, and reciprocity holds to rounding also where they
    /// cancel.
    #[inline(always)]
    fn refracted(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        let inside = wo.z < 0.0;
        let (outer, inner) = if inside { (wi, wo) } else { (wo, wi) };
        let h = outer + self.eta * inner;
        let length = h.length();
        let m = h * (h.z.signum() / length.max(f32::MIN_POSITIVE));
        let (outer_m, inner_m) = (outer.dot(m), -inner.dot(m));
        if !(outer_m > 0.0 && inner_m > 0.0 && length > 0.0) {
            return BsdfEval::ZERO;
        }
        // The reflectance is the same from both sides; the cosine on the thin side tells it without the square root
        // that magnifies rounding near the critical angle on the other.
        let through = 1.0 - self.split_signed(if self.eta < 1.0 { -inner_m } else { outer_m }).p_reflect;
        let ggx = self.alpha.ggx();
        // d(normal)/d(wi) = η²·|i·m|/|o + η·i|² with the viewer's η; the radiance of the denser side is η²
        // higher, which cancels its η². `length` is |o + η·i| from outside, η times it from inside, and equals
        // |cos_o − η·cos_t|.
        let eta2 = self.eta * self.eta;
        let (o_m, i_m, value, density) =
            if inside { (inner_m, outer_m, eta2, 1.0) } else { (outer_m, inner_m, 1.0, eta2) };
        let shared = through * ggx.density(m) * (o_m * i_m) / (length * length) * ggx.masking_over_cos(wo);
        BsdfEval { f_cos: self.tint * (shared * ggx.masking(wi) * value), pdf_sa: shared * density }
    }

    /// Draws a direction; `u` = reflect or transmit, u, v.
    #[inline(always)]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> Option<BsdfSample> {
        if wo.z == 0.0 || !wo.z.is_finite() {
            return None;
        }
        let side = if wo.z < 0.0 { -1.0 } else { 1.0 };
        let flip = Vec3::new(1.0, 1.0, side);
        let o = wo * flip;
        let smooth = self.is_delta();
        let ggx = self.alpha.at_least(ALPHA_DELTA).ggx();
        let m = if smooth { Vec3::Z } else { ggx.sample_visible(o, [u[1], u[2]]) };
        let o_m = o.dot(m).max(0.0);
        let split = self.split(wo, o_m);

        // Reflection: the weight is tint over probability, times masking if rough.
        if u[0] < split.p_reflect {
            let i = reflect(o, m);
            let above = i.z > 0.0;
            if !above {
                return None;
            }
            let masking = if smooth { 1.0 } else { ggx.masking(i) };
            let pdf_sa = if smooth { f32::INFINITY } else { split.p_reflect * ggx.reflection(o, i, m).pdf_sa };
            let weight = split.reflected * (masking / split.p_reflect);
            return Some(BsdfSample { wi: i * flip, weight, pdf_sa, eta: 1.0 });
        }

        // Straight through a thin wall: the mirrored reflection.
        if self.body == Body::Thin {
            let mirrored = reflect(o, m);
            let above = mirrored.z > 0.0;
            if !above {
                return None;
            }
            let masking = if smooth { 1.0 } else { ggx.masking(mirrored) };
            let through = 1.0 - split.p_reflect;
            let pdf_sa = if smooth { f32::INFINITY } else { through * ggx.reflection(o, mirrored, m).pdf_sa };
            let wi = Vec3::new(mirrored.x, mirrored.y, -mirrored.z) * flip;
            return Some(BsdfSample { wi, weight: self.tint * masking, pdf_sa, eta: 1.0 });
        }

        // Refraction.
        let Interface { cos_t, eta, .. } = split.interface;
        // Rounding grows with 1/eta on the way out of a dense body; equal indices change nothing at all.
        let i = if eta == 1.0 { -o } else { (m * (o_m / eta - cos_t) - o / eta).normalize() };
        let through = i.z < 0.0;
        if !through {
            return None;
        }
        let masking = if smooth { 1.0 } else { ggx.masking(i) };
        let pdf_sa = if smooth {
            f32::INFINITY
        } else {
            // |o + η·i| by difference of squares: no cancellation between the two cosines.
            let length = ((eta - 1.0) * (eta + 1.0)).abs() / (o_m + eta * cos_t);
            (1.0 - split.p_reflect) * ggx.visible_pdf(o, m) * cos_t * eta * eta / (length * length)
        };
        let weight = self.tint * (masking / (eta * eta));
        Some(BsdfSample { wi: i * flip, weight, pdf_sa, eta })
    }
}

/// Cosine of two directions with their half vector: one number for both, so that the reflectance near the critical
/// angle is the same there and back.
#[inline(always)]
fn shared_cosine(o: Vec3, i: Vec3, m: Vec3) -> f32 {
    (0.5 * (o.dot(m) + i.dot(m))).max(0.0)
}
