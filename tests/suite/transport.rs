//! The rendering equation against closed forms: furnaces, path lengths, Lambert's formula for polygonal lights.
//! False-alarm rate of each comparison: 1e-6 (4.9 standard errors) unless said otherwise; seeds are fixed.

use std::f64::consts::PI;

use glam::Vec3;
use pathspace::plan::options::{RenderOptions, Roulette, Strategy};
use pathspace::scene::Scene;
use pathspace::scene::builder::SceneBuilder;

use crate::common::{Estimate, options, probe, probe_film, render};

/// A closed inward sphere that emits 1 and reflects ρ everywhere.
fn closed_sphere(albedo: f32) -> Scene {
    let mut b = SceneBuilder::new();
    let material = b.emitter(Vec3::splat(albedo), Vec3::ONE);
    b.sphere(Vec3::ZERO, 1.0, 12, true, false, material);
    b.build()
}

#[test]
fn closed_sphere_radiates_le_over_one_minus_rho() {
    // P01, three strategies; roulette with its own rule.
    for (albedo, delta) in [(0.5f32, 5e-3), (0.8, 1e-2), (0.9, 1.5e-2)] {
        for strategy in [Strategy::MisPower, Strategy::BsdfOnly] {
            let options = RenderOptions { strategy, max_depth: 4096, seed: 7, ..RenderOptions::default() };
            let estimate =
                probe(&closed_sphere(albedo), Vec3::new(0.1, 0.2, -0.1), Vec3::new(0.3, -0.5, 0.8), 1 << 17, options);
            let expected = 1.0 / (1.0 - albedo as f64);
            estimate.expect(&format!("closed sphere, ρ = {albedo}, {strategy:?}"), expected, 1e-5 * expected, delta);
        }
    }
}

#[test]
fn each_path_length_of_the_closed_sphere_is_its_own_term() {
    // P02: with BSDF sampling and no roulette every sample of term k is exactly ρᵏ (up to rounding, k + 1 products).
    let albedo = 0.5f32;
    let options = RenderOptions {
        strategy: Strategy::BsdfOnly,
        roulette: Roulette::Off,
        max_depth: 12,
        per_length: true,
        ..RenderOptions::default()
    };
    let film = probe_film(&closed_sphere(albedo), Vec3::ZERO, Vec3::new(0.3, -0.5, 0.8), 1 << 10, options);
    let lengths = film.lengths.expect("per-length sums were asked for");
    let n = film.film.pixels.len() as f64;
    let mut total = 0.0;
    for edge in 1..=12 {
        let mean = lengths.image(edge).iter().map(|s| s[0]).sum::<f64>() / n;
        let expected = (albedo as f64).powi(edge as i32 - 1);
        assert!((mean - expected).abs() <= 2f64.powi(-20) * expected, "edge {edge}: {mean}, expected {expected}");
        total += mean;
    }
    let beauty = film.film.pixels.iter().map(|p| p.mean()[0]).sum::<f64>() / n;
    assert!((total - beauty).abs() <= 1e-6 * beauty, "terms sum to {total}, the picture is {beauty}");
}

#[test]
fn a_depth_limit_removes_exactly_its_tail() {
    // P03: L_M = (1 − ρ^(M+1))/(1 − ρ) with M = edges − 1 scatterings; deterministic under cosine sampling.
    for (albedo, edges) in [(0.5f32, 1u32), (0.5, 9), (0.9, 9), (0.9, 65), (0.99, 65)] {
        let options = RenderOptions {
            strategy: Strategy::BsdfOnly,
            roulette: Roulette::Off,
            max_depth: edges,
            ..RenderOptions::default()
        };
        let mean = probe(&closed_sphere(albedo), Vec3::ZERO, Vec3::X, 256, options).mean[0];
        let rho = albedo as f64;
        let expected = (1.0 - rho.powi(edges as i32)) / (1.0 - rho);
        let bound = 2f64.powi(-20) + edges as f64 * 2f64.powi(-24);
        assert!((mean / expected - 1.0).abs() <= bound, "ρ = {albedo}, {edges} edges: {mean}, expected {expected}");
    }
}

