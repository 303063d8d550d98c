//! Instances that move: rays of any time in one batch, against brute force over the scene as it stands at that time,
//! which knows no motion. Some of them change their shape as well. Also rays that leave a moving triangle. Oracles:
//! frozen geometry, [`exact`]; no re-hit. Nothing random is left: rate 0.

use glam::{Affine3A, Mat3A, Quat, Vec3};
use pathspace::backend::batch::{BLOCKED, Hit, LANES, RayBlock, RayHitBlock};
use pathspace::backend::{self, Backend, BackendKind, BackendOptions, Coherence};
use pathspace::math::float::spawn_origin;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::geometry::Geometry;
use pathspace::scene::motion::part_of;
use pathspace::scene::{Mesh, Shape};
use pathspace::shading::interaction::Interaction;

use super::shapes::{Rng, cube, soup};
use super::{Rule, TestRay, bits, closest, each_backend, exact, pack};

/// Places over the shutter, by the number of parts.
fn way(parts: usize, at: impl Fn(f32) -> Affine3A) -> Vec<Affine3A> {
    (0..=parts).map(|i| at(i as f32 / parts as f32)).collect()
}

/// A still soup, and six things that move: straight on, turning, mirrored and stretched, growing, far off, and with a
/// copy.
fn scene() -> Geometry {
    let mut rng = Rng::new(31);
    let mut b = SceneBuilder::new();
    let paper = b.lambert(Vec3::ONE);
    let mesh = |b: &mut SceneBuilder, triangles: &[[Vec3; 3]]| {
        let corners = triangles.iter().flatten().copied().collect();
        b.mesh(corners, (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(), paper)
    };
    let world = mesh(&mut b, &soup(&mut rng, 40, 0.5));
    let [heap, crate_] = [mesh(&mut b, &soup(&mut rng, 80, 0.4)), mesh(&mut b, &cube())];
    b.place(world, Affine3A::IDENTITY);
    let axis = rng.direction();
    let place = |scale: Vec3, angle: f32, at: Vec3| {
        Affine3A::from_scale_rotation_translation(scale, Quat::from_axis_angle(axis, angle), at)
    };
    b.place_moving(heap, way(1, |t| place(Vec3::ONE, 0.0, Vec3::new(2.5, 3.0 * t, 0.0))));
    b.place_moving(heap, way(8, |t| place(Vec3::ONE, 3.0 * t, Vec3::new(-2.5, 0.0, t))));
    b.place_moving(crate_, way(4, |t| place(Vec3::new(-2.0, 1.0, 0.3 + t), 1.0 + t, Vec3::new(0.0, 2.5 - t, 0.0))));
    b.place_moving(crate_, way(2, |t| place(Vec3::splat(0.5 + t), 0.3, Vec3::new(0.0, -2.5, 0.0))));
    b.place_moving(heap, way(1, |t| place(Vec3::splat(40.0), t, Vec3::new(9.0 + 30.0 * t, 3.0, -60.0))));
    b.place(crate_, place(Vec3::ONE, 0.4, Vec3::new(0.0, 0.0, 2.5)));
    b.place_moving(crate_, way(1, |t| place(Vec3::ONE, 0.4, Vec3::new(0.0, 0.0, 2.5 + t))));
    Geometry::build(&b.build())
}

/// A still soup, and five that change their shapes in one part and in eight: at rest, on the move, flattened and
/// mirrored, and two of one mesh. In one of them triangles have no area at either end, or at all but one shape.
fn changing() -> Geometry {
    let mut rng = Rng::new(41);
    let mut b = SceneBuilder::new();
    let paper = b.lambert(Vec3::ONE);
    let world: Vec<Vec3> = soup(&mut rng, 40, 0.5).into_iter().flatten().collect();
    let three = |triangles: u32| (0..triangles).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect::<Vec<_>>();
    b.triangles(world, three(40), paper);
    let mut mesh = |parts: usize, collapsed: bool| {
        let mut shape = || soup(&mut rng, 80, 0.4).into_iter().flatten().collect::<Vec<Vec3>>();
        let mut shapes: Vec<Vec<Vec3>> = (0..=parts).map(|_| shape()).collect();
        if collapsed {
            let last = shapes.len() - 1;
            shapes[0][..9].fill(Vec3::splat(0.25));
            shapes[last][9..18].fill(Vec3::splat(-0.25));
            shapes[1..].iter_mut().for_each(|shape| shape[18..27].fill(Vec3::X));
        }
        let mut shapes = shapes.into_iter();
        let positions = shapes.next().expect("a first shape");
        let later = shapes.map(|positions| Shape { positions, ..Shape::default() }).collect();
        b.full_mesh(Mesh { positions, later, triangles: three(80), material: paper, ..Mesh::default() })
    };
    let (straight, bent) = (mesh(1, true), mesh(8, false));
    let axis = rng.direction();
    let place = |scale: Vec3, angle: f32, at: Vec3| {
        Affine3A::from_scale_rotation_translation(scale, Quat::from_axis_angle(axis, angle), at)
    };
    b.place_moving(straight, vec![place(Vec3::ONE, 0.3, Vec3::new(2.5, 0.0, 0.0)); 2]);
    b.place_moving(bent, way(4, |t| place(Vec3::ONE, 2.0 * t, Vec3::new(-2.5, 0.0, 2.0 * t))));
    b.place_moving(bent, way(1, |t| place(Vec3::new(-1.0, 0.3, 1.0 + t), 1.0, Vec3::new(0.0, 2.5, 0.0))));
    b.place_moving(straight, way(2, |t| place(Vec3::splat(0.5 + t), 0.0, Vec3::new(0.0, -2.5, 0.0))));
    b.place_moving(straight, vec![place(Vec3::splat(40.0), 0.0, Vec3::new(9.0, 3.0, -60.0)); 2]);
    let scene = b.build();
    scene.validate().expect("a sound scene");
    Geometry::build(&scene)
}

/// The scene as it stands at `time`.
fn frozen(geometry: &Geometry, time: f32) -> Geometry {
    let mut frozen = geometry.clone();
    for mesh in frozen.meshes.iter_mut().filter(|mesh| !mesh.later.is_empty()) {
        let later = std::mem::take(&mut mesh.later);
        let (part, fraction) = part_of(time, later.len());
        let from = if part == 0 { mesh.vertices.clone() } else { later[part - 1].clone() };
        mesh.vertices = from.iter().zip(&later[part]).map(|(&from, &to)| from + (to - from) * fraction).collect();
    }
    frozen.deforming = Default::default();
    for (i, placement) in (0u32..).zip(&mut frozen.instances) {
        *placement = geometry.moving.at(i, time).unwrap_or(*placement);
    }
    frozen.moving = Default::default();
    frozen
}

/// `rays` in blocks, each with its time.
fn pack_timed(rays: &[(TestRay, f32)]) -> Vec<RayHitBlock> {
    let mut blocks = pack(&rays.iter().map(|(ray, _)| *ray).collect::<Vec<_>>());
    for (i, (_, time)) in rays.iter().enumerate() {
        blocks[i / LANES].ray.time[i % LANES] = *time;
    }
    blocks
}

fn trace(backend: &dyn Backend, rays: &[(TestRay, f32)], hint: Coherence) -> Vec<Option<Hit>> {
    let mut blocks = pack_timed(rays);
    assert_eq!(backend.closest_hit(&mut blocks, rays.len(), hint), 0, "valid rays were rejected");
    (0..rays.len()).map(|i| blocks[i / LANES].hit(i % LANES)).collect()
}

#[test]
fn backends_agree_at_every_time() {
    let geometry = scene();
    assert_eq!((geometry.instances.len(), geometry.moving.steps(0).len()), (6, 2), "what is at rest is baked");
    expect_agreement(geometry);
}

#[test]
fn backends_agree_on_changing_shapes() {
    let geometry = changing();
    assert_eq!(geometry.instances.len(), 5);
    assert_eq!(geometry.meshes.iter().map(|mesh| mesh.later.len()).collect::<Vec<_>>(), [0, 1, 8]);
    expect_agreement(geometry);
}

fn expect_agreement(geometry: Geometry) {
    const TIMES: usize = 60;
    let mut rng = Rng::new(32);
    let mut times: Vec<f32> = (2..TIMES).map(|_| rng.unit()).collect();
    times.extend([0.0, 1.0 - f32::EPSILON / 2.0]);
    let stills: Vec<Geometry> = times.iter().map(|&time| frozen(&geometry, time)).collect();
    // Neighbours in a packet have different times.
    let rays: Vec<(TestRay, f32)> = (0..100 * TIMES)
        .map(|i| {
            let still = &stills[i % TIMES];
            let placement = still.instances[(i / TIMES) % still.instances.len()];
            let target = placement.world_from_object.transform_point3(rng.cube() * 0.6);
            let org = rng.cube() * 8.0;
            (TestRay::new(org, (target - org).normalize()), times[i % TIMES])
        })
        .collect();
    let mut oracle = vec![None; rays.len()];
    for (t, still) in stills.iter().enumerate() {
        let brute =
            backend::select::build(BackendKind::Brute, still, &BackendOptions::default()).expect("brute builds");
        let of_time: Vec<TestRay> = rays.iter().skip(t).step_by(TIMES).map(|(ray, _)| *ray).collect();
        let hits = closest(brute.as_ref(), &of_time, Coherence::Incoherent);
        for (k, hit) in hits.into_iter().enumerate() {
            oracle[t + k * TIMES] = hit;
        }
    }
    let hits = oracle.iter().flatten().filter(|hit| hit.geom != 0).count();
    assert!(hits > rays.len() / 4, "{hits} rays meet what moves");
    each_backend(&geometry, |row, backend| {
        // Brute force is the same code as the oracle, and is held to its bits here.
        let exactly = row.rule == Rule::Exact || row.kind == BackendKind::Brute;
        let fits = |ray: usize, got: &Option<Hit>| {
            let still = &stills[ray % TIMES];
            let same = bits(&oracle[ray]) == bits(got);
            same || (!exactly && exact::plausible(still, &rays[ray].0, got.as_ref()))
        };
        for hint in [Coherence::Coherent, Coherence::Incoherent] {
            for (i, got) in trace(backend, &rays, hint).iter().enumerate() {
                assert!(fits(i, got), "{}, {:?}: expected {:?}, got {got:?}", row.name(), rays[i], oracle[i]);
            }
            let mut blocks: Vec<RayBlock> = pack_timed(&rays).iter().map(|block| block.ray).collect();
            assert_eq!(backend.any_hit(&mut blocks, rays.len(), hint), 0);
            for i in 0..rays.len() {
                let blocked = blocks[i / LANES].tfar[i % LANES] == BLOCKED;
                let fits = blocked == oracle[i].is_some()
                    || (!exactly && exact::plausible_any(&stills[i % TIMES], &rays[i].0, blocked));
                assert!(fits, "{}, {:?}: blocked = {blocked}", row.name(), rays[i]);
            }
        }
    });
}

/// A random linear map of moderate condition, moved up to `reach` away.
fn any_place(rng: &mut Rng, reach: f32) -> Affine3A {
    let scale = Vec3::new(0.3 + rng.unit(), 0.3 + rng.unit(), 0.3 + rng.unit()) * 10f32.powf(2.0 * rng.unit() - 1.0);
    let turn = Quat::from_axis_angle(rng.direction(), 6.0 * rng.unit());
    Affine3A::from_scale_rotation_translation(scale, turn, rng.cube() * reach)
}

/// Where a ray of [`aimed_at`] meets a triangle, and how far it comes from.
type Target = (Vec3, f32);

/// Rays that leave a triangle on the move never meet it again: the error bounds hold at every time and for every
/// backend's way to take a ray to the triangle. 10⁵ rays and more for each (far away some of the aimed ones pass by).
#[test]
fn no_ray_meets_the_moving_triangle_it_leaves() {
    for reach in [1.0, 1e3, 1e6] {
        let mut rng = Rng::new(33);
        let mut b = SceneBuilder::new();
        let paper = b.lambert(Vec3::ONE);
        let mut ends = Vec::new();
        for _ in 0..8 {
            let corners = [rng.cube(), rng.cube(), rng.cube()].to_vec();
            let mesh = b.mesh(corners, vec![[0, 1, 2]], paper);
            let from = any_place(&mut rng, reach);
            let turn = Quat::from_axis_angle(rng.direction(), 0.5);
            let mut to = from;
            to.matrix3 = Mat3A::from_quat(turn) * from.matrix3;
            to.translation += glam::Vec3A::from(rng.cube() * reach * 0.3);
            b.place_moving(mesh, vec![from, to]);
            ends.push((from, to));
        }
        let scene = b.build();
        scene.validate().expect("a sound motion");
        let geometry = Geometry::build(&scene);
        let target = |i: usize, time: f32, [u, v]: [f32; 2]| {
            let place = geometry.moving.at(i as u32, time).expect("it moves").world_from_object;
            let corners = geometry.meshes[1 + i].vertices[..3].to_vec();
            let target = place.transform_point3(corners[0] * (1.0 - u - v) + corners[1] * u + corners[2] * v);
            (target, place.transform_vector3(corners[1] - corners[0]).length())
        };
        expect_no_meeting(&geometry, &mut rng, &format!("reach {reach}"), target);
    }
}

/// The same of triangles that change their shape, at rest, on the move, and where their coordinates are large.
#[test]
fn no_ray_meets_the_changing_triangle_it_leaves() {
    for (reach, away) in [(1.0, 0.0), (1e3, 0.0), (1.0, 1e4)] {
        let mut rng = Rng::new(35);
        let mut b = SceneBuilder::new();
        let paper = b.lambert(Vec3::ONE);
        let offset = rng.direction() * away;
        for i in 0..8 {
            let mut corners = || [0; 3].map(|_| offset + rng.cube()).to_vec();
            let (positions, shape) = (corners(), corners());
            let later = vec![Shape { positions: shape, ..Shape::default() }];
            let triangles = vec![[0, 1, 2]];
            let mesh = b.full_mesh(Mesh { positions, later, triangles, material: paper, ..Mesh::default() });
            let from = any_place(&mut rng, reach);
            let mut to = from;
            if i % 2 == 0 {
                to.translation += glam::Vec3A::from(rng.cube() * reach * 0.3);
            }
            b.place_moving(mesh, vec![from, to]);
        }
        let scene = b.build();
        scene.validate().expect("a sound motion");
        let geometry = Geometry::build(&scene);
        let target = |i: usize, time: f32, [u, v]: [f32; 2]| {
            let still = frozen(&geometry, time);
            let (place, corners) = (still.instances[i].world_from_object, &still.meshes[1 + i].vertices);
            let target = place.transform_point3(corners[0] * (1.0 - u - v) + corners[1] * u + corners[2] * v);
            (target, place.transform_vector3(corners[1] - corners[0]).length())
        };
        expect_no_meeting(&geometry, &mut rng, &format!("reach {reach}, {away} away"), target);
    }
}

/// Rays to `target` of one of eight instances of a triangle, and from there on.
fn expect_no_meeting(geometry: &Geometry, rng: &mut Rng, what: &str, target: impl Fn(usize, f32, [f32; 2]) -> Target) {
    let aimed: Vec<(TestRay, f32)> = (0..8000)
        .map(|i| {
            let time = rng.unit();
            let (target, size) = target(i % 8, time, [0.45 * rng.unit(), 0.45 * rng.unit()]);
            let dir = rng.direction();
            (TestRay::new(target - dir * size, dir), time)
        })
        .collect();
    each_backend(geometry, |row, backend| {
        let hits = trace(backend, &aimed, Coherence::Incoherent);
        let mut rng = Rng::new(34);
        let (mut left, mut from) = (Vec::new(), Vec::new());
        for (hit, (_, time)) in hits.iter().zip(&aimed).filter_map(|(hit, ray)| Some(((*hit)?, ray))) {
            assert_eq!(hit.time, *time);
            let at = Interaction::at(geometry, &hit, false);
            for k in 0..32 {
                let mut dir = rng.direction();
                if k % 4 == 0 {
                    // A quarter grazes.
                    let cos = 10f32.powf(-9.0 + 8.0 * rng.unit());
                    dir = ((dir - at.n_g * at.n_g.dot(dir)).normalize() + at.n_g * cos).normalize();
                }
                left.push((TestRay::new(spawn_origin(at.p, at.n_g, at.error, dir), dir), *time));
                from.push((hit.inst, hit.prim));
            }
        }
        assert!(left.len() > 100_000, "{}: {} rays", row.name(), left.len());
        let again = trace(backend, &left, Coherence::Incoherent);
        let own = |(hit, from): (&Option<Hit>, &(u32, u32))| hit.is_some_and(|hit| (hit.inst, hit.prim) == *from);
        let met = again.iter().zip(&from).filter(|&pair| own(pair)).count();
        assert_eq!(met, 0, "{}, {what}: re-hits of {} rays", row.name(), left.len());
    });
}
