//! Where a ray starts, exactly: see `departure.rs`.

use glam::Vec3;

use crate::backend::batch::{Hit, RayBlock};
use crate::math::float::UNIT_ROUNDOFF;

/// Errors of a vertex and of a boundary within which the stack decides: the point is one off its triangle already, and
/// the distances of both rays are rounded. (32, with the same [`BACK`], was worse than none of
/// this where rounding is 5000 times as large: it is then as large as triangles.)
pub const BLUR: f32 = 4.0;

/// Errors of a vertex that rays are traced from before it.
pub const BACK: f32 = 1024.0;

/// Where a ray starts.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    /// The point, off the surface by its error, metres.
    pub p: Vec3,
    /// How far before it the ray is traced from, metres.
    pub back_m: f32,
    /// Distance of planes within which the point's side is not known by its numbers, metres.
    pub blur_m: f32,
    /// From the surface to the point, metres.
    pub off: Vec3,
    /// The surface that it leaves; `None` in the midst of a medium.
    pub from: Option<Left>,
}

/// A surface that a ray leaves.
#[derive(Clone, Copy, Debug)]
pub struct Left {
    /// Where.
    pub hit: Hit,
    /// The closed solid that it bounds, or `NO_SOLID`.
    pub solid: u32,
}

impl Start {
    /// Of rays that have not left anything.
    pub const NOWHERE: Start = Start { p: Vec3::ZERO, back_m: 0.0, blur_m: 0.0, off: Vec3::ZERO, from: None };

    /// In a medium, `distance_m` from the last vertex.
    pub fn within(p: Vec3, distance_m: f32) -> Start {
        let error = UNIT_ROUNDOFF * (p.abs().max_element() + distance_m);
        Start { p, back_m: BACK * error, blur_m: BLUR * error, ..Start::NOWHERE }
    }

    /// Moves the ray in lane `i` to where it is traced from.
    pub fn set_back(&self, ray: &mut RayBlock, i: usize) {
        let org = self.p - ray.dir(i) * self.back_m;
        (ray.org_x[i], ray.org_y[i], ray.org_z[i]) = (org.x, org.y, org.z);
        ray.tfar[i] += self.back_m;
    }
}
