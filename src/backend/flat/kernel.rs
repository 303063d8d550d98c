//! Sixteen rays against all faces. Loops over lanes without branches; compiled for the build's baseline and for AVX-512
//! with the same bits, as every fused operation is written out.

use bytemuck::cast_ref;
use glam::DVec3;

use super::faces::{Corner, Face, Faces};
use crate::backend::batch::{BLOCKED, Batch, Block, INVALID_ID, LANES, RayBlock, RayHitBlock};
use crate::backend::past::Without;
use crate::math::float::UNIT_ROUNDOFF;
use crate::math::lanes::lanes_of;
use crate::math::simd::isa::{Isa, Kernel};

/// "No face yet": the spare corner behind the last one is looked up instead.
const NOTHING: u32 = u32::MAX;

/// Cosine below which a hit is computed in f64.
const GRAZING: f32 = 1.0 / 64.0;

/// Roundings, over the coordinates of origin and face, up to which the side on which a ray passes an edge is not known:
/// two of the ray's moment, one of the edge, one of the sum. f64 decides then; without it 1.6 % of rays at the vertices
/// of a closed sphere found no face.
const EDGE: f32 = 4.0 * UNIT_ROUNDOFF;

/// A face that leans so far that its height, as the ray sees it, is below this many times the slack of [`EDGE`] is
/// decided in f64. A ray that is nearly parallel to an edge passes it by less than it is apart from it.
const SURE: f32 = 256.0;

/// How far beside a triangle, as a weight, a point in f64 still belongs to it: its own rounding, so that neighbours
/// overlap.
const EXACT: f64 = 1e-9;

type Column = [f32; LANES];

/// A block that is traced against faces.
pub(in crate::backend) trait Meets: Block {
    /// Traces the lanes of `valid`; the others hit nothing. Faces that a ray has passed do not count; the first lane
    /// has the number that comes with them.
    fn meet<I: Isa>(&mut self, faces: &Faces, valid: u16, without: (usize, impl Without));
}

impl Meets for RayHitBlock {
    #[inline(always)]
    fn meet<I: Isa>(&mut self, faces: &Faces, valid: u16, without: (usize, impl Without)) {
        closest::<I, _>(faces, self, valid, without);
    }
}

impl Meets for RayBlock {
    #[inline(always)]
    fn meet<I: Isa>(&mut self, faces: &Faces, valid: u16, _without: (usize, impl Without)) {
        any(faces, self, valid);
    }
}

/// Traces a batch; the number of invalid rays.
pub(super) struct Trace<'a, B, W> {
    pub faces: &'a Faces,
    pub batch: Batch<'a, B>,
    pub without: W,
}

impl<B: Meets, W: Without> Kernel for Trace<'_, B, W> {
    type Output = u64;

    #[inline(always)]
    fn run<I: Isa>(self) -> u64 {
        let Trace { faces, mut batch, without } = self;
        while let Some((index, block, valid)) = batch.next_block() {
            block.meet::<I>(faces, valid, (index * LANES, without));
        }
        batch.invalid()
    }
}

/// What the faces are tested with, of sixteen rays.
struct Rays<'a> {
    ray: &'a RayBlock,
    /// o × d.
    moment: [Column; 3],
    /// Error of the numbers that tell the side of an edge, metres.
    slack: Column,
}

impl<'a> Rays<'a> {
    #[inline(always)]
    fn new(faces: &Faces, ray: &'a RayBlock) -> Self {
        let mut r = [[0.0; LANES]; 3];
        let mut slack = [0.0; LANES];
        for i in 0..LANES {
            let (o, d) = ([ray.org_x[i], ray.org_y[i], ray.org_z[i]], [ray.dir_x[i], ray.dir_y[i], ray.dir_z[i]]);
            [r[0][i], r[1][i], r[2][i]] = cross(o, d);
            slack[i] = EDGE * (o[0].abs() + o[1].abs() + o[2].abs() + faces.reach);
        }
        Rays { ray, moment: r, slack }
    }
}

/// How a ray and a face's plane and edges lie.
struct Pass {
    /// It passes all edges on the same side.
    inside: bool,
    /// The roundings of its distances from the edges could make it so, or not.
    unsure: bool,
    /// Height of the plane over the origin, metres.
    height: f32,
    /// Cosine between direction and normal: the distance is `height / over`.
    over: f32,
}

