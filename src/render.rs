//! The library's front door: a scene and options in, a film and statistics out. Runs passes of samples over tiles on a
//! pool of its own, calls back between passes, and stops when the first of the limits is met.

pub mod target;

use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use rayon::prelude::*;

use crate::accuracy::predict::Predicted;
use crate::backend::{self, Backend, BackendInfo};
use crate::camera::CameraRays;
use crate::error::{Error, Result};
use crate::film::aov::FirstHit;
use crate::film::estimate::ErrorEstimate;
use crate::film::filter::FilterTable;
use crate::film::lengths::LengthSums;
use crate::film::{Film, Pixel};
use crate::plan::RenderPlan;
use crate::sampler::{IndependentScheme, SobolScheme};
use crate::scene::geometry::Geometry;
use crate::scene::{Camera, Scene};
use crate::shading::bsdf::albedo::SpecularAlbedo;
use crate::shading::light::Lights;
use crate::shading::light::select::Selection;
use crate::wavefront::alpha::AlphaTable;
use crate::wavefront::queue::{self, Kind};
use crate::wavefront::raygen::Chunk;
use crate::wavefront::replay::Replay;
use crate::wavefront::state::{Carried, Wave};
use crate::wavefront::{self, Context, Counters};

use self::target::Watch;

pub use crate::plan::options::{
    CameraChoice, Crop, FilterKind, Lens, RenderOptions, Roulette, SamplerKind, Strategy, TextureFilter,
};

/// Where a running render is; handed to the callback between passes.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Since the first pass began.
    pub elapsed: Duration,
    /// Samples every pixel has by now.
    pub spp: u64,
    /// Fraction of the work done, in [0, 1], by whichever limit is nearest.
    pub fraction: f64,
    /// Estimated relMSE so far; `None` until both halves have samples.
    pub relmse: Option<f64>,
    /// Rays traced so far, all classes.
    pub rays: u64,
    /// What meeting the error target costs in all, if there is a target and the looks so far tell.
    pub predicted: Option<Predicted>,
}

/// A render after a pass: what [`Renderer::render_watched`] shows.
#[derive(Clone, Copy, Debug)]
pub struct Checkpoint<'a> {
    /// Rendering time so far, without what was spent on showing this.
    pub elapsed: Duration,
    /// Samples every pixel has.
    pub spp: u64,
    /// The picture.
    pub film: &'a Film,
}

/// A prediction and when it was made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forecast {
    /// Seconds of rendering by then.
    pub after_seconds: f64,
    /// Samples per pixel by then.
    pub after_spp: u64,
    /// What was predicted for the whole render.
    pub predicted: Predicted,
}

/// Why a render ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// The samples asked for are done.
    Spp,
    /// Time is up.
    Time,
    /// The error target is met.
    Error,
    /// The callback broke off (a signal, on the command line).
    Callback,
}

impl StopReason {
    /// Spelling in the statistics' `stop`.
    pub fn name(self) -> &'static str {
        match self {
            StopReason::Spp => "spp",
            StopReason::Time => "time",
            StopReason::Error => "error",
            StopReason::Callback => "signal",
        }
    }
}

/// A finished (or stopped) render.
#[derive(Debug)]
pub struct Render {
    /// The picture: sums and counts per pixel.
    pub film: Film,
    /// What was traced.
    pub counters: Counters,
    /// One image per path length, if asked for.
    pub lengths: Option<LengthSums>,
    /// What camera rays meet first, one entry a pixel of the window, if asked for.
    pub first_hits: Option<Vec<FirstHit>>,
    /// Wall time of the passes.
    pub render_time: Duration,
    /// Why it ended.
    pub stop: StopReason,
    /// What the pilot of a render with an error target predicted.
    pub forecast: Option<Forecast>,
}

/// Side of the square tiles that workers take, pixels.
const TILE: u32 = 16;

/// Most samples per pixel in one pass: short enough for a progress report each second on ordinary images.
const PASS_SAMPLES: u64 = 64;

/// How often the error is estimated for the report alone.
const ESTIMATE_INTERVAL: Duration = Duration::from_secs(1);

/// Least time between two estimates for the report, in times that one takes: 2 % of the time at most.
const ESTIMATE_COST: u32 = 50;

