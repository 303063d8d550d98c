//! Every ray against every triangle: the oracle of the other backends. Exact in what it visits, slow by design, always
//! compiled.
//!
//! Tie rule, shared with `obvhs`: at equal `t` the lowest (instance, mesh, triangle) wins, and triangles of the world
//! mesh come before instances. Triangles without area are never reported. `ng` of the hit is left 0.

use glam::Vec3;

use super::batch::{Batch, INVALID_ID, LANES, RayBlock, RayHitBlock};
use super::past::{Past, Without, key_of};
use super::triangle::{self, Closest, Rank, Ray, RayByRay, RayShear, TriangleHit};
use super::{Backend, BackendInfo, BackendKind, Coherence, QueryMode};
use crate::math::lanes::lanes_of;
use crate::scene::geometry::{Geometry, Moving, Placement, TriangleMesh};
use crate::scene::motion::part_of;

/// One triangle of a mesh.
struct Face {
    vertices: [Vec3; 3],
    prim: u32,
}

/// Triangles of a mesh that changes its shape: the number of each, and its corners in every shape.
type Changing = Vec<(u32, Vec<[Vec3; 3]>)>;

/// The oracle.
pub struct Brute {
    info: BackendInfo,
    meshes: Vec<Vec<Face>>,
    /// By mesh, of those that change their shape.
    changing: Vec<Changing>,
    instances: Vec<Placement>,
    moving: Moving,
}

impl Brute {
    /// Copies the triangles that have an area. Indices out of range drop their triangle.
    pub fn build(geometry: &Geometry) -> Self {
        let meshes: Vec<Vec<Face>> = geometry
            .meshes
            .iter()
            .map(|mesh| {
                let at_rest = mesh.later.is_empty().then(|| mesh.traced()).into_iter().flatten();
                at_rest.map(|(prim, vertices)| Face { vertices, prim }).collect()
            })
            .collect();
        let changing = |mesh: &TriangleMesh| match mesh.later.is_empty() {
            true => Vec::new(),
            false => mesh.traced_moving().collect(),
        };
        let changing: Vec<Changing> = geometry.meshes.iter().map(changing).collect();
        let moving = changing.iter().map(|mesh| mesh.len() as u64).sum::<u64>();
        let triangles = meshes.iter().map(|m| m.len() as u64).sum::<u64>() + moving;
        let single = QueryMode::Single.name();
        let info = BackendInfo {
            kind: BackendKind::Brute,
            version: env!("CARGO_PKG_VERSION").into(),
            isa: std::env::consts::ARCH.into(),
            rays_incoherent: single,
            rays_coherent: single,
            rays_shadow: single,
            bvh_bytes: triangles * size_of::<Face>() as u64,
            triangles,
        };
        Brute { info, meshes, changing, instances: geometry.instances.clone(), moving: geometry.moving.clone() }
    }

    /// Calls `found` with every triangle that the segment meets at `time` until it returns false.
    fn each_hit(&self, ray: Ray, time: f32, mut found: impl FnMut(TriangleHit, Rank) -> bool) {
        let mut visit = |ray: Ray, mesh: u32, inst: u32| {
            let shear = RayShear::new(&ray);
            let faces = self.meshes.get(mesh as usize).map_or(&[][..], |m| m);
            let mut meets = |vertices: &[Vec3; 3], prim: u32| match shear.intersect(vertices, ray.tnear, ray.tfar) {
                Some(hit) => found(hit, (inst.wrapping_add(1), mesh, prim)),
                None => true,
            };
            let changing = self.changing.get(mesh as usize).map_or(&[][..], |m| m);
            faces.iter().all(|face| meets(&face.vertices, face.prim))
                && changing.iter().all(|(prim, shapes)| {
                    let (part, fraction) = part_of(time, shapes.len() - 1);
                    meets(&triangle::between(&shapes[part], &shapes[part + 1], fraction), *prim)
                })
        };
        if !visit(ray, 0, INVALID_ID) {
            return;
        }
        for (inst, placement) in (0u32..).zip(&self.instances) {
            let moved = self.moving.at(inst, time);
            if let Some(object_ray) = ray.to_object(moved.as_ref().unwrap_or(placement))
                && !visit(object_ray, placement.mesh, inst)
            {
                return;
            }
        }
    }
}

