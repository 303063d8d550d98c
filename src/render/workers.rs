//! The threads of a render: a pass brings every pixel to the same number of samples, tile by tile, on the renderer's
//! pool, while the thread that asked for it reports.
//!
//! **Determinism.** A worker renders a block of samples of a tile's pixels and adds it to the film; no two workers have
//! the same pixel. Counts are whole numbers. So the bits depend on neither the number of threads nor on who takes
//! what. A pass that ends early leaves tiles that have had their samples and tiles that have not, none in between.
//!
//! **Faults.** A worker that panics ends the pass: its tile stays as it was, the others finish theirs, and the sample
//! that did it is looked for.

use std::any::Any;
use std::cell::Cell;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::renderer::Renderer;
use super::result::{Fault, Totals};
use super::tile::{self, Tile};
use crate::backend::Backend;
use crate::film::estimate::ErrorEstimate;
use crate::film::store::Patch;
use crate::transport::counters::Counters;
use crate::transport::job::Job;
use crate::transport::raygen::Chunk;
use crate::transport::wave::Wave;
use crate::transport::{accumulate, first_hit, path, replay};

/// How long the sample that made a worker fail is looked for.
const BLAME_TIME: Duration = Duration::from_millis(400);

/// Samples of a pixel that are looked at then: those of the longest pass.
const MOST_BLAMED: u64 = 64;

/// How often the callback is called during a pass.
const REPORT_INTERVAL: Duration = Duration::from_millis(100);

/// One pass.
pub(super) struct Pass {
    /// Samples that every pixel has at its end; at most a wave more than before.
    pub end: u64,
    /// No tile is begun after it.
    pub deadline: Option<Instant>,
}

/// How a pass ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum PassEnd {
    /// Every pixel has its samples.
    Complete,
    /// The deadline came first.
    TimeIsUp,
    /// The callback broke off.
    BrokenOff,
    /// A texture could not be read.
    Unread,
    /// A worker failed.
    Fault(Fault),
}

/// Whether a tile's texels could be read.
enum Texels {
    /// All.
    Read,
    /// Not all: its pixels stay as they were.
    Missing,
}

/// The workers of one render and what they add to.
pub(super) struct Workers<'r> {
    renderer: &'r Renderer<'r>,
    /// The ray-tracing backend: the renderer's own backend, or one that stands before it.
    backend: &'r dyn Backend,
    tiles: Vec<Tile>,
    /// Film and counters at once, so that they always belong together.
    totals: Mutex<Totals>,
    /// Desks not in use; a worker takes one per tile and puts it back.
    desks: Mutex<Vec<Desk>>,
}

/// What a worker writes on.
struct Desk {
    wave: Wave,
    /// A block of samples of a tile, overwritten by the next.
    patch: Patch,
}

impl<'r> Workers<'r> {
    /// Workers that continue from `totals` and hand every ray to `backend`.
    pub fn new(renderer: &'r Renderer, backend: &'r dyn Backend, totals: Totals) -> Self {
        Workers {
            renderer,
            backend,
            tiles: tile::tiles(renderer.plan.window),
            totals: Mutex::new(totals),
            desks: Mutex::new(Vec::new()),
        }
    }

    /// Renders one pass over all tiles on the pool while this thread calls `report` with the fraction of the tiles that
    /// are done and the rays traced so far. Tiles at hand are finished whatever ends the pass.
    pub fn run(&self, pass: &Pass, report: &mut dyn FnMut(f64, u64) -> ControlFlow<()>) -> PassEnd {
        let cancelled = AtomicBool::new(false);
        let finished = AtomicUsize::new(0);
        let mut report = || {
            let fraction = finished.load(Ordering::Relaxed) as f64 / self.tiles.len().max(1) as f64;
            let rays = self.totals().counters.rays();
            report(fraction, rays)
        };
        let (fault, unread) = (Mutex::new(None), AtomicBool::new(false));
        // The worker wakes this thread when it is done; until then it sleeps but for the reports.
        let (done, reporter) = (AtomicBool::new(false), std::thread::current());
        self.renderer.pool.in_place_scope(|scope| {
            scope.spawn(|_| {
                let _wake = OnDrop(|| {
                    done.store(true, Ordering::Release);
                    reporter.unpark();
                });
                self.tiles.par_iter().for_each(|tile| {
                    let late = pass.deadline.is_some_and(|deadline| Instant::now() >= deadline);
                    if late || cancelled.load(Ordering::Relaxed) {
                        return;
                    }
                    let at = Cell::new((0, 0, 0));
                    match catch_unwind(AssertUnwindSafe(|| self.run_tile(pass, tile, &at))) {
                        Ok(Texels::Read) => {
                            finished.fetch_add(1, Ordering::Relaxed);
                        }
                        Ok(Texels::Missing) => {
                            cancelled.store(true, Ordering::Relaxed);
                            unread.store(true, Ordering::Relaxed);
                        }
                        Err(panic) => {
                            cancelled.store(true, Ordering::Relaxed);
                            let first = &mut *fault.lock().unwrap_or_else(PoisonError::into_inner);
                            first.get_or_insert_with(|| self.blame(tile, at.get(), message(panic.as_ref())));
                        }
                    }
                });
            });
            let mut reported = Instant::now();
            while !done.load(Ordering::Acquire) {
                std::thread::park_timeout(REPORT_INTERVAL.saturating_sub(reported.elapsed()));
                if reported.elapsed() >= REPORT_INTERVAL {
                    reported = Instant::now();
                    if report().is_break() {
                        cancelled.store(true, Ordering::Relaxed);
                    }
                }
            }
        });
        if let Some(fault) = fault.into_inner().unwrap_or_else(PoisonError::into_inner) {
            return PassEnd::Fault(fault);
        }
        if unread.into_inner() {
            return PassEnd::Unread;
        }
        let go_on = report().is_continue();
        if !go_on || cancelled.load(Ordering::Relaxed) {
            PassEnd::BrokenOff
        } else if finished.load(Ordering::Relaxed) < self.tiles.len() {
            PassEnd::TimeIsUp
        } else {
            PassEnd::Complete
        }
    }

