//! Whose triangles flattened geometry holds: from what a ray meets back to `Scene::instances`. Read by layers of ids
//! alone; eight bytes a placement.

/// Where the triangles of one baked placement begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// First record among those of the world mesh.
    pub first: u32,
    /// Index into `Scene::instances`.
    pub instance: u32,
}

/// Placements of flattened geometry by what is met of them.
#[derive(Clone, Debug, Default)]
pub struct Owners {
    /// Of the world mesh, by ascending record; one without triangles begins where the next one does.
    pub(super) baked: Vec<Part>,
    /// Index into `Scene::instances` of each instanced placement.
    pub(super) placed: Vec<u32>,
}

impl Owners {
    /// Index into `Scene::instances` of what triangle `prim` on instance `instance` (which may be none: then of the
    /// world mesh) belongs to.
    pub fn of(&self, instance: u32, prim: u32) -> usize {
        let Owners { baked, placed } = self;
        if let Some(&owner) = placed.get(instance as usize) {
            return owner as usize;
        }
        let after = baked.partition_point(|part| part.first <= prim);
        baked[..after].last().expect("a triangle of the world mesh belongs to a placement").instance as usize
    }
}

#[cfg(test)]
mod tests {
    use glam::{Affine3A, Vec3};

    use crate::scene::builder::SceneBuilder;
    use crate::scene::geometry::{BAKE_MESH_TRIANGLES, Geometry};

    /// Oracle: each triangle's place. Meshes stand at x = 10 times the number of their instance; those placed once are
    /// baked, the large one that is placed twice is not, a copy of a lamp is left out.
    #[test]
    fn triangles_know_their_placements() {
        let mut b = SceneBuilder::new();
        let (white, lamp) = (b.lambert(Vec3::ONE), b.emitter(Vec3::ZERO, Vec3::ONE));
        let corners = |x: f32| [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(y, z)| Vec3::new(x, y, z));
        b.quad(corners(0.0), white).quad(corners(10.0), lamp).quad(corners(10.0), lamp).quad(corners(30.0), white);
        let cells = BAKE_MESH_TRIANGLES as u32;
        let row = (0..=cells).flat_map(|i| [0.0, 1.0].map(|z| Vec3::new(0.0, i as f32, z))).collect();
        let strip = (0..cells).flat_map(|i| [[2 * i, 2 * i + 2, 2 * i + 1], [2 * i + 1, 2 * i + 2, 2 * i + 3]]);
        let large = b.mesh(row, strip.collect(), white);
        for x in [40.0, 50.0] {
            b.place(large, Affine3A::from_translation(Vec3::new(x, 0.0, 0.0)));
        }
        b.quad(corners(60.0), lamp);
        let geometry = Geometry::build(&b.build());
        assert_eq!((geometry.dropped_lamps, geometry.instances.len()), (2, 2));
        for prim in 0..geometry.meshes[0].indices.len() as u32 {
            let x = geometry.triangle(0, prim).v0[0];
            assert_eq!(geometry.owners.of(u32::MAX, prim), (x / 10.0) as usize, "{prim}");
        }
        assert_eq!([0, 1].map(|instance| geometry.owners.of(instance, 7)), [4, 5]);
    }
}
