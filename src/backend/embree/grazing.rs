//! Hits of rays nearly parallel to their triangle, recomputed in f64.
//!
//! Embree tests the edges of a triangle relative to the ray's origin in f32. The error of its weights and distances
//! grows with the way to the triangle over the triangle's size and over the cosine: seen from 5·10⁴ away at 10⁻⁴
//! rad, 40 301 of 46 114 hits on triangles of about 11 × 1 passed beside them, 5904 with distances that no point of
//! the triangle has, by up to 8·10⁴ (3.13.5, ROBUST). So the numbers of every hit below [`GRAZING`] are computed
//! anew. A ray that passes further from the triangle than rounding of its input explains has no hit there; it is traced
//! again beyond, from close by, where Embree's error is small, so that the neighbour is found that it took the triangle
//! for.
//!
//! Limits: instanced meshes are left as they are; any-hit rays name no triangle to look at; what Embree does not report
//! is not found. One in 4000 hits of a diffuse bounce is this oblique.

use glam::{DVec3, Vec3};

use super::abi::{self, Query, sys};
use super::scene::World;
use crate::backend::batch::{INVALID_ID, LANES, RayHitBlock};
use crate::math::float::UNIT_ROUNDOFF;
use crate::math::lanes::lanes_of;

/// Cosine (over the 1-norm of the normal, at most √3 times its length) below which a hit is recomputed.
const GRAZING: f32 = 1.0 / 64.0;

/// Roundings of the ray's origin, of the point at its end and of the triangle, which a hit may lie off the ray by.
const OFF_RAY: f64 = 4.0 * UNIT_ROUNDOFF as f64;

/// Hits in a row that turn out to be none before a ray counts as a miss.
const MOST_FALSE: usize = 8;

/// Ends of the rays of a batch, where they have one: tracing overwrites them.
pub(super) struct Ends(Vec<(usize, f32)>);

impl Ends {
    /// Before the batch is traced. Allocates nothing for rays without end.
    #[inline(always)]
    pub(super) fn of(blocks: &[RayHitBlock]) -> Self {
        let mut ends = Vec::new();
        for (index, block) in blocks.iter().enumerate() {
            if block.ray.tfar.iter().any(|&tfar| tfar < f32::INFINITY) {
                ends.extend(block.ray.tfar.iter().enumerate().map(|(lane, &tfar)| (index * LANES + lane, tfar)));
            }
        }
        Ends(ends)
    }

    /// Of the ray with this number in the batch; ∞ if it has none.
    pub(super) fn get(&self, index: usize) -> f32 {
        self.0.binary_search_by_key(&index, |end| end.0).map_or(f32::INFINITY, |at| self.0[at].1)
    }
}

/// Mends the hits of traced blocks.
#[inline(always)]
pub(super) fn mend(world: &World, blocks: &mut [RayHitBlock], ends: &Ends, query: &mut Query) {
    for (index, block) in blocks.iter_mut().enumerate() {
        let mask = grazing(block);
        for lane in lanes_of(mask) {
            mend_lane(world, block, lane, ends.get(index * LANES + lane), query);
        }
    }
}

/// Mends the hit of one lane, whose ray ended at `end`.
#[inline]
pub(super) fn mend_one(world: &World, block: &mut RayHitBlock, lane: usize, end: f32, query: &mut Query) {
    if grazing(block) >> lane & 1 != 0 {
        mend_lane(world, block, lane, end, query);
    }
}

/// The lanes whose hit is oblique.
#[inline(always)]
fn grazing(block: &RayHitBlock) -> u16 {
    let (ray, hit) = (&block.ray, &block.hit);
    let mut grazing = [0u32; LANES];
    for i in 0..LANES {
        let along = ray.dir_x[i] * hit.ng_x[i] + ray.dir_y[i] * hit.ng_y[i] + ray.dir_z[i] * hit.ng_z[i];
        let size = hit.ng_x[i].abs() + hit.ng_y[i].abs() + hit.ng_z[i].abs();
        let seen = (hit.geom[i] != INVALID_ID) & (hit.inst[i] == INVALID_ID);
        grazing[i] = u32::from(seen & (along.abs() < GRAZING * size));
    }
    grazing.iter().enumerate().fold(0u16, |mask, (lane, &bit)| mask | (bit as u16) << lane)
}

/// A ray in f64.
struct Ray {
    org: DVec3,
    dir: DVec3,
    /// First and last distance.
    segment: (f32, f32),
    /// Shutter time.
    time: f32,
}

/// Numbers of a hit.
struct Found {
    prim: u32,
    t: f32,
    u: f32,
    v: f32,
}

#[cold]
fn mend_lane(world: &World, block: &mut RayHitBlock, lane: usize, end: f32, query: &mut Query) {
    let ray = Ray {
        org: block.ray.org(lane).as_dvec3(),
        dir: block.ray.dir(lane).as_dvec3(),
        segment: (block.ray.tnear[lane], end),
        time: block.ray.time[lane],
    };
    let prim = block.hit.prim[lane];
    let Some(found) = ray.meets(world, prim).or_else(|| ray.look_on(world, prim, query)) else {
        block.ray.tfar[lane] = end;
        block.hit.geom[lane] = INVALID_ID;
        return;
    };
    if found.prim != prim {
        let [a, b, c] = world.corners(found.prim).map(|p| p.as_dvec3());
        let ng = (b - a).cross(c - a).as_vec3();
        (block.hit.ng_x[lane], block.hit.ng_y[lane], block.hit.ng_z[lane]) = (ng.x, ng.y, ng.z);
    }
    block.ray.tfar[lane] = found.t;
    (block.hit.u[lane], block.hit.v[lane], block.hit.prim[lane]) = (found.u, found.v, found.prim);
}

