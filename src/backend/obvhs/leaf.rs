//! A leaf: up to four triangles, tested at once. The operations are those of `triangle::RayShear` in their order, so
//! the numbers are the same bits; here four lanes are a register, whatever the compiler finds.

use glam::{DVec3, Vec4};

use super::ray::Record;
use crate::backend::triangle::{self, Lanes, TriangleHit};

/// Triangles of a leaf.
pub(super) const LEAF_SIZE: usize = 4;

/// Up to four triangles; unused lanes hold NaN and are never hit.
#[repr(C, align(32))]
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    /// `[vertex][axis]`.
    vertices: [[Vec4; 3]; 3],
    prim: [u32; LEAF_SIZE],
}

/// Corners relative to a ray's origin, sheared along it; four triangles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sheared([[Vec4; 3]; 3]);

impl Sheared {
    pub const EMPTY: Sheared = Sheared([[Vec4::ZERO; 3]; 3]);
}

impl Block {
    /// A block of triangles with their numbers.
    pub fn new(triangles: impl IntoIterator<Item = (u32, [glam::Vec3; 3])>) -> Self {
        let mut block = Block { vertices: [[Vec4::NAN; 3]; 3], prim: [u32::MAX; LEAF_SIZE] };
        for (lane, (prim, corners)) in triangles.into_iter().enumerate() {
            block.prim[lane] = prim;
            for (vertex, corner) in corners.iter().enumerate() {
                for axis in 0..3 {
                    block.vertices[vertex][axis][lane] = corner[axis];
                }
            }
        }
        block
    }

    /// The triangles between two shapes of a mesh; corners as [`triangle::between`] has them.
    pub fn between(from: &Block, to: &Block, fraction: f32) -> Block {
        let mut block = *from;
        for (corner, to) in block.vertices.iter_mut().flatten().zip(to.vertices.iter().flatten()) {
            *corner += (*to - *corner) * fraction;
        }
        block
    }

    /// Number of the triangle in a lane.
    #[inline(always)]
    pub fn prim(&self, lane: usize) -> u32 {
        self.prim[lane % LEAF_SIZE]
    }

    /// Which triangles the line of the ray passes through (bit i: lane i), whatever the distance; their corners go to
    /// `sheared`.
    #[inline(always)]
    pub fn pierced(&self, ray: &Record, sheared: &mut Sheared) -> u32 {
        let [kx, ky, kz] = ray.axes();
        let [ox, oy, oz] = ray.sheared_org.map(Vec4::splat);
        let (sx, sy) = (Vec4::splat(ray.sx), Vec4::splat(ray.sy));
        for vertex in 0..3 {
            let corner = &self.vertices[vertex];
            let z = corner[kz] - oz;
            sheared.0[vertex] = [(corner[kx] - ox) - sx * z, (corner[ky] - oy) - sy * z, z];
        }
        let [a, b, c] = &sheared.0;
        let cross = |p: &[Vec4; 3], q: &[Vec4; 3]| p[0] * q[1] - p[1] * q[0];
        // Opposite to each vertex: twice the signed areas of its weight.
        let (mut ea, mut eb, mut ec) = (cross(c, b), cross(a, c), cross(b, a));
        if (ea.cmpeq(Vec4::ZERO) | eb.cmpeq(Vec4::ZERO) | ec.cmpeq(Vec4::ZERO)).bitmask() != 0 {
            (ea, eb, ec) = settled(sheared, ea, eb, ec);
        }
        let above = ea.cmpge(Vec4::ZERO) & eb.cmpge(Vec4::ZERO) & ec.cmpge(Vec4::ZERO);
        let below = ea.cmple(Vec4::ZERO) & eb.cmple(Vec4::ZERO) & ec.cmple(Vec4::ZERO);
        (above | below).bitmask()
    }
}

impl Sheared {
    /// Where the ray meets the triangle of `lane`, which it was found to pierce.
    #[inline(always)]
    pub fn hit(&self, lane: usize, dz: f32) -> TriangleHit {
        let corner = |vertex: usize| {
            let at = |axis: usize| f64::from(self.0[vertex][axis].to_array()[lane % LEAF_SIZE]);
            DVec3::new(at(0), at(1), at(2))
        };
        triangle::hit_of(corner(0), corner(1), corner(2), dz)
    }
}

/// The edge functions with their zeros decided.
#[cold]
#[inline(never)]
fn settled(sheared: &Sheared, ea: Vec4, eb: Vec4, ec: Vec4) -> (Vec4, Vec4, Vec4) {
    let corners: Lanes<LEAF_SIZE> = sheared.0.map(|corner| corner.map(|axis| axis.to_array()));
    let (mut fa, mut fb, mut fc) = (ea.to_array(), eb.to_array(), ec.to_array());
    triangle::settle_zeros(&corners[0], &corners[1], &corners[2], &mut fa, &mut fb, &mut fc);
    (fa.into(), fb.into(), fc.into())
}
