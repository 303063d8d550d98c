//! Watertight ray–triangle test: a ray that passes over a shared edge or vertex hits at least one of the triangles
//! there.
//!
//! The ray is sheared onto its largest axis once (`RayShear`); a triangle is then a 2D problem whose three edge
//! functions have exactly opposite signs for the two owners of an edge. A product difference rounds to the right sign
//! or to zero, so a zero is settled in f64, where the products are exact. Edges and vertices belong to both sides; both
//! faces are hit; `tnear ≤ t ≤ tfar` is inclusive. `t` is in units of the direction's length, whatever that is. One
//! source serves one triangle (`intersect`, the oracle) and blocks of N (`intersect_lanes`): the operations and their
//! order are the same, so the numbers are too (Rust never contracts to FMA). Source: Woop, Benthin, Wald 2013
//! (JCGT 2:1); here weights are divided first and the depth is interpolated by differences: 10¹⁸ m coordinates do
//! not overflow, and a plane across the ray is hit at its exact distance. Limit: a triangle seen exactly edge-on is not
//! hit (its neighbours are).

use glam::{DVec3, Vec3};

use crate::backend::batch::{BLOCKED, Block, RayBlock, RayHitBlock};
use crate::scene::geometry::Placement;
pub(crate) use crate::scene::geometry::is_degenerate;

/// A ray as the backends that are written in Rust trace it. `dir` needs no unit length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    /// Origin.
    pub org: Vec3,
    /// Direction, not zero; no component is −0.0.
    pub dir: Vec3,
    /// Start of the segment.
    pub tnear: f32,
    /// End of the segment.
    pub tfar: f32,
}

impl Ray {
    /// Removes the sign of zero direction components: ±0.0 must choose the same planes and axes.
    #[inline(always)]
    pub fn new(org: Vec3, dir: Vec3, tnear: f32, tfar: f32) -> Self {
        Ray { org, dir: dir + Vec3::ZERO, tnear, tfar }
    }

    /// One lane of a block.
    #[inline(always)]
    pub fn of_lane(block: &RayBlock, lane: usize) -> Self {
        Ray::new(block.org(lane), block.dir(lane), block.tnear[lane], block.tfar[lane])
    }

    /// The same segment in the space of an instanced mesh. The direction is not renormalised, so `t` stays in world
    /// units. `None` when the transform takes it out of the finite range: such a ray misses.
    #[inline(always)]
    pub fn to_object(self, placement: &Placement) -> Option<Self> {
        let org = placement.object_from_world.transform_point3(self.org);
        let dir = placement.object_from_world.transform_vector3(self.dir);
        let usable = org.is_finite() && dir.is_finite() && dir != Vec3::ZERO;
        usable.then(|| Ray::new(org, dir, self.tnear, self.tfar))
    }
}

/// Corners of a triangle between two shapes of its mesh.
#[inline(always)]
pub(crate) fn between(from: &[Vec3; 3], to: &[Vec3; 3], fraction: f32) -> [Vec3; 3] {
    [0, 1, 2].map(|corner| from[corner] + (to[corner] - from[corner]) * fraction)
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TriangleHit {
    /// Distance in units of the direction's length.
    pub t: f32,
    /// Barycentric weight of the second vertex.
    pub u: f32,
    /// Barycentric weight of the third vertex.
    pub v: f32,
}

/// Order among hits at equal `t`, the lowest wins: (instance + 1, or 0 for the world; mesh; triangle).
pub(crate) type Rank = (u32, u32, u32);

/// The closest hit so far.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Closest {
    /// Where.
    pub hit: TriangleHit,
    /// On what; [`Closest::NOTHING`] before the first hit.
    pub rank: Rank,
}

impl Closest {
    /// Loses every tie, so that a hit at exactly `tfar` counts.
    const NOTHING: Rank = (u32::MAX, u32::MAX, u32::MAX);

