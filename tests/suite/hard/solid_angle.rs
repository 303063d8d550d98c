//! Solid angles of lights. The renderer does not sample by them: it draws points by area and converts their density, so
//! the solid angle is what 1/pdf adds up to over the light. It is summed by quadrature: no statistics.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DVec3, Vec3};
use pathspace::math::warp::cap_solid_angle;
use pathspace::plan::options::Strategy;
use pathspace::scene::Scene;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::geometry::Geometry;
use pathspace::shading::light::Lights;
use serde_json::json;

use super::Case;
use super::modes::Mode;
use super::receiver::{Means, Receiver, with};
use crate::meter::{Random, lights_of};

/// Cells of a light have at most this share of their distance as a side: the rule's error is then below 1e-7.
const CELL: f64 = 0.1;

/// Points and weights of degree 5 on a triangle (Dunavant 1985): barycentric of one corner, weight.
const RULE: [([f64; 2], f64); 7] = {
    const A: f64 = 0.470_142_064_105_115;
    const B: f64 = 0.101_286_507_323_456;
    const W: [f64; 2] = [0.132_394_152_788_506, 0.125_939_180_544_827];
    [
        ([1.0 / 3.0, 1.0 / 3.0], 0.225),
        ([A, A], W[0]),
        ([A, 1.0 - 2.0 * A], W[0]),
        ([1.0 - 2.0 * A, A], W[0]),
        ([B, B], W[1]),
        ([B, 1.0 - 2.0 * B], W[1]),
        ([1.0 - 2.0 * B, B], W[1]),
    ]
};

/// Exact solid angle of a triangle (Van Oosterom and Strackee 1983), with the determinant from its edges.
fn exact(p: DVec3, corners: [DVec3; 3]) -> f64 {
    let [a, b, c] = corners.map(|corner| corner - p);
    let determinant = (b - a).cross(c - a).dot(a).abs();
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    2.0 * determinant.atan2(la * lb * lc + a.dot(b) * lc + a.dot(c) * lb + b.dot(c) * la)
}

/// ∫ 1/pdf over a triangle that is the only light, from `p`. The points that are drawn are rounded to f32: what is
/// summed is the true density at the cell's point, and the difference of the light's own density to the true one at the
/// point that it drew.
fn solid_angle(lights: &Lights, p: Vec3, corners: [DVec3; 3]) -> f64 {
    let [v0, v1, v2] = corners;
    let (e1, e2) = (v1 - v0, v2 - v0);
    let cross = e1.cross(e2);
    let density = |position: DVec3| {
        let to_light = position - p.as_dvec3();
        let distance2 = to_light.length_squared();
        0.5 * to_light.dot(cross).abs() / (distance2 * distance2.sqrt())
    };
    let at = |[s, t]: [f64; 2]| v0 + e1 * s + e2 * t;
    let mut sum = 0.0;
    // Cells as barycentric corners; the longest edge is halved until the cell is small.
    let mut cells = vec![([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], 1.0)];
    while let Some((cell, share)) = cells.pop() {
        let world = cell.map(at);
        let edge = |i: usize| (world[(i + 1) % 3] - world[i]).length();
        let longest = (0..3).max_by(|&i, &j| edge(i).total_cmp(&edge(j))).expect("three edges");
        let centre = (world[0] + world[1] + world[2]) / 3.0;
        if edge(longest) > CELL * (centre - p.as_dvec3()).length() {
            let (i, j, k) = (longest, (longest + 1) % 3, (longest + 2) % 3);
            let half: [f64; 2] = std::array::from_fn(|d| 0.5 * (cell[i][d] + cell[j][d]));
            cells.push(([cell[i], half, cell[k]], 0.5 * share));
            cells.push(([half, cell[j], cell[k]], 0.5 * share));
            continue;
        }
        for ([s, t], weight) in RULE {
            let point: [f64; 2] =
                std::array::from_fn(|d| cell[0][d] + s * (cell[1][d] - cell[0][d]) + t * (cell[2][d] - cell[0][d]));
            let found = lights.sample(p, Vec3::ZERO, inverse_map(point)).map_or(0.0, |sample| {
                let drawn = sample.target.expect("finite").position.as_dvec3();
                1.0 / f64::from(sample.pdf_sa) - density(drawn)
            });
            sum += share * weight * (density(at(point)) + found);
        }
    }
    sum
}

/// The numbers by which a light is sampled at this point.
fn inverse_map([b1, b2]: [f64; 2]) -> [f32; 3] {
    let uv = if b2 > b1 { [2.0 * b1, b1 + b2] } else { [b1 + b2, 2.0 * b2] };
    let [u, v] = uv.map(|x| (x as f32).min(1.0 - f32::EPSILON / 2.0));
    [0.0, u, v]
}

