//! Rounding: error bounds of hit points, and where rays start and shadow segments end so that they do not meet the
//! surface they leave or reach. No absolute length anywhere: scaling all input by 2^k scales every result exactly.
//!
//! u = 2⁻²⁴ is the unit roundoff of f32; a bound of k operations in a row is k·u to first order. What must be
//! covered, measured along the surface's normal n, when a ray starts at o = p + offset·n and is tested against its own
//! triangle:
//!
//! | error | bound on the normal component | why |
//! | --- | --- | --- |
//! | p rebuilt from barycentrics | u·Σ\|n\|\|p\| + 3u·m | last sum; products, their sum, e1 and e2 rounded |
//! | o rounded | u·Σ\|n\|\|p\| | one sum per component |
//! | vertices relative to o | 2u·m | one difference each; a sheared test rounds them again, mixing axes |
//! | t of the traversal's test | 4u·Σ\|p − v0\|X/\|e1 × e2\| | error of its normal, ≤ 4u·X a component |
//!
//! with m the largest component of e1, e2, e2 − e1, and X per component the two products of e1 × e2 added instead of
//! subtracted. The last row grows with the aspect ratio of triangles of a general direction, as the error itself does,
//! and vanishes for those in a coordinate plane. It is Embree's (robust) and Möller–Trumbore's row; a test on
//! sheared vertices must sum the depth of a hit in f64 instead, else its weights' rounding is amplified whatever the
//! direction.
//!
//! Checked by `tests/suite/hard/spawn.rs` (HARDCASES G07, G08, G19) on every backend: no re-hit in 10⁷ rays; with any
//! one row left out re-hits appear, with all of them halved only the first two rows fail (5000 of 2.5·10⁶ at ±1e-4
//! around 1).

use glam::{Affine3A, Mat3A, Vec3};

/// u: half the distance from 1 to the next f32.
pub const UNIT_ROUNDOFF: f32 = 1.0 / (1u32 << 24) as f32;

/// Largest f32 below 1.
pub const ONE_MINUS: f32 = 1.0 - UNIT_ROUNDOFF;

/// Roundings that scale with the coordinate: the hit point's last sum and that of the origin moved off it.
const POSITION_ROUNDING: f32 = 2.0 * UNIT_ROUNDOFF;

/// Roundings that scale with the triangle: three of the reconstruction, two of the vertices relative to the origin.
const EXTENT_ROUNDING: f32 = 5.0 * UNIT_ROUNDOFF;

/// Rounding of the traversal's own normal, per product: one each of two edges, of the product and of the difference.
const TEST_ROUNDING: f32 = 4.0 * UNIT_ROUNDOFF;

/// Normal distance by which a shadow segment ends short of its target, per length: three roundings each of the
/// numerator and the denominator of t, one of the vertices relative to the far origin, two of the direction; rounded up
/// to a power of
/// 2. A quarter of it is too little (19 of 200,000 at distance 10⁴), half was enough.
const SEGMENT_ROUNDING: f32 = 16.0 * UNIT_ROUNDOFF;

/// Roundings of one affine map of a point: entry, product, and the sums in a row. An eighth is too little.
const AFFINE_ROUNDING: f32 = 4.0 * UNIT_ROUNDOFF;

/// Point of a triangle from its barycentric weights. Unlike o + t·d its error does not grow with the way the ray came
/// (HARDCASES G09).
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

/// As [`hit_error`] for a triangle of an instanced mesh: `v0`, `e1`, `e2`, `p` in object space, the result in world
/// space along the world normal. Both matrices are roundings of the exact ones.
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

/// Roundings of a pose between two, beside those of a pose: two backends that take it from the same ends may differ by
/// eight of the larger end's elements, which is twice [`AFFINE_ROUNDING`] more. (A sixth of it met no triangle again in
/// 10⁵ rays on any backend.)
const MOVING: f32 = 3.0;

