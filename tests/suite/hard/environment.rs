//! Light from an environment: analytic maps that show how directions are mapped, and a sun of 10⁶:1, also at the
//! pole.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use pathspace::math::frame::Frame;
use pathspace::math::table::Distribution2D;
use pathspace::math::warp::cosine_hemisphere;
use pathspace::plan::options::Strategy;
use pathspace::scene::Environment;
use pathspace::scene::builder::SceneBuilder;
use pathspace::shading::light::Lights;
use pathspace::shading::mis::power_weight;
use pathspace_stat::Moments;

use super::Case;
use super::modes::Mode;
use super::receiver::{Means, Receiver, delta, with};
use crate::common::Estimate;
use crate::meter::{Random, environment, environment_lights, irradiance, map_direction};

const ORIGIN: Vec3 = Vec3::ZERO;

/// The 26 directions to the faces, edges and corners of a cube.
fn compass() -> Vec<DVec3> {
    (0..27)
        .map(|i| DVec3::new(f64::from(i % 3 - 1), f64::from(i / 3 % 3 - 1), f64::from(i / 9 - 1)))
        .filter(|d| *d != DVec3::ZERO)
        .map(DVec3::normalize)
        .collect()
}

/// Irradiances of receivers facing each of `normals`, by one light sample and one BSDF sample each, the light samples
/// shared.
fn all_around(lights: &Lights, normals: &[DVec3], samples: u32, seed: u64) -> Vec<Moments> {
    let mut random = Random(seed);
    let frames: Vec<Frame> = normals.iter().map(|n| Frame::from_normal(n.as_vec3())).collect();
    let mut moments = vec![Moments::default(); normals.len()];
    for _ in 0..samples {
        let u = [random.unit(), random.unit(), random.unit()];
        let local = cosine_hemisphere([random.unit(), random.unit()]);
        let light = lights.sample(ORIGIN, Vec3::ZERO, u);
        for (frame, moments) in frames.iter().zip(&mut moments) {
            let by_light = light.as_ref().map_or(0.0, |light| {
                let cos = light.wi.dot(frame.n).max(0.0);
                light.radiance.x * cos * power_weight(light.pdf_sa, cos / PI as f32) / light.pdf_sa
            });
            let pdf = local.z / PI as f32;
            let seen = lights.environment_seen(frame.to_world(local), ORIGIN, Vec3::ZERO);
            let by_bsdf = seen.radiance.x * PI as f32 * power_weight(pdf, seen.pdf_sa);
            moments.push(f64::from(by_light) + f64::from(by_bsdf));
        }
    }
    moments
}

/// A map of 1024 × 512 texels and the irradiance that it should give.
struct Analytic {
    name: String,
    map: Environment,
    expected: Box<dyn Fn(DVec3) -> f64>,
}

fn linear(a: DVec3) -> Analytic {
    let map = environment(1024, 512, |w| (1.0 + w.dot(a)) as f32);
    Analytic { name: format!("linear along {a:.2}"), map, expected: Box::new(move |n| PI + 2.0 * PI / 3.0 * a.dot(n)) }
}

fn quadratic(a: DVec3) -> Analytic {
    let map = environment(1024, 512, |w| w.dot(a).powi(2) as f32);
    let expected = Box::new(move |n| PI / 4.0 * (1.0 + a.dot(n).powi(2)));
    Analytic { name: format!("quadratic along {a:.2}"), map, expected }
}

