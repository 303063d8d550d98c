//! Combining light sampling and BSDF sampling: the weights by themselves, the variance that each way must have,
//! blockers, mirrors, and lights that only one of the two can find.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use pathspace::plan::options::Strategy;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::geometry::Geometry;
use pathspace::scene::{Environment, Material, PunctualKind, PunctualLight, Scene};
use pathspace::shading::light::Lights;
use pathspace::shading::light::area::pdf_sa;
use pathspace::shading::mis::{balance_weight, power_weight};
use pathspace_stat::{Moments, welch};

use super::Case;
use super::area_lights::{FAN_DEFICIT, fan, square};
use super::modes::Mode;
use super::receiver::{Means, Receiver, STRATEGIES, bernoulli_delta, delta, delta_of, with};
use crate::common::{Estimate, probe_film};
use crate::meter::{Random, environment, geometry, irradiance, material, square_light};

const ORIGIN: Vec3 = Vec3::ZERO;
const UP: Vec3 = Vec3::Z;

#[test]
fn l15_weights() {
    let mut case = Case::open("L15", "MIS weights at overflow and underflow of densities", "squares of densities");
    const INF: f32 = f32::INFINITY;
    let table = [
        (1e-25, 1e-25, 0.5),
        (1e-25, 3e-25, 0.1),
        (1e20, 1e20, 0.5),
        (1e20, 1e25, 1e-10),
        (3e38, 3e38, 0.5),
        (1e-38, 1e-38, 0.5),
        (1e-30, 1e10, 0.0),
        (0.0, 1.0, 0.0),
        (1.0, 0.0, 1.0),
        (INF, 1.0, 1.0),
        (0.0, 0.0, 0.0),
        (1.0, INF, 0.0),
        (INF, INF, 1.0),
    ];
    let bound = 2f64.powi(-22);
    // At (1e-30, 1e10) the true weight is 1e-80, which is 0 in f32.
    case.numbers("- (power)", table.map(|(a, b, expected)| (expected, f64::from(power_weight(a, b)), bound)));
    let ends = [(0.0, 0.0, 0.0), (1.0, 0.0, 1.0), (INF, 1.0, 1.0), (3e38, 3e38, 0.5), (1.0, 3.0, 0.25)];
    case.numbers("- (balance)", ends.map(|(a, b, expected)| (expected, f64::from(balance_weight(a, b)), bound)));
    let lost = [power_weight(f32::NAN, 1.0), power_weight(1.0, f32::NAN), balance_weight(1.0, f32::NAN)];
    case.count("- (NaN that is lost)", 0, lost.iter().filter(|weight| !weight.is_nan()).count() as u64);

    // 10⁷ pairs, log-uniform over all positive finite numbers, subnormals included: uniform in their bits.
    let mut random = Random(15);
    let mut worst: f64 = 0.0;
    for _ in 0..10_000_000 {
        let mut positive =
            || f32::from_bits((random.unit() * INF.to_bits() as f32) as u32 ^ (random.unit() * 128.0) as u32);
        let (a, b) = (positive(), positive());
        if a > 0.0 && b > 0.0 && a < INF && b < INF {
            let power = f64::from(power_weight(a, b)) + f64::from(power_weight(b, a));
            let balance = f64::from(balance_weight(a, b)) + f64::from(balance_weight(b, a));
            worst = if (power - 1.0).abs() <= worst { worst } else { (power - 1.0).abs() };
            worst = if (balance - 1.0).abs() <= worst { worst } else { (balance - 1.0).abs() };
        }
    }
    case.number("- (sum of both weights, worst of 10⁷ pairs)", 1.0, 1.0 + worst, bound);
    case.close();
}

