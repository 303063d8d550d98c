//! `pathspace bench --suite`: a table of backends × scenes for people, JSON for programs, a map in colours.

use std::fmt::Write;
use std::path::Path;

use super::args::BenchArgs;
use super::job::{self, Fallback};
use super::output::{EXIT_OK, print, to_json};
use super::report::{Verbosity, count};
use crate::bench::suite::{self, NEAR, Report, heat, scenes};
use crate::error::Result;
use crate::film::atomic::write_atomically;
use crate::render::RenderOptions;

/// Columns and rows of the frames, unless the command line says otherwise.
const SIDE: u32 = 128;

/// Samples per pixel of the frames.
const SPP: u64 = 2;

/// Runs the command.
pub fn run(args: &BenchArgs, verbosity: Verbosity) -> Result<u8> {
    let most = args.suite_triangles;
    let mut rows = Vec::new();
    for (index, entry) in scenes::ALL.iter().enumerate().filter(|(_, entry)| entry.about <= most) {
        verbosity.note(format_args!("{} …", entry.name));
        let scene = (entry.make)();
        rows.push(suite::row(entry.name.into(), suite::part_of(index), &scene, &options(args, None))?);
    }
    for path in &args.scenes {
        verbosity.note(format_args!("{} …", path.display()));
        let mut scene = job::load(path, &args.settings, Fallback::White)?;
        if let Some(sky) = sky_beside(path).filter(|_| args.settings.environment.env.is_none()) {
            scene.load_environment(sky, 0.0, 1.0)?;
        }
        verbosity.warnings(&scene.warnings);
        let options = options(args, Some(job::settings(&args.settings, &scene)));
        rows.push(suite::row(path.display().to_string(), "file", &scene, &options)?);
    }
    let threads = crate::machine::threads(args.settings.threads.unwrap_or(0) as usize);
    let report = suite::report(rows, threads);
    if let Some(path) = &args.output {
        let drawing = heat::svg(&report);
        write_atomically(path, |writer| std::io::Write::write_all(writer, drawing.as_bytes()))?;
        verbosity.note(format_args!("wrote {}", path.display()));
    }
    print(&if args.json { to_json(&report) } else { table(&report) })?;
    Ok(EXIT_OK)
}

/// Options of a frame: those of the command line for a file, else machine and size.
fn options(args: &BenchArgs, of_file: Option<RenderOptions>) -> RenderOptions {
    let settings = &args.settings;
    let plain = RenderOptions::new(SIDE, SIDE).threads(settings.threads.unwrap_or(0) as usize);
    let mut options = of_file.unwrap_or(RenderOptions { isa: settings.isa.clone(), ..plain });
    (options.width, options.height) = (settings.width.unwrap_or(SIDE), settings.height.unwrap_or(SIDE));
    options.spp(args.spp.unwrap_or(SPP))
}

/// The environment that lies beside a scene: `NAME.env.exr`, or `env.exr` in its folder.
fn sky_beside(path: &Path) -> Option<std::path::PathBuf> {
    let named = path.with_extension("env.exr");
    [named, path.with_file_name("env.exr")].into_iter().find(|path| path.is_file())
}

/// The report for people.
fn table(report: &Report) -> String {
    let mut out = String::new();
    let machine = &report.machine;
    let _ = writeln!(out, "machine     {} ({}), {} threads", machine.cpu, machine.isa, machine.threads);
    let widest = report.scenes.iter().map(|row| row.name.chars().count()).max().unwrap_or(0).max(5);
    let _ = write!(
        out,
        "\ntime of a path's rays over the fastest backend's; * is what a render takes\n\n{:widest$}",
        "scene"
    );
    let _ = write!(out, " {:>9}", "triangles");
    for name in &report.backends {
        let _ = write!(out, " {name:>11}");
    }
    let _ = writeln!(out, "  choice");
    for row in &report.scenes {
        let _ = write!(out, "{:widest$} {:>9}", row.name, count(row.triangles));
        for name in &report.backends {
            let mark = if row.chosen == *name { "*" } else { " " };
            let _ = match row.timed.iter().find(|timed| timed.name == *name) {
                Some(timed) => write!(out, " {:>10.2}{mark}", timed.over_fastest),
                None => write!(out, " {:>10} ", "-"),
            };
        }
        let over = 100.0 * (row.chosen_over_fastest - 1.0);
        let verdict = if row.chosen_over_fastest <= NEAR { "within 5 %".into() } else { format!("+{over:.0} %") };
        let _ = writeln!(out, "  {verdict} ({})", row.part);
    }
    let (near, all) = (report.near, report.scenes.len());
    let _ = writeln!(out, "\nwithin 5 %  {near} of {all} scenes");
    for part in ["fit", "test", "file"] {
        let of_part = || report.scenes.iter().filter(|row| row.part == part);
        let near = of_part().filter(|row| row.chosen_over_fastest <= NEAR).count();
        if of_part().count() > 0 {
            let _ = writeln!(out, "            {part}: {near} of {}", of_part().count());
        }
    }
    for verdict in &report.verdicts {
        let (name, fastest, ahead) = (verdict.name, verdict.fastest, verdict.ahead);
        let place = if verdict.earns_its_place { "earns its place" } else { "does not earn its place" };
        let _ = writeln!(out, "{name:<11} fastest on {fastest}, by 10 % or more on {ahead}: {place}");
    }
    let _ = writeln!(out);
    for row in &report.scenes {
        let _ = writeln!(out, "{:widest$} {}: {}", row.name, row.chosen, row.reason);
    }
    out
}
