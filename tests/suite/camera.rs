//! Camera geometry: where rays start and point, thin lens, EXR matrices.

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

/// Oracle: symmetry. Focused at infinity all rays of a film point are parallel; the middle of the lens is the pinhole;
/// all rays of a film point meet in the plane in focus, which is perpendicular to the axis.
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

/// Oracle: points on camera rays. Row vector times matrix, as OpenEXR defines: camera space is left-handed with z along
/// the view, NDC has (0,0) top left and (1,1) bottom right. Coordinates include the scene's origin.
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