#[test]
fn l16_known_variances() {
    let mut case =
        Case::open("L16", "three estimators, one value, known variances (fan of 1024)", "each estimator by itself");
    // Reflected radiance of a receiver of albedo ½. Sampling by uniform hemisphere or by solid angle does not exist
    // here.
    let exact = [
        (Strategy::BSDF, 0.0625),
        (Strategy::LIGHT, 1.0 / 96.0),
        (Strategy::MIS_BALANCE, 0.01073829037),
        (Strategy::MIS, 0.008048958126),
    ];
    for mode in Mode::all() {
        // Films of 2^18 pixels, four of them where the count is full: a quarter of the specification's.
        let (pixels, films) = if mode.is_main() { (1 << 18, 4) } else { (1 << 12, 1) };
        let moments = exact.map(|(strategy, _)| {
            let mut moments = Moments::default();
            for film in 0..films {
                let render = Receiver::new(ORIGIN, UP, &fan).render(pixels, with(&mode, strategy, 160 + film));
                render.film.pixels.iter().for_each(|pixel| moments.push(pixel.mean()[0]));
            }
            moments
        });
        let mut means = Means::default();
        let (mut variances, mut worst_t) = (Vec::new(), 0.0f64);
        for ((strategy, variance), found) in exact.iter().zip(&moments) {
            let n = found.n as f64;
            let tau = 0.25 * FAN_DEFICIT + 1e-6;
            // The band of the known variance, and a tenth for its estimate.
            let band = 1.1 * 4.9 * (variance / n).sqrt() / 0.25;
            means.add(format!("{strategy}"), 0.25, tau, band, Estimate::of_moments(found));
            let spread = 4.9 * ((found.excess_kurtosis() + 2.0) / n).sqrt() + FAN_DEFICIT;
            variances.push((*variance, found.variance(), if mode.is_main() { spread.min(0.01) } else { spread }));
        }
        for i in 0..4 {
            worst_t = (0..i).fold(worst_t, |worst, j| worst.max(welch(&moments[i], &moments[j]).t.abs()));
        }
        means.judge(&mut case, format!("{} (mean)", mode.name));
        case.numbers(format!("{} (variance)", mode.name), variances);
        case.row(
            format!("{} (means, pairwise)", mode.name),
            "|t| < 4.9",
            format!("{worst_t:.2}"),
            format!("{worst_t:.2} σ"),
            worst_t < 4.9,
        );
    }
    case.close();
}

#[test]
fn l17_two_measures() {
    let mut case = Case::open("L17", "area form equals solid-angle form, sample by sample", "the measure of a density");
    let mut random = Random(117);
    let mut worst = 0.0f64;
    for _ in 0..1_000_000 {
        let (wi, n_x, n_y) = (random.direction(), random.direction(), random.direction());
        let distance = random.log_uniform(1e-3, 1e3) as f32;
        let area = random.log_uniform(1e-4, 1e4) as f32;
        let (cos_x, cos_y) = (wi.dot(n_x).abs(), wi.dot(n_y).abs());
        if cos_x == 0.0 || cos_y == 0.0 {
            continue;
        }
        let distance2 = distance * distance;
        let f_radiance = 0.5 / PI as f32;
        let area_form = f_radiance * (cos_x * cos_y / distance2) / (1.0 / area);
        let solid_angle_form = f_radiance * cos_x / pdf_sa(distance2, cos_y, area);
        worst = worst.max((f64::from(area_form) / f64::from(solid_angle_form) - 1.0).abs());
    }
    case.number("- (ratio, worst of 10⁶)", 1.0, 1.0 + worst, 8.0 * 2f64.powi(-24));
    case.close();
}

#[test]
fn l18_partly_occluded() {
    let mut case = Case::open("L18", "partly occluded light", "visibility");
    let blocked = |corners: [(f32, f32); 4]| {
        move |b: &mut SceneBuilder| {
            square(b);
            let black = b.lambert(Vec3::ZERO);
            b.quad(corners.map(|(x, y)| Vec3::new(x, y, 0.5)), black);
        }
    };
    let small = blocked([(-0.25, -0.25), (0.25, -0.25), (0.25, 0.25), (-0.25, 0.25)]);
    let half = blocked([(-100.0, -100.0), (0.0, -100.0), (0.0, 100.0), (-100.0, 100.0)]);
    for mode in Mode::all() {
        let n = if mode.is_main() { 1 << 20 } else { 1 << 15 };
        let mut means = Means::default();
        let variants =
            [("square", &small as &dyn Fn(&mut SceneBuilder), 0.9885648143), ("half plane", &half, 0.8704197514)];
        for (what, lights, expected) in variants {
            for strategy in STRATEGIES {
                // Half of the light samples are blocked.
                let more = if strategy == Strategy::BSDF { 1 } else { 2 };
                let estimate = Receiver::new(ORIGIN, UP, lights).irradiance(more * n, with(&mode, strategy, 18));
                let band = delta_of(strategy, expected, n);
                means.add(format!("{what}, {strategy}"), expected, 1e-5 * expected, band, estimate);
            }
        }
        means.judge(&mut case, &mode.name);
    }
    case.close();
}

