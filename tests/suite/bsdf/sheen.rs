//! Sheen over every kind of surface: its lobe by the extension's text, χ² of its sampling, energy, reciprocity, and
//! sheen of no colour.

use glam::Vec3;
use pathspace::shading::bsdf::albedo::SpecularAlbedo;
use pathspace::shading::bsdf::clearcoat::Clearcoat;
use pathspace::shading::bsdf::lambert::Lambert;
use pathspace::shading::bsdf::model::Bsdf;
use pathspace::shading::bsdf::sheen::Sheen;
use pathspace::shading::bsdf::sheen_albedo::SheenAlbedo;
use pathspace::shading::surface::Surface;
use pathspace_stat::{Moments, Pcg32, SphereBins};

use super::chi2::check;
use super::clearcoat::bases;
use super::{direction, viewers};

/// Two-sided false-alarm rate 1e-6 per value.
const Z: f64 = 4.9;

const BLUE: Vec3 = Vec3::new(0.3, 0.5, 0.9);

fn furnace(sheen: &Sheen, wo: Vec3, seed: u64) -> Moments {
    let mut rng = Pcg32::new(seed, 9);
    let mut energy = Moments::default();
    for _ in 0..1 << 14 {
        let sample = sheen.sample(wo, rng.array());
        energy.push(sample.map_or(0.0, |s| f64::from(s.weight.max_element() * s.eta * s.eta)));
    }
    energy
}

/// D·V of KHR_materials_sheen in f64, as its text has it.
fn lobe(wo: Vec3, wi: Vec3, roughness: f64) -> f64 {
    let alpha = roughness * roughness;
    let h = (wo + wi).as_dvec3().normalize();
    let inverse = 1.0 / alpha;
    let d = (2.0 + inverse) * (1.0 - h.z * h.z).powf(0.5 * inverse) / (2.0 * std::f64::consts::PI);
    let l = |x: f64| {
        let t = (1.0 - alpha) * (1.0 - alpha);
        let mix = |a: f64, b: f64| b + (a - b) * t;
        let (a, b, c) = (mix(25.3245, 21.5473), mix(3.32435, 3.82987), mix(0.16801, 0.19823));
        let (d, e) = (mix(-1.27393, -1.97760), mix(-4.85967, -4.32054));
        a / (1.0 + b * x.powf(c)) + d * x + e
    };
    let lambda = |cos: f64| if cos < 0.5 { l(cos).exp() } else { (2.0 * l(0.5) - l(1.0 - cos)).exp() };
    let (o, i) = (f64::from(wo.z), f64::from(wi.z));
    d / ((1.0 + lambda(o) + lambda(i)) * (4.0 * o * i))
}

/// Over black, in the range where the lobe returns no more than it gets; to 1e-4 of the value.
#[test]
fn lobe_is_that_of_the_text() {
    let table = SheenAlbedo::compute();
    let mut rng = Pcg32::new(5, 1);
    for roughness in [0.3, 0.5, 0.8, 1.0] {
        let sheen = Sheen::over(Surface::Black, BLUE, roughness, Some(&table));
        for _ in 0..200 {
            let [a, b, c, d]: [f32; 4] = rng.array();
            let (wo, wi) = (direction(0.1 + 0.9 * a, 6.2 * b), direction(0.1 + 0.9 * c, 6.2 * d));
            let got = f64::from(sheen.eval(wo, wi).f_cos.y / wi.z);
            let expected = 0.5 * lobe(wo, wi, f64::from(roughness));
            assert!((got - expected).abs() <= 1e-4 * expected + 1e-9, "{roughness}: {wo} {wi}: {got} {expected}");
        }
    }
}

/// 2¹⁶ draws from every viewer, over surfaces without delta lobes. p > 1e-6 over the whole file.
#[test]
fn directions_follow_their_density() {
    let (tables, table) = (SpecularAlbedo::compute(), SheenAlbedo::compute());
    let bins = SphereBins::sphere();
    for (k, (name, base)) in bases(&tables).into_iter().enumerate() {
        if ["mirror", "smooth glass"].contains(&name) {
            continue;
        }
        let sheen = Sheen::over(base, BLUE, 0.5, Some(&table));
        for (j, wo) in viewers(&base).into_iter().step_by(2).enumerate() {
            let mut rng = Pcg32::new(4000 + k as u64, j as u64);
            let draw = || sheen.sample(wo, rng.array()).map(|s| s.wi);
            check(&format!("sheen over {name} from {wo}"), &bins, 1 << 16, |wi| sheen.eval(wo, wi).pdf_sa, draw);
        }
    }
}

