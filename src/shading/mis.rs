//! Weights of multiple importance sampling for two techniques with one sample each (Veach 1997, §9.2). Both pdfs are
//! those of the same path in the same measure.
//!
//! Written on the ratio of the pdfs: their squares leave the range of f32 below 1e-23 and above 1.8e19, the ratio does
//! so only where the weight is 0 or 1 to the last bit. For finite pdfs that are not both 0,
//! `w(a, b) + w(b, a) = 1` within 2^-22.
//! Specified at the ends: a technique of density 0 has weight 0, also against another 0; one of infinite density (a
//! mirror, which no light sample can hit) has weight 1. NaN stays NaN, to be counted.

/// Power heuristic with exponent 2, the weight of the technique with density `a`: a²/(a² + b²).
#[inline(always)]
pub fn power_weight(a: f32, b: f32) -> f32 {
    let ratio = b / a;
    specified_ends(a, 1.0 / (1.0 + ratio * ratio))
}

/// Balance heuristic, the weight of the technique with density `a`: a/(a + b).
#[inline(always)]
pub fn balance_weight(a: f32, b: f32) -> f32 {
    specified_ends(a, 1.0 / (1.0 + b / a))
}

#[inline(always)]
fn specified_ends(a: f32, weight: f32) -> f32 {
    if a == 0.0 {
        0.0
    } else if a == f32::INFINITY {
        1.0
    } else {
        weight
    }
}
