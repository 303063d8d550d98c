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

/// Least distance² that counts over the squared radius of a group: a receiver inside the sphere is not at its centre.
const NEAR: f32 = 0.5;
/// m². A receiver on a point light has no direction to it.
const LEAST_DISTANCE2: f32 = 1e-24;
/// Keeps sums of weights finite; weights are near 1 at a distance of the size of the tree.
const LARGEST_WEIGHT: f32 = 1e30;

/// Eight children as columns, six cache lines. A slot without a child has intensity 0.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub struct Node {
    /// Centre of the sphere around the lights of each child.
    pub center: [[f32; WIDTH]; 3],
    /// Its radius, m.
    pub radius: [f32; WIDTH],
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

/// What bounds one child.
#[derive(Clone, Copy)]
struct Bounds {
    center: Vec3,
    radius: f32,
    axis: Vec3,
    cos_spread: f32,
    sin_spread: f32,
    cos_reach: f32,
    intensity: f32,
}

/// N receivers as columns.
pub struct Receivers<const N: usize> {
    /// Positions.
    pub p: [[f32; N]; 3],
    /// Unit normals, or 0 where light is received from both sides.
    pub n: [[f32; N]; 3],
    /// Least cosine that counts: 1 where light is received from both sides, else 0.
    least_cos: [f32; N],
}

impl<const N: usize> Receivers<N> {
    /// Receivers at `p` with normals `n`.
    #[inline(always)]
    pub fn new(p: [[f32; N]; 3], n: [[f32; N]; 3]) -> Self {
        let mut least_cos = [0.0; N];
        for i in 0..N {
            let any_side = (n[0][i] == 0.0) & (n[1][i] == 0.0) & (n[2][i] == 0.0);
            least_cos[i] = if any_side { 1.0 } else { 0.0 };
        }
        Receivers { p, n, least_cos }
    }

    #[inline(always)]
    fn get(&self, i: usize) -> Receiver {
        let [p, n] = [&self.p, &self.n].map(|columns| Vec3::new(columns[0][i], columns[1][i], columns[2][i]));
        Receiver { p, n, least_cos: self.least_cos[i] }
    }
}

impl Receivers<1> {
    /// One receiver.
    #[inline(always)]
    pub fn one(p: Vec3, n: Vec3) -> Self {
        Receivers::new(p.to_array().map(|x| [x]), n.to_array().map(|x| [x]))
    }
}

/// One of [`Receivers`].
#[derive(Clone, Copy)]
struct Receiver {
    p: Vec3,
    n: Vec3,
    least_cos: f32,
}

impl Node {
    /// A node without children.
    pub const EMPTY: Node = Node {
        center: [[0.0; WIDTH]; 3],
        radius: [1.0; WIDTH],
        axis: [[0.0; WIDTH], [0.0; WIDTH], [1.0; WIDTH]],
        cos_spread: [1.0; WIDTH],
        sin_spread: [0.0; WIDTH],
        cos_reach: [0.0; WIDTH],
        intensity: [0.0; WIDTH],
        child: [LEAF; WIDTH],
    };

    #[inline(always)]
    fn bounds(&self, slot: usize) -> Bounds {
        let [center, axis] =
            [&self.center, &self.axis].map(|columns| Vec3::new(columns[0][slot], columns[1][slot], columns[2][slot]));
        Bounds {
            center,
            radius: self.radius[slot],
            axis,
            cos_spread: self.cos_spread[slot],
            sin_spread: self.sin_spread[slot],
            cos_reach: self.cos_reach[slot],
            intensity: self.intensity[slot],
        }
    }

    /// Weights of the children for receiver `i`: finite, ≥ 0. A vector of children.
    #[inline(always)]
    fn weigh<const N: usize>(&self, receivers: &Receivers<N>, i: usize) -> [f32; WIDTH] {
        let receiver = receivers.get(i);
        let mut weights = [0.0; WIDTH];
        for slot in 0..WIDTH {
            weights[slot] = weight(self.bounds(slot), receiver);
        }
        weights
    }

    /// The same for a node whose own bound was positive: if no child's is, the intensities decide.
    #[inline(always)]
    pub fn weigh_inner<const N: usize>(&self, receivers: &Receivers<N>, i: usize) -> [f32; WIDTH] {
        let weights = self.weigh(receivers, i);
        let mut lit = 0;
        for slot in 0..WIDTH {
            lit |= u32::from(weights[slot] > 0.0);
        }
        if lit != 0 { weights } else { self.intensity }
    }

