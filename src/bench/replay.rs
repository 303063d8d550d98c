//! Recorded rays traced bare: nothing but the calls that the render made, in its order, with its batches.
//!
//! Each batch is copied into a buffer of the thread, which takes the role of the wave's columns and stays in its L2
//! cache; the copying is not timed, the call is. Every thread takes whole waves, one after the other.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::ThreadPool;

use super::record::{Batch, RayClass};
use crate::backend::Backend;
use crate::backend::batch::{BLOCKED, INVALID_ID, LANES, RayBlock, RayHitBlock};
use crate::error::{Error, Result};
use crate::machine::{self, Clock};

/// Rays that were traced and the time it took, by class; times are sums over threads, seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bare {
    /// Rays.
    pub rays: [u64; 3],
    /// Time inside the backend.
    pub seconds: [f64; 3],
    /// Time of copying, which no other number holds.
    pub copy_seconds: f64,
}

impl Bare {
    fn merge(&mut self, other: &Bare) {
        for class in 0..3 {
            self.rays[class] += other.rays[class];
            self.seconds[class] += other.seconds[class];
        }
        self.copy_seconds += other.copy_seconds;
    }

    /// 10⁶ rays of `class` per second of wall time when `threads` threads do nothing else.
    pub fn mrays_per_s(&self, class: RayClass, threads: usize) -> f64 {
        self.rays[class as usize] as f64 * 1e-6 * threads as f64 / self.seconds[class as usize]
    }
}

/// A pool of `threads` threads for replays.
///
/// # Errors
/// [`Error::Option`] when the system refuses to start them.
pub fn pool(threads: usize) -> Result<ThreadPool> {
    machine::pool(threads, "replay").map_err(|e| Error::Option { option: "--threads", problem: e.to_string() })
}

/// The buffers that a thread traces in.
#[derive(Default)]
struct Columns {
    closest: Vec<RayHitBlock>,
    any: Vec<RayBlock>,
}

impl Columns {
    /// Copies a batch and returns the call that traces it.
    fn load(&mut self, batch: &Batch) {
        let blocks = batch.rays.len();
        if batch.class == RayClass::Shadow {
            if self.any.len() < blocks {
                self.any.resize(blocks, RayBlock::EMPTY);
            }
            self.any[..blocks].copy_from_slice(&batch.rays);
        } else {
            if self.closest.len() < blocks {
                self.closest.resize(blocks, RayHitBlock::EMPTY);
            }
            for (block, rays) in self.closest.iter_mut().zip(&batch.rays) {
                block.ray = *rays;
            }
        }
    }

    fn trace(&mut self, backend: &dyn Backend, batch: &Batch) {
        let blocks = batch.rays.len();
        if batch.class == RayClass::Shadow {
            backend.any_hit(&mut self.any[..blocks], batch.len, batch.hint);
        } else {
            backend.closest_hit(&mut self.closest[..blocks], batch.len, batch.hint);
        }
    }
}

/// Traces the batches of `waves` whose class is `only` (or all) on every thread of `pool`.
pub fn replay(backend: &dyn Backend, waves: &[&[Batch]], only: Option<RayClass>, pool: &ThreadPool) -> Bare {
    replay_by(Clock::Wall, backend, waves, only, pool)
}

/// As [`replay`], by a clock.
pub fn replay_by(
    clock: Clock,
    backend: &dyn Backend,
    waves: &[&[Batch]],
    only: Option<RayClass>,
    pool: &ThreadPool,
) -> Bare {
    let next = AtomicUsize::new(0);
    let total = Mutex::new(Bare::default());
    pool.broadcast(|_| {
        let mut columns = Columns::default();
        let mut bare = Bare::default();
        while let Some(wave) = waves.get(next.fetch_add(1, Ordering::Relaxed)) {
            for batch in wave.iter().filter(|batch| only.is_none_or(|class| class == batch.class)) {
                let begin = clock.now();
                columns.load(batch);
                let loaded = clock.now();
                columns.trace(backend, batch);
                let traced = clock.now();
                bare.rays[batch.class as usize] += batch.len as u64;
                bare.seconds[batch.class as usize] += (traced - loaded).as_secs_f64();
                bare.copy_seconds += (loaded - begin).as_secs_f64();
            }
        }
        total.lock().expect("no thread panicked").merge(&bare);
    });
    total.into_inner().expect("no thread panicked")
}

/// What a ray met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// Nothing, or no blocker.
    Free,
    /// A blocker somewhere.
    Blocked,
    /// The closest hit: its distance (m) and its triangle (instance, mesh, triangle of the mesh).
    Hit {
        /// Distance along the ray, metres.
        t: f32,
        /// Who was hit.
        triangle: [u32; 3],
    },
}

/// What every ray of `waves` met, in order.
pub fn outcomes(backend: &dyn Backend, waves: &[&[Batch]]) -> Vec<Outcome> {
    let mut columns = Columns::default();
    let mut list = Vec::new();
    for batch in waves.iter().flat_map(|wave| wave.iter()) {
        columns.load(batch);
        columns.trace(backend, batch);
        for ray in 0..batch.len {
            let (block, lane) = (ray / LANES, ray % LANES);
            list.push(if batch.class == RayClass::Shadow {
                if columns.any[block].tfar[lane] == BLOCKED { Outcome::Blocked } else { Outcome::Free }
            } else {
                match columns.closest[block].hit(lane) {
                    Some(hit) => {
                        debug_assert!(hit.geom != INVALID_ID, "a hit names its mesh");
                        Outcome::Hit { t: hit.t, triangle: [hit.inst, hit.geom, hit.prim] }
                    }
                    None => Outcome::Free,
                }
            });
        }
    }
    list
}
