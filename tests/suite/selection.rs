//! The choice among lights by what they can send to a receiver: that it draws what it says, leaves out nothing that
//! counts, and fits any arrangement of lights. Seeds are fixed. Tests that say "exact" have no false alarms; chi-square
//! tests are accepted above p = 1e-6 (12 of them).

use glam::Vec3;
use pathspace::math::simd::isa::Baseline;
use pathspace::scene::geometry::Geometry;
use pathspace::scene::{PunctualKind, PunctualLight, Scene};
use pathspace::shading::light::grow::Emitter;
use pathspace::shading::light::select::{Distant, Selection, Selector};
use pathspace::shading::light::tree::Receivers;
use pathspace::shading::light::{Lights, punctual};
use pathspace::transport::choose::choose;
use pathspace_stat::chi2_test;

use crate::common::Estimate;
use crate::meter::{Random, environment, geometry, irradiance, material};

const PI: f64 = std::f64::consts::PI;

fn uniform(random: &mut Random, low: f32, high: f32) -> Vec3 {
    Vec3::new(random.unit(), random.unit(), random.unit()) * (high - low) + Vec3::splat(low)
}

/// Triangles of sizes over three decades, points and spots, in clusters in a box of 10 m.
fn emitters(count: u32, random: &mut Random) -> Vec<Emitter> {
    let clusters: Vec<Vec3> = (0..4).map(|_| uniform(random, 0.0, 10.0)).collect();
    (0..count)
        .map(|light| {
            let place = clusters[light as usize % 4] + uniform(random, -1.0, 1.0);
            let intensity = random.log_uniform(1e-3, 1e3);
            match light % 5 {
                0 => Emitter { light, corners: [place; 4], axis: Vec3::Z, spread: PI, reach: 0.0, intensity },
                1 => {
                    let (spread, reach) = (0.3 * f64::from(random.unit()), f64::from(random.unit()));
                    Emitter { light, corners: [place; 4], axis: random.direction(), spread, reach, intensity }
                }
                _ => {
                    let size = random.log_uniform(1e-3, 1.0) as f32;
                    let (e1, e2) = (random.direction() * size, random.direction() * size);
                    let axis = e1.as_dvec3().cross(e2.as_dvec3()).normalize().as_vec3();
                    let corners = [place, place + e1, place + e2, place];
                    Emitter { light, corners, axis, spread: 0.0, reach: PI / 2.0, intensity }
                }
            }
        })
        .collect()
}

/// Receivers inside and outside of the box, one in four without a normal.
fn receivers(count: usize, random: &mut Random) -> Vec<(Vec3, Vec3)> {
    (0..count)
        .map(|i| (uniform(random, -5.0, 15.0), if i % 4 == 0 { Vec3::ZERO } else { random.direction() }))
        .collect()
}

fn selector(near: &[Emitter], distant: &[Distant]) -> Selector {
    Selector::new(near.to_vec(), distant, near.len() + distant.len()).expect("valid lights")
}

/// Exact to the rounding of each probability to f32: for every receiver they add up to 1, or to 0 where nothing can
/// reach it, with lights at infinity and without, from one light to a thousand.
#[test]
fn probabilities_add_up_to_one() {
    let mut random = Random(1);
    for count in [1u32, 2, 3, 7, 8, 9, 64, 65, 1000] {
        let near = emitters(count, &mut random);
        for distant in [vec![], vec![Distant { light: count, irradiance: 1.0 }], {
            (0..3).map(|i| Distant { light: count + i, irradiance: f64::from(i) + 0.5 }).collect()
        }] {
            let selector = selector(&near, &distant);
            for (p, n) in receivers(64, &mut random) {
                let all = 0..count + distant.len() as u32;
                let sum: f64 = all.map(|light| f64::from(selector.p_select(light, p, n))).sum();
                let dark = selector.select(p, n, 0.5).is_none();
                assert!((sum - f64::from(u8::from(!dark))).abs() < 1e-6, "{count} lights at {p}: {sum}, dark: {dark}");
            }
        }
    }
}

/// Exact: the probability that a choice comes with is that of its light, in every bit, and never 0.
#[test]
fn chosen_probability_is_the_probability_of_the_light() {
    let mut random = Random(2);
    for count in [1u32, 2, 10, 300] {
        let near = emitters(count, &mut random);
        let distant: Vec<Distant> = (0..2).map(|i| Distant { light: count + i, irradiance: 3.0 }).collect();
        for distant in [&distant[..0], &distant[..1], &distant[..2]] {
            let selector = selector(&near, distant);
            for (p, n) in receivers(1 << 12, &mut random) {
                let u = f64::from(random.unit()) + f64::from(random.unit()) / (1u64 << 24) as f64;
                let Some(chosen) = selector.select(p, n, u) else { continue };
                assert!(chosen.p_select > 0.0);
                assert_eq!(chosen.p_select.to_bits(), selector.p_select(chosen.light, p, n).to_bits());
            }
        }
    }
}