    /// What `weigh` finds for N receivers that stand before the same node, by child: vectors of receivers.
    #[inline(always)]
    pub fn weigh_for<const N: usize>(&self, receivers: &Receivers<N>) -> [[f32; N]; WIDTH] {
        let mut weights = [[0.0; N]; WIDTH];
        for slot in 0..WIDTH {
            let bounds = self.bounds(slot);
            for i in 0..N {
                weights[slot][i] = weight(bounds, receivers.get(i));
            }
        }
        weights
    }
}

/// What a child could give a receiver. Written without branches, with two roots and a division.
#[inline(always)]
fn weight(child: Bounds, receiver: Receiver) -> f32 {
    let v = child.center - receiver.p;
    let distance2 = larger(v.dot(v), LEAST_DISTANCE2);
    let radius2 = child.radius * child.radius;
    let inside = distance2 <= radius2;
    let inverse2 = 1.0 / larger(distance2, NEAR * radius2);
    let inverse = distance2.sqrt() * inverse2;
    // Sine of the half angle under which the sphere is seen.
    let sin_seen = child.radius * inverse;

    // At the emitters: the angle to the axis less the cone's, then less the sphere's.
    let cos_axis = -child.axis.dot(v) * inverse;
    let sin_axis = larger(1.0 - cos_axis * cos_axis, 0.0).sqrt();
    let beyond = cos_axis * child.cos_spread + sin_axis * child.sin_spread;
    let emitted = if cos_axis >= child.cos_spread { 1.0 } else { cos_less(beyond, sin_seen) };
    let cos_least = if beyond >= 0.0 { child.cos_reach } else { 0.0 };
    let emitted = if emitted < cos_least { 0.0 } else { larger(emitted, 0.0) };

    // At the receiver: the angle to the normal less the sphere's.
    let received = larger(cos_less(receiver.n.dot(v) * inverse, sin_seen), receiver.least_cos);
    let seen = if inside { 1.0 } else { emitted * received };

    smaller(child.intensity * inverse2, LARGEST_WEIGHT) * seen
}

/// A bound of cos(a − b), at most 1, for a in [0,π] and b in [0,π/2], without a root: both roots of cos a √(1 −
/// sin²b) + sin b √(1 − cos²a) are taken as √(1 − x) ≤ 1 − x/2. For cos a < 0 it is no bound, but above 0
/// where cos(a − b) is.
#[inline(always)]
fn cos_less(cos_a: f32, sin_b: f32) -> f32 {
    smaller((cos_a + sin_b) * (1.0 - 0.5 * (cos_a * sin_b)), 1.0)
}

/// One instruction each, where `f32::max` and `f32::min` are three because of NaN; the second operand if one is NaN.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// See [`larger`].
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// 2^52: an f64 that counts from here has the count in its lowest bits.
const NONE_PASSED: f64 = (1u64 << 52) as f64;

/// Weights of a node's children with their sums, for N receivers at separate nodes. In f64, where lights of twelve
/// decades can be told apart.
pub struct Shares<const N: usize> {
    /// Sums up to and including each child.
    upto: [[f64; N]; WIDTH],
}

/// The children that N numbers fall to.
pub struct Drawn<const N: usize> {
    /// The child's place in its node.
    pub slot: [u64; N],
    /// Probability that it is drawn.
    pub p: [f64; N],
    /// The rest of the number, rescaled to [0,1).
    pub u: [f64; N],
}

impl<const N: usize> Shares<N> {
    /// Adds the weights up, in the order of the children.
    #[inline(always)]
    pub fn of(weights: &[[f32; N]; WIDTH]) -> Self {
        let mut upto = [[0.0; N]; WIDTH];
        let mut sum = [0.0; N];
        for slot in 0..WIDTH {
            for i in 0..N {
                sum[i] += f64::from(weights[slot][i]);
            }
            upto[slot] = sum;
        }
        Shares { upto }
    }

    /// Sums over all children.
    #[inline(always)]
    pub fn total(&self) -> &[f64; N] {
        &self.upto[WIDTH - 1]
    }

