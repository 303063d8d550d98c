//! `pathspace bench --suite`: backends × scenes. Each backend of the build that is fit for a scene traces the rays of a
//! small frame of it, in turn with the others, and what is fastest is held against what the counted rule takes.
//!
//! Times are processor times of the threads that trace, medians over the turns, in the modes of a render; only ratios
//! between backends on one scene mean something. A frame is recorded through the first backend of the build.

pub mod heat;
pub mod scenes;

use serde::Serialize;

use super::Machine;
use super::rates::median;
use super::record::{Batch, RayClass, Recording};
use super::replay;
use crate::backend::count::{self, Counts};
use crate::backend::{Backend, BackendKind, BackendOptions, joint, select};
use crate::error::Result;
use crate::machine::{Clock, Processor, processor_seconds};
use crate::plan::view::view_of;
use crate::render::{RenderOptions, Renderer};
use crate::scene::Scene;

/// Bytes of rays that are kept of a frame.
const RECORDING_BYTES: usize = 64 << 20;

/// Turns of all backends.
const TURNS: usize = 7;

/// How far behind the fastest the backend that is taken may be.
pub const NEAR: f64 = 1.05;

/// How far behind the fastest all others have to be for it to earn its place there.
pub const AHEAD: f64 = 1.1;

/// Scenes on which a backend has to earn it.
pub const SCENES_AHEAD: usize = 3;

/// All that was measured; what `bench --suite --json` prints.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Report {
    /// Where.
    pub machine: Machine,
    /// Names of the backends, columns of the table.
    pub backends: Vec<&'static str>,
    /// Rows of the table.
    pub scenes: Vec<Row>,
    /// What becomes of the backends.
    pub verdicts: Vec<Verdict>,
    /// Scenes on which the backend that is taken is within 5 % of the fastest.
    pub near: usize,
    /// This program's version.
    pub pathspace: &'static str,
}

/// A scene.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Row {
    /// Its name.
    pub name: String,
    /// Whether weights were fitted to it ("fit"), tested on it ("test"), or neither ("file").
    pub part: &'static str,
    /// Triangles over all placements.
    pub triangles: u64,
    /// The backend that a render takes.
    pub chosen: &'static str,
    /// Why.
    pub reason: String,
    /// Its time over that of the fastest.
    pub chosen_over_fastest: f64,
    /// What was counted; `null` where nothing was.
    pub counts: Option<Counts>,
    /// Faces, where they are few.
    pub faces: Option<usize>,
    /// Processor time of counting, s.
    pub count_s: f64,
    /// Processor time of flattening the scene and building for the backend that is taken, s.
    pub ready_s: Option<f64>,
    /// Rays by class: camera, bounce, shadow.
    pub rays: [u64; 3],
    /// The backends, as far as they are fit.
    pub timed: Vec<Timed>,
}

/// A backend on a scene.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Timed {
    /// Which.
    pub name: &'static str,
    /// Processor time of a path's rays, µs.
    pub us_per_path: f64,
    /// That over the fastest backend's.
    pub over_fastest: f64,
    /// Half the range of the middle half of the turns, over the median.
    pub spread: f64,
    /// Processor time of a ray by class, ns; 0 where there are none.
    pub ns_per_ray: [f64; 3],
    /// Counted cost of a ray, visits of a node; `null` where it was not counted.
    pub cost: Option<f64>,
    /// Instruction set that ran.
    pub isa: String,
}

/// What becomes of a backend.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Verdict {
    /// Which.
    pub name: &'static str,
    /// Scenes on which it was the fastest.
    pub fastest: usize,
    /// Scenes on which every other took at least 10 % longer.
    pub ahead: usize,
    /// Whether those are three or more.
    pub earns_its_place: bool,
}

/// What stands in a row's column `part`, of the suite's scene number `index`.
pub fn part_of(index: usize) -> &'static str {
    if index.is_multiple_of(2) { "fit" } else { "test" }
}

