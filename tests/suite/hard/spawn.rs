//! Rays that leave or reach a surface do not meet it (HARDCASES G07, G08, G19), and hit points are accurate from any
//! distance (G09): on every backend and mode, and on a plain Möller–Trumbore test, whose rounding is unlike theirs.
//!
//! Oracle: counting, 0 allowed; f64 for the points. Seeds are fixed, so no false alarms.

use std::fmt::Display;

use glam::{Affine3A, DAffine3, DMat3, DVec3, Quat, Vec3};
use pathspace::backend::batch::INVALID_ID;
use pathspace::backend::{self, Backend, BackendKind, BackendOptions, Coherence};
use pathspace::math::float::{hit_error, hit_error_instanced, hit_point, shadow_segment, spawn_origin};
use pathspace::math::frame::Frame;
use pathspace::math::warp;
use pathspace::scene::geometry::{Geometry, NO_ATTRIBUTES, Triangle, TriangleMesh};

use super::Case;
use crate::conformance::shapes::{Rng, grid, mesh, placed, with_instances, world};
use crate::conformance::{Row, TestRay, any, closest, tracers};

/// Triangles of one geometry: few, because brute force looks at all of them.
const GROUP: usize = 24;

/// A hit as shading takes it.
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

/// What to build: a backend and mode, or the plain test.
#[derive(Clone, Copy)]
enum Kind<'a> {
    MollerTrumbore,
    Row(&'a Row),
}

impl Kind<'_> {
    /// Whether the geometry can be traced; if it cannot, nothing is claimed of it.
    fn traces(&self, geometry: &Geometry) -> bool {
        match self {
            Kind::MollerTrumbore => true,
            Kind::Row(row) => row.kind.traces(geometry),
        }
    }

    fn build<'g>(&self, geometry: &'g Geometry) -> Tracer<'g> {
        match self {
            Kind::MollerTrumbore => Tracer::MollerTrumbore(geometry),
            Kind::Row(row) => {
                let options = BackendOptions { build_threads: 1, ..BackendOptions::with_mode(row.mode) };
                Tracer::Backend(
                    geometry,
                    backend::select::build(row.kind, geometry, &options).expect("the backend builds"),
                )
            }
        }
    }
}

impl Display for Kind<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Kind::MollerTrumbore => f.write_str("Möller-Trumbore"),
            Kind::Row(row) => f.write_str(&row.name()),
        }
    }
}

fn kinds(rows: &[Row]) -> impl Iterator<Item = Kind<'_>> {
    rows.iter().map(Kind::Row).chain([Kind::MollerTrumbore])
}

impl Tracer<'_> {
    fn closest(&self, rays: &[TestRay]) -> Vec<Option<Found>> {
        match self {
            Tracer::MollerTrumbore(geometry) => rays.iter().map(|ray| closest_in_order(geometry, ray)).collect(),
            Tracer::Backend(geometry, backend) => closest(backend.as_ref(), rays, Coherence::Incoherent)
                .into_iter()
                .map(|hit| {
                    hit.map(|h| {
                        let first = geometry.meshes[h.geom as usize].first_triangle;
                        Found { u: h.u, v: h.v, triangle: (first + h.prim) as usize, inst: h.inst }
                    })
                })
                .collect(),
        }
    }

    fn blocked(&self, rays: &[TestRay]) -> usize {
        match self {
            Tracer::MollerTrumbore(_) => self.closest(rays).iter().flatten().count(),
            Tracer::Backend(_, backend) => {
                any(backend.as_ref(), rays, Coherence::Incoherent).into_iter().filter(|blocked| *blocked).count()
            }
        }
    }
}

