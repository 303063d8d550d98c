//! How the two ways to find light are weighted, by strategy. A light found by both is counted once in expectation.

use crate::plan::options::Strategy;
use crate::shading::mis;

/// Weight of emission met by a BSDF-sampled (or camera) ray. `last_pdf_sa` is infinite where light sampling cannot find
/// the same path; `light_pdf_sa` is 0 where no light sampling takes place.
#[inline(always)]
pub fn emission_weight(strategy: Strategy, last_pdf_sa: f32, light_pdf_sa: f32) -> f32 {
    if last_pdf_sa == f32::INFINITY || light_pdf_sa == 0.0 {
        return 1.0;
    }
    match strategy {
        Strategy::MisPower => mis::power_weight(last_pdf_sa, light_pdf_sa),
        Strategy::MisBalance => mis::balance_weight(last_pdf_sa, light_pdf_sa),
        Strategy::BsdfOnly => 1.0,
        Strategy::LightOnly => 0.0,
    }
}

/// Weight of a light sample, given the density with which BSDF sampling would have chosen the same direction.
#[inline(always)]
pub fn light_weight(strategy: Strategy, light_pdf_sa: f32, bsdf_pdf_sa: f32, delta: bool) -> f32 {
    if delta {
        return 1.0;
    }
    match strategy {
        Strategy::MisPower => mis::power_weight(light_pdf_sa, bsdf_pdf_sa),
        Strategy::MisBalance => mis::balance_weight(light_pdf_sa, bsdf_pdf_sa),
        Strategy::BsdfOnly => 0.0,
        Strategy::LightOnly => 1.0,
    }
}
