//! A hierarchy over the lights at finite distances that chooses one by how much it can send to a receiver.
//!
//! A node holds eight children as columns, so one pass of vector instructions weighs them all. The weight of a child is
//! the largest irradiance (up to a common factor) that its lights could give together if nothing were in the way:
//! intensity / distance² × the largest cosine at the emitters × the largest cosine at the receiver, over the sphere
//! around its lights and the cone of their directions. It is 0 only where they can give nothing. A child is drawn in
//! proportion to its weight, then one of its children, down to a light; the probability of a light is the product on
//! its path. Eight children instead of two make the walk short and leave the loose bounds of large groups out of it.
//! Source: Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting" (the bounds;
//! no splitting of the receiver's sample here).
//! Limits: visibility is unknown to it; 2^24 lights.

use glam::Vec3;

/// Children of a node: one AVX register of f32.
pub const WIDTH: usize = 8;
/// Bits of a path that number the child of one node.
pub const SLOT_BITS: u32 = WIDTH.trailing_zeros();
/// Marks a child that is a light.
pub const LEAF: u32 = 1 << 31;

/// Least distance² that counts over the squared radius of a group.
pub const NEAR: f32 = 0.5;
/// m². A receiver on a point light has no direction to it.
pub const LEAST_DISTANCE2: f32 = 1e-24;
/// Keeps sums of weights finite; weights are near 1 at a distance of the size of the tree.
const LARGEST_WEIGHT: f32 = 1e30;

/// Eight children as columns. A slot without a child has intensity 0.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub struct Node {
    /// Centre of the sphere around the lights of each child.
    pub center: [[f32; WIDTH]; 3],
    /// Its radius, m.
    pub radius: [f32; WIDTH],
    /// Largest 1/distance² that counts, m⁻²: a receiver inside the sphere is not at its centre.
    pub falloff: [f32; WIDTH],
    /// Axis of the cone of their directions (normals of triangles, axes of spots).
    pub axis: [[f32; WIDTH]; 3],
    /// Cosine and sine of the cone's half angle.
    pub cos_spread: [f32; WIDTH],
    /// See `cos_spread`.
    pub sin_spread: [f32; WIDTH],
    /// Cosine of the largest angle to its direction under which a light emits: 0 for triangles, −1 for points.
    pub cos_reach: [f32; WIDTH],
    /// Summed intensity along the lights' directions, W/sr relative to the tree's unit.
    pub intensity: [f32; WIDTH],
    /// Number of a node, or [`LEAF`] and the number of a light.
    pub child: [u32; WIDTH],
}

impl Node {
    /// A node without children.
    pub const EMPTY: Node = Node {
        center: [[0.0; WIDTH]; 3],
        radius: [1.0; WIDTH],
        falloff: [1.0; WIDTH],
        axis: [[0.0; WIDTH], [0.0; WIDTH], [1.0; WIDTH]],
        cos_spread: [1.0; WIDTH],
        sin_spread: [0.0; WIDTH],
        cos_reach: [0.0; WIDTH],
        intensity: [0.0; WIDTH],
        child: [LEAF; WIDTH],
    };

    /// Weights of the children for a receiver at `p` with unit normal `n`, or with n = 0 where light is received from
    /// both sides: finite, ≥ 0. One loop without branches, over columns.
    #[inline(always)]
    fn weigh(&self, p: Vec3, n: Vec3) -> [f32; WIDTH] {
        let any_side = if n == Vec3::ZERO { 1.0 } else { 0.0f32 };
        let mut weights = [0.0; WIDTH];
        for i in 0..WIDTH {
            let v = [self.center[0][i] - p.x, self.center[1][i] - p.y, self.center[2][i] - p.z];
            let distance2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
            let inverse = 1.0 / distance2.max(LEAST_DISTANCE2);
            let inverse_distance = inverse.sqrt();

            // Half angle under which the sphere is seen.
            let sin_seen = (self.radius[i] * inverse_distance).min(1.0);
            let cos_seen = (1.0 - sin_seen * sin_seen).sqrt();
            let inside = distance2 <= self.radius[i] * self.radius[i];

            // At the emitters: the angle to the axis less the cone and the sphere's angle.
            let to_receiver =
                -(self.axis[0][i] * v[0] + self.axis[1][i] * v[1] + self.axis[2][i] * v[2]) * inverse_distance;
            let (cos_spread, sin_spread) = (self.cos_spread[i], self.sin_spread[i]);
            let cos_slack = cos_spread * cos_seen - sin_spread * sin_seen;
            let sin_slack = sin_spread * cos_seen + cos_spread * sin_seen;
            let emitted = cos_less(to_receiver, cos_slack, sin_slack);
            // A slack of more than π.
            let emitted = if inside | (sin_slack < 0.0) { 1.0 } else { emitted };
            let emitted = if emitted < self.cos_reach[i] { 0.0 } else { emitted.max(0.0) };

            // At the receiver: the angle to the normal less the sphere's angle.
            let from_normal = (n.x * v[0] + n.y * v[1] + n.z * v[2]) * inverse_distance;
            let received = cos_less(from_normal, cos_seen, sin_seen).max(any_side);
            let received = if inside { 1.0 } else { received };

            let near = (self.intensity[i] * inverse.min(self.falloff[i])).min(LARGEST_WEIGHT);
            weights[i] = near * emitted * received;
        }
        weights
    }
}