/// No gain anywhere, grazing and smooth fibres included (to the table's error, 1e-2), over every surface and under a
/// clearcoat; over a white diffuse surface at least 0.85 of the light comes back.
#[test]
fn fibres_gain_nothing() {
    let (tables, table) = (SpecularAlbedo::compute(), SheenAlbedo::compute());
    for (k, (name, base)) in bases(&tables).into_iter().enumerate() {
        for roughness in [0.05, 0.2, 0.5, 1.0] {
            let sheen = Sheen::over(base, Vec3::ONE, roughness, Some(&table));
            for wo in viewers(&base) {
                let energy = furnace(&sheen, wo, k as u64);
                let bound = 1.01 + Z * energy.standard_error();
                assert!(energy.mean <= bound, "{roughness} over {name} from {wo}: {}", energy.mean);
            }
        }
    }
    let white = Surface::Lambert(Lambert { albedo: Vec3::ONE });
    for roughness in [0.3, 0.6, 1.0] {
        let sheen = Sheen::over(white, Vec3::ONE, roughness, Some(&table));
        for mu in [1.0, 0.7, 0.3, 0.1] {
            let back = furnace(&sheen, direction(mu, 0.4), 6);
            assert!(back.mean > 0.85 - Z * back.standard_error(), "{roughness} {mu}: {}", back.mean);
        }
        let coat = Clearcoat::over(sheen, 1.0, 0.2, &tables);
        let mut rng = Pcg32::new(8, 8);
        let mut energy = Moments::default();
        for _ in 0..1 << 14 {
            let wo = direction(0.3, 0.0);
            energy.push(coat.sampled(wo, rng.array()).map_or(0.0, |s| f64::from(s.weight.max_element())));
        }
        assert!(energy.mean <= 1.01 + Z * energy.standard_error(), "under a coat: {}", energy.mean);
    }
}

/// f(wo, wi) = f(wi, wo) over opaque surfaces, to 1e-4 of the value; smooth fibres at grazing angles included.
#[test]
fn fibres_are_reciprocal() {
    let (tables, table) = (SpecularAlbedo::compute(), SheenAlbedo::compute());
    let mut rng = Pcg32::new(77, 2);
    for (name, base) in bases(&tables).into_iter().filter(|(_, base)| !base.is_transmissive()) {
        for roughness in [0.08, 0.6] {
            let sheen = Sheen::over(base, BLUE, roughness, Some(&table));
            for _ in 0..300 {
                let [a, b, c, d]: [f32; 4] = rng.array();
                let (wo, wi) = (direction(0.01 + 0.99 * a * a, 6.2 * b), direction(0.01 + 0.99 * c * c, 6.2 * d));
                let there = sheen.eval(wo, wi).f_cos / wi.z;
                let back = sheen.eval(wi, wo).f_cos / wo.z;
                assert!(
                    (there - back).abs().max_element() <= 1e-4 * there.max_element() + 1e-30,
                    "{name}: {there} {back}"
                );
            }
        }
    }
}

/// Sheen of no colour is the surface below, to the bit.
#[test]
fn no_sheen_is_the_surface_below() {
    let (tables, table) = (SpecularAlbedo::compute(), SheenAlbedo::compute());
    let mut rng = Pcg32::new(78, 1);
    for (name, base) in bases(&tables) {
        let sheen = Sheen::over(base, Vec3::ZERO, 0.5, Some(&table));
        for wo in viewers(&base) {
            let u: [f32; 3] = rng.array();
            assert_eq!(sheen.sample(wo, u), base.sample(wo, u), "{name}");
            let wi = direction(1.0 - 2.0 * u[0], 6.0 * u[1]);
            assert_eq!(sheen.eval(wo, wi), base.eval(wo, wi), "{name}");
        }
    }
}
