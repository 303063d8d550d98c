//! Placed meshes: at rest, or moving while the shutter is open. Both are of the flattened geometry, for tracing and
//! shading alike; a scene at rest has none of the second kind, and pays one comparison for each instance that is looked
//! up.

use glam::{Affine3A, DAffine3, DVec3, Mat3A};

use crate::scene::motion::{between, part_of};

/// A placed mesh.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// Index into [`Geometry::meshes`](super::Geometry::meshes).
    pub mesh: u32,
    /// Object to world.
    pub world_from_object: Affine3A,
    /// Its inverse, computed in f64.
    pub object_from_world: Affine3A,
    /// Inverse transpose of the linear part: takes normals to the world (to be normalised).
    pub world_from_normal: Mat3A,
    /// Index into `Scene::materials` of what it is made of in the place of the triangles' own, or [`NO_MATERIAL`].
    pub material: u32,
}

/// "As the triangles say" in [`Placement::material`].
pub const NO_MATERIAL: u32 = u32::MAX;

impl Placement {
    /// Mesh `mesh` at `world_from_object`, which is invertible.
    #[inline]
    pub fn new(mesh: u32, world_from_object: Affine3A) -> Placement {
        let inverse = DAffine3::from_cols_array(&world_from_object.to_cols_array().map(f64::from)).inverse();
        let column = |v: DVec3| v.as_vec3a();
        let object_from_world = Affine3A {
            matrix3: Mat3A::from_cols(
                column(inverse.matrix3.x_axis),
                column(inverse.matrix3.y_axis),
                column(inverse.matrix3.z_axis),
            ),
            translation: column(inverse.translation),
        };
        let world_from_normal = object_from_world.matrix3.transpose();
        Placement { mesh, world_from_object, object_from_world, world_from_normal, material: NO_MATERIAL }
    }
}

/// The placements that move: the last ones of [`Geometry::instances`](super::Geometry::instances), which has
/// them as they are when the shutter opens.
#[derive(Clone, Debug, Default)]
pub struct Moving {
    /// Number of the first of them among the instances.
    first: u32,
    tracks: Vec<Way>,
    /// Poses of all tracks, one after the other.
    steps: Vec<Placement>,
}

/// Where one track lies in [`Moving::steps`].
#[derive(Clone, Copy, Debug)]
struct Way {
    mesh: u32,
    start: u32,
    parts: u32,
}

impl Moving {
    /// Whether everything is at rest.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.tracks.is_empty()
    }

    /// Adds the track of instance `instance`; numbers follow each other. `steps` are at least two.
    pub(super) fn push(&mut self, instance: u32, mesh: u32, steps: &[Affine3A]) {
        if self.tracks.is_empty() {
            self.first = instance;
        }
        debug_assert_eq!(self.first as usize + self.tracks.len(), instance as usize, "tracks follow each other");
        self.tracks.push(Way { mesh, start: self.steps.len() as u32, parts: steps.len() as u32 - 1 });
        self.steps.extend(steps.iter().map(|&step| Placement::new(mesh, step)));
    }

    #[inline(always)]
    fn way(&self, instance: u32) -> Option<&Way> {
        self.tracks.get(instance.wrapping_sub(self.first) as usize)
    }

    /// Poses of instance `instance` at equal intervals of the shutter; none where it is at rest.
    pub fn steps(&self, instance: u32) -> &[Placement] {
        let way = self.way(instance);
        way.map_or(&[], |way| &self.steps[way.start as usize..][..way.parts as usize + 1])
    }

    /// The poses around `time`, and how far it is between them.
    #[inline(always)]
    fn around(&self, instance: u32, time: f32) -> Option<(u32, &[Placement; 2], f32)> {
        let way = self.way(instance)?;
        let (part, fraction) = part_of(time, way.parts as usize);
        let pair = self.steps[way.start as usize + part..].first_chunk().expect("a part has two ends");
        Some((way.mesh, pair, fraction))
    }

    /// Where instance `instance` is at `time`, a fraction of the shutter; `None` where it is at rest.
    #[inline]
    pub fn at(&self, instance: u32, time: f32) -> Option<Placement> {
        let (mesh, [from, to], fraction) = self.around(instance, time)?;
        Some(Placement::new(mesh, between(&from.world_from_object, &to.world_from_object, fraction)))
    }

    /// Elements of the poses around `time` by their larger magnitude: what the roundings of a pose between them are
    /// shares of.
    #[inline]
    pub fn reach(&self, instance: u32, time: f32) -> Option<Affine3A> {
        let (_, [from, to], _) = self.around(instance, time)?;
        let (a, b) = (&from.world_from_object, &to.world_from_object);
        let most = |a: glam::Vec3A, b: glam::Vec3A| a.abs().max(b.abs());
        Some(Affine3A {
            matrix3: Mat3A::from_cols(
                most(a.matrix3.x_axis, b.matrix3.x_axis),
                most(a.matrix3.y_axis, b.matrix3.y_axis),
                most(a.matrix3.z_axis, b.matrix3.z_axis),
            ),
            translation: most(a.translation, b.translation),
        })
    }
}
