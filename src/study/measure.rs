//! The measurement behind `pathspace accuracy`: what is rendered, in which order, within a budget of wall time.
//!
//! * Pilot: one seed, 4, 8, 16, … samples; fits the price list.
//! * Warm-up: every setting once; sets the numbers of samples, and is left out of every result by that rule.
//! * Reference: eight long runs with different seeds.
//! * Rounds: every setting in order and then in reverse order, so that a drift of the machine that is linear over a
//!   round falls on all settings alike. Within a round all settings use the same seeds and are compared on the same
//!   paths.
//! * The price list's targets, cheapest first, while time is left; then more rounds.
//!
//! The price of effects (`--effects`) takes the place of warm-up, reference and rounds: see `pairs.rs`.
//!
//! What it finds is a [`Study`]. Stopping early, by the budget or by the observer, keeps every finished run. Limit:
//! techniques and knobs need two rounds for an interval at all; a budget that is too small says so in the intervals.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use super::classes::{self, Classes};
use super::energy::Meter;
use super::findings::{Measured, Price, Series, Study};
use super::reference::{Reference, values};
use super::renderers::{Halt, Renderers, Step};
use super::rounds::{LEAST_SPP, deep, levels};
use super::settings::{self, Turns, Ways};
use crate::accuracy::predict::{self, Point, SlopePrior};
use crate::backend::BackendKind;
use crate::error::{Error, Result};
use crate::render::{Guiding, LightPaths, RenderOptions};
use crate::scene::Scene;

/// Targets of the price list, relative RMSE.
pub const TARGETS: [f64; 5] = [0.10, 0.05, 0.02, 0.01, 0.005];

/// Runs that the reference is the mean of.
const REFERENCE_RUNS: u64 = 8;

/// A run of the reference has this many times the samples of the largest runs that are compared with it, or more; fewer
/// where the budget is too small for that.
const REFERENCE_FACTOR: u64 = 4;

/// Rounds that the numbers of samples are chosen for. Machines that also do other things manage fewer; time that is
/// left goes into more.
const ROUNDS: f64 = 6.0;

/// Shares of the budget, from its start: end of the pilot, of the rounds; and the share that the reference may take.
const PILOT_UNTIL: f64 = 0.06;
const ROUNDS_UNTIL: f64 = 0.8;
const EFFECTS_UNTIL: f64 = 0.9;
const REFERENCE_SHARE: f64 = 0.2;
const MOST_REFERENCE_SHARE: f64 = 0.35;

/// Samples of the warm-up.
const WARM_UP_SPP: u64 = 8;

/// Wall time of a run beyond its samples: passes begin and end.
const RUN_OVERHEAD_S: f64 = 0.01;

/// Pixels of the largest picture that is studied.
pub const MOST_PIXELS: u64 = 1 << 18;

/// What is to be studied.
#[derive(Clone, Debug)]
pub struct Request {
    /// The default setting: picture, seed, threads. Its limits are ignored.
    pub base: RenderOptions,
    /// Wall time for everything, from `started` of [`run`].
    pub budget: Duration,
    /// All combinations of techniques instead of one factor at a time.
    pub full: bool,
    /// The price of every effect, in the place of techniques and knobs.
    pub effects: bool,
    /// A given reference; `None` renders one.
    pub reference: Option<Reference>,
    /// Paths that are looked at for their classes, on top of the budget; `None` looks at none.
    pub classes: Option<u64>,
    /// Seconds that loading the scene took.
    pub load_s: f64,
}

/// First seed of the reference: 2³² above those of the runs.
pub fn reference_seed(base: u64) -> u64 {
    base.wrapping_add(1 << 32)
}

/// Seed of a run for the price list: 2³³ above those of the rounds.
fn price_seed(base: u64, target: usize) -> u64 {
    base.wrapping_add((1 << 33) + target as u64)
}

