//! Two ways to the same number: strategies, roulette, backends, ray widths. Compared per block of 8×8 pixels by
//! Welch's t over independent seeds. Family-wise false-alarm rate 1e-4 per comparison; seeds fixed.

use glam::Vec3;
use pathspace::backend::BackendKind;
use pathspace::plan::options::{RenderOptions, Roulette, SamplerKind, Strategy};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Environment, Scene};

use crate::common::{options, render};

const SIDE: u32 = 48;
const BLOCK: u32 = 8;
const SEEDS: u64 = 8;

/// A small room with a light, a metal ball, a glass ball and an opening to an environment.
fn mixed_room() -> Scene {
    let mut b = SceneBuilder::new();
    let white = b.lambert(Vec3::new(0.7, 0.6, 0.5));
    let light = b.emitter(Vec3::ZERO, Vec3::new(6.0, 5.0, 4.0));
    let metal = b.metal(Vec3::new(0.9, 0.7, 0.5), 0.3);
    let coat = b.material(pathspace::scene::Material {
        base_color: Vec3::new(0.2, 0.4, 0.7),
        metallic: 0.0,
        roughness: 0.6,
        ..Default::default()
    });
    let glass = b.material(pathspace::scene::Material {
        metallic: 0.0,
        roughness: 0.5,
        transmission: 1.0,
        thickness: 1.0,
        attenuation_color: Vec3::new(0.8, 0.9, 0.5),
        attenuation_distance_m: 0.5,
        ..Default::default()
    });
    let quad = |b: &mut SceneBuilder, p: [[f32; 3]; 4], m| {
        b.quad(p.map(Vec3::from), m);
    };
    quad(&mut b, [[-1., 0., 1.], [1., 0., 1.], [1., 0., -1.], [-1., 0., -1.]], white);
    quad(&mut b, [[-1., 0., -1.], [1., 0., -1.], [1., 2., -1.], [-1., 2., -1.]], white);
    quad(&mut b, [[-1., 0., 1.], [-1., 0., -1.], [-1., 2., -1.], [-1., 2., 1.]], coat);
    quad(&mut b, [[-0.4, 1.9, -0.4], [0.4, 1.9, -0.4], [0.4, 1.9, 0.4], [-0.4, 1.9, 0.4]], light);
    b.sphere(Vec3::new(-0.4, 0.35, -0.2), 0.35, 16, false, true, metal);
    b.sphere(Vec3::new(0.45, 0.3, 0.2), 0.3, 16, false, true, glass);
    b.point_light(Vec3::new(0.8, 1.2, 0.8), Vec3::new(0.5, 0.2, 0.2));
    b.environment(Environment::constant(Vec3::new(0.1, 0.15, 0.3)));
    b.camera(Vec3::new(0.2, 1.0, 3.5), Vec3::new(0.0, 0.9, 0.0), Vec3::Y, 0.7);
    b.build()
}

/// Block means over independent seeds: mean and variance of the mean per block.
fn blocks(
    scene: &Scene,
    configure: impl Fn(RenderOptions) -> RenderOptions,
    spp: u64,
    first_seed: u64,
) -> Vec<(f64, f64)> {
    let per_seed: Vec<Vec<f64>> = (0..SEEDS)
        .map(|seed| {
            let base = options(SIDE, SIDE, spp).seed(first_seed + seed).sampler(SamplerKind::Independent);
            let film = render(scene, configure(base)).film;
            let mut sums = vec![0.0; ((SIDE / BLOCK) * (SIDE / BLOCK)) as usize];
            for y in 0..SIDE {
                for x in 0..SIDE {
                    let m = film.pixel(x, y).mean();
                    sums[(y / BLOCK * (SIDE / BLOCK) + x / BLOCK) as usize] += (m[0] + m[1] + m[2]) / 3.0;
                }
            }
            sums.iter().map(|s| s / (BLOCK * BLOCK) as f64).collect()
        })
        .collect();
    (0..per_seed[0].len())
        .map(|i| {
            let mean = per_seed.iter().map(|b| b[i]).sum::<f64>() / SEEDS as f64;
            let variance = per_seed.iter().map(|b| (b[i] - mean).powi(2)).sum::<f64>() / (SEEDS - 1) as f64;
            (mean, variance / SEEDS as f64)
        })
        .collect()
}

/// Welch's t per block. Limit for 36 blocks at family level 1e-4 (2.8e-6 two-sided each) with 14 degrees of freedom:
/// t = 7.5; a block with fewer effective degrees is covered by 9.
fn expect_equal(what: &str, a: &[(f64, f64)], b: &[(f64, f64)]) {
    const LIMIT: f64 = 9.0;
    let mut sum = (0.0, 0.0);
    for (i, (a, b)) in a.iter().zip(b).enumerate() {
        let t = (a.0 - b.0) / (a.1 + b.1).sqrt().max(1e-12);
        assert!(t.abs() <= LIMIT, "{what}: block {i}: {} against {}, t = {t:.2}", a.0, b.0);
        sum = (sum.0 + a.0 - b.0, sum.1 + a.1 + b.1);
    }
    let z = sum.0 / sum.1.sqrt();
    assert!(z.abs() <= 4.9, "{what}: whole picture differs by {z:.2} standard errors");
}

#[test]
fn strategies_agree_in_expectation() {
    let mut scene = mixed_room();
    scene.punctual.clear(); // BSDF sampling cannot find it.
    let mis = blocks(&scene, |o| o, 32, 100);
    for (strategy, spp) in [(Strategy::MIS_BALANCE, 32), (Strategy::LIGHT, 64), (Strategy::BSDF, 256)] {
        let other = blocks(&scene, |o| o.strategy(strategy), spp, 200);
        expect_equal(&format!("mis against {strategy}"), &mis, &other);
    }
}

#[test]
fn roulette_on_and_off_agree() {
    let scene = mixed_room();
    let on = blocks(&scene, |o| o, 64, 300);
    let off = blocks(&scene, |o| o.roulette(Roulette::Off), 64, 400);
    let constant = blocks(&scene, |o| o.roulette(Roulette::Constant(0.8)), 64, 500);
    expect_equal("roulette on against off", &on, &off);
    expect_equal("roulette constant against off", &constant, &off);
}

#[test]
fn samplers_agree() {
    let scene = mixed_room();
    let independent = blocks(&scene, |o| o, 64, 600);
    let sobol = blocks(&scene, |o| o.sampler(SamplerKind::Sobol), 64, 700);
    expect_equal("sobol against independent", &sobol, &independent);
}

#[test]
fn backends_agree() {
    let scene = mixed_room();
    let kinds = BackendKind::available();
    let first = blocks(&scene, |o| o.backend(kinds[0]), 16, 800);
    for &kind in &kinds[1..] {
        let other = blocks(&scene, |o| o.backend(kind), 16, 800);
        expect_equal(&format!("{} against {}", kinds[0].name(), kind.name()), &first, &other);
    }
}
