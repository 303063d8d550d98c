//! The scene's own rays: a backend that stands before another, passes every call on and keeps copies of the rays of
//! some whole waves, batch by batch, as the wavefront handed them over.
//!
//! A wave begins with the camera rays of a thread (the only closest-hit rays with the coherent hint) and holds all that
//! follows on that thread until the next. Every `stride`-th wave is kept; when the copies exceed the budget, every
//! second kept one is dropped and the stride doubles, so the kept waves stay spread evenly over the frame.

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::thread::ThreadId;

use crate::backend::batch::{RayBlock, RayHitBlock};
use crate::backend::past::Past;
use crate::backend::{Backend, BackendInfo, Coherence};
use crate::error::Result;
use crate::render::{Render, Renderer};

/// What a ray is traced for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(usize)]
pub enum RayClass {
    /// From the camera.
    Camera = 0,
    /// After a scattering.
    Bounce = 1,
    /// Towards a light sample.
    Shadow = 2,
}

impl RayClass {
    /// Every class, in the order of the reports.
    pub const ALL: [RayClass; 3] = [RayClass::Camera, RayClass::Bounce, RayClass::Shadow];

    /// Spelling in reports and in the names of benches.
    pub fn name(self) -> &'static str {
        match self {
            RayClass::Camera => "camera",
            RayClass::Bounce => "bounce",
            RayClass::Shadow => "shadow",
        }
    }
}

/// The rays of one call, before they were traced.
#[derive(Clone, Debug)]
pub struct Batch {
    /// What they are traced for; [`RayClass::Shadow`] asks for any hit, the others for the closest.
    pub class: RayClass,
    /// The hint of the call.
    pub hint: Coherence,
    /// The rays; lanes past `len` are not to be traced.
    pub rays: Vec<RayBlock>,
    /// Rays of the batch.
    pub len: usize,
}

/// One wave: the calls of its edges in order.
pub type Wave = Vec<Batch>;

/// Rays of a frame, and how many of its waves they are.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The kept waves in the order of their beginning.
    pub waves: Vec<Wave>,
    /// One wave of `stride` was kept.
    pub stride: u64,
}

impl Recording {
    /// Renders with `renderer` and keeps rays of at most about `budget_bytes`.
    ///
    /// # Errors
    /// Those of the render.
    pub fn of(renderer: &Renderer, budget_bytes: usize) -> Result<(Recording, Render)> {
        let recorder = Recorder::new(renderer.backend(), budget_bytes);
        let render = renderer.render_through(&recorder, |_| ControlFlow::Continue(()))?;
        Ok((recorder.finish(), render))
    }

    /// Rays by class.
    pub fn rays(&self) -> [u64; 3] {
        count(&self.waves)
    }

    /// Whole waves, spread evenly, that hold at least `rays` of each class (or all waves).
    pub fn sample(&self, rays: u64) -> Vec<&[Batch]> {
        let least = self.rays().into_iter().filter(|&n| n > 0).min().unwrap_or(0);
        let step = (least / rays.max(1)).max(1) as usize;
        self.waves.iter().step_by(step).map(Vec::as_slice).collect()
    }
}

/// Rays by class in some waves.
pub fn count<W: AsRef<[Batch]>>(waves: &[W]) -> [u64; 3] {
    let mut rays = [0; 3];
    for batch in waves.iter().flat_map(|wave| wave.as_ref()) {
        rays[batch.class as usize] += batch.len as u64;
    }
    rays
}

/// The wave that a thread is tracing.
struct Open {
    number: u64,
    batches: Wave,
}

#[derive(Default)]
struct State {
    /// Waves begun.
    begun: u64,
    stride: u64,
    bytes: usize,
    open: HashMap<ThreadId, Open>,
    kept: Vec<(u64, Wave)>,
}

impl State {
    fn keep(&mut self, wave: Open, budget_bytes: usize) {
        if !wave.number.is_multiple_of(self.stride) {
            return;
        }
        self.bytes += bytes_of(&wave.batches);
        self.kept.push((wave.number, wave.batches));
        while self.bytes > budget_bytes && self.kept.len() > 1 {
            self.stride *= 2;
            let stride = self.stride;
            self.kept.retain(|(number, _)| number.is_multiple_of(stride));
            self.bytes = self.kept.iter().map(|(_, wave)| bytes_of(wave)).sum();
        }
    }
}

fn bytes_of(wave: &Wave) -> usize {
    wave.iter().map(|batch| size_of_val(batch.rays.as_slice())).sum()
}

/// The recording backend. Its lock is taken once a batch: rates of a render through it say nothing.
struct Recorder<'b> {
    inner: &'b dyn Backend,
    budget_bytes: usize,
    state: Mutex<State>,
}

impl<'b> Recorder<'b> {
    fn new(inner: &'b dyn Backend, budget_bytes: usize) -> Self {
        Recorder { inner, budget_bytes, state: Mutex::new(State { stride: 1, ..State::default() }) }
    }

    fn finish(self) -> Recording {
        let mut state = self.state.into_inner().expect("no worker panicked");
        for wave in std::mem::take(&mut state.open).into_values() {
            state.keep(wave, self.budget_bytes);
        }
        state.kept.sort_by_key(|(number, _)| *number);
        Recording { waves: state.kept.into_iter().map(|(_, wave)| wave).collect(), stride: state.stride }
    }

    fn record(&self, class: RayClass, hint: Coherence, len: usize, rays: impl FnOnce() -> Vec<RayBlock>) {
        let mut state = self.state.lock().expect("no worker panicked");
        let thread = std::thread::current().id();
        if class == RayClass::Camera {
            let wave = Open { number: state.begun, batches: Wave::new() };
            state.begun += 1;
            if let Some(finished) = state.open.insert(thread, wave) {
                state.keep(finished, self.budget_bytes);
            }
        }
        let stride = state.stride;
        if let Some(wave) = state.open.get_mut(&thread).filter(|wave| wave.number.is_multiple_of(stride)) {
            wave.batches.push(Batch { class, hint, rays: rays(), len });
        }
    }
}

impl Backend for Recorder<'_> {
    fn info(&self) -> &BackendInfo {
        self.inner.info()
    }

    fn closest_hit(&self, blocks: &mut [RayHitBlock], len: usize, hint: Coherence) -> u64 {
        let class = if hint == Coherence::Coherent { RayClass::Camera } else { RayClass::Bounce };
        self.record(class, hint, len, || blocks.iter().map(|block| block.ray).collect());
        self.inner.closest_hit(blocks, len, hint)
    }

    /// Rays that go on are not kept: a recording holds what was traced first.
    fn closest_hit_past(&self, blocks: &mut [RayHitBlock], len: usize, past: &Past) -> u64 {
        self.inner.closest_hit_past(blocks, len, past)
    }

    fn any_hit(&self, blocks: &mut [RayBlock], len: usize, hint: Coherence) -> u64 {
        self.record(RayClass::Shadow, hint, len, || blocks.to_vec());
        self.inner.any_hit(blocks, len, hint)
    }
}
