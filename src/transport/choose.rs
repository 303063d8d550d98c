//! The choice of a light for sixteen receivers: sixteen walks through the light tree side by side, a level at a time.
//! What stands before one node (the root) or draws a number goes in columns; separate nodes are weighed lane by lane,
//! eight children in a register, without a branch between the lanes: the waits of sixteen nodes overlap.
//!
//! The numbers are those of [`Selector::select`](crate::shading::light::select::Selector::select), to the bit.

use crate::backend::batch::LANES;
use crate::math::columns::{Lane, Mask, ZERO, bits};
use crate::math::lanes::lanes_of;
use crate::math::simd::isa::Isa;
use crate::shading::light::select::{ByReceiver, Selected, within};
use crate::shading::light::tree::{LEAF, LightTree, Receivers, Shares, WIDTH};

/// Lights chosen for sixteen receivers.
#[repr(C, align(64))]
pub struct Chosen {
    /// Their numbers.
    pub light: [u32; LANES],
    /// Probabilities with which they are chosen; 0 where there is none.
    pub p_select: Lane,
}

impl Chosen {
    /// The light of a lane.
    #[inline(always)]
    pub fn get(&self, i: usize) -> Selected {
        Selected { light: self.light[i], p_select: self.p_select[i] }
    }
}

/// Chooses by the numbers `u` in [0,1) for the lanes of `active`.
#[inline(always)]
pub fn choose<I: Isa>(
    by_receiver: &ByReceiver,
    active: &Mask,
    receivers: &Receivers<LANES>,
    u: &[f64; LANES],
) -> Chosen {
    let tree = &by_receiver.tree;
    let shares = Shares::of(&tree.root().weigh_for(receivers));
    let (mut at, mut total, mut within_tree) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    for i in 0..LANES {
        total[i] = shares.total()[i] + by_receiver.distant_weight;
        at[i] = u[i] * total[i];
        within_tree[i] = within((at[i] - by_receiver.distant_weight) / shares.total()[i]);
    }
    let mut chosen = Chosen { light: [0; LANES], p_select: ZERO };
    let mut walking = 0u16;
    for i in lanes_of(bits(active)) {
        let distant = at[i] < by_receiver.distant_weight;
        walking |= u16::from((total[i] > 0.0) & !distant) << i;
        if distant {
            let selected = by_receiver.select_distant(at[i], total[i]);
            chosen.light[i] = selected.light;
            chosen.p_select[i] = selected.p_select;
        }
    }
    if walking != 0 {
        let walk = Walk { child: [0; LANES], u: within_tree, p: [1.0; LANES] };
        let walk = walk.descend::<I>(tree, walking, receivers, &shares);
        for i in lanes_of(walking) {
            chosen.light[i] = walk.child[i] & !LEAF;
            chosen.p_select[i] = (shares.total()[i] / total[i] * walk.p[i]) as f32;
        }
    }
    chosen
}

/// Where sixteen walks are.
struct Walk {
    /// The nodes they stand before, or [`LEAF`] and a light.
    child: [u32; LANES],
    /// The rest of their numbers, rescaled to [0,1).
    u: [f64; LANES],
    /// Probabilities of their ways.
    p: [f64; LANES],
}

impl Walk {
    /// Walks the lanes of `walking` from the root, whose shares are given, down to lights.
    #[inline(always)]
    fn descend<I: Isa>(
        mut self,
        tree: &LightTree,
        mut walking: u16,
        receivers: &Receivers<LANES>,
        root: &Shares<LANES>,
    ) -> Self {
        let drawn = root.choose(&self.u);
        self.u = drawn.u;
        self.p = drawn.p;
        for i in lanes_of(walking) {
            self.child[i] = tree.root().child[drawn.slot[i] as usize % WIDTH];
            walking &= !(leaf(self.child[i]) << i);
        }
        let mut rows = [[0.0; LANES]; LANES];
        while walking != 0 {
            for i in lanes_of(walking) {
                rows[i][..WIDTH].copy_from_slice(&tree.node(self.child[i]).weigh_inner(receivers, i));
            }
            // Lanes at rest keep their rows; their results are ignored.
            let drawn = Shares::of(&columns::<I>(&rows)).choose(&self.u);
            self.u = drawn.u;
            for i in lanes_of(walking) {
                self.p[i] *= drawn.p[i];
                self.child[i] = tree.node(self.child[i]).child[drawn.slot[i] as usize % WIDTH];
                walking &= !(leaf(self.child[i]) << i);
            }
        }
        self
    }
}

/// 1 for a light, 0 for a node.
#[inline(always)]
fn leaf(child: u32) -> u16 {
    (child / LEAF) as u16
}

/// The first [`WIDTH`] numbers of the rows, as columns.
#[inline(always)]
fn columns<I: Isa>(rows: &[[f32; LANES]; LANES]) -> [Lane; WIDTH] {
    let columns = I::transpose(rows.each_ref());
    std::array::from_fn(|k| columns[k])
}
