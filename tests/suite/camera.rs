//! Camera geometry: where rays start and point, thin lens, EXR matrices (HARDCASES M05, M07).

use glam::{Affine3A, DVec2, DVec3, Vec3};
use pathspace::camera::{CameraRays, Lens};
use pathspace::sampler::{Scheme, SobolScheme};
use pathspace::scene::{Camera, Projection};

fn camera(projection: Projection) -> Camera {
    Camera { name: "test".into(), world_from_camera: Affine3A::IDENTITY, projection }
}

fn perspective(yfov_rad: f32, aspect: Option<f32>) -> Camera {
    camera(Projection::Perspective { yfov_rad, aspect })
}

fn turned() -> Affine3A {
    Affine3A::from_rotation_translation(
        glam::Quat::from_euler(glam::EulerRot::YXZ, 0.7, -0.3, 0.2),
        Vec3::new(3.0, -2.0, 5.0),
    )
}

const RIGHT_ANGLE: f32 = std::f32::consts::FRAC_PI_2;

/// Tangents of the direction to the right and upwards.
fn tangents(rays: &CameraRays, x: f32, y: f32) -> DVec2 {
    let d = rays.pinhole_ray(x, y).1.as_dvec3();
    DVec2::new(d.x / -d.z, d.y / -d.z)
}

/// Oracle: glTF's rule. Wider than authored keeps the vertical field, narrower the horizontal one; no stretching.
#[test]
fn the_view_is_fitted_and_never_stretched() {
    let cases = [
        (None, (200, 100), (2.0, 1.0)),
        (None, (100, 200), (0.5, 1.0)),
        (Some(2.0), (200, 100), (2.0, 1.0)),
        (Some(1.5), (200, 100), (2.0, 1.0)),
        (Some(3.0), (200, 100), (3.0, 1.5)),
        (Some(1.0), (63, 126), (1.0, 2.0)),
    ];
    for (aspect, (width, height), (tan_x, tan_y)) in cases {
        let rays = CameraRays::new(&perspective(RIGHT_ANGLE, aspect), (width, height), None).unwrap();
        let (w, h) = (width as f32, height as f32);
        // The middle is exact; corners to a few roundoffs.
        assert_eq!(rays.pinhole_ray(w / 2.0, h / 2.0), (Vec3::ZERO, Vec3::NEG_Z));
        assert!((tangents(&rays, 0.0, 0.0) - DVec2::new(-tan_x, tan_y)).length() < 1e-6, "{aspect:?}");
        assert!((tangents(&rays, w, h) - DVec2::new(tan_x, -tan_y)).length() < 1e-6, "{aspect:?}");
    }
    // Parallel: the same rule with magnifications 3 by 2.
    for ((width, height), (half_x, half_y)) in
        [((300, 200), (3.0, 2.0)), ((400, 200), (4.0, 2.0)), ((200, 200), (3.0, 3.0))]
    {
        let camera = camera(Projection::Orthographic { xmag_m: 3.0, ymag_m: 2.0 });
        let rays = CameraRays::new(&camera, (width, height), None).unwrap();
        let (origin, dir) = rays.ray(0.0, 0.0, [0.5; 2]);
        assert_eq!(dir, Vec3::NEG_Z);
        assert!((origin - Vec3::new(-half_x, half_y, 0.0)).length() < 1e-6);
    }
}