#[inline(always)]
fn pass<const N: usize>(face: &Face<N>, rays: &Rays, i: usize) -> Pass {
    let ray = rays.ray;
    let (dx, dy, dz) = (ray.dir_x[i], ray.dir_y[i], ray.dir_z[i]);
    let (rx, ry, rz) = (rays.moment[0][i], rays.moment[1][i], rays.moment[2][i]);
    let (mut least, mut most) = (f32::INFINITY, f32::NEG_INFINITY);
    for [ex, ey, ez, mx, my, mz] in face.edges {
        let side = ex.mul_add(rx, ey.mul_add(ry, ez.mul_add(rz, mx.mul_add(dx, my.mul_add(dy, mz * dz)))));
        least = if side < least { side } else { least };
        most = if side > most { side } else { most };
    }
    let ([nx, ny, nz], [px, py, pz]) = (face.normal, face.corner);
    let over = nx.mul_add(dx, ny.mul_add(dy, nz * dz));
    let height = nx.mul_add(px - ray.org_x[i], ny.mul_add(py - ray.org_y[i], nz * (pz - ray.org_z[i])));
    let slack = rays.slack[i];
    let inside = (least >= 0.0) | (most <= 0.0);
    let could_be = (least >= -slack) | (most <= slack);
    let unsure = could_be & (!inside | (over.abs() * face.height <= SURE * slack));
    Pass { inside: inside & !unsure, unsure, height, over }
}

#[inline(always)]
fn closest<I: Isa, W: Without>(faces: &Faces, block: &mut RayHitBlock, valid: u16, (lane, without): (usize, W)) {
    let rays = Rays::new(faces, &block.ray);
    // `tfar` itself belongs to the segment. A ray that is not valid has no segment.
    let mut met = Met { t: [0.0; LANES], face: [NOTHING; LANES] };
    for i in 0..LANES {
        let end = block.ray.tfar[i].next_up();
        met.t[i] = if valid >> i & 1 != 0 { end } else { f32::NEG_INFINITY };
    }
    let (quads, triangles) = faces.exact.split_at(faces.quads.len());
    for (first, (some, exact)) in (0u32..).step_by(SOME).zip(faces.quads.chunks(SOME).zip(quads.chunks(SOME))) {
        let passed = passed(faces, first, valid, (lane, without));
        met.nearest::<_, W>((some, exact), &rays, first, &passed);
    }
    let first = faces.quads.len() as u32;
    let triangles = faces.triangles.chunks(SOME).zip(triangles.chunks(SOME));
    for (first, (some, exact)) in (first..).step_by(SOME).zip(triangles) {
        let passed = passed(faces, first, valid, (lane, without));
        met.nearest::<_, W>((some, exact), &rays, first, &passed);
    }
    resolve::<I>(faces, block, &met);
}

/// Faces whose doubtful lanes are one number of 32 bits.
const SOME: usize = 32;

/// Of the [`SOME`] faces from `first` on, those that each ray has passed, a bit each.
#[inline(always)]
fn passed<W: Without>(faces: &Faces, first: u32, valid: u16, (lane, without): (usize, W)) -> [u32; LANES] {
    let mut passed = [0; LANES];
    if W::SOME {
        for i in lanes_of(valid) {
            // Keys of instances are above every number of a triangle.
            let prims = without.of(lane + i).filter_map(|key| u32::try_from(key).ok());
            for face in prims.filter_map(|prim| faces.of_triangle(prim)) {
                passed[i] |= 1u32.checked_shl(face.wrapping_sub(first)).unwrap_or(0);
            }
        }
    }
    passed
}

/// The nearest face of each lane so far.
struct Met {
    /// Distance.
    t: Column,
    /// Face, or [`NOTHING`].
    face: [u32; LANES],
}