#[test]
fn l13_analytic() {
    let mut case = Case::open("L13", "analytic environments (1024×512 texels)", "orientation, mapping, poles");
    let compass = compass();
    let uniform =
        || Analytic { name: "uniform".into(), map: environment(1024, 512, |_| 1.0), expected: Box::new(|_| PI) };
    let constant = Analytic {
        name: "uniform, one texel".into(),
        map: Environment::constant(Vec3::ONE),
        expected: Box::new(|_| PI),
    };
    // All pairs of an axis and a normal, by the lights and the weights alone, at a sixteenth of the number of samples.
    let samples = 1 << 12;
    let maps = [uniform(), constant].into_iter();
    let maps = maps.chain(compass.iter().map(|&a| linear(a))).chain(compass.iter().map(|&a| quadratic(a)));
    let mut means = Means::default();
    for (i, Analytic { name, map, expected }) in maps.enumerate() {
        let lights = environment_lights(map);
        let found = all_around(&lights, &compass, samples, 1300 + i as u64);
        for (n, moments) in compass.iter().zip(&found) {
            let expected = expected(*n);
            let estimate = Estimate::of_moments(moments);
            means.add(format!("{name}, n = {n:.2}"), expected, 1e-4 * expected, delta(samples.into()), estimate);
        }
    }
    means.judge(&mut case, "-");
    // Traced: each axis with one normal.
    for mode in Mode::all() {
        let n = if mode.is_main() { 1 << 16 } else { 1 << 13 };
        let mut means = Means::default();
        for (i, &a) in compass.iter().enumerate().step_by(if mode.is_main() { 1 } else { 9 }) {
            let normal = compass[(7 * i + 3) % 26];
            let Analytic { name, map, expected } = if i % 2 == 0 { linear(a) } else { quadratic(a) };
            let sky = |b: &mut SceneBuilder| {
                b.environment(map.clone());
            };
            let receiver = Receiver::new(ORIGIN, normal.as_vec3(), &sky);
            let expected = expected(normal);
            let estimate = receiver.irradiance(n, with(&mode, Strategy::MIS, i as u64));
            means.add(format!("{name}, n = {normal:.2}"), expected, 1e-4 * expected, delta(n), estimate);
        }
        means.judge(&mut case, &mode.name);
    }
    case.close();
}

/// 2048 × 1024 texels of radiance 1, one of 10⁶.
const SKY: (u32, u32) = (2048, 1024);

/// cos θ of the upper edge of a row.
fn cos_edge(row: u32) -> f64 {
    (PI * f64::from(row) / f64::from(SKY.1)).cos()
}

fn texel_solid_angle(row: u32) -> f64 {
    (cos_edge(row) - cos_edge(row + 1)) * 2.0 * PI / f64::from(SKY.0)
}

/// The sun under the renderer's bilinear lookup, its column turned away from the seam.
fn sunny(sun_row: u32) -> Environment {
    let (width, height) = (SKY.0 as usize, SKY.1 as usize);
    let mut texels = vec![Vec3::ONE; width * height];
    texels[sun_row as usize * width] = Vec3::splat(1e6);
    Environment { width, height, texels: texels.into(), rotation_rad: 0.7, intensity: 1.0 }
}

/// Irradiance from above of [`sunny`], by Simpson's rule: over longitude the texel's tent integrates to one texel;
/// above the first row's centre the lookup is clamped.
fn sunny_irradiance(sun_row: u32) -> f64 {
    let step = PI / f64::from(SKY.1);
    let centre = (f64::from(sun_row) + 0.5) * step;
    let tent = |theta: f64| if sun_row == 0 && theta < centre { 1.0 } else { 1.0 - (theta - centre).abs() / step };
    let simpson = |a: f64, b: f64| {
        let f = |theta: f64| tent(theta).max(0.0) * theta.cos() * theta.sin();
        let h = (b - a) / 64.0;
        (0..=64).map(|i| f(a + f64::from(i) * h) * [2.0, 4.0][i as usize % 2]).sum::<f64>() * h / 3.0
            - (f(a) + f(b)) * h / 3.0
    };
    let sun = simpson((centre - step).max(0.0), centre) + simpson(centre, centre + step);
    PI + (1e6 - 1.0) * sun * 2.0 * PI / f64::from(SKY.0)
}