/// HARDCASES L19: a light above the receiver and a mirror beside it (a metal of roughness 0 that reflects everything).
pub fn mirror_beside(b: &mut SceneBuilder) {
    let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
    b.quad([(0.0, 0.5), (1.0, 0.5), (1.0, -0.5), (0.0, -0.5)].map(|(x, y)| Vec3::new(x, y, 1.0)), lamp);
    let mirror = b.material(Material { metallic: 1.0, roughness: 0.0, base_color: Vec3::ONE, ..Material::default() });
    b.quad([(-5.0, 0.0), (-5.0, 5.0), (5.0, 5.0), (5.0, 0.0)].map(|(y, z)| Vec3::new(2.0, y, z)), mirror);
}

#[test]
fn l19_caustic() {
    let mut case = Case::open("L19", "mirror caustic on a diffuse floor", "a path that light sampling cannot find");
    let receiver = Receiver::new(ORIGIN, UP, &mirror_beside);
    let scene = receiver.scene();
    for mode in Mode::all() {
        // Eight films, since few paths find the lamp by way of the mirror.
        let (pixels, spp) = if mode.is_main() { (1u32 << 14, 512) } else { (1 << 12, 16) };
        let n = u64::from(pixels) * spp;
        let options = with(&mode, Strategy::MIS, 19).max_depth(3).per_length(true).spp(spp);
        let film = probe_film(&scene, receiver.eye(), -UP, pixels, options).film;
        let lengths = film.path_lengths().expect("asked for");
        let of = |edge: usize| Estimate::of(lengths.image(edge).into_iter()).scaled(PI / 0.5);
        let mut means = Means::default();
        means.add("direct", 0.566645112, 1e-5 * 0.57, delta(n), of(2));
        let by_mirror = 0.005953642017;
        means.add("by the mirror", by_mirror, 1e-5 * by_mirror, bernoulli_delta(by_mirror / PI, n), of(3));
        means.judge(&mut case, &mode.name);
        // No light by any other length: what is counted twice would show here.
        let other: f64 = [1, 4, 5].iter().map(|&edge| of(edge).mean[0]).sum();
        case.number(format!("{} (other lengths)", mode.name), 0.0, other, 0.0);
    }
    case.close();
}

fn lamp() -> PunctualLight {
    PunctualLight {
        name: "lamp".into(),
        position: Vec3::new(0.0, 0.0, 2.0),
        direction: -UP,
        intensity: Vec3::ONE,
        kind: PunctualKind::Point,
        range_m: f32::INFINITY,
        profile: None,
    }
}