/// The pilot of an error target ends after this time, but not before these samples per pixel (below, the estimate is not
/// good enough to go by), and at the second number at the latest. The prediction of that moment is kept and held against
/// what the render took.
const PILOT: (Duration, u64, u64) = (Duration::from_secs(2), 32, 128);

/// Passes aim at this wall time, so that limits and the callback are looked at a few times a second.
const PASS_SECONDS: f64 = 0.4;

/// How often the callback is called during a pass.
const REPORT_INTERVAL: Duration = Duration::from_millis(100);

/// A scene made ready: plan, acceleration structure, light tables.
pub struct Renderer<'a> {
    scene: &'a Scene,
    plan: RenderPlan,
    geometry: Geometry,
    lights: Lights,
    backend: Box<dyn Backend>,
    camera: CameraRays,
    camera_steps: Vec<CameraRays>,
    filter: FilterTable,
    kinds: Vec<Kind>,
    only_kind: Option<Kind>,
    alpha: AlphaTable,
    albedo: SpecularAlbedo,
    pool: rayon::ThreadPool,
    build_time: Duration,
}

impl<'a> Renderer<'a> {
    /// Resolves the options against the scene and builds the backend.
    ///
    /// # Errors
    /// [`Error::Option`] for options out of range, [`Error::Backend`] when the backend cannot be built,
    /// [`Error::InvalidScene`] for lights that are not finite.
    pub fn new(scene: &'a Scene, options: RenderOptions) -> Result<Self> {
        let start = Instant::now();
        let mut geometry = Geometry::build(scene);
        let plan = RenderPlan::new(scene, &geometry, &options)?;
        if plan.features.footprints {
            scene.textures.par_iter().for_each(|texture| texture.make_levels());
        }
        let lights = Lights::build(scene, &geometry)?;
        lights.assign(&mut geometry);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(plan.threads)
            .thread_name(|i| format!("pathspace-{i}"))
            .build()
            .map_err(|e| Error::Option { option: "--threads", problem: e.to_string() })?;
        let backend = backend::build(plan.backend, &geometry, &plan.backend_options())?;
        let camera = CameraRays::new(&scene.cameras[plan.camera], plan.resolution, plan.lens)?;
        let camera_steps = camera_steps(scene, &plan)?;
        let kind = |m| if plan.features.all_general { Kind::General } else { queue::kind_of(m) };
        let kinds: Vec<Kind> = scene.materials.iter().map(kind).collect();
        Ok(Renderer {
            scene,
            lights,
            backend,
            camera,
            camera_steps,
            filter: FilterTable::new(plan.filter),
            only_kind: queue::only_kind(scene, &kinds),
            kinds,
            alpha: AlphaTable::new(scene),
            albedo: SpecularAlbedo::for_materials(&scene.materials),
            pool,
            geometry,
            plan,
            build_time: start.elapsed(),
        })
    }

    /// Takes other options for the renders to come. Nothing is built again, so backend, traversal and ray modes must stay
    /// what they are.
    ///
    /// # Errors
    /// As [`new`](Self::new), and [`Error::Option`] for options that need another backend.
    pub fn retarget(&mut self, options: &RenderOptions) -> Result<()> {
        let plan = RenderPlan::new(self.scene, &self.geometry, options)?;
        if plan.backend != self.plan.backend || plan.backend_options() != self.plan.backend_options() {
            let problem = "another backend, ray mode or number of threads needs a renderer of its own".into();
            return Err(Error::Option { option: "--backend", problem });
        }
        if plan.features.footprints {
            self.scene.textures.par_iter().for_each(|texture| texture.make_levels());
        }
        self.camera = CameraRays::new(&self.scene.cameras[plan.camera], plan.resolution, plan.lens)?;
        self.camera_steps = camera_steps(self.scene, &plan)?;
        self.filter = FilterTable::new(plan.filter);
        self.plan = plan;
        Ok(())
    }

    /// Renders with other random numbers from here on. Nothing that was built depends on the seed.
    pub fn set_seed(&mut self, seed: u64) {
        self.plan.seed = seed;
    }

    /// The resolved decisions.
    pub fn plan(&self) -> &RenderPlan {
        &self.plan
    }

    /// The backend that traces.
    pub fn backend_info(&self) -> &BackendInfo {
        self.backend.info()
    }

    /// The same, to be asked.
    pub fn backend(&self) -> &dyn Backend {
        self.backend.as_ref()
    }