/// Exact: sixteen walks side by side end where one by itself does, with the same probability in every bit; lanes that
/// are not asked for have none.
#[test]
fn sixteen_choices_are_those_of_one() {
    const N: usize = 16;
    let mut random = Random(6);
    let (mut found, mut dark, mut far) = (0, 0, 0);
    for count in [2u32, 9, 300, 5000] {
        let near = emitters(count, &mut random);
        let distant: Vec<Distant> = (0..2).map(|i| Distant { light: count + i, irradiance: 3.0 }).collect();
        for distant in [&distant[..0], &distant[..2]] {
            let selector = selector(&near, distant);
            let by_receiver = selector.by_receiver().expect("several lights at finite distances");
            for _ in 0..1 << 8 {
                let receivers = receivers(N, &mut random);
                let active: [u32; N] = std::array::from_fn(|_| u32::from(random.unit() < 0.7));
                let u: [f64; N] = std::array::from_fn(|_| f64::from(random.unit()));
                let column = |of: fn(&(Vec3, Vec3)) -> Vec3| {
                    std::array::from_fn(|axis| std::array::from_fn(|i| of(&receivers[i])[axis]))
                };
                let columns = Receivers::new(column(|r| r.0), column(|r| r.1));
                let chosen = choose::<Baseline>(by_receiver, &active, &columns, &u);
                for i in 0..N {
                    let expected = selector.select(receivers[i].0, receivers[i].1, u[i]).filter(|_| active[i] != 0);
                    let (light, p_select) = (chosen.light[i], chosen.p_select[i]);
                    match expected {
                        None => assert_eq!(p_select, 0.0),
                        Some(one) => {
                            assert_eq!((light, p_select.to_bits()), (one.light, one.p_select.to_bits()));
                        }
                    }
                    found += u32::from(expected.is_some());
                    dark += u32::from(expected.is_none() && active[i] != 0);
                    far += u32::from(expected.is_some_and(|one| one.light >= count));
                }
            }
        }
    }
    assert!(found > 10_000 && dark > 10 && far > 100, "{found} found, {dark} dark, {far} at infinity");
}

/// Lights are chosen as often as reported: chi-square over 200 lights and two at infinity, for 12 receivers.
#[test]
fn choices_follow_the_probabilities() {
    let mut random = Random(3);
    let near = emitters(200, &mut random);
    let distant: Vec<Distant> = (0..2).map(|i| Distant { light: 200 + i, irradiance: 2.0 }).collect();
    let selector = selector(&near, &distant);
    let samples = 1 << 17;
    for (p, n) in receivers(12, &mut random) {
        let mut observed = vec![0u64; 202];
        for _ in 0..samples {
            let chosen = selector.select(p, n, f64::from(random.unit())).expect("a sky is seen from everywhere");
            observed[chosen.light as usize] += 1;
        }
        let expected: Vec<f64> =
            (0..202).map(|light| f64::from(selector.p_select(light, p, n)) * f64::from(samples)).collect();
        let test = chi2_test(&observed, &expected);
        assert!(test.p_value > 1e-6, "receiver {p}, {n}: p = {:e}", test.p_value);
    }
}