#[test]
fn l21_delta_lights() {
    let mut case = Case::open("L21", "delta lights", "points and directions, nothing counted twice");
    let punctual = |light: PunctualLight| {
        let scene = Scene { punctual: vec![light], ..Scene::default() };
        Lights::build(&scene, &Geometry::default()).expect("valid light")
    };
    // A spot is aimed so that the receiver is seen under the given angle to its axis; cone of 20° and 40°.
    let towards = |degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        DVec3::new(sin, 0.0, -cos).as_vec3()
    };
    let cos = |degrees: f64| degrees.to_radians().cos();
    let spot = |degrees: f64| {
        let kind = PunctualKind::Spot { cos_inner: cos(20.0) as f32, cos_outer: cos(40.0) as f32 };
        PunctualLight { direction: towards(degrees), kind, ..lamp() }
    };
    let sun = PunctualLight { direction: towards(60.0), kind: PunctualKind::Directional, ..lamp() };
    let ramp = (cos(30.0) - cos(40.0)) / (cos(20.0) - cos(40.0));
    let single = [
        (lamp(), ORIGIN, 0.25),
        (lamp(), Vec3::X, 0.1788854382),
        (sun.clone(), Vec3::X, 0.5),
        (spot(10.0), ORIGIN, 0.25),
        (spot(30.0), ORIGIN, 0.25 * ramp * ramp),
        (spot(41.0), ORIGIN, 0.0),
    ];
    let bound = 2f64.powi(-21);
    let mut not_delta = u64::from(punctual(lamp()).sample(lamp().position, UP, [0.5; 3]).is_some());
    let found = single.map(|(light, p, expected)| {
        let lights = punctual(light);
        not_delta += u64::from(lights.sample(p, UP, [0.5; 3]).is_some_and(|sample| !sample.delta));
        let moments = irradiance(&lights, p, UP, 2, 1);
        not_delta += u64::from(moments.m2 != 0.0);
        (expected, moments.mean, bound)
    });
    case.numbers("- (one sample)", found);
    case.count("- (samples that vary, or ask for a weight)", 0, not_delta);
    // All kinds together, whichever is chosen.
    let mut scene = Scene { materials: vec![material(1.0)], punctual: vec![lamp(), sun.clone()], ..Scene::default() };
    scene.punctual[1].direction = -UP;
    scene.environment = Some(environment(64, 32, |_| 1.0));
    let lights = Lights::build(&scene, &geometry(&square_light())).expect("valid lights");
    let sum: f64 = (0..4).map(|light| f64::from(lights.p_select(light, ORIGIN, UP))).sum();
    case.number("- (four kinds: sum of the probabilities)", 1.0, sum, 1e-6);
    let all = Estimate::of_moments(&irradiance(&lights, ORIGIN, UP, 1 << 22, 121));
    let mut means = Means::default();
    means.add("four kinds", 1.740839503 + 0.25 + 1.0 + PI, 6e-5, 5e-3, all);
    means.judge(&mut case, "-");

    // Under walls of radiance 1, which BSDF sampling finds. They would block a light at infinity: a sky stands for them
    // there.
    let walls = |b: &mut SceneBuilder, light: &PunctualLight| {
        if light.kind == PunctualKind::Directional {
            b.environment(Environment::constant(Vec3::ONE));
        } else {
            let wall = b.emitter(Vec3::ZERO, Vec3::ONE);
            b.cuboid(Vec3::splat(-10.0), Vec3::splat(10.0), true, wall);
        }
    };
    for mode in Mode::all() {
        let n = if mode.is_main() { 1 << 20 } else { 1 << 14 };
        let (mut means, mut exact) = (Means::default(), Vec::new());
        for (light, at, expected) in
            [(lamp(), ORIGIN, 0.25), (lamp(), Vec3::X, 0.1788854382), (sun.clone(), Vec3::X, 0.5)]
        {
            let add = |b: &mut SceneBuilder| {
                drop(b.punctual(light.position, light.direction, light.intensity, light.kind).clone())
            };
            let alone = Receiver::new(at, UP, &add).irradiance(256, with(&mode, Strategy::MIS, 21));
            exact.push((expected, alone.mean[0], bound));
            let both = |b: &mut SceneBuilder| {
                add(b);
                walls(b, &light);
            };
            for strategy in [Strategy::LIGHT, Strategy::MIS] {
                let estimate = Receiver::new(at, UP, &both).irradiance(n, with(&mode, strategy, 22));
                let expected = PI + expected;
                // Most light samples of a room all around are below the horizon.
                let band = delta(n) * if strategy == Strategy::LIGHT { 2.0 } else { 1.0 };
                means.add(format!("{:?} and walls, {strategy}", light.kind), expected, 1e-5 * expected, band, estimate);
            }
        }
        case.numbers(format!("{} (alone)", mode.name), exact);
        means.judge(&mut case, &mode.name);
    }
    case.close();
}
