//! What only this backend can get wrong: ids, masks, modes, poisoned rays, handles. Agreement with `brute` over the
//! whole conformance matrix is tested in the suite.
//!
//! Oracles: closed forms of planes and spheres; exact equality where nothing may be touched. Seeds are fixed, so a
//! false alarm needs another library, not another draw.

use std::sync::Arc;

use glam::{Affine3A, Vec3};

use super::Embree;
use super::abi::HAS_STREAMS;
use super::device::Device;
use super::scene::World;
use crate::backend::batch::{BLOCKED, INVALID_ID, LANES, RayBlock, RayHitBlock};
use crate::backend::{Backend, BackendOptions, Coherence, QueryMode};
use crate::scene::geometry::{Geometry, NO_MATERIAL, Placement, TriangleMesh};

const HINTS: [Coherence; 2] = [Coherence::Coherent, Coherence::Incoherent];

/// Two triangles spanning [−1,1]² at height `z`, with the spare vertex.
fn quad(z: f32) -> TriangleMesh {
    let at = |x, y| Vec3::new(x, y, z);
    TriangleMesh {
        vertices: vec![at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0), Vec3::ZERO],
        indices: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    }
}

/// A closed latitude-longitude sphere of radius 2 (HARDCASES.md, G01).
fn sphere(rows: u32) -> TriangleMesh {
    let columns = 2 * rows;
    let mut mesh = TriangleMesh::default();
    for row in 0..=rows {
        for column in 0..columns {
            let (phi, theta) = [row, column].map(|i| i as f32 * std::f32::consts::PI / rows as f32).into();
            let radius = if row == 0 || row == rows { 0.0 } else { 2.0 * phi.sin() };
            mesh.vertices.push(Vec3::new(radius * theta.sin(), 2.0 * phi.cos(), radius * theta.cos()));
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let corner = |r: u32, c: u32| (row + r) * columns + (column + c) % columns;
            mesh.indices.push([corner(0, 0), corner(1, 0), corner(1, 1)]);
            mesh.indices.push([corner(0, 0), corner(1, 1), corner(0, 1)]);
        }
    }
    mesh.vertices.push(Vec3::ZERO);
    mesh
}

fn world_of(mesh: TriangleMesh) -> Geometry {
    Geometry { meshes: vec![mesh], ..Default::default() }
}

fn placement(mesh: u32, world_from_object: Affine3A) -> Placement {
    let object_from_world = world_from_object.inverse();
    let world_from_normal = object_from_world.matrix3.transpose();
    Placement { mesh, world_from_object, object_from_world, world_from_normal, material: NO_MATERIAL }
}

fn build(geometry: &Geometry, mode: QueryMode) -> Embree {
    Embree::build(geometry, &BackendOptions::with_mode(mode)).expect("the geometry is sound")
}

/// Uniform numbers in [−1,1) from a 64-bit linear congruence (constants of Knuth's MMIX).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }
}

/// `count` rays from inside the sphere in random directions.
fn random_rays(count: usize) -> Vec<RayHitBlock> {
    let mut numbers = Numbers(7);
    let mut blocks = vec![RayHitBlock::EMPTY; count.div_ceil(LANES)];
    for i in 0..count {
        let (org, dir) = (0.5 * numbers.vector(), (numbers.vector() + 1e-3 * Vec3::X).normalize());
        blocks[i / LANES].ray.set(i % LANES, org, dir, f32::INFINITY);
    }
    blocks
}

fn same_bits<T: bytemuck::Pod>(a: &T, b: &T) -> bool {
    bytemuck::bytes_of(a) == bytemuck::bytes_of(b)
}

#[test]
fn empty_geometry_answers_misses() {
    for geometry in [Geometry::default(), world_of(TriangleMesh::default())] {
        for mode in QueryMode::ALL {
            let embree = build(&geometry, mode);
            let mut blocks = random_rays(40);
            let before: Vec<RayBlock> = blocks.iter().map(|block| block.ray).collect();
            assert_eq!(embree.closest_hit(&mut blocks, 40, Coherence::Incoherent), 0);
            assert!(blocks.iter().all(|block| (0..LANES).all(|lane| block.hit(lane).is_none())), "{mode}");
            let mut shadow = before.clone();
            assert_eq!(embree.any_hit(&mut shadow, 40, Coherence::Incoherent), 0);
            assert!(shadow.iter().zip(&before).all(|(after, before)| same_bits(after, before)), "{mode}");
            assert_eq!(embree.info().triangles, 0);
        }
    }
}

