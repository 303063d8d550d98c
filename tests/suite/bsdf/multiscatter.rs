//! The lobe of light that facets scatter more than once (`--multiscatter on`): furnaces, reciprocity, χ², eval against
//! sample, and what it leaves alone.

use std::sync::LazyLock;

use glam::Vec3;
use pathspace::render::{Renderer, Strategy};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Environment, Material};
use pathspace::shading::bsdf::albedo::SpecularAlbedo;
use pathspace::shading::bsdf::clearcoat::Clearcoat;
use pathspace::shading::bsdf::compensated::Compensated;
use pathspace::shading::bsdf::dielectric::Body;
use pathspace::shading::bsdf::glass_albedo::GlassAlbedo;
use pathspace::shading::bsdf::model::{Bsdf, Tables};
use pathspace::shading::surface::Surface;
use pathspace_stat::{Moments, Pcg32, SphereBins};

use super::chi2::check;
use crate::common::{options, probe};

use super::{direction, furnace, glass, glossy, rough_surfaces, viewers};

/// Two-sided false-alarm rate 1e-6 per value.
const Z: f64 = 4.9;

const INDICES: [f32; 3] = [1.33, 1.5, 2.4];

/// Tables that all tests share.
static ALL: LazyLock<All> = LazyLock::new(|| All {
    albedo: SpecularAlbedo::compute(),
    glass: GlassAlbedo::new(&[1.1, INDICES[0], INDICES[1], INDICES[2]]),
});

struct All {
    albedo: SpecularAlbedo,
    glass: GlassAlbedo,
}

impl All {
    fn tables(&self) -> Tables<'_> {
        Tables::new(&self.albedo, true).with_glass(&self.glass)
    }

    /// `surface` with what it loses, under a clearcoat of that weight.
    fn whole<'t>(&'t self, surface: Surface<'t>, coat: f32) -> Compensated<'t> {
        Compensated::new(Clearcoat::over(surface, coat, 0.1, &self.albedo), &self.tables())
    }
}

/// Energy of one unit of light from `wo`: weight × η², largest channel.
fn whole_furnace(surface: &Compensated, wo: Vec3, n: u32, seed: u64) -> Moments {
    let mut rng = Pcg32::new(seed, 3);
    let mut energy = Moments::default();
    for _ in 0..n {
        let sample = surface.sampled(wo, rng.array());
        energy.push(sample.map_or(0.0, |s| f64::from(s.weight.max_element() * s.eta * s.eta)));
    }
    energy
}

/// What is white loses less than 1 % at every roughness and angle, from every side, where single scattering loses up to
/// two thirds; and gains no more than the tables' error. Oracle: 1.
#[test]
fn white_surfaces_return_all_light() {
    let all = &*ALL;
    let mut surfaces: Vec<(String, Surface)> = Vec::new();
    for alpha in [1e-3, 0.01, 0.06, 0.2, 0.5, 1.0] {
        surfaces.push((format!("metal {alpha}"), glossy(&all.albedo, Vec3::ONE, 1.0, alpha, 1.0)));
        surfaces.push((format!("thin {alpha}"), glass(Body::Thin, 1.5, alpha)));
        for eta in INDICES {
            surfaces.push((format!("solid {eta} {alpha}"), glass(Body::Solid, eta, alpha)));
        }
        surfaces.push((format!("bubble {alpha}"), glass(Body::Solid, 1.0 / 1.5, alpha)));
    }
    let mut worst = 1.0f64;
    for (k, (name, surface)) in surfaces.into_iter().enumerate() {
        for mu in [1.0, 0.7, 0.4, 0.2, 0.1, 0.03] {
            let sides: &[f32] = if surface.is_transmissive() { &[1.0, -1.0] } else { &[1.0] };
            for side in sides {
                let wo = direction(mu * side, 0.4);
                let single = furnace(&surface, wo, 1 << 12, k as u64);
                let energy = whole_furnace(&all.whole(surface, 0.0), wo, 1 << 13, k as u64);
                worst = worst.min(single.mean);
                println!(
                    "{name} {mu:.2} {side}: {:.4}, now {:.4} ± {:.4}",
                    single.mean,
                    energy.mean,
                    energy.standard_error()
                );
                let off = (energy.mean - 1.0).abs();
                assert!(
                    off < 0.01 + Z * energy.standard_error(),
                    "{name} from {wo}: {}, single {}",
                    energy.mean,
                    single.mean
                );
                assert!(energy.standard_error() < 0.012, "{name} from {wo}: {energy:?}");
            }
        }
    }
    assert!(worst < 0.4, "{worst}");
}