    /// The flattened geometry that the backend was built over.
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// The camera that looks, with its matrices.
    pub fn camera(&self) -> &CameraRays {
        &self.camera
    }

    /// Wall time of flattening the scene and building the acceleration structure and the light tables.
    pub fn build_time(&self) -> Duration {
        self.build_time
    }

    /// Renders to the first limit that is met; 64 samples per pixel when there is none.
    pub fn render(&self) -> Result<Render> {
        self.render_with(|_| ControlFlow::Continue(()))
    }

    /// Renders, calling `progress` on this thread a few times a second. When it breaks off, the tiles at hand are
    /// finished and what there is is returned.
    pub fn render_with(&self, progress: impl FnMut(&Progress) -> ControlFlow<()>) -> Result<Render> {
        self.render_on(self.backend(), progress, None, None)
    }

    /// Goes on from `earlier`, a render of the same scene and options that was stopped, up to this renderer's limits: the film, its
    /// halves and the counts are then, in every bit, those of one render without the stop. Times add up; limits on time are for
    /// this part alone.
    ///
    /// # Errors
    /// [`Error::Option`] when `earlier` has another size or window, stopped within a pass, or when there is an error target,
    /// whose looks would be missing.
    pub fn resume(&self, earlier: Render) -> Result<Render> {
        let film = &earlier.film;
        let spp = film.spp();
        let refused = |option, problem: &str| Err(Error::Option { option, problem: problem.into() });
        if (film.resolution, film.window) != (self.plan.resolution, self.plan.window) {
            return refused("--width", "the earlier render has another size or window");
        }
        if spp.min != spp.max {
            return refused("--spp", "the earlier render was stopped within a pass: its pixels differ in samples");
        }
        if self.plan.limits.error.is_some() {
            return refused("--error", "a render cannot be resumed towards an error target");
        }
        self.render_on(self.backend(), |_| ControlFlow::Continue(()), None, Some(earlier))
    }