    /// Renders one tile's samples of a pass, block by block (`film/blocks.rs`), and adds them to the film,
    /// unless a texture could not be read meanwhile. A function in the machine code as well: `make gates` counts what
    /// runs within it.
    #[inline(never)]
    fn run_tile(&self, pass: &Pass, tile: &Tile, at: &Cell<(usize, usize, u64)>) -> Texels {
        let plan = &self.renderer.plan;
        let Some(&first_pixel) = tile.pixels.first() else { return Texels::Read };
        // All pixels of a tile have the same number: tiles are rendered wholly or not at all.
        let mut done = self.totals().film.samples(first_pixel);
        while done < pass.end {
            let samples = next_block(done, pass.end);
            let free = self.desks.lock().unwrap_or_else(PoisonError::into_inner).pop();
            let mut desk = free.unwrap_or_else(|| Desk {
                wave: Wave::new(plan.wave, plan.features.per_length),
                patch: self.totals().film.patch(),
            });
            let Desk { wave, patch } = &mut desk;
            patch.resize(tile.pixels.len());
            let job = Job { backend: self.backend, ..self.renderer.job() };
            let mut counters = Counters::default();
            if done == 0 && plan.features.first_hit {
                patch.clear_planes();
                first_hit::centres(&job, &tile.pixels, &mut patch.planes, &mut counters);
            }
            let (first_sample, in_chunk) = (plan.sample_start + done, samples as usize);
            let per_chunk = (wave.capacity() / in_chunk).max(1);
            let chunks = tile.pixels.chunks(per_chunk).zip(patch.pixels.chunks_mut(per_chunk));
            for (number, (pixels, sums)) in chunks.enumerate() {
                at.set((number * per_chunk, pixels.len(), first_sample));
                let chunk = Chunk { pixels, first_sample, samples: in_chunk };
                path::run(&job, &chunk, wave, sums, &mut counters);
                accumulate::layers(&chunk, wave, &mut patch.planes, number * per_chunk);
            }
            if self.renderer.tiles.as_ref().is_some_and(|tiles| tiles.must_stop()) {
                return Texels::Missing;
            }
            let mut totals = self.totals();
            totals.film.push(&tile.pixels, patch);
            totals.counters.merge(&counters);
            drop(totals);
            self.desks.lock().unwrap_or_else(PoisonError::into_inner).push(desk);
            done += samples;
        }
        Texels::Read
    }

    /// Which sample of a tile a worker failed at: those of the chunk at hand (its first pixel within the tile, number
    /// of pixels, first sample) are rendered one by one.
    fn blame(&self, tile: &Tile, (first, pixels, sample): (usize, usize, u64), problem: String) -> Fault {
        let until = Instant::now() + BLAME_TIME;
        let pixels = &tile.pixels[first..(first + pixels).min(tile.pixels.len())];
        let pixels = if pixels.is_empty() { &tile.pixels[..1] } else { pixels };
        let job = Job { backend: self.backend, ..self.renderer.job() };
        let fails = |pixel, sample| catch_unwind(AssertUnwindSafe(|| replay::run(&job, pixel, sample))).is_err();
        let all = (sample..sample + MOST_BLAMED).flat_map(|sample| pixels.iter().map(move |&pixel| (pixel, sample)));
        let found = all.take_while(|_| Instant::now() < until).find(|&(pixel, sample)| fails(pixel, sample));
        let (pixel, sample) = found.unwrap_or((pixels[0], sample));
        Fault { tile: tile.pixels[0], pixel, sample, repeats: found.is_some(), problem }
    }

    /// What was added up so far.
    pub fn totals(&self) -> MutexGuard<'_, Totals> {
        self.totals.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The film's estimate of its error, by all workers.
    pub fn estimate(&self) -> Option<ErrorEstimate> {
        let totals = self.totals();
        let film = totals.film.total();
        self.renderer.pool.install(|| film.error_estimate())
    }

    /// What was added up.
    pub fn finish(self) -> Totals {
        self.totals.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Samples of the block after `done`, which ends at `end` at the latest: the largest power of two that `done` is a
/// multiple of.
fn next_block(done: u64, end: u64) -> u64 {
    let most = 1 << (end - done).ilog2();
    match done {
        0 => most,
        _ => most.min(1 << done.trailing_zeros()),
    }
}

/// What a panic says, on one line.
fn message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| text.to_string());
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "it did not say why".into());
    text.lines().map(str::trim).collect::<Vec<_>>().join("; ")
}

/// Runs when it goes out of scope, after a panic as well.
struct OnDrop<F: FnMut()>(F);

impl<F: FnMut()> Drop for OnDrop<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

#[cfg(test)]
mod tests {
    use super::next_block;

    /// Oracle: written by hand.
    #[test]
    fn blocks_begin_at_multiples_of_their_size() {
        let blocks = |mut done: u64, end: u64| {
            let next = || (done < end).then(|| next_block(done, end)).inspect(|samples| done += samples);
            std::iter::from_fn(next).collect::<Vec<_>>()
        };
        assert_eq!(blocks(0, 1), [1]);
        assert_eq!(blocks(0, 21), [16, 4, 1]);
        assert_eq!(blocks(21, 64), [1, 2, 8, 32]);
        assert_eq!(blocks(64, 192), [64, 64]);
        assert_eq!(blocks(18, 32), [2, 4, 8]);
    }
}
