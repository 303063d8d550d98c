use glam::{Affine3A, Quat, Vec3};

use super::parts::{Body, Parts};
use super::volumes::Volumes;
use super::*;
use crate::backend::Backend;
use crate::backend::batch::Hit;
use crate::backend::brute::Brute;
use crate::backend::select::{self, DIVIDED_COST, DIVISION};
use crate::scene::geometry::Placement;

struct Numbers(u64);

impl Numbers {
    /// In [−1, 1).
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    fn point(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }
}

fn quad(mesh: &mut TriangleMesh, corners: [Vec3; 4]) {
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(corners);
    mesh.indices.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
}

/// A ball of 2·n² triangles that share their vertices.
fn ball(mesh: &mut TriangleMesh, center: Vec3, radius: f32, n: u32) {
    let first = mesh.vertices.len() as u32;
    for i in 0..=n {
        for j in 0..=n {
            let (theta, phi) = (i as f32 / n as f32 * 3.1, j as f32 / n as f32 * 6.2);
            let p = Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
            mesh.vertices.push(center + radius * p);
        }
    }
    for i in 0..n {
        for j in 0..n {
            let a = first + i * (n + 1) + j;
            mesh.indices.extend([[a, a + n + 1, a + 1], [a + 1, a + n + 1, a + n + 2]]);
        }
    }
}

fn bounded(mut geometry: Geometry) -> Geometry {
    for mesh in &mut geometry.meshes {
        mesh.vertices.push(Vec3::ZERO);
    }
    let mut bounds = Bounds::EMPTY;
    for (_, corners) in geometry.meshes[0].traced() {
        bounds = bounds.union(Bounds::of(&corners));
    }
    for placement in &geometry.instances {
        for (_, corners) in geometry.meshes[placement.mesh as usize].traced() {
            bounds = bounds.union(Bounds::of(&corners.map(|p| placement.world_from_object.transform_point3(p))));
        }
    }
    geometry.bounds = (bounds.lo, bounds.hi);
    geometry
}

/// A room of two metres with a ball that is baked, two that are instances, and a loose triangle in its middle.
fn room() -> Geometry {
    let mut world = TriangleMesh::default();
    ball(&mut world, Vec3::new(0.4, -0.5, 0.2), 0.4, 12);
    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
        for n in [axis, -axis] {
            let u = n.any_orthonormal_vector();
            let v = n.cross(u);
            quad(&mut world, [n - u - v, n + u - v, n + u + v, n - u + v]);
        }
    }
    let first = world.vertices.len() as u32;
    world.vertices.extend([Vec3::splat(0.01), Vec3::new(0.05, 0.0, 0.0), Vec3::new(0.0, 0.04, 0.02)]);
    world.indices.push([first, first + 1, first + 2]);
    let mut other = TriangleMesh::default();
    ball(&mut other, Vec3::new(0.1, 0.2, 0.3), 1.0, 12);
    let turned = |scale: Vec3, at: Vec3| {
        Placement::new(1, Affine3A::from_scale_rotation_translation(scale, Quat::from_rotation_x(0.7), at))
    };
    let instances = vec![
        turned(Vec3::splat(0.2), Vec3::new(-0.5, 0.5, 0.0)),
        turned(Vec3::new(0.1, 0.3, 0.2), Vec3::new(-0.4, -0.5, 0.4)),
    ];
    bounded(Geometry { meshes: vec![world, other], instances, ..Geometry::default() })
}

fn joint(geometry: &Geometry, isa: &str) -> Joint {
    let options = BackendOptions { isa: (isa == "avx2").then(|| isa.into()), ..BackendOptions::default() };
    Joint::build(geometry, &DIVISION, &options).expect("it builds")
}

/// Rays from within the room, every other one a segment.
fn rays() -> Vec<RayHitBlock> {
    let mut numbers = Numbers(1);
    let mut blocks = vec![RayHitBlock::EMPTY; 2000];
    for (i, block) in blocks.iter_mut().enumerate() {
        for lane in 0..LANES {
            let tfar = if i % 2 == 0 { f32::INFINITY } else { 0.7 };
            block.ray.set(lane, numbers.point() * 0.98, numbers.point().normalize(), tfar);
        }
    }
    blocks
}

