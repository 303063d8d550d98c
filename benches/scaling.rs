//! How cost grows with triangles and with samples: `make scaling` prints a table with fitted exponents and writes
//! scaling.json, scaling-triangles.svg and scaling-samples.svg under the target folder (about two minutes once built).
//!
//! Triangles: one room with 160 spheres, tessellated more and more finely, so that what is seen and the paths stay the
//! same. Per backend: processor time to build by one thread, bytes of the hierarchy, processor time per 10⁶ rays of
//! each class (the render's own rays, replayed), and of the whole render. Samples: one of these rooms, from 1 to 1024
//! samples a pixel; processor time and peak memory. Times are the least of several turns, seconds of one thread; other
//! processes stretch neither, but they do take turns in the caches. Exponents: least squares through logarithms, with
//! the standard error from the scatter of the points about the line. A power is a summary, not a law: the cost of a ray
//! steps up where the hierarchy leaves a cache.

mod common;

use std::fs;
use std::hint::black_box;
use std::ops::ControlFlow;
use std::path::Path;

use pathspace::backend::{self, Backend, BackendOptions};
use pathspace::bench::record::{RayClass, Recording, count};
use pathspace::bench::replay;
use pathspace::plot::axes::{Axis, Plot};
use pathspace::plot::svg::Anchor;
use pathspace::render::Renderer;
use pathspace::study::clock::Stopwatch;
use pathspace::study::runs::{self, Line};
use serde_json::{Value, json};

/// Triangles of the rooms, about.
const TRIANGLES: [f64; 6] = [1e4, 3e4, 1e5, 3e5, 1e6, 4e6];
/// The room in which samples are counted: in memory, but beyond the nearest caches.
const SAMPLED_TRIANGLES: f64 = 1e5;
/// Pixels along an edge, and samples per pixel, of the renders over triangles.
const SIDE: u32 = 96;
const SPP: u64 = 8;
/// The same over samples: short renders are timed as well as long ones.
const SAMPLED_SIDE: u32 = 32;
const MOST_SPP: u64 = 1024;
/// Turns of which the least counts.
const TURNS: usize = 3;
/// Bytes of rays that are kept for the replay.
const RECORDED_BYTES: usize = 24 << 20;

/// A quantity over triangles or samples.
struct Series {
    /// Backend and quantity, with the unit.
    name: String,
    /// (triangles or samples, value).
    points: Vec<(f64, f64)>,
}

impl Series {
    /// The line through the logarithms, whose slope is the exponent.
    fn fit(&self) -> Line {
        let logs: Vec<_> = self.points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
        runs::line(&logs).expect("more than two points")
    }
}

fn main() {
    common::facts();
    let samples = over_samples();
    let triangles = over_triangles();
    print("triangles", &triangles);
    print("samples per pixel", &samples);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let record = json!({"version": 1, "triangles": record(&triangles), "samples": record(&samples)});
    let text = serde_json::to_string_pretty(&record).expect("numbers and names");
    let kept = |name: &str, text: &str| {
        let path = folder.join(name);
        fs::write(&path, text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        println!("wrote {}", path.display());
    };
    println!();
    kept("scaling.json", &text);
    let times: Vec<Series> = triangles.into_iter().filter(|s| !s.name.contains("bytes")).collect();
    kept("scaling-triangles.svg", &draw(&times, "triangles", "Cost against triangles"));
    let times: Vec<Series> = samples.into_iter().filter(|s| !s.name.contains("bytes")).collect();
    kept("scaling-samples.svg", &draw(&times, "samples per pixel", "Cost against samples per pixel"));
}

/// Every backend on every room.
fn over_triangles() -> Vec<Series> {
    let pool = replay::pool(1).expect("one thread");
    let mut series = Vec::new();
    for about in TRIANGLES {
        let scene = common::spheres_of(about);
        let renderer = Renderer::new(&scene, common::options(SIDE, SPP)).unwrap_or_else(|e| panic!("{e}"));
        let triangles = renderer.geometry().triangles.len() as f64;
        let (recording, _) = Recording::of(&renderer, RECORDED_BYTES).unwrap_or_else(|e| panic!("{e}"));
        let waves: Vec<_> = recording.waves.iter().map(Vec::as_slice).collect();
        let rays = count(&waves);
        let mut add = |name: String, value: f64| {
            let of_name = |s: &Series| s.name == name;
            let place = series.iter().position(of_name).unwrap_or_else(|| {
                series.push(Series { name, points: Vec::new() });
                series.len() - 1
            });
            series[place].points.push((triangles, value));
        };
        for kind in common::kinds() {
            let options = BackendOptions { build_threads: 1, ..renderer.plan().backend_options() };
            // Small hierarchies are built again until their time can be told.
            let (mut times, watch) = (0, Stopwatch::start());
            let backend = loop {
                let backend =
                    backend::select::build(kind, renderer.geometry(), &options).unwrap_or_else(|e| panic!("{e}"));
                times += 1;
                if watch.cost().cpu_s > 0.1 {
                    break backend;
                }
            };
            let of = |what: &str| format!("{}: {what}", kind.name());
            add(of("build, s"), watch.cost().cpu_s / f64::from(times));
            add(of("hierarchy, bytes"), backend.info().bvh_bytes as f64);
            for class in RayClass::ALL.into_iter().filter(|class| rays[*class as usize] > 0) {
                let seconds = least(|| {
                    let watch = Stopwatch::start();
                    let bare = replay::replay(backend.as_ref(), &waves, Some(class), &pool);
                    let inside = bare.seconds[class as usize];
                    watch.cost().cpu_s * inside / (inside + bare.copy_seconds)
                });
                add(of(&format!("10⁶ {} rays, s", class.name())), 1e6 * seconds / rays[class as usize] as f64);
            }
            add(of("render, s"), least(|| render_s(&renderer, backend.as_ref())));
        }
    }
    series
}

/// The default backend on one room.
fn over_samples() -> Vec<Series> {
    let scene = common::spheres_of(SAMPLED_TRIANGLES);
    let mut renderer = Renderer::new(&scene, common::options(SAMPLED_SIDE, 1)).unwrap_or_else(|e| panic!("{e}"));
    // What the first render of a process makes once is not the samples' cost.
    black_box(renderer.render().unwrap_or_else(|e| panic!("{e}")));
    let (mut seconds, mut bytes) = (Vec::new(), Vec::new());
    let mut spp = 1;
    while spp <= MOST_SPP {
        renderer.retarget(&common::options(SAMPLED_SIDE, spp)).unwrap_or_else(|e| panic!("{e}"));
        forget_peak();
        let turns = if spp > 64 { 1 } else { 5 };
        let cost = (0..turns).map(|_| render_s(&renderer, renderer.backend())).fold(f64::INFINITY, f64::min);
        seconds.push((spp as f64, cost));
        bytes.extend(peak_bytes().map(|peak| (spp as f64, peak)));
        spp *= 2;
    }
    let mut series = vec![Series { name: "render, s".into(), points: seconds }];
    if bytes.len() > 2 {
        series.push(Series { name: "peak memory, bytes".into(), points: bytes });
    }
    series
}

/// Processor time of a render.
fn render_s(renderer: &Renderer, backend: &dyn Backend) -> f64 {
    let watch = Stopwatch::start();
    black_box(renderer.render_through(backend, |_| ControlFlow::Continue(())).unwrap_or_else(|e| panic!("{e}")));
    watch.cost().cpu_s
}

/// The least of some turns of `measure`.
fn least(mut measure: impl FnMut() -> f64) -> f64 {
    (0..TURNS).map(|_| measure()).fold(f64::INFINITY, f64::min)
}

/// Begins a new high-water mark of resident memory (Linux; elsewhere nothing).
fn forget_peak() {
    let _ = fs::write("/proc/self/clear_refs", "5");
}

/// The high-water mark since then, bytes.
fn peak_bytes() -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(1024.0 * line.trim().strip_suffix(" kB")?.trim().parse::<f64>().ok()?)
}