/// Measures one scene; `part` as in [`Row::part`].
///
/// # Errors
/// Those of [`Renderer::new`] and of building backends.
pub fn row(name: String, part: &'static str, scene: &Scene, options: &RenderOptions) -> Result<Row> {
    let before = processor_seconds();
    let renderer = Renderer::new(scene, RenderOptions { backend: None, ..options.clone() })?;
    let ready_s = before.zip(processor_seconds()).map(|(before, after)| after - before);
    let (plan, geometry) = (renderer.plan(), renderer.geometry());
    let chosen = (plan.backend, plan.backend_reason.clone());

    let start = Clock::Thread.now();
    let counted = geometry.triangles.len() <= select::COUNTED_TRIANGLES;
    let counts = counted.then(|| count::of(geometry, &view_of(scene, geometry), &select::DIVISION));
    let count_s = (Clock::Thread.now() - start).as_secs_f64();

    let (recording, render) = Recording::of(&renderer, RECORDING_BYTES)?;
    let waves: Vec<&[Batch]> = recording.waves.iter().map(Vec::as_slice).collect();
    let paths = render.counters.paths as f64 * recording.rays()[0] as f64 / render.counters.rays_camera as f64;
    let faces = select::few_faces(geometry);
    let costs = counts.as_ref().map(|counts| select::candidates(counts, faces)).unwrap_or_default();
    let mut backends: Vec<(BackendKind, Box<dyn Backend>)> = Vec::new();
    // Undivided, flat+obvhs is obvhs.
    let divides = joint::divide(geometry, &select::DIVISION).is_some();
    for kind in candidates(faces.is_some()).filter(|kind| divides || *kind != BackendKind::FlatObvhs) {
        let isa = plan.isa.clone().filter(|isa| kind.pins(isa));
        let modes = BackendOptions { isa, ..plan.backend_options() };
        backends.push((kind, select::build(kind, geometry, &modes)?));
    }
    let turns = turns(&backends, &waves, plan.threads)?;
    let medians: Vec<f64> = turns.iter().map(|turns| median(&mut totals(turns))).collect();
    let fastest = medians.iter().copied().fold(f64::INFINITY, f64::min);
    let timed: Vec<Timed> = (backends.iter().zip(&turns).zip(&medians))
        .map(|(((kind, backend), turns), &seconds)| {
            let mut sorted = totals(turns);
            sorted.sort_by(f64::total_cmp);
            let quarter = sorted.len() / 4;
            let rays = recording.rays();
            let per_ray = |class: RayClass| match rays[class as usize] {
                0 => 0.0,
                rays => 1e9 * median(&mut turns.iter().map(|t| t[class as usize]).collect::<Vec<_>>()) / rays as f64,
            };
            Timed {
                name: kind.name(),
                us_per_path: 1e6 * seconds / paths,
                over_fastest: seconds / fastest,
                spread: 0.5 * (sorted[sorted.len() - 1 - quarter] - sorted[quarter]) / seconds,
                ns_per_ray: RayClass::ALL.map(per_ray),
                cost: costs.iter().find(|(of, _)| of == kind).map(|(_, cost)| *cost),
                isa: backend.info().isa.clone(),
            }
        })
        .collect();
    let of_chosen = timed.iter().find(|timed| timed.name == chosen.0.name());
    Ok(Row {
        name,
        part,
        triangles: scene.triangle_count(),
        chosen: chosen.0.name(),
        reason: chosen.1,
        chosen_over_fastest: of_chosen.map_or(f64::NAN, |timed| timed.over_fastest),
        counts,
        faces,
        count_s,
        ready_s,
        rays: recording.rays(),
        timed,
    })
}

/// The backends that compete: all that a render may take.
fn candidates(few_faces: bool) -> impl Iterator<Item = BackendKind> {
    let all = BackendKind::available().iter().copied().filter(|kind| *kind != BackendKind::Brute);
    all.chain(few_faces.then_some(BackendKind::Flat))
}

/// Seconds by class in each turn of each backend, after one that warms the caches.
fn turns(
    backends: &[(BackendKind, Box<dyn Backend>)],
    waves: &[&[Batch]],
    threads: usize,
) -> Result<Vec<Vec<[f64; 3]>>> {
    let pool = replay::pool(threads)?;
    let mut turns = vec![Vec::new(); backends.len()];
    for turn in 0..=TURNS {
        for ((_, backend), turns) in backends.iter().zip(&mut turns) {
            let bare = replay::replay_by(Clock::Thread, backend.as_ref(), waves, None, &pool);
            if turn > 0 {
                turns.push(bare.seconds);
            }
        }
    }
    Ok(turns)
}

/// Sums over classes.
fn totals(turns: &[[f64; 3]]) -> Vec<f64> {
    turns.iter().map(|turn| turn.iter().sum()).collect()
}

/// The table of some scenes, measured with so many threads.
pub fn report(scenes: Vec<Row>, threads: usize) -> Report {
    let backends: Vec<&'static str> = candidates(true).map(BackendKind::name).collect();
    let verdicts = backends.iter().map(|&name| verdict(name, &scenes)).collect();
    let processor = Processor::detect();
    Report {
        machine: Machine { cpu: processor.name.clone(), isa: processor.isa(), threads },
        backends,
        near: scenes.iter().filter(|row| row.chosen_over_fastest <= NEAR).count(),
        scenes,
        verdicts,
        pathspace: env!("CARGO_PKG_VERSION"),
    }
}

fn verdict(name: &'static str, scenes: &[Row]) -> Verdict {
    let over = |row: &Row, own: bool| {
        let times = row.timed.iter().filter(|timed| (timed.name == name) == own);
        times.map(|timed| timed.us_per_path).fold(f64::INFINITY, f64::min)
    };
    let lead = |row: &&Row| over(row, false) / over(row, true);
    let (fastest, ahead) =
        (scenes.iter().filter(|row| lead(row) > 1.0).count(), scenes.iter().filter(|row| lead(row) >= AHEAD).count());
    Verdict { name, fastest, ahead, earns_its_place: ahead >= SCENES_AHEAD }
}
