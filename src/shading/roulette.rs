//! Russian roulette: ends paths that carry little, and scales up those that go on so that the expectation stays.
//!
//! The path goes on when a uniform number is below the survival probability q, and its throughput is then divided by q.
//! q follows the largest channel of the throughput, so q ≥ throughput in every channel and a survivor never carries more
//! than 1: the variance stays finite for every albedo below 1 (it needs q > ρ² a bounce in the brightest channel, and a
//! rule on luminance breaks that in red). The factor 1/η² of radiance that entered glass is taken out first: it comes
//! back on the way out, and ending paths on it would make glass noisy (as PBRT and Mitsuba do).
//! Limit: with an albedo of 1 q stays 1; the depth limit of the render ends such paths, and counts them.

use glam::Vec3;

/// First path vertex (1 is the first surface) at which a path may end: shorter paths carry most of the image, and
/// ending them saves little.
pub const FIRST_VERTEX: u32 = 4;

/// Values of a uniform f32 in [0,1) are multiples of 2^-24.
const LATTICE: f32 = 16_777_216.0;

/// Probability with which a path of throughput `beta` goes on from path vertex `vertex`; `eta_scale` is the product of
/// η² over its refractions. 0 only where `beta` is 0 (such a path ends at any vertex), else in [2^-24, 1]; 1 before
/// [`FIRST_VERTEX`], and for a throughput that is NaN, which is to reach the counter.
#[inline(always)]
pub fn survival(beta: Vec3, eta_scale: f32, vertex: u32) -> f32 {
    let largest = beta.max_element();
    if largest <= 0.0 {
        return 0.0;
    }
    if vertex < FIRST_VERTEX {
        return 1.0;
    }
    on_lattice((largest * eta_scale).min(1.0))
}

/// `q` rounded up to a multiple of 2^-24, at least one: `u < q` then has exactly this probability, however small.
#[inline(always)]
pub fn on_lattice(q: f32) -> f32 {
    (q * LATTICE).ceil().max(1.0) / LATTICE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stays_within_its_bounds() {
        for exponent in -149..=20 {
            let beta = Vec3::new(0.1, 1.0, 0.3) * 2f32.powi(exponent);
            for eta_scale in [0.1, 1.0 / 2.25, 1.0, 2.25] {
                for vertex in 1..100 {
                    let q = survival(beta, eta_scale, vertex);
                    assert!(q > 0.0 && q <= 1.0, "q = {q} at 2^{exponent}");
                    assert!(q >= (beta.max_element() * eta_scale).min(1.0), "a survivor would gain at 2^{exponent}");
                    assert!((beta * eta_scale / q).max_element() <= (beta * eta_scale).max_element().max(1.0));
                    assert!(vertex >= FIRST_VERTEX || q == 1.0);
                    assert_eq!((q * LATTICE).fract(), 0.0);
                }
            }
        }
        assert_eq!(survival(Vec3::ZERO, 1.0, 1), 0.0);
        assert_eq!(survival(Vec3::ONE, 1.0, 1000), 1.0);
        assert_eq!(survival(Vec3::splat(f32::INFINITY), 1.0, 9), 1.0);
        assert_eq!(survival(Vec3::splat(f32::NAN), 1.0, 9), 1.0);
    }
}
