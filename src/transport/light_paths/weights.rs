//! Weights of three techniques that find the same path: BSDF samples (density b), light samples (l) and light paths
//! (t), by ratios of their densities, as in `shading/mis.rs`. Veach 1997 §9.2.

use crate::plan::options::{Heuristic, Strategy};

/// Weight of one of three techniques, by the densities of the other two over its own.
#[inline]
fn weight(heuristic: Heuristic, [first, second]: [f32; 2]) -> f32 {
    match heuristic {
        Heuristic::Power => 1.0 / (1.0 + first * first + second * second),
        Heuristic::Balance => 1.0 / (1.0 + first + second),
    }
}

/// Weight of emission that a BSDF-sampled ray meets, where light paths have the density `light_path` over the ray's.
/// `last_pdf_sa` and `light_pdf_sa` as in `estimator.rs`.
pub fn of_emission(strategy: Strategy, [last_pdf_sa, light_pdf_sa]: [f32; 2], light_path: f32) -> f32 {
    let found = last_pdf_sa < f32::INFINITY && light_pdf_sa > 0.0 && strategy.techniques.light;
    if found && !strategy.techniques.bsdf {
        return 0.0;
    }
    let light = if found { light_pdf_sa / last_pdf_sa } else { 0.0 };
    weight(strategy.heuristic, [light, light_path])
}

/// Weight of a light sample, where BSDF samples have the density `bsdf` over its own and light paths `light_path`, over
/// the weight that it has without light paths.
pub fn of_light_sample(strategy: Strategy, bsdf: f32, light_path: f32) -> f32 {
    let bsdf = if strategy.techniques.bsdf { bsdf } else { 0.0 };
    weight(strategy.heuristic, [bsdf, light_path]) / weight(strategy.heuristic, [bsdf, 0.0])
}

/// Weight of a light path, where BSDF samples have the density `bsdf` over its own and light samples `light`.
pub fn of_light_path(strategy: Strategy, bsdf: f32, light: f32) -> f32 {
    let light = if strategy.techniques.light { light } else { 0.0 };
    let bsdf = if strategy.techniques.bsdf || light == 0.0 { bsdf } else { 0.0 };
    weight(strategy.heuristic, [bsdf, light])
}

#[cfg(test)]
mod tests {
    use super::super::super::estimator;
    use super::*;

    /// Oracle: weights of all techniques that find a path sum to 1, and are those of two without the third.
    #[test]
    fn weights_sum_to_one() {
        for strategy in [Strategy::MIS, Strategy::MIS_BALANCE, Strategy::BSDF, Strategy::LIGHT] {
            for (b, l, t) in [(1.0, 2.0, 0.5), (3.0, 1e-3, 4.0), (1e-4, 1e4, 1.0), (2.0, 0.0, 1.0)] {
                let emission = of_emission(strategy, [b, l], t / b);
                let sample = if l > 0.0 {
                    estimator::light_weight(strategy, l, b, false) * of_light_sample(strategy, b / l, t / l)
                } else {
                    0.0
                };
                let path = of_light_path(strategy, b / t, l / t);
                assert!((emission + sample + path - 1.0).abs() < 1e-6, "{strategy} {b} {l} {t}");
                let two = estimator::emission_weight(strategy, b, l);
                assert!((of_emission(strategy, [b, l], 0.0) - two).abs() < 1e-6);
            }
            // A mirror before the light: no light sample. A point of light: no ray meets it.
            assert!(
                (of_emission(strategy, [f32::INFINITY, 0.0], 2.0) + of_light_path(strategy, 0.5, 0.0) - 1.0).abs()
                    < 1e-6
            );
            if strategy.techniques.light {
                assert!((of_light_sample(strategy, 0.0, 0.5) + of_light_path(strategy, 0.0, 2.0) - 1.0).abs() < 1e-6);
            }
        }
    }
}
