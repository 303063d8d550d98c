//! Lights by light sampling alone: HARDCASES §3.3, without visibility (environments: `environments.rs`). Receivers are points with a normal; the quantity
//! is the irradiance E = ∫ L cos⁺ dω. Means are tested at 4.9 standard errors (two-sided 1e-6 each, about 150 of them:
//! a change of random numbers fails by chance once in 7000 changes), and a mean counts only if it could see a bias of
//! `power`. Seeds are fixed. Tests that say "exact" have no false alarms.

use std::f64::consts::PI;

use glam::{DVec3, Vec2, Vec3};
use pathspace::scene::geometry::Geometry;
use pathspace::scene::{
    ColorSpace, Environment, Material, PunctualKind, PunctualLight, Scene, Texture, TextureId, TextureSlot, Wrap,
};
use pathspace::shading::light::area::{emitted, pdf_sa, square_to_triangle};
use pathspace::shading::light::{EmitterHit, Lights};
use pathspace::shading::mis::{balance_weight, power_weight};

use crate::meter::{Moments, Random, environment, geometry, irradiance, lights_of, material, rectangle, square_light};

const ORIGIN: Vec3 = Vec3::ZERO;
const UP: Vec3 = Vec3::Z;

#[test]
fn l01_rectangle() {
    let lights = lights_of(&square_light());
    let tilted = Vec3::new(1.0, 2.0, 2.0) / 3.0;
    let cases = [
        (ORIGIN, UP, 1.740839503),
        (Vec3::new(1.0, 0.0, 0.0), UP, 1.051648203),
        (Vec3::new(3.0, 0.0, 0.0), UP, 0.04960834601),
        (Vec3::new(3.0, 4.0, 0.0), UP, 0.006554121792),
        (ORIGIN, tilted, 1.165664387),
    ];
    for (i, (p, n, expected)) in cases.into_iter().enumerate() {
        irradiance(&lights, p, n, 1 << 20, 101 + i as u64).expect(&format!("receiver {p}, {n}"), expected, 1e-5, 5e-3);
    }
}

#[test]
fn l02_triangle() {
    let lights = lights_of(&[([Vec3::Z, Vec3::new(0.0, 1.0, 1.0), Vec3::new(1.0, 0.0, 1.0)], 0)]);
    irradiance(&lights, ORIGIN, UP, 1 << 20, 102).expect("triangle", 0.302299894, 1e-5, 5e-3);
}

/// Half of the samples are below the horizon, so the power needs twice the usual number.
#[test]
fn l03_cut_by_the_horizon() {
    let corner = Vec3::new(2.0, -1.0, -1.0);
    let lights = lights_of(&rectangle(corner, Vec3::new(0.0, 0.0, 2.0), Vec3::new(0.0, 2.0, 0.0), 0));
    irradiance(&lights, ORIGIN, UP, 1 << 21, 103).expect("vertical square", 0.08751026477, 1e-5, 5e-3);
}

/// Exact: a light in the receiver's plane, 2^-126 above it, or on the receiver itself gives nothing and no NaN.
#[test]
fn l09_coplanar() {
    for height in [0.0, f32::MIN_POSITIVE] {
        let corner = Vec3::new(1.0, -0.5, height);
        let lights = lights_of(&rectangle(corner, Vec3::X, Vec3::Y, 0));
        let mut random = Random(109);
        for _ in 0..1 << 16 {
            let u = [random.unit(), random.unit(), random.unit()];
            assert_eq!(lights.sample(ORIGIN, UP, u), None);
        }
        assert_eq!(lights.sample(corner, UP, [0.0; 3]), None);
    }
}

#[test]
fn l10_triangles_without_area() {
    let mut triangles = square_light();
    triangles.extend((0..1000).map(|i| ([Vec3::splat(i as f32), Vec3::splat(i as f32), Vec3::ONE], 0)));
    let lights = lights_of(&triangles);
    // The halves of the square are one light.
    let p_select: Vec<f32> = (0..1001).map(|light| lights.p_select(light, ORIGIN, UP)).collect();
    assert_eq!(p_select[0], 1.0);
    assert!(p_select[1..].iter().all(|&p| p == 0.0));
    irradiance(&lights, ORIGIN, UP, 1 << 20, 110).expect("square", 1.740839503, 1e-5, 5e-3);
}