impl Brute {
    fn trace<B: RayByRay>(&self, blocks: &mut [B], len: usize, without: impl Without) -> u64 {
        let mut first = 0;
        Batch::new(blocks, len).for_each(|block, valid| {
            for lane in lanes_of(valid) {
                let ray = Ray::of_lane(block.rays(), lane);
                let mut closest = Closest::none(ray.tfar);
                self.each_hit(ray, block.rays().time[lane], |hit, rank| {
                    if without.is_passed(first + lane, key_of(rank.0, rank.2)) {
                        return true;
                    }
                    closest.offer(hit, rank);
                    !B::ANY
                });
                block.store(lane, &closest);
            }
            first += LANES;
        })
    }
}

impl Backend for Brute {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn closest_hit(&self, blocks: &mut [RayHitBlock], len: usize, _hint: Coherence) -> u64 {
        self.trace(blocks, len, ())
    }

    fn closest_hit_past(&self, blocks: &mut [RayHitBlock], len: usize, past: &Past) -> u64 {
        self.trace(blocks, len, past.lanes())
    }

    fn any_hit(&self, blocks: &mut [RayBlock], len: usize, _hint: Coherence) -> u64 {
        self.trace(blocks, len, ())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::geometry::NO_MATERIAL;
    use glam::{Affine3A, Mat3A};

    fn triangle_at(z: f32) -> TriangleMesh {
        let vertices = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p + Vec3::Z * z).to_vec();
        TriangleMesh { vertices, indices: vec![[0, 1, 2]; 2], ..TriangleMesh::default() }
    }

    fn closest(brute: &Brute, org: Vec3, dir: Vec3) -> Option<super::super::batch::Hit> {
        let mut block = RayHitBlock::EMPTY;
        block.ray.set(0, org, dir, f32::INFINITY);
        assert_eq!(brute.closest_hit(std::slice::from_mut(&mut block), 1, Coherence::Incoherent), 0);
        block.hit(0)
    }

    /// Oracle: the tie rule. Two copies of a triangle in the world and two instances of them coincide: the world's
    /// first wins; without the world's, the first instance's first.
    #[test]
    fn lowest_id_wins_at_equal_distance() {
        let place = Placement {
            mesh: 1,
            world_from_object: Affine3A::IDENTITY,
            object_from_world: Affine3A::IDENTITY,
            world_from_normal: Mat3A::IDENTITY,
            material: NO_MATERIAL,
        };
        let mut geometry = Geometry {
            meshes: vec![triangle_at(0.0), triangle_at(0.0)],
            instances: vec![place; 2],
            ..Geometry::default()
        };
        let org = Vec3::new(0.25, 0.25, 1.0);
        let hit = closest(&Brute::build(&geometry), org, Vec3::NEG_Z).unwrap();
        assert_eq!((hit.inst, hit.geom, hit.prim), (INVALID_ID, 0, 0));
        geometry.meshes[0] = TriangleMesh::default();
        let hit = closest(&Brute::build(&geometry), org, Vec3::NEG_Z).unwrap();
        assert_eq!((hit.inst, hit.geom, hit.prim), (0, 1, 0));
    }

    /// Oracle: the direction is not renormalised, so an instance scaled by 4 at z = −8 is hit at world distance 9.
    #[test]
    fn distances_of_instances_are_world_distances() {
        let world = Affine3A::from_scale_rotation_translation(Vec3::splat(4.0), glam::Quat::IDENTITY, Vec3::Z * -8.0);
        let place = Placement {
            mesh: 1,
            world_from_object: world,
            object_from_world: world.inverse(),
            world_from_normal: Mat3A::IDENTITY,
            material: NO_MATERIAL,
        };
        let geometry = Geometry {
            meshes: vec![TriangleMesh::default(), triangle_at(0.0)],
            instances: vec![place],
            ..Geometry::default()
        };
        let hit = closest(&Brute::build(&geometry), Vec3::new(1.0, 2.0, 1.0), Vec3::NEG_Z).unwrap();
        assert_eq!((hit.t, hit.u, hit.v, hit.inst), (9.0, 0.25, 0.5, 0));
    }
}