impl Met {
    /// Meets [`SOME`] faces at most, with their corners, the first of which has number `first`; those in `passed` do
    /// not count.
    #[inline(always)]
    fn nearest<const N: usize, W: Without>(
        &mut self,
        (faces, exact): (&[Face<N>], &[[DVec3; 4]]),
        rays: &Rays,
        first: u32,
        passed: &[u32; LANES],
    ) {
        let mut unsure = [0u32; LANES];
        let tnear = &rays.ray.tnear;
        for (k, face) in (0u32..).zip(faces) {
            for i in 0..LANES {
                let pass = pass(face, rays, i);
                let t = pass.height / pass.over;
                let counts = !W::SOME | (passed[i] >> k & 1 == 0);
                let closer = pass.inside & counts & (t >= tnear[i]) & (t < self.t[i]);
                self.t[i] = if closer { t } else { self.t[i] };
                self.face[i] = if closer { first + k } else { self.face[i] };
                unsure[i] |= if pass.unsure & counts { 1 << k } else { 0 };
            }
        }
        for i in marked(&unsure) {
            for k in (0..faces.len()).filter(|k| unsure[i] >> k & 1 != 0) {
                // As if it had been met in its turn: of equal distances that of the lower face counts.
                let (face, (best, found)) = (first + k as u32, (self.t[i], self.face[i]));
                let is_nearer = |t: f32| t < best || (t == best && found != NOTHING && face < found);
                if let Some(t) = meets::<N>(&exact[k], rays.ray, i).filter(|&t| t >= tnear[i] && is_nearer(t)) {
                    (self.t[i], self.face[i]) = (t, face);
                }
            }
        }
    }
}

#[inline(always)]
fn any(faces: &Faces, ray: &mut RayBlock, valid: u16) {
    let rays = Rays::new(faces, ray);
    let mut blocked = [0u32; LANES];
    let (quads, triangles) = faces.exact.split_at(faces.quads.len());
    for (some, exact) in faces.quads.chunks(SOME).zip(quads.chunks(SOME)) {
        blocks(some, exact, &rays, &mut blocked);
    }
    for (some, exact) in faces.triangles.chunks(SOME).zip(triangles.chunks(SOME)) {
        blocks(some, exact, &rays, &mut blocked);
    }
    for i in 0..LANES {
        let hit = (blocked[i] != 0) & (valid >> i & 1 != 0);
        ray.tfar[i] = if hit { BLOCKED } else { ray.tfar[i] };
    }
}

/// Marks the lanes whose segment one of the faces, [`SOME`] at most, blocks. Not divided: heights are compared with
/// those of the segment's ends.
#[inline(always)]
fn blocks<const N: usize>(faces: &[Face<N>], exact: &[[DVec3; 4]], rays: &Rays, blocked: &mut [u32; LANES]) {
    let mut unsure = [0u32; LANES];
    let (tnear, tfar) = (&rays.ray.tnear, &rays.ray.tfar);
    for (k, face) in faces.iter().enumerate() {
        for i in 0..LANES {
            let pass = pass(face, rays, i);
            let height = if pass.over < 0.0 { -pass.height } else { pass.height };
            let over = pass.over.abs();
            let within = (height >= tnear[i] * over) & (height <= tfar[i] * over);
            blocked[i] |= u32::from(pass.inside & within);
            unsure[i] |= if pass.unsure { 1 << k } else { 0 };
        }
    }
    for i in marked(&unsure) {
        for k in (0..faces.len()).filter(|k| unsure[i] >> k & 1 != 0) {
            let hit = meets::<N>(&exact[k], rays.ray, i).is_some_and(|t| t >= tnear[i] && t <= tfar[i]);
            blocked[i] |= u32::from(hit);
        }
    }
}

/// The lanes with a mark, ascending. Seldom any.
#[inline(always)]
fn marked(marks: &[u32; LANES]) -> impl Iterator<Item = usize> {
    lanes_of(marks.iter().enumerate().fold(0, |mask, (i, &mark)| mask | u16::from(mark != 0) << i))
}

/// Where a ray meets a face of `N` edges, in f64, by the triangles that it is made of.
#[cold]
#[inline(never)]
fn meets<const N: usize>(&[c, a, d, b]: &[DVec3; 4], ray: &RayBlock, i: usize) -> Option<f32> {
    let (org, dir) = (ray.org(i).as_dvec3(), ray.dir(i).as_dvec3());
    let on = |c: DVec3, a: DVec3, b: DVec3| {
        let (t, u, v) = moller_trumbore(org - c, dir, a - c, b - c)?;
        (u >= -EXACT && v >= -EXACT && u + v <= 1.0 + EXACT).then_some(t as f32)
    };
    on(c, a, b).or_else(|| if N == 4 { on(d, b, a) } else { None })
}

