//! What rays have passed: triangles that do not count when they go on.
//!
//! A ray that passes a surface keeps its origin and direction and is traced again from a little before the hit
//! (`tnear`); what it has passed is left out by number, not by distance. So nothing is met twice and nothing behind is
//! skipped, however many surfaces lie at the same distance and whatever rounding does to their order.

use super::batch::Hit;

/// A triangle of the world mesh or of an instance: instance + 1 (0: the world) above the number in its mesh.
pub(crate) type Key = u64;

/// The triangle that was hit.
#[inline(always)]
fn key(hit: &Hit) -> Key {
    key_of(hit.inst.wrapping_add(1), hit.prim)
}

/// The triangle `prim` of an instance, by its number + 1.
#[inline(always)]
pub(crate) fn key_of(instance: u32, prim: u32) -> Key {
    u64::from(instance) << 32 | u64::from(prim)
}

/// The end of a list of passed triangles.
const NOTHING: u32 = u32::MAX;

/// A passed triangle, and the one before.
#[derive(Clone, Copy, Debug)]
struct Link {
    key: Key,
    before: u32,
}

/// What a ray has passed, in a [`Past`].
#[derive(Clone, Copy, Debug)]
pub struct Passed(u32);

impl Passed {
    /// A ray that has passed nothing.
    pub const NOTHING: Passed = Passed(NOTHING);
}

/// What the rays of a batch have passed. Memory is kept from batch to batch.
#[derive(Clone, Debug, Default)]
pub struct Past {
    links: Vec<Link>,
    /// By lane.
    last: Vec<u32>,
}

impl Past {
    /// Forgets everything.
    pub fn clear(&mut self) {
        self.links.clear();
        self.last.clear();
    }

    /// `before`, and the triangle that was hit.
    #[inline]
    pub fn add(&mut self, before: Passed, hit: &Hit) -> Passed {
        self.links.push(Link { key: key(hit), before: before.0 });
        Passed(self.links.len() as u32 - 1)
    }

    /// Whether a triangle that was hit is among `passed`.
    #[inline]
    pub fn holds(&self, passed: Passed, hit: &Hit) -> bool {
        let (key, mut at) = (key(hit), passed.0);
        while let Some(link) = self.links.get(at as usize) {
            if link.key == key {
                return true;
            }
            at = link.before;
        }
        false
    }

    /// Sets what the ray of a lane has passed, at most one behind the last lane.
    #[inline]
    pub fn set(&mut self, lane: usize, passed: Passed) {
        if lane == self.last.len() {
            self.last.push(passed.0);
        } else {
            self.last[lane] = passed.0;
        }
    }

    /// For backends.
    #[inline]
    pub fn lanes(&self) -> PastLanes<'_> {
        PastLanes { links: &self.links, last: &self.last }
    }
}

/// A [`Past`] as backends read it: lanes may stand in another order.
#[derive(Clone, Copy, Debug)]
pub struct PastLanes<'p> {
    links: &'p [Link],
    last: &'p [u32],
}

/// Triangles that do not count, lane by lane. `()`: all count, and the question costs nothing.
pub(crate) trait Without: Copy {
    /// Whether there are any.
    const SOME: bool;

    /// The same for lanes in another order.
    type Reordered<'q>: Without
    where
        Self: 'q;

    /// The lanes `from` in their order; `memory` is room for it.
    fn reordered<'q>(self, from: impl Iterator<Item = usize>, memory: &'q mut Vec<u32>) -> Self::Reordered<'q>
    where
        Self: 'q;

    /// What does not count for the ray of a lane.
    fn of(self, lane: usize) -> impl Iterator<Item = Key>;

    /// Whether a triangle does not count for the ray of a lane.
    #[inline(always)]
    fn is_passed(self, lane: usize, key: Key) -> bool {
        Self::SOME && self.of(lane).any(|passed| passed == key)
    }
}

impl Without for () {
    const SOME: bool = false;
    type Reordered<'q> = ();

    #[inline(always)]
    fn reordered<'q>(self, _from: impl Iterator<Item = usize>, _memory: &'q mut Vec<u32>)
    where
        Self: 'q,
    {
    }

    #[inline(always)]
    fn of(self, _lane: usize) -> impl Iterator<Item = Key> {
        std::iter::empty()
    }
}

impl<'p> Without for PastLanes<'p> {
    const SOME: bool = true;
    type Reordered<'q>
        = PastLanes<'q>
    where
        Self: 'q;

    #[inline]
    fn reordered<'q>(self, from: impl Iterator<Item = usize>, memory: &'q mut Vec<u32>) -> PastLanes<'q>
    where
        Self: 'q,
    {
        memory.clear();
        memory.extend(from.map(|lane| self.last[lane]));
        PastLanes { links: self.links, last: memory }
    }

    #[inline]
    fn of(self, lane: usize) -> impl Iterator<Item = Key> {
        let first = self.links.get(self.last[lane] as usize);
        std::iter::successors(first, move |link| self.links.get(link.before as usize)).map(|link| link.key)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::batch::INVALID_ID;

    /// Oracle: the lists by hand. Lanes that go on share what they passed together; the world is not instance 0.
    #[test]
    fn lanes_have_passed_what_was_added() {
        let hit = |inst: u32, prim: u32| Hit { t: 1.0, u: 0.0, v: 0.0, prim, geom: 0, inst, time: 0.0 };
        let mut past = Past::default();
        let one = past.add(Passed::NOTHING, &hit(INVALID_ID, 7));
        let two = past.add(one, &hit(0, 7));
        for (lane, passed) in [Passed::NOTHING, one, two].into_iter().enumerate() {
            past.set(lane, passed);
        }
        let lanes = past.lanes();
        let lists = |lanes: PastLanes| [0, 1, 2].map(|lane| lanes.of(lane).collect::<Vec<_>>());
        assert_eq!(lists(lanes), [vec![], vec![7], vec![1 << 32 | 7, 7]]);
        assert!(lanes.is_passed(1, key_of(0, 7)) && !lanes.is_passed(1, key_of(1, 7)));
        let mut memory = Vec::new();
        assert_eq!(lists(lanes.reordered([2, 0, 1].into_iter(), &mut memory))[0].len(), 2);
    }
}
