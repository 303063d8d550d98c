//! The library's front door: a scene and options in, a film and statistics out. Runs passes of samples over tiles on
//! its own thread pool, calls back between passes, and stops when the first of the limits is met.
//!
//! This page is the loop over passes; each noun in it is a file: the [`Renderer`] is a scene made ready, `workers` run
//! a pass over the `tile`s, `schedule` says where the next one ends, `monitor` estimates the error, [`stopping`] says
//! when it is little enough, `progress` and `result` are what callers see meanwhile and at the end. Imports run
//! progress, result, stopping, tile, renderer ← schedule, monitor, workers ← this page.

mod background;
pub mod checkpoint;
mod guiding;
#[doc(hidden)]
pub mod identity;
pub mod memory;
pub mod merge;
mod metadata;
mod monitor;
mod progress;
mod renderer;
mod result;
mod saved;
mod schedule;
#[doc(hidden)]
pub mod stopping;
mod survey;
mod surveyed;
mod tile;
mod workers;

use std::ops::ControlFlow;
use std::sync::Arc;

use self::monitor::ErrorMonitor;
use self::schedule::{Clock, Schedule};
use self::workers::{Pass, PassEnd, Workers};
use crate::backend::Backend;
use crate::error::{Error, Result};
use crate::film::Film;
use crate::film::layer::kind::Shape;
use crate::film::splats::{AS_PIXELS, Splats};
use crate::plan::aov::Aov;
use crate::transport::counters::Counters;
use crate::transport::job::Job;
use crate::transport::replay;

pub use self::memory::{Need, Part};
pub use self::progress::{Keeper, Progress, Snapshot};
pub use self::renderer::Renderer;
pub use self::result::{Fault, Forecast, Render, State, StopReason};
pub use self::schedule::DEFAULT_SPP;
pub use crate::plan::effects::without::{Absent, leave_out};
pub use crate::plan::light_groups::LightGroup;
pub use crate::plan::options::{
    Backfaces, CameraChoice, Crop, FilterKind, Fog, Guiding, Heuristic, Lens, LightPaths, RenderOptions, Roulette,
    SamplerKind, Strategy, Techniques, TextureFilter,
};

/// Who is told of a running render.
struct Observers<'o> {
    /// Where it is; breaks it off.
    progress: &'o mut dyn FnMut(&Progress) -> ControlFlow<()>,
    /// Is shown the picture after every pass.
    watch: Option<&'o mut dyn FnMut(&Snapshot)>,
    /// Gets the state.
    keeper: Option<&'o mut dyn Keeper>,
}

impl<'o> Observers<'o> {
    /// One alone.
    fn new(progress: &'o mut dyn FnMut(&Progress) -> ControlFlow<()>) -> Self {
        Observers { progress, watch: None, keeper: None }
    }
}