/// Distance and weights of the face that each lane found, relative to the ray's origin (Möller and Trumbore 1997).
#[inline(always)]
fn resolve<I: Isa>(faces: &Faces, block: &mut RayHitBlock, met: &Met) {
    let RayHitBlock { ray, hit } = block;
    let spare = faces.corners.len() - 1;
    let corner = |i: usize| &faces.corners[(met.face[i] as usize).min(spare)];
    let mut rows = [cast_ref(corner(0)); LANES];
    for (i, row) in rows.iter_mut().enumerate() {
        *row = cast_ref(corner(i));
    }
    let [cx, cy, cz, ax, ay, az, bx, by, bz, nx, ny, nz, prim_1, prim_2, first_1, first_2] = I::transpose(rows);
    let (mut t, mut alpha, mut beta, mut grazing) = (met.t, [0.0; LANES], [0.0; LANES], [0u32; LANES]);
    for i in 0..LANES {
        let d = [ray.dir_x[i], ray.dir_y[i], ray.dir_z[i]];
        let s = [ray.org_x[i] - cx[i], ray.org_y[i] - cy[i], ray.org_z[i] - cz[i]];
        let p = cross(d, [bx[i], by[i], bz[i]]);
        let ca = [ax[i], ay[i], az[i]];
        let q = cross(s, ca);
        let scale = 1.0 / dot(ca, p);
        alpha[i] = dot(s, p) * scale;
        beta[i] = dot(d, q) * scale;
        let oblique = (dot([nx[i], ny[i], nz[i]], d).abs() < GRAZING) & (met.face[i] != NOTHING);
        grazing[i] = u32::from(oblique);
    }
    for i in marked(&grazing) {
        // A ray in the plane has no hit: the corner, at the distance that was found.
        let (exact_t, a, b) = exact(corner(i), ray, i).unwrap_or((f64::from(t[i]), 0.0, 0.0));
        (t[i], alpha[i], beta[i]) = (exact_t as f32, a as f32, b as f32);
    }
    let quads = faces.quads.len() as u32;
    for i in 0..LANES {
        let is_hit = met.face[i] != NOTHING;
        // The point of the face that is nearest: roundings may put the hit beside it.
        let a = within(alpha[i], 1.0);
        let b = within(beta[i], if met.face[i] < quads { 1.0 } else { 1.0 - a });
        let second = a + b > 1.0;
        // Weights of the triangle's corners (c, a, b), or (a + b − c, b, a).
        let w_0 = if second { a + b - 1.0 } else { 1.0 - a - b };
        let w_1 = if second { 1.0 - a } else { a };
        let w_2 = if second { 1.0 - b } else { b };
        let prim = if second { prim_2[i].to_bits() } else { prim_1[i].to_bits() };
        let first = if second { first_2[i].to_bits() } else { first_1[i].to_bits() };
        let u = if first == 2 { w_0 } else { w_2 };
        let v = if first == 2 { w_1 } else { w_0 };
        hit.u[i] = if first == 0 { w_1 } else { u };
        hit.v[i] = if first == 0 { w_2 } else { v };
        hit.prim[i] = prim;
        hit.geom[i] = if is_hit { 0 } else { INVALID_ID };
        hit.inst[i] = INVALID_ID;
        let t = within(t[i], ray.tfar[i]);
        let t = if t < ray.tnear[i] { ray.tnear[i] } else { t };
        ray.tfar[i] = if is_hit { t } else { ray.tfar[i] };
    }
}

/// Between 0 and `most`; a zero has no sign.
#[inline(always)]
fn within(x: f32, most: f32) -> f32 {
    let x = if x > 0.0 { x } else { 0.0 };
    if x < most { x } else { most }
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

#[inline(always)]
fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1].mul_add(b[2], -(a[2] * b[1])), a[2].mul_add(b[0], -(a[0] * b[2])), a[0].mul_add(b[1], -(a[1] * b[0]))]
}

/// Distance and weights of a hit in f64; nothing for a ray in the plane itself.
#[cold]
#[inline(never)]
fn exact(corner: &Corner, ray: &RayBlock, i: usize) -> Option<(f64, f64, f64)> {
    let [c, ca, cb] = [corner.c, corner.ca, corner.cb].map(|v| DVec3::from(v.map(f64::from)));
    moller_trumbore(ray.org(i).as_dvec3() - c, ray.dir(i).as_dvec3(), ca, cb)
}

/// Distance, and weights of `a` and `b`, of a ray that starts at `s` from the corner between the edges `a` and `b`.
fn moller_trumbore(s: DVec3, d: DVec3, a: DVec3, b: DVec3) -> Option<(f64, f64, f64)> {
    let (p, q) = (d.cross(b), s.cross(a));
    let det = a.dot(p);
    (det != 0.0).then(|| (b.dot(q) / det, s.dot(p) / det, d.dot(q) / det))
}
