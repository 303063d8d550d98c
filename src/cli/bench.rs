//! `pathspace bench`: rates of every backend and query mode on a scene's own rays, and the frame figure; a table for
//! people, JSON for programs, a chart.

use std::fmt::Write;

use super::args::BenchArgs;
use super::job::{self, Fallback};
use super::output::{EXIT_OK, print, to_json};
use super::report::{Verbosity, bytes, count};
use super::suite;
use super::waiting::Waiting;
use crate::bench::agree::Agreement;
use crate::bench::rates::BackendRates;
use crate::bench::record::RayClass;
use crate::bench::{self, BenchOptions, Report, chart};
use crate::error::{Error, Result};
use crate::film::atomic::{check_writable, write_atomically};
use crate::render::RenderOptions;

/// Share of the processor time below which the table says that the machine was busy.
const BUSY: f64 = 0.9;

/// Samples per pixel of the frame, unless the command line says otherwise.
const SPP: u64 = 64;

/// Runs the command.
pub fn run(args: &BenchArgs) -> Result<u8> {
    if let Some(path) = &args.output {
        if path.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("svg")) {
            let problem = format!("{}: the name must end in .svg", path.display());
            return Err(Error::Option { option: "--output", problem });
        }
        check_writable(path)?;
    }
    job::check(&args.settings)?;
    let verbosity = Verbosity::of(args.quiet, false);
    if args.suite {
        return suite::run(args, verbosity);
    }
    let [path] = args.scenes.as_slice() else {
        let problem = format!("{} scenes; several are for --suite", args.scenes.len());
        return Err(Error::Option { option: "SCENE", problem });
    };
    let waiting = Waiting::begin(verbosity, "loading");
    let scene = job::load(path, &args.settings, Fallback::White)?;
    drop(waiting);
    verbosity.warnings(&scene.warnings);

    let render = RenderOptions { spp: Some(args.spp.unwrap_or(SPP)), ..job::settings(&args.settings, &scene) };
    render.check_memory()?;
    let options = BenchOptions::new(render).pairs(args.pairs).time(args.time);
    let report = bench::run(&scene, &options, |step| verbosity.note(format_args!("{step} …")))?;

    if let Some(path) = &args.output {
        let drawing = chart::svg(&report);
        write_atomically(path, |writer| std::io::Write::write_all(writer, drawing.as_bytes()))?;
        verbosity.note(format_args!("wrote {}", path.display()));
    }
    print(&if args.json { to_json(&report) } else { table(&report) })?;
    scene.check_textures()?;
    Ok(EXIT_OK)
}

/// The report for people.
fn table(report: &Report) -> String {
    let mut out = String::new();
    let machine = &report.machine;
    let _ = writeln!(out, "scene       {}, {} triangles", report.scene.file, count(report.scene.triangles));
    let threads = if machine.threads == 1 { "1 thread".into() } else { format!("{} threads", machine.threads) };
    let _ = writeln!(out, "machine     {} ({}), {threads}; pathspace {}", machine.cpu, machine.isa, report.pathspace);
    for backend in &report.backends {
        let (name, version, isa) = (backend.name, &backend.version, &backend.isa);
        let (build, size) = (1e3 * backend.build_s, bytes(backend.bvh_bytes));
        let _ = writeln!(out, "{name:<11} {version} ({isa}), built in {build:.1} ms, hierarchy {size}");
    }
    for skipped in &report.skipped {
        let _ = writeln!(out, "{:<11} not measured: {}", skipped.name, skipped.why);
    }

    let mut sets = vec![1];
    if machine.threads > 1 {
        sets.push(machine.threads);
    }
    let _ = write!(out, "\n10⁶ rays/s  {:<12}", "");
    for threads in &sets {
        let heading = if *threads == 1 { "1 thread".into() } else { format!("{threads} threads") };
        let _ = write!(out, " {heading:<27}");
    }
    let _ = write!(out, "\nbackend     {:<12}", "mode");
    for _ in &sets {
        for class in RayClass::ALL {
            let _ = write!(out, " {:>8}", class.name());
        }
    }
    out.push('\n');
    for backend in &report.backends {
        rows(&mut out, backend, &sets);
    }

    out.push('\n');
    for other in &report.agreement.against {
        let _ = writeln!(out, "agreement   {}: {}", other.name, differences(&other.agreement, report));
    }
    for backend in &report.backends {
        for mode in &backend.validation {
            let what = format!("{} {} against {}", backend.name, mode.mode, mode.reference);
            let a = &mode.agreement;
            let (rays, hit, distance) = (count(a.rays), a.hit_differs, a.distance_differs);
            let _ = writeln!(out, "validated   {what}: of {rays} rays {hit} differ in hit, {distance} in distance");
        }
    }
    frame(&mut out, report);
    out
}

