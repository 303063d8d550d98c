//! Discrete distributions, drawn from one number in [0,1): [`AliasTable`] in constant time, [`Distribution2D`] by
//! inverting rows and columns (which keeps neighbouring numbers in neighbouring cells, as low-discrepancy points want).
//! Both stand on the lattice of this page.
//!
//! Weights are summed in f64 and then apportioned to the 2^24 steps of a lattice: the values that a uniform `f32` in
//! [0,1) distinguishes. Every positive weight gets at least one step, a zero weight none, and the steps add up to 2^24.
//! So the probability that is reported is the probability with which the cell is drawn, exactly, for any number of
//! cells and any spread of weights; rounding costs a little variance instead of a bias.
//! Limit: 2^24 cells an axis.

mod alias;
mod grid;
mod guide;
mod lattice;

pub use alias::{AliasTable, Choice};
pub use grid::{Cell, Cells, Distribution2D, SquarePoint};
pub use lattice::TableError;
