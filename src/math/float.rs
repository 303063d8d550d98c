//! Rounding: error bounds of hit points, and where rays start and shadow segments end so that they do not meet the
//! surface they leave or reach. No absolute length anywhere: scaling all input by 2^k scales every result exactly.
//!
//! u = 2⁻²⁴ is the unit roundoff of f32; a bound of k operations in a row is k·u to first order. What must be covered,
//! measured along the surface's normal n, when a ray starts at o = p + offset·n and is tested against its own triangle:
//!
//! | error | bound on the normal component | why |
//! | --- | --- | --- |
//! | p rebuilt from barycentrics | u·Σ\|n\|\|p\| + 3u·Σ\|n\|m | last sum; two products, their sum, e1 and e2 rounded |
//! | o rounded | u·Σ\|n\|\|p\| | one sum per component |
//! | vertices relative to o | 2u·Σ\|n\|m | one difference per vertex, twice: Woop's shear rounds once more |
//! | t of the traversal's test | c·u·Σ\|p − v0\|X/\|e1 × e2\| | its normal e1 × e2 has error ≤ c·u·X |
//!
//! with m = max(\|e1\|, \|e2\|, \|e2 − e1\|) and X = the product sums of e1 × e2 without cancellation, both per component. The
//! last row grows with the triangle's aspect ratio, as the error itself does; for slivers of a general direction it
//! dominates. The first rows are worst cases; c is measured, see `TEST_ROUNDING`.
//! Checked by `tests/suite/spawn.rs` (HARDCASES G07, G08, G19) on every backend of the build.

use glam::{Affine3A, Mat3A, Vec3};

/// u: half the distance from 1 to the next f32.
pub const UNIT_ROUNDOFF: f32 = 1.0 / (1u32 << 24) as f32;

/// Largest f32 below 1.
pub const ONE_MINUS: f32 = 1.0 - UNIT_ROUNDOFF;

/// Roundings of a hit point's coordinates that scale with the coordinate: its own last sum and that of the origin
/// moved off it.
const POSITION_ROUNDING: f32 = 2.0 * UNIT_ROUNDOFF;

/// Roundings that scale with the triangle: three of the reconstruction, two of the vertices relative to the origin.
const EXTENT_ROUNDING: f32 = 5.0 * UNIT_ROUNDOFF;

/// Rounding of the traversal's own normal or edge functions, per product of the cross product: two roundings of the edges,
/// one of the product, one of the difference, as a worst case.
const TEST_ROUNDING: f32 = 4.0 * UNIT_ROUNDOFF;

/// Normal distance by which a shadow segment ends short of its target, per length: three roundings each of the numerator and
/// the denominator of t, one of the vertices relative to the far origin, two of the direction, rounded up to a power of 2.
const SEGMENT_ROUNDING: f32 = 16.0 * UNIT_ROUNDOFF;

/// Roundings of one affine map of a point: three products and three sums in a row, rounded to the map's own entries.
const AFFINE_ROUNDING: f32 = 4.0 * UNIT_ROUNDOFF;

/// Point of a triangle from its barycentric weights. Twice as near to the plane as o + t·d and independent of how far
/// the ray came (HARDCASES G09).
#[inline(always)]
pub fn hit_point(v0: Vec3, e1: Vec3, e2: Vec3, u: f32, v: f32) -> Vec3 {
    v0 + (e1 * u + e2 * v)
}

/// How far from `p`, along the geometric normal, a ray must start so that it cannot meet the triangle it leaves. `p`
/// comes from [`hit_point`]; everything in world space.
#[inline(always)]
pub fn hit_error(v0: Vec3, e1: Vec3, e2: Vec3, p: Vec3) -> f32 {
    let n = Normal::new(e1, e2);
    n.along(p.abs() * POSITION_ROUNDING) + n.object_error(v0, e1, e2, p)
}

