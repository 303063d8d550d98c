//! Chi-square of the samplers of lights, of the lens and of the pixel filter against their densities (class T4 of
//! HARDCASES §1.3); those of the BSDFs are in `bsdf::chi2`. Accepted above p = 1e-6 each: 8 tests, false-alarm rate
//! below 1e-5 for the file; seeds fixed.

use glam::{Affine3A, DVec3, Vec3};
use pathspace::camera::CameraRays;
use pathspace::film::filter::{FilterKind, FilterTable};
use pathspace::plan::options::Lens;
use pathspace::scene::{Camera, Projection};
use pathspace_stat::{GaussLegendre, Pcg32, chi2_test};

use crate::meter::{environment, environment_lights, lights_of, map_direction, square_light};

const SAMPLES: usize = 1 << 18;
const ACCEPT: f64 = 1e-6;

fn accept(what: &str, observed: &[u64], expected: &[f64]) {
    let test = chi2_test(observed, expected);
    assert!(test.p_value > ACCEPT, "{what}: p = {:e}, {} impossible samples", test.p_value, test.impossible);
}

/// Points on the square light of two equal triangles are uniform over its 16×16 equal cells.
#[test]
fn points_on_an_area_light() {
    let lights = lights_of(&square_light());
    let mut random = Pcg32::new(1, 1);
    let mut observed = vec![0u64; 256];
    for _ in 0..SAMPLES {
        let sample = lights.sample(Vec3::new(0.3, -0.2, 0.0), Vec3::Z, random.array()).expect("the light is above");
        let p = sample.target.expect("at a finite distance").position;
        let cell = |x: f32| (((x + 1.0) * 8.0) as usize).min(15);
        observed[cell(p.y) * 16 + cell(p.x)] += 1;
    }
    accept("area light", &observed, &vec![SAMPLES as f64 / 256.0; 256]);
}

/// Directions to an uneven environment, with a sun, follow the density that the map reports: per cell of texels, by
/// Gauss–Legendre within each texel, where the density is smooth.
#[test]
fn directions_to_the_environment() {
    const W: usize = 32;
    const H: usize = 16;
    let sun = DVec3::new(0.5, 0.6, -0.4).normalize();
    let lights = environment_lights(environment(W, H, |d| {
        (0.2 + d.y.max(0.0) + if d.dot(sun) > 0.95 { 40.0 } else { 0.0 }) as f32
    }));
    let mut random = Pcg32::new(2, 1);
    let mut observed = vec![0u64; W * H];
    for _ in 0..SAMPLES {
        let wi = lights.sample(Vec3::ZERO, Vec3::Y, random.array()).expect("it is bright everywhere").wi;
        let u = 0.5 + f64::from(wi.x).atan2(-f64::from(wi.z)) / std::f64::consts::TAU;
        let v = f64::from(wi.y).clamp(-1.0, 1.0).acos() / std::f64::consts::PI;
        let cell = |x: f64, n: usize| ((x * n as f64) as usize).min(n - 1);
        observed[cell(v, H) * W + cell(u, W)] += 1;
    }
    let rule = GaussLegendre::new(6);
    let jacobian = std::f64::consts::TAU * std::f64::consts::PI;
    let expected: Vec<f64> = (0..W * H)
        .map(|i| {
            let (column, row) = ((i % W) as f64, (i / W) as f64);
            let (u, v) = ([column / W as f64, (column + 1.0) / W as f64], [row / H as f64, (row + 1.0) / H as f64]);
            SAMPLES as f64
                * rule.integrate_2d(u, v, &|u, v| {
                    let pdf = lights.pdf_environment(map_direction(u, v).as_vec3(), Vec3::ZERO, Vec3::Y);
                    f64::from(pdf) * (std::f64::consts::PI * v).sin() * jacobian
                })
        })
        .collect();
    accept("environment", &observed, &expected);
}

/// Origins of thin-lens rays are uniform over the aperture: 16 rings of equal area by 16 sectors.
#[test]
fn points_on_the_lens() {
    let camera = Camera {
        name: "lens".into(),
        world_from_camera: Affine3A::IDENTITY,
        projection: Projection::Perspective { yfov_rad: 0.8, aspect: None },
    };
    let lens = Lens { radius_m: 0.5, focus_m: 3.0 };
    let rays = CameraRays::new(&camera, (64, 64), Some(lens)).expect("a valid camera");
    let mut random = Pcg32::new(3, 1);
    let mut observed = vec![0u64; 256];
    for _ in 0..SAMPLES {
        let [a, b] = random.array();
        let (origin, _) = rays.ray(20.0, 40.0, [a, b]);
        let ring = ((origin.truncate().length_squared() / 0.25 * 16.0) as usize).min(15);
        let sector = ((origin.y.atan2(origin.x) / std::f32::consts::TAU + 0.5) * 16.0) as usize;
        observed[ring * 16 + sector.min(15)] += 1;
    }
    accept("lens", &observed, &vec![SAMPLES as f64 / 256.0; 256]);
}

/// Offsets drawn from each pixel filter follow its profile |h(x)|·|h(y)|, known here in closed form.
#[test]
fn offsets_of_the_pixel_filters() {
    let gaussian = |x: f64| (-2.0 * x * x).exp();
    let mitchell = |x: f64| {
        let x = x.abs();
        if x < 1.0 {
            (7.0 * x * x * x - 12.0 * x * x + 16.0 / 3.0) / 6.0
        } else if x < 2.0 {
            (-7.0 / 3.0 * x * x * x + 12.0 * x * x - 20.0 * x + 32.0 / 3.0) / 6.0
        } else {
            0.0
        }
    };
    let blackman_harris = |x: f64| {
        let t = std::f64::consts::TAU * (x / 3.0 + 0.5);
        0.35875 - 0.48829 * t.cos() + 0.14128 * (2.0 * t).cos() - 0.01168 * (3.0 * t).cos()
    };
    let cases: [(FilterKind, &dyn Fn(f64) -> f64); 5] = [
        (FilterKind::Box, &|_| 1.0),
        (FilterKind::Tent, &|x| 1.0 - x.abs()),
        (FilterKind::Gaussian, &gaussian),
        (FilterKind::BlackmanHarris, &blackman_harris),
        (FilterKind::Mitchell, &mitchell),
    ];
    const CELLS: usize = 16;
    let rule = GaussLegendre::new(8);
    for (kind, profile) in cases {
        let (table, radius) = (FilterTable::new(kind), f64::from(kind.radius()));
        let mut random = Pcg32::new(4, kind as u64);
        let mut observed = vec![0u64; CELLS * CELLS];
        for _ in 0..SAMPLES {
            let [u, v] = random.array();
            let sample = table.sample(u, v);
            let cell = |x: f32| (((f64::from(x) / radius + 1.0) * 0.5 * CELLS as f64) as usize).min(CELLS - 1);
            observed[cell(sample.dy) * CELLS + cell(sample.dx)] += 1;
        }
        let edge = |i: usize| (2.0 * i as f64 / CELLS as f64 - 1.0) * radius;
        let mass: Vec<f64> = (0..CELLS).map(|i| rule.integrate([edge(i), edge(i + 1)], |x| profile(x).abs())).collect();
        let total: f64 = mass.iter().sum();
        let expected: Vec<f64> =
            (0..CELLS * CELLS).map(|i| SAMPLES as f64 * mass[i % CELLS] * mass[i / CELLS] / (total * total)).collect();
        accept(&format!("{} filter", kind.name()), &observed, &expected);
    }
}
