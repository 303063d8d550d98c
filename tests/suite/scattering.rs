//! Light that is scattered on its way: solids with KHR_materials_volume_scatter, and fog. Oracles: Beer and Lambert,
//! single scattering by hand, Chandrasekhar's H functions, a white furnace, delta tracking, one strategy against
//! another. Renders are held within 4.9 standard errors of their pixels (two-sided 10⁻⁶); seeds fixed.

use std::f64::consts::PI;

use glam::Vec3;
use pathspace::backend::BackendKind;
use pathspace::plan::options::Strategy;
use pathspace::render::{Fog, RenderOptions};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Environment, Material, PunctualKind, Scene};
use pathspace::shading::scattering::single_scattering;

use crate::common::{Estimate, options, render};

/// The albedo of many scatterings that belongs to this one of a single scattering.
fn multiple(single: f64) -> f32 {
    let (mut low, mut high) = (0.0f32, 1.0f32);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if f64::from(single_scattering(middle)) < single { low = middle } else { high = middle }
    }
    high
}

/// A solid of this index with σ_t per metre and these albedos.
pub fn murky(ior: f32, sigma_t: f32, albedo: [f64; 3], g: f32) -> Material {
    Material {
        metallic: 0.0,
        roughness: 0.0,
        transmission: 1.0,
        thickness: 1.0,
        ior,
        attenuation_distance_m: 1.0 / sigma_t,
        attenuation_color: Vec3::splat((-1.0f32).exp()),
        multiscatter_color: Vec3::from(albedo.map(multiple)),
        scatter_anisotropy: g,
        ..Material::default()
    }
}

/// A slab below z = 0 under a directional light of irradiance 1 from straight above, seen from straight above.
pub fn lit_slab(material: Material, depth_m: f32) -> Scene {
    let mut b = SceneBuilder::new();
    let medium = b.material(material);
    b.cuboid(Vec3::new(-400.0, -400.0, -depth_m), Vec3::new(400.0, 400.0, 0.0), false, medium);
    b.punctual(Vec3::ZERO, Vec3::NEG_Z, Vec3::ONE, PunctualKind::Directional);
    b.camera(Vec3::new(0.1, 0.2, 5.0), Vec3::new(0.1, 0.2, -1.0), Vec3::Y, 1e-3);
    b.build()
}

fn hold(what: &str, scene: &Scene, options: RenderOptions, expected: [f64; 3]) {
    let found = Estimate::of_pixels(&render(scene, options).film);
    for (channel, expected) in expected.into_iter().enumerate() {
        let allowed = 4.9 * found.standard_error(channel) + 2e-4 * expected;
        let mean = found.mean[channel];
        assert!((mean - expected).abs() <= allowed, "{what}, channel {channel}: {mean} for {expected} ± {allowed}");
        assert!(allowed < 0.05 * expected, "{what}: {allowed} of {expected} says little");
    }
}

/// Fog that only absorbs, on the way to a lamp, in front of and behind a solid that has none.
#[test]
fn fog_absorbs_by_beer_and_lambert() {
    let mut b = SceneBuilder::new();
    let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
    let clear = b.material(Material { multiscatter_color: Vec3::ZERO, ..murky(1.0, 0.5, [0.0; 3], 0.0) });
    b.quad([(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)].map(|(x, y)| Vec3::new(x, y, -2.0)), lamp);
    b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), false, clear);
    b.camera(Vec3::new(0.1, 0.2, 3.0), Vec3::new(0.1, 0.2, -9.0), Vec3::Y, 1e-3);
    let expected = (-0.25f64 * 3.0 - 0.5 * 2.0).exp();
    for strategy in [Strategy::MIS, Strategy::BSDF] {
        let fog = Fog { sigma_t: 0.25, albedo: 0.0, g: 0.0 };
        let options = options(8, 8, 4).backend(BackendKind::Obvhs).strategy(strategy).fog(fog);
        hold("fog", &b.clone().build(), options, [expected; 3]);
    }
}

