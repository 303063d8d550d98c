//! The operator check: a deterministic solver of diffuse light transport, against which the path tracer must hold length
//! by length.
//!
//! The theory is L = Σ (KG)ᵏ Le: term k is the light of paths with k scatterings. The solver divides the surfaces into
//! patches ([`patches`]), computes the form factors between them ([`form_factor`], [`operator`]) and iterates
//! L ← KG·L; the path tracer keeps one image per length. Both sides of the comparison are the same quantity: the mean
//! over pixels of the radiance along the one ray through each pixel's centre. The last scattering, at the point that the
//! camera sees, is gathered exactly from all patches ([`gather`]), so that no patch is ever looked at directly.
//! They share the scene and the backend's ray queries; no sampling, no shading code.
//!
//! Intervals ([`compare`]): the path tracer's own standard error, and the solver's discretisation error, taken from the
//! differences between solutions on patches of 1, 3/2 and 3 times the side. Source: Goral et al. 1984; HARDCASES §4.3.
//! Limits: flat, untextured Lambert surfaces, emissive triangles as the only light. Everything else is refused by name.

pub mod compare;
pub mod form_factor;
pub mod gather;
pub mod operator;
pub mod patches;

use rayon::prelude::*;

use crate::backend::{self, Backend, BackendKind, BackendOptions};
use crate::camera::CameraRays;
use crate::error::{Error, Result};
use crate::film::lengths::LENGTHS;
use crate::plan::options::{CameraChoice, FilterKind, RenderOptions};
use crate::render::Renderer;
use crate::scene::Scene;
use crate::scene::geometry::Geometry;
use compare::{Comparison, Estimates};
use gather::{Pixel, Radiances};
use operator::{Operator, Series};
use patches::Patches;

/// What a check is told.
#[derive(Clone, Debug, PartialEq)]
pub struct VerifyOptions {
    /// Patches of the finer solution, about.
    pub patches: usize,
    /// Samples per pixel of the path tracer, over both of its runs.
    pub spp: u64,
    /// Columns and rows of the picture.
    pub resolution: (u32, u32),
    /// Largest number of path edges.
    pub max_depth: u32,
    /// Seed of the path tracer.
    pub seed: u64,
    /// Worker threads; 0 means all that the process may use.
    pub threads: usize,
    /// Ray backend of both; `None` takes the fastest of this build.
    pub backend: Option<BackendKind>,
}

impl Default for VerifyOptions {
    fn default() -> Self {
        VerifyOptions {
            patches: 2000,
            spp: 256,
            resolution: (64, 64),
            max_depth: 64,
            seed: 0,
            threads: 0,
            backend: None,
        }
    }
}

/// What a check found.
#[derive(Clone, Debug, PartialEq)]
pub struct Verification {
    /// Patches of the three solutions, the coarsest first.
    pub patches: [usize; SOLUTIONS],
    /// Term by term; see [`compare::judge`] for their order.
    pub comparisons: Vec<Comparison>,
    /// Spectral radius of KG as the light that the camera sees feels it: the late ratio of consecutive terms of the picture,
    /// by channel.
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
pub struct Solution {
    /// Patches in the order of the scene.
    pub patches: Patches,
    /// Radiance of every node by number of scatterings.
    pub series: Series,
    /// Largest sum of the form factors of a row.
    pub largest_row: f64,
}

/// Number of solutions that a check makes, of fineness 1 to this.
pub const SOLUTIONS: usize = patches::FINEST as usize;

/// Solves on about `count` patches, or on fewer of `FINEST / fineness` times their side.
///
/// # Errors
/// [`Error::InvalidScene`] naming what the solver does not know.
pub fn solve(scene: &Scene, backend: &dyn Backend, count: usize, fineness: u32) -> Result<Solution> {
    let patches = Patches::of(scene, count, fineness)?;
    let operator = Operator::new(&patches, backend);
    let series = Series::iterate(&operator, &patches);
    Ok(Solution { largest_row: operator.largest_row(), patches, series })
}

/// Runs the check on the scene's first camera.
///
/// # Errors
/// [`Error::InvalidScene`] for a scene that the solver does not know, naming the material; what [`Renderer::new`] refuses.
pub fn verify(scene: &Scene, options: &VerifyOptions) -> Result<Verification> {
    patches::check(scene)?;
    let geometry = Geometry::build(scene);
    let kind = options.backend.unwrap_or(BackendKind::available()[0]);
    let backend = backend::build(kind, &geometry, &BackendOptions::default())?;
    let camera = scene.cameras.first().ok_or_else(|| refusal(scene, "/cameras", "the scene has no camera".into()))?;
    let camera = CameraRays::new(camera, options.resolution, None)?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(options.threads)
        .build()
        .map_err(|e| Error::Option { option: "--threads", problem: e.to_string() })?;

    // The solver, on three sizes of patches.
    let pixels = gather::pixels(&camera, options.resolution, &geometry, scene, backend.as_ref());
    let mut solved = Vec::new();
    for fineness in 1..=patches::FINEST {
        let solution = pool.install(|| solve(scene, backend.as_ref(), options.patches, fineness))?;
        let seen = pool.install(|| look(&pixels, &solution, options.max_depth, backend.as_ref()));
        solved.push((solution, seen));
    }
    let finest = &solved[SOLUTIONS - 1];

    // The path tracer, twice: independent seeds give each pixel's variance.
    let runs = [0, 1].map(|run| trace(scene, options, run));
    let [first, second] = runs;
    let brightest = patches::brightest(scene);
    let estimates = Estimates::new(&[first?, second?], 2 * options.spp.div_ceil(2), brightest);

    let seen: [&[Radiances]; SOLUTIONS] = std::array::from_fn(|i| solved[i].1.as_slice());
    Ok(Verification {
        patches: std::array::from_fn(|i| solved[i].0.patches.len()),
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

/// One run of the path tracer: per pixel the mean radiance by number of edges, index 0 unused, the last the tail.
fn trace(scene: &Scene, options: &VerifyOptions, run: u64) -> Result<Vec<[[f64; 3]; LENGTHS]>> {
    let (width, height) = options.resolution;
    let render = RenderOptions {
        spp: Some(options.spp.div_ceil(2)),
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
    let lengths = render.lengths.expect("asked for");
    let means = |(sums, n): (&[[f64; 3]; LENGTHS], &u64)| sums.map(|term| term.map(|sum| sum / *n as f64));
    Ok(lengths.sums.iter().zip(&lengths.n).map(means).collect())
}

fn refusal(scene: &Scene, pointer: &str, problem: String) -> Error {
    Error::InvalidScene { file: scene.file.clone(), pointer: pointer.into(), problem }
}