/// A million point lights over twelve decades, in both orders: every one above the receiver's horizon can be chosen, the probabilities add up to 1 up to their rounding to f32, and the estimate agrees with the sum.
#[test]
fn l12_a_million_lights() {
    let n = 1_000_000;
    let mut random = Random(112);
    let mut scene = Scene::default();
    let mut expected = 0.0;
    for i in 0..n {
        let intensity = 10f64.powf(-6.0 + 12.0 * f64::from(i) / f64::from(n - 1)) as f32;
        let position = 2.0 * random.direction();
        expected += f64::from(intensity) / 4.0 * f64::from(position.z.max(0.0)) / 2.0;
        scene.punctual.push(point_light(position, intensity));
    }
    for order in 0..2 {
        let lights = Lights::build(&scene, &Geometry::default()).expect("valid lights");
        let mut sum = 0.0;
        for light in 0..n as u32 {
            let p = lights.p_select(light, ORIGIN, UP);
            assert!(p > 0.0 || scene.punctual[light as usize].position.z <= 0.0, "light {light}");
            sum += f64::from(p);
        }
        assert!((sum - 1.0).abs() < 1e-6, "the probabilities add up to {sum}");
        irradiance(&lights, ORIGIN, UP, 1 << 18, 113 + order).expect("a million lights", expected, 1e-5, 2e-2);
        scene.punctual.reverse();
    }
}

/// Lambert disc as a fan of 1024 triangles: light sampling, cosine sampling and both combined have one mean and each its
/// known variance, which sees swapped weights and wrong densities that leave the mean alone. Variances within 4.9
/// standard errors (kurtosis below 8 in all four) and the fan's deficit of area.
#[test]
fn l16_one_value_and_known_variances() {
    let ring = |i: u32| {
        let angle = 2.0 * PI * f64::from(i % 1024) / 1024.0;
        DVec3::new(angle.cos(), angle.sin(), 1.0).as_vec3()
    };
    let lights = lights_of(&(0..1024).map(|i| ([Vec3::Z, ring(i + 1), ring(i)], 0)).collect::<Vec<_>>());
    let area_m2 = (PI / 1024.0) as f32;
    let reflectance = 0.5;

    let mut random = Random(116);
    let mut moments: [Moments; 4] = Default::default();
    let samples = 1 << 20;
    for _ in 0..samples {
        let light = lights.sample(ORIGIN, UP, [random.unit(), random.unit(), random.unit()]).expect("lit");
        let cos = light.wi.z;
        let pdf_cosine = cos / PI as f32;
        let by_light = reflectance * f64::from(pdf_cosine / light.pdf_sa);

        // A cosine-distributed direction meets the disc below 45°.
        let cos2 = 1.0 - f64::from(random.unit());
        let cos_hit = cos2.sqrt() as f32;
        // Every triangle of the fan is as probable, but for rounding; 7 stands for the one that is hit.
        let hit = EmitterHit { light: 7, distance_m: 1.0 / cos_hit, cos_light: cos_hit, area_m2 };
        let pdf_light = lights.pdf_triangle(ORIGIN, UP, &hit);
        let by_cosine = if cos2 > 0.5 { reflectance } else { 0.0 };

        let combine = |weight: fn(f32, f32) -> f32| {
            by_light * f64::from(weight(light.pdf_sa, pdf_cosine))
                + by_cosine * f64::from(weight(cos_hit / PI as f32, pdf_light))
        };
        let values = [by_cosine, by_light, combine(balance_weight), combine(power_weight)];
        for (moments, value) in moments.iter_mut().zip(values) {
            moments.add(value);
        }
    }
    let expected = [("cosine", 0.0625), ("light", 1.0 / 96.0), ("balance", 0.01073829037), ("power", 0.008048958126)];
    for (moments, (name, variance)) in moments.iter().zip(expected) {
        moments.expect(name, 0.25, 2e-5, 6e-3);
        let tolerance = 4.9 * (7.0 / f64::from(samples)).sqrt() + 2e-5;
        assert!((moments.variance() / variance - 1.0).abs() < tolerance, "{name}: variance {}", moments.variance());
    }
}

/// Exact identity, in f32 within 8 roundoffs: f L G / p_A against f L cos / p_ω.
#[test]
fn l17_area_form_equals_solid_angle_form() {
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
    assert!(worst <= 8.0 / 16_777_216.0, "worst relative difference {worst:e}");
}