/// Möller and Trumbore 1997 in f32, over the world mesh.
fn closest_in_order(geometry: &Geometry, ray: &TestRay) -> Option<Found> {
    let mesh = &geometry.meshes[0];
    let mut best: Option<(f32, Found)> = None;
    for (i, index) in mesh.indices.iter().enumerate() {
        let [a, b, c] = index.map(|k| mesh.vertices[k as usize]);
        let (e1, e2) = (b - a, c - a);
        let q = ray.dir.cross(e2);
        let det = e1.dot(q);
        let s = ray.org - a;
        let r = s.cross(e1);
        let (u, v, t) = (s.dot(q) / det, ray.dir.dot(r) / det, e2.dot(r) / det);
        let limit = best.map_or(ray.tfar, |(t, _)| t);
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0 && t <= limit {
            best = Some((t, Found { u, v, triangle: i, inst: INVALID_ID }));
        }
    }
    best.map(|(_, found)| found)
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

/// Triangles in the world, or in one mesh placed by transforms, with their shading records.
fn geometry_of(triangles: &[[Vec3; 3]], placements: &[DAffine3]) -> Geometry {
    let affine = |m: &DAffine3| Affine3A::from_mat3_translation(m.matrix3.as_mat3(), m.translation.as_vec3());
    let geometry = match placements {
        [] => world(mesh(triangles)),
        _ => with_instances(
            vec![TriangleMesh::default(), mesh(triangles)],
            placements.iter().map(|m| placed(1, affine(m))).collect(),
        ),
    };
    Geometry { triangles: triangles.iter().map(record_of).collect(), ..geometry }
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

/// Log-uniform in [10^a, 10^b].
fn log(rng: &mut Rng, a: f64, b: f64) -> f64 {
    10f64.powf(a + (b - a) * f64::from(rng.unit()))
}

fn barycentric(rng: &mut Rng) -> [f32; 2] {
    warp::triangle_barycentric([rng.unit(), rng.unit()])
}

/// Aims at random points of the triangles, spawns from every hit, and counts re-hits.
fn respawn(tracer: &Tracer, geometry: &Geometry, targets: &[(Vec3, f32)], rng: &mut Rng, tally: &mut Tally) {
    const SPAWNED: usize = 64;
    let aimed: Vec<_> = targets
        .iter()
        .map(|&(target, size)| {
            let dir = rng.direction();
            TestRay::new(target - dir * (size * log(rng, -1.0, 1.0) as f32), dir)
        })
        .collect();
    let hits: Vec<_> = tracer.closest(&aimed).into_iter().flatten().collect();
    let mut rays = Vec::with_capacity(hits.len() * SPAWNED);
    for found in &hits {
        let left = leave(geometry, found);
        tally.relative += f64::from(left.error / left.size) * SPAWNED as f64;
        tally.largest = tally.largest.max(f64::from(left.error / left.size));
        for k in 0..SPAWNED {
            let mut dir = rng.direction();
            // A quarter grazes: cosine log-uniform down to a hundredth of the roundoff.
            if k % 4 == 0 {
                let cos = log(rng, -9.0, -1.0) as f32;
                let side = 1f32.copysign(left.n_g.dot(dir));
                dir = ((dir - left.n_g * left.n_g.dot(dir)).normalize() + left.n_g * (cos * side)).normalize();
            }
            rays.push(TestRay::new(spawn_origin(left.p, left.n_g, left.error, dir), dir));
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

type Family = (&'static str, fn(&mut Rng) -> [DVec3; 3]);

/// The specification's families (a) to (c), slivers of a general direction up to 1 : 2000, and triangles in coordinate
/// planes (through the origin every second time), where most bounds vanish.
const FAMILIES: [Family; 5] = [
    ("log-uniform 1e-3..1e3", |r| {
        std::array::from_fn(|_| DVec3::from_array(std::array::from_fn(|_| log(r, -3.0, 3.0))))
    }),
    ("unit at 1e6", |r| std::array::from_fn(|_| DVec3::new(1e6, -1e6, 5e5) + r.cube().as_dvec3())),
    ("1e-4 at (1,1,1)", |r| std::array::from_fn(|_| DVec3::ONE + r.cube().as_dvec3() * 1e-4)),
    ("slivers", |r| {
        let (along, across) = (r.direction().as_dvec3(), r.direction().as_dvec3());
        let (middle, height, at) = (r.cube().as_dvec3(), log(r, -3.3, -0.3), f64::from(r.unit()));
        [middle, middle + along, middle + along * at + across * height]
    }),
    ("coordinate planes", |r| {
        let axis = r.below(3);
        let height = if r.unit() < 0.5 { 0.0 } else { log(r, -3.0, 3.0) };
        std::array::from_fn(|_| {
            let mut p = r.cube().as_dvec3();
            p[axis] = height;
            p
        })
    }),
];

/// Placements within `reach`: rotated, scaled by 0.01..100 (non-uniformly within 30), mirrored.
fn placement(rng: &mut Rng, reach: f64) -> DAffine3 {
    let turn = |rng: &mut Rng| {
        let u: [f32; 4] = std::array::from_fn(|_| rng.unit() - 0.5);
        DMat3::from_quat(Quat::from_array(u).normalize().as_dquat())
    };
    let size = log(rng, -2.0, 2.0);
    let scale = DVec3::new(log(rng, -0.75, 0.75), log(rng, -0.75, 0.75), -log(rng, -0.75, 0.75)) * size;
    DAffine3 {
        matrix3: turn(rng) * DMat3::from_diagonal(scale) * turn(rng),
        translation: rng.cube().as_dvec3() * reach,
    }
}

/// What a test run affords per family, or what the environment asks for when constants are validated.
fn rays_per_family() -> u64 {
    std::env::var("PATHSPACE_SPAWN_RAYS").ok().and_then(|n| n.parse().ok()).unwrap_or(450_000)
}

/// Height over longest edge above 2⁻²⁰: below, vertices in f32 do not define a plane.
fn has_area(t: &[Vec3; 3]) -> bool {
    let [a, b, c] = t.map(|v| v.as_dvec3());
    let longest2 = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
    (b - a).cross(c - a).length() > longest2 * 2f64.powi(-20)
}

fn report(case: &mut Case, tracer: impl Display, family: &str, tally: &Tally) {
    case.row(
        format!("{tracer}, {family}"),
        format!("0 of {}", tally.rays),
        format!("{} met again ({} hidden)", tally.again, tally.hidden),
        format!("offset/size {:.1e}, at most {:.1e}", tally.relative / tally.rays as f64, tally.largest),
        tally.again == 0 && tally.rays > 0,
    );
}

/// 2.25·10⁶ rays a tracer from triangles in the world, and as many again per backend over two from instances.
#[test]
fn g07_spawned_rays_do_not_meet_the_triangle_they_leave() {
    let mut case = Case::open("G07", "re-intersection after spawning", "self-intersection offset");
    let rows = tracers();
    for kind in kinds(&rows) {
        'families: for (number, (family, triangle)) in FAMILIES.into_iter().enumerate() {
            let mut rng = Rng::new(number as u64);
            let mut tally = Tally::default();
            while tally.rays < rays_per_family() {
                let triangles: Vec<[Vec3; 3]> =
                    (0..GROUP).map(|_| triangle(&mut rng).map(|p| p.as_vec3())).filter(has_area).collect();
                let geometry = geometry_of(&triangles, &[]);
                if !kind.traces(&geometry) {
                    continue 'families;
                }
                let targets: Vec<_> = (0..40 * triangles.len())
                    .map(|i| {
                        let [u, v] = barycentric(&mut rng);
                        let [a, b, c] = triangles[i % triangles.len()];
                        (hit_point(a, b - a, c - a, u, v), (b - a).length().max((c - a).length()))
                    })
                    .collect();
                respawn(&kind.build(&geometry), &geometry, &targets, &mut rng, &mut tally);
            }
            report(&mut case, kind, family, &tally);
        }
    }
    for row in rows.iter().filter(|row| row.kind != BackendKind::Flat) {
        for (family, reach) in [("instances within 1e3", 1e3), ("instances within 1e6", 1e6)] {
            let mut rng = Rng::new(77);
            let mut tally = Tally::default();
            while tally.rays < rays_per_family() / 2 {
                let triangles: Vec<[Vec3; 3]> =
                    (0..4).map(|_| std::array::from_fn(|_| rng.cube())).filter(has_area).collect();
                let placements: Vec<DAffine3> = (0..8).map(|_| placement(&mut rng, reach)).collect();
                let geometry = geometry_of(&triangles, &placements);
                let targets: Vec<_> = (0..1000)
                    .map(|i| {
                        let [u, v] = barycentric(&mut rng);
                        let [a, b, c] = triangles[i % triangles.len()];
                        let m = &geometry.instances[i % placements.len()].world_from_object;
                        let size = m.transform_vector3(b - a).length().max(m.transform_vector3(c - a).length());
                        (m.transform_point3(hit_point(a, b - a, c - a, u, v)), size)
                    })
                    .collect();
                respawn(&Kind::Row(row).build(&geometry), &geometry, &targets, &mut rng, &mut tally);
            }
            report(&mut case, row.name(), family, &tally);
        }
    }
    case.close();
}

/// A quad at z = 1 under a larger one 2⁻¹⁶ above: 10⁶ spawned rays, none escapes. A direction with z = 2⁻¹²
/// travels 2⁻⁴ to the cover: inside its margin of 1.
#[test]
fn g08_a_thin_gap_does_not_leak() {
    let mut case = Case::open("G08", "thin gap must not leak", "offset larger than the scene's detail");
    let quad =
        |z: f32, half: f32| grid(1, 2.0 * half, z).into_iter().map(move |t| t.map(|p| p - Vec3::new(half, half, 0.0)));
    let geometry = geometry_of(&quad(1.0, 1.0).chain(quad(1.0 + 2f32.powi(-16), 2.0)).collect::<Vec<_>>(), &[]);
    let rows = tracers();
    for kind in kinds(&rows) {
        let tracer = kind.build(&geometry);
        let (mut rng, mut offset, mut leaks) = (Rng::new(8), 0.0f32, 0);
        for _ in 0..100 {
            let rays: Vec<_> = (0..10_000)
                .map(|i| {
                    let [u, v] = barycentric(&mut rng);
                    let left = leave(&geometry, &Found { u, v, triangle: i % 2, inst: INVALID_ID });
                    offset = offset.max(left.error);
                    let dir = warp::cosine_hemisphere([rng.unit(), rng.unit()]).normalize();
                    TestRay::new(spawn_origin(left.p, left.n_g, left.error, dir), dir)
                })
                .collect();
            leaks += rays.len() - tracer.blocked(&rays);
        }
        let difference = format!("offset {offset:.2e} in a gap of {:.2e}", 2f32.powi(-16));
        case.row(kind, "0 of 1000000", format!("{leaks} escaped"), difference, leaks == 0 && offset < 4e-6);
    }
    case.close();
}

/// A unit triangle in z = 0 seen from distances of 1 to 10⁶, 200 000 rays each. Oracle: the point of the same
/// barycentrics in f64, within two ulps of the triangle's extent; the plane exactly.
#[test]
fn g09_hit_points_are_as_accurate_from_afar() {
    let mut case = Case::open("G09", "hit position accuracy with distance", "reconstruction of the hit point");
    let corners = [Vec3::new(-0.5, -0.5, 0.0), Vec3::new(0.5, -0.5, 0.0), Vec3::new(0.0, 0.5, 0.0)];
    let [a, b, c] = corners;
    let geometry = geometry_of(&[corners], &[]);
    for row in &tracers() {
        let tracer = Kind::Row(row).build(&geometry);
        for distance in [1.0f64, 1e2, 1e4, 1e6] {
            let mut rng = Rng::new(9);
            let rays: Vec<_> = (0..200_000)
                .map(|_| {
                    let [u, v] = barycentric(&mut rng);
                    let mut away = rng.direction().as_dvec3();
                    away.z = away.z.abs();
                    let target = hit_point(a, b - a, c - a, u, v).as_dvec3();
                    let org = (away * distance).as_vec3();
                    TestRay::new(org, (target - org.as_dvec3()).normalize().as_vec3())
                })
                .collect();
            let hits: Vec<Found> = tracer.closest(&rays).into_iter().flatten().collect();
            let (mut error, mut off_plane) = (0.0f64, 0);
            for hit in &hits {
                let p = hit_point(a, b - a, c - a, hit.u, hit.v);
                let exact =
                    a.as_dvec3() + (b - a).as_dvec3() * f64::from(hit.u) + (c - a).as_dvec3() * f64::from(hit.v);
                error = error.max((p.as_dvec3() - exact).length());
                off_plane += usize::from(p.z != 0.0);
            }
            case.row(
                format!("{}, from {distance:.0e}", row.name()),
                "error ≤ 1.2e-7, z = 0",
                format!("{error:.2e}"),
                format!("{off_plane} of {} off the plane", hits.len()),
                error <= 1.2e-7 && off_plane == 0 && hits.len() > 80_000,
            );
        }
    }
    case.close();
}

/// Nothing but the light itself between a point and the light, 200 000 segments a family; then a true blocker just in
/// front of it.
#[test]
fn g19_shadow_segments_stop_short_of_their_light() {
    let mut case = Case::open("G19", "shadow ray to a sampled light point", "false occlusion by the light itself");
    let far = DVec3::new(1e6, -1e6, 5e5);
    // Centre, size, distance, and where a blocker stands: at 1e6 coordinates come in steps of 1/16 m, 0.999 of 3 m is
    // the light.
    let families = [
        ("near", DVec3::ZERO, 1.0, 3.0, 0.999),
        ("at 1e6", far, 1.0, 3.0, 0.7),
        ("size 100", DVec3::ZERO, 100.0, 300.0, 0.999),
        ("distance 1e4", DVec3::ZERO, 1.0, 1e4, 0.999),
    ];
    for row in &tracers() {
        for (number, (family, center, size, distance, fraction)) in families.into_iter().enumerate() {
            if row.kind == BackendKind::Flat && center != DVec3::ZERO {
                continue;
            }
            let mut rng = Rng::new(100 + number as u64);
            let (mut segments, mut occluded, mut blockers, mut passed) = (0, 0, 0, 0);
            while segments < 200_000 {
                let light: [Vec3; 3] =
                    std::array::from_fn(|_| (center + rng.cube().as_dvec3() * (0.5 * size)).as_vec3());
                if !has_area(&light) || !Kind::Row(row).traces(&geometry_of(&[light], &[])) {
                    continue;
                }
                let t = record_of(&light);
                let [v0, e1, e2, n_g] = [t.v0, t.e1, t.e2, t.n_g].map(Vec3::from);
                let segment = |rng: &mut Rng| {
                    let org = (center + rng.direction().as_dvec3() * distance).as_vec3();
                    let [u, v] = barycentric(rng);
                    let y = hit_point(v0, e1, e2, u, v);
                    let s = shadow_segment(org, y, n_g, hit_error(v0, e1, e2, y)).expect("points differ");
                    TestRay { tfar: s.tfar, ..TestRay::new(org, s.dir) }
                };
                let rays: Vec<_> = (0..1000).map(|_| segment(&mut rng)).collect();
                occluded += Kind::Row(row).build(&geometry_of(&[light], &[])).blocked(&rays);
                segments += rays.len();

                // One triangle across each of sixteen segments, all in one geometry.
                let blocker = |ray: &TestRay| -> [Vec3; 3] {
                    let frame = Frame::from_normal(ray.dir);
                    let middle = ray.org + ray.dir * (ray.tfar * fraction);
                    let half = 0.25 * size as f32;
                    let corner = |x, y| middle + frame.to_world(Vec3::new(x, y, 0.0)) * half;
                    [corner(-1.0, -1.0), corner(1.0, -1.0), corner(0.0, 2.0)]
                };
                let mut triangles = vec![light];
                triangles.extend(rays[..16].iter().map(blocker));
                blockers += 16;
                passed += 16 - Kind::Row(row).build(&geometry_of(&triangles, &[])).blocked(&rays[..16]);
            }
            case.row(
                format!("{}, {family}", row.name()),
                format!("0 of {segments} occluded"),
                format!("{occluded} occluded"),
                format!("{passed} of {blockers} passed a blocker"),
                occluded == 0 && passed == 0,
            );
        }
    }
    case.close();
}
