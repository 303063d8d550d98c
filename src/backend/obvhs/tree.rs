//! Binary hierarchy over boxes: clusters and reinsertion by the `obvhs` crate, with a depth bound that the crate lacks.
//!
//! Boxes that share their centre (concentric shapes, copies) make a bottom-up builder pair nothing but neighbours with
//! a chain, n − 7 levels deep and quadratic in time (HARDCASES G15). So boxes of equal centres enter as one and are
//! opened by median splits below; and a tree that still comes out deeper than [`MAX_DEPTH`] is rebuilt by median splits
//! alone. Deterministic: one thread, ties by index. Limit: nested boxes of *different* centres that chain cost build
//! time.

use glam::Vec3;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::builder::build_bvh2;

use crate::backend::bounds::Bounds;

/// Levels of the binary tree.
pub(super) const MAX_DEPTH: usize = 64;

/// Boxes with one centre that the builder sees one by one; more become one box. They add at most this many levels.
const MAX_TWINS: usize = 8;

/// What lies below a node.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) enum Below {
    /// Two nodes.
    Nodes(u32, u32),
    /// `order[first..first + count]`.
    Leaf { first: u32, count: u32 },
}

/// A node of the tree.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct TreeNode {
    pub bounds: Bounds,
    pub below: Below,
}

/// The hierarchy: the root is node 0, children follow their parents. Empty over no boxes.
#[derive(Debug, Default)]
pub(in crate::backend) struct Tree {
    pub nodes: Vec<TreeNode>,
    /// Indices of boxes in leaf order.
    pub order: Vec<u32>,
}

impl Tree {
    /// Builds over the boxes named by `items`, with at most `leaf_size` of them in a leaf.
    pub fn build(boxes: &[Bounds], mut items: Vec<u32>, leaf_size: usize) -> Self {
        if items.len() <= leaf_size {
            return Self::by_median(boxes, items, leaf_size);
        }

        // Boxes of one centre stand together; each group of many becomes one entry.
        let center = |&i: &u32| (boxes[i as usize].center() + Vec3::ZERO).to_array().map(f32::to_bits);
        items.sort_unstable_by_key(|i| (center(i), *i));
        let mut entries: Vec<std::ops::Range<usize>> = Vec::with_capacity(items.len());
        for group in items.chunk_by(|a, b| center(a) == center(b)) {
            let first = entries.last().map_or(0, |e| e.end);
            if group.len() > MAX_TWINS {
                entries.push(first..first + group.len());
            } else {
                entries.extend((first..first + group.len()).map(|i| i..i + 1));
            }
        }
        let entry_bounds = |range: &std::ops::Range<usize>| {
            items[range.clone()].iter().fold(Bounds::EMPTY, |b, &i| b.union(boxes[i as usize]))
        };
        let tree = match entries.len() {
            0 | 1 => None,
            _ => {
                let aabbs: Vec<Aabb> =
                    entries.iter().map(entry_bounds).map(|b| Aabb::new(b.lo.into(), b.hi.into())).collect();
                Self::by_clusters(boxes, &items, &entries, &aabbs, leaf_size)
            }
        };
        tree.unwrap_or_else(|| Self::by_median(boxes, items, leaf_size))
    }

    /// The crate's builder over `entries`, each a range of `items`. `None` when the result is too deep.
    fn by_clusters(
        boxes: &[Bounds],
        items: &[u32],
        entries: &[std::ops::Range<usize>],
        aabbs: &[Aabb],
        leaf_size: usize,
    ) -> Option<Self> {
        // Single boxes in its leaves: who collapses the tree makes larger ones of the least cost. So nothing is to be
        // reinserted after the crate's own collapsing, and more before.
        let params = BvhBuildParams {
            max_prims_per_leaf: 1,
            reinsertion_batch_ratio: 0.25,
            post_collapse_reinsertion_batch_ratio_multiplier: 0.0,
            ..BvhBuildParams::medium_build()
        };
        let bvh = build_bvh2(aabbs, params, &mut std::time::Duration::default());
        let mut tree = Tree { nodes: Vec::with_capacity(bvh.nodes.len()), order: Vec::with_capacity(items.len()) };
        tree.nodes.push(TreeNode { bounds: Bounds::EMPTY, below: Below::Leaf { first: 0, count: 0 } });
        let mut pending = vec![(0usize, 0usize, 1usize)];
        while let Some((source, target, depth)) = pending.pop() {
            if depth > MAX_DEPTH {
                return None;
            }
            let node = &bvh.nodes[source];
            if node.is_leaf() {
                let range = node.first_index as usize..(node.first_index + node.prim_count) as usize;
                let members = bvh.primitive_indices[range]
                    .iter()
                    .flat_map(|&entry| items[entries[entry as usize].clone()].iter().copied())
                    .collect();
                tree.split(boxes, target, members, leaf_size);
            } else {
                let left = tree.nodes.len();
                let bounds = Bounds { lo: node.aabb().min.into(), hi: node.aabb().max.into() };
                tree.nodes[target] = TreeNode { bounds, below: Below::Nodes(left as u32, left as u32 + 1) };
                tree.nodes.push(tree.nodes[target]);
                tree.nodes.push(tree.nodes[target]);
                let first = node.first_index as usize;
                pending.push((first + 1, left + 1, depth + 1));
                pending.push((first, left, depth + 1));
            }
        }
        (tree.depth() <= MAX_DEPTH).then_some(tree)
    }

