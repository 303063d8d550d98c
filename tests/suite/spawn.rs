//! Rays that leave or reach a surface do not meet it (HARDCASES G07, G08, G19), on every backend of the build and on a plain
//! Möller–Trumbore test, whose rounding is unlike theirs. Also the accuracy of hit points (G09) and exact scaling (G10).
//!
//! Oracle: counting, 0 allowed. Seeds are fixed, so no false alarms. `--nocapture` prints the average offsets.

use glam::{Affine3A, DAffine3, DMat3, DVec3, Mat3A, Quat, Vec3};
use pathspace::backend::batch::{BLOCKED, INVALID_ID, RayBlock, RayHitBlock};
use pathspace::backend::{self, Backend, BackendKind, BackendOptions, Coherence};
use pathspace::math::float::{hit_error, hit_error_instanced, hit_point, shadow_segment, spawn_origin};
use pathspace::math::warp;
use pathspace::sampler::{IndependentScheme, Scheme};
use pathspace::scene::geometry::{Geometry, NO_ATTRIBUTES, Placement, Triangle, TriangleMesh};

/// Triangles of one geometry: few, because `brute` looks at all of them.
const GROUP: usize = 24;

/// Random numbers in order; the tests have no pixels.
struct Random {
    at: u32,
    seed: u32,
}

impl Random {
    fn four(&mut self) -> [f32; 4] {
        self.at += 1;
        IndependentScheme::sample_4d(self.at, [self.seed, 0], 0)
    }

    fn one(&mut self) -> f64 {
        f64::from(self.four()[0])
    }

    fn direction(&mut self) -> Vec3 {
        let u = self.four();
        warp::uniform_sphere([u[0], u[1]])
    }

    /// Log-uniform in [10^a, 10^b].
    fn log(&mut self, a: f64, b: f64) -> f64 {
        10f64.powf(a + (b - a) * self.one())
    }

    fn cube(&mut self) -> DVec3 {
        let u = self.four().map(|x| 2.0 * f64::from(x) - 1.0);
        DVec3::new(u[0], u[1], u[2])
    }
}

#[derive(Clone, Copy)]
struct Ray {
    origin: Vec3,
    dir: Vec3,
    tfar: f32,
}

#[derive(Clone, Copy, PartialEq)]
struct Found {
    u: f32,
    v: f32,
    /// Position in `Geometry::triangles`, and the instance.
    triangle: usize,
    inst: u32,
}

/// Something that traces.
enum Tracer<'a> {
    MollerTrumbore(&'a Geometry),
    Backend(&'a Geometry, Box<dyn Backend>),
}

impl<'a> Tracer<'a> {
    fn build(name: &str, geometry: &'a Geometry) -> Self {
        match name.parse::<BackendKind>() {
            Ok(kind) => {
                let options = BackendOptions { build_threads: 1, ..BackendOptions::default() };
                Tracer::Backend(geometry, backend::build(kind, geometry, &options).expect("the backend builds"))
            }
            Err(_) => Tracer::MollerTrumbore(geometry),
        }
    }

    fn closest(&self, rays: &[Ray]) -> Vec<Option<Found>> {
        match self {
            Tracer::MollerTrumbore(geometry) => rays.iter().map(|ray| closest_in_order(geometry, ray)).collect(),
            Tracer::Backend(geometry, backend) => {
                let mut blocks = vec![RayHitBlock::EMPTY; rays.len().div_ceil(16)];
                for (i, r) in rays.iter().enumerate() {
                    blocks[i / 16].ray.set(i % 16, r.origin, r.dir, r.tfar);
                }
                assert_eq!(backend.closest_hit(&mut blocks, rays.len(), Coherence::Incoherent), 0, "invalid rays");
                let found = |i: usize| {
                    blocks[i / 16].hit(i % 16).map(|h| {
                        let first = geometry.meshes[h.geom as usize].first_triangle;
                        Found { u: h.u, v: h.v, triangle: (first + h.prim) as usize, inst: h.inst }
                    })
                };
                (0..rays.len()).map(found).collect()
            }
        }
    }

    fn blocked(&self, rays: &[Ray]) -> Vec<bool> {
        match self {
            Tracer::MollerTrumbore(_) => self.closest(rays).iter().map(Option::is_some).collect(),
            Tracer::Backend(_, backend) => {
                let mut blocks = vec![RayBlock::EMPTY; rays.len().div_ceil(16)];
                for (i, r) in rays.iter().enumerate() {
                    blocks[i / 16].set(i % 16, r.origin, r.dir, r.tfar);
                }
                assert_eq!(backend.any_hit(&mut blocks, rays.len(), Coherence::Incoherent), 0, "invalid rays");
                (0..rays.len()).map(|i| blocks[i / 16].tfar[i % 16] == BLOCKED).collect()
            }
        }
    }
}

/// Möller and Trumbore 1997 in f32, over the world mesh.
fn closest_in_order(geometry: &Geometry, ray: &Ray) -> Option<Found> {
    let mesh = &geometry.meshes[0];
    let mut best: Option<(f32, Found)> = None;
    for (i, index) in mesh.indices.iter().enumerate() {
        let [a, b, c] = index.map(|k| mesh.vertices[k as usize]);
        let (e1, e2) = (b - a, c - a);
        let q = ray.dir.cross(e2);
        let det = e1.dot(q);
        let s = ray.origin - a;
        let r = s.cross(e1);
        let (u, v, t) = (s.dot(q) / det, ray.dir.dot(r) / det, e2.dot(r) / det);
        let limit = best.map_or(ray.tfar, |(t, _)| t);
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0 && t <= limit {
            best = Some((t, Found { u, v, triangle: i, inst: INVALID_ID }));
        }
    }
    best.map(|(_, found)| found)
}

/// Names for [`Tracer::build`].
fn tracers() -> impl Iterator<Item = &'static str> {
    ["Möller-Trumbore"].into_iter().chain(backends())
}

