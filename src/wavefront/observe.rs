//! Where a wave can be looked at between its stages. Replay looks; a render has no observer and pays one test of an
//! option per wave and stage, so both run the same machine code over the same random numbers.

use super::Context;
use super::state::Wave;

/// A moment at which the columns are complete.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The kernels have run: `current` holds rays with hits, `next` the survivors, `shadows` rays that are not traced yet;
    /// what emission and environment give to paths of this edge is in the sums.
    Shaded,
    /// The shadow rays are traced, and what was not blocked is in the sums, as paths of one edge more.
    Connected,
}

/// Somebody who looks.
pub trait Observer {
    /// The paths of `wave` have `edge` edges. Nothing of it can be changed.
    fn look(&self, stage: Stage, edge: u32, wave: &Wave);
}

/// Shows `wave` to the observer, if there is one.
#[inline(always)]
pub(super) fn look(context: &Context, stage: Stage, edge: u32, wave: &Wave) {
    if let Some(observer) = context.observer {
        observer.look(stage, edge, wave);
    }
}
