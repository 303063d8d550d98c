//! Cameras as measuring instruments (HARDCASES M03–M05, M07). A pixel of the product is plain radiance, so irradiance
//! on a sensor (M03, M04) is not what a picture shows; what can be held to it is the aperture: the integral over the
//! lens by the rays that it gives.

use std::f64::consts::PI;

use glam::{Affine3A, DVec2, DVec3, Vec3};
use pathspace::camera::{CameraRays, Lens};
use pathspace::plan::options::{Crop, SamplerKind};
use pathspace::sampler::{Scheme, SobolScheme};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Camera, Projection, Scene};
use pathspace_stat::{Moments, Pcg32, chi2_test};

use super::Case;
use super::modes::Mode;
use crate::common::{Estimate, options, render};

fn perspective(yfov: f64) -> Camera {
    let projection = Projection::Perspective { yfov_rad: yfov as f32, aspect: None };
    Camera { name: "test".into(), world_from_camera: Affine3A::IDENTITY, projection }
}

/// A camera of 50 mm at f-number `n`, focused at infinity.
fn fifty_mm(n: f64) -> CameraRays {
    let lens = Lens { radius_m: (0.025 / n) as f32, focus_m: f32::INFINITY };
    CameraRays::new(&perspective(0.5), (64, 64), Some(lens)).expect("a valid camera")
}

/// Irradiance over radiance at a sensor point `offset` m beside the axis and 50 mm behind the lens: ∫ cos⁴/f² over
/// the aperture, by the origins of the camera's rays, which are uniform over it.
fn irradiance(n: f64, offset: f64, seed: u64) -> Moments {
    let (rays, area) = (fifty_mm(n), PI * (0.025 / n).powi(2));
    let mut rng = Pcg32::new(seed, 3);
    let mut moments = Moments::default();
    moments.extend((0..1 << 18).map(|_| {
        let (p, _) = rays.ray(32.0, 32.0, rng.array());
        let across = (DVec2::new(f64::from(p.x), f64::from(p.y)) - DVec2::new(offset, 0.0)).length_squared();
        // cos² = f²/(f² + r²): E = A · cos⁴/f².
        let cos2 = 0.0025 / (0.0025 + across);
        area * cos2 * cos2 / 0.0025
    }));
    moments
}

#[test]
fn m03_exposure_against_f_number() {
    let mut case = Case::open("M03", "Exposure against f-number", "aperture integral");
    let table = [
        (1.4, 0.3553837843),
        (2.0, 0.1847995679),
        (2.8, 0.09708259127),
        (4.0, 0.04833219467),
        (8.0, 0.01222409593),
        (16.0, 0.003064968443),
    ];
    for (k, (n, expected)) in table.into_iter().enumerate() {
        let estimate = Estimate::of_moments(&irradiance(n, 0.0, k as u64));
        case.mean(format!("f/{n}"), [expected; 3], 1e-6, 5e-3, &estimate);
    }
    let ratio = irradiance(2.0, 0.0, 9).mean / irradiance(4.0, 0.0, 10).mean;
    case.number("f/2 : f/4", 65.0 / 17.0, ratio, 1e-3);
    // And what a picture shows: radiance, whatever the f-number.
    let mut b = SceneBuilder::new();
    let light = b.emitter(Vec3::ZERO, Vec3::ONE);
    b.sphere(Vec3::ZERO, 5.0, 8, true, false, light);
    b.camera(Vec3::ZERO, -Vec3::Z, Vec3::Y, 0.5);
    let scene = b.build();
    for mode in Mode::all() {
        for n in [2.0, 16.0] {
            let lens = Some(Lens { radius_m: 0.025 / n, focus_m: 2.0 });
            let film = render(&scene, mode.options(options(8, 8, 4).lens(lens))).film;
            let pixels = film.pixels.iter().map(|p| (1.0, p.mean()[1], 0.5_f64.powi(20)));
            case.numbers(format!("{}, f/{n}, radiance 1 is shown as 1", mode.name), pixels);
        }
    }
    case.close();
}

#[test]
fn m04_off_axis_falloff() {
    let mut case = Case::open("M04", "Off-axis falloff", "cos⁴ with a finite aperture");
    let on_axis = 0.1847995679;
    for (k, (mm, share)) in
        [(0.0, 1.0), (10.0, 0.9325256321), (18.0, 0.8030360757), (21.6, 0.7336004541)].into_iter().enumerate()
    {
        let estimate = Estimate::of_moments(&irradiance(2.0, mm * 1e-3, 20 + k as u64));
        case.mean(format!("{mm} mm"), [share * on_axis; 3], 1e-6, 5e-3, &estimate);
    }
    case.close();
}

