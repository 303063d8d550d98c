//! Rays that continue past surfaces: see [`pass_through`](super::pass_through).

use crate::backend::batch::{Hit, LANES, RayBlock, RayHitBlock};
use crate::backend::past::{Passed, Past};
use crate::math::float;
use crate::shading::interaction::Interaction;

/// Rays that continue, in lanes `0..pending.len()`. Grows to a wave's size where it is used at all.
#[derive(Default)]
pub struct Passing {
    /// The rays and, after tracing, hits.
    pub rays: Vec<RayHitBlock>,
    /// What is known of each.
    pub pending: Vec<Pending>,
    /// What each has passed.
    pub past: Past,
    /// What the rays of the batch had passed before any went on; empty where they had passed nothing.
    pub first: Vec<Passed>,
}

/// One ray that continues.
#[derive(Clone, Copy)]
pub struct Pending {
    /// Lane of the path or shadow ray.
    pub lane: u32,
    /// Surfaces passed so far.
    pub surfaces: u32,
    /// Triangles passed so far.
    pub passed: Passed,
    /// The last of them.
    pub last: Option<Hit>,
    /// Fraction of a shadow ray that is left.
    pub left: f64,
}

impl Pending {
    /// The ray of a lane before it has passed anything.
    pub fn new(lane: usize) -> Self {
        Pending { lane: lane as u32, surfaces: 0, passed: Passed::NOTHING, last: None, left: 1.0 }
    }
}

impl Passing {
    /// Makes room for this many rays, and forgets those there are.
    pub fn clear(&mut self, capacity: usize) {
        self.pending.clear();
        self.past.clear();
        self.first.clear();
        if self.rays.len() * LANES < capacity {
            self.rays.resize(capacity.div_ceil(LANES), RayHitBlock::EMPTY);
        }
    }

    /// Sets the ray in lane `place`, at most one behind the last: lane `i` of `from` as it started, up to `tfar`.
    #[inline(always)]
    pub fn put(&mut self, place: usize, pending: Pending, (from, i): (&RayBlock, usize), tfar: f32) {
        let ray = &mut self.rays[place / LANES].ray;
        ray.set(place % LANES, from.org(i), from.dir(i), tfar);
        ray.tnear[place % LANES] = from.tnear[i];
        ray.time[place % LANES] = from.time[i];
        self.past.set(place, pending.passed);
        if place == self.pending.len() {
            self.pending.push(pending);
        } else {
            self.pending[place] = pending;
        }
    }

    /// [`put`](Self::put) for a ray that goes on past `hit`, which lies `at`, and past another triangle there.
    #[inline(always)]
    pub fn put_past(
        &mut self,
        place: usize,
        pending: Pending,
        from: (&RayBlock, usize),
        tfar: f32,
        passed: (&Hit, &Interaction),
        also: Option<Hit>,
    ) {
        let (hit, at) = passed;
        let before = also.map_or(pending.passed, |also| self.past.add(pending.passed, &also));
        let pending = Pending { passed: self.past.add(before, hit), last: Some(*hit), ..pending };
        self.put(place, pending, from, tfar);
        let ray = &mut self.rays[place / LANES].ray;
        let i = place % LANES;
        let before = float::before(hit.t, ray.org(i), at.error, at.n_g.dot(ray.dir(i)));
        ray.tnear[i] = ray.tnear[i].max(before);
    }

    /// [`put_past`](Self::put_past) for a ray without end that starts behind `hit`, which it does not pass.
    #[inline(always)]
    pub fn put_skipped(
        &mut self,
        place: usize,
        pending: Pending,
        from: (&RayBlock, usize),
        skipped: (&Hit, &Interaction),
    ) {
        self.put_past(place, pending, from, f32::INFINITY, skipped, None);
        self.pending[place].last = pending.last;
    }
}
