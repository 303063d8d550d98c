//! Environments by light sampling alone: HARDCASES L13 and L14, the conventions of the shared scenes, and how well the
//! density follows the radiance. Statistics and false alarms as in `lights.rs`, whose meter measures here too.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use pathspace::math::table::Distribution2D;
use pathspace::scene::Environment;
use pathspace::shading::light::Lights;

use crate::meter::{Moments, Random, environment, environment_lights, irradiance, map_direction};

const ORIGIN: Vec3 = Vec3::ZERO;

#[test]
fn l13_analytic_environments() {
    let compass: Vec<DVec3> = (0..27)
        .map(|i| DVec3::new(f64::from(i % 3 - 1), f64::from(i / 3 % 3 - 1), f64::from(i / 9 - 1)))
        .filter(|d| *d != DVec3::ZERO)
        .map(DVec3::normalize)
        .collect();
    assert_eq!(compass.len(), 26);
    let mut seed = 1300;
    let mut check = |what: &str, lights: &Lights, n: DVec3, expected: f64| {
        seed += 1;
        irradiance(lights, ORIGIN, n.as_vec3(), 1 << 16, seed).expect(
            &format!("{what}, n = {n}"),
            expected,
            1e-4,
            1e-1,
        );
    };
    let uniform = environment_lights(environment(1024, 512, |_| 1.0));
    for &n in &compass {
        check("uniform", &uniform, n, PI);
    }
    for (i, &a) in compass.iter().enumerate().step_by(4) {
        let linear = environment_lights(environment(1024, 512, |w| (1.0 + w.dot(a)) as f32));
        let quadratic = environment_lights(environment(1024, 512, |w| w.dot(a).powi(2) as f32));
        for &n in compass.iter().skip(i % 3).step_by(3) {
            check(&format!("linear along {a}"), &linear, n, PI + 2.0 * PI / 3.0 * a.dot(n));
            check(&format!("quadratic along {a}"), &quadratic, n, PI / 4.0 * (1.0 + a.dot(n).powi(2)));
        }
    }
}

/// The sun in one texel, nearest lookup: the grid alone, with directions uniform per steradian within a texel.
#[test]
fn l14_one_texel_sun_nearest() {
    let (width, height) = (2048u32, 1024u32);
    let edge = |row: u32| (PI * f64::from(row) / f64::from(height)).cos();
    let solid_angle = |row: u32| (edge(row) - edge(row + 1)) * 2.0 * PI / f64::from(width);
    for (sun_row, expected) in [(0, 3.15603102), (1, 3.1849072), (64, 4.95590138), (256, 7.84775253)] {
        let radiance = |column: u32, row: u32| if (column, row) == (700, sun_row) { 1e6 } else { 1.0 };
        let grid = Distribution2D::new(width, height, |row, weights| {
            (0..).zip(weights).for_each(|(column, weight)| *weight = radiance(column, row) * solid_angle(row));
        })
        .expect("valid weights");
        let mut random = Random(u64::from(sun_row) + 114);
        let mut moments = Moments::default();
        for _ in 0..1 << 18 {
            let cell = grid.sample_cell(random.unit(), random.unit());
            let cos = edge(cell.row) + (edge(cell.row + 1) - edge(cell.row)) * f64::from(cell.within[1]);
            let pdf_sa = f64::from(cell.p) / solid_angle(cell.row);
            moments.add(radiance(cell.column, cell.row) * cos.max(0.0) / pdf_sa);
        }
        moments.expect(&format!("sun in row {sun_row}"), expected, 1e-4, 2e-2);
        assert!(moments.variance().sqrt() < 2.0 * moments.mean);
    }
}

