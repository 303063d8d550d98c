//! Choosing among lights: a million of them over twelve decades, none, and one among a thousand that are black.

use glam::Vec3;
use pathspace::math::table::AliasTable;
use pathspace::plan::options::Strategy;
use pathspace::render::Renderer;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::geometry::Geometry;
use pathspace::scene::{Environment, Material, PunctualKind, PunctualLight, Scene};
use pathspace::shading::light::Lights;
use pathspace::shading::light::grow::Emitter;
use pathspace::shading::light::select::Selector;
use pathspace_stat::chi2_test;

use super::Case;
use super::modes::Mode;
use super::receiver::{Means, Receiver, STRATEGIES, delta, with};
use crate::common::{Estimate, options};
use crate::meter::{Random, environment, geometry, irradiance, material, square_light};

const ORIGIN: Vec3 = Vec3::ZERO;
const UP: Vec3 = Vec3::Z;
const MILLION: u32 = 1_000_000;

fn point_light(position: Vec3, intensity: f32) -> PunctualLight {
    let (name, direction, intensity) = ("lamp".into(), Vec3::ZERO, Vec3::splat(intensity));
    PunctualLight {
        name,
        position,
        direction,
        intensity,
        kind: PunctualKind::Point,
        range_m: f32::INFINITY,
        profile: None,
    }
}

/// Weight `i` of `n`: 10^-6 to 10^6.
fn decades(i: u32, n: u32) -> f64 {
    10f64.powf(-6.0 + 12.0 * f64::from(i) / f64::from(n - 1))
}

/// `n` lamps over twelve decades on a sphere of 2 m, and their irradiance at the origin.
fn lamps(n: u32) -> (Vec<PunctualLight>, f64) {
    let mut random = Random(112);
    let mut expected = 0.0;
    let lamps = (0..n).map(|i| {
        let (intensity, position) = (decades(i, n) as f32, 2.0 * random.direction());
        expected += f64::from(intensity) / 4.0 * f64::from(position.z.max(0.0)) / 2.0;
        point_light(position, intensity)
    });
    (lamps.collect(), expected)
}