#[test]
fn plane_gives_distance_weights_and_ids() {
    // t = 3 exactly; on the first triangle (v0, v1, v2) u = (x − y)/2 and v = (y + 1)/2.
    for mode in QueryMode::ALL {
        let embree = build(&world_of(quad(0.0)), mode);
        let mut blocks = [RayHitBlock::EMPTY; 1];
        for lane in 0..LANES {
            blocks[0].ray.set(lane, Vec3::new(0.5, lane as f32 / 8.0 - 0.75, 3.0), Vec3::NEG_Z, 10.0);
        }
        for hint in HINTS {
            let mut blocks = blocks;
            assert_eq!(embree.closest_hit(&mut blocks, LANES, hint), 0);
            for lane in 0..LANES {
                let (y, hit) = (lane as f32 / 8.0 - 0.75, blocks[0].hit(lane));
                let Some(hit) = hit else {
                    assert!(y > 1.0, "{mode}: y = {y} missed");
                    continue;
                };
                // y = 0.5 lies on the diagonal, which belongs to both triangles.
                assert_eq!((hit.geom, hit.inst), (0, INVALID_ID), "{mode}: y = {y}");
                assert!(y == 0.5 || hit.prim == u32::from(y > 0.5), "{mode}: y = {y}: {hit:?}");
                assert!((hit.t - 3.0).abs() <= 4.0 * f32::EPSILON, "{mode}: {hit:?}");
                if y < 0.5 {
                    let error = (hit.u - (0.5 - y) / 2.0).abs().max((hit.v - (y + 1.0) / 2.0).abs());
                    assert!(error <= 4.0 * f32::EPSILON, "{mode}: {hit:?}");
                }
            }
        }
    }
}

#[test]
fn lanes_past_the_length_are_not_traced() {
    for mode in QueryMode::ALL {
        let embree = build(&world_of(sphere(10)), mode);
        for len in [0, 1, 3, 5, 15, 16, 17, 31, 33] {
            let mut blocks = random_rays(64);
            let before = blocks.clone();
            assert_eq!(embree.closest_hit(&mut blocks, len, Coherence::Incoherent), 0);
            let mut shadow: Vec<RayBlock> = before.iter().map(|block| block.ray).collect();
            assert_eq!(embree.any_hit(&mut shadow, len, Coherence::Incoherent), 0);
            for i in 0..64 {
                let (block, lane) = (i / LANES, i % LANES);
                assert_eq!(blocks[block].hit(lane).is_some(), i < len, "{mode}: ray {i} of {len}");
                assert_eq!(shadow[block].tfar[lane] == BLOCKED, i < len, "{mode}: ray {i} of {len}");
                if i >= len {
                    assert_eq!(blocks[block].ray.tfar[lane], f32::INFINITY);
                }
            }
        }
    }
}

