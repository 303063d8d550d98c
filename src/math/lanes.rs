//! Sets of lanes as bit masks: bit i is lane i.

/// Lanes that are computed together.
pub const LANES: usize = 16;

/// The lanes of a set, ascending.
#[inline(always)]
pub fn lanes_of(mut mask: u16) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        (mask != 0).then(|| {
            let lane = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            // So that no index of sixteen has to be checked.
            lane % LANES
        })
    })
}