    /// As [`render_with`](Self::render_with), with every ray handed to `backend`: the renderer's own, or one that stands
    /// before it (a recorder) and gives the same answers.
    pub fn render_through(
        &self,
        backend: &dyn Backend,
        progress: impl FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Render> {
        self.render_on(backend, progress, None, None)
    }

    /// [`render_with`](Self::render_with), and the picture is shown to `watch` after every pass. The clock stands while it
    /// looks.
    pub fn render_watched(
        &self,
        progress: impl FnMut(&Progress) -> ControlFlow<()>,
        mut watch: impl FnMut(&Checkpoint),
    ) -> Result<Render> {
        self.render_on(self.backend(), progress, Some(&mut watch), None)
    }

    fn render_on(
        &self,
        backend: &dyn Backend,
        mut progress: impl FnMut(&Progress) -> ControlFlow<()>,
        mut watch: Option<&mut dyn FnMut(&Checkpoint)>,
        earlier: Option<Render>,
    ) -> Result<Render> {
        let limits = &self.plan.limits;
        let endless = limits.spp.is_none() && limits.time.is_none() && limits.error.is_none();
        let spp_limit = limits.spp.unwrap_or(if endless { DEFAULT_SPP } else { u64::MAX });
        let earlier = earlier.unwrap_or_else(|| Render {
            film: Film::new(self.plan.resolution, self.plan.window),
            counters: Counters::default(),
            lengths: None,
            first_hits: None,
            render_time: Duration::ZERO,
            stop: StopReason::Spp,
            forecast: None,
        });
        let first = earlier.film.spp().min;
        let film = Mutex::new(earlier.film);
        let counters = Mutex::new(earlier.counters);
        let lengths = self
            .plan
            .features
            .per_length
            .then(|| Mutex::new(earlier.lengths.unwrap_or_else(|| LengthSums::new(self.plan.window))));
        let waves = Mutex::new(Vec::new());
        let tiles = self.tiles();
        let pixels = u64::from(self.plan.window.width) * u64::from(self.plan.window.height);
        let mut target = limits.error.map(|e| Watch::new(e, limits.min_spp, pixels, self.plan.sampler));
        let start = Instant::now();

        let (mut done, mut relmse, mut predicted, mut forecast) = (first, None, None, None);
        let mut stop = StopReason::Spp;
        let (mut last, mut estimated, mut shown) = (Duration::ZERO, Duration::ZERO, Duration::ZERO);
        let (mut samples, mut interval) = (1u64, ESTIMATE_INTERVAL);
        while done < spp_limit {
            samples = samples.min(spp_limit - done);
            let pass = Pass {
                backend,
                first_sample: self.plan.sample_start + done,
                samples,
                tiles: &tiles,
                film: &film,
                counters: &counters,
                lengths: lengths.as_ref(),
                waves: &waves,
            };
            let completed = self.run_pass(&pass, &mut |tiles_done, rays| {
                let within = tiles_done as f64 / tiles.len().max(1) as f64;
                let elapsed = start.elapsed() - shown;
                let spp = done as f64 + within * samples as f64;
                let by_spp = spp / spp_limit as f64;
                let by_time = limits.time.map_or(0.0, |t| elapsed.as_secs_f64() / t.as_secs_f64());
                let by_error = predicted.map_or(0.0, |p: Predicted| spp / p.spp);
                let fraction = by_spp.max(by_time).max(by_error).min(1.0);
                progress(&Progress { elapsed, spp: done, fraction, relmse, rays, predicted })
            });
            if !completed {
                stop = StopReason::Callback;
                break;
            }
            done += samples;

            // The estimate costs a look at every pixel. A target is judged at looks that depend on nothing but the film
            // and the number of samples, so that the same input stops at the same sample; a mere report may wait a second.
            let elapsed = start.elapsed() - shown;
            if let Some(target) = target.as_mut().filter(|target| done == target.next()) {
                let estimate = self.estimate(&film);
                (relmse, estimated) = (estimate.map(|e| e.relmse), elapsed);
                let met = target.look(done, elapsed.as_secs_f64(), estimate);
                predicted = target.predicted();
                let pilot_over = (elapsed >= PILOT.0 && done >= PILOT.1) || done >= PILOT.2;
                if let (None, true, false, Some(predicted)) = (forecast, pilot_over, met, predicted) {
                    let after_seconds = elapsed.as_secs_f64();
                    forecast = Some(Forecast { after_seconds, after_spp: done, predicted });
                }
                if met {
                    stop = StopReason::Error;
                }
            } else if elapsed - estimated >= interval {
                relmse = self.estimate(&film).map(|e| e.relmse);
                estimated = start.elapsed() - shown;
                interval = ESTIMATE_INTERVAL.max((estimated - elapsed) * ESTIMATE_COST);
            }
            if let Some(watch) = &mut watch {
                let showing = Instant::now();
                let film = film.lock().expect("no worker panicked");
                watch(&Checkpoint { elapsed, spp: done, film: &film });
                shown += showing.elapsed();
            }
            if stop == StopReason::Error {
                break;
            }
            if limits.time.is_some_and(|t| elapsed >= t) {
                stop = StopReason::Time;
                break;
            }
            samples = next_pass(samples, elapsed - last, limits.time.map(|t| t.saturating_sub(elapsed)), done);
            if let Some(target) = &target {
                samples = samples.min(target.next() - done);
            }
            last = elapsed;
        }

        let (film, counters) = (film.into_inner(), counters.into_inner());
        let (film, mut counters) = (film.expect("no worker panicked"), counters.expect("no worker panicked"));
        self.locate(backend, &mut counters);
        let first_hits = match earlier.first_hits {
            None if self.plan.features.first_hit => Some(self.first_hits(film.spp().max, &mut counters)),
            known => known,
        };
        Ok(Render {
            film,
            counters,
            lengths: lengths.map(|l| l.into_inner().expect("no worker panicked")),
            first_hits,
            render_time: earlier.render_time + start.elapsed() - shown,
            stop,
            forecast,
        })
    }

    /// The film's estimate of its error, by all workers.
    fn estimate(&self, film: &Mutex<Film>) -> Option<ErrorEstimate> {
        let film = film.lock().expect("no worker panicked");
        self.pool.install(|| film.error_estimate())
    }

    /// The window cut into tiles, each a list of pixels along a Morton curve (neighbours stay in one packet).
    fn tiles(&self) -> Vec<Tile> {
        let w = self.plan.window;
        let mut tiles = Vec::new();
        for ty in (0..w.height).step_by(TILE as usize) {
            for tx in (0..w.width).step_by(TILE as usize) {
                let mut pixels = Vec::with_capacity((TILE * TILE) as usize);
                for code in 0..TILE * TILE {
                    let (x, y) = (tx + even_bits(code), ty + even_bits(code >> 1));
                    if x < w.width && y < w.height {
                        pixels.push((w.x + x, w.y + y));
                    }
                }
                tiles.push(Tile { pixels });
            }
        }
        tiles
    }

    /// Renders one pass over all tiles on the pool while this thread reports. Returns false if the callback broke off.
    fn run_pass(&self, pass: &Pass, report: &mut dyn FnMut(usize, u64) -> ControlFlow<()>) -> bool {
        let cancelled = AtomicBool::new(false);
        let finished = AtomicUsize::new(0);
        let rays = |pass: &Pass| pass.counters.lock().expect("no worker panicked").rays();
        // The worker wakes this thread when it is done; until then it sleeps but for the reports.
        let (done, reporter) = (AtomicBool::new(false), std::thread::current());
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let _wake = OnDrop(|| {
                    done.store(true, Ordering::Release);
                    reporter.unpark();
                });
                self.pool.install(|| {
                    pass.tiles.par_iter().for_each(|tile| {
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
                    if report(finished.load(Ordering::Relaxed), rays(pass)).is_break() {
                        cancelled.store(true, Ordering::Relaxed);
                    }
                }
            }
        });
        let complete = finished.load(Ordering::Relaxed) == pass.tiles.len();
        let go_on = report(finished.load(Ordering::Relaxed), rays(pass)).is_continue();
        complete && go_on && !cancelled.load(Ordering::Relaxed)
    }

    /// What the camera rays of every pixel meet first; `spp` is what the render took.
    fn first_hits(&self, spp: u64, counters: &mut Counters) -> Vec<FirstHit> {
        let w = self.plan.window;
        let rows: Vec<(Vec<FirstHit>, Counters)> = self.pool.install(|| {
            let row = |y| {
                let pixels: Vec<(u32, u32)> = (w.x..w.x + w.width).map(|x| (x, y)).collect();
                let mut counters = Counters::default();
                (wavefront::first_hit::run(&self.context(), &pixels, spp, &mut counters), counters)
            };
            (w.y..w.y + w.height).into_par_iter().map(row).collect()
        });
        rows.iter().for_each(|(_, traced)| counters.merge(traced));
        rows.into_iter().flat_map(|(hits, _)| hits).collect()
    }

    /// What the stages read.
    fn context(&self) -> Context<'_> {
        Context {
            plan: &self.plan,
            scene: self.scene,
            geometry: &self.geometry,
            lights: &self.lights,
            backend: self.backend.as_ref(),
            camera: &self.camera,
            camera_steps: &self.camera_steps,
            filter: &self.filter,
            kinds: &self.kinds,
            only_kind: self.only_kind,
            carried: Carried {
                normal: self.lights.selection() == Selection::Receiver,
                medium: self.plan.features.dielectric || self.plan.features.thin || self.plan.features.absorption,
            },
            only_area: self.lights.only_area(),
            alpha: &self.alpha,
            albedo: &self.albedo,
            observer: None,
        }
    }