/// Exact: a light that gives anything to a receiver can be chosen for it. Triangles are tried at 16 points each.
#[test]
fn nothing_that_counts_is_left_out() {
    let mut random = Random(4);
    let triangles: Vec<([Vec3; 3], u32)> = emitters(250, &mut random)
        .iter()
        .filter(|emitter| emitter.reach > 1.5)
        .map(|emitter| ([emitter.corners[0], emitter.corners[1], emitter.corners[2]], 0))
        .collect();
    let spots: Vec<PunctualLight> = (0..100)
        .map(|i| {
            let outer = (1.0 - random.unit()) * if i % 2 == 0 { 0.3 } else { 2.0 };
            let inner = outer * [0.0, 1.0, random.unit()][i % 3];
            PunctualLight {
                name: "spot".into(),
                position: uniform(&mut random, 0.0, 10.0),
                direction: random.direction(),
                intensity: Vec3::ONE,
                kind: PunctualKind::Spot { cos_inner: inner.cos(), cos_outer: outer.cos() },
                range_m: f32::INFINITY,
                profile: None,
            }
        })
        .collect();
    let scene = Scene { materials: vec![material(1.0)], punctual: spots, ..Scene::default() };
    let geometry = geometry(&triangles);
    let lights = Lights::build(&scene, &geometry).expect("valid lights");
    let mut seen = 0;
    for (p, n) in receivers(1 << 9, &mut random) {
        let received = |wi: Vec3| n == Vec3::ZERO || wi.dot(n) > 1e-6;
        for (light, triangle) in geometry.triangles.iter().enumerate() {
            let (v0, e1, e2) = (Vec3::from(triangle.v0), Vec3::from(triangle.e1), Vec3::from(triangle.e2));
            let gives = (0..16).any(|_| {
                let (a, b) = (random.unit(), random.unit());
                let (a, b) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
                let wi = (v0 + e1 * a + e2 * b - p).normalize();
                received(wi) && -wi.dot(Vec3::from(triangle.n_g)) > 1e-6
            });
            seen += u32::from(gives);
            assert!(!gives || lights.p_select(light as u32, p, n) > 0.0, "triangle {light} from {p}, {n}");
        }
        for (light, spot) in scene.punctual.iter().enumerate() {
            let sample = punctual::Light::new(spot).expect("valid").sample(p);
            let gives = sample.is_some_and(|sample| received(sample.wi));
            seen += u32::from(gives);
            let number = (triangles.len() + light) as u32;
            assert!(!gives || lights.p_select(number, p, n) > 0.0, "spot {light} from {p}, {n}");
        }
    }
    assert!(seen > 10_000, "only {seen} pairs in sight");
}

/// Arrangements that trees choke on: all in one place, on a logarithmic scale, in one plane; brightness over 24
/// decades.
#[test]
fn odd_arrangements() {
    let point = |light: u32, place: Vec3, intensity: f64| Emitter {
        light,
        corners: [place; 4],
        axis: Vec3::Z,
        spread: PI,
        reach: 0.0,
        intensity,
    };
    let arrangements: [Vec<Emitter>; 4] = [
        (0..1000).map(|i| point(i, Vec3::splat(3.0), 1.0)).collect(),
        (0..100).map(|i| point(i, Vec3::X * 2f32.powi(i as i32 - 50), 1.0)).collect(),
        (0..1000).map(|i| point(i, Vec3::new((i % 10) as f32, 2.0, (i / 10) as f32), 1.0)).collect(),
        (0..1000).map(|i| point(i, Vec3::X * (i % 37) as f32, 10f64.powf(f64::from(i % 25) - 12.0))).collect(),
    ];
    for near in arrangements {
        let selector = selector(&near, &[]);
        assert_eq!(selector.selection(), Selection::Receiver);
        for p in [Vec3::ZERO, Vec3::splat(3.0), Vec3::new(5.0, -1.0, 40.0), Vec3::X * 1e-20] {
            let sum: f64 = near.iter().map(|e| f64::from(selector.p_select(e.light, p, Vec3::ZERO))).sum();
            assert!((sum - 1.0).abs() < 1e-6, "{sum} from {p}");
            let chosen = selector.select(p, Vec3::ZERO, 0.999_999_9).expect("points shine all around");
            assert_eq!(chosen.p_select, selector.p_select(chosen.light, p, Vec3::ZERO));
        }
    }
}

/// Lights of every kind around a receiver: the mean of the estimate is the sum of the closed forms, at 4.9 standard
/// errors, and its spread is what the choice is for: below half of what a choice by power would have (in closed form,
/// the sky left out), with the squares of the distances over four decades.
#[test]
fn near_and_far_lights_add_up() {
    let mut random = Random(5);
    let mut scene = Scene::default();
    let (mut expected, mut squares, n) = (0.0, 0.0, Vec3::Z);
    for _ in 0..500 {
        let position = random.direction() * random.log_uniform(0.1, 10.0) as f32;
        let light = PunctualLight {
            name: "lamp".into(),
            position,
            direction: Vec3::ZERO,
            intensity: Vec3::ONE,
            kind: PunctualKind::Point,
            range_m: f32::INFINITY,
            profile: None,
        };
        let irradiance = f64::from(position.z.max(0.0)) / f64::from(position.length()).powi(3);
        expected += irradiance;
        squares += irradiance * irradiance;
        scene.punctual.push(light);
    }
    scene.environment = Some(environment(16, 8, |_| 1.0));
    let lights = Lights::build(&scene, &Geometry::default()).expect("valid lights");
    let moments = irradiance(&lights, Vec3::ZERO, n, 1 << 18, 5);
    Estimate::of_moments(&moments).expect("lamps and sky", expected + PI, 1e-5 * (expected + PI), 2e-2);
    let by_power = (500.0 * squares - expected * expected).sqrt();
    let spread = moments.variance().sqrt();
    assert!(spread < 0.5 * by_power, "standard deviation {spread}, by power {by_power}");
}