impl Ray {
    /// The point of a triangle of the world mesh that is closest to the ray, if it is close enough and on the segment.
    fn meets(&self, world: &World, prim: u32) -> Option<Found> {
        let corners = world.corners(prim).map(|p| p.as_dvec3());
        let q = corners.map(|p| p - self.org);
        let length2 = self.dir.length_squared();

        // As the ray sees the triangle: corners in the plane across it, with the ray at 0.
        let p = q.map(|q| q - self.dir * (q.dot(self.dir) / length2));
        let area = |i: usize, j: usize| p[i].cross(p[j]).dot(self.dir);
        let w = [area(1, 2), area(2, 0), area(0, 1)];
        let sum: f64 = w.iter().sum();
        let inside = sum != 0.0 && (w.iter().all(|&w| w >= 0.0) || w.iter().all(|&w| w <= 0.0));
        let (weights, off) = if inside { (w.map(|w| w / sum), 0.0) } else { nearest_on_edges(p) };

        let point = q[0] * weights[0] + q[1] * weights[1] + q[2] * weights[2];
        let t = point.dot(self.dir) / length2;
        let reach = self.org.length() + t.abs() * length2.sqrt() + corners[0].length();
        let t = t as f32;
        (off <= OFF_RAY * reach && t >= self.segment.0 && t <= self.segment.1).then(|| Found {
            prim,
            t,
            u: weights[1] as f32,
            v: weights[2] as f32,
        })
    }

    /// The closest hit when that on `prim` is none: before the triangle from the ray's own origin, then from close by.
    fn look_on(&self, world: &World, prim: u32, query: &mut Query) -> Option<Found> {
        let along = world.corners(prim).map(|p| (p.as_dvec3() - self.org).dot(self.dir) / self.dir.length_squared());
        let (least, most) = along.iter().fold((f64::MAX, f64::MIN), |(lo, hi), &t| (lo.min(t), hi.max(t)));
        let split = ((2.0 * least - most) as f32).clamp(self.segment.0, self.segment.1.min(f32::MAX));
        let before = self.trace(world, 0.0, (self.segment.0, split), query);
        before.or_else(|| self.trace(world, split, (0.0, self.segment.1 - split), query))
    }

    /// The first hit, on a segment counted from the point at `start`, that is one in f64.
    fn trace(&self, world: &World, start: f32, segment: (f32, f32), query: &mut Query) -> Option<Found> {
        let org = (self.org + self.dir * f64::from(start)).as_vec3();
        let (mut near, far) = segment;
        for _ in 0..MOST_FALSE {
            let hit = world.closest((org, self.dir.as_vec3(), self.time), (near, far), query)?;
            if let Some(found) = self.meets(world, hit.prim) {
                return Some(found);
            }
            near = hit.t.next_up();
        }
        None
    }
}

/// Weights and distance of the point nearest to 0 on the sides of a triangle.
fn nearest_on_edges(p: [DVec3; 3]) -> ([f64; 3], f64) {
    let mut best = ([0.0; 3], f64::INFINITY);
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        let side = p[j] - p[i];
        let length2 = side.length_squared();
        let s = if length2 > 0.0 { (-p[i].dot(side) / length2).clamp(0.0, 1.0) } else { 0.0 };
        let off = (p[i] + side * s).length();
        if off < best.1 {
            best = ([0.0; 3], off);
            (best.0[i], best.0[j]) = (1.0 - s, s);
        }
    }
    best
}

/// A hit of the world mesh as Embree reports it.
pub(super) struct Reported {
    pub(super) prim: u32,
    pub(super) t: f32,
}

impl World {
    /// The closest hit of one ray on the world mesh. `None` also for one on an instance, which nothing can be said of
    /// here.
    fn closest(&self, (org, dir, time): (Vec3, Vec3, f32), segment: (f32, f32), query: &mut Query) -> Option<Reported> {
        let (tnear, tfar) = segment;
        if !(tnear <= tfar && org.is_finite()) {
            return None;
        }
        let ray = sys::RTCRay {
            org_x: org.x,
            org_y: org.y,
            org_z: org.z,
            tnear,
            dir_x: dir.x,
            dir_y: dir.y,
            dir_z: dir.z,
            time,
            tfar,
            mask: u32::MAX,
            ..Default::default()
        };
        let mut one = sys::RTCRayHit { ray, ..Default::default() };
        one.hit.geomID = INVALID_ID;
        one.hit.instID = [INVALID_ID];
        // SAFETY: the world's scene is committed and lives as long as `self`; the ray starts on one that was valid.
        unsafe { abi::intersect1(self.raw(), &mut one, query) };
        (one.hit.geomID != INVALID_ID && one.hit.instID[0] == INVALID_ID)
            .then_some(Reported { prim: one.hit.primID, t: one.ray.tfar })
    }
}
