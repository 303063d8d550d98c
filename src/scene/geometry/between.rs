//! Triangles of meshes that change their shape while the shutter is open: between the shapes, corners, normals and
//! tangents run along straight lines. Texture coordinates and colours stay those of the first shape.
//!
//! Limit: corners are rounded on their way, as every backend does it; the bound of the error of hits has room for that
//! (`math::float::hit_error_deforming`).

use glam::Vec3;

use super::deforming::Keys;
use super::records::{Geometry, Triangle};
use crate::scene::motion::part_of;

/// A triangle between two shapes.
#[derive(Clone, Copy, Debug)]
pub struct Between {
    /// Corners and normal at the time; the rest as in the first shape.
    pub triangle: Triangle,
    /// Records before and after.
    pub ends: [Triangle; 2],
    /// How far it is between them.
    pub fraction: f32,
}

impl Geometry {
    /// Triangle `prim` of mesh `geom` at `time`, a fraction of the shutter; `None` where the mesh keeps its shape.
    #[inline]
    pub fn deformed(&self, geom: u32, prim: u32, time: f32) -> Option<Between> {
        self.deforming.of(geom).map(|keys| self.between(geom, prim, time, *keys))
    }

    #[cold]
    #[inline(never)]
    fn between(&self, geom: u32, prim: u32, time: f32, keys: Keys) -> Between {
        let (part, fraction) = part_of(time, keys.parts);
        let first = self.triangle(geom, prim);
        let record = |shape: usize| match shape.checked_sub(1) {
            None => *first,
            Some(later) => self.later[keys.record(later, prim)],
        };
        let ends = [record(part), record(part + 1)];
        let mix = |of: fn(&Triangle) -> [f32; 3]| {
            let [from, to] = [0, 1].map(|end| Vec3::from(of(&ends[end])));
            from + (to - from) * fraction
        };
        let (v0, e1, e2) = (mix(|t| t.v0), mix(|t| t.e1), mix(|t| t.e2));
        let normal = e1.as_dvec3().cross(e2.as_dvec3()).try_normalize();
        let n_g = normal.map_or(first.n_g, |normal| normal.as_vec3().into());
        let triangle = Triangle { v0: v0.into(), e1: e1.into(), e2: e2.into(), n_g, ..*first };
        Between { triangle, ends, fraction }
    }

    /// Record of triangle `prim` of mesh `geom`, whose corners and normal are those at `time`.
    #[inline]
    pub fn triangle_at(&self, geom: u32, prim: u32, time: f32) -> Triangle {
        self.deformed(geom, prim, time).map_or_else(|| *self.triangle(geom, prim), |between| between.triangle)
    }
}