/// Exact: the back of an emitter is black however it is found, and what light sampling draws has the density that
/// emission MIS asks for.
#[test]
fn l20_one_sided_and_consistent() {
    let mut geometry = geometry(&square_light());
    let scene = Scene { materials: vec![material(1.0)], ..Scene::default() };
    let lights = Lights::build(&scene, &geometry).expect("valid lights");
    lights.assign(&mut geometry);
    assert_eq!(geometry.triangles.iter().map(|t| t.light).collect::<Vec<_>>(), [0, 0]);
    assert_eq!((lights.counts().triangles, lights.area_m2(0)), (1, 4.0));

    let above = Vec3::new(0.0, 0.0, 2.0);
    assert_eq!(irradiance(&lights, above, -UP, 1 << 12, 120).mean, 0.0);
    assert_eq!(emitted(Vec3::ONE, -0.5), Vec3::ZERO);
    assert_eq!(emitted(Vec3::ONE, 0.5), Vec3::ONE);

    let mut random = Random(121);
    for _ in 0..1 << 16 {
        let p = Vec3::new(random.unit() * 4.0, random.unit() * 4.0, -random.unit());
        let u = [random.unit(), random.unit(), random.unit()];
        let sample = lights.sample(p, UP, u).expect("in front");
        let point = sample.target.expect("finite");
        assert!((point.position.z - 1.0).abs() <= point.error && point.normal == -UP);
        assert!(point.position.x.abs() <= 1.0 && point.position.y.abs() <= 1.0);
        let distance_m = (point.position - p).length();
        let hit = EmitterHit { light: 0, distance_m, cos_light: sample.wi.z, area_m2: 4.0 };
        assert!((lights.pdf_triangle(p, UP, &hit) / sample.pdf_sa - 1.0).abs() < 1e-6);
        assert_eq!(lights.pdf_triangle(p, UP, &EmitterHit { cos_light: -sample.wi.z, ..hit }), 0.0);
    }
}

/// Exact: which pairs of triangles are one light, and that its points are those of the two. Halves in any order of their
/// corners, placed and rounded; not halves of a kite, of a bent sheet, nor back to back, nor of two materials.
#[test]
fn parallelograms_are_found() {
    let mut random = Random(120);
    for i in 0..1000 {
        let origin = random.direction() * random.log_uniform(0.1, 1000.0) as f32;
        let (e1, e2) = (random.direction(), random.direction() * random.log_uniform(0.1, 10.0) as f32);
        let [a, b, c, d] = [origin, origin + e1, origin + e1 + e2, origin + e2];
        let turned = |[a, b, c]: [Vec3; 3], by: usize| [[a, b, c], [b, c, a], [c, a, b]][by % 3];
        let lights_of_two = |other: [Vec3; 3], material: u32| {
            let scene = Scene { materials: vec![self::material(1.0), self::material(1.0)], ..Scene::default() };
            let mut geometry = geometry(&[(turned([a, b, c], i), 0), (turned(other, i / 3), material)]);
            let lights = Lights::build(&scene, &geometry).expect("valid lights");
            lights.assign(&mut geometry);
            (lights, geometry)
        };
        let (whole, geometry) = lights_of_two([a, c, d], 0);
        assert_eq!(whole.counts().triangles, 1, "{a} {b} {c} {d}");
        let area: f32 = geometry.triangles.iter().map(|t| t.area()).sum();
        assert!((whole.area_m2(0) / area - 1.0).abs() < 1e-3 && geometry.triangles.iter().all(|t| t.light == 0));
        let n_g = Vec3::from(geometry.triangles[0].n_g);
        for _ in 0..8 {
            let p = a + n_g + random.direction() * 0.5;
            let u = [random.unit(), random.unit(), random.unit()];
            let point = whole.sample(p, Vec3::ZERO, u).and_then(|sample| sample.target).expect("in front");
            let expected = a + e1 * u[1] + e2 * u[2];
            // Corners of one piece, starting from either of two: the same parallelogram, other axes.
            let inside = [e1, e2].map(|e| (point.position - a).dot(e.cross(n_g)).abs());
            assert!(inside[0] <= e2.cross(e1).length() * 1.001 && inside[1] <= e1.cross(e2).length() * 1.001);
            assert!((point.position - expected).dot(n_g).abs() <= point.error, "{point:?}");
        }
        let bent = n_g * 0.01;
        for (other, material) in
            [([a, c, d + e1 * 0.01], 0), ([a, c, d + bent], 0), ([a, d, c], 0), ([a, c, d], 1), ([b, c, d + e1], 0)]
        {
            assert_eq!(lights_of_two(other, material).0.counts().triangles, 2, "{other:?}");
        }
    }
}

fn point_light(position: Vec3, intensity: f32) -> PunctualLight {
    PunctualLight {
        name: "lamp".into(),
        position,
        direction: Vec3::ZERO,
        intensity: Vec3::splat(intensity),
        kind: PunctualKind::Point,
    }
}

