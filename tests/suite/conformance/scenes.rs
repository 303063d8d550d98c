//! Open scenes: hits compared one by one (HARDCASES G13, G16, G17). Oracle: brute force; no failure is allowed.

use glam::{Affine3A, DVec3, Quat, Vec3};
use pathspace::scene::geometry::{Geometry, TriangleMesh};

use super::shapes::{FAR, Rng, cube, grid, mesh, placed, soup, with_instances, world};
use super::{Scenario, TestRay, check};

/// Rays from all around a scene of about unit size toward its inside.
fn incoming(rng: &mut Rng, n: usize, distance: f32) -> Vec<TestRay> {
    (0..n)
        .map(|_| {
            let org = rng.direction() * distance * (0.2 + rng.unit());
            let dir = (rng.cube() - org).normalize();
            TestRay::new(org, dir)
        })
        .collect()
}

/// Triangles of all sizes; rays with random segments, from near and from a thousand times the scene's size.
#[test]
fn random_soup() {
    let mut rng = Rng::new(11);
    let mut triangles = soup(&mut rng, 400, 0.3);
    triangles.extend(soup(&mut rng, 200, 0.02));
    triangles.extend(soup(&mut rng, 20, 3.0));
    let geometry = world(mesh(&triangles));
    let mut rays = incoming(&mut rng, 6000, 3.0);
    for ray in rays.iter_mut().skip(3000) {
        ray.tnear = rng.unit() * 2.0;
        ray.tfar = ray.tnear + rng.unit() * 3.0;
    }
    let from_far = incoming(&mut rng, 3000, 3000.0);
    check(&[Scenario::open("soup", geometry.clone(), rays), Scenario::open("soup from afar", geometry, from_far)]);
}

/// The same soup 10⁵ m from the origin, and at scales of 10⁻⁶ and 10⁶.
#[test]
fn soup_at_other_places_and_scales() {
    let cases =
        [("soup, far from the origin", 1.0, FAR), ("soup, 1e-6", 1e-6, Vec3::ZERO), ("soup, 1e6", 1e6, Vec3::ZERO)]
            .map(|(name, scale, center)| {
                let mut rng = Rng::new(12);
                let triangles: Vec<_> =
                    soup(&mut rng, 300, 0.4).iter().map(|t| t.map(|p| p * scale + center)).collect();
                let mut rays = incoming(&mut rng, 2000, 3.0);
                for ray in &mut rays {
                    ray.org = ray.org * scale + center;
                }
                Scenario::open(name, world(mesh(&triangles)), rays)
            });
    check(&cases);
}

/// G16, mild family: triangles with edges of about 11, 10 and 1, seen from 500 away at 0.009 rad to their plane.
#[test]
fn grazing_rays() {
    let mut rng = Rng::new(13);
    let mut triangles = Vec::new();
    let mut rays = Vec::new();
    for _ in 0..40 {
        let x = rng.direction().as_dvec3();
        let y = x.cross(rng.direction().as_dvec3()).normalize();
        let place = rng.cube().as_dvec3() * 50.0;
        let corners = [DVec3::ZERO, x * 11.0, x * 10.0 + y].map(|p| p + place);
        triangles.push(corners.map(|p| p.as_vec3()));
        let n = x.cross(y);
        for _ in 0..50 {
            // A point about the triangle, half the time inside, and a direction in any azimuth.
            let (a, b) = (f64::from(rng.unit()) * 1.2 - 0.1, f64::from(rng.unit()) * 1.2 - 0.1);
            let target = corners[0] + (corners[1] - corners[0]) * a + (corners[2] - corners[0]) * b * (1.0 - a);
            let azimuth = f64::from(rng.unit()) * std::f64::consts::TAU;
            let along = x * azimuth.cos() + y * azimuth.sin();
            let dir = along * 0.009f64.cos() + n * 0.009f64.sin();
            rays.push(TestRay::new((target - dir * 500.0).as_vec3(), dir.as_vec3()));
        }
    }
    check(&[Scenario::open("grazing rays", world(mesh(&triangles)), rays)]);
}

/// G17's transforms: rotation, non-uniform scale, mirror, all of them, tiny, huge, and coincident with another.
fn instances() -> Geometry {
    let mut rng = Rng::new(14);
    let meshes =
        vec![mesh(&soup(&mut rng, 30, 0.5)), mesh(&soup(&mut rng, 80, 0.4)), mesh(&cube()), TriangleMesh::default()];
    let turn = Quat::from_axis_angle(rng.direction(), 1.1);
    let place = |scale: Vec3, turn: Quat, at: Vec3| Affine3A::from_scale_rotation_translation(scale, turn, at);
    let instances = vec![
        placed(1, place(Vec3::ONE, turn, Vec3::new(2.5, 0.0, 0.0))),
        placed(1, place(Vec3::new(2.0, 1.0, 0.25), turn, Vec3::new(-2.5, 0.0, 0.0))),
        placed(1, place(Vec3::new(-1.0, 1.0, 1.0), Quat::IDENTITY, Vec3::new(0.0, 2.5, 0.0))),
        placed(2, place(Vec3::new(-3.0, 0.5, 1.5), turn, Vec3::new(0.0, -2.5, 0.0))),
        placed(2, place(Vec3::splat(1e-3), turn, Vec3::new(0.0, 0.0, 2.5))),
        placed(1, place(Vec3::splat(40.0), turn.inverse(), Vec3::new(9.0, 3.0, -60.0))),
        placed(2, place(Vec3::ONE, turn, Vec3::new(2.5, 1.0, 1.0))),
        // Twice in one place: the tie goes to the first.
        placed(2, place(Vec3::ONE, turn, Vec3::new(2.5, 1.0, 1.0))),
        // Nothing in it.
        placed(3, Affine3A::IDENTITY),
    ];
    with_instances(meshes, instances)
}

/// Instances beside a world mesh, and with an empty world; rays aimed at every instance.
#[test]
fn instances_mirrored_and_scaled() {
    let geometry = instances();
    let mut rng = Rng::new(15);
    let rays: Vec<TestRay> = (0..6000)
        .map(|i| {
            let placement = &geometry.instances[i % geometry.instances.len()];
            let target = placement.world_from_object.transform_point3(rng.cube() * 0.6);
            let org = rng.cube() * 8.0;
            TestRay::new(org, (target - org).normalize())
        })
        .collect();
    let mut without_world = geometry.clone();
    without_world.meshes[0] = TriangleMesh::default();
    check(&[
        Scenario::open("instances and world", geometry, rays.clone()),
        Scenario::open("instances alone", without_world, rays),
    ]);
}

/// No triangles at all, one triangle, and one that is degenerate: every ray misses or is compared.
#[test]
fn empty_and_trivial_scenes() {
    let mut rng = Rng::new(16);
    let rays = incoming(&mut rng, 100, 2.0);
    let flat = [Vec3::ZERO, Vec3::X, Vec3::X * 2.0];
    check(&[
        Scenario::open(
            "no mesh",
            Geometry { bounds: (Vec3::INFINITY, Vec3::NEG_INFINITY), ..Geometry::default() },
            rays.clone(),
        ),
        Scenario::open("empty mesh", world(TriangleMesh::default()), rays.clone()),
        Scenario::open("one triangle", world(mesh(&[[Vec3::NEG_ONE, Vec3::X, Vec3::Y]])), rays.clone()),
        Scenario::open("one degenerate triangle", world(mesh(&[flat])), rays.clone()),
        Scenario::open("one flat grid", world(mesh(&grid(8, 1.0, 0.0))), rays),
    ]);
}
