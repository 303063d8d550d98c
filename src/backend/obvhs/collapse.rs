//! Collapses the binary tree into nodes of eight children, of all ways the one with the least expected cost.
//!
//! By the surface area heuristic a node costs its surface and so does a block of up to four triangles, which one test
//! serves. For each subtree and each i ≤ 8 the least cost of i roots that cover it follows from those of its halves
//! (Ylitie, Karras, Laine 2017, HPG, §4.1). Against opening the child of the largest surface until there are eight,
//! nodes have 6.0 children instead of 4.2.

use super::node::Node;
use super::reference::Reference;
use super::stack::MAX_LEVELS;
use super::tree::{Below, Tree};
use crate::backend::bounds::Bounds;

/// Children of a node.
const WIDTH: usize = 8;

/// How subtrees are covered, by the number of roots (0 is unused).
#[derive(Clone, Copy)]
struct Cover {
    /// Least cost with at most that many roots.
    cost: [f32; WIDTH + 1],
    /// How many of them cover the left half, where the subtree is opened.
    left: [u8; WIDTH + 1],
    /// What the subtree costs as a single root: whether that is a leaf.
    leaf: bool,
    /// `order[first..first + count]`.
    first: u32,
    count: u32,
}

/// The nodes over `tree`, parents before children, and the root. `leaf` stores some of `tree.order`, at most
/// `leaf_size` (as many as the tree's), and returns its reference. `None` when the result is deeper than the stack
/// allows.
fn collapse(
    tree: &Tree,
    leaf_size: usize,
    mut leaf: impl FnMut(&[u32]) -> Reference,
) -> Option<(Vec<Node>, Reference)> {
    if tree.nodes.is_empty() {
        return Some((Vec::new(), Reference::NOTHING));
    }
    let covers = covers(tree, leaf_size);
    let mut store = |source: usize| {
        let Cover { first, count, .. } = covers[source];
        leaf(&tree.order[first as usize..(first + count) as usize])
    };
    if covers[0].leaf {
        return Some((Vec::new(), store(0)));
    }

    let mut nodes = vec![Node::new(&[])];
    let mut pending = vec![(0usize, 0usize, 1usize)];
    while let Some((source, target, level)) = pending.pop() {
        if level > MAX_LEVELS {
            return None;
        }
        let first_new = pending.len();
        let children: Vec<(Bounds, Reference)> = roots(tree, &covers, source)
            .into_iter()
            .map(|child| {
                let reference = if covers[child].leaf {
                    store(child)
                } else {
                    pending.push((child, nodes.len(), level + 1));
                    nodes.push(Node::new(&[]));
                    Reference::node(nodes.len() - 1)
                };
                (tree.nodes[child].bounds, reference)
            })
            .collect();
        nodes[target] = Node::new(&children);
        // Depth first, in order.
        pending[first_new..].reverse();
    }
    Some((nodes, Reference::node(0)))
}

/// The nodes over `boxes`, of which `leaf` stores some at a time, `leaf_size` at most; what it makes of them, and the
/// root. `leaves` makes an empty store: a hierarchy that comes out too deep is built again by median splits.
pub(super) fn build<S>(
    boxes: &[Bounds],
    leaf_size: usize,
    leaves: impl Fn() -> S,
    leaf: impl Fn(&mut S, &[u32]) -> Reference,
) -> (Vec<Node>, S, Reference) {
    let collapsed = |tree: Tree| {
        let mut store = leaves();
        let (nodes, root) = collapse(&tree, leaf_size, |members| leaf(&mut store, members))?;
        Some((nodes, store, root))
    };
    let items = || (0..boxes.len() as u32).collect();
    collapsed(Tree::build(boxes, items(), leaf_size))
        .or_else(|| collapsed(Tree::by_median(boxes, items(), leaf_size)))
        .expect("median splits of 2^31 boxes are 31 levels deep, fewer than the stack allows")
}

