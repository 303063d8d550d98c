//! Counts of sampled directions against the integrated density, for every sampler. p > 1e-6 over the whole file.

use glam::Vec3;
use pathspace::math::warp;
use pathspace::shading::bsdf::albedo::SpecularAlbedo;
use pathspace_stat::{Pcg32, SphereBins, chi2_test, sidak_level};

use super::{rough_surfaces, viewers};

/// More tests than this file, clearcoat.rs, sheen.rs and body.rs make, so that their false-alarm rate stays below 1e-6.
const TESTS: usize = 1000;

pub fn check(name: &str, bins: &SphereBins, n: u64, pdf: impl Fn(Vec3) -> f32, draw: impl FnMut() -> Option<Vec3>) {
    let mut draw = draw;
    let expected = bins.expect(n, &|d| f64::from(pdf(Vec3::from_array(d.map(|x| x as f32)))));
    let observed = bins.observe(n, || draw().map(|w| w.to_array().map(f64::from)));
    let total: f64 = expected.iter().sum();
    assert!((total / n as f64 - 1.0).abs() < 1e-3, "{name}: density integrates to {}", total / n as f64);
    let verdict = chi2_test(&observed, &expected);
    let level = sidak_level(TESTS, 1e-6);
    assert!(verdict.p_value > level, "{name}: {verdict:?}");
}

/// Every surface from every viewer, over the whole sphere, 2¹⁸ draws; a delta lobe counts as rejected.
#[test]
fn every_surface() {
    let tables = SpecularAlbedo::compute();
    let bins = SphereBins::sphere();
    for (k, (name, surface)) in rough_surfaces(&tables).into_iter().enumerate() {
        for (j, wo) in viewers(&surface).into_iter().enumerate() {
            let mut rng = Pcg32::new(100 + k as u64, j as u64);
            check(
                &format!("{name} from {wo}"),
                &bins,
                1 << 18,
                |wi| surface.eval(wo, wi).pdf_sa,
                || surface.sample(wo, rng.array()).filter(|s| s.pdf_sa.is_finite()).map(|s| s.wi),
            );
        }
    }
}

/// The diffuse warp against z/π, 10⁶ draws.
#[test]
fn cosine_hemisphere() {
    let mut rng = Pcg32::new(200, 0);
    let pdf = |wi: Vec3| wi.z.max(0.0) * std::f32::consts::FRAC_1_PI;
    check("cosine", &SphereBins::hemisphere(), 1_000_000, pdf, || Some(warp::cosine_hemisphere(rng.array())));
}