    /// Median splits alone: ⌈log2(n)⌉ levels whatever the boxes are.
    pub fn by_median(boxes: &[Bounds], items: Vec<u32>, leaf_size: usize) -> Self {
        let mut tree = Tree::default();
        if !items.is_empty() {
            tree.nodes.push(TreeNode { bounds: Bounds::EMPTY, below: Below::Leaf { first: 0, count: 0 } });
            tree.split(boxes, 0, items, leaf_size);
        }
        tree
    }

    /// Puts a subtree over `items` at node `target`: halves by centre along the longest axis, by size where all centres
    /// coincide.
    fn split(&mut self, boxes: &[Bounds], target: usize, mut items: Vec<u32>, leaf_size: usize) {
        let mut pending = vec![(target, 0..items.len())];
        while let Some((target, range)) = pending.pop() {
            let members = &mut items[range.clone()];
            let bounds = members.iter().fold(Bounds::EMPTY, |b, &i| b.union(boxes[i as usize]));
            if members.len() <= leaf_size {
                members.sort_unstable();
                let below = Below::Leaf { first: self.order.len() as u32, count: members.len() as u32 };
                self.nodes[target] = TreeNode { bounds, below };
                self.order.extend_from_slice(members);
                continue;
            }
            let spread = members
                .iter()
                .map(|&i| boxes[i as usize].center())
                .fold(Bounds::EMPTY, |b, c| b.union(Bounds { lo: c, hi: c }));
            let extent = spread.hi - spread.lo;
            let axis = extent.max_position();
            let key = |i: &u32| {
                let b = boxes[*i as usize];
                if extent[axis] > 0.0 { b.center()[axis] } else { b.half_area() }
            };
            let middle = members.len() / 2;
            members.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));

            let left = self.nodes.len();
            self.nodes[target] = TreeNode { bounds, below: Below::Nodes(left as u32, left as u32 + 1) };
            self.nodes.push(self.nodes[target]);
            self.nodes.push(self.nodes[target]);
            pending.push((left + 1, range.start + middle..range.end));
            pending.push((left, range.start..range.start + middle));
        }
    }

    /// Levels from the root to the deepest leaf; 0 when empty.
    pub fn depth(&self) -> usize {
        // Children follow their parents, so one pass suffices.
        let mut level = vec![1usize; self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate() {
            if let Below::Nodes(left, right) = node.below {
                level[left as usize] = level[i] + 1;
                level[right as usize] = level[i] + 1;
            }
        }
        level.into_iter().max().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxes(n: usize, of: impl Fn(f32) -> Bounds) -> Vec<Bounds> {
        (0..n).map(|i| of(i as f32)).collect()
    }

    /// Every box in one leaf, every node's box around those below it, depth bounded.
    fn check(boxes: &[Bounds]) -> usize {
        check_leaves(boxes, 1);
        check_leaves(boxes, 4)
    }

    fn check_leaves(boxes: &[Bounds], leaf_size: usize) -> usize {
        let tree = Tree::build(boxes, (0..boxes.len() as u32).collect(), leaf_size);
        let mut seen = tree.order.clone();
        seen.sort_unstable();
        assert_eq!(seen, (0..boxes.len() as u32).collect::<Vec<_>>());
        let inside = |outer: Bounds, inner: Bounds| {
            assert!(inner.lo.cmpge(outer.lo).all() && inner.hi.cmple(outer.hi).all(), "{inner:?} not in {outer:?}");
        };
        for node in &tree.nodes {
            match node.below {
                Below::Nodes(left, right) => {
                    inside(node.bounds, tree.nodes[left as usize].bounds);
                    inside(node.bounds, tree.nodes[right as usize].bounds);
                }
                Below::Leaf { first, count } => {
                    assert!(count as usize <= leaf_size && count > 0);
                    for &i in &tree.order[first as usize..(first + count) as usize] {
                        inside(node.bounds, boxes[i as usize]);
                    }
                }
            }
        }
        assert!(tree.depth() <= MAX_DEPTH, "depth {}", tree.depth());
        tree.depth()
    }

    /// Oracle: invariants of a hierarchy. Degenerate inputs of HARDCASES G15 and ordinary ones.
    #[test]
    fn hierarchies_are_whole_and_shallow() {
        let unit = |c: Vec3, r: f32| Bounds { lo: c - r, hi: c + r };
        for n in [0, 1, 2, 3, 4, 5, 8, 9, 10, 100, 1000, 5000] {
            check(&boxes(n, |_| unit(Vec3::ONE, 0.5)));
            check(&boxes(n, |i| unit(Vec3::ZERO, 1.0 + i)));
            check(&boxes(n, |i| unit(Vec3::new(i * 7.0 % 31.0, i * 3.0 % 17.0, i), 0.75)));
            // Twins beside ordinary boxes.
            check(&boxes(n, |i| unit(Vec3::X * (i % 2.0) * i, 0.5)));
        }
        // At full size a chain would take minutes and 10⁵ levels.
        assert!(check(&boxes(100_000, |_| unit(Vec3::ONE, 0.5))) <= 17);
        // Nested boxes that share a corner: the chain that equal centres do not catch.
        check(&boxes(2000, |i| Bounds { lo: Vec3::ZERO, hi: Vec3::splat(1.0 + i) }));
    }
}
