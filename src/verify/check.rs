//! The check itself: solves, traces, compares.

use std::time::Instant;

use rayon::prelude::*;

use super::compare::{self, Comparison, Estimates};
use super::gather::{self, Pixel, Radiances};
use super::operator::{Operator, Series};
use super::options::VerifyOptions;
use super::patches::{self, Patches, SOLUTIONS, refusal};
use crate::backend::{self, Backend, BackendKind, BackendOptions};
use crate::camera::CameraRays;
use crate::error::{Error, Result};
use crate::film::layer::bounces::LENGTHS;
use crate::machine;
use crate::plan::options::{CameraChoice, FilterKind, RenderOptions};
use crate::render::Renderer;
use crate::scene::Scene;
use crate::scene::geometry::Geometry;

/// What a check found.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Verification {
    /// Patches of the three solutions, the coarsest first.
    pub patches: [usize; SOLUTIONS],
    /// Samples per pixel of the path tracer, over both of its runs; where the time was over, of the pixel that has
    /// fewest.
    pub spp: u64,
    /// Term by term; see [`compare::judge`] for their order.
    pub comparisons: Vec<Comparison>,
    /// Spectral radius of KG as the light that the camera sees feels it: the late ratio of consecutive terms of the
    /// picture, by channel.
    pub spectral_radius: [f64; 3],
    /// Share of the picture's energy in paths longer than the depth limit, by the solver.
    pub beyond_depth: f64,
    /// Largest sum of a row of the finest solution: 1 in a closed convex room; shadow edges that are resolved to a node
    /// put it a little off.
    pub largest_row: f64,
}

impl Verification {
    /// Whether every term agrees.
    pub fn agrees(&self) -> bool {
        self.comparisons.iter().all(Comparison::agrees)
    }
}

/// The solver's side, for one number of patches.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Solution {
    /// Patches in the order of the scene.
    pub patches: Patches,
    /// Radiance of every node by number of scatterings.
    pub series: Series,
    /// Largest sum of the form factors of a row.
    pub largest_row: f64,
}

/// Solves on about `count` patches, or on fewer of `FINEST / fineness` times their side.
///
/// # Errors
/// [`Error::InvalidScene`] naming what the solver does not know.
pub fn solve(scene: &Scene, backend: &dyn Backend, count: usize, fineness: u32) -> Result<Solution> {
    solve_until(scene, backend, (count, fineness), None)
}

fn solve_until(
    scene: &Scene,
    backend: &dyn Backend,
    (count, fineness): (usize, u32),
    deadline: Option<Instant>,
) -> Result<Solution> {
    let patches = Patches::of(scene, count, fineness)?;
    let operator = Operator::new(&patches, backend, deadline)
        .ok_or_else(|| too_short(format!("{} patches are not solved by then; fewer --patches", patches.len())))?;
    let series = Series::iterate(&operator, &patches);
    Ok(Solution { largest_row: operator.largest_row(), patches, series })
}

/// Runs the check on the scene's first camera.
///
/// # Errors
/// [`Error::InvalidScene`] for a scene that the solver does not know, naming the material; what [`Renderer::new`]
/// refuses; [`Error::Option`] where the time is too short.
pub fn verify(scene: &Scene, options: &VerifyOptions) -> Result<Verification> {
    patches::check(scene)?;
    let deadline = options.time.and_then(|time| Instant::now().checked_add(time));
    let geometry = Geometry::build(scene);
    let kind = options.backend.unwrap_or(BackendKind::available()[0]);
    let backend = backend::select::build(kind, &geometry, &BackendOptions::default())?;
    let camera = scene.cameras.first().ok_or_else(|| refusal(scene, "/cameras", "the scene has no camera".into()))?;
    let camera = CameraRays::new(camera, options.resolution, None)?;
    let pool = machine::pool(machine::threads(options.threads), "verify")
        .map_err(|e| Error::Option { option: "--threads", problem: e.to_string() })?;

    // The solver, on three sizes of patches.
    let pixels = gather::pixels(&camera, options.resolution, &geometry, scene, backend.as_ref());
    let mut solved = Vec::new();
    for fineness in 1..=patches::FINEST {
        let solution = pool.install(|| solve_until(scene, backend.as_ref(), (options.patches, fineness), deadline))?;
        let seen = pool.install(|| look(&pixels, &solution, options.max_depth, backend.as_ref()));
        solved.push((solution, seen));
    }
    let finest = &solved[SOLUTIONS - 1];

    // The path tracer, twice: independent seeds give each pixel's variance.
    let (first, least) = trace(scene, options, (0, deadline))?;
    let (second, also) = trace(scene, options, (1, deadline))?;
    let spp = least + also;
    let estimates = Estimates::new(&[first, second], spp, patches::brightest(scene));

    let seen: [&[Radiances]; SOLUTIONS] = std::array::from_fn(|i| solved[i].1.as_slice());
    Ok(Verification {
        patches: std::array::from_fn(|i| solved[i].0.patches.len()),
        spp,
        comparisons: compare::judge(&seen, &estimates, options),
        spectral_radius: gather::late_ratio(&finest.1),
        beyond_depth: gather::share_beyond(&finest.1, options.max_depth),
        largest_row: finest.0.largest_row,
    })
}

/// Radiance by length along every pixel's ray.
fn look(pixels: &[Pixel], solution: &Solution, max_depth: u32, backend: &dyn Backend) -> Vec<Radiances> {
    let sources = gather::sources(&solution.series, max_depth);
    pixels.par_iter().map(|pixel| gather::radiances(pixel, &sources, &solution.patches, backend)).collect()
}

/// Per pixel the mean radiance by number of edges, index 0 unused, the last the tail.
type Lengths = Vec<[[f64; 3]; LENGTHS]>;

/// One of the two runs of the path tracer, and the samples of the pixel that has fewest.
fn trace(scene: &Scene, options: &VerifyOptions, (run, deadline): (u64, Option<Instant>)) -> Result<(Lengths, u64)> {
    let (width, height) = options.resolution;
    let left = deadline.map(|deadline| deadline.saturating_duration_since(Instant::now()));
    let render = RenderOptions {
        spp: Some(options.spp.div_ceil(2)),
        time: left.map(|left| left / if run == 0 { 2 } else { 1 }),
        camera: CameraChoice::First,
        // Seeds of different checks must not meet.
        seed: options.seed.wrapping_mul(2).wrapping_add(run),
        threads: options.threads,
        filter: FilterKind::Point,
        max_depth: options.max_depth,
        backend: options.backend,
        per_length: true,
        ..RenderOptions::new(width, height)
    };
    let render = Renderer::new(scene, render)?.render()?;
    let least = render.film.spp().min;
    if least == 0 {
        return Err(too_short("pixels without a sample are left".into()));
    }
    let lengths = render.film.path_lengths().expect("asked for");
    let images: [Vec<[f64; 3]>; LENGTHS] = std::array::from_fn(|edges| lengths.image(edges));
    Ok(((0..render.film.pixels.len()).map(|p| std::array::from_fn(|edges| images[edges][p])).collect(), least))
}

fn too_short(problem: String) -> Error {
    Error::Option { option: "--time", problem }
}