fn hits(backend: &dyn Backend, rays: &[RayHitBlock], len: usize) -> Vec<Option<Hit>> {
    let mut blocks = rays.to_vec();
    assert_eq!(backend.closest_hit(&mut blocks, len, Coherence::Incoherent), 0);
    (0..len).map(|i| blocks[i / LANES].hit(i % LANES)).collect()
}

fn blocked(backend: &dyn Backend, rays: &[RayHitBlock], len: usize) -> Vec<bool> {
    let mut blocks: Vec<_> = rays.iter().map(|block| block.ray).collect();
    assert_eq!(backend.any_hit(&mut blocks, len, Coherence::Incoherent), 0);
    (0..len).map(|i| blocks[i / LANES].tfar[i % LANES] == BLOCKED).collect()
}

/// Oracle: `brute`. The same triangle of the same instance and numbers within rounding, but for rays that pass an edge
/// within the slack: at most 3 of 32 000. Both instruction sets give the same bits, and a batch the same as its
/// beginning.
#[test]
fn hits_are_those_of_every_triangle() {
    let (geometry, rays) = (room(), rays());
    let parts = Parts::of(&geometry, &DIVISION).expect("walls");
    assert_eq!((parts.faces.len(), parts.bodies.len()), (12, 4));
    let (narrow, wide) = (joint(&geometry, "avx2"), joint(&geometry, "any"));
    let len = rays.len() * LANES;
    let (met, stopped) = (hits(&narrow, &rays, len), blocked(&narrow, &rays, len));
    assert_eq!(met, hits(&wide, &rays, len));
    assert_eq!(stopped, blocked(&wide, &rays, len));
    let part = 1000 * LANES + 5;
    assert_eq!(met[..part], hits(&wide, &rays, part));
    assert_eq!(stopped[..part], blocked(&wide, &rays, part));

    let brute = Brute::build(&geometry);
    let mut other = 0;
    for (a, b) in met.iter().zip(hits(&brute, &rays, len)) {
        match (a, b) {
            (Some(a), Some(b)) if (a.prim, a.geom, a.inst) == (b.prim, b.geom, b.inst) => {
                let near = |x: f32, y: f32| (x - y).abs() < 1e-4;
                assert!(near(a.t, b.t) && near(a.u, b.u) && near(a.v, b.v), "{a:?} {b:?}");
            }
            (None, None) => {}
            _ => other += 1,
        }
    }
    other += stopped.iter().zip(blocked(&brute, &rays, len)).filter(|(a, b)| *a != b).count();
    assert!(other <= 3, "{other} differ");
    let on = |inst: u32| met.iter().flatten().filter(|hit| hit.inst == inst).count();
    assert!(on(0) > 300 && on(1) > 300, "{} and {} hits on the instances", on(0), on(1));
}

