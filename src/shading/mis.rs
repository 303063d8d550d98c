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

#[cfg(test)]
mod tests {
    use super::*;

    const INF: f32 = f32::INFINITY;

    /// HARDCASES L15: the table and the ends.
    #[test]
    fn l15_table() {
        let cases = [
            (1e-25, 1e-25, 0.5),
            (1e-25, 3e-25, 0.1),
            (1e20, 1e20, 0.5),
            (1e20, 1e25, 1e-10),
            (3e38, 3e38, 0.5),
            (1e-38, 1e-38, 0.5),
            (1e-30, 1e10, 0.0),
            (0.0, 1.0, 0.0),
            (1.0, 0.0, 1.0),
            (INF, 1.0, 1.0),
            (0.0, 0.0, 0.0),
            (1.0, INF, 0.0),
            (INF, INF, 1.0),
        ];
        for (a, b, expected) in cases {
            let weight = power_weight(a, b);
            assert!((weight - expected).abs() <= expected * 2f32.powi(-22), "({a}, {b}): {weight}");
        }
        for (a, b, expected) in [(0.0, 0.0, 0.0), (1.0, 0.0, 1.0), (INF, 1.0, 1.0), (3e38, 3e38, 0.5), (1.0, 3.0, 0.25)]
        {
            assert_eq!(balance_weight(a, b), expected, "({a}, {b})");
        }
        assert!(power_weight(f32::NAN, 1.0).is_nan() && balance_weight(1.0, f32::NAN).is_nan());
    }

    /// L15: weights add up to 1 for 10^7 log-uniform pairs over the range of f32. Deterministic; no false alarms.
    #[test]
    fn l15_weights_sum_to_one() {
        let mut state = 0x9e37_79b9_7f4a_7c15u64;
        let mut positive = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            // Uniform in the bits of positive finite numbers is log-uniform in the numbers; subnormals included.
            f32::from_bits(((state >> 33) as u32) % INF.to_bits())
        };
        let limit = 2f32.powi(-22);
        for _ in 0..10_000_000 {
            let (a, b) = (positive(), positive());
            if a > 0.0 && b > 0.0 {
                let power = power_weight(a, b) + power_weight(b, a);
                let balance = balance_weight(a, b) + balance_weight(b, a);
                assert!((power - 1.0).abs() <= limit && (balance - 1.0).abs() <= limit, "({a:e}, {b:e})");
            }
        }
    }
}