    /// Renders one sample of a pixel of the full image again, with everything that was decided on its path written down.
    /// Kernels, backend, query modes and random numbers are those of a render, and so are the bits.
    ///
    /// # Errors
    /// [`Error::Option`] for a pixel outside the full image.
    pub fn replay(&self, pixel: (u32, u32), sample: u64) -> Result<Replay> {
        let (width, height) = self.plan.resolution;
        if pixel.0 >= width || pixel.1 >= height {
            let problem = format!("{},{} lies outside the picture of {width}x{height} pixels", pixel.0, pixel.1);
            return Err(Error::Option { option: "--pixel", problem });
        }
        Ok(wavefront::replay::run(&self.context(), pixel, sample))
    }

    /// Says of the listed samples that were not finite after how many scatterings they ceased to be.
    fn locate(&self, backend: &dyn Backend, counters: &mut Counters) {
        let context = Context { backend, ..self.context() };
        for met in &mut counters.nonfinite_first {
            met.bounce = wavefront::replay::nonfinite_bounce(&context, met.pixel, met.sample);
        }
    }

    /// Renders one tile's samples of a pass: takes the tile's pixels from the film, continues their sums, puts them back.
    fn run_tile(&self, pass: &Pass, tile: &Tile) {
        let context = self.context();
        let mut wave = pass
            .waves
            .lock()
            .expect("no worker panicked")
            .pop()
            .unwrap_or_else(|| Wave::new(self.plan.wave, pass.lengths.is_some()));
        let window = self.plan.window;
        let place = |&(x, y): &(u32, u32)| (y - window.y) as usize * window.width as usize + (x - window.x) as usize;

        let mut pixels: Vec<Pixel> = {
            let film = pass.film.lock().expect("no worker panicked");
            tile.pixels.iter().map(|p| film.pixels[place(p)]).collect()
        };
        let context = Context { backend: pass.backend, ..context };
        let mut counters = Counters::default();
        let per_chunk = (wave.capacity() / pass.samples as usize).max(1);
        for (part, sums) in tile.pixels.chunks(per_chunk).zip(pixels.chunks_mut(per_chunk)) {
            let chunk = Chunk { pixels: part, first_sample: pass.first_sample, samples: pass.samples as usize };
            match self.plan.sampler {
                SamplerKind::Sobol => wavefront::run::<SobolScheme>(&context, &chunk, &mut wave, sums, &mut counters),
                SamplerKind::Independent => {
                    wavefront::run::<IndependentScheme>(&context, &chunk, &mut wave, sums, &mut counters)
                }
            }
            if let Some(lengths) = pass.lengths {
                let mut lengths = lengths.lock().expect("no worker panicked");
                wavefront::accumulate::by_length(&chunk, &wave, &mut lengths, |p| place(&p));
            }
        }
        {
            let mut film = pass.film.lock().expect("no worker panicked");
            for (p, pixel) in tile.pixels.iter().zip(&pixels) {
                film.pixels[place(p)] = *pixel;
            }
        }
        pass.counters.lock().expect("no worker panicked").merge(&counters);
        pass.waves.lock().expect("no worker panicked").push(wave);
    }
}

