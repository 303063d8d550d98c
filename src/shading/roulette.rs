//! Russian roulette: ends paths that carry little, and scales up the survivors so that the expectation stays.
//!
//! The path survives when a uniform number is below the survival probability q, and its throughput is then divided by
//! q. q is twice the largest channel of the throughput: a path that carries at least a half is never ended, and a
//! survivor carries a half. q ≥ throughput in every channel keeps the variance finite for every albedo below 1 (it
//! needs q > ρ² a bounce in the brightest channel, and a rule on luminance breaks that in red). The factor 1/η² of
//! radiance that entered glass is taken out first: it comes back on the way out, and ending paths on it would make
//! glass noisy (as PBRT and Mitsuba do). Measured, 1/(relMSE·rays a path) at 64 samples per pixel against q =
//! throughput from the fourth vertex on, which is the common rule: cornell-box 1.27, glass-caustics 1.46, interior
//! 1.05, many-lights 1.06; four times the throughput gives 1.33, 1.44, 1.00, 1.02; its square root 0.99, 1.08, 1.03,
//! 1.03. Limit: with an albedo of 1 q stays 1; the depth limit of the render ends such paths, and counts them.

use glam::Vec3;

/// Throughput below which a path may end, and what its survivors carry.
const SURVIVOR: f32 = 0.5;

/// Values of a uniform f32 in [0,1) are multiples of 2^-24.
const LATTICE: f32 = 16_777_216.0;

/// Probability that a path of throughput `beta` survives path vertex `vertex`; `eta_scale` is the product of η² over
/// its refractions. 0 only where `beta` is 0 (such a path ends at any vertex), else in [2^-24, 1]; 1 before
/// `first_vertex`, and for a throughput that is NaN, which is to reach the counter.
#[inline(always)]
pub fn survival(beta: Vec3, eta_scale: f32, vertex: u32, first_vertex: u32) -> f32 {
    if vertex < first_vertex && beta.max_element() > 0.0 {
        return 1.0;
    }
    survival_from(beta, eta_scale)
}

/// [`survival`] from `first_vertex` on; one expression, for loops over lanes.
#[inline(always)]
pub fn survival_from(beta: Vec3, eta_scale: f32) -> f32 {
    let largest = beta.x.max(beta.y).max(beta.z);
    let q = on_lattice((largest * eta_scale / SURVIVOR).min(1.0));
    if largest <= 0.0 { 0.0 } else { q }
}

/// `q` rounded up to a multiple of 2^-24, at least one: `u < q` then has exactly this probability, however small.
#[inline(always)]
pub fn on_lattice(q: f32) -> f32 {
    (q * LATTICE).ceil().max(1.0) / LATTICE
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::options::ROULETTE_START as START;

    /// SplitMix64 (Steele et al. 2014), as multiples of 2^-24 in [0,1).
    fn uniform(state: &mut u64) -> f32 {
        *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / LATTICE
    }

    /// Σₖ βₖ along one path of a closed furnace of radiance 1 and the given reflectance.
    fn furnace_path(rho: Vec3, state: &mut u64, rule: impl Fn(Vec3, u32) -> f32) -> Vec3 {
        let (mut beta, mut sum) = (Vec3::ONE, Vec3::ZERO);
        for vertex in 1..1_000_000 {
            sum += beta;
            beta *= rho;
            let q = rule(beta, vertex);
            if uniform(state) >= q {
                return sum;
            }
            beta /= q;
        }
        panic!("the path does not end");
    }

    /// Mean and variance of a channel over `paths` furnace paths.
    fn furnace(rho: Vec3, paths: u32, channel: usize, rule: impl Fn(Vec3, u32) -> f32) -> (f64, f64) {
        let mut state = 108 + u64::from(paths) + channel as u64;
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..paths {
            let value = f64::from(furnace_path(rho, &mut state, &rule)[channel]);
            sum += value;
            squares += value * value;
        }
        let mean = sum / f64::from(paths);
        // A channel without any variance comes out a rounding below 0.
        (mean, (squares / f64::from(paths) - mean * mean).max(0.0))
    }

    /// HARDCASES P09 (a) without the scene: with reflectance 0.999 paths are ended, after 1000 vertices in the mean and
    /// three more for those that are never ended early.
    #[test]
    fn p09_long_paths_end() {
        let (rho, paths) = (0.999, 1 << 13);
        let (mean, variance) = furnace(Vec3::splat(rho), paths, 0, |beta, vertex| survival(beta, 1.0, vertex, START));
        let error = 4.9 * (variance / f64::from(paths)).sqrt();
        assert!((mean - 1000.0).abs() < error + 1e-2, "{mean} ± {error}");
    }

    #[test]
    fn stays_within_its_bounds() {
        for exponent in -149..=20 {
            let beta = Vec3::new(0.1, 1.0, 0.3) * (exponent as f32).exp2();
            for eta_scale in [0.1, 1.0 / 2.25, 1.0, 2.25] {
                for vertex in 1..100 {
                    let q = survival(beta, eta_scale, vertex, 4);
                    assert!(q > 0.0 && q <= 1.0, "q = {q} at 2^{exponent}");
                    assert!(q >= (beta.max_element() * eta_scale).min(1.0), "a survivor would gain at 2^{exponent}");
                    assert!((beta * eta_scale / q).max_element() <= (beta * eta_scale).max_element().max(1.0));
                    assert!(vertex >= 4 || q == 1.0);
                    assert_eq!((q * LATTICE).fract(), 0.0);
                }
            }
        }
        assert_eq!(survival(Vec3::ZERO, 1.0, 1, START), 0.0);
        assert_eq!(survival(Vec3::ONE, 1.0, 1000, START), 1.0);
        assert_eq!(survival(Vec3::splat(f32::INFINITY), 1.0, 9, START), 1.0);
        assert_eq!(survival(Vec3::splat(f32::NAN), 1.0, 9, START), 1.0);
    }
}
