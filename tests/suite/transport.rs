//! The rendering equation in a white furnace; closed rooms and polygonal lights are in `hard`. False-alarm rate of each
//! comparison: 1e-6 (4.9 standard errors); seeds are fixed.

use glam::Vec3;
use pathspace::plan::options::{RenderOptions, Roulette, SamplerKind, Strategy};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Environment, Projection, Scene};

use crate::common::{Estimate, options, render};

/// B01: a Lambert sphere in a uniform environment shows its albedo in every pixel.
fn sphere_in_furnace(albedo: f32) -> Scene {
    let mut b = SceneBuilder::new();
    let material = b.lambert(Vec3::splat(albedo));
    b.sphere(Vec3::ZERO, 1.0, 48, false, false, material);
    b.environment(Environment::constant(Vec3::ONE));
    b.any_camera(Vec3::new(0.0, 0.0, 3.0), Vec3::ZERO, Vec3::Y, Projection::Orthographic { xmag_m: 0.6, ymag_m: 0.6 });
    b.build()
}

#[test]
fn white_furnace_by_bsdf_sampling_is_exact() {
    // Every sample of cosine sampling is exactly ρ: no statistics, 2⁻²⁰ for the f32 products.
    for albedo in [1.0, 0.5, 0.18f32] {
        let render = render(
            &sphere_in_furnace(albedo),
            RenderOptions { strategy: Strategy::BsdfOnly, roulette: Roulette::Off, ..options(32, 32, 16) },
        );
        for pixel in &render.film.pixels {
            for c in 0..3 {
                let error = (pixel.mean()[c] - albedo as f64).abs();
                assert!(error <= 2f64.powi(-20), "albedo {albedo}: {} in channel {c}", pixel.mean()[c]);
            }
        }
    }
}

#[test]
fn white_furnace_by_light_sampling_and_mis() {
    // Light sampling spends half of its samples below the horizon: three times the deviation.
    for (strategy, delta) in [(Strategy::MisPower, 5e-3), (Strategy::MisBalance, 5e-3), (Strategy::LightOnly, 1.5e-2)] {
        let render = render(
            &sphere_in_furnace(0.5),
            RenderOptions { strategy, sampler: SamplerKind::Independent, ..options(64, 64, 64) },
        );
        Estimate::of_pixels(&render.film).expect(&format!("furnace, {strategy:?}"), 0.5, 1e-5, delta);
    }
}