/// One scattering back the way light came: albedo · p(−1) · (1 − e^(−2 σ d))/2, by channel and anisotropy.
#[test]
fn single_scattering_is_the_integral() {
    let (sigma, depth) = (1.5f64, 0.8f64);
    for g in [0.0f64, 0.6, -0.4] {
        let albedo = [0.9, 0.5, 0.2];
        let scene = lit_slab(murky(1.0, sigma as f32, albedo, g as f32), depth as f32);
        let back = (1.0 - g * g) / (4.0 * PI * (1.0 + g).powi(3));
        let expected = albedo.map(|albedo| albedo * back * (1.0 - (-2.0 * sigma * depth).exp()) / 2.0);
        let options = options(16, 16, 64).backend(BackendKind::Obvhs).max_depth(2);
        hold(&format!("g {g}"), &scene, options, expected);
    }
}

/// Chandrasekhar's H function of isotropic scattering at μ = 1 (Radiative Transfer, §37), by iteration of
/// 1/H(μ) = √(1−ϖ) + ϖ/2 ∫ μ' H(μ')/(μ+μ') dμ' on midpoints.
pub fn h_at_one(albedo: f64) -> f64 {
    const N: usize = 400;
    let mu = |i: usize| (i as f64 + 0.5) / N as f64;
    let inverse = |h: &[f64], at: f64| {
        let integral: f64 = (0..N).map(|i| mu(i) * h[i] / (at + mu(i))).sum::<f64>() / N as f64;
        (1.0 - albedo).sqrt() + 0.5 * albedo * integral
    };
    let mut h = vec![1.0; N];
    for _ in 0..400 {
        h = (0..N).map(|i| 0.5 * (h[i] + 1.0 / inverse(&h, mu(i)))).collect();
    }
    1.0 / inverse(&h, 1.0)
}

/// A slab too thick to see through reflects ϖ/8π · H(1)² of a perpendicular irradiance of 1 straight back.
#[test]
fn thick_slabs_are_chandrasekhars() {
    for (albedo, depth_m, spp) in [(0.5, 30.0, 64), (0.9, 60.0, 64), (0.999, 300.0, 64)] {
        let scene = lit_slab(murky(1.0, 1.0, [albedo; 3], 0.0), depth_m);
        let expected = albedo / (8.0 * PI) * h_at_one(albedo).powi(2);
        let options = options(16, 16, spp).backend(BackendKind::Obvhs).max_depth(1 << 14);
        hold(&format!("albedo {albedo}"), &scene, options, [expected; 3]);
    }
}

/// What scatters everything and stands in a radiance of 1 has a radiance of 1, whatever its index; in fog too.
#[test]
fn a_furnace_shows_nothing() {
    let furnace = |ior: f32| {
        let mut b = SceneBuilder::new();
        let milk = b.material(Material { multiscatter_color: Vec3::ONE, ..murky(ior, 1.0, [0.5; 3], 0.3) });
        b.sphere(Vec3::ZERO, 1.0, 12, false, false, milk);
        b.environment(Environment::constant(Vec3::ONE));
        b.camera(Vec3::new(0.0, 0.0, 3.0), Vec3::ZERO, Vec3::Y, 0.5);
        b.build()
    };
    for strategy in [Strategy::MIS, Strategy::BSDF, Strategy::LIGHT] {
        let options = |spp| options(16, 16, spp).backend(BackendKind::Obvhs).strategy(strategy).max_depth(4096);
        let spp = if strategy == Strategy::LIGHT { 64 } else { 16 };
        hold(&format!("index 1 by {strategy}"), &furnace(1.0), options(spp), [1.0; 3]);
        if strategy != Strategy::LIGHT {
            hold(&format!("index 1.4 by {strategy}"), &furnace(1.4), options(16), [1.0; 3]);
        }
        let fog = Fog { sigma_t: 0.3, albedo: 1.0, g: 0.5 };
        hold(&format!("fog by {strategy}"), &furnace(1.0), options(spp).fog(fog), [1.0; 3]);
    }
}

