//! Scattering functions. Directions in the shading frame, n = +z; `eval` includes |cos θ_i|; pdfs in sr⁻¹.

use glam::Vec3;

pub mod albedo;
pub mod dielectric;
pub mod fresnel;
pub mod glossy;
pub mod lambert;
pub mod microfacet;

/// Value and density of a BSDF for one pair of directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfEval {
    /// f(wo, wi)·|cos θ_i|, per channel, sr⁻¹.
    pub f_cos: Vec3,
    /// Density of `sample` choosing `wi`, sr⁻¹. 0 where `f_cos` is 0 by support.
    pub pdf_sa: f32,
}

impl BsdfEval {
    /// Nothing scattered, never sampled.
    pub const ZERO: BsdfEval = BsdfEval { f_cos: Vec3::ZERO, pdf_sa: 0.0 };
}

/// A direction drawn from a BSDF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Unit direction towards the light.
    pub wi: Vec3,
    /// f·|cos θ_i| / pdf, per channel: what the throughput is multiplied by. Finite, ≥ 0. Radiance convention: includes
    /// 1/η² on refraction into a medium of relative index η (so that L/n² is conserved).
    pub weight: Vec3,
    /// Density of the choice, sr⁻¹; +∞ for a delta lobe, which light sampling cannot hit.
    pub pdf_sa: f32,
    /// n(side of wi)/n(side of wo): 1 for reflection.
    pub eta: f32,
}