#[test]
fn poisoned_rays_are_counted_misses() {
    // Debian's 3.13.5 aborts the process on most of these.
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    let sound = (Vec3::ZERO, Vec3::Z, 0.0, inf);
    let poisoned = [
        (Vec3::new(nan, 0.0, 0.0), Vec3::Z, 0.0, inf),
        (Vec3::new(0.0, inf, 0.0), Vec3::Z, 0.0, inf),
        (Vec3::new(0.0, 0.0, -1.9e18), Vec3::Z, 0.0, inf),
        (Vec3::ZERO, Vec3::new(0.0, nan, 1.0), 0.0, inf),
        (Vec3::ZERO, Vec3::new(-inf, 0.0, 0.0), 0.0, inf),
        (Vec3::ZERO, Vec3::ZERO, 0.0, inf),
        (Vec3::ZERO, Vec3::Z, nan, inf),
        (Vec3::ZERO, Vec3::Z, 0.0, nan),
        (Vec3::ZERO, Vec3::Z, -1.0, inf),
        (Vec3::ZERO, Vec3::Z, 5.0, 4.0),
        (Vec3::ZERO, Vec3::Z, 0.0, -1.0),
    ];
    // Every instruction set has calls of its own, and its own packets that are none.
    let isas = ["sse2", "sse4.2", "avx", "avx2", "avx512"].map(|isa| Some(isa.to_string())).into_iter().chain([None]);
    for (isa, mode) in isas.flat_map(|isa| QueryMode::ALL.map(move |mode| (isa.clone(), mode))) {
        let options = BackendOptions { isa, ..BackendOptions::with_mode(mode) };
        let Ok(embree) = Embree::build(&world_of(sphere(10)), &options) else {
            assert!(options.isa.is_some(), "{mode}");
            continue; // not of this processor
        };
        for (case, bad) in poisoned.into_iter().enumerate() {
            let mut blocks = vec![RayHitBlock::EMPTY; 4];
            // The bad ray sits once in each of two blocks, in different lanes; every other ray is sound.
            let bad_at = |i: usize| i == case || i == 40;
            for i in 0..64 {
                let (org, dir, tnear, tfar) = if bad_at(i) { bad } else { sound };
                blocks[i / LANES].ray.set(i % LANES, org, dir, tfar);
                blocks[i / LANES].ray.tnear[i % LANES] = tnear;
            }
            let mut shadow: Vec<RayBlock> = blocks.iter().map(|block| block.ray).collect();
            assert_eq!(embree.closest_hit(&mut blocks, 64, Coherence::Coherent), 2, "{mode}, case {case}");
            assert_eq!(embree.any_hit(&mut shadow, 64, Coherence::Coherent), 2, "{mode}, case {case}");
            for i in 0..64 {
                let (block, lane) = (i / LANES, i % LANES);
                assert_eq!(blocks[block].hit(lane).is_none(), bad_at(i), "{mode}, case {case}, ray {i}");
                assert_eq!(shadow[block].tfar[lane] == BLOCKED, !bad_at(i), "{mode}, case {case}, ray {i}");
                if bad_at(i) {
                    assert_eq!(shadow[block].tfar[lane].to_bits(), bad.3.to_bits(), "{mode}, case {case}");
                }
            }
        }
    }
}

#[test]
fn any_hit_respects_the_segment() {
    for mode in QueryMode::ALL {
        let embree = build(&world_of(quad(0.0)), mode);
        let mut blocks = [RayBlock::EMPTY; 1];
        // Segments from z = 2 downwards: ends before, at and behind the plane; starts behind it.
        let segments = [(0.0, 1.5), (0.0, 2.5), (2.5, 9.0), (1.5, 2.5), (0.0, f32::INFINITY), (-0.0, 1.999)];
        for (lane, (tnear, tfar)) in segments.into_iter().enumerate() {
            blocks[0].set(lane, Vec3::new(0.3, 0.1, 2.0), Vec3::NEG_Z, tfar);
            blocks[0].tnear[lane] = tnear;
        }
        assert_eq!(embree.any_hit(&mut blocks, segments.len(), Coherence::Incoherent), 0);
        for (lane, (tnear, tfar)) in segments.into_iter().enumerate() {
            let expected = if tnear < 2.0 && tfar > 2.0 { BLOCKED } else { tfar };
            assert_eq!(blocks[0].tfar[lane], expected, "{mode}: [{tnear}, {tfar}]");
        }
    }
}