/// Runs the study. `observe` is called during every render and ends the study by breaking off.
///
/// # Errors
/// Those of [`Renderer::new`](crate::Renderer::new); [`Error::Option`] for more pixels than [`MOST_PIXELS`] and for a
/// reference of another size.
pub fn run(
    scene: &Scene,
    request: &Request,
    started: Instant,
    observe: &mut dyn FnMut(&Step) -> ControlFlow<()>,
) -> Result<Study> {
    let mut base = request.base.clone();
    (base.spp, base.time, base.error) = (None, None, None);
    let mut renderers = Renderers::new(scene, started, request.budget, observe);
    let first = renderers.renderer(&base)?;
    let (window, build, plan) = (first.plan().window, first.build_time(), first.plan());
    let decided = (plan.backend, plan.features.light_paths.then_some(plan.light_paths), plan.guide.is_some());
    let textures = plan.features.textures;
    let has = if request.effects { Ways::default() } else { Ways::of(first, &base) };
    let pixels = u64::from(window.width) * u64::from(window.height);
    if pixels > MOST_PIXELS {
        let problem = format!("{pixels} pixels; a study takes at most {MOST_PIXELS} (its pictures are kept in memory)");
        return Err(Error::Option { option: "--width", problem });
    }
    if request.reference.as_ref().is_some_and(|r| r.values.len() as u64 != 3 * pixels) {
        let problem = format!("it must have the size of the picture, {}x{}", window.width, window.height);
        return Err(Error::Option { option: "--reference", problem });
    }
    let mut list = Vec::new();
    if !request.effects {
        list = settings::techniques(&base, request.full);
        list.extend(settings::ways(&base, has, request.full));
        list.extend(settings::knobs(&base, Turns { textures, ..Turns::of(scene) }));
    } else {
        hold(&mut base, decided);
    }
    let mut study = Study::new(request.load_s + build.as_secs_f64(), request.reference.clone(), list);
    let measured = match request.effects {
        true => study.measure_effects(&mut renderers, scene, &base),
        false => study.measure(&mut renderers, &base),
    };
    match measured {
        Err(Halt::Failed(error)) => return Err(error),
        Err(Halt::Interrupted) => study.interrupted = true,
        Ok(()) | Err(Halt::Budget) => study.classes = classes_of(&mut renderers, &base, request, &mut study)?,
    }
    study.seconds = started.elapsed().as_secs_f64();
    Ok(study)
}

/// What the plan and surveys decided is held, so that a picture without one technique has the others.
fn hold(base: &mut RenderOptions, (backend, light_paths, guides): (BackendKind, Option<f32>, bool)) {
    base.backend = Some(backend);
    if base.light_paths == LightPaths::Auto {
        base.light_paths = light_paths.map_or(LightPaths::Off, LightPaths::Share);
    }
    if base.guiding == Guiding::Auto {
        base.guiding = if guides { Guiding::On } else { Guiding::Off };
    }
}

/// Where the noise comes from, if that is asked for and there is a reference. Takes the time that it takes.
fn classes_of(
    renderers: &mut Renderers,
    base: &RenderOptions,
    request: &Request,
    study: &mut Study,
) -> Result<Option<Classes>> {
    let (Some(paths), Some(reference)) = (request.classes, &study.reference) else { return Ok(None) };
    renderers.budget = Duration::from_secs(u32::MAX.into());
    match classes::measure(renderers, base, reference, paths) {
        Err(Halt::Failed(error)) => Err(error),
        Err(Halt::Interrupted | Halt::Budget) => {
            study.interrupted = true;
            Ok(None)
        }
        Ok(classes) => Ok(Some(classes)),
    }
}

impl Study {
    fn measure(&mut self, renderers: &mut Renderers, base: &RenderOptions) -> Result<(), Halt> {
        self.fly_pilot(renderers, base)?;
        let per_spp = self.choose_samples(renderers)?;
        if self.reference.is_none() {
            self.render_reference(renderers, base, per_spp)?;
        }
        self.go_rounds(renderers, base, ROUNDS_UNTIL)?;
        self.measure_prices(renderers, base)?;
        // What the prices left.
        self.go_rounds(renderers, base, 1.0)
    }

    fn measure_effects(&mut self, renderers: &mut Renderers, scene: &Scene, base: &RenderOptions) -> Result<(), Halt> {
        self.list_effects(scene, base);
        self.fly_pilot(renderers, base)?;
        self.price_effects(renderers, scene, base, EFFECTS_UNTIL)?;
        self.measure_prices(renderers, base)
    }

    /// One seed, so that each run contains the samples of the one before, as the looks at a running render do.
    fn fly_pilot(&mut self, renderers: &mut Renderers, base: &RenderOptions) -> Result<(), Halt> {
        let mut tail = None;
        renderers.render(base, base.seed, LEAST_SPP / 2, "pilot")?;
        let mut spp = LEAST_SPP;
        while self.pilot.len() < 3 || renderers.share() < PILOT_UNTIL {
            let (render, _) = renderers.render(base, base.seed, spp, "pilot")?;
            tail = render.film.tail().map(|tail| tail.verdict());
            let begun = Instant::now();
            if let Some(estimate) = render.film.error_estimate() {
                self.estimate_s = Some(begun.elapsed().as_secs_f64());
                let seconds = render.render_time.as_secs_f64();
                let (relmse, relmse_interval) = (estimate.relmse, estimate.interval);
                let relmse_at_least = relmse_interval[0];
                self.pilot.push(Point { spp, seconds, relmse, relmse_interval, relmse_at_least });
                self.prediction = predict::fit_with(&self.pilot, self.fixed_s, SlopePrior::of(base.sampler));
            } else if spp > LEAST_SPP {
                break;
            }
            spp *= 2;
        }
        let prediction = self.prediction;
        let price =
            |error| prediction.map(|p| Price { error, predicted: p.for_error(error).under(tail), measured: None });
        self.prices = TARGETS.into_iter().filter_map(price).collect();
        Ok(())
    }