/// The camera of the plan along its way while the shutter is open; nothing where it is at rest.
fn camera_steps(scene: &Scene, plan: &RenderPlan) -> Result<Vec<CameraRays>> {
    let steps = scene.motion.of_camera(plan.camera).map_or(&[][..], |track| &track.steps);
    let camera = &scene.cameras[plan.camera];
    let posed = |&world_from_camera: &_| {
        CameraRays::new(&Camera { world_from_camera, ..camera.clone() }, plan.resolution, plan.lens)
    };
    steps.iter().map(posed).collect()
}

/// Runs when it goes out of scope, after a panic as well.
struct OnDrop<F: FnMut()>(F);

impl<F: FnMut()> Drop for OnDrop<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

/// Samples per pixel when no limit is given.
pub const DEFAULT_SPP: u64 = 64;

/// Pixels of one tile, full-image coordinates.
struct Tile {
    pixels: Vec<(u32, u32)>,
}

/// One pass: the same range of samples for every pixel.
struct Pass<'p> {
    backend: &'p dyn Backend,
    first_sample: u64,
    samples: u64,
    tiles: &'p [Tile],
    film: &'p Mutex<Film>,
    counters: &'p Mutex<Counters>,
    lengths: Option<&'p Mutex<LengthSums>>,
    /// Waves not in use; a worker takes one per tile and puts it back.
    waves: &'p Mutex<Vec<Wave>>,
}

/// Samples of the next pass: doubles until a pass takes long enough, shrinks to fit the time that is left. Always even
/// after the first two, so that both halves of the film have the same number.
fn next_pass(last: u64, took: Duration, left: Option<Duration>, done: u64) -> u64 {
    if done == 1 {
        return 1;
    }
    let per_sample = took.as_secs_f64() / last as f64;
    let mut seconds = PASS_SECONDS;
    if let Some(left) = left {
        seconds = seconds.min(left.as_secs_f64());
    }
    let fitting = if per_sample > 0.0 { (seconds / per_sample) as u64 } else { u64::MAX };
    let samples = fitting.min(2 * last).clamp(2, PASS_SAMPLES);
    samples & !1
}

/// Bits 0, 2, 4, … of `code`, packed.
fn even_bits(code: u32) -> u32 {
    (0..8).fold(0, |packed, bit| packed | (((code >> (2 * bit)) & 1) << bit))
}