/// HARDCASES M07. Oracle: projected area of a unit square at distance 2 in a 90° view, frontal, off centre and tilted by 30°. 2²⁰
/// scrambled Sobol' points know such an area to about 1e-5; the limit is ten of those, a hundredth of a pixel's shift of one
/// edge would be 4e-5 and a half-pixel shift of the off-centre square, which touches the border, 2e-3.
#[test]
fn a_square_covers_its_projected_area() {
    let (sin, cos) = (std::f64::consts::FRAC_PI_6).sin_cos();
    // The last square sticks out to the right and below: what is inside is 0.5 × 0.3 of its 1 × 1.
    let squares = [
        (DVec3::new(0.0, 0.0, -2.0), DVec3::X, 0.0625),
        (DVec3::new(0.7, -0.9, -2.0), DVec3::X, 0.0625),
        (DVec3::new(0.0, 0.0, -2.0), DVec3::new(cos, 0.0, sin), 0.055_858_529_45),
        (DVec3::new(2.0, -2.2, -2.0), DVec3::X, 0.0625 * 0.5 * 0.3),
    ];
    for size in [(64, 64), (61, 61), (4096, 4096)] {
        let rays = CameraRays::new(&perspective(RIGHT_ANGLE, None), size, None).unwrap();
        for (k, (middle, across, covered)) in squares.into_iter().enumerate() {
            let normal = across.cross(DVec3::Y);
            let n = 1 << 20;
            let inside = (0..n).filter(|&i| {
                let u = SobolScheme::sample_4d(i, [7, k as u32], 0);
                let d = rays.pinhole_ray(u[0] * size.0 as f32, u[1] * size.1 as f32).1.as_dvec3();
                let p = d * (middle.dot(normal) / d.dot(normal)) - middle;
                p.dot(across).abs() <= 0.5 && p.y.abs() <= 0.5
            });
            let mean = inside.count() as f64 / f64::from(n);
            println!("{size:?} square {k}: {:e}", mean - covered);
            assert!((mean - covered).abs() < 1e-4, "{size:?}, square {k}: {mean} for {covered}");
        }
    }
}

/// Film position (pixels from the middle, along x) at which a point at distance `o` on the axis is seen through one
/// point of the lens: the film maps linearly to the plane of the point.
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

/// HARDCASES M05. Oracle: the thin-lens formula, f = 50 mm at f/2 focused at 2 m. The diameter is that of the circle of
/// positions over the lens' rim (closed form, 1e-3 relative), the distribution over the lens is a uniform disk
/// (rms radius D/√8; 4096 Sobol' points know it to 1e-3).
#[test]
fn circle_of_confusion() {
    let (focal, radius, focus) = (0.05f64, 0.0125f64, 2.0f64);
    let film_distance = focal * focus / (focus - focal);
    let film_height = 0.024;
    let resolution = 1024;
    let yfov = 2.0 * (0.5 * film_height / film_distance).atan();
    let lens = Lens { radius_m: radius as f32, focus_m: focus as f32 };
    let rays = CameraRays::new(&perspective(yfov as f32, None), (resolution, resolution), Some(lens)).unwrap();
    let mm_per_pixel = film_height * 1e3 / f64::from(resolution);
    let middle = resolution as f32 / 2.0;
    for (o, diameter) in
        [(1.0, 0.641_025_64), (1.5, 0.213_675_21), (2.0, 0.0), (4.0, 0.320_512_82), (1e9, 0.641_025_64)]
    {
        let (mut sum, mut sum2, mut largest) = (DVec2::ZERO, 0.0, 0.0f64);
        let n = 4096;
        for i in 0..n {
            let u = SobolScheme::sample_4d(i, [5, 6], 0);
            let p = seen_at(&rays, middle, o, [u[0], u[1]]) * mm_per_pixel;
            sum += p;
            sum2 += p.length_squared();
            largest = largest.max(p.length());
        }
        let n = f64::from(n);
        // In focus everything meets within rounding: 2⁻²³ of the 24 mm film and the step's division.
        let tolerance = 1e-3 * diameter + 2e-5;
        assert!((2.0 * largest - diameter).abs() < 2.0 * tolerance, "{o} m: diameter {}", 2.0 * largest);
        assert!(((sum2 / n).sqrt() - diameter / 8f64.sqrt()).abs() < tolerance, "{o} m: rms {}", (sum2 / n).sqrt());
        assert!((sum / n).length() < tolerance, "{o} m: centre {}", sum / n);
    }
}