/// The covers of all subtrees; children follow their parents, so backwards.
fn covers(tree: &Tree, leaf_size: usize) -> Vec<Cover> {
    let none = Cover { cost: [f32::INFINITY; WIDTH + 1], left: [0; WIDTH + 1], leaf: true, first: 0, count: 0 };
    let mut covers = vec![none; tree.nodes.len()];
    for (i, node) in tree.nodes.iter().enumerate().rev() {
        // A surface of 0 or beyond f32 must not make every way equal.
        let area = node.bounds.half_area().clamp(f32::MIN_POSITIVE, f32::MAX / 1e6);
        covers[i] = match node.below {
            Below::Leaf { first, count } => Cover { cost: [area; WIDTH + 1], first, count, ..none },
            Below::Nodes(left, right) => {
                let (l, r) = (covers[left as usize], covers[right as usize]);
                let mut cover = Cover { first: l.first, count: l.count + r.count, ..none };
                let mut opened = [f32::INFINITY; WIDTH + 1];
                for roots in 2..=WIDTH {
                    for of_left in 1..roots {
                        let cost = l.cost[of_left] + r.cost[roots - of_left];
                        if cost < opened[roots] {
                            opened[roots] = cost;
                            cover.left[roots] = of_left as u8;
                        }
                    }
                }
                let as_leaf = if cover.count as usize <= leaf_size { area } else { f32::INFINITY };
                cover.leaf = as_leaf <= area + opened[WIDTH];
                cover.cost[1] = as_leaf.min(area + opened[WIDTH]);
                for roots in 2..=WIDTH {
                    cover.cost[roots] = opened[roots].min(cover.cost[roots - 1]);
                }
                cover
            }
        };
    }
    covers
}

/// The children of the node that represents the subtree `source`, left to right.
fn roots(tree: &Tree, covers: &[Cover], source: usize) -> Vec<usize> {
    let mut children = Vec::with_capacity(WIDTH);
    let mut open = vec![(source, WIDTH, true)];
    while let Some((subtree, most, opened)) = open.pop() {
        let cover = &covers[subtree];
        let mut count = most;
        // The fewest roots of the least cost; a node itself is opened in any case.
        while !opened && count > 1 && cover.cost[count] >= cover.cost[count - 1] {
            count -= 1;
        }
        match tree.nodes[subtree].below {
            Below::Nodes(left, right) if count > 1 => {
                let of_left = usize::from(cover.left[count]);
                open.push((right as usize, count - of_left, false));
                open.push((left as usize, of_left, false));
            }
            _ => children.push(subtree),
        }
    }
    children
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::backend::obvhs::leaf::LEAF_SIZE;
    use crate::backend::obvhs::reference::Stage;

    /// Oracle: every item below exactly one leaf, every node reached once, parents first; nodes well filled.
    #[test]
    fn every_item_is_in_one_leaf() {
        for n in [0usize, 1, 4, 5, 9, 100, 5000] {
            let boxes: Vec<Bounds> = (0..n)
                .map(|i| {
                    let p = Vec3::new((i * 7 % 31) as f32, (i * 13 % 17) as f32, i as f32 * 0.1);
                    Bounds { lo: p, hi: p + 0.75 }
                })
                .collect();
            let tree = Tree::build(&boxes, (0..n as u32).collect(), LEAF_SIZE);
            let mut leaves: Vec<Vec<u32>> = Vec::new();
            let (nodes, root) = collapse(&tree, LEAF_SIZE, |items| {
                leaves.push(items.to_vec());
                Reference::triangles(leaves.len() - 1)
            })
            .unwrap();
            let mut seen: Vec<u32> = leaves.concat();
            seen.sort_unstable();
            assert_eq!(seen, (0..n as u32).collect::<Vec<_>>());
            assert!(leaves.iter().all(|leaf| (1..=LEAF_SIZE).contains(&leaf.len())));

            let mut met = vec![0; nodes.len()];
            let mut children = 0;
            for (i, node) in nodes.iter().enumerate() {
                for child in node.children {
                    children += usize::from(child != Reference::NOTHING);
                    if child.stage() == Stage::Boxes {
                        assert!(child.index() > i);
                        met[child.index()] += 1;
                    }
                }
            }
            assert!(met.iter().skip(1).all(|&count| count == 1) && met.first().is_none_or(|&count| count == 0));
            match n {
                0 => assert_eq!(root, Reference::NOTHING),
                1..=4 => assert_eq!(root, Reference::triangles(0)),
                5000 => assert!(children as f32 >= 5.0 * nodes.len() as f32, "{children} in {}", nodes.len()),
                _ => assert_eq!(root, Reference::node(0)),
            }
        }
    }
}
