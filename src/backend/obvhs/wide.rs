//! Hierarchy with eight children a node, boxes in f32 as columns: one node is tested by a dozen vector instructions.
//! Folded from the binary tree by opening the child of the largest surface until eight are found.
//!
//! The box test (after Ize 2013, JCGT 2:2) may accept too much, never too little; boxes are grown besides, so that a
//! ray in the plane of a flat box is inside it. No `unsafe`: glam's vectors are the machine's.

use std::ops::ControlFlow;

use glam::{Vec3, Vec4};

use super::tree::{Below, Bounds, Tree};
use crate::backend::triangle::Ray;

/// Set in a child reference that names a leaf.
const LEAF: u32 = 1 << 31;

/// Reference to nothing: the root of an empty hierarchy.
const NOTHING: u32 = u32::MAX;

/// Entries of the traversal stack; a node leaves at most seven behind and adds eight.
const STACK: usize = 256;

/// Levels that the stack allows.
const MAX_WIDE_DEPTH: usize = (STACK - 8) / 7;

/// Exit distances are lengthened by 16 unit roundoffs (2⁻²⁴): the slab test rounds three times on each side and the
/// triangle test shifts a plane by up to five more.
pub(super) const SLACK: f32 = 1.0 + 1.0 / (1 << 20) as f32;

/// A zero (or nearly zero) direction component counts as 2⁻⁹⁶: a power of two, so that products stay exact, large
/// enough to be infinite for any scene and finite enough that 0 · 2⁹⁶ = 0.
const MAX_INVERSE: f32 = 2.0 * (1u128 << 95) as f32;

/// Eight boxes and what is in them. Unused children have an empty box.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// `[axis][lower or upper][half]`.
    planes: [[[Vec4; 2]; 2]; 3],
    children: [u32; 8],
}

/// The hierarchy. Leaves are numbered by the caller of [`Wide::fold`].
#[derive(Debug)]
pub(super) struct Wide {
    nodes: Vec<Node>,
    root: u32,
}

/// Distance (upper half) and child reference of what is still to visit. Distances are not negative, so their bits order
/// as they do.
pub(super) type Stack = [u64; STACK];

/// An empty stack.
pub(super) const EMPTY_STACK: Stack = [0; STACK];

/// What the box test needs of a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct BoxRay {
    org: [Vec4; 3],
    inverse: [Vec4; 3],
    negative: [bool; 3],
    tnear: Vec4,
}

impl BoxRay {
    /// Prepares `ray`.
    #[inline(always)]
    pub fn new(ray: &Ray) -> Self {
        let inverse =
            ray.dir.to_array().map(|d| if d.abs() * MAX_INVERSE >= 1.0 { 1.0 / d } else { MAX_INVERSE.copysign(d) });
        BoxRay {
            org: ray.org.to_array().map(Vec4::splat),
            inverse: inverse.map(Vec4::splat),
            negative: inverse.map(|i| i < 0.0),
            tnear: Vec4::splat(ray.tnear),
        }
    }
}

impl Node {
    const EMPTY: Node = Node { planes: [[[Vec4::INFINITY; 2], [Vec4::NEG_INFINITY; 2]]; 3], children: [NOTHING; 8] };

    fn set(&mut self, slot: usize, bounds: Bounds, child: u32) {
        for axis in 0..3 {
            self.planes[axis][0][slot / 4][slot % 4] = bounds.lo[axis];
            self.planes[axis][1][slot / 4][slot % 4] = bounds.hi[axis];
        }
        self.children[slot] = child;
    }

    /// Which boxes the ray may enter before `reach`, and where.
    #[inline(always)]
    fn test(&self, ray: &BoxRay, reach: f32) -> (u32, [f32; 8]) {
        let mut mask = 0;
        let mut entry = [0.0; 8];
        for half in 0..2 {
            let near = |axis: usize| {
                (self.planes[axis][usize::from(ray.negative[axis])][half] - ray.org[axis]) * ray.inverse[axis]
            };
            let far = |axis: usize| {
                (self.planes[axis][usize::from(!ray.negative[axis])][half] - ray.org[axis]) * ray.inverse[axis]
            };
            // `max` returns its argument at equal values: the result is never −0.0, for `tnear` is not.
            let enter = near(0).max(near(1).max(near(2).max(ray.tnear)));
            let leave = (far(0).min(far(1)).min(far(2)) * SLACK).min(Vec4::splat(reach));
            mask |= enter.cmple(leave).bitmask() << (4 * half);
            entry[4 * half..4 * half + 4].copy_from_slice(&enter.to_array());
        }
        (mask, entry)
    }
}