fn punctual(light: PunctualLight) -> Lights {
    let scene = Scene { punctual: vec![light], ..Scene::default() };
    Lights::build(&scene, &Geometry::default()).expect("valid light")
}

/// Exact: one sample of one delta light is the answer.
#[test]
fn l21_delta_lights() {
    let point = point_light(Vec3::new(0.0, 0.0, 2.0), 1.0);
    let (sin, cos) = (PI / 3.0).sin_cos();
    let sun = PunctualLight {
        direction: DVec3::new(sin, 0.0, -cos).as_vec3(),
        kind: PunctualKind::Directional,
        ..point.clone()
    };
    let spot = |degrees: f64| {
        // Aimed so that the receiver is seen under the given angle to the axis; cone of 20° and 40°.
        let (sin, cos) = degrees.to_radians().sin_cos();
        PunctualLight {
            direction: DVec3::new(sin, 0.0, -cos).as_vec3(),
            kind: PunctualKind::Spot {
                cos_inner: 20f64.to_radians().cos() as f32,
                cos_outer: 40f64.to_radians().cos() as f32,
            },
            ..point.clone()
        }
    };
    let degrees = |x: f64| x.to_radians().cos();
    let ramp = (degrees(30.0) - degrees(40.0)) / (degrees(20.0) - degrees(40.0));
    let cases = [
        (point.clone(), ORIGIN, 0.25),
        (point.clone(), Vec3::X, 0.1788854382),
        (sun, Vec3::X, 0.5),
        (spot(10.0), ORIGIN, 0.25),
        (spot(30.0), ORIGIN, 0.25 * ramp * ramp),
        (spot(41.0), ORIGIN, 0.0),
    ];
    for (light, p, expected) in cases {
        let what = format!("{light:?}");
        let lights = punctual(light);
        let moments = irradiance(&lights, p, UP, 2, 1);
        assert_eq!(moments.m2, 0.0);
        assert!((moments.mean - expected).abs() <= expected * 2f64.powi(-21), "{what}: {}", moments.mean);
        assert!(lights.sample(p, UP, [0.5; 3]).is_none_or(|sample| sample.delta));
    }
    // At the light itself there is no direction.
    assert_eq!(punctual(point.clone()).sample(point.position, UP, [0.5; 3]), None);
}

/// Kinds together: the estimate is the sum of all, whichever is chosen; a spot's power is the integral of its ramp.
#[test]
fn l21_mixed_kinds_add_up() {
    let lamp = point_light(Vec3::new(0.0, 0.0, 2.0), 1.0);
    let sun = PunctualLight { direction: -Vec3::Z, kind: PunctualKind::Directional, ..lamp.clone() };
    let mut scene = Scene { materials: vec![material(1.0)], punctual: vec![lamp, sun], ..Scene::default() };
    scene.environment = Some(environment(64, 32, |_| 1.0));
    let lights = Lights::build(&scene, &geometry(&square_light())).expect("valid lights");
    let sum: f32 = (0..4).map(|light| lights.p_select(light, ORIGIN, UP)).sum();
    assert!((sum - 1.0).abs() < 1e-6);
    irradiance(&lights, ORIGIN, UP, 1 << 20, 121).expect("four kinds", 1.740839503 + 0.25 + 1.0 + PI, 1e-5, 1e-2);
}

#[test]
fn l23_black_lights() {
    // (a) nothing, (b) only black: exact.
    let black = Scene {
        materials: vec![material(0.0)],
        punctual: vec![point_light(Vec3::Z, 0.0)],
        environment: Some(environment(8, 4, |_| 0.0)),
        ..Scene::default()
    };
    for (scene, geometry) in [(Scene::default(), Geometry::default()), (black, geometry(&square_light()))] {
        let lights = Lights::build(&scene, &geometry).expect("valid lights");
        assert!(lights.is_dark());
        assert_eq!(lights.sample(ORIGIN, UP, [0.5; 3]), None);
        assert_eq!(lights.environment_radiance(UP), Vec3::ZERO);
        assert_eq!(lights.pdf_environment(UP, ORIGIN, UP), 0.0);
    }
    // (c) one of a thousand: exact, since only that one is ever chosen.
    let mut scene = Scene { punctual: vec![point_light(Vec3::Z * 2.0, 0.0); 1000], ..Scene::default() };
    scene.punctual[700].intensity = Vec3::ONE;
    let lights = Lights::build(&scene, &Geometry::default()).expect("valid lights");
    assert_eq!(irradiance(&lights, ORIGIN, UP, 1000, 123).mean, 0.25);
}