    /// No hit yet on a segment that ends at `tfar`.
    #[inline(always)]
    pub fn none(tfar: f32) -> Self {
        Closest { hit: TriangleHit { t: tfar, u: 0.0, v: 0.0 }, rank: Self::NOTHING }
    }

    /// Whether there is a hit.
    #[inline(always)]
    pub fn is_hit(&self) -> bool {
        self.rank != Self::NOTHING
    }

    /// Keeps the closer of the two, or the lower at equal distance.
    #[inline(always)]
    pub fn offer(&mut self, hit: TriangleHit, rank: Rank) {
        if hit.t < self.hit.t || (hit.t == self.hit.t && rank < self.rank) {
            *self = Closest { hit, rank };
        }
    }
}

/// A block whose rays are traced one by one.
pub(crate) trait RayByRay: Block {
    /// Whether any hit will do.
    const ANY: bool;

    /// Writes the hit, if there is one, to a lane that was cleared.
    fn store(&mut self, lane: usize, closest: &Closest);
}

impl RayByRay for RayHitBlock {
    const ANY: bool = false;

    #[inline(always)]
    fn store(&mut self, lane: usize, closest: &Closest) {
        if closest.is_hit() {
            self.ray.tfar[lane] = closest.hit.t;
            self.hit.u[lane] = closest.hit.u;
            self.hit.v[lane] = closest.hit.v;
            self.hit.inst[lane] = closest.rank.0.wrapping_sub(1);
            self.hit.geom[lane] = closest.rank.1;
            self.hit.prim[lane] = closest.rank.2;
        }
    }
}

impl RayByRay for RayBlock {
    const ANY: bool = true;

    #[inline(always)]
    fn store(&mut self, lane: usize, closest: &Closest) {
        if closest.is_hit() {
            self.tfar[lane] = BLOCKED;
        }
    }
}

/// Hits of one ray with N triangles; a column is meaningful where `mask` has its bit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LaneHits<const N: usize> {
    /// Bit i: triangle i is hit.
    pub mask: u32,
    /// As [`TriangleHit::t`].
    pub t: [f32; N],
    /// As [`TriangleHit::u`].
    pub u: [f32; N],
    /// As [`TriangleHit::v`].
    pub v: [f32; N],
}

/// N triangles as `[vertex][axis][lane]`. Unused lanes hold NaN, which no comparison accepts.
pub(crate) type Lanes<const N: usize> = [[[f32; N]; 3]; 3];

/// What the test needs of a ray, computed once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RayShear {
    org: [f32; 3],
    /// Axis of the largest direction component and the two others, in an order that keeps the winding.
    kx: usize,
    ky: usize,
    kz: usize,
    /// `dir[kx]/dir[kz]` and `dir[ky]/dir[kz]`.
    sx: f32,
    sy: f32,
    /// `dir[kz]`.
    dz: f32,
}

impl RayShear {
    /// Prepares `ray`.
    #[inline(always)]
    pub fn new(ray: &Ray) -> Self {
        let dir = ray.dir.to_array();
        let abs = ray.dir.abs();
        // Equal components: the first axis wins.
        let kz = if abs.x >= abs.y && abs.x >= abs.z {
            0
        } else if abs.y >= abs.z {
            1
        } else {
            2
        };
        let (mut kx, mut ky) = ([1, 2, 0][kz], [2, 0, 1][kz]);
        if dir[kz] < 0.0 {
            (kx, ky) = (ky, kx);
        }
        RayShear { org: ray.org.to_array(), kx, ky, kz, sx: dir[kx] / dir[kz], sy: dir[ky] / dir[kz], dz: dir[kz] }
    }

    /// Tests one triangle.
    #[inline(always)]
    pub fn intersect(&self, triangle: &[Vec3; 3], tnear: f32, tfar: f32) -> Option<TriangleHit> {
        let lanes = triangle.map(|v| v.to_array().map(|x| [x]));
        let hits = self.intersect_lanes::<1>(&lanes, tnear, tfar);
        (hits.mask != 0).then(|| TriangleHit { t: hits.t[0], u: hits.u[0], v: hits.v[0] })
    }