#[test]
fn l12_a_million_lights() {
    let mut case = Case::open("L12", "a million lights with 12 decades of power", "sums of probabilities");
    // Lights in one place differ by power alone: then the tree has to give each its share.
    let weights: Vec<f64> = (0..MILLION).map(|i| decades(i, MILLION)).collect();
    let orders = [
        ("ascending", weights.clone()),
        ("descending", weights.iter().rev().copied().collect()),
        ("equal", vec![0.1; MILLION as usize]),
    ];
    for (order, weights) in orders {
        let emitter = |(light, &intensity): (u32, &f64)| Emitter {
            light,
            corners: [Vec3::Z; 4],
            axis: UP,
            spread: std::f64::consts::PI,
            reach: 0.0,
            intensity,
        };
        let emitters: Vec<Emitter> = (0..).zip(&weights).map(emitter).collect();
        let selector = Selector::new(emitters, &[], weights.len()).expect("valid lights");
        let total: f64 = weights.iter().sum();
        let p = |light: u32| f64::from(selector.p_select(light, ORIGIN, Vec3::ZERO));
        let (mut worst, mut never) = ((1.0, 1.0), 0);
        let bin = |light: u32| (12 * light as usize / MILLION as usize).min(11);
        let (mut observed, mut shares) = ([0u64; 12], [0.0; 12]);
        for (light, weight) in (0..).zip(&weights) {
            let (found, expected) = (p(light), weight / total);
            shares[bin(light)] += found;
            never += u64::from(found == 0.0);
            if (found / expected - 1.0).abs() > (worst.0 / worst.1 - 1.0_f64).abs() {
                worst = (found, expected);
            }
        }
        case.count(format!("- ({order}: lights never chosen)"), 0, never);
        case.number(format!("- ({order}: probability, worst of 10⁶)"), worst.1, worst.0, 1e-5);

        // Draws by decade of their weight, with numbers of 48 bits; most where sums of f32 fail.
        let draws = if order == "descending" { 2_000_000 } else { 100_000 };
        let mut random = Random(12);
        for _ in 0..draws {
            let u = f64::from(random.unit()) + f64::from(random.unit()) / (1u64 << 24) as f64;
            observed[bin(selector.select(ORIGIN, Vec3::ZERO, u).expect("a light").light)] += 1;
        }
        let test = chi2_test(&observed, &shares.map(|share| share * f64::from(draws)));
        let p_value = format!("{:.2e}", test.p_value);
        case.row(format!("- ({order}: {draws} draws)"), "p > 1e-6", p_value, "-", test.p_value > 1e-6);

        // The table that lights at infinity are drawn from says exactly what it does: every number that it can be given
        // is tried.
        const STEPS: u32 = 1 << 24;
        let table = AliasTable::new(&weights).expect("valid weights");
        let mut drawn = vec![0u32; weights.len()];
        (0..STEPS).for_each(|step| drawn[table.sample(step as f32 / STEPS as f32).index as usize] += 1);
        let differing = (0..).zip(&drawn).filter(|&(i, &n)| n == 0 || n as f32 / STEPS as f32 != table.p(i)).count();
        case.count(format!("- ({order}: cells of the alias table drawn otherwise than told)"), 0, differing as u64);
    }

    // The irradiance of a million lamps at one point, in both orders.
    let (punctual, expected) = lamps(MILLION);
    let mut scene = Scene { punctual, ..Scene::default() };
    let mut means = Means::default();
    for (order, seed) in [("ascending", 113), ("descending", 114)] {
        let lights = Lights::build(&scene, &Geometry::default()).expect("valid lights");
        let estimate = Estimate::of_moments(&irradiance(&lights, ORIGIN, UP, 1 << 18, seed));
        means.add(format!("irradiance, {order}"), expected, 1e-5 * expected, delta(1 << 18), estimate);
        scene.punctual.reverse();
    }
    means.judge(&mut case, "-");
    // Traced: ten thousand of them.
    let (punctual, expected) = lamps(10_000);
    let add = |b: &mut SceneBuilder| {
        for lamp in &punctual {
            b.point_light(lamp.position, lamp.intensity);
        }
    };
    for mode in Mode::all() {
        let n = if mode.is_main() { 1 << 18 } else { 1 << 14 };
        let receiver = Receiver::new(ORIGIN, UP, &add);
        let mut means = Means::default();
        let estimate = receiver.irradiance(n, with(&mode, Strategy::MIS, 12));
        means.add("10⁴ lamps", expected, 1e-5 * expected, delta(n), estimate);
        means.judge(&mut case, &mode.name);
    }
    case.close();
}