/// A Lambert patch (ρ = 0.5) facing `normal` under a polygonal light; the probe looks at it from above.
fn irradiance(receiver: Vec3, normal: Vec3, light: &[Vec3], strategy: Strategy, n: u32) -> Estimate {
    let mut b = SceneBuilder::new();
    let patch = b.lambert(Vec3::splat(0.5));
    let emitter = b.emitter(Vec3::ZERO, Vec3::ONE);
    let (s, t) = normal.any_orthonormal_pair();
    let (s, t) = (s * 0.01, t * 0.01);
    let (s, t) = if s.cross(t).dot(normal) > 0.0 { (s, t) } else { (t, s) };
    b.quad([receiver - s - t, receiver + s - t, receiver + s + t, receiver - s + t], patch);
    let corners = (1..light.len() as u32 - 1).map(|i| [0, i, i + 1]).collect();
    b.triangles(light.to_vec(), corners, emitter);
    let scene = b.build();
    let eye = receiver + normal * 0.05;
    let mut estimate =
        probe(&scene, eye, -normal, n, RenderOptions { strategy, max_depth: 2, seed: 11, ..RenderOptions::default() });
    let scale = PI / 0.5;
    estimate.mean = estimate.mean.map(|m| m * scale);
    estimate.variance = estimate.variance.map(|v| v * scale * scale);
    estimate
}

/// Lambert's formula (1760): irradiance of a polygon of radiance 1, wound so that its front faces the receiver.
fn lambert_formula(receiver: Vec3, normal: Vec3, polygon: &[Vec3]) -> f64 {
    let v: Vec<_> = polygon.iter().map(|p| (*p - receiver).as_dvec3()).collect();
    let sum: f64 = (0..v.len())
        .map(|i| {
            let (a, b) = (v[i], v[(i + 1) % v.len()]);
            let cross = a.cross(b);
            cross.length().atan2(a.dot(b)) * normal.as_dvec3().dot(cross / cross.length())
        })
        .sum();
    0.5 * sum.abs()
}

#[test]
fn polygonal_light_over_a_plane_follows_lamberts_formula() {
    // L01 and L02. BSDF-only is a Bernoulli estimator: it is held to a coarser power.
    let square = [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)].map(|(x, y)| Vec3::new(x, y, 1.0));
    let triangle = [Vec3::new(0.0, 0.0, 1.0), Vec3::new(0.0, 1.0, 1.0), Vec3::new(1.0, 0.0, 1.0)];
    let tilted = Vec3::new(1.0, 2.0, 2.0) / 3.0;
    let cases: [(&str, Vec3, Vec3, &[Vec3], f64); 6] = [
        ("square, below", Vec3::ZERO, Vec3::Z, &square, 1.740839503),
        ("square, edge", Vec3::new(1.0, 0.0, 0.0), Vec3::Z, &square, 1.051648203),
        ("square, aside", Vec3::new(3.0, 0.0, 0.0), Vec3::Z, &square, 0.04960834601),
        ("square, far aside", Vec3::new(3.0, 4.0, 0.0), Vec3::Z, &square, 0.006554121792),
        ("square, tilted", Vec3::ZERO, tilted, &square, 1.165664387),
        ("triangle", Vec3::ZERO, Vec3::Z, &triangle, 0.302299894),
    ];
    for (name, receiver, normal, polygon, expected) in cases {
        if name != "square, tilted" {
            // The tilted receiver sees part of the square below its horizon: the unclipped formula does not apply.
            let formula = lambert_formula(receiver, normal, polygon);
            assert!((formula / expected - 1.0).abs() < 1e-6, "{name}: formula {formula}, table {expected}");
        }
        for (strategy, n) in
            [(Strategy::LightOnly, 1 << 16), (Strategy::MisPower, 1 << 17), (Strategy::BsdfOnly, 1 << 18)]
        {
            let delta = match strategy {
                Strategy::BsdfOnly => 4.9 * ((PI / expected - 1.0) / n as f64).sqrt() * 1.05,
                _ => 2e-2,
            };
            irradiance(receiver, normal, polygon, strategy, n).expect(
                &format!("{name}, {strategy:?}"),
                expected,
                1e-5 * expected,
                delta,
            );
        }
    }
}

#[test]
fn albedo_one_in_a_closed_room_ends_at_the_depth_limit() {
    // P09 (b): nothing emits, nothing absorbs. Every path is capped, the picture is 0.
    let mut b = SceneBuilder::new();
    let white = b.lambert(Vec3::ONE);
    b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, white);
    b.camera(Vec3::new(0.1, 0.2, 0.3), Vec3::new(1.0, 0.3, 0.1), Vec3::Y, 1.0);
    let render = render(&b.build(), RenderOptions { max_depth: 100, roulette: Roulette::Off, ..options(16, 16, 4) });
    assert_eq!(render.counters.capped_paths, 16 * 16 * 4);
    assert!(render.film.pixels.iter().all(|p| p.mean()[..3] == [0.0; 3]));
}
