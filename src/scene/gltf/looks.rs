//! When motion is looked at, and how close straight lines have to come to it: of nodes (`moving`) and of the shapes of
//! meshes (`changing`).

use super::super::motion::MOST_PARTS;

/// Times at which what is animated is posed: the ends of all parts and the middles between them.
pub(super) const LOOKS: usize = 2 * MOST_PARTS + 1;

/// How far a corner may be from its way, in diagonals of the object.
pub(super) const CLOSE_ENOUGH: f64 = 1.0 / 1024.0;

/// What is taken for rounding, in the same measure.
pub(super) const ROUNDING: f64 = 1e-6;