fn backends() -> impl Iterator<Item = &'static str> {
    BackendKind::available().iter().map(|kind| kind.name())
}

fn mesh_of(triangles: &[[Vec3; 3]], first_triangle: u32) -> TriangleMesh {
    let mut vertices: Vec<Vec3> = triangles.iter().flatten().copied().collect();
    vertices.push(Vec3::ZERO);
    let indices = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    TriangleMesh { vertices, indices, first_triangle }
}

fn record_of([a, b, c]: &[Vec3; 3]) -> Triangle {
    let cross = (b.as_dvec3() - a.as_dvec3()).cross(c.as_dvec3() - a.as_dvec3());
    Triangle {
        v0: a.to_array(),
        e1: (b - a).to_array(),
        e2: (c - a).to_array(),
        n_g: cross.normalize().as_vec3().to_array(),
        material: 0,
        attributes: NO_ATTRIBUTES,
        error: 0.0,
        light: u32::MAX,
    }
}

/// Triangles in the world, or in one mesh placed by transforms.
fn geometry_of(triangles: &[[Vec3; 3]], placements: &[DAffine3]) -> Geometry {
    let mut geometry = Geometry { triangles: triangles.iter().map(record_of).collect(), ..Geometry::default() };
    if placements.is_empty() {
        geometry.meshes = vec![mesh_of(triangles, 0)];
    } else {
        geometry.meshes = vec![mesh_of(&[], 0), mesh_of(triangles, 0)];
    }
    let affine = |m: &DAffine3| Affine3A::from_mat3_translation(m.matrix3.as_mat3(), m.translation.as_vec3());
    for m in placements {
        geometry.instances.push(Placement {
            mesh: 1,
            world_from_object: affine(m),
            object_from_world: affine(&m.inverse()),
            world_from_normal: Mat3A::from(m.matrix3.inverse().transpose().as_mat3()),
        });
    }
    let mut points = triangles.iter().flatten().map(|p| p.as_dvec3()).collect::<Vec<_>>();
    if !placements.is_empty() {
        points = placements.iter().flat_map(|m| points.iter().map(|p| m.transform_point3(*p))).collect();
    }
    let min = points.iter().copied().reduce(DVec3::min).expect("some points");
    let max = points.iter().copied().reduce(DVec3::max).expect("some points");
    geometry.bounds = (min.as_vec3() - min.as_vec3().abs() * 1e-6, max.as_vec3() + max.as_vec3().abs() * 1e-6);
    geometry
}

/// Where a ray left a triangle: position, world normal and error bound, as the integrator computes them.
struct Left {
    p: Vec3,
    n_g: Vec3,
    error: f32,
    /// Longest edge in the world, for the report.
    size: f32,
}