    /// Tests N triangles.
    #[inline(always)]
    pub fn intersect_lanes<const N: usize>(&self, tri: &Lanes<N>, tnear: f32, tfar: f32) -> LaneHits<N> {
        let [a, b, c] = [self.shear(&tri[0]), self.shear(&tri[1]), self.shear(&tri[2])];
        // Edge functions opposite to each vertex: twice the signed areas of its weight.
        let mut ea = cross_lanes(&c, &b);
        let mut eb = cross_lanes(&a, &c);
        let mut ec = cross_lanes(&b, &a);
        let mut zero = false;
        for i in 0..N {
            zero |= (ea[i] == 0.0) | (eb[i] == 0.0) | (ec[i] == 0.0);
        }
        if zero {
            settle_zeros(&a, &b, &c, &mut ea, &mut eb, &mut ec);
        }

        let mut mask = lane_mask::<N>(|i| {
            ((ea[i] >= 0.0) & (eb[i] >= 0.0) & (ec[i] >= 0.0)) | ((ea[i] <= 0.0) & (eb[i] <= 0.0) & (ec[i] <= 0.0))
        });
        let mut hits = LaneHits { mask: 0, t: [0.0; N], u: [0.0; N], v: [0.0; N] };
        if mask == 0 {
            return hits;
        }

        // Few get here: the numbers of a hit are worth f64.
        let mut candidates = mask;
        while candidates != 0 {
            let i = candidates.trailing_zeros() as usize;
            candidates &= candidates - 1;
            let at = |v: &[[f32; N]; 3]| DVec3::new(f64::from(v[0][i]), f64::from(v[1][i]), f64::from(v[2][i]));
            let hit = hit_of(at(&a), at(&b), at(&c), self.dz);
            (hits.t[i], hits.u[i], hits.v[i]) = (hit.t, hit.u, hit.v);
            mask &= !(u32::from(!(hit.t >= tnear && hit.t <= tfar)) << i);
        }
        hits.mask = mask;
        hits
    }

    /// Vertices relative to the origin, sheared so that the ray runs along the third axis.
    #[inline(always)]
    fn shear<const N: usize>(&self, vertex: &[[f32; N]; 3]) -> [[f32; N]; 3] {
        let (kx, ky, kz) = (self.kx, self.ky, self.kz);
        let mut out = [[0.0; N]; 3];
        for i in 0..N {
            let z = vertex[kz][i] - self.org[kz];
            out[0][i] = (vertex[kx][i] - self.org[kx]) - self.sx * z;
            out[1][i] = (vertex[ky][i] - self.org[ky]) - self.sy * z;
            out[2][i] = z;
        }
        out
    }
}

/// Weights and depth of a hit from sheared vertices, in f64: products of f32 are exact there. In f32 the rounding of
/// the weights would be amplified by the triangle's aspect ratio and by 1/cos where it is grazed, and a ray could meet
/// the triangle it was spawned on; so only the rounding of the vertices is left (table of `math::float`). Exactly
/// edge-on, t is NaN, which no range accepts.
#[inline(always)]
pub(crate) fn hit_of(a: DVec3, b: DVec3, c: DVec3, dz: f32) -> TriangleHit {
    let edge = |p: DVec3, q: DVec3| p.x * q.y - p.y * q.x;
    let (wa, wb, wc) = (edge(c, b), edge(a, c), edge(b, a));
    let area = wa + wb + wc;
    // f32 accepted the edges; where f64 disagrees by a rounding the hit stays on the rim.
    let u = (wb / area).clamp(0.0, 1.0);
    let v = (wc / area).max(0.0).min(1.0 - u);
    // Depth from differences: weights that do not quite add up to one cannot move the hit along the ray.
    let depth = a.z + (u * (b.z - a.z) + v * (c.z - a.z));
    let t = if area != 0.0 { depth / f64::from(dz) } else { f64::NAN };
    TriangleHit { t: t as f32 + 0.0, u: u as f32 + 0.0, v: v as f32 + 0.0 }
}

