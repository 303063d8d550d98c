//! Which light to sample. One light is taken as it is; lights at infinity alone are drawn by their power, which is the
//! same for every receiver; several lights of which some are at a finite distance are drawn by what they can send to
//! the receiver: the tree and the lights at infinity in proportion to their irradiance, then one of them.

use glam::Vec3;

use super::grow::Emitter;
use super::tree::{BELOW_ONE, LightTree};
use crate::math::table::{AliasTable, TableError};

/// A chosen light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selected {
    /// Its number.
    pub light: u32,
    /// Probability with which it is chosen.
    pub p_select: f32,
}

/// A light at infinity.
#[derive(Clone, Copy, Debug)]
pub struct Distant {
    /// Number of the light.
    pub light: u32,
    /// What it adds to the irradiance of a receiver that faces it, W/m²; > 0.
    pub irradiance: f64,
}

/// How lights are chosen; the plan prints it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Selection {
    /// There is nothing to choose.
    Dark,
    /// There is one light.
    Single,
    /// The same probabilities everywhere.
    Power,
    /// By distance and orientation: position and normal of the receiver count.
    Receiver,
}

/// Chooses lights.
#[derive(Clone, Debug)]
pub struct Selector {
    choice: Choice,
}

#[derive(Clone, Debug)]
enum Choice {
    Dark,
    Single(u32),
    Distant(DistantTable),
    Receiver(ByReceiver),
}

/// Lights of which some are at a finite distance.
#[derive(Clone, Debug)]
pub struct ByReceiver {
    /// Those at a finite distance.
    pub tree: LightTree,
    /// The others.
    distant: Option<DistantTable>,
    /// Irradiance of all lights at infinity, in the unit of the tree; 0 without them.
    pub distant_weight: f64,
}

/// Lights at infinity, drawn in proportion to their irradiance.
#[derive(Clone, Debug)]
struct DistantTable {
    /// Numbers of the lights, ascending.
    lights: Vec<u32>,
    table: AliasTable,
}

impl DistantTable {
    fn new(distant: &[Distant]) -> Result<Option<Self>, TableError> {
        if distant.is_empty() {
            return Ok(None);
        }
        let weights: Vec<f64> = distant.iter().map(|light| light.irradiance).collect();
        let lights = distant.iter().map(|light| light.light).collect();
        Ok(Some(DistantTable { lights, table: AliasTable::new(&weights)? }))
    }

    #[inline]
    fn select(&self, u: f64) -> Selected {
        // Down to the lattice that the table is exact on.
        let choice = self.table.sample(lattice(u));
        Selected { light: self.lights[choice.index as usize], p_select: choice.p }
    }

    #[inline]
    fn p(&self, light: u32) -> f32 {
        self.lights.binary_search(&light).map_or(0.0, |index| self.table.p(index as u32))
    }
}

/// The multiple of 2^-24 at or below `u` in [0,1).
#[inline(always)]
fn lattice(u: f64) -> f32 {
    const STEPS: f64 = (1 << 24) as f64;
    ((u * STEPS) as u32).min((1 << 24) - 1) as f32 / STEPS as f32
}

impl Selector {
    /// A selector over `lights` lights: those at a finite distance, and those at infinity by ascending number. Others
    /// are never chosen.
    ///
    /// # Errors
    /// More lights at infinity than the table holds, or an irradiance that overflows.
    pub fn new(near: Vec<Emitter>, distant: &[Distant], lights: usize) -> Result<Self, TableError> {
        let choice = match (near.as_slice(), distant) {
            ([], []) => Choice::Dark,
            ([], [one]) => Choice::Single(one.light),
            ([one], []) => Choice::Single(one.light),
            ([], _) => DistantTable::new(distant)?.map_or(Choice::Dark, Choice::Distant),
            _ => {
                let tree = LightTree::grow(near, lights);
                let distant_weight = distant.iter().map(|light| light.irradiance).sum::<f64>() / tree.unit;
                Choice::Receiver(ByReceiver { tree, distant: DistantTable::new(distant)?, distant_weight })
            }
        };
        Ok(Selector { choice })
    }

    /// How lights are chosen.
    pub fn selection(&self) -> Selection {
        match self.choice {
            Choice::Dark => Selection::Dark,
            Choice::Single(_) => Selection::Single,
            Choice::Distant(_) => Selection::Power,
            Choice::Receiver(_) => Selection::Receiver,
        }
    }

    /// The light that `u` in [0,1) chooses for a receiver at `p` with unit normal `n`, or n = 0 where light from both
    /// sides counts. `None` where no light can reach the receiver. `u` may have more bits than an f32: the rarest of
    /// many lights need them.
    #[inline]
    pub fn select(&self, p: Vec3, n: Vec3, u: f64) -> Option<Selected> {
        match &self.choice {
            Choice::Dark => None,
            &Choice::Single(light) => Some(Selected { light, p_select: 1.0 }),
            Choice::Distant(table) => Some(table.select(u)),
            Choice::Receiver(choice) => choice.select(p, n, u),
        }
    }

    /// Probability with which [`select`](Self::select) chooses `light` for that receiver, to the last bit; 0 for a
    /// light that is never chosen.
    #[inline]
    pub fn p_select(&self, light: u32, p: Vec3, n: Vec3) -> f32 {
        match &self.choice {
            Choice::Dark => 0.0,
            Choice::Single(only) => f32::from(u8::from(*only == light)),
            Choice::Distant(table) => table.p(light),
            Choice::Receiver(choice) => choice.p_select(light, p, n),
        }
    }

    /// The choice that depends on the receiver.
    #[inline(always)]
    pub fn by_receiver(&self) -> Option<&ByReceiver> {
        match &self.choice {
            Choice::Receiver(choice) => Some(choice),
            _ => None,
        }
    }
}

impl ByReceiver {
    #[inline]
    fn select(&self, p: Vec3, n: Vec3, u: f64) -> Option<Selected> {
        let view = self.tree.view(p, n);
        let total = view.weight() + self.distant_weight;
        if !(total > 0.0) {
            return None;
        }
        let at = u * total;
        if at < self.distant_weight {
            return Some(self.select_distant(at, total));
        }
        let leaf = self.tree.select(&view, within((at - self.distant_weight) / view.weight()));
        Some(Selected { light: leaf.light, p_select: (view.weight() / total * leaf.p) as f32 })
    }

    /// The light at infinity for the number `at` below their weight, out of the weight of all.
    #[inline]
    pub fn select_distant(&self, at: f64, total: f64) -> Selected {
        // Without such lights no number is below their weight.
        let Some(table) = &self.distant else { return Selected { light: u32::MAX, p_select: 0.0 } };
        let selected = table.select(at / self.distant_weight);
        Selected { p_select: (self.distant_weight / total * f64::from(selected.p_select)) as f32, ..selected }
    }

    #[inline]
    fn p_select(&self, light: u32, p: Vec3, n: Vec3) -> f32 {
        let view = self.tree.view(p, n);
        let total = view.weight() + self.distant_weight;
        if !(total > 0.0) {
            0.0
        } else if !self.tree.holds(light) {
            let within = self.distant.as_ref().map_or(0.0, |table| table.p(light));
            (self.distant_weight / total * f64::from(within)) as f32
        } else if view.weight() > 0.0 {
            (view.weight() / total * self.tree.p(&view, light)) as f32
        } else {
            0.0
        }
    }
}

/// A number that rounding may have brought to 1, below it.
#[inline(always)]
pub fn within(u: f64) -> f64 {
    if u < BELOW_ONE { u } else { BELOW_ONE }
}
