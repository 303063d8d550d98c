//! The renderers of a study, one for each way to trace, under its clock: every render is watched by the observer and by
//! the budget of wall time, and ends the study where either says so.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use super::clock::{Cost, Stopwatch};
use super::settings::backend_of;
use crate::error::{Error, Result};
use crate::render::{Render, RenderOptions, Renderer};
use crate::scene::Scene;

/// A render that runs on past this multiple of the budget is broken off.
const OVERRUN: f64 = 1.12;

/// What is going on; handed to the observer a few times a second.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    /// In words.
    pub what: &'a str,
    /// Since `started`.
    pub elapsed: Duration,
}

/// Why the measurement ends before its end.
pub(super) enum Halt {
    Interrupted,
    Budget,
    Failed(Error),
}

impl From<Error> for Halt {
    fn from(error: Error) -> Self {
        Halt::Failed(error)
    }
}

/// The renderers of a study, one for each way to trace, and its clock.
pub(super) struct Renderers<'a, 'o> {
    scene: &'a Scene,
    built: Vec<Renderer<'a>>,
    /// The beginning of the study.
    pub(super) started: Instant,
    /// Wall time from then on.
    pub(super) budget: Duration,
    observe: &'o mut dyn FnMut(&Step) -> ControlFlow<()>,
}

impl<'a, 'o> Renderers<'a, 'o> {
    /// None is built yet.
    pub(super) fn new(
        scene: &'a Scene,
        started: Instant,
        budget: Duration,
        observe: &'o mut dyn FnMut(&Step) -> ControlFlow<()>,
    ) -> Self {
        Renderers { scene, built: Vec::new(), started, budget, observe }
    }

    /// Seconds since the study began.
    pub(super) fn elapsed_s(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// Share of the budget that is gone.
    pub(super) fn share(&self) -> f64 {
        self.elapsed_s() / self.budget.as_secs_f64()
    }

    /// The renderer that traces as `options` want it, built when first asked for.
    pub(super) fn renderer(&mut self, options: &RenderOptions) -> Result<&Renderer<'a>> {
        let place = self.place(options)?;
        Ok(&self.built[place])
    }

    fn place(&mut self, options: &RenderOptions) -> Result<usize> {
        let fits = |r: &Renderer| r.plan().backend == backend_of(options) && r.plan().robust == options.robust;
        if let Some(place) = self.built.iter().position(fits) {
            return Ok(place);
        }
        self.built.push(Renderer::new(self.scene, options.clone())?);
        Ok(self.built.len() - 1)
    }

    /// Shows the observer what goes on between renders.
    pub(super) fn look(&mut self, what: &str) -> ControlFlow<()> {
        (self.observe)(&Step { what, elapsed: self.started.elapsed() })
    }

    /// Renders `options` with another seed and number of samples, and tells what that took.
    pub(super) fn render(
        &mut self,
        options: &RenderOptions,
        seed: u64,
        spp: u64,
        what: &str,
    ) -> Result<(Render, Cost), Halt> {
        let options = RenderOptions { seed, spp: Some(spp), ..options.clone() };
        let place = self.place(&options)?;
        self.built[place].retarget(&options)?;
        let Renderers { built, scene, started, budget, observe } = self;
        watched((&built[place], scene), (*started, *budget), observe, what)
    }

    /// The same, of a renderer of another scene.
    pub(super) fn watched(&mut self, renderer: &Renderer, what: &str) -> Result<(Render, Cost), Halt> {
        watched((renderer, renderer.scene()), (self.started, self.budget), self.observe, what)
    }
}

/// Renders, under the clock and the observer of a study.
fn watched(
    (renderer, scene): (&Renderer, &Scene),
    (started, budget): (Instant, Duration),
    observe: &mut dyn FnMut(&Step) -> ControlFlow<()>,
    what: &str,
) -> Result<(Render, Cost), Halt> {
    let limit = budget.mul_f64(OVERRUN);
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
    render.check_fault()?;
    scene.check_textures()?;
    match halt {
        Some(halt) => Err(halt),
        None => Ok((render, cost)),
    }
}