#[test]
fn l23_no_light() {
    let mut case = Case::open("L23", "no light, black lights, one of many black", "total power of 0");
    let sky = |radiance: f32| environment(8, 4, move |_| radiance);
    let black = |b: &mut SceneBuilder| {
        let lamp = b.emitter(Vec3::ZERO, Vec3::ZERO);
        b.quad([(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)].map(|(x, y)| Vec3::new(x, y, 1.0)), lamp);
        b.point_light(UP, Vec3::ZERO);
        b.environment(sky(0.0));
    };
    // (a), (b): the functions.
    let dark = Scene {
        materials: vec![material(0.0)],
        punctual: vec![point_light(UP, 0.0)],
        environment: Some(sky(0.0)),
        ..Scene::default()
    };
    let mut lit = 0;
    for (scene, geometry) in [(Scene::default(), Geometry::default()), (dark, geometry(&square_light()))] {
        let lights = Lights::build(&scene, &geometry).expect("valid lights");
        lit += u64::from(!lights.is_dark());
        lit += u64::from(lights.sample(ORIGIN, UP, [0.5; 3]).is_some());
        lit += u64::from(lights.environment_radiance(UP) != Vec3::ZERO);
        lit += u64::from(lights.pdf_environment(UP, ORIGIN, UP) != 0.0);
    }
    case.count("- (answers that are not 0)", 0, lit);
    // (c): a lamp of 10 cm, alone or as one of a thousand of which the others are black and out of the way.
    let triangle = |b: &mut SceneBuilder, at: Vec3, radiance: f32| {
        let lamp = b.emitter(Vec3::ZERO, Vec3::splat(radiance));
        b.triangles(vec![at, at + 0.1 * Vec3::X, at + 0.1 * Vec3::Z], vec![[0, 1, 2]], lamp);
    };
    let alone = |b: &mut SceneBuilder| triangle(b, Vec3::Z * 0.5, 1.0);
    let among = |b: &mut SceneBuilder| {
        for i in 0..1000 {
            let at = Vec3::new((i % 40) as f32 * 0.1 - 2.0, 3.0, (i / 40) as f32 * 0.1);
            if i == 700 { alone(b) } else { triangle(b, at, 0.0) }
        }
    };
    for mode in Mode::all() {
        let (mut lit, mut shadows) = (0, 0);
        for lights in [&(|_: &mut SceneBuilder| {}) as &dyn Fn(&mut SceneBuilder), &black] {
            for strategy in STRATEGIES {
                let render = Receiver::new(ORIGIN, UP, lights).render(1 << 10, with(&mode, strategy, 23));
                lit += render.film.pixels.iter().filter(|pixel| pixel.mean()[..3] != [0.0; 3]).count() as u64;
                shadows += render.counters.rays_shadow + render.counters.nonfinite;
            }
        }
        case.count(format!("{} (samples not 0)", mode.name), 0, lit);
        case.count(format!("{} (shadow rays)", mode.name), 0, shadows);
        let n = if mode.is_main() { 1 << 18 } else { 1 << 10 };
        // The lamp faces along -y. Only it is ever chosen, so that not even the random numbers differ.
        let values = [&alone as &dyn Fn(&mut SceneBuilder), &among].map(|lights| {
            let receiver = Receiver::new(Vec3::new(0.0, -0.5, 0.0), Vec3::new(0.0, 0.6, 0.8), lights);
            receiver.irradiance(n, with(&mode, Strategy::LIGHT, 23)).mean[0]
        });
        case.number(format!("{} (one of 1000)", mode.name), values[0], values[1], 1e-12);
    }
    // (d): refused by name, before anything is rendered.
    let mut unnamed = 0;
    for (scene, words) in bad_lights() {
        let text = Lights::build(&scene, &Geometry::default()).expect_err("refused").to_string();
        unnamed += words.iter().filter(|word| !text.contains(**word)).count() as u64;
        let mut scene = scene;
        let mut b = SceneBuilder::new();
        b.camera(UP, ORIGIN, Vec3::Y, 1.0);
        scene.cameras = b.build().cameras;
        unnamed += u64::from(Renderer::new(&scene, options(8, 8, 1)).is_ok());
    }
    case.count("- (bad lights that are not named, or rendered)", 0, unnamed);
    case.close();
}

/// Scenes with a light whose radiance is none, and the words that must name it.
fn bad_lights() -> Vec<(Scene, Vec<&'static str>)> {
    let mut scenes = Vec::new();
    for bad in [-1.0, f32::NAN, f32::INFINITY] {
        let mut lamp = point_light(UP, 1.0);
        lamp.intensity.y = bad;
        scenes.push((Scene { punctual: vec![lamp], ..Scene::default() }, vec!["\"lamp\"", "intensity"]));
        let mut panel = Material { name: "panel".into(), ..material(1.0) };
        panel.emissive.z = bad;
        let materials = vec![Material::default(), panel];
        scenes.push((Scene { materials, ..Scene::default() }, vec!["/materials/1", "\"panel\""]));
        let sky = environment(8, 4, |d| if d.y > 0.9 && d.x > 0.0 { bad } else { 1.0 });
        scenes.push((Scene { environment: Some(sky), ..Scene::default() }, vec!["environment: texel"]));
        let sky = Environment { intensity: bad, ..environment(8, 4, |_| 1.0) };
        scenes.push((Scene { environment: Some(sky), ..Scene::default() }, vec!["--env-intensity"]));
    }
    let lamp = PunctualLight { kind: PunctualKind::Directional, ..point_light(UP, 1.0) };
    scenes.push((Scene { punctual: vec![lamp], ..Scene::default() }, vec!["direction"]));
    scenes
}
