//! Perfectly diffuse reflection: f = albedo/π on the viewer's side, nothing through the surface.
//! Directions in the shading frame, n = +z; `eval` includes the cosine; pdfs in sr⁻¹.
//! Limit: a viewer or light at or below the horizon sees nothing; the caller orients the frame towards the viewer.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::{BsdfEval, BsdfSample};
use crate::math::warp;

/// Value and density for a pair of directions.
#[inline(always)]
pub fn eval(albedo: Vec3, wo: Vec3, wi: Vec3) -> BsdfEval {
    let above = wo.z > 0.0 && wi.z > 0.0;
    let pdf_sa = if above { wi.z * FRAC_1_PI } else { 0.0 };
    BsdfEval { f_cos: albedo * pdf_sa, pdf_sa }
}

/// Draws a cosine-distributed direction; its weight is the albedo itself, with no division.
#[inline(always)]
pub fn sample(albedo: Vec3, wo: Vec3, u: [f32; 2]) -> Option<BsdfSample> {
    let wi = warp::cosine_hemisphere(u);
    let pdf_sa = wi.z * FRAC_1_PI;
    (wo.z > 0.0 && pdf_sa > 0.0).then_some(BsdfSample { wi, weight: albedo, pdf_sa, eta: 1.0 })
}