/// As [`hit_error`] for a triangle of an instanced mesh: `v0`, `e1`, `e2`, `p` in object space, the result in world space
/// along the world normal. Both matrices are roundings of the exact ones.
#[inline(always)]
pub fn hit_error_instanced(
    triangle: (Vec3, Vec3, Vec3),
    p: Vec3,
    world_from_object: &Affine3A,
    object_from_world: &Affine3A,
) -> f32 {
    let (v0, e1, e2) = triangle;
    let n = Normal::new(e1, e2);

    // The map to the world rounds p, the traversal's map back rounds the ray's origin, and its matrix is rounded too.
    let world = abs(&world_from_object.matrix3) * p.abs() + Vec3::from(world_from_object.translation).abs();
    let back = Vec3::from(abs(&object_from_world.matrix3) * glam::Vec3A::from(world));
    let object = n.object_error(v0, e1, e2, p) + n.along(p.abs() * POSITION_ROUNDING + back * (2.0 * AFFINE_ROUNDING));

    // A world offset h along the world normal is h·|M⁻ᵀ n| along the object's.
    let normal = Vec3::from(object_from_world.matrix3.transpose() * glam::Vec3A::from(n.unit));
    let stretch = normal.length();
    let rounding = (normal / stretch).abs().dot(world) * (AFFINE_ROUNDING + UNIT_ROUNDOFF);
    object / stretch + rounding
}

/// Origin of a ray that leaves `p` along `dir`: moved by `error` along the unit normal `n_g` to the side of `dir`.
#[inline(always)]
pub fn spawn_origin(p: Vec3, n_g: Vec3, error: f32, dir: Vec3) -> Vec3 {
    p + n_g * error.copysign(n_g.dot(dir))
}

/// A shadow ray: from its origin in a unit direction up to `tfar`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Unit direction.
    pub dir: Vec3,
    /// Length.
    pub tfar: f32,
}

/// The segment from `origin` (already moved by [`spawn_origin`]) to a point on a light, ending short of the light's own
/// triangle: the target moves along its normal, to the side of the origin, by its error and the traversal's error at
/// that distance. A zero normal (punctual light) leaves the target where it is. `None` when there is no such direction:
/// origin and target coincide or are not finite.
#[inline(always)]
pub fn shadow_segment(origin: Vec3, target_position: Vec3, target_normal: Vec3, target_error: f32) -> Option<Segment> {
    let to_target = target_position - origin;
    let shift = target_error + SEGMENT_ROUNDING * to_target.length();
    let target = target_position - target_normal * shift.copysign(target_normal.dot(to_target));
    let to_target = target - origin;
    let tfar = to_target.length();
    let dir = to_target / tfar;
    (tfar > 0.0 && tfar < f32::INFINITY).then_some(Segment { dir, tfar })
}

/// Normal of a triangle with its length apart: squares of lengths are formed, fourth powers never, so that sizes from
/// 1e-18 to 1e18 stay in range.
struct Normal {
    unit: Vec3,
    /// |e1 × e2|, never less than its own rounding error.
    length: f32,
    /// Sums of the cross product's products without cancellation, per component.
    products: Vec3,
}

impl Normal {
    #[inline(always)]
    fn new(e1: Vec3, e2: Vec3) -> Self {
        let (a, b) = (e1.abs(), e2.abs());
        let products = Vec3::new(a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x);
        let cross = e1.cross(e2);
        let scale = cross.abs().max_element();
        let scaled = cross / scale;
        let length = scaled.length();
        let floor = products.max_element() * NEEDLE;
        // A needle's normal is noise in f32: weigh all axes alike.
        let unit = if scale > floor { scaled / length } else { Vec3::ONE };
        Normal { unit, length: (scale * length).max(floor), products }
    }

    /// Component along the normal of a vector of absolute errors.
    #[inline(always)]
    fn along(&self, error: Vec3) -> f32 {
        self.unit.abs().dot(error)
    }

    /// The rows of the module's table that scale with the triangle.
    #[inline(always)]
    fn object_error(&self, v0: Vec3, e1: Vec3, e2: Vec3, p: Vec3) -> f32 {
        let extent = e1.abs().max(e2.abs()).max((e2 - e1).abs());
        let test = (p - v0).abs().dot(self.products / self.length) * TEST_ROUNDING;
        // A triangle in a coordinate plane through the origin has no rounding at all, and a ray that starts exactly in
        // its plane would meet it at t = 0: the offset is never nothing.
        let floor = extent.max_element() * (2.0 * UNIT_ROUNDOFF);
        (self.along(extent * EXTENT_ROUNDING) + test).max(floor)
    }
}

/// Height over length below which a triangle's normal is not resolved by f32 edges; its offset grows no further.
const NEEDLE: f32 = 64.0 * UNIT_ROUNDOFF;

/// Matrix of absolute values.
#[inline(always)]
fn abs(m: &Mat3A) -> Mat3A {
    Mat3A::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs())
}