/// Oracle: points that lie on the triangles of the rest, in f64. No segment that ends just behind such a point is left
/// out, from wherever it comes, nor one that begins just before it.
#[test]
fn no_ray_at_the_rest_is_left_out() {
    let geometry = room();
    let parts = Parts::of(&geometry, &DIVISION).expect("walls");
    let stretch = geometry.instances.iter().map(bounds::condition).fold(1.0, f64::max) as f32;
    let mut numbers = Numbers(3);
    let placed = |p: Vec3, map: &Affine3A| {
        let m = glam::DAffine3::from_cols_array(&map.to_cols_array().map(f64::from));
        m.transform_point3(p.as_dvec3())
    };
    let mut points = Vec::new();
    let rest = parts.rest(&geometry.meshes[0]);
    for (_, corners) in rest.traced() {
        points.extend(corners.map(|p| p.as_dvec3()));
    }
    for placement in &geometry.instances {
        for (_, corners) in geometry.meshes[1].traced() {
            points.extend(corners.map(|p| placed(p, &placement.world_from_object)));
        }
    }
    // Balls of both kinds, boxes, and neighbours in one volume.
    let mut many = parts.bodies.clone();
    many.extend((0..100).map(|i| {
        let at = Vec3::new((i % 10) as f32, (i / 10) as f32, 0.0) * 0.1;
        Body { bounds: Bounds { lo: at, hi: at + 0.05 }, radius: 0.05 }
    }));
    for bodies in [&parts.bodies, &many] {
        let volumes = Volumes::new(bodies, DIVISION.volumes, stretch);
        for reach in [1.0, 1e3, 1e6, 1e12, 1e17] {
            for p in points.iter().step_by(3) {
                let mut ray = RayBlock::EMPTY;
                for lane in 0..LANES {
                    // Some along an axis.
                    let away = numbers.point()
                        * Vec3::select(glam::BVec3::new(lane % 4 == 1, lane % 4 == 2, false), Vec3::ZERO, Vec3::ONE);
                    let from = (p + away.as_dvec3() * reach).as_vec3();
                    let way = p - from.as_dvec3();
                    let (dir, t) = (way.normalize().as_vec3(), way.length() as f32);
                    ray.set(lane, from, dir, t * (1.0 + 1e-6));
                    ray.tnear[lane] = if lane % 2 == 0 { t * (1.0 - 1e-6) } else { 0.0 };
                }
                assert_eq!(volumes.near(&ray, u16::MAX), u16::MAX, "from {reach} m at {p}");
            }
        }
    }
}

/// Oracle: geometry. Rays that pass a ball or a box by a hundredth of its size, and those that end before it, are not
/// held up.
#[test]
fn rays_that_pass_are_left_out() {
    let bodies = [Vec3::X, Vec3::NEG_X].map(|c| Body { bounds: Bounds { lo: c - 0.5, hi: c + 0.5 }, radius: 0.5 });
    let box_like = bodies.map(|body| Body { radius: 0.9, ..body });
    for bodies in [bodies, box_like] {
        let volumes = Volumes::new(&bodies, DIVISION.volumes, 1.0);
        let near = |org: Vec3, dir: Vec3, tfar: f32| {
            let mut ray = RayBlock::EMPTY;
            ray.set(3, org, dir, tfar);
            volumes.near(&ray, 1 << 3) != 0
        };
        assert!(near(Vec3::new(1.0, 0.495, 5.0), Vec3::NEG_Z, 9.0));
        assert!(!near(Vec3::new(1.0, 0.505, 5.0), Vec3::NEG_Z, 9.0));
        assert!(!near(Vec3::new(0.0, 0.0, 5.0), Vec3::NEG_Z, 9.0));
        assert!(!near(Vec3::new(1.0, 0.0, 5.0), Vec3::NEG_Z, 4.49));
        assert!(near(Vec3::new(1.0, 0.0, 5.0), Vec3::NEG_Z, 4.51));
        assert!(!near(Vec3::new(1.0, 0.0, 5.0), Vec3::Z, 9.0));
    }
}

/// Oracle: the rule. What shares a position with a mesh of many triangles stays with it, whatever its size; small
/// things are no faces; walls that touch one another are taken together.
#[test]
fn what_hangs_together_stays_together() {
    let faces = |change: &dyn Fn(&mut TriangleMesh)| {
        let mut mesh = TriangleMesh::default();
        ball(&mut mesh, Vec3::ZERO, 0.3, 12);
        quad(&mut mesh, [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| Vec3::new(x, y, -1.0)));
        quad(&mut mesh, [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[y, z]| Vec3::new(-1.0, y, z)));
        change(&mut mesh);
        let geometry = bounded(Geometry { meshes: vec![mesh], ..Geometry::default() });
        Parts::of(&geometry, &DIVISION).map_or(0, |parts| {
            let mesh = &geometry.meshes[0];
            let (few, many) = (parts.faces.len(), parts.rest(mesh).traced().count());
            assert_eq!(few + many, mesh.traced().count());
            few
        })
    };
    assert_eq!(faces(&|_| {}), 4);
    // A small one in a corner of the wall belongs to it; one in the middle of the room is not worth a face.
    let small =
        |at: Vec3| move |mesh: &mut TriangleMesh| quad(mesh, [at, at + Vec3::X * 1e-3, at + 1e-3, at + Vec3::Y * 1e-3]);
    assert_eq!(faces(&small(Vec3::splat(-1.0))), 6);
    assert_eq!(faces(&small(Vec3::new(0.5, 0.5, 0.5))), 4);
    // The ball's first vertex is the corner of one wall, and so of both.
    let corner = |mesh: &mut TriangleMesh| mesh.vertices[0] = Vec3::splat(-1.0);
    assert_eq!(faces(&corner), 0);
    // No ball at all is no matter for this backend, but no fault either.
    assert_eq!(faces(&|mesh| mesh.indices.retain(|triangle| triangle[0] >= 169)), 4);
}