/// A row a series, a column an abscissa.
fn print(x: &str, series: &[Series]) {
    let head: String = series[0].points.iter().map(|p| format!(" {} |", p.0)).collect();
    println!("\n| {x} |{head} exponent |\n| --- |{}", " --- |".repeat(series[0].points.len() + 1));
    for s in series {
        let scale = if s.name.contains("bytes") { 1e-6 } else { 1.0 };
        let cells: String = s.points.iter().map(|p| format!(" {} |", digits(p.1 * scale))).collect();
        let fit = s.fit();
        println!("| {} |{cells} {:.3} ± {:.3} |", s.name.replace("bytes", "MB"), fit.slope, fit.slope_error);
    }
}

/// Three digits that mean something.
fn digits(v: f64) -> String {
    let decimals = (2 - v.abs().log10().floor() as i32).clamp(0, 6) as usize;
    format!("{v:.decimals$}")
}

fn record(series: &[Series]) -> Value {
    let one = |s: &Series| {
        let fit = s.fit();
        json!({"name": s.name, "points": s.points, "exponent": fit.slope, "exponent_error": fit.slope_error})
    };
    series.iter().map(one).collect()
}

/// All series in one frame with their names; both axes logarithmic.
fn draw(series: &[Series], x: &str, title: &str) -> String {
    let all = || series.iter().flat_map(|s| &s.points);
    let mut x = Axis::log(all().map(|p| p.0), x);
    // Air for the names.
    x.high *= (x.high / x.low).powf(0.55);
    let mut plot = Plot::new(x, Axis::log(all().map(|p| p.1), "seconds of processor time"));
    let mut names = Vec::new();
    for (i, s) in series.iter().enumerate() {
        // A colour a quantity, a dash a backend.
        let kind = s.name.split(": ").next().unwrap_or_default();
        let dash = if series[0].name.starts_with(kind) { "" } else { ";stroke-dasharray:6 3" };
        let colour = series[..i].iter().filter(|other| other.name.starts_with(kind)).count();
        plot.line(&s.points, &format!("stroke:var(--c{colour});stroke-width:2{dash}"));
        for p in &s.points {
            plot.dot(*p, colour, !dash.is_empty(), &format!("{}: {}", s.name, digits(p.1)));
        }
        let end = s.points.last().expect("a series has points");
        let fit = s.fit();
        let mark = if dash.is_empty() { "●" } else { "○" };
        let name = format!("{mark} {} (exponent {:.2})", s.name, fit.slope);
        names.push((plot.place(end.0, end.1), colour, name));
    }
    // Names in the order of their lines, pushed apart where these are close.
    names.sort_by(|a, b| a.0.1.total_cmp(&b.0.1));
    let mut free = 0.0f64;
    for ((x, y), colour, name) in names {
        let y = (y + 4.0).max(free);
        free = y + 15.0;
        let attributes = format!("style=\"fill:var(--c{colour})\"");
        plot.svg.styled_text((x + 10.0, y), Anchor::Start, &attributes, &name);
    }
    plot.svg.file(title)
}