/// The same for a triangle made in code.
fn solid_angle_of(p: Vec3, corners: [Vec3; 3]) -> f64 {
    // The side that emits is turned to the receiver.
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let front = (b - a).cross(c - a).dot(p.as_dvec3() - a) > 0.0;
    let corners = if front { corners } else { [corners[0], corners[2], corners[1]] };
    solid_angle(&lights_of(&[(corners, 0)]), p, corners.map(Vec3::as_dvec3))
}

/// The faces of a mesh that look at `p`.
fn facing(p: Vec3, positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<[Vec3; 3]> {
    let corners = triangles.iter().map(|t| t.map(|i| positions[i as usize]));
    let towards =
        |[a, b, c]: &[Vec3; 3]| (*b - *a).as_dvec3().cross((*c - *a).as_dvec3()).dot((p - *a).as_dvec3()) > 0.0;
    corners.filter(towards).collect()
}

#[test]
fn l06_small_sphere() {
    let mut case = Case::open("L06", "solid angle of a small sphere (mesh)", "cancellation in 1 − cos");
    // No sphere primitive, no cone sampling: the sphere is a mesh around the origin, from 1 m away. Its outline lies
    // between the sphere's and that of the sphere which its faces touch, cos²(π/64) as large.
    let sizes = [
        (0.1, 0.03149486152),
        (0.01, 0.0003141671197),
        (1e-3, 3.141593439e-06),
        (3e-4, 2.827433452e-07),
        (1e-4, 3.141592661e-08),
        (1e-5, 3.141592654e-10),
    ];
    let rows = 32;
    let found = sizes.map(|(s, expected)| {
        let mut b = SceneBuilder::new();
        let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
        b.sphere(Vec3::ZERO, s as f32, rows, false, false, lamp);
        let mesh = b.build().meshes.swap_remove(0);
        let faces = facing(Vec3::Z, &mesh.positions, &mesh.triangles);
        let sum: f64 = faces.iter().map(|&corners| solid_angle_of(Vec3::Z, corners)).sum();
        let of_mesh: f64 = faces.iter().map(|corners| exact(DVec3::Z, corners.map(Vec3::as_dvec3))).sum();
        (s, expected, sum, of_mesh)
    });
    case.numbers("- (1/pdf, summed)", found.map(|(_, _, sum, of_mesh)| (of_mesh, sum, 2f64.powi(-22))));
    let stable = |s: f64| 2.0 * PI * s * s / (1.0 + (1.0 - s * s).sqrt());
    let least = (PI / f64::from(2 * rows)).cos().powi(2);
    let bound = |s: f64| 1.0 - stable(s * least) / stable(s) + 1e-6;
    case.numbers("- (mesh against the sphere)", found.map(|(s, expected, _, of_mesh)| (expected, of_mesh, bound(s))));
    // The formula for caps in f32, at the cap's f32 half-angle.
    let cap = |s: f64| {
        let half_angle = s.asin() as f32;
        (4.0 * PI * (0.5 * f64::from(half_angle)).sin().powi(2), f64::from(cap_solid_angle(half_angle)), 2f64.powi(-22))
    };
    case.numbers("- (cap in f32)", sizes.map(|(s, _)| cap(s)));
    case.numbers("- (stable form in f64)", sizes.map(|(s, expected)| (expected, stable(s), 1e-9)));
    case.close();
}

#[test]
fn l07_distant_sun() {
    let mut case = Case::open("L07", "sun as a distant disc (fan of 8192 triangles)", "small angles in f32");
    // A disc about the origin of the sun's half angle, 0.2665°, from 1 m away; it lacks 1e-7 of a round one.
    let alpha = 0.2665f64.to_radians();
    let (sides, radius) = (8192, alpha.tan());
    let ring = |i: u32| {
        let angle = 2.0 * PI * f64::from(i % sides) / f64::from(sides);
        DVec3::new(radius * angle.cos(), radius * angle.sin(), 0.0).as_vec3()
    };
    let triangles: Vec<[Vec3; 3]> = (0..sides).map(|i| [Vec3::ZERO, ring(i + 1), ring(i)]).collect();
    let sum: f64 = triangles.iter().map(|&corners| solid_angle_of(-Vec3::Z, corners)).sum();
    case.number("- (1/pdf, summed)", 6.796702357e-05, sum, 1e-6);
    case.number("- (cap in f32)", 6.796702357e-05, f64::from(cap_solid_angle(alpha as f32)), 1e-6);
    let sun = |b: &mut SceneBuilder| {
        let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
        let corners: Vec<Vec3> = triangles.iter().flatten().map(|corner| *corner + Vec3::Z).collect();
        b.triangles(corners, (0..sides).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(), lamp);
    };
    let expected = 6.796665596e-05;
    for mode in Mode::all() {
        let n = if mode.is_main() {
            1 << 18
        } else if mode.is_brute() {
            1 << 8
        } else {
            1 << 14
        };
        let mut means = Means::default();
        let receiver = Receiver::new(Vec3::ZERO, Vec3::Z, &sun);
        let estimate = receiver.irradiance(n, with(&mode, Strategy::MIS, 7));
        means.add("light sampling and BSDF sampling", expected, 1e-5 * expected, 1e-2, estimate);
        means.judge(&mut case, &mode.name);
    }
    case.close();
}

#[test]
fn l11_extreme_triangles() {
    let mut case = Case::open("L11", "tiny, huge, sliver and far triangles", "cancellation in solid angles");
    let v = Vec3::new;
    let legs = |l: f32| [v(0.0, 0.0, 1.0), v(l, 0.0, 1.0), v(0.0, l, 1.0)];
    let around = |h: f64| {
        [0.0, 120.0, 240.0].map(|degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            DVec3::new(cos, sin, h).as_vec3()
        })
    };
    let listed = [
        ("legs 1e-1", legs(1e-1), 0.00497514505, 1e-6),
        ("legs 1e-2", legs(1e-2), 4.999749791e-05, 1e-6),
        ("legs 1e-3", legs(1e-3), 4.999997975e-07, 1e-6),
        ("legs 1e-4", legs(1e-4), 4.999999722e-09, 1e-6),
        ("legs 1e-5", legs(1e-5), 4.999999747e-11, 1e-6),
        ("octant", [Vec3::X, Vec3::Y, Vec3::Z], FRAC_PI_2, 1e-6),
        ("near a hemisphere, 1e-4", around(1e-4), 6.282146077, 1e-6),
        ("near a hemisphere, 1e-2", around(1e-2), 6.179277845, 1e-6),
        ("sliver", [v(-0.5, 0.0, 0.01), v(0.5, 0.0, 0.01), v(0.5, 1e-4, 0.01)], 0.009997917189, 2e-4),
    ];
    for (what, corners, expected, bound) in listed {
        case.number(format!("- ({what})"), expected, solid_angle_of(Vec3::ZERO, corners), bound);
    }
    let flat = [v(1.0, 0.0, 0.0), v(2.0, 0.0, 0.0), v(1.0, 1.0, 0.0)];
    case.number("- (edge-on)", 2.071067807e-07, solid_angle_of(v(0.0, 0.0, 1e-6), flat), 1e-6);
    case.number("- (far from the origin, loaded from a file)", 0.06923949433, far_triangle(), 1e-6);

    let mut random = Random(11);
    let pairs: Vec<_> = (0..4000)
        .map(|_| {
            let size = random.log_uniform(1e-4, 10.0) as f32;
            let at = random.direction() * random.log_uniform(0.1, 100.0) as f32;
            let corners = std::array::from_fn(|_| at + random.direction() * size);
            (exact(DVec3::ZERO, corners.map(|c: Vec3| c.as_dvec3())), solid_angle_of(Vec3::ZERO, corners), 1e-4)
        })
        .collect();
    case.numbers("- (random)", pairs);
    case.close();
}

