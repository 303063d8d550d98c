//! Axis-aligned boxes, and those of instances.

use glam::{Affine3A, DAffine3, DVec3, Vec3};

use crate::scene::geometry::{Geometry, Placement};

/// Axis-aligned box.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct Bounds {
    pub lo: Vec3,
    pub hi: Vec3,
}

impl Bounds {
    pub const EMPTY: Bounds = Bounds { lo: Vec3::INFINITY, hi: Vec3::NEG_INFINITY };

    pub fn of(points: &[Vec3]) -> Self {
        points.iter().fold(Self::EMPTY, |b, &p| b.union(Bounds { lo: p, hi: p }))
    }

    pub fn union(self, other: Self) -> Self {
        Bounds { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }

    pub fn is_empty(self) -> bool {
        !self.lo.cmple(self.hi).all()
    }

    /// Length of the diagonal in f64, where no square over- or underflows; 0 when empty.
    pub fn diagonal(self) -> f64 {
        if self.is_empty() { 0.0 } else { (self.hi.as_dvec3() - self.lo.as_dvec3()).length() }
    }

    /// Half the surface, the cost measure.
    pub fn half_area(self) -> f32 {
        let e = self.hi - self.lo;
        e.x * e.y + e.y * e.z + e.z * e.x
    }

    /// Every side moved outward by `pad`, then by one ulp.
    pub fn grown(self, pad: Vec3) -> Self {
        let down = |x: Vec3| Vec3::new(x.x.next_down(), x.y.next_down(), x.z.next_down());
        let up = |x: Vec3| Vec3::new(x.x.next_up(), x.y.next_up(), x.z.next_up());
        Bounds { lo: down(self.lo - pad), hi: up(self.hi + pad) }
    }

    /// Halved first: the sum of two large coordinates may overflow.
    pub fn center(self) -> Vec3 {
        self.lo * 0.5 + self.hi * 0.5
    }
}

/// World box of instance `index` over the shutter, of a mesh with these bounds.
pub(in crate::backend) fn of_instance(geometry: &Geometry, index: usize, mesh: Bounds, reach: DVec3) -> Bounds {
    match geometry.moving.steps(index as u32) {
        [] => instance_bounds(&geometry.instances[index], mesh, reach),
        steps => moving_bounds(steps, mesh, reach),
    }
}

/// How large a coordinate or a distance of the scene may be, per axis, with the ray's origin in it or about it.
pub(in crate::backend) fn reach_of(scene: Bounds) -> DVec3 {
    let (lo, hi) = (scene.lo.as_dvec3(), scene.hi.as_dvec3());
    if scene.is_empty() { DVec3::ZERO } else { lo.abs().max(hi.abs()) * 2.0 + (hi - lo) }
}

/// World box of an instance, grown so that no ray that hits its mesh in object space misses it: taking a ray there and
/// testing it costs at most 16 roundings of terms no larger than |object_from_world| · reach.
fn instance_bounds(placement: &Placement, mesh: Bounds, reach: DVec3) -> Bounds {
    bounds_with_room(placement, mesh, reach, 1.0)
}

/// The same of an instance that moves: its corners run along straight lines between the poses, so the boxes there hold
/// them. Inverses between two poses may be larger than theirs: by up to 64 times for turns and changes of size
/// (`scene::motion::Track::problem`); a shear that changes by more than 700 times within a part is beyond this.
fn moving_bounds(steps: &[Placement], mesh: Bounds, reach: DVec3) -> Bounds {
    let boxes = steps.iter().map(|step| bounds_with_room(step, mesh, reach, 64.0));
    boxes.fold(Bounds::EMPTY, Bounds::union)
}

/// [`instance_bounds`] with `room` times the rounding.
fn bounds_with_room(placement: &Placement, mesh: Bounds, reach: DVec3, room: f64) -> Bounds {
    let world = exact(&placement.world_from_object);
    let (lo, hi) = (mesh.lo.as_dvec3(), mesh.hi.as_dvec3());
    let half = world.matrix3.abs() * (0.5 * (hi - lo)) + room * rounding_of(placement, reach);
    let center = world.transform_point3(0.5 * lo + 0.5 * hi);
    Bounds { lo: (center - half).as_vec3(), hi: (center + half).as_vec3() }.grown(Vec3::ZERO)
}

/// How far, per axis of the world, rounding may put a hit on an instance beside it, metres.
pub(in crate::backend) fn rounding_of(placement: &Placement, reach: DVec3) -> DVec3 {
    let (world, object) = (exact(&placement.world_from_object), exact(&placement.object_from_world));
    let unit_roundoff = 0.5 * f64::from(f32::EPSILON);
    world.matrix3.abs() * (16.0 * unit_roundoff * (object.matrix3.abs() * reach + object.translation.abs()))
}

/// How many times an error of a ray's origin may grow on its way into an instance and back, at most.
pub(in crate::backend) fn condition(placement: &Placement) -> f64 {
    let (world, object) = (exact(&placement.world_from_object), exact(&placement.object_from_world));
    let product = world.matrix3.abs() * object.matrix3.abs();
    (product * DVec3::ONE).max_element()
}

/// Bound of how many times a map lengthens a vector; sharp for turns and changes of size.
pub(in crate::backend) fn stretch(map: &Affine3A) -> f64 {
    let m = exact(map).matrix3;
    ((m.transpose() * m).abs() * DVec3::ONE).max_element().sqrt()
}

fn exact(map: &Affine3A) -> DAffine3 {
    DAffine3::from_cols_array(&map.to_cols_array().map(f64::from))
}