fn leave(geometry: &Geometry, found: &Found) -> Left {
    let t = &geometry.triangles[found.triangle];
    let [v0, e1, e2, n_g] = [t.v0, t.e1, t.e2, t.n_g].map(Vec3::from);
    let p = hit_point(v0, e1, e2, found.u, found.v);
    let longest = |e1: Vec3, e2: Vec3| e1.length().max(e2.length()).max((e2 - e1).length());
    if found.inst == INVALID_ID {
        return Left { p, n_g, error: hit_error(v0, e1, e2, p), size: longest(e1, e2) };
    }
    let m = &geometry.instances[found.inst as usize];
    Left {
        p: m.world_from_object.transform_point3(p),
        n_g: (m.world_from_normal * n_g).normalize(),
        error: hit_error_instanced((v0, e1, e2), p, &m.world_from_object, &m.object_from_world),
        size: longest(m.world_from_object.transform_vector3(e1), m.world_from_object.transform_vector3(e2)),
    }
}

/// Spawned rays, those that met the triangle they left, those hidden by another one; average offset over size.
#[derive(Default)]
struct Tally {
    rays: u64,
    again: u64,
    hidden: u64,
    relative: f64,
    largest: f64,
}

/// Aims at random points of the triangles, spawns from every hit, and counts re-hits.
fn respawn(tracer: &Tracer, geometry: &Geometry, targets: &[(Vec3, f32)], random: &mut Random, tally: &mut Tally) {
    const SPAWNED: usize = 64;
    let aimed: Vec<_> = targets
        .iter()
        .map(|&(target, size)| {
            let dir = random.direction();
            Ray { origin: target - dir * (size * random.log(-1.0, 1.0) as f32), dir, tfar: f32::INFINITY }
        })
        .collect();
    let hits: Vec<_> = tracer.closest(&aimed).into_iter().flatten().collect();
    let mut rays = Vec::new();
    for found in &hits {
        let left = leave(geometry, found);
        tally.relative += f64::from(left.error / left.size) * SPAWNED as f64;
        tally.largest = tally.largest.max(f64::from(left.error / left.size));
        for k in 0..SPAWNED {
            let mut dir = random.direction();
            // A quarter grazes: cosine log-uniform down to a hundredth of the roundoff.
            if k % 4 == 0 {
                let cos = random.log(-9.0, -1.0) as f32;
                let side = 1f32.copysign(left.n_g.dot(dir));
                dir = ((dir - left.n_g * left.n_g.dot(dir)).normalize() + left.n_g * (cos * side)).normalize();
            }
            rays.push(Ray { origin: spawn_origin(left.p, left.n_g, left.error, dir), dir, tfar: f32::INFINITY });
        }
    }
    for (i, again) in tracer.closest(&rays).into_iter().enumerate() {
        let own = &hits[i / SPAWNED];
        tally.rays += 1;
        match again {
            Some(found) if (found.triangle, found.inst) == (own.triangle, own.inst) => tally.again += 1,
            Some(_) => tally.hidden += 1,
            None => {}
        }
    }
}

