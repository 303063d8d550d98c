//! The measurement behind `pathspace accuracy`: what is rendered, in which order, within a budget of wall time.
//!
//! * Pilot: one seed, 4, 8, 16, … samples; fits the price list.
//! * Warm-up: every setting once; sets the numbers of samples, and is left out of every result by that rule.
//! * Reference: eight long runs with seeds of their own.
//! * Rounds: every setting in order and then in reverse order, so that a drift of the machine that is linear over a round
//!   falls on all settings alike. Within a round all settings use the same seeds and are compared on the same paths.
//! * The price list's targets, cheapest first, while time is left; then more rounds.
//!
//! Stopping early, by the budget or by the observer, keeps every finished run. Limit: techniques and knobs need two rounds
//! for an interval at all; a budget that is too small says so in the intervals.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use super::clock::{Cost, Stopwatch};
use super::reference::{Difference, Reference, values};
use super::settings::{self, Role, Setting, backend_of};
use crate::accuracy::flip;
use crate::accuracy::predict::{self, Point, Predicted, Prediction, SlopePrior};
use crate::error::{Error, Result};
use crate::film::Film;
use crate::film::lengths::LENGTHS;
use crate::render::{Render, RenderOptions, Renderer, SamplerKind};
use crate::scene::Scene;

/// Targets of the price list, relative RMSE.
pub const TARGETS: [f64; 5] = [0.10, 0.05, 0.02, 0.01, 0.005];

/// Runs that the reference is the mean of.
const REFERENCE_RUNS: u64 = 8;

/// A run of the reference has this many times the samples of the largest runs that are held against it, or more; fewer
/// where the budget is too small for that.
const REFERENCE_FACTOR: u64 = 4;

/// Rounds that the numbers of samples are chosen for. Machines that also do other things manage fewer; time that is left
/// goes into more.
const ROUNDS: f64 = 6.0;

/// More rounds than this say little more.
const MOST_ROUNDS: usize = 12;

/// Shares of the budget, from its start: end of the pilot, of the rounds; and the share that the reference may take.
const PILOT_UNTIL: f64 = 0.06;
const ROUNDS_UNTIL: f64 = 0.8;
const REFERENCE_SHARE: f64 = 0.2;
const MOST_REFERENCE_SHARE: f64 = 0.35;

/// A render that runs on past this multiple of the budget is broken off.
const OVERRUN: f64 = 1.12;

/// Samples of the warm-up, and fewest samples of a run that is measured.
const WARM_UP_SPP: u64 = 8;
const LEAST_SPP: u64 = 4;

/// Numbers of samples at which techniques are followed: this many, each half of the next.
const LEVELS: u32 = 5;

/// Wall time of a run beyond its samples: passes begin and end.
const RUN_OVERHEAD_S: f64 = 0.01;

/// Bytes of pictures that are kept for the biases.
const MOST_BYTES: usize = 1 << 29;

/// Pixels of the largest picture that is studied.
pub const MOST_PIXELS: u64 = 1 << 18;

/// What is to be studied.
#[derive(Clone, Debug)]
pub struct Request {
    /// The default setting: picture, seed, threads. Its limits are not looked at.
    pub base: RenderOptions,
    /// Wall time for everything, from `started` of [`run`].
    pub budget: Duration,
    /// All combinations of techniques instead of one factor at a time.
    pub full: bool,
    /// A given reference; `None` renders one.
    pub reference: Option<Reference>,
    /// Seconds that loading the scene took.
    pub load_s: f64,
}

/// One finished run of a setting.
#[derive(Clone, Debug)]
pub struct Run {
    /// Which of the setting's runs of this number of samples; equal numbers of all settings share a seed.
    pub index: usize,
    /// Samples per pixel.
    pub spp: u64,
    /// What it took.
    pub cost: Cost,
    /// How it differs from the reference.
    pub difference: Difference,
    /// HDR-FLIP against the reference: of the largest runs only.
    pub flip: Option<f64>,
    /// Samples that were not finite.
    pub nonfinite: u64,
    /// Paths ended by the depth limit.
    pub capped_paths: u64,
    /// Camera, bounce and shadow rays.
    pub rays: [u64; 3],
}

