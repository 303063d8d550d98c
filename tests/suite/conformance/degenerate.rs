//! Geometry that upsets builders and tests: thin margins, degenerate and coincident triangles (HARDCASES G04, G13–G15).
//! Oracles stand at each test; no failure is allowed.

use std::time::{Duration, Instant};

use glam::Vec3;
use pathspace::backend::{BackendKind, BackendOptions, Coherence};

use super::shapes::{Rng, grid, mesh, world};
use super::{Case, TestRay, bits, check, closest, each_backend};

/// G04: a ray parallel to two axes passes at `margin` from the rim of a quad at distance `d`; a reciprocal that is
/// clamped too low loses it. Oracle: the quad's plane; |t/d − 1| ≤ 2⁻²³.
#[test]
fn axis_parallel_ray_close_to_a_box_face() {
    for margin in [1e-3f32, 1e-4, 1e-5, 1e-6] {
        for d in [1.0f32, 1e1, 1e2, 1e3, 1e4] {
            let [a, b] = [Vec3::new(-1.0, -1.0, d), Vec3::new(margin, -1.0, d)];
            let [c, e] = [Vec3::new(-1.0, 3.0, d), Vec3::new(margin, 3.0, d)];
            let elsewhere = [Vec3::new(50.0, 0.0, 0.0), Vec3::new(51.0, 0.0, 0.0), Vec3::new(50.0, 1.0, 0.0)];
            each_backend(&world(mesh(&[[a, b, c], [b, e, c], elsewhere])), |row, backend| {
                for zero in [0.0f32, -0.0] {
                    let ray = TestRay::new(Vec3::new(0.0, 0.25, 0.0), Vec3::new(zero, zero, 1.0));
                    let hit = closest(backend, &[ray], Coherence::Incoherent)[0];
                    let t = hit.map_or(f32::NAN, |h| h.t);
                    let close = (f64::from(t) / f64::from(d) - 1.0).abs() <= f64::from(f32::EPSILON);
                    assert!(close, "{} {}: margin {margin}, distance {d}: {hit:?}", row.kind.name(), row.mode);
                }
            });
        }
    }
}

/// G13: a quad with a thousand degenerate triangles mixed in gives the hits of the clean quad. Oracle: the clean quad on
/// the same backend, bit for bit (prim ids mapped). Embree keeps needles of positive area, so it is spared those.
#[test]
fn degenerate_triangles_are_not_hit() {
    let quad = grid(1, 1.0, 0.0);
    let mut rng = Rng::new(31);
    let mut bad = Vec::new();
    for i in 0..1000 {
        let [p, q] = [rng.cube(), rng.cube()];
        bad.push(match i % 4 {
            0 => [p, q, p],
            1 => [p, p, p],
            // Collinear in binary: steps of a dyadic vector.
            2 => {
                let [from, by] = [p, q].map(|v| (v * 64.0).round() / 64.0);
                [from, from + by, from + by * 3.0]
            }
            _ => [Vec3::ZERO, Vec3::X, Vec3::new(0.5, 1e-30, 0.0)],
        });
    }
    let collinear = [
        Vec3::new(-1_113.454_6, -79.049_614, -56.243_19),
        Vec3::new(-1_113.454_6, -87.092_27, -56.243_19),
        Vec3::new(-1_113.454_6, -79.209_015, -56.243_19),
    ];
    let mut rays: Vec<TestRay> = (0..2000)
        .map(|_| {
            let org = rng.cube() * 2.0;
            TestRay::new(org, (Vec3::new(rng.unit(), rng.unit(), 0.0) - org).normalize())
        })
        .collect();
    let dir = Vec3::new(-32.107_3, -183.355_87, -144.607_64);
    rays.push(TestRay {
        tfar: 0.999_9 * dir.length(),
        ..TestRay::new(Vec3::new(-1_081.479_2, 99.999_954, 87.770_11), dir.normalize())
    });

    let needles = |triangle: &[Vec3; 3]| triangle[2].y == 1e-30;
    for with_needles in [false, true] {
        let mut triangles: Vec<_> = bad.iter().filter(|t| with_needles || !needles(t)).copied().collect();
        triangles.push(collinear);
        let middle = triangles.len() / 2;
        triangles.splice(middle..middle, quad.iter().copied());
        let mut clean = Vec::new();
        each_backend(&world(mesh(&quad)), |_, backend| clean.push(closest(backend, &rays, Coherence::Incoherent)));
        let mut clean = clean.into_iter();
        each_backend(&world(mesh(&triangles)), |row, backend| {
            let expected = clean.next().expect("the same rows");
            if with_needles && row.kind == BackendKind::Embree {
                return;
            }
            for (ray, (got, mut expected)) in
                rays.iter().zip(closest(backend, &rays, Coherence::Incoherent).iter().zip(expected))
            {
                if let Some(hit) = &mut expected {
                    hit.prim += middle as u32;
                }
                assert_eq!(bits(got), bits(&expected), "{} {}: {ray:?}", row.kind.name(), row.mode);
            }
        });
    }
}