/// Film position, pixels from the middle, at which a point at distance `o` on the axis is seen through one point of the
/// lens: the film maps linearly to the plane of the point.
fn seen_at(rays: &CameraRays, middle: f32, o: f64, lens_uv: [f32; 2]) -> DVec2 {
    let hit = |x: f32, y: f32| {
        let (origin, dir) = rays.lens_ray(middle + x, middle + y, lens_uv);
        let (origin, dir) = (origin.as_dvec3(), dir.as_dvec3());
        let p = origin + dir * ((-o - origin.z) / dir.z);
        DVec2::new(p.x, p.y)
    };
    let step = 256.0;
    let (p, px, py) = (hit(0.0, 0.0), hit(step, 0.0), hit(0.0, step));
    DVec2::new(-p.x / (px.x - p.x), -p.y / (py.y - p.y)) * f64::from(step)
}

/// f = 50 mm at f/2 focused at 2 m, on 24 mm of film. A point is as small as the specification's emitter; what the
/// pixels show of a larger one through the lens has the same sum as without, which the renders are held to.
#[test]
fn m05_circle_of_confusion() {
    let mut case = Case::open("M05", "Circle of confusion", "defocus geometry");
    let (focal, focus, film_height) = (0.05f64, 2.0f64, 0.024f64);
    let film_distance = focal * focus / (focus - focal);
    let yfov = 2.0 * (0.5 * film_height / film_distance).atan();
    let lens = Lens { radius_m: 0.0125, focus_m: focus as f32 };
    let rays = CameraRays::new(&perspective(yfov), (1024, 1024), Some(lens)).expect("a valid camera");
    let mm_per_pixel = film_height * 1e3 / 1024.0;
    let table = [(1.0, 0.64102564), (1.5, 0.21367521), (2.0, 0.0), (4.0, 0.32051282), (1e9, 0.64102564)];
    for (k, (o, diameter)) in table.into_iter().enumerate() {
        let mut rng = Pcg32::new(k as u64, 5);
        let (mut square, mut largest, mut cells) = (Moments::default(), 0.0f64, [0u64; 256]);
        let mut centre = [Moments::default(); 2];
        for _ in 0..1 << 20 {
            let p = seen_at(&rays, 512.0, o, rng.array()) * mm_per_pixel;
            square.push(p.length_squared());
            centre[0].push(p.x);
            centre[1].push(p.y);
            largest = largest.max(p.length());
            let ring = (p.length_squared() / (0.25 * diameter * diameter) * 16.0) as usize;
            let sector = ((p.y.atan2(p.x) / std::f64::consts::TAU + 0.5) * 16.0) as usize;
            cells[ring.min(15) * 16 + sector.min(15)] += 1;
        }
        if diameter == 0.0 {
            // In focus everything meets within rounding: 2⁻²³ of the 24 mm of film and the step's division.
            case.number(format!("{o} m, largest radius, mm"), 0.0, largest, 2e-5);
            continue;
        }
        case.number(format!("{o} m, diameter, mm"), diameter, 2.0 * largest, 1e-3);
        // Mean square radius D²/8; 1e-3 of the diameter is 2e-3 of it.
        let expected = diameter * diameter / 8.0;
        let on = format!("{o} m, mean square radius, mm²");
        case.mean(on, [expected; 3], 2e-3 * expected, 5e-3, &Estimate::of_moments(&square));
        let z = centre.iter().map(|m| m.z(0.0, 1e-3 * diameter)).fold(0.0, f64::max);
        case.row(format!("{o} m, centre"), "0", "0", format!("{z:.2} σ"), z <= 4.9);
        let p = chi2_test(&cells, &[(1 << 20) as f64 / 256.0; 256]).p_value;
        case.row(format!("{o} m, 16 rings × 16 sectors"), "p > 1e-6", format!("{p:.1e}"), "-", p > 1e-6);
    }
    // A square emitter of 40 mm a metre of distance fills the same part of the view at any defocus.
    for o in [1.0, 4.0] {
        let mut b = SceneBuilder::new();
        let light = b.emitter(Vec3::ZERO, Vec3::ONE);
        let corners = [(-0.02, -0.02), (0.02, -0.02), (0.02, 0.02), (-0.02, 0.02)];
        b.quad(corners.map(|(x, y)| Vec3::new(x, y, -1.0) * o as f32), light);
        b.camera(Vec3::ZERO, -Vec3::Z, Vec3::Y, yfov as f32);
        let scene = b.build();
        let covered = (0.04 * film_distance / film_height).powi(2);
        for mode in Mode::all() {
            let (side, delta) = mode.count((1024, 7e-2), (256, 2.8e-1));
            let sampler = SamplerKind::Independent;
            let film = render(&scene, mode.options(options(side, side, 1).lens(lens).sampler(sampler))).film;
            let energy = Estimate::of(film.pixels.iter().map(|p| [p.mean()[0], p.mean()[1], p.mean()[2]]));
            case.mean(format!("{}, total at {o} m", mode.name), [covered; 3], 0.0, delta, &energy);
        }
    }
    case.close();
}