/// Oracle: the mean of the lobe's own weights over 2¹⁴ even numbers, to 4e-3.
#[test]
fn tables_of_glass_are_its_albedo() {
    let eta = 1.5;
    let [outside, inside] = ALL.glass.at(eta).expect("a table");
    for alpha in [0.05f32, 0.35, 1.0] {
        let surface = glass(Body::Solid, eta, alpha);
        for mu in [0.97f32, 0.6, 0.2] {
            for (side, table) in [(1.0, outside), (-1.0, inside)] {
                let n = 1 << 14;
                let energy = |i: u32| {
                    let at = |step: f64| (f64::from(i) * step).fract() as f32;
                    // Steps of the plastic number's generalisation to three dimensions.
                    let u = [at(0.819_172_513_4), at(0.671_043_606_7), at(0.549_700_477_9)];
                    surface.sample(direction(side * mu, 0.0), u).map_or(0.0, |s| f64::from(s.weight.x * s.eta * s.eta))
                };
                let exact = (0..n).map(energy).sum::<f64>() / f64::from(n);
                let got = 1.0 - f64::from(table.complement(alpha, 1.0, 0.0).at(mu));
                assert!((got - exact).abs() < 4e-3, "alpha {alpha} mu {mu} side {side}: {got}, {exact}");
            }
        }
    }
}

/// Nothing shines by itself: coloured surfaces, under clearcoats too.
#[test]
fn nothing_is_gained() {
    let all = &*ALL;
    for (k, (name, surface)) in rough_surfaces(&all.albedo).into_iter().enumerate() {
        for coat in [0.0, 0.7] {
            let whole = all.whole(surface, coat);
            for wo in viewers(&surface) {
                let energy = whole_furnace(&whole, wo, 1 << 13, k as u64);
                let bound = 1.0 + 4e-3 + Z * energy.standard_error();
                assert!(energy.mean <= bound, "{name} under {coat} from {wo}: {}", energy.mean);
            }
        }
    }
}

/// Light goes there as it comes back: f(wo, wi)/n(wo)² = f(wi, wo)/n(wi)², to 1e-4 of the lobe.
#[test]
fn the_lobe_is_reciprocal() {
    let all = &*ALL;
    let grey = Vec3::new(0.8, 0.5, 0.2);
    let mut rng = Pcg32::new(81, 1);
    for (name, eta, surface) in [
        ("metal", 1.0, glossy(&all.albedo, grey, 1.0, 0.5, 1.0)),
        ("half metal", 1.0, glossy(&all.albedo, grey, 0.5, 0.8, 1.0)),
        ("thin", 1.0, glass(Body::Thin, 1.5, 0.6)),
        ("solid", 1.5, glass(Body::Solid, 1.5, 0.6)),
        ("dense", 2.4, glass(Body::Solid, 2.4, 0.3)),
        ("bubble", 1.0 / 1.5, glass(Body::Solid, 1.0 / 1.5, 0.6)),
    ] {
        for coat in [0.0, 0.7] {
            let (whole, layered) = (all.whole(surface, coat), Clearcoat::over(surface, coat, 0.1, &all.albedo));
            // The lobe alone: what single scattering adds has its own test.
            let lobe = |wo: Vec3, wi: Vec3| (whole.value(wo, wi).f_cos - layered.value(wo, wi).f_cos) / wi.z.abs();
            let n2 = |w: Vec3| if w.z < 0.0 { eta * eta } else { 1.0 };
            for _ in 0..300 {
                let [a, b, c, d]: [f32; 4] = rng.array();
                let sides: [f32; 2] = rng.array();
                let side = |u: f32| if surface.is_transmissive() && u < 0.5 { -1.0 } else { 1.0 };
                let wo = direction((0.02 + 0.97 * a) * side(sides[0]), 6.2 * b);
                let wi = direction((0.02 + 0.97 * c) * side(sides[1]), 6.2 * d);
                let (there, back) = (lobe(wo, wi) / n2(wo), lobe(wi, wo) / n2(wi));
                let size = (whole.value(wo, wi).f_cos / wi.z.abs()).max_element() / n2(wo);
                let size = size.max((whole.value(wi, wo).f_cos / wo.z.abs()).max_element() / n2(wi));
                let off = (there - back).abs().max_element();
                assert!(off <= 1e-4 * there.max_element() + 1e-5 * size, "{name} {wo} {wi}: {there} {back}");
            }
        }
    }
}