impl Renderer<'_> {
    /// Renders to the first limit that is met; 64 samples per pixel when there is none.
    pub fn render(&self) -> Result<Render> {
        self.render_with(|_| ControlFlow::Continue(()))
    }

    /// Renders, calling `progress` on this thread some fifty times a second. When it breaks off, tiles at hand that
    /// have no samples yet are finished, and what there is is returned.
    pub fn render_with(&self, mut progress: impl FnMut(&Progress) -> ControlFlow<()>) -> Result<Render> {
        self.run(self.backend(), Observers::new(&mut progress), None)
    }

    /// Goes on from `earlier`, a render of the same scene and options that was stopped, within a pass or not, up to
    /// this renderer's limits: all layers and the counts are then, in every bit, those of one render without the stop.
    /// Times add up; limits on time are for this part alone. An error target that `earlier` had as well is checked
    /// where the one render checks it; another one from here on.
    ///
    /// # Errors
    /// [`Error::Option`] when `earlier` has another size, window, first sample or other layers, or when its pixels
    /// differ in samples within a tile.
    pub fn resume(&self, earlier: Render) -> Result<Render> {
        self.resume_with(earlier, |_| ControlFlow::Continue(()))
    }

    /// [`resume`](Self::resume) with the callback of [`render_with`](Self::render_with).
    pub fn resume_with(
        &self,
        earlier: Render,
        mut progress: impl FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Render> {
        self.check_earlier(&earlier)?;
        self.run(self.backend(), Observers::new(&mut progress), Some(earlier))
    }

    /// Whether a render can be gone on with.
    fn check_earlier(&self, earlier: &Render) -> Result<()> {
        let (film, empty) = (&earlier.film, self.empty_film());
        let refused = |option, problem: &str| Err(Error::Option { option, problem: problem.into() });
        let layers = |film: &Film| film.planes().iter().map(|plane| plane.layer.aov).collect::<Vec<_>>();
        if (film.resolution, film.window) != (empty.resolution, empty.window) {
            return refused("--width", "the earlier render has another size or window");
        }
        if film.first_sample != empty.first_sample {
            return refused("--sample-range", "the earlier render begins at another sample");
        }
        if layers(film) != layers(&empty) {
            return refused("--aov", "the earlier render has other layers");
        }
        if !tile::tiles(film.window).iter().all(|tile| film.is_uniform(&tile.pixels)) {
            return refused("--spp", "pixels of the earlier render differ in samples within a tile");
        }
        let (there, here) = (&earlier.splats, self.splats());
        let units = |splats: Option<&Splats>| splats.map(Splats::exponent);
        let sampled = film.spp().max > 0;
        if sampled && units(there.as_deref()) != units(here.as_ref()) {
            return refused("--techniques", "the earlier render has other light paths, or none");
        }
        if sampled && there.as_deref().is_some_and(|splats| splats.samples() == AS_PIXELS) {
            return refused("--techniques", "the earlier render lacks light paths of some samples");
        }
        Ok(())
    }

    /// [`render_with`](Self::render_with), or [`resume_with`](Self::resume_with) where there is an `earlier` render;
    /// the picture is shown to `watch` after every pass as by [`render_watched`](Self::render_watched), and `keeper`
    /// gets the state whenever it wants it.
    ///
    /// # Errors
    /// As [`resume`](Self::resume).
    pub fn render_kept(
        &self,
        earlier: Option<Render>,
        mut progress: impl FnMut(&Progress) -> ControlFlow<()>,
        watch: Option<&mut dyn FnMut(&Snapshot)>,
        keeper: &mut dyn Keeper,
    ) -> Result<Render> {
        earlier.as_ref().map_or(Ok(()), |earlier| self.check_earlier(earlier))?;
        let mut observers = Observers { keeper: Some(keeper), ..Observers::new(&mut progress) };
        if let Some(watch) = watch {
            observers.watch = Some(watch);
        }
        self.run(self.backend(), observers, earlier)
    }

    /// As [`render_with`](Self::render_with), with every ray handed to `backend`: the renderer's own, or one that
    /// stands before it (a recorder) and gives the same answers.
    pub fn render_through(
        &self,
        backend: &dyn Backend,
        mut progress: impl FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Render> {
        self.run(backend, Observers::new(&mut progress), None)
    }

    /// [`render_with`](Self::render_with), and the picture is shown to `watch` after every pass. The clock is paused
    /// while it looks.
    pub fn render_watched(
        &self,
        mut progress: impl FnMut(&Progress) -> ControlFlow<()>,
        mut watch: impl FnMut(&Snapshot),
    ) -> Result<Render> {
        let observers = Observers { watch: Some(&mut watch), ..Observers::new(&mut progress) };
        self.run(self.backend(), observers, None)
    }

    /// The loop over passes, from `earlier` or from an empty film to the first limit that is met.
    fn run(&self, backend: &dyn Backend, observers: Observers, earlier: Option<Render>) -> Result<Render> {
        let Observers { progress, mut watch, mut keeper } = observers;
        let plan = &self.plan;
        let copies = u64::from(keeper.as_ref().is_some_and(|keeper| keeper.keeps_copies()));
        let films = (1 + copies) * memory::films(plan.limits.spp);
        let shape = Shape { max_depth: plan.max_depth, groups: &plan.light_groups.names };
        let ids = memory::ids(plan.limits.spp, self.scene().instances.len() as u64);
        memory::check((plan.window.width, plan.window.height), &plan.aovs, &shape, (films, ids))?;
        let earlier = earlier.unwrap_or_else(|| Render::before(self.empty_film()));
        let (mut done, before) = (earlier.samples(), earlier.render_time);
        let mut monitor = ErrorMonitor::new(plan, done, earlier.check);
        if earlier.stop == StopReason::Error && earlier.check.map(|(target, _)| target) == plan.limits.error {
            return Ok(earlier);
        }
        let mut totals = earlier.into_totals();
        if totals.splats.is_none() {
            totals.splats = self.splats().map(Arc::new);
        }
        let workers = Workers::new(self, backend, totals);
        let schedule = Schedule::new(&plan.limits);
        let mut clock = Clock::start();
        let mut fault = None;

        // A state may be from between the end of a pass and the check that was due then.
        let due = monitor.next_check() == Some(done);
        let mut met = due && monitor.pass_ended(done, clock.elapsed(), || workers.estimate(), || workers.tail());

        let stop = loop {
            if met {
                break StopReason::Error;
            }
            let Some(end) = schedule.next(done, monitor.next_check()) else { break StopReason::Spp };
            let pass = Pass { end, deadline: schedule.deadline(clock.elapsed()) };
            let ended = workers.run(&pass, &mut |within, rays| {
                let (elapsed, predicted) = (clock.elapsed(), monitor.predicted);
                let spp = done as f64 + within * (end - done) as f64;
                let fraction = schedule.fraction(spp, elapsed, predicted);
                let ended =
                    progress(&Progress { elapsed, spp: done, fraction, relmse: monitor.relmse, rays, predicted });
                if let Some(keeper) = &mut keeper
                    && keeper.is_due()
                {
                    let totals = workers.totals().clone();
                    keeper.keep(State { totals, render_time: before + elapsed, check: monitor.check() });
                }
                ended
            });
            match ended {
                PassEnd::Complete => done = end,
                PassEnd::TimeIsUp => break StopReason::Time,
                PassEnd::BrokenOff => break StopReason::Callback,
                PassEnd::Unread => break StopReason::Texture,
                PassEnd::Fault(found) => {
                    fault = Some(found);
                    break StopReason::Fault;
                }
            }

            let elapsed = clock.elapsed();
            met = monitor.pass_ended(done, elapsed, || workers.estimate(), || workers.tail());
            if let Some(watch) = &mut watch {
                clock.pause(|| watch(&Snapshot { elapsed, spp: done, film: &workers.totals().picture() }));
            }
            if !met && schedule.time_is_up(elapsed) {
                break StopReason::Time;
            }
        };

        let totals = workers.finish();
        let mut counters = totals.counters.clone();
        if fault.is_none() {
            self.locate(backend, &mut counters);
        }
        let render_time = before + clock.elapsed();
        let (film, blocks, splats) = totals.finish();
        let (check, forecast) = (monitor.check(), monitor.forecast);
        Ok(Render { film, blocks, splats, counters, render_time, stop, check, forecast, fault })
    }

    /// A film without samples that keeps what the plan asks for.
    fn empty_film(&self) -> Film {
        let plan = &self.plan;
        let mut aovs = plan.aovs.clone();
        let of_nobody = plan.features.per_length && !aovs.iter().any(|aov| aov.is_of_lengths());
        aovs.extend((plan.per_length || of_nobody).then_some(Aov::BOUNCES));
        let mut film = Film::with_groups(plan.resolution, plan.window, &aovs, &plan.light_groups.names);
        film.first_sample = plan.sample_start;
        film
    }

    /// Says of the listed samples that were not finite after how many scatterings they ceased to be.
    fn locate(&self, backend: &dyn Backend, counters: &mut Counters) {
        let job = Job { backend, ..self.job() };
        for met in &mut counters.nonfinite_first {
            met.bounce = replay::nonfinite_bounce(&job, met.pixel, met.sample);
        }
    }
}