/// A unit square of radiance 1 around `middle`, along `across` and +Y, before a pinhole of 90°.
fn square_in_view(middle: DVec3, across: DVec3) -> Scene {
    let mut b = SceneBuilder::new();
    let light = b.emitter(Vec3::ZERO, Vec3::ONE);
    let corner = |x: f64, y: f64| (middle + across * x + DVec3::Y * y).as_vec3();
    b.quad([corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(-0.5, 0.5)], light);
    b.camera(Vec3::ZERO, -Vec3::Z, Vec3::Y, std::f32::consts::FRAC_PI_2);
    b.build()
}

/// By 2²⁰ Sobol' points through the camera's rays, which know such an area to about 1e-5 (the limit is ten of those;
/// half a pixel's shift of the square at the border would be 2e-3); and by renders. The image never stretches, so that
/// there are no anamorphic pixels: a wider image shows more at the sides.
#[test]
fn m07_projected_area() {
    let mut case = Case::open("M07", "Projected area", "camera mapping, pixel coverage");
    let (sin, cos) = std::f64::consts::FRAC_PI_6.sin_cos();
    let tilted = DVec3::new(cos, 0.0, sin);
    // The last square sticks out to the right and below: what is inside is 0.5 × 0.3 of its 1 × 1.
    let squares = [
        ("frontal", DVec3::new(0.0, 0.0, -2.0), DVec3::X, 0.0625),
        ("off centre", DVec3::new(0.7, -0.9, -2.0), DVec3::X, 0.0625),
        ("tilted by 30°", DVec3::new(0.0, 0.0, -2.0), tilted, 0.055_858_529_45),
        ("over the border", DVec3::new(2.0, -2.2, -2.0), DVec3::X, 0.0625 * 0.5 * 0.3),
    ];
    for (k, (name, middle, across, covered)) in squares.into_iter().enumerate() {
        let normal = across.cross(DVec3::Y);
        for size in [(64, 64), (61, 61), (4096, 4096)] {
            let rays = CameraRays::new(&perspective(PI / 2.0), size, None).expect("a valid camera");
            let inside = (0..1 << 20).filter(|&i| {
                let u = SobolScheme::sample_4d(i, [7, k as u32], 0);
                let d = rays.pinhole_ray(u[0] * size.0 as f32, u[1] * size.1 as f32).1.as_dvec3();
                let p = d * (middle.dot(normal) / d.dot(normal)) - middle;
                p.dot(across).abs() <= 0.5 && p.y.abs() <= 0.5
            });
            let mean = inside.count() as f64 / f64::from(1 << 20);
            case.number(format!("rays, {name}, {} × {}", size.0, size.1), covered, mean, 1e-4 / covered);
        }
    }
    for mode in Mode::all() {
        for (name, middle, across, covered) in squares {
            let scene = square_in_view(middle, across);
            // 63 × 61: 61 rows are 90°, so that the columns show 63/61 of it.
            for (width, height, shape) in [(64, 64, 1.0), (63, 61, 63.0 / 61.0)] {
                if name == "over the border" && shape != 1.0 {
                    continue;
                }
                let sampler = SamplerKind::Independent;
                let film = render(&scene, mode.options(options(width, height, 16).sampler(sampler))).film;
                // Every sample is a Bernoulli one within its pixel; stratified over pixels, so less than p(1−p)/n.
                let n = f64::from(width * height) * 16.0;
                let p = covered / shape;
                let estimate = Estimate { n, mean: [film.mean()[1]; 3], variance: [p * (1.0 - p); 3] };
                let delta = 4.9 * 1.05 * ((1.0 - p) / (p * n)).sqrt();
                case.mean(format!("{}, {name}, {width} × {height}", mode.name), [p; 3], 1e-7, delta, &estimate);
                // A window shows the pixels of the whole, wherever it lies.
                let crops = [(0, 0), (9, 5), (31, 29)].map(|(x, y)| Crop { x, y, width: 32, height: 32 });
                let moved = crops.into_iter().map(|crop| {
                    let options = options(width, height, 16).sampler(sampler).crop(crop);
                    let part = render(&scene, mode.options(options)).film;
                    let same = |i: u32| part.pixel(i % 32, i / 32) == film.pixel(crop.x + i % 32, crop.y + i / 32);
                    (0..32 * 32).filter(|&i| !same(i)).count()
                });
                case.bits(format!("{}, {name}, {width} × {height}, windows", mode.name), moved.sum());
            }
        }
    }
    case.close();
}
