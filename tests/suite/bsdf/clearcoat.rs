//! A clearcoat over every kind of surface: χ² of its sampling, eval against sample, energy, reciprocity, and the
//! layer of weight 0.

use glam::Vec3;
use pathspace::shading::bsdf::albedo::SpecularAlbedo;
use pathspace::shading::bsdf::clearcoat::Clearcoat;
use pathspace::shading::bsdf::dielectric::Body;
use pathspace::shading::bsdf::lambert::Lambert;
use pathspace::shading::bsdf::model::Bsdf;
use pathspace::shading::surface::Surface;
use pathspace_stat::{Moments, Pcg32, SphereBins};

use super::chi2::check;
use super::{direction, glass, glossy, viewers};

/// Two-sided false-alarm rate 1e-6 per value.
const Z: f64 = 4.9;

pub fn bases(tables: &SpecularAlbedo) -> Vec<(&'static str, Surface<'_>)> {
    let grey = Vec3::new(0.8, 0.5, 0.2);
    vec![
        ("black", Surface::Black),
        ("lambert", Surface::Lambert(Lambert { albedo: grey })),
        ("rough metal", glossy(tables, grey, 1.0, 0.3, 1.0)),
        ("mirror", glossy(tables, Vec3::ONE, 1.0, 0.0, 1.0)),
        ("coated", glossy(tables, grey, 0.0, 0.2, 1.0)),
        ("rough glass", glass(Body::Solid, 1.5, 0.3)),
        ("smooth glass", glass(Body::Solid, 1.5, 0.0)),
        ("thin", glass(Body::Thin, 1.5, 0.2)),
    ]
}

/// 2¹⁷ draws from every viewer; delta lobes count as rejected. p > 1e-6 over the whole file.
#[test]
fn directions_follow_their_density() {
    let tables = SpecularAlbedo::compute();
    let bins = SphereBins::sphere();
    for (k, (name, base)) in bases(&tables).into_iter().enumerate() {
        for alpha in [0.0, 0.1, 0.6] {
            let coat = Clearcoat::over(base, 0.7, alpha, &tables);
            for (j, wo) in viewers(&base).into_iter().enumerate() {
                let has_density = (0..200).any(|i| {
                    let u = [(f64::from(i) * 0.618).fract() as f32, (f64::from(i) * 0.414).fract() as f32, 0.3];
                    coat.sampled(wo, u).is_some_and(|s| s.pdf_sa.is_finite())
                });
                if !has_density {
                    continue;
                }
                let mut rng = Pcg32::new(1000 + k as u64, j as u64);
                // What goes to delta lobes is missing from the density as well as from the draws.
                let mut dense = 0u32;
                let n = 1 << 17;
                for _ in 0..n {
                    let drawn = coat.sampled(wo, rng.array());
                    dense += u32::from(drawn.is_none_or(|s| s.pdf_sa.is_finite()));
                }
                if dense == n {
                    let mut rng = Pcg32::new(2000 + k as u64, j as u64);
                    let pdf = |wi: Vec3| coat.value(wo, wi).pdf_sa;
                    let draw = || coat.sampled(wo, rng.array()).filter(|s| s.pdf_sa.is_finite()).map(|s| s.wi);
                    check(&format!("{name} under {alpha} from {wo}"), &bins, u64::from(n), pdf, draw);
                }
            }
        }
    }
}

/// Energy of one unit of light from `wo`: weight × η², largest channel.
fn furnace(coat: &Clearcoat, wo: Vec3, seed: u64) -> Moments {
    let mut rng = Pcg32::new(seed, 7);
    let mut energy = Moments::default();
    for _ in 0..1 << 15 {
        let sample = coat.sampled(wo, rng.array());
        energy.push(sample.map_or(0.0, |s| f64::from(s.weight.max_element() * s.eta * s.eta)));
    }
    energy
}

/// Oracles: no gain anywhere; over a perfect mirror everything comes back (to the table's error, 2.5e-3 for cosines
/// above 0.01); over a white diffuse surface at least 0.93 of it, for a smooth layer.
#[test]
fn a_layer_gains_nothing_and_loses_little() {
    let tables = SpecularAlbedo::compute();
    for (k, (name, base)) in bases(&tables).into_iter().enumerate() {
        for alpha in [0.0, 0.1, 0.6] {
            for weight in [0.3, 1.0] {
                let coat = Clearcoat::over(base, weight, alpha, &tables);
                for wo in viewers(&base) {
                    let energy = furnace(&coat, wo, k as u64);
                    let bound = 1.0 + 2.5e-3 + Z * energy.standard_error();
                    assert!(energy.mean <= bound, "{weight} of {alpha} over {name} from {wo}: {}", energy.mean);
                }
            }
        }
    }
    let mirror = Clearcoat::over(glossy(&tables, Vec3::ONE, 1.0, 0.0, 1.0), 1.0, 0.0, &tables);
    let white = Clearcoat::over(Surface::Lambert(Lambert { albedo: Vec3::ONE }), 1.0, 0.0, &tables);
    for mu in [1.0, 0.7, 0.3, 0.1] {
        let back = furnace(&mirror, direction(mu, 0.4), 5);
        assert!((back.mean - 1.0).abs() < 2.5e-3 + Z * back.standard_error(), "mirror {mu}: {}", back.mean);
        let back = furnace(&white, direction(mu, 0.4), 6);
        assert!(back.mean > 0.93 - Z * back.standard_error(), "white {mu}: {}", back.mean);
    }
}