/// A setting and what was measured of it.
#[derive(Clone, Debug)]
pub struct Series {
    /// What was rendered.
    pub setting: Setting,
    /// Finished runs, in order of time.
    pub runs: Vec<Run>,
    /// Pictures of the runs with the most samples, by [`Run::index`].
    pub pictures: Vec<Vec<f32>>,
}

/// A target of the price list.
#[derive(Clone, Copy, Debug)]
pub struct Price {
    /// Relative RMSE.
    pub error: f64,
    /// What the pilot says it costs.
    pub predicted: Predicted,
    /// What a run of that many samples took and reached.
    pub measured: Option<Measured>,
}

/// A run for the price list.
#[derive(Clone, Copy, Debug)]
pub struct Measured {
    /// Samples per pixel.
    pub spp: u64,
    /// Wall time in all, fixed costs included.
    pub seconds: f64,
    /// relMSE against the reference, the reference's own subtracted; `None` without a reference.
    pub relmse: Option<f64>,
    /// The film's own estimate of its relMSE and its 95 % interval.
    pub estimated: Option<(f64, [f64; 2])>,
}

/// Everything that was measured.
#[derive(Debug)]
pub struct Study {
    /// Load and build of the default setting, seconds.
    pub fixed_s: f64,
    /// Points of the pilot.
    pub pilot: Vec<Point>,
    /// What they say.
    pub prediction: Option<Prediction>,
    /// The price list.
    pub prices: Vec<Price>,
    /// What everything is held against.
    pub reference: Option<Reference>,
    /// Samples per pixel of each run of the reference; 0 for a given one.
    pub reference_spp: u64,
    /// The default first, then techniques and knobs.
    pub series: Vec<Series>,
    /// Mean radiance by number of edges, a run each ([`LENGTHS`] entries; the last holds all longer paths).
    pub lengths: Vec<[f64; LENGTHS]>,
    /// Samples per pixel of the largest runs.
    pub top_spp: u64,
    /// Finished rounds of two runs.
    pub rounds: usize,
    /// Wall time of the last of them.
    pub round_s: f64,
    /// The first of the largest runs of the default setting.
    pub film: Option<Film>,
    /// Whether the observer broke it off.
    pub interrupted: bool,
    /// Wall time from `started` to the last run.
    pub seconds: f64,
}

/// What is going on; handed to the observer a few times a second.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    /// In words.
    pub what: &'a str,
    /// Since `started`.
    pub elapsed: Duration,
}

/// Why the measurement ends before its end.
enum Halt {
    Interrupted,
    Budget,
    Failed(Error),
}

impl From<Error> for Halt {
    fn from(error: Error) -> Self {
        Halt::Failed(error)
    }
}

/// Seeds: the reference's lie 2³² above those of the runs, the price list's 2³³.
fn run_seed(base: u64, level: u32, index: usize) -> u64 {
    base.wrapping_add(1 + u64::from(level) * 4096 + index as u64)
}

/// First seed of the reference.
pub fn reference_seed(base: u64) -> u64 {
    base.wrapping_add(1 << 32)
}

fn price_seed(base: u64, target: usize) -> u64 {
    base.wrapping_add((1 << 33) + target as u64)
}