/// As [`hit_error_instanced`] for a mesh that moves: `reach` has the elements of the poses around the ray's time by
/// their larger magnitude, `object_from_world` is the inverse of the pose at that time.
#[inline]
pub fn hit_error_moving(triangle: (Vec3, Vec3, Vec3), p: Vec3, reach: &Affine3A, object_from_world: &Affine3A) -> f32 {
    MOVING * hit_error_instanced(triangle, p, reach, object_from_world)
}

/// As [`hit_error_moving`] for a mesh that changes its shape as well: its corners, none with a coordinate of a larger
/// magnitude than `most`, were taken from their places in two shapes. That rounds a corner three times, in the record
/// and in the traversal, so neighbouring roundings of either are beside the others; doubled.
#[inline]
pub fn hit_error_deforming(
    triangle: (Vec3, Vec3, Vec3),
    p: Vec3,
    most: Vec3,
    reach: &Affine3A,
    object_from_world: &Affine3A,
) -> f32 {
    let (v0, e1, e2) = triangle;
    let n = Normal::new(e1, e2);
    let normal = Vec3::from(object_from_world.matrix3.transpose() * glam::Vec3A::from(n.unit));
    let corners = n.along(most * (SHAPE_ROUNDING * UNIT_ROUNDOFF)) / normal.length();
    hit_error_moving((v0, e1, e2), p.abs().max(most), reach, object_from_world) + corners
}

/// Roundings of a corner between two shapes: of the difference, of its share and of the sum, of numbers up to twice the
/// corner's coordinates, in two ways, doubled.
const SHAPE_ROUNDING: f32 = 16.0;

/// Origin of a ray that leaves `p` along `dir`: moved by `error` along the unit normal `n_g` to the side of `dir`.
#[inline(always)]
pub fn spawn_origin(p: Vec3, n_g: Vec3, error: f32, dir: Vec3) -> Vec3 {
    p + n_g * error.copysign(n_g.dot(dir))
}

/// Roundings of origin and distance by which traversals may differ about a distance; they are about 20.
const DISTANCE_ROUNDING: f32 = 256.0 * UNIT_ROUNDOFF;

/// Where a ray from `org` that goes on past its hit at `t` is searched from: before everything that may lie at the same
/// distance up to rounding. `error` is the hit point's bound, `cos` that between the ray and the normal. At least 0.
#[inline(always)]
pub fn before(t: f32, org: Vec3, error: f32, cos: f32) -> f32 {
    let rounding = 16.0 * error + DISTANCE_ROUNDING * (org.abs().max_element() + t);
    // NaN and -inf become 0.
    (t - rounding / cos.abs()).max(0.0)
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
    let segment = segment_to(origin, target_position, target_normal, target_error);
    (segment.tfar > 0.0 && segment.tfar < f32::INFINITY).then_some(segment)
}

/// [`shadow_segment`] without its judgement, for loops over lanes: the caller refuses a `tfar` that is not above 0 and
/// finite.
#[inline(always)]
pub fn segment_to(origin: Vec3, target_position: Vec3, target_normal: Vec3, target_error: f32) -> Segment {
    let to_target = target_position - origin;
    let shift = target_error + SEGMENT_ROUNDING * to_target.length();
    let target = target_position - target_normal * shift.copysign(target_normal.dot(to_target));
    let to_target = target - origin;
    let tfar = to_target.length();
    Segment { dir: to_target / tfar, tfar }
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
        let extent = e1.abs().max(e2.abs()).max((e2 - e1).abs()).max_element();
        let test = (p - v0).abs().dot(self.products / self.length) * TEST_ROUNDING;
        extent * EXTENT_ROUNDING + test
    }
}

/// Height over length below which a triangle's normal is not resolved by f32 edges; its offset grows no further.
const NEEDLE: f32 = 64.0 * UNIT_ROUNDOFF;

/// Matrix of absolute values.
#[inline(always)]
fn abs(m: &Mat3A) -> Mat3A {
    Mat3A::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs())
}