/// χ² over the sphere, 2¹⁶ draws, and the weight of each draw is value over density.
#[test]
fn directions_follow_their_density() {
    let all = &*ALL;
    let bins = SphereBins::sphere();
    let grey = Vec3::new(0.8, 0.5, 0.2);
    for (k, (name, surface)) in [
        ("metal", glossy(&all.albedo, grey, 1.0, 0.5, 1.0)),
        ("half metal", glossy(&all.albedo, grey, 0.5, 1.0, 1.0)),
        ("thin", glass(Body::Thin, 1.5, 0.6)),
        ("solid", glass(Body::Solid, 1.5, 0.5)),
    ]
    .into_iter()
    .enumerate()
    {
        let whole = all.whole(surface, if name == "metal" { 0.5 } else { 0.0 });
        let mus: &[f32] = if surface.is_transmissive() { &[0.9, 0.2, -0.9, -0.3] } else { &[0.9, 0.2] };
        for (j, mu) in mus.iter().enumerate() {
            let wo = direction(*mu, 0.4);
            let mut rng = Pcg32::new(4000 + k as u64, j as u64);
            let pdf = |wi: Vec3| whole.value(wo, wi).pdf_sa;
            check(&format!("{name} from {wo}"), &bins, 1 << 16, pdf, || whole.sampled(wo, rng.array()).map(|s| s.wi));
            for _ in 0..500 {
                let Some(sample) = whole.sampled(wo, rng.array()) else { continue };
                let value = whole.value(wo, sample.wi);
                assert!((sample.pdf_sa / value.pdf_sa - 1.0).abs() < 2e-3, "{name}: {sample:?} {value:?}");
                let off = (sample.weight * sample.pdf_sa - value.f_cos).abs().max_element();
                assert!(off <= 2e-3 * value.f_cos.max_element(), "{name}: {sample:?} {value:?}");
            }
        }
    }
}

/// What loses nothing is left as it is, to the bit.
#[test]
fn smooth_and_diffuse_surfaces_are_left_alone() {
    let all = &*ALL;
    let mut rng = Pcg32::new(82, 1);
    let grey = Vec3::new(0.8, 0.5, 0.2);
    for surface in [
        Surface::Black,
        glossy(&all.albedo, grey, 0.0, 0.4, 1.0),
        glossy(&all.albedo, grey, 1.0, 0.0, 1.0),
        glass(Body::Solid, 1.5, 0.0),
        glass(Body::Thin, 1.5, 0.0),
    ] {
        let (whole, layered) = (all.whole(surface, 0.3), Clearcoat::over(surface, 0.3, 0.1, &all.albedo));
        for wo in viewers(&surface) {
            for _ in 0..50 {
                let u: [f32; 3] = rng.array();
                assert_eq!(whole.sampled(wo, u), layered.sampled(wo, u));
                let wi = direction(1.0 - 2.0 * u[0], 6.0 * u[1]);
                assert_eq!(whole.value(wo, wi), layered.value(wo, wi));
            }
        }
    }
}

/// A sheet of white metal and a block of clear glass, both rough, in a white furnace: by all strategies they are as
/// bright as it with the option, and darker without. What loses nothing asks for nothing.
#[test]
fn renders_lose_nothing() {
    let block = |material: Material| {
        let mut b = SceneBuilder::new();
        let material = b.material(material);
        b.cuboid(Vec3::new(-1.0, -0.5, -1.0), Vec3::new(1.0, 0.5, 1.0), false, material);
        b.environment(Environment::constant(Vec3::ONE));
        b.build()
    };
    let metal = Material { roughness: 0.9, ..Material::default() };
    let glass = Material { metallic: 0.0, roughness: 0.7, transmission: 1.0, thickness: 1.0, ..Material::default() };
    let thin = Material { thickness: 0.0, ..glass.clone() };
    let dir = Vec3::new(0.8, -0.6, 0.1);
    for (name, material, lost) in [("metal", metal, 0.12), ("glass", glass, 0.05), ("thin", thin, 0.05)] {
        let scene = block(material);
        // Through glass, light samples alone are too noisy to tell.
        let count = if name == "metal" { 3 } else { 2 };
        for strategy in [Strategy::MIS, Strategy::BSDF, Strategy::LIGHT].into_iter().take(count) {
            let options = options(1, 1, 16).strategy(strategy);
            let n = if strategy == Strategy::LIGHT { 1 << 11 } else { 1 << 9 };
            let seen = |options| probe(&scene, Vec3::new(0.1, 0.5, 0.0) - 3.0 * dir, dir, n, options);
            seen(options.clone().multiscatter(true)).expect(&format!("{name} {}", strategy.name()), 1.0, 5e-3, 0.08);
            let single = seen(options).mean[0];
            assert!(single < 1.0 - lost, "{name} {}: {single}", strategy.name());
        }
    }
    let mut smooth = block(Material { roughness: 0.0, ..Material::default() });
    smooth.cameras.push(crate::common::single_ray(Vec3::Y, Vec3::NEG_Y));
    let renderer = Renderer::new(&smooth, options(1, 1, 1).multiscatter(true)).expect("a plan");
    assert!(!renderer.plan().features.multiscatter, "{:?}", renderer.plan().effects);
}