/// L23 (d): a radiance that is none is refused by the name of its light.
#[test]
fn l23_bad_lights_are_named() {
    let build = |scene: &Scene| Lights::build(scene, &Geometry::default()).expect_err("refused").to_string();
    for bad in [-1.0, f32::NAN, f32::INFINITY] {
        let mut lamp = point_light(Vec3::Z, 1.0);
        lamp.intensity.y = bad;
        let text = build(&Scene { punctual: vec![lamp], ..Scene::default() });
        assert!(text.contains("\"lamp\"") && text.contains("intensity"), "{text}");

        let mut panel = Material { name: "panel".into(), ..material(1.0) };
        panel.emissive.z = bad;
        let text = build(&Scene { materials: vec![Material::default(), panel], ..Scene::default() });
        assert!(text.contains("/materials/1") && text.contains("\"panel\""), "{text}");

        let sky = environment(8, 4, |d| if d.y > 0.9 && d.x > 0.0 { bad } else { 1.0 });
        let text = build(&Scene { environment: Some(sky), ..Scene::default() });
        assert!(text.contains("environment: texel"), "{text}");
        let sky = Environment { intensity: bad, ..environment(8, 4, |_| 1.0) };
        let text = build(&Scene { environment: Some(sky), ..Scene::default() });
        assert!(text.contains("--env-intensity"), "{text}");
    }
    let lamp = PunctualLight { kind: PunctualKind::Directional, ..point_light(Vec3::Z, 1.0) };
    assert!(build(&Scene { punctual: vec![lamp], ..Scene::default() }).contains("direction"));
}

/// Emission by texture: black texels are drawn too, a wholly black texture is no light, and the point to look up is
/// the point that was drawn.
#[test]
fn textured_emission_leaves_the_lookup_to_the_caller() {
    let texture = |texels: &[[u8; 4]]| Texture {
        name: "glow".into(),
        width: texels.len(),
        height: 1,
        texels: texels.into(),
        color_space: ColorSpace::Srgb,
        wrap_u: Wrap::Repeat,
        wrap_v: Wrap::Repeat,
        bilinear: true,
    };
    let slot = Some(TextureSlot { texture: TextureId(0), uv_set: 0 });
    let scene = |texels: &[[u8; 4]]| Scene {
        materials: vec![Material { emissive_texture: slot, ..material(2.0) }],
        textures: vec![texture(texels)],
        ..Scene::default()
    };
    let square = geometry(&square_light());
    let dark = Lights::build(&scene(&[[0, 0, 0, 255]]), &square).expect("valid lights");
    assert!(dark.is_dark() && dark.counts().triangles == 0);

    let lights = Lights::build(&scene(&[[0, 0, 0, 255], [0, 0, 1, 255]]), &square).expect("valid lights");
    let sample = lights.sample(ORIGIN, UP, [0.75, 0.3, 0.6]).expect("lit");
    let point = sample.texture_point.expect("textured");
    let triangle = &square.triangles[point.triangle as usize];
    let [u, v] = point.barycentric;
    let position = Vec3::from(triangle.v0) + (u * Vec3::from(triangle.e1) + v * Vec3::from(triangle.e2));
    assert_eq!((sample.radiance, point.triangle), (Vec3::splat(2.0), 1));
    assert_eq!(position, sample.target.expect("finite").position);
}

/// Exact in every grid cell: the map from the square to the triangle keeps areas (256² midpoints against the triangle's
/// 16² grid, 128 a cell, half of that on the hypotenuse) and never leaves the triangle.
#[test]
fn square_to_triangle_keeps_areas() {
    let mut counts = [[0u32; 16]; 16];
    for i in 0..256 * 256 {
        let uv = [((i % 256) as f32 + 0.5) / 256.0, ((i / 256) as f32 + 0.5) / 256.0];
        let [b1, b2] = square_to_triangle(uv);
        assert!(b1 >= 0.0 && b2 >= 0.0 && b1 + b2 <= 1.0);
        counts[(b1 * 16.0) as usize][(b2 * 16.0) as usize] += 1;
    }
    // 65536 points on half a unit of area: 512 a full cell; sheared lattice lines shift a cell's count by its boundary.
    for (i, row) in counts.iter().enumerate() {
        for (j, &count) in row.iter().enumerate() {
            let expected = [512, 256, 0][(i + j).saturating_sub(14).min(2)];
            assert!(count.abs_diff(expected) <= 32, "cell {i}, {j}: {count}, expected {expected}");
        }
    }
    let corner = Vec2::from(square_to_triangle([1.0 - f32::EPSILON / 2.0; 2]));
    assert!(corner.element_sum() <= 1.0);
}
