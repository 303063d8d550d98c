//! Identities that hold pair by pair: weight = f·cos/pdf, finite values at the corners of the domain.

use glam::Vec3;
use pathspace::shading::bsdf::albedo::SpecularAlbedo;
use pathspace::shading::bsdf::dielectric::{Body, Dielectric};
use pathspace::shading::bsdf::fresnel::MAX_INDEX;
use pathspace::shading::bsdf::lambert::Lambert;
use pathspace::shading::bsdf::model::BsdfEval;
use pathspace::shading::surface::Surface;
use pathspace_stat::Pcg32;

use super::{direction, glossy, rough_surfaces, viewers};

/// What `sample` returns is what `eval` says of that direction. Oracle: each other; 2e-3 relative: the half vector is
/// rebuilt from two f32 directions, which at alpha 0.05 shifts slopes by 1e-5 of it, and at grazing a hundred times
/// that.
#[test]
fn sample_agrees_with_eval() {
    let tables = SpecularAlbedo::compute();
    for (k, (name, surface)) in rough_surfaces(&tables).into_iter().enumerate() {
        for wo in viewers(&surface) {
            let mut rng = Pcg32::new(k as u64, 10);
            for _ in 0..2000 {
                let Some(s) = surface.sample(wo, rng.array()) else { continue };
                if s.pdf_sa.is_infinite() {
                    continue;
                }
                let e = surface.eval(wo, s.wi);
                assert!((e.pdf_sa / s.pdf_sa - 1.0).abs() < 2e-3, "{name} {wo} → {}: {e:?} {s:?}", s.wi);
                let weight = e.f_cos / e.pdf_sa;
                assert!(
                    (weight - s.weight).abs().max_element() < 2e-3 * s.weight.max_element().max(1e-3),
                    "{name} {wo}: {e:?} {s:?}"
                );
            }
        }
    }
}

/// The same for narrow lobes, down to the mirror limit. Oracle: each other, within 2⁻²¹/alpha relative: the half
/// vector's rounding in units of the lobe's width.
#[test]
fn narrow_lobes_agree_too() {
    let tables = SpecularAlbedo::empty();
    for alpha in [0.02, 0.005, 1e-3, 1e-4_f32] {
        let metal = glossy(&tables, Vec3::ONE, 1.0, alpha, 1.0);
        assert!(!metal.is_delta());
        let bound = 0.5_f32.powi(21) / alpha;
        for mu in [1.0, 0.9, 0.5, 0.2] {
            let wo = direction(mu, 0.4);
            let mut rng = Pcg32::new(3, 13);
            for _ in 0..5000 {
                let Some(s) = metal.sample(wo, rng.array()) else { continue };
                let e = metal.eval(wo, s.wi);
                let error = (e.pdf_sa / s.pdf_sa - 1.0).abs();
                assert!(error <= bound, "alpha {alpha} {wo} → {}: {e:?} {s:?}", s.wi);
            }
        }
    }
}

/// Anything in range gives finite, non-negative numbers. Oracle: that, over a grid of extremes.
#[test]
fn extremes_stay_finite() {
    let tables = SpecularAlbedo::compute();
    let colors = [Vec3::ZERO, Vec3::ONE, Vec3::new(1.0, 0.0, 1e-30)];
    let alphas = [0.0, 1e-6, 1e-4, 1e-3, 0.1, 1.0];
    let mut surfaces = Vec::new();
    for alpha in alphas {
        for color in colors {
            surfaces.push(Surface::Lambert(Lambert { albedo: color }));
            for (metallic, specular) in [(0.0, 0.0), (0.0, 1.0), (0.5, 1.0), (1.0, 0.0), (1e-30, 1e-30)] {
                surfaces.push(glossy(&tables, color, metallic, alpha, specular));
            }
            for eta in [1.0, 1.0 + 1.0 / 8_388_608.0, 1.0001, 1.5, MAX_INDEX] {
                for body in [Body::Solid, Body::Thin] {
                    for (specular, specular_color) in [(0.0, Vec3::ONE), (1.0, Vec3::ZERO), (1.0, Vec3::splat(1e30))] {
                        let tint = color;
                        surfaces.push(Surface::Dielectric(Dielectric {
                            body,
                            eta,
                            alpha,
                            tint,
                            specular,
                            specular_color,
                        }));
                    }
                }
            }
        }
    }
    let mus = [1.0, 1.0 - 0.5_f32.powi(24), 0.5, 1e-3, 1e-6, 1e-30, 1e-45, 0.0];
    let directions: Vec<Vec3> = mus
        .into_iter()
        .flat_map(|mu| [(mu, 0.0), (mu, 3.0), (-mu, 0.0), (-mu, 1.0)])
        .map(|(mu, phi)| direction(mu, phi))
        .collect();
    let numbers = [0.0, 0.5_f32.powi(32), 0.5, 1.0 - 0.5_f32.powi(24)];
    for surface in &surfaces {
        for &wo in &directions {
            for &wi in &directions {
                let e = surface.eval(wo, wi);
                let good =
                    e.f_cos.is_finite() && e.f_cos.min_element() >= 0.0 && e.pdf_sa.is_finite() && e.pdf_sa >= 0.0;
                assert!(good, "{surface:?} {wo} {wi}: {e:?}");
                assert!(surface.is_transmissive() || wo.z > 0.0 || e == BsdfEval::ZERO, "{surface:?} {wo} {wi}: {e:?}");
                assert!(!surface.is_delta() || e == BsdfEval::ZERO, "{surface:?}: a delta surface has a value {e:?}");
            }
            for u in numbers.into_iter().flat_map(|a| numbers.map(|b| [a, b])) {
                for lobe in numbers {
                    let Some(s) = surface.sample(wo, [lobe, u[0], u[1]]) else { continue };
                    let good = s.weight.is_finite() && s.weight.min_element() >= 0.0 && s.pdf_sa > 0.0;
                    let unit = s.wi.is_finite() && (s.wi.length() - 1.0).abs() < 1e-5 && s.wi.z != 0.0;
                    assert!(good && unit && s.eta > 0.0, "{surface:?} {wo} {u:?}: {s:?}");
                    assert!(surface.is_transmissive() || wo.z > 0.0, "{surface:?} {wo}: sampled from below");
                }
            }
        }
        assert!(viewers(surface).len() >= 5);
    }
}