/// The sun in one texel, as the renderer looks it up: bilinearly, and turned. The reference is the same integral by
/// Simpson's rule: over longitude the texel's tent integrates to one texel.
#[test]
fn l14_one_texel_sun_bilinear() {
    let (width, height) = (2048usize, 1024usize);
    for sun_row in [0usize, 1, 64, 256] {
        let mut texels = vec![Vec3::ONE; width * height];
        texels[sun_row * width] = Vec3::splat(1e6);
        let map = Environment { width, height, texels: texels.into(), rotation_rad: 0.7, intensity: 1.0 };
        let lights = environment_lights(map);

        // Between row centres; above the first one the lookup is clamped.
        let step = PI / height as f64;
        let centre = (sun_row as f64 + 0.5) * step;
        let tent = |theta: f64| if sun_row == 0 && theta < centre { 1.0 } else { 1.0 - (theta - centre).abs() / step };
        let simpson = |a: f64, b: f64| {
            let f = |theta: f64| tent(theta).max(0.0) * theta.cos() * theta.sin();
            let h = (b - a) / 64.0;
            (0..=64).map(|i| f(a + f64::from(i) * h) * [2.0, 4.0][i as usize % 2]).sum::<f64>() * h / 3.0
                - (f(a) + f(b)) * h / 3.0
        };
        let below = simpson(centre, centre + step);
        let expected = PI + (1e6 - 1.0) * (simpson((centre - step).max(0.0), centre) + below) * 2.0 * PI / width as f64;

        let moments = irradiance(&lights, ORIGIN, Vec3::Y, 1 << 18, 1140 + sun_row as u64);
        moments.expect(&format!("sun in row {sun_row}"), expected, 1e-4, 2e-2);
        assert!(moments.variance().sqrt() < 2.0 * moments.mean, "spread {}", moments.variance().sqrt() / moments.mean);

        // The density integrates to 1: it is constant in each texel.
        let mut integral = 0.0;
        for row in 0..height {
            let (upper, lower) = ((row as f64 * step).cos(), ((row + 1) as f64 * step).cos());
            let solid_angle = (upper - lower) * 2.0 * PI / width as f64;
            for column in 0..width {
                let turn = 0.7 / (2.0 * PI);
                let d = map_direction((column as f64 + 0.5) / width as f64 - turn, (row as f64 + 0.5) / height as f64);
                integral += f64::from(lights.pdf_environment(d.as_vec3(), ORIGIN, Vec3::Y)) * solid_angle;
            }
        }
        assert!((integral - 1.0).abs() < 1e-4, "row {sun_row}: {integral}");
    }
}

/// Exact up to rounding: a bright texel is found in the direction that the convention says, turned counter-clockwise
/// seen from above; both axes of the lookup are between texel centres and wrap around.
#[test]
fn environment_convention() {
    let (width, height) = (64, 32);
    let mut texels = vec![Vec3::ZERO; width * height];
    texels[10 * width] = Vec3::new(4.0, 8.0, 12.0);
    let texels: Arc<[Vec3]> = texels.into();
    for turn in [0.0, 0.25, -0.4, 7.125] {
        let rotation_rad = (2.0 * PI * turn) as f32;
        let map = Environment { width, height, texels: Arc::clone(&texels), rotation_rad, intensity: 0.5 };
        let lights = environment_lights(map);
        // Counter-clockwise from above: from −Z towards −X. The map's u runs the other way.
        let look = |column: f64, row: f64| {
            let d = map_direction(column / width as f64, row / height as f64);
            let (sin, cos) = (2.0 * PI * turn).sin_cos();
            let d = DVec3::new(d.x * cos + d.z * sin, d.y, -d.x * sin + d.z * cos);
            lights.environment_radiance(d.as_vec3()).x
        };
        let near = |found: f32, expected: f32| assert!((found - expected).abs() < 1e-4, "{found}, expected {expected}");
        near(look(0.5, 10.5), 2.0);
        near(look(0.0, 10.5), 1.0);
        near(look(63.75, 10.5), 0.5);
        near(look(1.0, 11.0), 0.5);
        near(look(2.0, 10.5), 0.0);
        near(look(0.5, 9.4), 0.0);
    }
}

/// What light sampling draws from the environment is what an escaping ray finds there: the same radiance, and the same
/// density except where rounding moves a direction across a texel's edge (it may in 2 of 10^4).
#[test]
fn environment_sample_agrees_with_lookup() {
    let mut map = environment(256, 128, |w| (1.0 + w.x) as f32 * if w.y > 0.99 { 1e4 } else { 1.0 });
    map.rotation_rad = 2.0;
    let lights = environment_lights(map);
    let mut random = Random(114);
    let (mut drawn, mut moved) = (0, 0);
    for _ in 0..1 << 18 {
        let sample = lights.sample(ORIGIN, Vec3::Y, [random.unit(), random.unit(), random.unit()]).expect("lit");
        let (found, pdf) = (lights.environment_radiance(sample.wi), lights.pdf_environment(sample.wi, ORIGIN, Vec3::Y));
        assert!((found - sample.radiance).abs().max_element() <= 2e-3 * found.x + 0.2, "{sample:?}, found {found}");
        assert!(pdf > 0.0);
        drawn += 1;
        moved += u32::from(pdf != sample.pdf_sa);
    }
    assert!(moved * 5000 < drawn, "{moved} of {drawn}");
}
