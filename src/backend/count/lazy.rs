//! A hierarchy that is built only where counted rays go: a node's children are made when a ray first enters it.
//!
//! As Embree's builder does, a node opens its child of the largest surface until it has eight; each opening is a binned
//! split by the surface area heuristic (Wald 2007, RT'07), here by a sample of the members. Leaves hold up to four
//! triangles, as in `backend::obvhs`. Members are runs of triangles that follow each other in the mesh; one comes apart
//! when a ray enters the last node around it. What a node's children are depends on its members alone, so neither on
//! the rays nor on their order.

use std::ops::Range;

use glam::Vec3;

use crate::backend::bounds::Bounds;

/// Children of a node.
const WIDTH: usize = 8;

/// Planes of a split are tried between so many bins of the longest axis.
const BINS: usize = 16;

/// Members that vote on a split.
const VOTERS: usize = 256;

/// Things with a box: triangles of a mesh that follow each other, or an instance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    pub bounds: Bounds,
    /// Number of the first.
    pub number: u32,
    /// How many there are.
    pub count: u32,
}

/// A node or leaf.
#[derive(Clone, Debug)]
struct Node {
    bounds: Bounds,
    items: Range<usize>,
    /// Things in them.
    count: usize,
    /// Its children once it has been entered.
    children: Option<Range<usize>>,
}

/// The hierarchy.
#[derive(Clone, Debug, Default)]
pub(super) struct Lazy {
    items: Vec<Item>,
    nodes: Vec<Node>,
    leaf_size: usize,
}

impl Lazy {
    /// A root over `items`; leaves hold up to `leaf_size` of them.
    pub fn new(items: Vec<Item>, leaf_size: usize) -> Self {
        let bounds = items.iter().fold(Bounds::EMPTY, |all, item| all.union(item.bounds));
        let count = items.iter().map(|item| item.count as usize).sum();
        let root = Node { bounds, items: 0..items.len(), count, children: None };
        let nodes = if items.is_empty() { Vec::new() } else { vec![root] };
        Lazy { items, nodes, leaf_size }
    }

    /// Whether there is nothing.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// What lies in a leaf; `None` of a node.
    pub fn leaf(&self, at: usize) -> Option<&[Item]> {
        let node = &self.nodes[at];
        (node.count <= self.leaf_size).then(|| &self.items[node.items.clone()])
    }

    /// The box of a node or leaf.
    pub fn bounds_of(&self, at: usize) -> Bounds {
        self.nodes[at].bounds
    }

    /// The children of a node, which has them made if it is entered for the first time. `single` gives one thing of a
    /// run, by its number.
    pub fn open(&mut self, at: usize, single: &dyn Fn(u32) -> Option<Item>) -> Range<usize> {
        if let Some(children) = &self.nodes[at].children {
            return children.clone();
        }
        let mut parts = vec![self.nodes[at].clone()];
        while parts.len() < WIDTH {
            let area = |part: &Node| if part.count > self.leaf_size { part.bounds.half_area() } else { -1.0 };
            let largest = (0..parts.len()).max_by(|&a, &b| area(&parts[a]).total_cmp(&area(&parts[b])));
            let Some(largest) = largest.filter(|&i| parts[i].count > self.leaf_size) else { break };
            if let [run] = self.items[parts[largest].items.clone()] {
                let first = self.items.len();
                self.items.extend((run.number..run.number + run.count).filter_map(single));
                parts[largest].items = first..self.items.len();
                parts[largest].count = self.items.len() - first;
                continue;
            }
            let (left, right) = self.split(&parts[largest]);
            parts[largest] = left;
            parts.push(right);
        }
        let children = self.nodes.len()..self.nodes.len() + parts.len();
        self.nodes.extend(parts);
        self.nodes[at].children = Some(children.clone());
        children
    }

    /// Two halves of more than one member.
    fn split(&mut self, part: &Node) -> (Node, Node) {
        let items = &mut self.items[part.items.clone()];
        let plane = plane(items);
        let (mut left, mut right) = (Bounds::EMPTY, Bounds::EMPTY);
        let (mut at, mut end) = (0, items.len());
        if let Some(plane) = plane {
            while at < end {
                if plane.is_left(&items[at]) {
                    left = left.union(items[at].bounds);
                    at += 1;
                } else {
                    right = right.union(items[at].bounds);
                    end -= 1;
                    items.swap(at, end);
                }
            }
        }
        if at == 0 || at == items.len() {
            // All centres in one place.
            at = items.len() / 2;
            let all = |items: &[Item]| items.iter().fold(Bounds::EMPTY, |all, item| all.union(item.bounds));
            (left, right) = (all(&items[..at]), all(&items[at..]));
        }
        let middle = part.items.start + at;
        let node = |bounds, items: Range<usize>| {
            let count = self.items[items.clone()].iter().map(|item| item.count as usize).sum();
            Node { bounds, items, count, children: None }
        };
        (node(left, part.items.start..middle), node(right, middle..part.items.end))
    }
}

/// Where members are divided.
struct Plane {
    axis: usize,
    bins: Bins,
    /// The first bin of the right half.
    first: usize,
}

impl Plane {
    #[inline]
    fn is_left(&self, item: &Item) -> bool {
        self.bins.of(item.bounds.center()[self.axis]) < self.first
    }
}

/// Equal intervals along an axis.
#[derive(Clone, Copy)]
struct Bins {
    low: f32,
    over: f32,
}

impl Bins {
    #[inline]
    fn of(self, x: f32) -> usize {
        // Casts saturate, and NaN becomes 0.
        (((x - self.low) * self.over) as usize).min(BINS - 1)
    }
}

/// The plane of the least cost, surface times things on either side; `None` where all centres lie in one place.
fn plane(items: &[Item]) -> Option<Plane> {
    let stride = (items.len() / VOTERS).max(1);
    let voters = || items.iter().step_by(stride);
    let (low, high) = voters().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), item| {
        let center = item.bounds.center();
        (low.min(center), high.max(center))
    });
    let size = high - low;
    let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).filter(|&axis| size[axis] > 0.0)?;
    let bins = Bins { low: low[axis], over: BINS as f32 / size[axis] };
    let mut filled = [(Bounds::EMPTY, 0u32); BINS];
    for item in voters() {
        let bin = &mut filled[bins.of(item.bounds.center()[axis])];
        *bin = (bin.0.union(item.bounds), bin.1 + item.count);
    }
    let cost = |(bounds, count): (Bounds, u32)| bounds.half_area() * count as f32;
    let joined = |a: (Bounds, u32), b: (Bounds, u32)| (a.0.union(b.0), a.1 + b.1);
    let mut right = filled;
    for i in (0..BINS - 1).rev() {
        right[i] = joined(filled[i], right[i + 1]);
    }
    let mut best: Option<(f32, usize)> = None;
    let mut left = (Bounds::EMPTY, 0);
    for first in 1..BINS {
        left = joined(left, filled[first - 1]);
        if left.1 == 0 || right[first].1 == 0 {
            continue;
        }
        let cost = cost(left) + cost(right[first]);
        if best.is_none_or(|(least, _)| cost < least) {
            best = Some((cost, first));
        }
    }
    best.map(|(_, first)| Plane { axis, bins, first })
}