impl Wide {
    /// Folds a binary tree; `leaf` stores `order[first..first + count]` and returns its number. `None` when the result
    /// is deeper than the stack allows.
    pub fn fold(tree: &Tree, mut leaf: impl FnMut(&[u32]) -> u32) -> Option<Self> {
        let Some(root) = tree.nodes.first() else {
            return Some(Wide { nodes: Vec::new(), root: NOTHING });
        };
        let mut store = |first: u32, count: u32| LEAF | leaf(&tree.order[first as usize..(first + count) as usize]);
        if let Below::Leaf { first, count } = root.below {
            return Some(Wide { nodes: Vec::new(), root: store(first, count) });
        }

        let mut nodes = vec![Node::EMPTY];
        let mut pending = vec![(0u32, 0usize, 1usize)];
        while let Some((source, target, depth)) = pending.pop() {
            if depth > MAX_WIDE_DEPTH {
                return None;
            }
            // Open the largest inner child until there are eight.
            let mut children = vec![source];
            while children.len() < 8 {
                let area = |&child: &u32| tree.nodes[child as usize].bounds.half_area();
                let inner = (0..children.len())
                    .filter(|&i| matches!(tree.nodes[children[i] as usize].below, Below::Nodes(..)))
                    .max_by(|&a, &b| area(&children[a]).total_cmp(&area(&children[b])).then(b.cmp(&a)));
                let Some(open) = inner else { break };
                let Below::Nodes(left, right) = tree.nodes[children[open] as usize].below else { break };
                children[open] = left;
                children.insert(open + 1, right);
            }
            let first_new = pending.len();
            for (slot, &child) in children.iter().enumerate() {
                let node = &tree.nodes[child as usize];
                let reference = match node.below {
                    Below::Leaf { first, count } => store(first, count),
                    Below::Nodes(..) => {
                        pending.push((child, nodes.len(), depth + 1));
                        nodes.push(Node::EMPTY);
                        nodes.len() as u32 - 1
                    }
                };
                nodes[target].set(slot, node.bounds, reference);
            }
            // Depth first, in slot order.
            pending[first_new..].reverse();
        }
        Some(Wide { nodes, root: 0 })
    }

    /// Bytes of the nodes.
    pub fn bytes(&self) -> u64 {
        size_of_val(self.nodes.as_slice()) as u64
    }

    /// Visits the leaves that the ray enters before `reach`, nearest first. `leaf` gets the leaf's number, may shorten
    /// `reach` (already with its [`SLACK`]) and may stop the walk.
    #[inline(always)]
    pub fn walk(
        &self,
        ray: &BoxRay,
        reach: &mut f32,
        stack: &mut Stack,
        mut leaf: impl FnMut(u32, &mut f32) -> ControlFlow<()>,
    ) {
        if self.root == NOTHING {
            return;
        }
        let mut current = self.root;
        let mut top = 0usize;
        loop {
            if current & LEAF != 0 {
                if leaf(current & !LEAF, reach).is_break() {
                    return;
                }
            } else {
                let node = &self.nodes[current as usize];
                let (mut mask, entry) = node.test(ray, *reach);
                let base = top;
                while mask != 0 {
                    let child = mask.trailing_zeros() as usize & 7;
                    mask &= mask - 1;
                    let key = u64::from(entry[child].to_bits()) << 32 | u64::from(node.children[child]);
                    // Insertion keeps this node's entries sorted, the nearest on top.
                    let mut place = top;
                    while place > base && stack[(place - 1) % STACK] < key {
                        stack[place % STACK] = stack[(place - 1) % STACK];
                        place -= 1;
                    }
                    stack[place % STACK] = key;
                    top += 1;
                }
            }
            // What lies beyond a hit found meanwhile is dropped; at equal distance it may still win the tie.
            loop {
                if top == 0 {
                    return;
                }
                top -= 1;
                let key = stack[top % STACK];
                if (key >> 32) as u32 <= reach.to_bits() {
                    current = key as u32;
                    break;
                }
            }
        }
    }
}

/// Grows the box of a triangle: by 4·10⁻⁷ of the diagonal of everything (HARDCASES §5.3, measured: less leaves misses at
/// vertices), then by one ulp.
pub(super) fn grown(bounds: Bounds, diagonal: f64) -> Bounds {
    bounds.grown(Vec3::splat((4e-7 * diagonal) as f32))
}
