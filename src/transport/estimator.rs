//! How the two ways to find light are weighted, by strategy. A light found by both is counted once in expectation.

use crate::plan::options::{Heuristic, Strategy, Techniques};
use crate::shading::mis;

/// Weight of emission met by a BSDF-sampled (or camera) ray. `last_pdf_sa` is infinite where light sampling cannot find
/// the same path; `light_pdf_sa` is 0 where no light sampling takes place.
#[inline(always)]
pub fn emission_weight(strategy: Strategy, last_pdf_sa: f32, light_pdf_sa: f32) -> f32 {
    if last_pdf_sa == f32::INFINITY || light_pdf_sa == 0.0 {
        return 1.0;
    }
    match (strategy.techniques, strategy.heuristic) {
        (Techniques { light: false, .. }, _) => 1.0,
        (Techniques { bsdf: false, .. }, _) => 0.0,
        (_, Heuristic::Power) => mis::power_weight(last_pdf_sa, light_pdf_sa),
        (_, Heuristic::Balance) => mis::balance_weight(last_pdf_sa, light_pdf_sa),
    }
}

/// Weight of a light sample, given the density with which BSDF sampling would have chosen the same direction.
#[inline(always)]
pub fn light_weight(strategy: Strategy, light_pdf_sa: f32, bsdf_pdf_sa: f32, delta: bool) -> f32 {
    if delta {
        return 1.0;
    }
    match (strategy.techniques, strategy.heuristic) {
        (Techniques { light: false, .. }, _) => 0.0,
        (Techniques { bsdf: false, .. }, _) => 1.0,
        (_, Heuristic::Power) => mis::power_weight(light_pdf_sa, bsdf_pdf_sa),
        (_, Heuristic::Balance) => mis::balance_weight(light_pdf_sa, bsdf_pdf_sa),
    }
}