/// Runs the study. `observe` is called during every render and ends the study by breaking off.
///
/// # Errors
/// Those of [`Renderer::new`]; [`Error::Option`] for more pixels than [`MOST_PIXELS`] and for a reference of another size.
pub fn run(
    scene: &Scene,
    request: &Request,
    started: Instant,
    observe: &mut dyn FnMut(&Step) -> ControlFlow<()>,
) -> Result<Study> {
    let mut base = request.base.clone();
    (base.spp, base.time, base.error) = (None, None, None);
    let mut bench = Bench { scene, renderers: Vec::new(), started, budget: request.budget, observe };
    let first = bench.renderer(&base)?;
    let (window, build) = (bench.renderers[first].plan().window, bench.renderers[first].build_time());
    let pixels = u64::from(window.width) * u64::from(window.height);
    if pixels > MOST_PIXELS {
        let problem = format!("{pixels} pixels; a study takes at most {MOST_PIXELS} (its pictures are kept in memory)");
        return Err(Error::Option { option: "--width", problem });
    }
    if request.reference.as_ref().is_some_and(|r| r.values.len() as u64 != 3 * pixels) {
        let problem = format!("it must have the size of the picture, {}x{}", window.width, window.height);
        return Err(Error::Option { option: "--reference", problem });
    }
    let mut list = settings::techniques(&base, request.full);
    list.extend(settings::knobs(&base, bench.renderers[first].plan().features.textures));
    let series = list.into_iter().map(|setting| Series { setting, runs: Vec::new(), pictures: Vec::new() }).collect();
    let fixed_s = request.load_s + build.as_secs_f64();
    let mut study = Study {
        fixed_s,
        pilot: Vec::new(),
        prediction: None,
        prices: Vec::new(),
        reference: request.reference.clone(),
        reference_spp: 0,
        series,
        lengths: Vec::new(),
        top_spp: 0,
        rounds: 0,
        round_s: 0.0,
        film: None,
        interrupted: false,
        seconds: 0.0,
    };
    match study.measure(&mut bench, &base) {
        Err(Halt::Failed(error)) => return Err(error),
        Err(Halt::Interrupted) => study.interrupted = true,
        Ok(()) | Err(Halt::Budget) => {}
    }
    study.seconds = started.elapsed().as_secs_f64();
    Ok(study)
}

impl Study {
    fn measure(&mut self, bench: &mut Bench, base: &RenderOptions) -> Result<(), Halt> {
        self.fly_pilot(bench, base)?;
        let per_spp = self.choose_samples(bench)?;
        if self.reference.is_none() {
            self.render_reference(bench, base, per_spp)?;
        }
        self.go_rounds(bench, base, ROUNDS_UNTIL)?;
        self.measure_prices(bench, base)?;
        // What the prices left.
        self.go_rounds(bench, base, 1.0)
    }

    /// One seed, so that each run contains the samples of the one before, as the looks at a running render do.
    fn fly_pilot(&mut self, bench: &mut Bench, base: &RenderOptions) -> Result<(), Halt> {
        bench.render(base, base.seed, LEAST_SPP / 2, "pilot")?;
        let mut spp = LEAST_SPP;
        while self.pilot.len() < 3 || bench.share() < PILOT_UNTIL {
            let (render, _) = bench.render(base, base.seed, spp, "pilot")?;
            if let Some(estimate) = render.film.error_estimate() {
                let seconds = render.render_time.as_secs_f64();
                let (relmse, relmse_interval) = (estimate.relmse, estimate.interval);
                self.pilot.push(Point { spp, seconds, relmse, relmse_interval });
                let prior = match base.sampler {
                    SamplerKind::Sobol => SlopePrior::SOBOL,
                    SamplerKind::Independent => SlopePrior::INDEPENDENT,
                };
                self.prediction = predict::fit_with(&self.pilot, self.fixed_s, prior);
            } else if spp > LEAST_SPP {
                break;
            }
            spp *= 2;
        }
        let prediction = self.prediction;
        let price = |error| prediction.map(|p| Price { error, predicted: p.for_error(error), measured: None });
        self.prices = TARGETS.into_iter().filter_map(price).collect();
        Ok(())
    }

