//! What of the world mesh other frames of an animation have elsewhere. Backends build it apart, and keep the hierarchy
//! of the rest from frame to frame.
//!
//! This follows from the scene alone, not from how many of its frames are rendered: the picture of a frame is the same
//! bit for bit in a sequence and on its own.

use std::ops::Range;

use super::owners::Part;
use crate::scene::Scene;

/// Triangles of the rest from which it is worth a hierarchy of its own. Embree builds that many in 50 ms, obvhs in 130.
const LEAST: usize = 1 << 16;

/// The part of the world mesh that an animation moves or bends at some time.
#[derive(Clone, Debug, Default)]
pub struct Frames {
    /// Whether there is something that is the same in other frames, and something that is not.
    differ: bool,
    /// Its triangles by number, ascending; none where the rest is not worth it.
    moved: Vec<Range<u32>>,
    /// Whether the rest is.
    apart: bool,
}

impl Frames {
    /// Of a scene whose world mesh has that many triangles, placed as `baked` says.
    pub(super) fn of(scene: &Scene, baked: &[Part], triangles: usize) -> Self {
        let animated = &scene.motion.animated;
        if animated.is_empty() {
            return Frames::default();
        }
        let ends = baked.iter().skip(1).map(|next| next.first).chain([triangles as u32]);
        let mut moved: Vec<Range<u32>> = Vec::new();
        for (part, end) in baked.iter().zip(ends) {
            if part.first == end || animated.binary_search(&(part.instance as usize)).is_err() {
                continue;
            }
            match moved.last_mut() {
                Some(last) if last.end == part.first => last.end = end,
                _ => moved.push(part.first..end),
            }
        }
        let count: usize = moved.iter().map(ExactSizeIterator::len).sum();
        let apart = triangles - count >= LEAST;
        Frames { differ: true, moved: if apart { moved } else { Vec::new() }, apart }
    }

    /// That these triangles are elsewhere in other frames, and all others worth it.
    #[cfg(test)]
    pub(crate) fn apart(moved: Range<u32>) -> Self {
        Frames { differ: true, moved: vec![moved], apart: true }
    }

    /// Whether other frames have some of the scene as it is here.
    pub fn differ(&self) -> bool {
        self.differ
    }

    /// Which triangles of a world mesh of so many other frames have elsewhere; `None` where the rest is not worth it.
    pub(super) fn moved(&self, triangles: usize) -> Option<Vec<bool>> {
        self.apart.then(|| {
            let mut is_moved = vec![false; triangles];
            self.moved.iter().for_each(|range| is_moved[range.start as usize..range.end as usize].fill(true));
            is_moved
        })
    }
}