/// f(wo, wi) = f(wi, wo) over opaque surfaces, to 1e-4 of the value. Deterministic.
#[test]
fn a_layer_over_an_opaque_surface_is_reciprocal() {
    let tables = SpecularAlbedo::compute();
    let mut rng = Pcg32::new(77, 1);
    for (name, base) in bases(&tables).into_iter().filter(|(_, base)| !base.is_transmissive()) {
        let coat = Clearcoat::over(base, 0.8, 0.3, &tables);
        for _ in 0..500 {
            let [a, b, c, d]: [f32; 4] = rng.array();
            let (wo, wi) = (direction(0.02 + 0.98 * a, 6.2 * b), direction(0.02 + 0.98 * c, 6.2 * d));
            let there = coat.value(wo, wi).f_cos / wi.z;
            let back = coat.value(wi, wo).f_cos / wo.z;
            assert!((there - back).abs().max_element() <= 1e-4 * there.max_element(), "{name}: {there} {back}");
        }
    }
}

/// A layer of weight 0 is the surface below, to the bit of value and density.
#[test]
fn no_layer_is_the_surface_below() {
    let tables = SpecularAlbedo::compute();
    let mut rng = Pcg32::new(78, 1);
    for (name, base) in bases(&tables) {
        let coat = Clearcoat::over(base, 0.0, 0.3, &tables);
        for wo in viewers(&base) {
            for _ in 0..50 {
                let u: [f32; 3] = rng.array();
                let wi = direction(1.0 - 2.0 * u[0], 6.0 * u[1]);
                assert_eq!(
                    coat.value(wo, wi),
                    if base.is_transmissive() || (wo.z > 0.0 && wi.z > 0.0) {
                        base.eval(wo, wi)
                    } else {
                        pathspace::shading::bsdf::model::BsdfEval::ZERO
                    },
                    "{name}"
                );
            }
        }
    }
}

/// A layer whose normal is not that of the surface below: χ² of its sampling, no gain, and reciprocity.
#[test]
fn tilted_layers_are_sound() {
    let tables = SpecularAlbedo::compute();
    let bins = SphereBins::sphere();
    let opaque = || bases(&tables).into_iter().filter(|(_, base)| !base.is_transmissive());
    for (k, (name, base)) in opaque().enumerate() {
        let coat = Clearcoat::over(base, 0.7, 0.3, &tables).with_normal(direction(0.9, 1.0));
        for (j, wo) in [direction(0.95, 0.4), direction(0.4, 2.0)].into_iter().enumerate() {
            let energy = furnace(&coat, wo, k as u64);
            assert!(energy.mean <= 1.0 + 2.5e-3 + Z * energy.standard_error(), "{name} from {wo}: {}", energy.mean);
            if name == "mirror" {
                continue;
            }
            let mut rng = Pcg32::new(3000 + k as u64, j as u64);
            let draw = || coat.sampled(wo, rng.array()).map(|s| s.wi);
            check(
                &format!("{name} under a tilted layer from {wo}"),
                &bins,
                1 << 16,
                |wi| coat.value(wo, wi).pdf_sa,
                draw,
            );
        }
        let mut rng = Pcg32::new(79, k as u64);
        for _ in 0..200 {
            let [a, b, c, d]: [f32; 4] = rng.array();
            let (wo, wi) = (direction(0.02 + 0.98 * a, 6.2 * b), direction(0.02 + 0.98 * c, 6.2 * d));
            // The layer's lobe has the layer's cosine; the rest that of the surface below.
            let layer = |wo, wi| coat.value(wo, wi).f_cos - base.eval(wo, wi).f_cos * coat.left_of_both(wo, wi);
            let n = coat.normal();
            let (there, back) = (layer(wo, wi) * n.dot(wo), layer(wi, wo) * n.dot(wi));
            let bound = 1e-4 * (there.abs().max_element() + coat.value(wo, wi).f_cos.max_element());
            assert!((there - back).abs().max_element() <= bound, "{name}: {there} {back}");
        }
    }
}