#[test]
fn instances_are_named_by_their_index() {
    // World quad at z = −10; an empty mesh; instances of mesh 2 at x = 0, 10, 20, …, one mirrored and one squashed.
    let scales = [Vec3::ONE, Vec3::new(-1.0, 1.0, 1.0), Vec3::new(1.0, 2.0, 0.25), Vec3::splat(0.5)];
    let mut instances: Vec<Placement> = (0..4)
        .map(|i| {
            let world_from_object = Affine3A::from_translation(Vec3::new(10.0 * i as f32, 0.0, 0.0))
                * Affine3A::from_scale(scales[i as usize]);
            placement(2, world_from_object)
        })
        .collect();
    instances.insert(1, placement(1, Affine3A::IDENTITY));
    let meshes = vec![quad(-10.0), TriangleMesh::default(), quad(1.0)];
    let geometry = Geometry { meshes, instances, ..Default::default() };
    for mode in QueryMode::ALL {
        let embree = build(&geometry, mode);
        assert_eq!(embree.info().triangles, 4);
        let mut blocks = [RayHitBlock::EMPTY; 1];
        for lane in 0..4 {
            blocks[0].ray.set(lane, Vec3::new(10.0 * lane as f32 + 0.25, 0.125, 5.0), Vec3::NEG_Z, f32::INFINITY);
        }
        blocks[0].ray.set(4, Vec3::new(0.25, 0.125, -5.0), Vec3::NEG_Z, f32::INFINITY);
        assert_eq!(embree.closest_hit(&mut blocks, 5, Coherence::Coherent), 0);
        for (lane, (inst, scale)) in [0, 2, 3, 4].into_iter().zip(scales).enumerate() {
            let hit = blocks[0].hit(lane).expect("each ray points at its instance");
            assert_eq!((hit.geom, hit.inst), (2, inst), "{mode}, lane {lane}");
            assert!((hit.t - (5.0 - scale.z)).abs() <= 8.0 * f32::EPSILON, "{mode}: {hit:?}");
            // Its own point of the triangle, found from the weights in object space.
            let [a, b, c] =
                geometry.meshes[2].indices[hit.prim as usize].map(|v| geometry.meshes[2].vertices[v as usize]);
            let point = scale * (a + hit.u * (b - a) + hit.v * (c - a));
            // Sixteen roundings of numbers up to 30, the largest translation.
            let error = (point.truncate() - glam::Vec2::new(0.25, 0.125)).length();
            assert!(error < 16.0 * 30.0 * f32::EPSILON, "{mode}: {point}");
        }
        let below = blocks[0].hit(4).expect("the world quad lies below");
        assert_eq!((below.geom, below.inst), (0, INVALID_ID), "{mode}");
    }
}

#[test]
fn rays_that_an_instance_would_carry_out_of_range_are_counted() {
    // The object space is 10⁶ times larger: an origin at 10¹⁴ lies at 10²⁰ there, where Debian's 3.13.5 aborts.
    let shrunk = placement(1, Affine3A::from_scale(Vec3::splat(1e-6)));
    let geometry = Geometry { meshes: vec![quad(-10.0), quad(1.0)], instances: vec![shrunk], ..Default::default() };
    for mode in QueryMode::ALL {
        let embree = build(&geometry, mode);
        let mut blocks = [RayHitBlock::EMPTY; 1];
        for (lane, z) in [1e14, 1e3, 1e11, 9e17].into_iter().enumerate() {
            blocks[0].ray.set(lane, Vec3::new(0.0, 0.0, z), Vec3::NEG_Z, f32::INFINITY);
        }
        let mut shadow = [blocks[0].ray];
        assert_eq!(embree.closest_hit(&mut blocks, 4, Coherence::Incoherent), 2, "{mode}");
        assert_eq!(embree.any_hit(&mut shadow, 4, Coherence::Incoherent), 2, "{mode}");
        assert_eq!([0, 1, 2, 3].map(|lane| blocks[0].hit(lane).is_some()), [false, true, true, false], "{mode}");
    }
}

#[test]
fn unsound_geometry_is_refused() {
    let options = BackendOptions::default();
    let refused = |geometry: &Geometry| Embree::build(geometry, &options).err().expect("refused").to_string();
    let mut mesh = quad(0.0);
    mesh.indices.push([0, 1, 5]);
    assert!(refused(&world_of(mesh)).contains("vertex index"));
    for matrix in [Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0)), Affine3A::from_translation(Vec3::NAN)] {
        let mut bad = placement(1, Affine3A::IDENTITY);
        (bad.world_from_object, bad.object_from_world) = (matrix, matrix.inverse());
        let geometry = Geometry { meshes: vec![quad(0.0), quad(1.0)], instances: vec![bad], ..Default::default() };
        assert!(refused(&geometry).contains("transform"));
    }
    let lost = placement(7, Affine3A::IDENTITY);
    let geometry = Geometry { meshes: vec![quad(0.0)], instances: vec![lost], ..Default::default() };
    assert!(refused(&geometry).contains("not there"));
}

#[test]
fn closed_sphere_holds_random_rays_in_every_mode() {
    // 0 misses expected of 20,000 a mode (ROBUST); t within the shell between the inscribed and circumscribed sphere.
    for mode in QueryMode::ALL {
        let embree = build(&world_of(sphere(50)), mode);
        for hint in HINTS {
            let mut blocks = random_rays(20_000);
            assert_eq!(embree.closest_hit(&mut blocks, 20_000, hint), 0);
            for block in &blocks {
                for lane in 0..LANES {
                    let hit = block.hit(lane).unwrap_or_else(|| panic!("{mode}, {hint:?}: a ray escaped"));
                    let radius = (block.ray.org(lane) + hit.t * block.ray.dir(lane)).length();
                    assert!((1.99..=2.000001).contains(&radius), "{mode}, {hint:?}: {hit:?} at radius {radius}");
                }
            }
        }
    }
}