/// p × q in the sheared plane.
#[inline(always)]
fn cross_lanes<const N: usize>(p: &[[f32; N]; 3], q: &[[f32; N]; 3]) -> [f32; N] {
    let mut out = [0.0; N];
    for i in 0..N {
        out[i] = p[0][i] * q[1][i] - p[1][i] * q[0][i];
    }
    out
}

/// Recomputes in f64 the three edge functions of every lane that has a zero. Products of f32 are exact in f64, so the
/// difference has the exact sign; one that rounds to zero again on the way back counts as on the edge, never as a miss.
#[cold]
#[inline(never)]
pub(crate) fn settle_zeros<const N: usize>(
    a: &[[f32; N]; 3],
    b: &[[f32; N]; 3],
    c: &[[f32; N]; 3],
    ea: &mut [f32; N],
    eb: &mut [f32; N],
    ec: &mut [f32; N],
) {
    let exact = |p: &[[f32; N]; 3], q: &[[f32; N]; 3], i: usize| {
        (f64::from(p[0][i]) * f64::from(q[1][i]) - f64::from(p[1][i]) * f64::from(q[0][i])) as f32
    };
    for i in 0..N {
        if ea[i] == 0.0 || eb[i] == 0.0 || ec[i] == 0.0 {
            ea[i] = exact(c, b, i);
            eb[i] = exact(a, c, i);
            ec[i] = exact(b, a, i);
        }
    }
}

/// Bit i of the result is `test(i)`.
#[inline(always)]
fn lane_mask<const N: usize>(test: impl Fn(usize) -> bool) -> u32 {
    let mut mask = 0;
    for i in 0..N {
        mask |= u32::from(test(i)) << i;
    }
    mask
}

#[cfg(test)]
mod tests {
    use super::*;

