//! The threads of a render: a pass gives every pixel the same range of samples, tile by tile, on the renderer's pool,
//! while the thread that asked for it reports.
//!
//! **Determinism.** A worker takes the sums of a tile's pixels, goes on with them and puts them back; no two workers have
//! the same pixel. Counts are whole numbers. So the bits depend on neither the number of threads nor on who takes what.
//!
//! A panic of a worker is one of the caller.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::renderer::Renderer;
use super::tile::{self, Tile};
use crate::backend::Backend;
use crate::film::estimate::ErrorEstimate;
use crate::film::lengths::LengthSums;
use crate::film::{Film, Pixel};
use crate::sampler::{IndependentScheme, SamplerKind, SobolScheme};
use crate::wavefront::raygen::Chunk;
use crate::wavefront::state::Wave;
use crate::wavefront::{self, Context, Counters};

/// How often the callback is called during a pass.
const REPORT_INTERVAL: Duration = Duration::from_millis(100);

/// What passes add up.
pub(super) struct Totals {
    /// Sums and counts per pixel.
    pub film: Film,
    /// What was traced.
    pub counters: Counters,
    /// One image per path length, if asked for.
    pub lengths: Option<LengthSums>,
}

/// One pass: the same range of samples for every pixel.
pub(super) struct Pass {
    /// Index of the first sample.
    pub first_sample: u64,
    /// Samples per pixel.
    pub samples: u64,
}

/// The workers of one render and what they add to.
pub(super) struct Workers<'r> {
    renderer: &'r Renderer<'r>,
    /// Who traces: the renderer's own backend, or one that stands before it.
    backend: &'r dyn Backend,
    tiles: Vec<Tile>,
    film: Mutex<Film>,
    counters: Mutex<Counters>,
    lengths: Option<Mutex<LengthSums>>,
    /// Waves not in use; a worker takes one per tile and puts it back.
    waves: Mutex<Vec<Wave>>,
}

impl<'r> Workers<'r> {
    /// Workers that go on from `totals` and hand every ray to `backend`.
    pub fn new(renderer: &'r Renderer, backend: &'r dyn Backend, totals: Totals) -> Self {
        Workers {
            renderer,
            backend,
            tiles: tile::tiles(renderer.plan.window),
            film: Mutex::new(totals.film),
            counters: Mutex::new(totals.counters),
            lengths: totals.lengths.map(Mutex::new),
            waves: Mutex::new(Vec::new()),
        }
    }

    /// Renders one pass over all tiles on the pool while this thread calls `report` with the fraction of the tiles that
    /// are done and the rays traced so far. Returns false if the callback broke off; tiles at hand are finished then.
    pub fn run(&self, pass: &Pass, report: &mut dyn FnMut(f64, u64) -> ControlFlow<()>) -> bool {
        let cancelled = AtomicBool::new(false);
        let finished = AtomicUsize::new(0);
        let mut report = || {
            let fraction = finished.load(Ordering::Relaxed) as f64 / self.tiles.len().max(1) as f64;
            report(fraction, self.counters.lock().expect("no worker panicked").rays())
        };
        // The worker wakes this thread when it is done; until then it sleeps but for the reports.
        let (done, reporter) = (AtomicBool::new(false), std::thread::current());
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let _wake = OnDrop(|| {
                    done.store(true, Ordering::Release);
                    reporter.unpark();
                });
                self.renderer.pool.install(|| {
                    self.tiles.par_iter().for_each(|tile| {
                        if !cancelled.load(Ordering::Relaxed) {
                            self.run_tile(pass, tile);
                            finished.fetch_add(1, Ordering::Relaxed);
                        }
                    });
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
        let go_on = report().is_continue();
        let complete = finished.load(Ordering::Relaxed) == self.tiles.len();
        complete && go_on && !cancelled.load(Ordering::Relaxed)
    }

    /// Renders one tile's samples of a pass: takes the tile's pixels from the film, continues their sums, puts them back.
    /// A function in the machine code as well: `make gates` counts what runs within it.
    #[inline(never)]
    fn run_tile(&self, pass: &Pass, tile: &Tile) {
        let plan = &self.renderer.plan;
        let mut wave = self
            .waves
            .lock()
            .expect("no worker panicked")
            .pop()
            .unwrap_or_else(|| Wave::new(plan.wave, self.lengths.is_some()));
        let window = plan.window;
        let place = |&(x, y): &(u32, u32)| (y - window.y) as usize * window.width as usize + (x - window.x) as usize;

        let mut pixels: Vec<Pixel> = {
            let film = self.film();
            tile.pixels.iter().map(|p| film.pixels[place(p)]).collect()
        };
        let context = Context { backend: self.backend, ..self.renderer.context() };
        let mut counters = Counters::default();
        let per_chunk = (wave.capacity() / pass.samples as usize).max(1);
        for (part, sums) in tile.pixels.chunks(per_chunk).zip(pixels.chunks_mut(per_chunk)) {
            let chunk = Chunk { pixels: part, first_sample: pass.first_sample, samples: pass.samples as usize };
            match plan.sampler {
                SamplerKind::Sobol => wavefront::run::<SobolScheme>(&context, &chunk, &mut wave, sums, &mut counters),
                SamplerKind::Independent => {
                    wavefront::run::<IndependentScheme>(&context, &chunk, &mut wave, sums, &mut counters)
                }
            }
            if let Some(lengths) = &self.lengths {
                let mut lengths = lengths.lock().expect("no worker panicked");
                wavefront::accumulate::by_length(&chunk, &wave, &mut lengths, |p| place(&p));
            }
        }
        {
            let mut film = self.film();
            for (p, pixel) in tile.pixels.iter().zip(&pixels) {
                film.pixels[place(p)] = *pixel;
            }
        }
        self.counters.lock().expect("no worker panicked").merge(&counters);
        self.waves.lock().expect("no worker panicked").push(wave);
    }

    /// The film, while nobody works on it.
    pub fn film(&self) -> MutexGuard<'_, Film> {
        self.film.lock().expect("no worker panicked")
    }

    /// The film's estimate of its error, by all workers.
    pub fn estimate(&self) -> Option<ErrorEstimate> {
        let film = self.film();
        self.renderer.pool.install(|| film.error_estimate())
    }

    /// What was added up.
    pub fn finish(self) -> Totals {
        Totals {
            film: self.film.into_inner().expect("no worker panicked"),
            counters: self.counters.into_inner().expect("no worker panicked"),
            lengths: self.lengths.map(|lengths| lengths.into_inner().expect("no worker panicked")),
        }
    }
}

/// Runs when it goes out of scope, after a panic as well.
struct OnDrop<F: FnMut()>(F);

impl<F: FnMut()> Drop for OnDrop<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}