/// cos(max(0, a − b)) for angles in [0,π], at least 0.
#[inline(always)]
fn cos_less(cos_a: f32, cos_b: f32, sin_b: f32) -> f32 {
    let sin_a = (1.0 - cos_a * cos_a).max(0.0).sqrt();
    let difference = cos_a * cos_b + sin_a * sin_b;
    if cos_a >= cos_b { 1.0 } else { difference.max(0.0) }
}

/// Weights of a node's children with their sum. In f64, where lights of twelve decades can be told apart.
struct Shares {
    /// Sums up to and including each child.
    upto: [f64; WIDTH],
}

impl Shares {
    #[inline(always)]
    fn of(weights: &[f32; WIDTH]) -> Self {
        let mut upto = [0.0; WIDTH];
        let mut sum = 0.0;
        for i in 0..WIDTH {
            sum += f64::from(weights[i]);
            upto[i] = sum;
        }
        Shares { upto }
    }

    #[inline(always)]
    fn total(&self) -> f64 {
        self.upto[WIDTH - 1]
    }

    /// Probability of a child: what [`choose`](Self::choose) leaves to it.
    #[inline(always)]
    fn p(&self, slot: usize) -> f64 {
        (self.upto[slot] - self.before(slot)) / self.total()
    }

    #[inline(always)]
    fn before(&self, slot: usize) -> f64 {
        if slot == 0 { 0.0 } else { self.upto[slot - 1] }
    }

    /// The child that `u` in [0,1) falls to, and what is left of `u`.
    #[inline(always)]
    fn choose(&self, u: f64) -> (usize, f64) {
        let at = u * self.total();
        let mut slot = 0;
        for i in 0..WIDTH - 1 {
            slot += usize::from(self.upto[i] <= at);
        }
        let before = self.before(slot);
        let left = (at - before) / (self.upto[slot] - before);
        (slot, left.clamp(0.0, BELOW_ONE))
    }
}

/// The largest f64 below 1.
const BELOW_ONE: f64 = 1.0 - f64::EPSILON / 2.0;

/// A light of the tree, drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leaf {
    /// Its number.
    pub light: u32,
    /// Probability with which it is drawn from the tree.
    pub p: f64,
    /// What is left of the random number, in [0,1).
    pub u: f64,
}

/// The hierarchy.
#[derive(Clone, Debug)]
pub struct LightTree {
    /// The root is the first.
    pub(super) nodes: Vec<Node>,
    /// By number of light: the slots from the root on, the root's in the lowest bits; [`NO_PATH`] for lights without
    /// intensity or not in the tree.
    pub(super) paths: Vec<u64>,
    /// Irradiance (W/m²) of one unit of weight.
    pub(super) unit: f64,
}

/// "Not in the tree"; no path is that long.
pub const NO_PATH: u64 = u64::MAX;

/// The root's children as a receiver sees them: where every walk begins.
pub struct View {
    shares: Shares,
}

impl View {
    /// Bound of the irradiance at the receiver, in the unit of the tree; where it is 0 no light of the tree can reach it.
    #[inline(always)]
    pub fn weight(&self) -> f64 {
        self.shares.total()
    }
}

impl LightTree {
    /// The root as seen from `p` with normal `n` (0: from both sides).
    #[inline(always)]
    pub fn view(&self, p: Vec3, n: Vec3) -> View {
        View { shares: Shares::of(&self.nodes[0].weigh(p, n)) }
    }

    /// Shares of an inner node. Its parent's bound was positive; if no child's is, the intensities decide.
    #[inline(always)]
    fn shares(&self, node: u32, p: Vec3, n: Vec3) -> Shares {
        let node = &self.nodes[node as usize];
        let shares = Shares::of(&node.weigh(p, n));
        if shares.total() > 0.0 { shares } else { Shares::of(&node.intensity) }
    }

    /// Draws a light by `u` in [0,1), from a view of positive weight.
    #[inline]
    pub fn select(&self, view: &View, p: Vec3, n: Vec3, u: f64) -> Leaf {
        let (mut slot, mut u) = view.shares.choose(u);
        let mut probability = view.shares.p(slot);
        let mut child = self.nodes[0].child[slot];
        while child & LEAF == 0 {
            let shares = self.shares(child, p, n);
            (slot, u) = shares.choose(u);
            probability *= shares.p(slot);
            child = self.nodes[child as usize].child[slot];
        }
        Leaf { light: child & !LEAF, p: probability, u }
    }

    /// Whether a light is in the tree.
    #[inline(always)]
    pub fn holds(&self, light: u32) -> bool {
        self.paths.get(light as usize).is_some_and(|&path| path != NO_PATH)
    }

    /// Probability with which [`select`](Self::select) draws `light`, which the tree holds, from the same view: the same
    /// numbers in the same order, so the same bits.
    #[inline]
    pub fn p(&self, view: &View, p: Vec3, n: Vec3, light: u32) -> f64 {
        let mut path = self.paths[light as usize];
        let slot = |path: u64| (path & (WIDTH as u64 - 1)) as usize;
        let mut probability = view.shares.p(slot(path));
        let mut child = self.nodes[0].child[slot(path)];
        while child & LEAF == 0 {
            path >>= SLOT_BITS;
            probability *= self.shares(child, p, n).p(slot(path));
            child = self.nodes[child as usize].child[slot(path)];
        }
        probability
    }
}