    /// Renders every setting once and chooses how many samples the rounds can afford. Returns the wall time of a sample
    /// of the default setting.
    fn choose_samples(&mut self, renderers: &mut Renderers) -> Result<f64, Halt> {
        let mut costs = Vec::new();
        for series in &self.series {
            let setting = &series.setting;
            let (render, _) = renderers.render(&setting.options, setting.options.seed, WARM_UP_SPP, "warm-up")?;
            costs.push(render.render_time.as_secs_f64().max(1e-6));
        }
        let per_spp = self.prediction.map_or(costs[0] / WARM_UP_SPP as f64, |p| p.seconds_per_spp);
        let round = |top: u64| -> f64 {
            let seconds = |(series, cost): (&Series, &f64)| {
                let levels = levels(series.setting.role, top);
                let spp: u64 = levels.iter().map(|(_, spp)| spp).sum();
                2.0 * (per_spp * cost / costs[0] * spp as f64 + RUN_OVERHEAD_S * levels.len() as f64)
            };
            // And the run of the path lengths.
            self.series.iter().zip(&costs).map(seconds).sum::<f64>() + 2.0 * per_spp * top as f64
        };
        let reference = |top: u64| (REFERENCE_RUNS * REFERENCE_FACTOR * top) as f64 * per_spp;
        let end = ROUNDS_UNTIL * renderers.budget.as_secs_f64();
        let left = end - renderers.elapsed_s();
        let mut top = 2 * LEAST_SPP;
        while ROUNDS * round(2 * top) + reference(2 * top) < left && top < 1 << 14 {
            top *= 2;
        }
        self.top_spp = top;
        Ok(per_spp)
    }

    fn render_reference(&mut self, renderers: &mut Renderers, base: &RenderOptions, per_spp: f64) -> Result<(), Halt> {
        let budget = renderers.budget.as_secs_f64();
        let mut spp = REFERENCE_FACTOR * self.top_spp;
        let share = |spp: u64| (REFERENCE_RUNS * spp) as f64 * per_spp / budget;
        while share(2 * spp) < REFERENCE_SHARE {
            spp *= 2;
        }
        while share(spp) > MOST_REFERENCE_SHARE && spp > self.top_spp {
            spp /= 2;
        }
        let options = RenderOptions { max_depth: deep(base), ..base.clone() };
        let mut pictures = Vec::new();
        let what = format!("reference: {REFERENCE_RUNS} runs of {spp} spp");
        for run in 0..REFERENCE_RUNS {
            let (render, _) = renderers.render(&options, reference_seed(base.seed).wrapping_add(run), spp, &what)?;
            pictures.push(values(&render.film));
        }
        self.reference = Some(Reference::of_runs(&pictures));
        self.reference_spp = spp;
        Ok(())
    }

    fn measure_prices(&mut self, renderers: &mut Renderers, base: &RenderOptions) -> Result<(), Halt> {
        for (target, price) in self.prices.iter_mut().enumerate() {
            let spp = (price.predicted.spp.ceil() as u64).next_multiple_of(2).max(2);
            let left = renderers.budget.as_secs_f64() - renderers.elapsed_s();
            if price.predicted.seconds - self.fixed_s > left {
                break;
            }
            let what = format!("price of {} %", 100.0 * price.error);
            let meter = Meter::start();
            let (render, _) = renderers.render(base, price_seed(base.seed, target), spp, &what)?;
            let joules = meter.and_then(|meter| meter.joules());
            let picture = values(&render.film);
            let estimate = render.film.error_estimate();
            price.measured = Some(Measured {
                spp,
                seconds: self.fixed_s + render.render_time.as_secs_f64(),
                relmse: self.reference.as_ref().map(|r| r.difference(&picture).relmse),
                estimated: estimate.map(|e| (e.relmse, e.interval)),
                joules,
            });
            self.price_pictures.push(picture);
        }
        Ok(())
    }
}