    /// Renders every setting once and chooses how many samples the rounds can afford. Returns the wall time of a sample of
    /// the default setting.
    fn choose_samples(&mut self, bench: &mut Bench) -> Result<f64, Halt> {
        let mut costs = Vec::new();
        for series in &self.series {
            let setting = &series.setting;
            let (render, _) = bench.render(&setting.options, setting.options.seed, WARM_UP_SPP, "warm-up")?;
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
        let end = ROUNDS_UNTIL * bench.budget.as_secs_f64();
        let left = end - bench.started.elapsed().as_secs_f64();
        let mut top = 2 * LEAST_SPP;
        while ROUNDS * round(2 * top) + reference(2 * top) < left && top < 1 << 14 {
            top *= 2;
        }
        self.top_spp = top;
        Ok(per_spp)
    }

    fn render_reference(&mut self, bench: &mut Bench, base: &RenderOptions, per_spp: f64) -> Result<(), Halt> {
        let budget = bench.budget.as_secs_f64();
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
            let (render, _) = bench.render(&options, reference_seed(base.seed).wrapping_add(run), spp, &what)?;
            pictures.push(values(&render.film));
        }
        self.reference = Some(Reference::of_runs(&pictures));
        self.reference_spp = spp;
        Ok(())
    }

    fn go_rounds(&mut self, bench: &mut Bench, base: &RenderOptions, until: f64) -> Result<(), Halt> {
        let bytes = self.series.len() * 2 * 4 * self.reference.as_ref().map_or(0, |r| r.values.len());
        let most = MOST_ROUNDS.min(MOST_BYTES / bytes.max(1)).max(1);
        let end = until * bench.budget.as_secs_f64();
        let mut last = self.round_s;
        while self.rounds < most && (self.rounds == 0 || bench.started.elapsed().as_secs_f64() + last < end) {
            let begun = Instant::now();
            for (half, order) in [false, true].into_iter().enumerate() {
                let index = 2 * self.rounds + half;
                let what = format!("round {} at up to {} spp", self.rounds + 1, self.top_spp);
                let n = self.series.len();
                for i in (0..n).map(|i| if order { n - 1 - i } else { i }) {
                    self.visit(bench, i, index, &what)?;
                }
                let deep = RenderOptions { max_depth: deep(base), per_length: true, ..base.clone() };
                let (render, _) = bench.render(&deep, run_seed(base.seed, 0, index), self.top_spp, &what)?;
                self.lengths.extend(length_means(&render));
            }
            self.rounds += 1;
            last = begun.elapsed().as_secs_f64();
            self.round_s = last;
        }
        Ok(())
    }

    /// Renders one setting at its numbers of samples.
    fn visit(&mut self, bench: &mut Bench, i: usize, index: usize, what: &str) -> Result<(), Halt> {
        let series = &mut self.series[i];
        let reference = self.reference.as_ref().expect("rounds begin with a reference");
        let options = &series.setting.options;
        for (level, spp) in levels(series.setting.role, self.top_spp) {
            let (render, cost) = bench.render(options, run_seed(options.seed, level, index), spp, what)?;
            let picture = values(&render.film);
            let width = render.film.window.width as usize;
            let counters = &render.counters;
            series.runs.push(Run {
                index,
                spp,
                cost,
                difference: reference.difference(&picture),
                flip: (level == 0).then(|| flip::hdr_flip(&pixels(&picture), &pixels_f64(&reference.values), width)),
                nonfinite: counters.nonfinite,
                capped_paths: counters.capped_paths,
                rays: [counters.rays_camera, counters.rays_bounce, counters.rays_shadow],
            });
            if level == 0 {
                series.pictures.push(picture);
                if i == 0 && self.film.is_none() {
                    self.film = Some(render.film);
                }
            }
        }
        Ok(())
    }