#[test]
fn neighbours_and_hint_do_not_change_a_bit() {
    // The same rays, each in another block among other neighbours: 7919 is prime to the count, so `i·7919` visits all.
    const COUNT: usize = 16_384;
    for mode in QueryMode::ALL {
        let embree = build(&world_of(sphere(50)), mode);
        let rays = random_rays(COUNT);
        let mut moved = vec![RayHitBlock::EMPTY; COUNT / LANES];
        let place = |i: usize| (i * 7919) % COUNT;
        for i in 0..COUNT {
            let ray = &rays[i / LANES].ray;
            moved[place(i) / LANES].ray.set(place(i) % LANES, ray.org(i % LANES), ray.dir(i % LANES), f32::INFINITY);
        }
        let trace = |rays: &[RayHitBlock], hint| {
            let mut rays = rays.to_vec();
            embree.closest_hit(&mut rays, COUNT, hint);
            rays
        };
        let (a, b) = (trace(&rays, Coherence::Incoherent), trace(&rays, Coherence::Coherent));
        let c = trace(&moved, Coherence::Incoherent);
        for i in 0..COUNT {
            let (there, hit) = (place(i), a[i / LANES].hit(i % LANES));
            assert_eq!(hit, b[i / LANES].hit(i % LANES), "{mode}: ray {i} and the hint");
            assert_eq!(hit, c[there / LANES].hit(there % LANES), "{mode}: ray {i} and its neighbours");
        }
    }
}

#[test]
fn info_names_library_instruction_set_and_effective_modes() {
    let embree = build(&world_of(sphere(10)), QueryMode::Stream);
    let info = embree.info();
    assert!(info.version.starts_with(if HAS_STREAMS { "3.13." } else { "4." }), "{}", info.version);
    let expected = if HAS_STREAMS { "stream" } else { "packet-loop" };
    assert_eq!([info.rays_incoherent, info.rays_coherent, info.rays_shadow], [expected; 3]);
    assert_eq!(info.triangles, 400);
    assert!(info.bvh_bytes > 400 * 16, "{} bytes", info.bvh_bytes);
    assert!(!info.isa.is_empty());
}

#[test]
fn instruction_sets_can_be_pinned_and_unknown_ones_are_refused() {
    let geometry = world_of(sphere(10));
    let with = |isa: &str| Embree::build(&geometry, &BackendOptions { isa: Some(isa.into()), ..Default::default() });
    assert!(with("avx3").err().expect("no such set").to_string().contains("avx3"));
    // This program itself needs AVX2 on x86-64.
    #[cfg(target_arch = "x86_64")]
    for isa in ["sse4.2", "avx2"] {
        let embree = with(isa).expect("every processor that runs this has it");
        assert_eq!(embree.info().isa, isa);
        let mut blocks = random_rays(160);
        assert_eq!(embree.closest_hit(&mut blocks, 160, Coherence::Incoherent), 0);
        assert!(blocks.iter().all(|block| (0..LANES).all(|lane| block.hit(lane).is_some())), "{isa}");
    }
}