type Family = (&'static str, fn(&mut Random) -> [DVec3; 3]);

/// HARDCASES G07, families (a) to (c), slivers of a general direction up to 1 : 2000, and triangles in coordinate planes (through
/// the origin every second time), where most bounds vanish.
const FAMILIES: [Family; 5] = [
    ("log-uniform 1e-3..1e3", |r| {
        std::array::from_fn(|_| DVec3::from_array(std::array::from_fn(|_| r.log(-3.0, 3.0))))
    }),
    ("unit at 1e6", |r| std::array::from_fn(|_| DVec3::new(1e6, -1e6, 5e5) + r.cube())),
    ("1e-4 at (1,1,1)", |r| std::array::from_fn(|_| DVec3::ONE + r.cube() * 1e-4)),
    ("slivers", |r| {
        let (along, across) = (r.direction().as_dvec3(), r.direction().as_dvec3());
        let (middle, height, at) = (r.cube(), r.log(-3.3, -0.3), r.one());
        [middle, middle + along, middle + along * at + across * height]
    }),
    ("coordinate planes", |r| {
        let axis = (r.one() * 3.0) as usize;
        let height = if r.one() < 0.5 { 0.0 } else { r.log(-3.0, 3.0) };
        std::array::from_fn(|_| {
            let mut p = r.cube();
            p[axis] = height;
            p
        })
    }),
];

fn barycentric(random: &mut Random) -> [f32; 2] {
    let u = random.four();
    warp::triangle_barycentric([u[0], u[1]])
}

/// HARDCASES G07, 4e6 rays a tracer.
#[test]
fn spawned_rays_do_not_meet_the_triangle_they_leave() {
    let mut faults = Vec::new();
    for name in tracers() {
        for (number, (family, triangle)) in FAMILIES.into_iter().enumerate() {
            let mut random = Random { at: 0, seed: number as u32 };
            let mut tally = Tally::default();
            while tally.rays < rays_per_family() {
                let triangles: Vec<[Vec3; 3]> =
                    (0..GROUP).map(|_| triangle(&mut random).map(|p| p.as_vec3())).filter(has_area).collect();
                let geometry = geometry_of(&triangles, &[]);
                let targets: Vec<_> = (0..40 * triangles.len())
                    .map(|i| {
                        let [u, v] = barycentric(&mut random);
                        let [a, b, c] = triangles[i % triangles.len()];
                        (hit_point(a, b - a, c - a, u, v), (b - a).length().max((c - a).length()))
                    })
                    .collect();
                respawn(&Tracer::build(name, &geometry), &geometry, &targets, &mut random, &mut tally);
            }
            report(name, family, &tally, &mut faults);
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// What a test run affords, or what the environment asks for when constants are validated.
fn rays_per_family() -> u64 {
    std::env::var("PATHSPACE_SPAWN_RAYS").ok().and_then(|n| n.parse().ok()).unwrap_or(750_000)
}

/// Height over longest edge above 2⁻²⁰: below, vertices in f32 do not define a plane.
fn has_area(t: &[Vec3; 3]) -> bool {
    let [a, b, c] = t.map(|v| v.as_dvec3());
    let longest2 = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
    (b - a).cross(c - a).length() > longest2 * 2f64.powi(-20)
}

fn report(name: &str, family: &str, tally: &Tally, faults: &mut Vec<String>) {
    let line = format!(
        "{name}, {family}: {} of {} rays met the triangle they left ({} hidden); offset over size {:.2e} on average, {:.2e} at most",
        tally.again,
        tally.rays,
        tally.hidden,
        tally.relative / tally.rays as f64,
        tally.largest,
    );
    println!("{line}");
    if tally.again > 0 {
        faults.push(line);
    }
}

/// HARDCASES G07 through instances: rotated, scaled by 0.01..100 (non-uniformly within 30), mirrored, moved by up to 1e3 and 1e6.
#[test]
fn spawned_rays_do_not_meet_an_instance_they_leave() {
    let mut faults = Vec::new();
    for name in backends() {
        for (family, reach) in [("instances within 1e3", 1e3), ("instances within 1e6", 1e6)] {
            let mut random = Random { at: 0, seed: 77 };
            let mut tally = Tally::default();
            while tally.rays < rays_per_family() / 2 {
                let triangles: Vec<[Vec3; 3]> =
                    (0..4).map(|_| std::array::from_fn(|_| random.cube().as_vec3())).filter(has_area).collect();
                let placements: Vec<DAffine3> = (0..8).map(|_| placement(&mut random, reach)).collect();
                let geometry = geometry_of(&triangles, &placements);
                let targets: Vec<_> = (0..1000)
                    .map(|i| {
                        let [u, v] = barycentric(&mut random);
                        let [a, b, c] = triangles[i % triangles.len()];
                        let m = &geometry.instances[i % placements.len()].world_from_object;
                        let size = m.transform_vector3(b - a).length().max(m.transform_vector3(c - a).length());
                        (m.transform_point3(hit_point(a, b - a, c - a, u, v)), size)
                    })
                    .collect();
                respawn(&Tracer::build(name, &geometry), &geometry, &targets, &mut random, &mut tally);
            }
            report(name, family, &tally, &mut faults);
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

fn placement(random: &mut Random, reach: f64) -> DAffine3 {
    let turn = |random: &mut Random| {
        let u = random.four();
        let q = Quat::from_xyzw(u[0] - 0.5, u[1] - 0.5, u[2] - 0.5, u[3] - 0.5).normalize();
        DMat3::from_quat(q.as_dquat())
    };
    let size = random.log(-2.0, 2.0);
    let scale = DVec3::new(random.log(-0.75, 0.75), random.log(-0.75, 0.75), -random.log(-0.75, 0.75)) * size;
    DAffine3 { matrix3: turn(random) * DMat3::from_diagonal(scale) * turn(random), translation: random.cube() * reach }
}

/// HARDCASES G08: no shadow ray escapes through a gap of 2⁻¹⁶ above a quad at z = 1.
#[test]
fn a_thin_gap_does_not_leak() {
    let quad = |z: f32, half: f32| {
        let corner = |x: f32, y: f32| Vec3::new(x * half, y * half, z);
        let (a, b, c, d) = (corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0));
        [[a, b, c], [a, c, d]]
    };
    let triangles = [quad(1.0, 1.0), quad(1.0 + 2f32.powi(-16), 2.0)].concat();
    let geometry = geometry_of(&triangles, &[]);
    for name in tracers() {
        let tracer = Tracer::build(name, &geometry);
        let (mut random, mut offset) = (Random { at: 0, seed: 8 }, 0.0f32);
        for _ in 0..100 {
            let rays: Vec<_> = (0..10_000)
                .map(|i| {
                    let [u, v] = barycentric(&mut random);
                    let left = leave(&geometry, &Found { u, v, triangle: i % 2, inst: INVALID_ID });
                    offset = offset.max(left.error);
                    let w = random.four();
                    let dir = warp::cosine_hemisphere([w[0], w[1]]).normalize();
                    Ray { origin: spawn_origin(left.p, left.n_g, left.error, dir), dir, tfar: f32::INFINITY }
                })
                .collect();
            let leaks = tracer.blocked(&rays).iter().filter(|b| !**b).count();
            // A direction with z = 2⁻¹² travels 2⁻⁴ to the cover: inside its margin of 1.
            assert_eq!(leaks, 0, "{name}");
        }
        println!("{name}: largest offset {offset:.2e} in a gap of {:.2e}", 2f32.powi(-16));
        assert!(offset < 4e-6, "{offset}");
    }
}

/// HARDCASES G19: nothing but the light itself between a point and the light; then a true blocker just in front of it.
#[test]
fn shadow_segments_stop_short_of_their_light() {
    let mut faults = Vec::new();
    let far = DVec3::new(1e6, -1e6, 5e5);
    // Centre, size, distance, and where a blocker stands: at 1e6 coordinates come in steps of 1/16 m.
    let families = [
        ("near", DVec3::ZERO, 1.0, 3.0, 0.999),
        ("at 1e6", far, 1.0, 3.0, 0.7),
        ("size 100", DVec3::ZERO, 100.0, 300.0, 0.999),
        ("distance 1e4", DVec3::ZERO, 1.0, 1e4, 0.999),
    ];
    for name in backends() {
        for (number, (family, center, size, distance, fraction)) in families.into_iter().enumerate() {
            let mut random = Random { at: 0, seed: 100 + number as u32 };
            let (mut rays_total, mut false_hits, mut passed) = (0, 0, 0);
            while rays_total < 200_000 {
                let light: [Vec3; 3] = std::array::from_fn(|_| (center + random.cube() * (0.5 * size)).as_vec3());
                if !has_area(&light) {
                    continue;
                }
                let t = record_of(&light);
                let [v0, e1, e2, n_g] = [t.v0, t.e1, t.e2, t.n_g].map(Vec3::from);
                let segment = |random: &mut Random| {
                    let origin = (center + random.direction().as_dvec3() * distance).as_vec3();
                    let [u, v] = barycentric(random);
                    let y = hit_point(v0, e1, e2, u, v);
                    let s = shadow_segment(origin, y, n_g, hit_error(v0, e1, e2, y)).expect("points differ");
                    Ray { origin, dir: s.dir, tfar: s.tfar }
                };
                let rays: Vec<_> = (0..1000).map(|_| segment(&mut random)).collect();
                let geometry = geometry_of(&[light], &[]);
                let blocked = Tracer::build(name, &geometry).blocked(&rays);
                false_hits += blocked.iter().filter(|b| **b).count();
                rays_total += rays.len();

                // One triangle across each of sixteen segments, all in one geometry.
                let blocker = |ray: &Ray| -> [Vec3; 3] {
                    let frame = pathspace::math::frame::Frame::from_normal(ray.dir);
                    let middle = ray.origin + ray.dir * (ray.tfar * fraction);
                    let half = 0.25 * size as f32;
                    let corner = |x, y| middle + frame.to_world(Vec3::new(x, y, 0.0)) * half;
                    [corner(-1.0, -1.0), corner(1.0, -1.0), corner(0.0, 2.0)]
                };
                let mut triangles = vec![light];
                triangles.extend(rays[..16].iter().map(blocker));
                let geometry = geometry_of(&triangles, &[]);
                let blocked = Tracer::build(name, &geometry).blocked(&rays[..16]);
                passed += blocked.iter().filter(|b| !**b).count();
            }
            let line =
                format!("{name}, light {family}: {false_hits} of {rays_total} occluded by the light, {passed} passed");
            println!("{line}");
            if false_hits + passed > 0 {
                faults.push(line);
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// HARDCASES G09. Oracle: the same point in f64. Points rebuilt from barycentrics do not depend on the camera's distance.
#[test]
fn hit_points_are_as_accurate_from_afar() {
    let [a, b, c] = [Vec3::new(-0.5, -0.5, 0.0), Vec3::new(0.5, -0.5, 0.0), Vec3::new(0.0, 0.5, 0.0)];
    let mut random = Random { at: 0, seed: 9 };
    for _ in 0..200_000 {
        let [u, v] = barycentric(&mut random);
        let p = hit_point(a, b - a, c - a, u, v);
        let exact = a.as_dvec3() + (b - a).as_dvec3() * f64::from(u) + (c - a).as_dvec3() * f64::from(v);
        assert!((p.as_dvec3() - exact).abs().max_element() <= 1.2e-7 && p.z == 0.0, "{p}");
    }
}

/// HARDCASES G10, for this file's functions. Oracle: multiplication by 2^k commutes with every operation.
#[test]
fn offsets_scale_exactly() {
    let mut random = Random { at: 0, seed: 10 };
    for _ in 0..20_000 {
        let [v0, e1, e2] = std::array::from_fn(|_| random.cube().as_vec3());
        let [u, v] = barycentric(&mut random);
        let (dir, receiver) = (random.direction(), random.cube().as_vec3() * 4.0);
        let n = random.direction();
        let m = placement(&mut random, 10.0);
        let of = |k: i32| {
            let s = 2f32.powi(k);
            let (v0, e1, e2) = (v0 * s, e1 * s, e2 * s);
            let p = hit_point(v0, e1, e2, u, v);
            let error = hit_error(v0, e1, e2, p);
            let origin = spawn_origin(p, n, error, dir);
            let segment = shadow_segment(receiver * s, p, n, error).expect("points differ");
            // An instance scaled along: the translation alone changes.
            let affine = |m: DAffine3| Affine3A::from_mat3_translation(m.matrix3.as_mat3(), m.translation.as_vec3());
            let scaled = DAffine3 { matrix3: m.matrix3, translation: m.translation * f64::from(s) };
            let placed = hit_error_instanced((v0, e1, e2), p, &affine(scaled), &affine(scaled.inverse()));
            let lengths = [error, origin.x, origin.y, origin.z, segment.tfar, placed].map(|x| (x / s).to_bits());
            (lengths, segment.dir.to_array().map(f32::to_bits))
        };
        let one = of(0);
        for k in [-20, -10, 10, 20, 40] {
            assert_eq!(of(k), one, "2^{k}");
        }
    }
}

/// Oracle: the contract of the ends. A target at the origin or not finite gives no ray; a zero normal leaves the target.
#[test]
fn shadow_segments_without_direction_are_none() {
    let p = Vec3::new(1.0, 2.0, 3.0);
    assert_eq!(shadow_segment(p, p, Vec3::ZERO, 0.0), None);
    assert_eq!(shadow_segment(p, Vec3::INFINITY, Vec3::Z, 0.0), None);
    assert_eq!(shadow_segment(p, Vec3::NAN, Vec3::Z, 0.0), None);
    let s = shadow_segment(p, p + Vec3::X * 4.0, Vec3::ZERO, 1e-6).expect("points differ");
    assert_eq!((s.dir, s.tfar), (Vec3::X, 4.0));
}