    fn measure_prices(&mut self, bench: &mut Bench, base: &RenderOptions) -> Result<(), Halt> {
        for (target, price) in self.prices.iter_mut().enumerate() {
            let spp = (price.predicted.spp.ceil() as u64).next_multiple_of(2).max(2);
            let left = bench.budget.as_secs_f64() - bench.started.elapsed().as_secs_f64();
            if price.predicted.seconds - self.fixed_s > left {
                break;
            }
            let what = format!("price of {} %", 100.0 * price.error);
            let (render, _) = bench.render(base, price_seed(base.seed, target), spp, &what)?;
            let estimate = render.film.error_estimate();
            price.measured = Some(Measured {
                spp,
                seconds: self.fixed_s + render.render_time.as_secs_f64(),
                relmse: self.reference.as_ref().map(|r| r.difference(&values(&render.film)).relmse),
                estimated: estimate.map(|e| (e.relmse, e.interval)),
            });
        }
        Ok(())
    }
}

/// Depth at which truncation no longer matters for the reference and the path lengths.
fn deep(base: &RenderOptions) -> u32 {
    base.max_depth.max(RenderOptions::default().max_depth)
}

/// Numbers of samples of a setting's runs, the largest last; level 0 is the largest.
fn levels(role: Role, top: u64) -> Vec<(u32, u64)> {
    let count = if role == Role::Knob { 1 } else { LEVELS };
    let all = (0..count).rev().map(|level| (level, top >> level));
    all.filter(|(_, spp)| *spp >= LEAST_SPP).collect()
}

fn length_means(render: &Render) -> Option<[f64; LENGTHS]> {
    let lengths = render.lengths.as_ref()?;
    let pixels = lengths.sums.len() as f64;
    Some(std::array::from_fn(|edge| lengths.image(edge).iter().flatten().sum::<f64>() / (3.0 * pixels)))
}

fn pixels(values: &[f32]) -> Vec<[f32; 3]> {
    values.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect()
}

fn pixels_f64(values: &[f64]) -> Vec<[f32; 3]> {
    values.chunks_exact(3).map(|p| [p[0] as f32, p[1] as f32, p[2] as f32]).collect()
}

/// The renderers of a study, one for each way to trace, and its clock.
struct Bench<'a, 'o> {
    scene: &'a Scene,
    renderers: Vec<Renderer<'a>>,
    started: Instant,
    budget: Duration,
    observe: &'o mut dyn FnMut(&Step) -> ControlFlow<()>,
}

impl<'a> Bench<'a, '_> {
    /// Share of the budget that is gone.
    fn share(&self) -> f64 {
        self.started.elapsed().as_secs_f64() / self.budget.as_secs_f64()
    }

    /// Place of the renderer that traces as `options` want it, built when first asked for.
    fn renderer(&mut self, options: &RenderOptions) -> Result<usize> {
        let fits = |r: &Renderer| r.plan().backend == backend_of(options) && r.plan().robust == options.robust;
        if let Some(place) = self.renderers.iter().position(fits) {
            return Ok(place);
        }
        self.renderers.push(Renderer::new(self.scene, options.clone())?);
        Ok(self.renderers.len() - 1)
    }

    fn render(&mut self, options: &RenderOptions, seed: u64, spp: u64, what: &str) -> Result<(Render, Cost), Halt> {
        let options = RenderOptions { seed, spp: Some(spp), ..options.clone() };
        let (started, limit) = (self.started, self.budget.mul_f64(OVERRUN));
        let place = self.renderer(&options)?;
        self.renderers[place].retarget(&options)?;
        let (renderer, observe) = (&self.renderers[place], &mut *self.observe);
        let mut halt = None;
        let watch = Stopwatch::start();
        let render = renderer.render_with(|_| {
            let elapsed = started.elapsed();
            if observe(&Step { what, elapsed }).is_break() {
                halt = Some(Halt::Interrupted);
            } else if elapsed > limit {
                halt = Some(Halt::Budget);
            }
            if halt.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })?;
        let cost = watch.cost();
        match halt {
            Some(halt) => Err(halt),
            None => Ok((render, cost)),
        }
    }
}