/// A line per query mode.
fn rows(out: &mut String, backend: &BackendRates, sets: &[usize]) {
    let mut modes: Vec<&str> = Vec::new();
    for rate in &backend.rays {
        if !modes.contains(&rate.mode_effective) {
            modes.push(rate.mode_effective);
        }
    }
    for mode in modes {
        let _ = write!(out, "{:<11} {mode:<12}", backend.name);
        for threads in sets {
            for class in RayClass::ALL {
                let rate = backend
                    .rays
                    .iter()
                    .find(|r| r.mode_effective == mode && r.class == class.name() && r.threads == *threads);
                let _ = write!(out, " {:>8}", rate.map_or("none".into(), |r| chart::number(r.mrays_per_s)));
            }
        }
        out.push('\n');
    }
}

fn differences(counts: &Agreement, report: &Report) -> String {
    let agreement = &report.agreement;
    format!(
        "of {} rays {} differ in hit from {}, {} in distance by more than {:.1e}; {} met another triangle there",
        count(counts.rays),
        counts.hit_differs,
        agreement.reference,
        counts.distance_differs,
        agreement.distance_tolerance,
        counts.triangle_differs
    )
}

fn frame(out: &mut String, report: &Report) {
    let frame = &report.frame;
    let [width, height] = frame.resolution;
    let [camera, bounce, shadow] = frame.modes_render;
    let _ = writeln!(
        out,
        "\nframe       {width}x{height}, {} spp, {} with camera {camera}, bounce {bounce}, shadow {shadow}",
        frame.spp, frame.backend
    );
    let [camera, bounce, shadow] = frame.rays.map(count);
    let _ = writeln!(out, "            {camera} camera, {bounce} bounce, {shadow} shadow rays");
    let [camera, bounce, shadow] = frame.modes_bare;
    let _ = writeln!(
        out,
        "            render {:.3} s ({:.2}·10⁶ paths/s); its rays bare {:.3} s, camera {camera}, bounce \
         {bounce}, shadow {shadow}",
        frame.render_s, frame.mpaths_per_s, frame.bare_trace_s
    );
    let [low, high] = frame.tracing_efficiency_range;
    let cpu = frame.tracing_efficiency_cpu.map_or(String::new(), |e| format!("; in processor time {e:.3}"));
    let _ = writeln!(
        out,
        "            tracing efficiency {:.3} ({low:.3} to {high:.3} in {} pairs{cpu})",
        frame.tracing_efficiency, frame.pairs
    );
    for other in &report.elsewhere {
        let _ = writeln!(
            out,
            "            the same rays bare by {}, by its best rates: {:.3} s, {:.3} of the render",
            other.name, other.bare_trace_s, other.of_render
        );
    }
    if let Some(share) = frame.processor_share.filter(|share| *share < BUSY) {
        let percent = 100.0 * share;
        let _ = writeln!(
            out,
            "            the machine was busy: the threads got {percent:.0} % of the time that they could use"
        );
    }
}