    /// The children that the numbers `u` in [0,1) fall to. Means nothing where the total is 0.
    #[inline(always)]
    pub fn choose(&self, u: &[f64; N]) -> Drawn<N> {
        let mut drawn = Drawn { slot: [0; N], p: [0.0; N], u: [0.0; N] };
        for i in 0..N {
            let total = self.total()[i];
            let at = u[i] * total;
            // The last sum that was passed and the first that was not: sums only grow. Counted in the columns' own
            // width.
            let (mut slot, mut before, mut after) = (NONE_PASSED, 0.0, total);
            for k in 0..WIDTH - 1 {
                let sum = self.upto[k][i];
                let passed = sum <= at;
                slot = if passed { slot + 1.0 } else { slot };
                before = if passed { sum } else { before };
                let ahead = if passed { f64::INFINITY } else { sum };
                after = if ahead < after { ahead } else { after };
            }
            let share = after - before;
            let left = (at - before) / share;
            drawn.slot[i] = slot.to_bits() % WIDTH as u64;
            drawn.p[i] = share / total;
            drawn.u[i] = if left < BELOW_ONE { left } else { BELOW_ONE };
        }
        drawn
    }
}

impl Shares<1> {
    /// Probability of a child: what [`choose`](Self::choose) leaves to it.
    #[inline(always)]
    fn p(&self, slot: usize) -> f64 {
        let before = if slot == 0 { 0.0 } else { self.upto[slot - 1][0] };
        (self.upto[slot][0] - before) / self.total()[0]
    }
}

/// The largest f64 below 1.
pub const BELOW_ONE: f64 = 1.0 - f64::EPSILON / 2.0;

/// A light of the tree, drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leaf {
    /// Its number.
    pub light: u32,
    /// Probability with which it is drawn from the tree.
    pub p: f64,
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
    receiver: Receivers<1>,
    shares: Shares<1>,
}

impl View {
    /// Bound of the irradiance at the receiver, in the unit of the tree; where it is 0 no light of the tree can reach
    /// it.
    #[inline(always)]
    pub fn weight(&self) -> f64 {
        self.shares.total()[0]
    }
}

impl LightTree {
    /// The root as seen from `p` with normal `n` (0: from both sides).
    #[inline(always)]
    pub fn view(&self, p: Vec3, n: Vec3) -> View {
        let receiver = Receivers::one(p, n);
        let shares = Shares::of(&self.root().weigh(&receiver, 0).map(|weight| [weight]));
        View { receiver, shares }
    }

    /// Where every walk begins.
    #[inline(always)]
    pub fn root(&self) -> &Node {
        &self.nodes[0]
    }

    /// A child that is no light.
    #[inline(always)]
    pub fn node(&self, number: u32) -> &Node {
        &self.nodes[number as usize]
    }

    #[inline(always)]
    fn shares(&self, node: u32, receiver: &Receivers<1>) -> Shares<1> {
        Shares::of(&self.node(node).weigh_inner(receiver, 0).map(|weight| [weight]))
    }

    /// Draws a light by `u` in [0,1), from a view of positive weight.
    #[inline]
    pub fn select(&self, view: &View, u: f64) -> Leaf {
        let mut drawn = view.shares.choose(&[u]);
        let mut p = drawn.p[0];
        let mut child = self.root().child[drawn.slot[0] as usize];
        while child & LEAF == 0 {
            drawn = self.shares(child, &view.receiver).choose(&drawn.u);
            p *= drawn.p[0];
            child = self.node(child).child[drawn.slot[0] as usize];
        }
        Leaf { light: child & !LEAF, p }
    }

    /// Whether a light is in the tree.
    #[inline(always)]
    pub fn holds(&self, light: u32) -> bool {
        self.paths.get(light as usize).is_some_and(|&path| path != NO_PATH)
    }

    /// Probability with which [`select`](Self::select) draws `light`, which the tree holds, from the same view: the
    /// same numbers in the same order, so the same bits.
    #[inline]
    pub fn p(&self, view: &View, light: u32) -> f64 {
        let mut path = self.paths[light as usize];
        let slot = |path: u64| (path & (WIDTH as u64 - 1)) as usize;
        let mut probability = view.shares.p(slot(path));
        let mut child = self.root().child[slot(path)];
        while child & LEAF == 0 {
            path >>= SLOT_BITS;
            probability *= self.shares(child, &view.receiver).p(slot(path));
            child = self.node(child).child[slot(path)];
        }
        probability
    }
}