/// SplitMix64 (Steele et al. 2014).
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ z >> 31) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Radiance straight back from a slab under a perpendicular irradiance of 1, by delta tracking (Woodcock et al. 1965)
/// with twice the attenuation, one channel at a time, a shadow ray at each scattering: mean and standard error.
fn by_delta_tracking(sigma: f64, albedo: f64, g: f64, depth: f64, paths: usize) -> [f64; 2] {
    let mut random = Random(7);
    let phase = |cos: f64| (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * cos).powf(1.5));
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..paths {
        let (mut z, mut cos, mut carried, mut found) = (0.0f64, -1.0f64, 1.0f64, 0.0f64);
        loop {
            z += cos * -(1.0 - random.uniform()).ln() / (2.0 * sigma);
            if z > 0.0 || z < -depth {
                break;
            }
            if random.uniform() < 0.5 {
                continue;
            }
            carried *= albedo;
            found += carried * phase(cos) * (sigma * z).exp();
            // Turn by the phase function, evenly around.
            let root = (1.0 - g * g) / (1.0 + g - 2.0 * g * random.uniform());
            let turn = (1.0 + g * g - root * root) / (2.0 * g);
            let around = (2.0 * PI * random.uniform()).cos();
            cos = cos * turn + ((1.0 - cos * cos) * (1.0 - turn * turn)).max(0.0).sqrt() * around;
            if carried < 1e-9 {
                break;
            }
        }
        (sum, squares) = (sum + found, squares + found * found);
    }
    let n = paths as f64;
    let mean = sum / n;
    [mean, ((squares / n - mean * mean) / n).sqrt()]
}

/// Colours that scatter differently, forwards: spectral MIS against delta tracking of each channel by itself.
#[test]
fn channels_are_what_delta_tracking_says() {
    let (albedo, g, depth) = ([0.95, 0.7, 0.3], 0.6, 3.0);
    let mut material = murky(1.0, 1.0, albedo, g as f32);
    let sigma = [1.0f64, 2.0, 0.5];
    material.attenuation_color = Vec3::from(sigma.map(|sigma| (-sigma).exp() as f32));
    let film =
        render(&lit_slab(material, depth as f32), options(16, 16, 256).backend(BackendKind::Obvhs).max_depth(1024))
            .film;
    let found = Estimate::of_pixels(&film);
    for channel in 0..3 {
        let [mean, error] = by_delta_tracking(sigma[channel], albedo[channel], g, depth, 200_000);
        let allowed = 4.9 * error.hypot(found.standard_error(channel));
        let off = (found.mean[channel] - mean).abs();
        assert!(off < allowed && allowed < 0.05 * mean, "{channel}: {} for {mean} ± {allowed}", found.mean[channel]);
    }
}

/// A lamp and walls in fog, a murky ball of the index of air among them: strategies agree.
#[test]
fn strategies_agree_in_fog() {
    let mut b = SceneBuilder::new();
    let white = b.lambert(Vec3::splat(0.6));
    let lamp = b.emitter(Vec3::ZERO, Vec3::splat(10.0));
    let ball = b.material(murky(1.0, 3.0, [0.9, 0.6, 0.3], 0.5));
    b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, white);
    b.sphere(Vec3::new(0.2, -0.4, -0.2), 0.4, 8, false, false, ball);
    b.quad([[-0.5, 0.9, -0.5], [0.5, 0.9, -0.5], [0.5, 0.9, 0.5], [-0.5, 0.9, 0.5]].map(Vec3::from), lamp);
    b.camera(Vec3::new(0.1, 0.0, 0.9), Vec3::new(0.0, -0.3, -1.0), Vec3::Y, 0.9);
    let scene = b.build();
    let fog = Fog { sigma_t: 0.5, albedo: 0.8, g: -0.3 };
    let [a, b] = [Strategy::MIS, Strategy::BSDF].map(|strategy| {
        let films = (0..8).map(|seed| {
            let options = options(16, 16, 64).backend(BackendKind::Obvhs).strategy(strategy).seed(seed).fog(fog);
            Estimate::of_pixels(&render(&scene, options).film).mean
        });
        Estimate::of(films.collect::<Vec<_>>().into_iter())
    });
    for channel in 0..3 {
        let error = a.standard_error(channel).hypot(b.standard_error(channel));
        let off = (a.mean[channel] - b.mean[channel]).abs();
        // 14 degrees of freedom: 7.2 standard errors are 10⁻⁶, two-sided.
        assert!(off < 7.2 * error && error < 0.02 * a.mean[channel], "{:?} {:?}", a.mean, b.mean);
    }
}