#[test]
fn dropping_gives_all_memory_back() {
    let device = Arc::new(Device::open(None, 0, false).expect("a device"));
    let shrunk = placement(1, Affine3A::from_scale(Vec3::splat(0.5)));
    let geometry = Geometry { meshes: vec![quad(-10.0), sphere(20)], instances: vec![shrunk; 3], ..Default::default() };
    let flags = super::abi::scene_flags(true, false);
    let build =
        |geometry: &Geometry, kept| World::build(&device, geometry, flags, kept).expect("the geometry is sound");
    let world = build(&geometry, None);
    assert!(device.bytes() > 0);
    drop(world);
    assert_eq!(device.bytes(), 0);

    // And what the world of the next frame takes over: the top scene, as long as what stands still is the same.
    let frame = |x: f32, still: f32| {
        let mut mesh = sphere(20);
        let first = mesh.vertices.len() as u32;
        mesh.vertices.extend(quad(still).vertices.iter().chain(&quad(0.0).vertices).map(|&p| p + x * Vec3::X));
        mesh.vertices[first as usize..][..5].iter_mut().for_each(|p| *p -= x * Vec3::X);
        let triangles = mesh.indices.len() as u32;
        mesh.indices.extend([[first, first + 1, first + 2], [first + 5, first + 6, first + 7]]);
        let frames = crate::scene::geometry::Frames::apart(triangles + 1..triangles + 2);
        Geometry { meshes: vec![mesh, sphere(20)], instances: vec![shrunk; 2], frames, ..Default::default() }
    };
    let first = build(&frame(0.0, 1.0), None);
    let (top, bytes) = (first.raw(), device.bytes());
    let second = build(&frame(0.5, 1.0), Some(first));
    assert_eq!((second.raw(), second.triangles), (top, 2 * sphere(20).indices.len() as u64 + 2));
    assert!(device.bytes() < bytes + bytes / 4, "{bytes}, then {}", device.bytes());
    let third = build(&frame(0.5, 1.1), Some(second));
    assert!(third.bvh_bytes() > 0);
    drop(third);
    assert_eq!(device.bytes(), 0);
    assert_eq!(Arc::strong_count(&device), 1);
}

/// A ray's hit does not depend on the rays that it is traced with, on edges shared by coplanar quads least of all.
/// Oracle: the same ray among others. Of 3.13.5 without `edges`, packets of 4, 8 and 16 all differ.
#[test]
fn hits_on_edges_do_not_depend_on_neighbours() {
    // Quads side by side, each with corners of its own, in an order that is not that of their places.
    let (side, mut mesh) = (24u32, TriangleMesh::default());
    for number in 0..side * side {
        let place = number * 7 % (side * side);
        let at = |dx: u32, dz: u32| {
            let [x, z] = [place % side + dx, place / side + dz].map(|i| 0.37 * i as f32 - 4.1);
            Vec3::new(x, -1.0, z)
        };
        let first = mesh.vertices.len() as u32;
        mesh.vertices.extend([at(0, 0), at(1, 0), at(1, 1), at(0, 1)]);
        mesh.indices.extend([[0, 1, 2], [0, 2, 3]].map(|corners: [u32; 3]| corners.map(|i| first + i)));
    }
    mesh.vertices.push(Vec3::ZERO);
    let geometry = world_of(mesh);

    // Towards points on edges and corners, in the order of the grid.
    let mut numbers = Numbers(3);
    let count = 1 << 14;
    let ray = |i: usize, numbers: &mut Numbers| {
        let on = |i: usize| 0.37 * (i % (side as usize + 1)) as f32 - 4.1;
        let along = 4.4 * numbers.next();
        let target = match i % 3 {
            0 => Vec3::new(on(i / 3), -1.0, along),
            1 => Vec3::new(along, -1.0, on(i / 3)),
            _ => Vec3::new(on(i / 3), -1.0, on(i / 75)),
        };
        let org = Vec3::new(0.1 * numbers.next(), 3.0, 0.2);
        (org, (target - org).normalize())
    };
    let rays: Vec<(Vec3, Vec3)> = (0..count).map(|i| ray(i, &mut numbers)).collect();
    for mode in QueryMode::ALL {
        let embree = build(&geometry, mode);
        for hint in HINTS {
            let hits = |order: &[usize]| {
                let mut blocks = vec![RayHitBlock::EMPTY; count / LANES];
                for (at, &i) in order.iter().enumerate() {
                    blocks[at / LANES].ray.set(at % LANES, rays[i].0, rays[i].1, f32::INFINITY);
                }
                embree.closest_hit(&mut blocks, count, hint);
                let mut hits = vec![None; count];
                for (at, &i) in order.iter().enumerate() {
                    let hit = blocks[at / LANES].hit(at % LANES);
                    hits[i] = hit.map(|hit| (hit.prim, [hit.t, hit.u, hit.v].map(f32::to_bits)));
                }
                hits
            };
            let plain = hits(&(0..count).collect::<Vec<_>>());
            assert!(plain.iter().flatten().count() > count / 2, "{mode}: the rays miss");
            for stride in [5, 17, 1023, 4099] {
                let order: Vec<usize> = (0..count).map(|i| i * stride % count).collect();
                let differ = hits(&order).iter().zip(&plain).filter(|(a, b)| a != b).count();
                assert_eq!(differ, 0, "{mode}, {hint:?}, every {stride}th: of {count} rays");
            }
        }
    }
}
