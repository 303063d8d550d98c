//! What comes back: that nothing shines by itself, and that glass loses nothing. White furnaces are hard cases.

use pathspace::shading::bsdf::albedo::SpecularAlbedo;
use pathspace::shading::bsdf::dielectric::Body;

use super::{direction, furnace, glass, rough_surfaces, viewers};

/// Two-sided false-alarm rate 1e-6 per value.
const Z: f64 = 4.9;

/// No surface returns more than it gets. Oracle: ≤ 1 within 4.9 s.e. of 2¹⁵ draws plus the table's error.
#[test]
fn nothing_shines_by_itself() {
    let tables = SpecularAlbedo::compute();
    for (k, (name, surface)) in rough_surfaces(&tables).into_iter().enumerate() {
        for wo in viewers(&surface) {
            let energy = furnace(&surface, wo, 1 << 15, k as u64);
            let bound = 1.0 + 2.5e-3 + Z * energy.standard_error();
            assert!(energy.mean <= bound, "{name} from {wo}: {}", energy.mean);
        }
    }
}

/// Smooth glass loses nothing: every draw carries exactly one unit. Oracle: 1, to 2⁻²⁰.
#[test]
fn smooth_glass_is_lossless() {
    for body in [Body::Solid, Body::Thin] {
        for eta in [1.0, 1.0001, 1.33, 1.5, 2.4] {
            let surface = glass(body, eta, 0.0);
            for wo in viewers(&surface) {
                let energy = furnace(&surface, wo, 1000, 5);
                assert_eq!(energy.n, 1000);
                assert!((energy.mean - 1.0).abs() < 0.5_f64.powi(20) && energy.variance() < 1e-12, "{wo}: {energy:?}");
            }
        }
    }
}

/// Rough glass keeps what single scattering keeps: as roughness falls, energy tends to 1. Oracle: 1 − E at alpha 0.01
/// is below 3e-3 for cosines of 0.5 and more on both sides.
#[test]
fn rough_glass_tends_to_smooth_glass() {
    for eta in [1.33, 1.5, 2.4] {
        let surface = glass(Body::Solid, eta, 0.01);
        for mu in [1.0, 0.5, -0.5, -1.0] {
            let energy = furnace(&surface, direction(mu, 0.1), 1 << 14, 6);
            assert!((1.0 - energy.mean).abs() < 3e-3, "eta {eta} mu {mu}: {}", energy.mean);
        }
    }
}
