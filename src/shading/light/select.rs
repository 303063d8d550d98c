//! Which light to sample: by power, whatever the receiver. The receiver is passed in all the same, so that a choice
//! that looks at it (a hierarchy over the lights) can take this one's place without another word changing.

use glam::Vec3;

use crate::math::table::{AliasTable, TableError};

/// A chosen light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selected {
    /// Its number.
    pub light: u32,
    /// Probability with which it is chosen.
    pub p_select: f32,
    /// What is left of the random number, uniform in [0,1).
    pub u: f32,
}

/// Chooses lights in proportion to their power.
#[derive(Clone, Debug)]
pub struct Selector {
    /// `None` where no light has any power.
    table: Option<AliasTable>,
}

impl Selector {
    /// A selector over lights of the given powers, W.
    pub fn new(powers: &[f64]) -> Result<Self, TableError> {
        match AliasTable::new(powers) {
            Ok(table) => Ok(Selector { table: Some(table) }),
            Err(TableError::Empty) => Ok(Selector { table: None }),
            Err(error) => Err(error),
        }
    }

    /// Whether there is nothing to choose.
    pub fn is_dark(&self) -> bool {
        self.table.is_none()
    }

    /// The light that `u` in [0,1) chooses for a receiver at `p` with normal `n`.
    #[inline]
    pub fn select(&self, _p: Vec3, _n: Vec3, u: f32) -> Option<Selected> {
        let choice = self.table.as_ref()?.sample(u);
        Some(Selected { light: choice.index, p_select: choice.p, u: choice.u })
    }

    /// Probability with which [`select`](Self::select) chooses `light` for that receiver.
    #[inline]
    pub fn p_select(&self, light: u32, _p: Vec3, _n: Vec3) -> f32 {
        self.table.as_ref().map_or(0.0, |table| table.p(light))
    }
}