/// A triangle a million metres from the origin, as the loader places it, from its apex.
fn far_triangle() -> f64 {
    let corners = [[1000001.0f32, 1e6, 1000002.0], [1000002.0, 1e6, 1000002.0], [1000001.0, 1000001.0, 1000002.0]];
    let binary: Vec<u8> = corners.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("far.bin"), &binary).expect("written");
    let document = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "materials": [{"emissiveFactor": [1, 1, 1]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3,
             "min": [1000001.0, 1e6, 1000002.0], "max": [1000002.0, 1000001.0, 1000002.0]},
            {"bufferView": 1, "componentType": 5121, "type": "SCALAR", "count": 3}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 3}],
        "buffers": [{"uri": "far.bin", "byteLength": 39}]
    });
    // Counter-clockwise seen from the apex.
    std::fs::write(folder.path().join("far.bin"), [binary, vec![0, 2, 1]].concat()).expect("written");
    let file = folder.path().join("far.gltf");
    std::fs::write(&file, document.to_string()).expect("written");
    let scene = Scene::load(&file).expect("a scene");
    let lights = Lights::build(&scene, &Geometry::build(&scene)).expect("valid lights");
    let apex = (DVec3::splat(1e6) - scene.origin).as_vec3();
    let [a, b, c] = corners.map(|c| Vec3::from(c).as_dvec3() - scene.origin);
    solid_angle(&lights, apex, [a, c, b])
}