/// Oracle: symmetry. Focused at infinity all rays of a film point are parallel; the middle of the lens is the pinhole; all rays
/// of a film point meet in the plane in focus, which is perpendicular to the axis.
#[test]
fn lens_rays_meet_in_the_plane_in_focus() {
    let mut camera = perspective(1.0, None);
    camera.world_from_camera = turned();
    let pinhole = CameraRays::new(&camera, (640, 480), None).unwrap();
    assert!(!pinhole.has_lens());
    for focus_m in [0.3f32, 7.0, f32::INFINITY] {
        let rays = CameraRays::new(&camera, (640, 480), Some(Lens { radius_m: 0.1, focus_m })).unwrap();
        assert!(rays.has_lens());
        for i in 0..1000 {
            let u = SobolScheme::sample_4d(i, [1, 2], 0);
            let (x, y) = (u[0] * 640.0, u[1] * 480.0);
            let (eye, axis) = pinhole.pinhole_ray(x, y);
            assert_eq!(rays.ray(x, y, [0.5, 0.5]), (eye, axis));
            let (origin, dir) = rays.ray(x, y, [u[2], u[3]]);
            assert!(dir.is_normalized() && (origin - eye).length() <= 0.1 * 1.000_01);
            assert!((origin - eye).dot(camera.world_from_camera.transform_vector3(Vec3::Z)).abs() < 1e-6);
            if focus_m.is_finite() {
                // Rays that start up to 8 m from zero carry 2⁻²¹ m of rounding.
                let depth = |p: Vec3| rays.depth(p);
                let at_focus = |o: Vec3, d: Vec3| o + d * ((focus_m - depth(o)) / depth(eye + d));
                assert!((at_focus(origin, dir) - at_focus(eye, axis)).length() < 1e-5, "{focus_m}");
            } else {
                assert!((dir - axis).length() < 1e-6);
            }
        }
    }
}

/// Oracle: points on camera rays. Row vector times matrix, as OpenEXR defines: camera space is left-handed with z along the
/// view, NDC has (0,0) top left and (1,1) bottom right. Coordinates include the scene's origin.
#[test]
fn exr_matrices_follow_renderman() {
    let scene_origin = DVec3::new(1e4, -2e4, 3e4);
    for projection in [
        Projection::Perspective { yfov_rad: 0.8, aspect: Some(2.0) },
        Projection::Orthographic { xmag_m: 3.0, ymag_m: 2.0 },
    ] {
        let mut camera = camera(projection);
        camera.world_from_camera = turned();
        let rays = CameraRays::new(&camera, (300, 200), None).unwrap();
        let apply = |m: [f32; 16], p: DVec3| {
            let v = [p.x, p.y, p.z, 1.0];
            let out: [f64; 4] = std::array::from_fn(|j| (0..4).map(|i| v[i] * f64::from(m[4 * i + j])).sum());
            DVec3::new(out[0], out[1], out[2]) / out[3]
        };
        for (fx, fy) in [(0.0, 0.0), (150.0, 100.0), (300.0, 200.0), (40.0, 170.0)] {
            let (origin, dir) = rays.pinhole_ray(fx, fy);
            let p = origin + dir * 7.0;
            let world = p.as_dvec3() + scene_origin;
            // f32 entries times 3e4 m: 2e-3 m.
            let in_camera = apply(rays.world_to_camera(scene_origin), world);
            assert!((in_camera.z - f64::from(rays.depth(p))).abs() < 1e-2, "{in_camera}");
            let right = camera.world_from_camera.transform_vector3(Vec3::X).as_dvec3();
            let eye = camera.position().as_dvec3() + scene_origin;
            assert!((in_camera.x - (world - eye).dot(right)).abs() < 1e-2);
            let ndc = apply(rays.world_to_ndc(scene_origin), world);
            let expected = DVec2::new(f64::from(fx) / 300.0, f64::from(fy) / 200.0);
            assert!((ndc.truncate() - expected).length() < 3e-3, "{ndc} for {expected}");
        }
    }
}