/// Whether dividing `geometry` pays.
fn suits(geometry: &Geometry) -> bool {
    divide(geometry, &DIVISION).is_some_and(|division| select::cost(&division) <= DIVIDED_COST)
}

/// Oracle: the rule. A room with things in it, but not the things alone, nor a room that is full of them.
#[test]
fn rooms_with_things_in_them_suit() {
    assert!(suits(&room()));
    let mut things = room();
    things.meshes[0].indices.truncate(288);
    assert!(!suits(&bounded(things)));
    let mut full = room();
    full.instances = (0..8)
        .map(|i| {
            let at = Vec3::new((i & 1) as f32 - 0.5, (i >> 1 & 1) as f32 - 0.5, (i >> 2) as f32 - 0.5);
            Placement::new(1, Affine3A::from_scale_rotation_translation(Vec3::splat(0.5), Quat::IDENTITY, at))
        })
        .collect();
    assert!(!suits(&full));
}

/// Oracle: the rule. So many faces cost as much as the hierarchy that they spare: a ball in a dome of 120 triangles.
#[test]
fn many_faces_do_not_pay() {
    let dome = |n: u32| {
        let mut mesh = TriangleMesh::default();
        ball(&mut mesh, Vec3::ZERO, 1.0, n);
        ball(&mut mesh, Vec3::ZERO, 0.2, 12);
        bounded(Geometry { meshes: vec![mesh], ..Geometry::default() })
    };
    assert_eq!(Parts::of(&dome(7), &DIVISION).expect("a dome").faces.len(), 2 * 49 - 7);
    assert!(!suits(&dome(7)));
    assert!(suits(&dome(4)));
}

/// Oracle: the same mesh without them. Triangles that cannot be traced do not matter, on an instance either.
#[test]
fn bad_triangles_are_left_out() {
    let good = room();
    let mut bad = good.clone();
    for mesh in &mut bad.meshes {
        let far = mesh.vertices.len() as u32;
        mesh.vertices.extend([Vec3::NAN, Vec3::splat(f32::INFINITY), Vec3::X, Vec3::ZERO]);
        mesh.indices.extend([[0, 1, far], [0, far + 1, far + 2], [0, 1, far + 100], [5, 5, 6]]);
    }
    let (rays, len) = (rays(), 32_000);
    assert_eq!(hits(&joint(&bad, "any"), &rays, len), hits(&joint(&good, "any"), &rays, len));
}

/// Oracle: `obvhs`. A scene without faces is traced all the same, to the bit.
#[test]
fn scenes_without_faces_are_the_hierarchys() {
    let mut geometry = room();
    geometry.meshes[0].indices.truncate(288);
    let geometry = bounded(geometry);
    let options = BackendOptions::default();
    let obvhs = Obvhs::build(&geometry, &geometry.meshes[0], &options).expect("it builds");
    let len = 1000 * LANES;
    assert_eq!(hits(&joint(&geometry, "any"), &rays(), len), hits(&obvhs, &rays(), len));
    let empty = bounded(Geometry { meshes: vec![TriangleMesh::default()], ..Geometry::default() });
    assert!(hits(&joint(&empty, "any"), &rays(), len).iter().all(Option::is_none));
}
