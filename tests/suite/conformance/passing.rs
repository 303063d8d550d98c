//! Rays that go on past what they hit: stacks of sheets at the same distance, or almost. Oracle: counting. Every ray
//! must meet every sheet exactly once, on every backend and query mode, whatever lies between the sheets. No failure is
//! allowed.

use glam::{Affine3A, Quat, Vec3};
use pathspace::backend::batch::{LANES, RayHitBlock};
use pathspace::backend::past::{Passed, Past};
use pathspace::backend::{self, Backend, BackendOptions, Coherence};
use pathspace::math::float;
use pathspace::scene::geometry::{Geometry, TriangleMesh};

use super::shapes::{Rng, mesh, placed, with_instances, world};
use super::{TestRay, pack, tracers};

/// Sheets of a stack.
const SHEETS: usize = 7;

/// Rays a stack.
const RAYS: usize = 40;

/// Two triangles.
type Sheet = [[Vec3; 3]; 2];

/// What each ray meets until it meets nothing: (instance, triangle), in the order of meeting.
fn all_hits(backend: &dyn Backend, geometry: &Geometry, rays: &[TestRay]) -> Vec<Vec<(u32, u32)>> {
    let mut met = vec![Vec::new(); rays.len()];
    let (mut past, mut passed) = (Past::default(), vec![Passed::NOTHING; rays.len()]);
    (0..rays.len()).for_each(|lane| past.set(lane, Passed::NOTHING));
    let mut starts: Vec<f32> = rays.iter().map(|ray| ray.tnear).collect();
    for round in 0..4 * SHEETS {
        let mut blocks: Vec<RayHitBlock> = pack(rays);
        for (lane, start) in starts.iter().enumerate() {
            blocks[lane / LANES].ray.tnear[lane % LANES] = *start;
        }
        let invalid = match round {
            0 => backend.closest_hit(&mut blocks, rays.len(), Coherence::Incoherent),
            _ => backend.closest_hit_past(&mut blocks, rays.len(), &past),
        };
        assert_eq!(invalid, 0);
        let mut left = 0;
        for (lane, ray) in rays.iter().enumerate() {
            let Some(hit) = blocks[lane / LANES].hit(lane % LANES) else { continue };
            left += 1;
            met[lane].push((hit.inst, hit.prim));
            let mesh = &geometry.meshes[hit.geom as usize];
            let to_world =
                geometry.instances.get(hit.inst as usize).map_or(Affine3A::IDENTITY, |p| p.world_from_object);
            let corner =
                |i: usize| to_world.transform_point3(mesh.vertices[mesh.indices[hit.prim as usize][i] as usize]);
            let (v0, e1, e2) = (corner(0), corner(1) - corner(0), corner(2) - corner(0));
            let error = float::hit_error(v0, e1, e2, float::hit_point(v0, e1, e2, hit.u, hit.v));
            starts[lane] =
                starts[lane].max(float::before(hit.t, ray.org, error, e1.cross(e2).normalize().dot(ray.dir)));
            passed[lane] = past.add(passed[lane], &hit);
            past.set(lane, passed[lane]);
        }
        if left == 0 {
            break;
        }
    }
    met
}

/// Each ray of `rays` must meet each of the `count` sheets once; `sheet` numbers them.
fn check(name: &str, geometry: &Geometry, rays: &[TestRay], count: usize, sheet: impl Fn(u32, u32) -> usize) {
    let mut failed = Vec::new();
    for row in tracers() {
        if !row.kind.traces(geometry) {
            continue;
        }
        let options = BackendOptions { passes: true, build_threads: 1, ..BackendOptions::with_mode(row.mode) };
        let backend = backend::select::build(row.kind, geometry, &options).expect("the backend builds");
        let met = all_hits(backend.as_ref(), geometry, rays);
        let wrong = |hits: &&Vec<(u32, u32)>| {
            let mut times = vec![0; count];
            hits.iter().for_each(|&(inst, prim)| times[sheet(inst, prim)] += 1);
            times.iter().any(|&n| n != 1)
        };
        if let Some(example) = met.iter().find(wrong) {
            failed.push(format!(
                "{name}, {}: {} of {RAYS} rays, as {example:?}",
                row.name(),
                met.iter().filter(wrong).count()
            ));
        }
    }
    assert!(failed.is_empty(), "sheets were skipped or met twice\n{}", failed.join("\n"));
}

/// A square of side 2·`scale` in the plane x-z, turned by `turn`, raised by `up` along y before.
fn square(scale: f32, turn: Quat, up: f32) -> Sheet {
    let [a, b, c, d] =
        [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)].map(|(x, z)| turn * Vec3::new(x * scale, up, z * scale));
    [[a, b, c], [a, c, d]]
}

/// Rays towards inner points of the square, within 80° of its normal, from about `scale` away.
fn rays(rng: &mut Rng, scale: f32, turn: Quat) -> Vec<TestRay> {
    (0..RAYS)
        .map(|_| {
            let towards = Vec3::new(rng.unit() * 1.4 - 0.7, 0.0, rng.unit() * 1.4 - 0.7);
            let from = loop {
                let d = rng.direction();
                if d.y > 0.18 {
                    break d * (0.3 + 3.0 * rng.unit());
                }
            };
            let org = turn * ((towards + from) * scale);
            TestRay::new(org, (turn * -from).normalize())
        })
        .collect()
}

/// Gaps from nothing to a thousandth of the squares, in a coordinate plane and across, from a millimetre to 10 km.
#[test]
fn every_sheet_is_met_once() {
    let mut rng = Rng::new(2026);
    for scale in [1e-3f32, 1.0, 1e4] {
        for turn in [Quat::IDENTITY, Quat::from_euler(glam::EulerRot::XYZ, 0.4, 0.3, -0.7)] {
            for gap in [0.0, f32::EPSILON / 2.0, 1e-7, 1e-6, 1e-3] {
                let sheets: Vec<Sheet> = (0..SHEETS).map(|i| square(scale, turn, i as f32 * gap * scale)).collect();
                let geometry = world(mesh(sheets.as_flattened()));
                let rays = rays(&mut rng, scale, turn);
                let name = format!("scale {scale}, gap {gap}, turned {}", turn != Quat::IDENTITY);
                check(&name, &geometry, &rays, SHEETS, |_, prim| prim as usize / 2);
            }
        }
    }
}

/// Copies of one mesh at one place count each, and so does the world's.
#[test]
fn coincident_instances_are_met_once() {
    let mut rng = Rng::new(2027);
    let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.2, -0.3, 0.5);
    let sheet = mesh(&square(1.0, turn, 0.0));
    let instances = vec![placed(1, Affine3A::IDENTITY), placed(1, Affine3A::IDENTITY)];
    let geometry = with_instances(vec![sheet.clone(), TriangleMesh { first_triangle: 2, ..sheet }], instances);
    let rays = rays(&mut rng, 1.0, turn);
    check("instances", &geometry, &rays, 3, |inst, _| inst.wrapping_add(1) as usize);
}