#[test]
fn l14_sun_in_one_texel() {
    let mut case = Case::open("L14", "sun of 10⁶:1 in an environment, also at the pole", "range of radiance, poles");
    let suns = [(0, 3.15603102), (1, 3.1849072), (64, 4.95590138), (256, 7.84775253)];

    // Constant per texel, as the specification has it: the renderer looks up bilinearly, so this is its grid alone,
    // with directions uniform per steradian within a texel. The spread below 2 is what the power rests on.
    let mut means = Means::default();
    let mut spreads: f64 = 0.0;
    for (sun_row, expected) in suns {
        let radiance = |column: u32, row: u32| if (column, row) == (700, sun_row) { 1e6 } else { 1.0 };
        let grid = Distribution2D::new(SKY.0, SKY.1, |row, weights| {
            let weight = |column: u32| radiance(column, row) * texel_solid_angle(row);
            (0..).zip(weights).for_each(|(column, cell)| *cell = weight(column));
        })
        .expect("valid weights");
        let mut random = Random(u64::from(sun_row) + 114);
        let mut moments = Moments::default();
        for _ in 0..1 << 18 {
            let cell = grid.sample_cell(random.unit(), random.unit());
            let (upper, lower) = (cos_edge(cell.row), cos_edge(cell.row + 1));
            let cos = upper + (lower - upper) * f64::from(cell.within[1]);
            let pdf_sa = f64::from(cell.p) / texel_solid_angle(cell.row);
            moments.push(radiance(cell.column, cell.row) * cos.max(0.0) / pdf_sa);
        }
        spreads = spreads.max(moments.variance().sqrt() / moments.mean);
        means.add(format!("row {sun_row}"), expected, 1e-4 * expected, 2e-2, Estimate::of_moments(&moments));
    }
    means.judge(&mut case, "- (nearest lookup, grid alone)");

    // As the renderer looks it up. The density has to integrate to 1: it is constant in each texel.
    let mut means = Means::default();
    let mut integrals = Vec::new();
    for (sun_row, _) in suns {
        let lights = environment_lights(sunny(sun_row));
        let moments = irradiance(&lights, ORIGIN, Vec3::Y, 1 << 18, 1140 + u64::from(sun_row));
        spreads = spreads.max(moments.variance().sqrt() / moments.mean);
        let expected = sunny_irradiance(sun_row);
        means.add(format!("row {sun_row}"), expected, 1e-4 * expected, 2e-2, Estimate::of_moments(&moments));
        let mut integral = 0.0;
        for i in 0..SKY.0 * SKY.1 {
            let (u, v) = (f64::from(i % SKY.0) + 0.5, f64::from(i / SKY.0) + 0.5);
            let d = map_direction(u / f64::from(SKY.0) - 0.7 / (2.0 * PI), v / f64::from(SKY.1)).as_vec3();
            integral += f64::from(lights.pdf_environment(d, ORIGIN, Vec3::Y)) * texel_solid_angle(i / SKY.0);
        }
        integrals.push((1.0, integral, 1e-4));
    }
    means.judge(&mut case, "- (bilinear lookup, light sampling)");
    case.numbers("- (integral of the density)", integrals);
    case.row("- (relative deviation of a sample)", "below 2", format!("{spreads:.3}"), "-", spreads < 2.0);

    // Traced: all suns where the count is full, the pole elsewhere.
    for mode in Mode::all() {
        let n = if mode.is_main() { 1 << 18 } else { 1 << 14 };
        let mut means = Means::default();
        for (sun_row, _) in suns.into_iter().take(if mode.is_main() { 4 } else { 1 }) {
            let map = sunny(sun_row);
            let sky = |b: &mut SceneBuilder| {
                b.environment(map.clone());
            };
            let (receiver, expected) = (Receiver::new(ORIGIN, Vec3::Y, &sky), sunny_irradiance(sun_row));
            for strategy in [Strategy::LIGHT, Strategy::MIS] {
                let estimate = receiver.irradiance(n, with(&mode, strategy, 14 + u64::from(sun_row)));
                // 4.9 standard errors of a relative deviation of 2.
                let delta = 2e-2 * ((1u64 << 18) as f64 / n as f64).sqrt();
                means.add(format!("row {sun_row}, {strategy}"), expected, 1e-4 * expected, delta, estimate);
            }
        }
        means.judge(&mut case, &mode.name);
    }
    case.close();
}