    const RIGHT: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];

    fn hit(triangle: &[Vec3; 3], org: Vec3, dir: Vec3, tnear: f32, tfar: f32) -> Option<TriangleHit> {
        RayShear::new(&Ray::new(org, dir, tnear, tfar)).intersect(triangle, tnear, tfar)
    }

    /// Oracle: the hit computed by hand; exact in binary, so no tolerance.
    #[test]
    fn interior_hit_has_the_weights_of_the_second_and_third_vertex() {
        let org = Vec3::new(0.25, 0.5, 2.0);
        assert_eq!(hit(&RIGHT, org, Vec3::NEG_Z, 0.0, f32::INFINITY), Some(TriangleHit { t: 2.0, u: 0.25, v: 0.5 }));
        // From behind, and with a direction twice as long: t counts directions.
        let below = Vec3::new(0.25, 0.5, -2.0);
        assert_eq!(hit(&RIGHT, below, Vec3::Z * 2.0, 0.0, f32::INFINITY).map(|h| h.t), Some(1.0));
    }

    /// Oracle: the contract. Both ends of the segment belong to it, one ulp outside does not.
    #[test]
    fn segment_is_inclusive() {
        let org = Vec3::new(0.25, 0.25, 2.0);
        let cast = |tnear, tfar| hit(&RIGHT, org, Vec3::NEG_Z, tnear, tfar).is_some();
        assert!(cast(2.0, 2.0));
        assert!(!cast(0.0, 2.0f32.next_down()));
        assert!(!cast(2.0f32.next_up(), 9.0));
        // A triangle through the origin is hit at t = +0.
        let at_origin = hit(&RIGHT, Vec3::new(0.25, 0.25, 0.0), Vec3::NEG_Z, 0.0, 1.0).unwrap();
        assert_eq!(at_origin.t.to_bits(), 0);
    }

    /// Oracle: three edges and three vertices of a dyadic triangle lie on it; all signs of zero give the same bits.
    #[test]
    fn edges_and_vertices_count_for_every_sign_of_zero() {
        for (x, y) in [(0.5, 0.0), (0.0, 0.5), (0.5, 0.5), (0.0, 0.0), (1.0, 0.0), (0.0, 1.0)] {
            let all: Vec<_> = [(0.0, 0.0), (-0.0, 0.0), (0.0, -0.0), (-0.0, -0.0)]
                .into_iter()
                .map(|(dx, dy)| {
                    hit(&RIGHT, Vec3::new(x, y, 1.0), Vec3::new(dx, dy, -1.0), 0.0, 2.0).expect("on the rim")
                })
                .map(|h| (h.t.to_bits(), h.u.to_bits(), h.v.to_bits()))
                .collect();
            assert!(all.windows(2).all(|w| w[0] == w[1]), "{all:x?}");
        }
    }

    /// Oracle: the one-triangle path. Blocks must agree with it in every bit, zeros and NaN padding included.
    #[test]
    fn lanes_agree_with_single_triangles_bit_for_bit() {
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            // A coarse dyadic grid makes exact edge hits common.
            ((state >> 59) as f32) / 8.0 - 2.0
        };
        let mut point = || Vec3::new(next(), next(), next());
        let mut count = 0;
        for _ in 0..20_000 {
            let triangles: [[Vec3; 3]; 3] = std::array::from_fn(|_| [point(), point(), point()]);
            let (org, dir) = (point(), point());
            if dir == Vec3::ZERO {
                continue;
            }
            let shear = RayShear::new(&Ray::new(org, dir, 0.0, 10.0));
            let mut lanes: Lanes<4> = [[[f32::NAN; 4]; 3]; 3];
            for (lane, triangle) in triangles.iter().enumerate() {
                for (vertex, p) in triangle.iter().enumerate() {
                    for axis in 0..3 {
                        lanes[vertex][axis][lane] = p[axis];
                    }
                }
            }
            let block = shear.intersect_lanes(&lanes, 0.0, 10.0);
            assert_eq!(block.mask & 8, 0, "padding was hit");
            for (i, triangle) in triangles.iter().enumerate() {
                let one = shear.intersect(triangle, 0.0, 10.0);
                let of_block =
                    (block.mask >> i & 1 == 1).then(|| TriangleHit { t: block.t[i], u: block.u[i], v: block.v[i] });
                assert_eq!(one, of_block);
                count += u32::from(one.is_some());
            }
        }
        assert!(count > 1000, "only {count} hits were compared");
    }

    /// Oracle: area in exact arithmetic. The last case is the collinear triangle of HARDCASES G13.
    #[test]
    fn lines_points_and_needles_are_degenerate() {
        let v = Vec3::new;
        let needle = [Vec3::ZERO, Vec3::X, v(0.5, 1e-30, 0.0)];
        let collinear = [
            v(-1_113.454_6, -79.049_614, -56.243_19),
            v(-1_113.454_6, -87.092_27, -56.243_19),
            v(-1_113.454_6, -79.209_015, -56.243_19),
        ];
        for bad in [[Vec3::X; 3], [Vec3::X, Vec3::Y, Vec3::X], needle, collinear, [Vec3::NAN, Vec3::X, Vec3::Y]] {
            assert!(is_degenerate(&bad), "{bad:?}");
        }
        for scale in [1e-18f32, 1e-6, 1.0, 1e6, 1e18] {
            assert!(!is_degenerate(&RIGHT.map(|p| p * scale)));
        }
        assert!(!is_degenerate(&[Vec3::ZERO, Vec3::X, v(0.5, 1e-6, 0.0)]));
    }

    /// Oracle: t = distance by construction. Nothing over- or underflows between 10⁻¹⁵ and 10¹⁸ m.
    #[test]
    fn scale_does_not_matter() {
        for exponent in -50..=59 {
            let s = 2f32.powi(exponent);
            let h = hit(&RIGHT.map(|p| p * s), Vec3::new(0.25, 0.5, 0.75) * s, Vec3::NEG_Z, 0.0, f32::INFINITY);
            assert_eq!(h, Some(TriangleHit { t: 0.75 * s, u: 0.25, v: 0.5 }), "2^{exponent}");
        }
    }
}
