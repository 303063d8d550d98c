//! The library's front door: a scene and options in, a film and statistics out. Runs passes of samples over tiles on a
//! pool of its own, calls back between passes, and stops when the first of the limits is met.
//!
//! This page is the loop over passes; each noun in it is a file: the [`Renderer`] is a scene made ready, `workers` run a
//! pass over the `tile`s, `schedule` says how long the next one is, `looks` what is known of the error, [`target`] when
//! that is little enough, and `outcome` holds what is told meanwhile and at the end. Imports run
//! outcome, target, tile, renderer ← schedule, looks, workers ← this page.

mod looks;
mod outcome;
mod renderer;
mod schedule;
pub mod target;
mod tile;
mod workers;

use std::ops::ControlFlow;

use rayon::prelude::*;

use self::looks::Looks;
use self::schedule::{Clock, Schedule};
use self::workers::{Pass, Totals, Workers};
use crate::backend::Backend;
use crate::error::{Error, Result};
use crate::film::aov::FirstHit;
use crate::film::lengths::LengthSums;
use crate::wavefront::{self, Context, Counters};

pub use self::outcome::{Checkpoint, Forecast, Progress, Render, StopReason};
pub use self::renderer::Renderer;
pub use self::schedule::DEFAULT_SPP;
pub use crate::plan::options::{
    CameraChoice, Crop, FilterKind, Lens, RenderOptions, Roulette, SamplerKind, Strategy, TextureFilter,
};

impl Renderer<'_> {
    /// Renders to the first limit that is met; 64 samples per pixel when there is none.
    pub fn render(&self) -> Result<Render> {
        self.render_with(|_| ControlFlow::Continue(()))
    }

    /// Renders, calling `progress` on this thread a few times a second. When it breaks off, the tiles at hand are
    /// finished and what there is is returned.
    pub fn render_with(&self, progress: impl FnMut(&Progress) -> ControlFlow<()>) -> Result<Render> {
        self.run(self.backend(), progress, None, None)
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
        self.run(self.backend(), |_| ControlFlow::Continue(()), None, Some(earlier))
    }

    /// As [`render_with`](Self::render_with), with every ray handed to `backend`: the renderer's own, or one that stands
    /// before it (a recorder) and gives the same answers.
    pub fn render_through(
        &self,
        backend: &dyn Backend,
        progress: impl FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Render> {
        self.run(backend, progress, None, None)
    }

    /// [`render_with`](Self::render_with), and the picture is shown to `watch` after every pass. The clock stands while it
    /// looks.
    pub fn render_watched(
        &self,
        progress: impl FnMut(&Progress) -> ControlFlow<()>,
        mut watch: impl FnMut(&Checkpoint),
    ) -> Result<Render> {
        self.run(self.backend(), progress, Some(&mut watch), None)
    }

    /// The loop over passes, from `earlier` or from an empty film to the first limit that is met.
    fn run(
        &self,
        backend: &dyn Backend,
        mut progress: impl FnMut(&Progress) -> ControlFlow<()>,
        mut watch: Option<&mut dyn FnMut(&Checkpoint)>,
        earlier: Option<Render>,
    ) -> Result<Render> {
        let plan = &self.plan;
        let earlier = earlier.unwrap_or_else(|| Render::unbegun(plan.resolution, plan.window));
        let mut done = earlier.film.spp().min;
        let lengths = || earlier.lengths.unwrap_or_else(|| LengthSums::new(plan.window));
        let lengths = plan.features.per_length.then(lengths);
        let totals = Totals { film: earlier.film, counters: earlier.counters, lengths };
        let workers = Workers::new(self, backend, totals);
        let mut schedule = Schedule::new(&plan.limits);
        let mut looks = Looks::new(plan);
        let mut clock = Clock::start();

        let stop = loop {
            let Some(samples) = schedule.pass(done) else { break StopReason::Spp };
            let pass = Pass { first_sample: plan.sample_start + done, samples };
            let completed = workers.run(&pass, &mut |within, rays| {
                let (elapsed, predicted) = (clock.elapsed(), looks.predicted);
                let fraction = schedule.fraction(done as f64 + within * samples as f64, elapsed, predicted);
                progress(&Progress { elapsed, spp: done, fraction, relmse: looks.relmse, rays, predicted })
            });
            if !completed {
                break StopReason::Callback;
            }
            done += samples;

            let elapsed = clock.elapsed();
            let met = looks.look(done, elapsed, || workers.estimate());
            if let Some(watch) = &mut watch {
                clock.stand(|| watch(&Checkpoint { elapsed, spp: done, film: &workers.film() }));
            }
            if met {
                break StopReason::Error;
            }
            if schedule.time_is_up(elapsed) {
                break StopReason::Time;
            }
            schedule.passed(done, elapsed, looks.next());
        };

        let Totals { film, mut counters, lengths } = workers.finish();
        self.locate(backend, &mut counters);
        let first_hits = match earlier.first_hits {
            None if plan.features.first_hit => Some(self.first_hits(film.spp().max, &mut counters)),
            known => known,
        };
        let render_time = earlier.render_time + clock.elapsed();
        Ok(Render { film, counters, lengths, first_hits, render_time, stop, forecast: looks.forecast })
    }

    /// Says of the listed samples that were not finite after how many scatterings they ceased to be.
    fn locate(&self, backend: &dyn Backend, counters: &mut Counters) {
        let context = Context { backend, ..self.context() };
        for met in &mut counters.nonfinite_first {
            met.bounce = wavefront::replay::nonfinite_bounce(&context, met.pixel, met.sample);
        }
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
}