/// G14: two coincident grids in one mesh, the second in another order. Oracle: brute force, whose tie goes to the lowest id.
#[test]
fn coincident_surfaces() {
    let mut triangles = grid(16, 1.0, 0.0);
    let mut copies = triangles.clone();
    copies.reverse();
    triangles.extend(copies);
    // The same surface once more with the corners turned: not a copy bit for bit, but at the same distance.
    triangles.extend(grid(16, 1.0, 0.0).iter().map(|&[a, b, c]| [b, c, a]));
    let mut rng = Rng::new(32);
    let rays = (0..2000)
        .map(|i| {
            // Half of them head-on through a dyadic lattice: edges and corners.
            let (x, y) = (rng.below(65) as f32 / 64.0, rng.below(65) as f32 / 64.0);
            let org = Vec3::new(x, y, 1.0);
            let dir = if i % 2 == 0 { Vec3::NEG_Z } else { (Vec3::new(rng.unit(), rng.unit(), 0.0) - org).normalize() };
            TestRay::new(org, dir)
        })
        .collect();
    check(&[Case::open("coincident grids", world(mesh(&triangles)), rays)]);
}

/// G15: identical triangles, concentric ones and points. Oracle: closed form; the nearest is the first copy. A builder
/// that chains is quadratic: 10⁵ copies took it more than 100 s, so a limit of 10 s separates the two even on a loaded machine.
#[test]
fn identical_and_concentric_triangles() {
    let unit = [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(0.0, 1.0, 0.0)];
    for n in [10usize, 100, 1000, 100_000] {
        let concentric = |i: usize| unit.map(|p| p * (1.0 + i as f32 / n as f32));
        let meshes = [
            ("identical", vec![unit; n], Some(0)),
            ("concentric", (0..n).map(concentric).collect(), Some(0)),
            ("points", vec![[Vec3::ONE; 3]; n], None),
        ];
        for (name, triangles, expected) in meshes {
            let geometry = world(mesh(&triangles));
            for &kind in BackendKind::available() {
                let rows = super::rows();
                let Some(row) = rows.iter().find(|r| r.kind == kind) else { continue };
                let start = Instant::now();
                let backend = pathspace::backend::build(kind, &geometry, &BackendOptions::default()).expect("builds");
                let spent = start.elapsed();
                assert!(spent < Duration::from_secs(10), "{}: {n} {name} triangles took {spent:?}", kind.name());
                let ray = TestRay::new(Vec3::new(0.0, 0.0, 2.0), Vec3::NEG_Z);
                let hit = closest(backend.as_ref(), &[ray], Coherence::Incoherent)[0];
                // Embree divides by an approximate reciprocal: four ulps.
                let near = hit.map(|h| (h.t - 2.0).abs() <= 4.0 * 2.0 * f32::EPSILON);
                assert_eq!(near, expected.map(|_| true), "{}: {n} {name}: {hit:?}", kind.name());
                if row.rule == super::Rule::Exact {
                    assert_eq!(hit.map(|h| h.prim), expected, "{}: {n} {name}", kind.name());
                }
            }
        }
    }
}
