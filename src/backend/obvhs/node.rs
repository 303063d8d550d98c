//! A node of the hierarchy: eight boxes on a grid of 256 steps an axis, two cache lines.
//!
//! A ray meets the plane at step q of an axis at t = q·a + b, with a = step·inverse and b = (corner −
//! org)·inverse. Rounding moves a plane by at most 4u of the node's side (u = 2⁻²⁴, the rounding of a and of the
//! sum) and t by 5u of itself; boxes are widened by [`PAD`] of the side before they are put on the grid, and exits are
//! lengthened by [`SLACK`]. So a box may be entered too often, never too rarely (after Ize 2013, JCGT 2:2; the grid
//! after Ylitie, Karras, Laine 2017, HPG).
//!
//! The child in slot s lies towards the corner s of the node (bit a set: the upper side of axis a), as far as there is
//! choice: slots taken in the order s ⊕ octant come about nearest first for every ray of the octant, with no sorting.

use glam::Vec3;

use super::ray::Record;
use super::reference::Reference;
use super::stack::Stack;
use crate::backend::bounds::Bounds;
use crate::math::simd::isa::Isa;
use crate::math::simd::x8::{F32x8, U32x8};

/// Exit distances are lengthened by 16 unit roundoffs (2⁻²⁴): the slab test rounds four times on each side and the
/// triangle test shifts a plane by up to five more.
pub(super) const SLACK: f32 = 1.0 + 1.0 / (1 << 20) as f32;

/// By how much of the node's side a box is widened, on each side of it.
const PAD: f64 = 8.0 / (1 << 24) as f64;

/// Steps of the grid.
const STEPS: f64 = 255.0;

/// Eight children.
#[repr(C, align(128))]
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub children: [Reference; 8],
    /// Lower corner of the grid.
    corner: [f32; 3],
    /// Step of the grid.
    step: [f32; 3],
    /// `[axis][lower or upper][slot]`, in steps.
    planes: [[[u8; 8]; 2]; 3],
}

/// Slots of an octant, the farthest first.
static FARTHEST_FIRST: [[u32; 8]; 8] = {
    let mut order = [[0; 8]; 8];
    let mut octant = 0;
    while octant < 8 {
        let mut i = 0;
        while i < 8 {
            order[octant][i] = (7 - i as u32) ^ octant as u32;
            i += 1;
        }
        octant += 1;
    }
    order
};

impl Node {
    /// A node of up to eight boxes.
    pub fn new(children: &[(Bounds, Reference)]) -> Self {
        let all = children.iter().fold(Bounds::EMPTY, |b, (bounds, _)| b.union(*bounds));
        let slots = slots_of(children, all.center());
        let mut node = Node {
            children: [Reference::NOTHING; 8],
            corner: [0.0; 3],
            step: [0.0; 3],
            planes: [[[u8::MAX; 8], [0; 8]]; 3],
        };
        for axis in 0..3 {
            let (lo, hi) = (f64::from(all.lo[axis]), f64::from(all.hi[axis]));
            let pad = PAD * (hi - lo);
            let corner = ((lo - pad) as f32).next_down();
            // Down and up by a rounding: the last step is not short of the upper side.
            let step = (((hi + pad - f64::from(corner)) / STEPS) as f32).next_up();
            node.corner[axis] = corner;
            node.step[axis] = step;
            for ((bounds, child), &slot) in children.iter().zip(&slots) {
                let steps = |x: f64| (x - f64::from(corner)) / f64::from(step);
                let lower = steps(f64::from(bounds.lo[axis]) - pad).floor();
                let upper = steps(f64::from(bounds.hi[axis]) + pad).ceil();
                node.planes[axis][0][slot] = lower.clamp(0.0, STEPS) as u8;
                node.planes[axis][1][slot] = upper.clamp(0.0, STEPS) as u8;
                node.children[slot] = *child;
            }
        }
        node
    }

    /// Puts the children that the ray may enter before `reach` on its stack, the nearest on top.
    #[inline(always)]
    pub fn enter<I: Isa>(&self, ray: &Record, reach: f32, stack: &mut Stack) {
        let (mut near, mut far) = ([F32x8::splat(0.0); 3], [F32x8::splat(0.0); 3]);
        for axis in 0..3 {
            let a = F32x8::splat(self.step[axis] * ray.inverse[axis]);
            let b = F32x8::splat((self.corner[axis] - ray.org[axis]) * ray.inverse[axis]);
            let negative = ray.octant as usize >> axis & 1;
            near[axis] = F32x8::of_bytes(self.planes[axis][negative]).mul_add(a, b);
            far[axis] = F32x8::of_bytes(self.planes[axis][negative ^ 1]).mul_add(a, b);
        }
        let enter = near[0].max(near[1]).max(near[2].max(F32x8::splat(ray.tnear)));
        let order = U32x8::of(FARTHEST_FIRST[ray.octant as usize & 7]);
        let enter = enter.permuted(order);
        let leave = far[0].min(far[1]).min(far[2]).permuted(order);
        let keep = enter.le(leave.times(F32x8::splat(SLACK)).min(F32x8::splat(reach)));
        let children = U32x8::of(bytemuck::cast(self.children)).permuted(order);
        stack.push(I::squeeze8(enter.to_bits(), keep), I::squeeze8(children, keep), keep.count_ones());
    }
}

/// A slot for each child: greedily the pair of child and free corner that gains most, by the distance of the child's
/// centre from the middle towards the corner.
fn slots_of(children: &[(Bounds, Reference)], middle: Vec3) -> Vec<usize> {
    let corner = |slot: usize| {
        let side = |axis: usize| if slot >> axis & 1 == 1 { 1.0 } else { -1.0 };
        Vec3::new(side(0), side(1), side(2))
    };
    let mut gains: Vec<(f32, usize, usize)> = Vec::with_capacity(8 * children.len());
    for (child, (bounds, _)) in children.iter().enumerate() {
        let towards = bounds.center() - middle;
        gains.extend((0..8).map(|slot| (towards.dot(corner(slot)), child, slot)));
    }
    gains.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (mut slots, mut taken) = (vec![usize::MAX; children.len()], [false; 8]);
    for (_, child, slot) in gains {
        if slots[child] == usize::MAX && !taken[slot] {
            slots[child] = slot;
            taken[slot] = true;
        }
    }
    slots
}
