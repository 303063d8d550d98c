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
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::renderer::Renderer;
use super::result::{Fault, Totals};
use super::tile::{self, Tile};
use crate::backend::Backend;
use crate::film::estimate::{ErrorEstimate, Tail};
use crate::film::splats::Splats;
use crate::film::store::Patch;
use crate::transport::counters::Counters;
use crate::transport::job::Job;
use crate::transport::light_paths::start::Batch;
use crate::transport::light_paths::{lit, trace};
use crate::transport::parts::Wanted;
use crate::transport::raygen::Chunk;
use crate::transport::wave::Wave;
use crate::transport::{accumulate, first_hit, path, replay};

/// How long the sample that made a worker fail is looked for.
const BLAME_TIME: Duration = Duration::from_millis(400);

/// Samples of a pixel that are looked at then: those of the longest pass.
const MOST_BLAMED: u64 = 64;

/// How often the callback is called during a pass: who moves the camera of a view waits for it.
const REPORT_INTERVAL: Duration = Duration::from_millis(20);

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

/// What became of a tile.
enum Done {
    /// It has its samples.
    Whole,
    /// Not all texels could be read: its pixels stay as they were.
    Unread,
    /// The callback broke off: the tile has samples, but not all of this pass.
    BrokenOff,
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
    /// The same for light paths.
    light_desks: Mutex<Vec<trace::Desk>>,
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
            light_desks: Mutex::new(Vec::new()),
        }
    }

    /// Renders one pass over all tiles on the pool while this thread calls `report` with the fraction of the tiles that
    /// are done and the rays traced so far. Tiles at hand are finished when the time is up.
    pub fn run(&self, pass: &Pass, report: &mut dyn FnMut(f64, u64) -> ControlFlow<()>) -> PassEnd {
        let cancelled = AtomicBool::new(false);
        let (finished, light) = (AtomicUsize::new(0), self.light_batches(pass.end));
        let traced = AtomicUsize::new(0);
        let mut report = || {
            let done = finished.load(Ordering::Relaxed) + traced.load(Ordering::Relaxed);
            let fraction = done as f64 / (self.tiles.len() + light.len()).max(1) as f64;
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
                let is_late = || pass.deadline.is_some_and(|deadline| Instant::now() >= deadline);
                // Camera paths get what time light paths leave, half of it at least.
                let begun = Instant::now();
                let half = pass.deadline.map(|deadline| begun + deadline.saturating_duration_since(begun) / 2);
                let is_half_over = || half.is_some_and(|half| Instant::now() >= half);
                if is_late() || !self.trace_light(&light, (&traced, &cancelled), &is_half_over, &fault) {
                    return;
                }
                // A tile each is rendered in any case, so that what light paths took is not lost.
                let least = if light.is_empty() { 0 } else { rayon::current_num_threads() };
                let taken = AtomicUsize::new(0);
                self.tiles.par_iter().for_each(|tile| {
                    let is_late = is_late() && taken.load(Ordering::Relaxed) >= least;
                    if is_late || cancelled.load(Ordering::Relaxed) {
                        return;
                    }
                    taken.fetch_add(1, Ordering::Relaxed);
                    let at = Cell::new((0, 0, 0));
                    match catch_unwind(AssertUnwindSafe(|| self.run_tile(pass, tile, &at, &cancelled))) {
                        Ok(Done::Whole) => {
                            finished.fetch_add(1, Ordering::Relaxed);
                        }
                        Ok(Done::BrokenOff) => {}
                        Ok(Done::Unread) => {
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
                if !is_late() && !cancelled.load(Ordering::Relaxed) {
                    self.trace_light(&light, (&traced, &cancelled), &is_late, &fault);
                }
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
        } else if finished.load(Ordering::Relaxed) < self.tiles.len() || traced.load(Ordering::Relaxed) < light.len() {
            PassEnd::TimeIsUp
        } else {
            PassEnd::Complete
        }
    }

    /// The light paths of a pass up to sample `end`, in batches that fit a wave.
    fn light_batches(&self, end: u64) -> Vec<Batch> {
        let (plan, totals) = (&self.renderer.plan, self.totals());
        let Some(splats) = &totals.splats else { return Vec::new() };
        let (per_sample, (first, (begun, _))) = (lit::per_sample(plan), splats.traced());
        let (paths, sample) = (end.saturating_sub(first) * per_sample, plan.sample_start + first);
        let starts = (begun..paths).step_by(plan.wave);
        starts
            .map(|at| Batch { sample, per_sample, first: at, len: (paths - at).min(plan.wave as u64) as usize })
            .collect()
    }

    /// Traces the `batches` after the first `traced` ones, in their order, until they are done or it `is_late`, one at
    /// least, and adds what they bring. Nothing is added where a worker fails, which the result says.
    fn trace_light(
        &self,
        batches: &[Batch],
        (traced, cancelled): (&AtomicUsize, &AtomicBool),
        is_late: &(dyn Fn() -> bool + Sync),
        fault: &Mutex<Option<Fault>>,
    ) -> bool {
        let first = traced.load(Ordering::Relaxed);
        let Some(sums) = self.totals().splats.clone().filter(|_| first < batches.len()) else { return true };
        let (of_pass, counted) = (sums.blank(), Mutex::new(Counters::default()));
        let (next, failed) = (AtomicUsize::new(first), AtomicBool::new(false));
        // Whoever is free takes the next one, so that those that are traced are the first ones.
        let work = || {
            let free = self.light_desks.lock().unwrap_or_else(PoisonError::into_inner).pop();
            let mut desk = free.unwrap_or_else(|| trace::Desk::new(self.renderer.plan.wave));
            let job = Job { backend: self.backend, ..self.renderer.job() };
            let mut counters = Counters::default();
            let mut sink = trace::ToPixels::new(&of_pass, job.filter);
            while !cancelled.load(Ordering::Relaxed) {
                let number = next.load(Ordering::Relaxed);
                let goes_on = number == first || !is_late();
                if !goes_on || number >= batches.len() {
                    break;
                }
                let Some(batch) = batches.get(next.fetch_add(1, Ordering::Relaxed)) else { break };
                let run = AssertUnwindSafe(|| trace::run(&job, batch, &mut desk, &mut sink, &mut counters));
                if let Err(panic) = catch_unwind(run) {
                    failed.store(true, Ordering::Relaxed);
                    cancelled.store(true, Ordering::Relaxed);
                    let first = &mut *fault.lock().unwrap_or_else(PoisonError::into_inner);
                    let problem = format!("light paths {batch:?}: {}", message(panic.as_ref()));
                    let fault = Fault { tile: (0, 0), pixel: (0, 0), sample: batch.sample, repeats: false, problem };
                    first.get_or_insert(fault);
                    return;
                }
                traced.fetch_add(1, Ordering::Relaxed);
            }
            counted.lock().unwrap_or_else(PoisonError::into_inner).merge(&counters);
            self.light_desks.lock().unwrap_or_else(PoisonError::into_inner).push(desk);
        };
        rayon::scope(|scope| (0..rayon::current_num_threads()).for_each(|_| scope.spawn(|_| work())));
        if failed.into_inner() {
            return false;
        }
        let done = traced.load(Ordering::Relaxed);
        if done == first {
            return true;
        }
        let last = &batches[done - 1];
        let mut sum = match sums.traced() {
            (0, (0, _)) => of_pass,
            _ => {
                let mut sum = Splats::clone(&sums);
                sum.merge(&of_pass);
                sum
            }
        };
        let before = (last.sample - self.renderer.plan.sample_start) * last.per_sample;
        sum.set_traced(before + last.first + last.len as u64, last.per_sample);
        let mut totals = self.totals();
        totals.counters.nonfinite += sum.lost() - sums.lost();
        totals.splats = Some(Arc::new(sum));
        totals.counters.merge(&counted.into_inner().unwrap_or_else(PoisonError::into_inner));
        true
    }

    /// Renders one tile's samples of a pass, block by block (`film/blocks.rs`), and adds them to the film,
    /// unless a texture could not be read meanwhile. Of a tile that has samples the block at hand is dropped once it is
    /// `cancelled`. A function in the machine code as well: `make gates` counts what runs within it.
    #[inline(never)]
    fn run_tile(&self, pass: &Pass, tile: &Tile, at: &Cell<(usize, usize, u64)>, cancelled: &AtomicBool) -> Done {
        let plan = &self.renderer.plan;
        let Some(&first_pixel) = tile.pixels.first() else { return Done::Whole };
        // All pixels of a tile have the same number: tiles are rendered wholly or not at all.
        let mut done = self.totals().film.samples(first_pixel);
        while done < pass.end {
            let samples = next_block(done, pass.end);
            let free = self.desks.lock().unwrap_or_else(PoisonError::into_inner).pop();
            let mut desk = free.unwrap_or_else(|| Desk {
                wave: Wave::new(plan.wave, &Wanted::by(plan)),
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
                if done > 0 && cancelled.load(Ordering::Relaxed) {
                    return Done::BrokenOff;
                }
                at.set((number * per_chunk, pixels.len(), first_sample));
                let chunk = Chunk { pixels, first_sample, samples: in_chunk };
                path::run(&job, &chunk, wave, sums, &mut counters);
                accumulate::layers(&chunk, wave, &mut patch.planes, number * per_chunk);
            }
            if self.renderer.tiles.as_ref().is_some_and(|tiles| tiles.must_stop()) {
                return Done::Unread;
            }
            let mut totals = self.totals();
            totals.film.push(&tile.pixels, patch);
            totals.counters.merge(&counters);
            drop(totals);
            self.desks.lock().unwrap_or_else(PoisonError::into_inner).push(desk);
            done += samples;
        }
        Done::Whole
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
        let film = totals.picture();
        self.renderer.pool.install(|| film.error_estimate())
    }

    /// The tail of that estimate, by all workers.
    pub fn tail(&self) -> Option<Tail> {
        let totals = self.totals();
        let film = totals.picture();
        self.renderer.pool.install(|| film.tail())
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
    use super::*;
    use crate::film::blocks::Blocks;
    use crate::plan::options::{FilterKind, LightPaths, RenderOptions};
    use crate::scene::Projection;
    use crate::scene::builder::SceneBuilder;
    use glam::Vec3;

    /// Light paths that end with their first batch, half of those of the sample: a pixel has the mean of those
    /// that there are. Oracle: the floor's irradiance by a point light and its image in a mirror, E = I·cos/d², over
    /// the middle; 16 seeds, within 4.9 standard errors, which are to be below 2 %. Gone on with, it has the bits of a
    /// render at once.
    #[test]
    fn light_paths_may_end_early() {
        let mut b = SceneBuilder::new();
        let (grey, mirror) = (b.lambert(Vec3::splat(0.5)), b.metal(Vec3::ONE, 0.0));
        b.quad([[-9.0, 9.0], [9.0, 9.0], [9.0, -9.0], [-9.0, -9.0]].map(|[x, z]| Vec3::new(x, 0.0, z)), grey);
        b.quad([[0.0, 5.0], [5.0, 5.0], [5.0, -5.0], [0.0, -5.0]].map(|[y, z]| Vec3::new(2.0, y, z)), mirror);
        b.point_light(Vec3::new(0.5, 1.0, 0.0), Vec3::ONE);
        let parallel = Projection::Orthographic { xmag_m: 0.5, ymag_m: 0.5 };
        b.any_camera(Vec3::new(0.0, 4.0, 0.0), Vec3::ZERO, Vec3::Z, parallel);
        let scene = b.build();
        let of = |x: f64, z: f64| (x * x + 1.0 + z * z).powf(-1.5);
        let at = |i: i32| (f64::from(i) + 0.5) / 100.0 - 0.5;
        let points = (0..100 * 100).map(|i| (at(i % 100), at(i / 100)));
        let expected = points.map(|(x, z)| of(x - 0.5, z) + of(x - 3.5, z)).sum::<f64>() / 1e4;

        let means: Vec<f64> = (0..16)
            .map(|seed| {
                let options = RenderOptions::new(64, 64).spp(1).seed(seed).filter(FilterKind::Box).threads(1);
                let renderer =
                    Renderer::new(&scene, options.light_paths(LightPaths::Share(1.0))).expect("valid options");
                let film = Blocks::of(vec![renderer.empty_film()]);
                let totals = Totals { film, splats: renderer.splats().map(Arc::new), counters: Counters::default() };
                let workers = Workers::new(&renderer, renderer.backend(), totals);
                let (traced, cancelled, fault) = (AtomicUsize::new(0), AtomicBool::new(false), Mutex::new(None));
                let batches = workers.light_batches(1);
                let trace = || workers.trace_light(&batches, (&traced, &cancelled), &|| true, &fault);
                assert!(renderer.pool.install(trace) && batches.len() > 1);
                let of_one = (0, (renderer.plan.wave as u64, 4096));
                assert_eq!(workers.totals().splats.as_ref().map(|splats| splats.traced()), Some(of_one));

                let pass = Pass { end: 1, deadline: None };
                for tile in &workers.tiles {
                    let at = Cell::new((0, 0, 0));
                    assert!(matches!(workers.run_tile(&pass, tile, &at, &AtomicBool::new(false)), Done::Whole));
                }
                let mean = workers.totals().picture().mean()[0] * std::f64::consts::PI / 0.5;
                let ended = workers.run(&pass, &mut |_, _| ControlFlow::Continue(()));
                assert_eq!(ended, PassEnd::Complete);
                let whole = renderer.render().expect("a render");
                assert_eq!(workers.finish().finish().0.hash(), whole.film.hash());
                mean
            })
            .collect();
        let mean = means.iter().sum::<f64>() / 16.0;
        let error = (means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / 15.0 / 16.0).sqrt();
        assert!((mean - expected).abs() < 4.9 * error && error < 0.02 * expected, "{mean} ± {error}, {expected}");
    }

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
