//! `pathspace verify`: the path tracer against the deterministic solver, length by length, as a table or JSON. Exit
//! code 0 if every term agrees, 3 if one does not; a scene that the solver does not know is refused with code 4.

use serde::Serialize;

use super::args::VerifyArgs;
use super::output::{EXIT_OK, EXIT_TARGET_MISSED, print, to_json};
use super::report::{Verbosity, stderr_line};
use super::waiting::Waiting;
use crate::error::Result;
use crate::film::layer::bounces::LENGTHS;
use crate::plan::options::RenderOptions;
use crate::scene::{LoadOptions, Scene};
use crate::verify::compare::{Comparison, Region, SIGMAS};
use crate::verify::{self, SOLUTIONS, Verification, VerifyOptions};

/// What `verify --json` prints.
#[derive(Serialize)]
struct Record {
    scene: String,
    resolution: [u32; 2],
    spp: u64,
    max_depth: u32,
    patches: [usize; SOLUTIONS],
    terms: Vec<TermRecord>,
    spectral_radius: [f64; 3],
    beyond_depth: f64,
    agrees: bool,
}

#[derive(Serialize)]
struct TermRecord {
    /// "bounce_03" or "bounce_tail", as `--aov bounces` names it.
    length: String,
    region: &'static str,
    solver: [f64; 3],
    discretisation: [f64; 3],
    path_tracer: [f64; 3],
    standard_error: [f64; 3],
    sigmas: [f64; 3],
    judged: [bool; 3],
    agrees: bool,
}

/// Runs the command.
pub fn run(args: &VerifyArgs) -> Result<u8> {
    let options = LoadOptions::default()
        .fallback_light(false)
        .allow_outside(args.files.allow_outside)
        .allow_missing_extensions(args.files.allow_missing_extensions);
    let waiting = Waiting::begin(Verbosity::Normal, "loading");
    let scene = Scene::load_with(&args.scene, &options)?;
    drop(waiting);
    for warning in &scene.warnings {
        stderr_line(format_args!("pathspace: warning: {}: {}", warning.place, warning.what));
    }
    let picture = RenderOptions::default().sized_for(&scene, Some(args.width), None);
    let options = VerifyOptions {
        patches: args.patches as usize,
        spp: args.spp,
        time: args.time,
        resolution: (picture.width, picture.height),
        max_depth: args.max_depth,
        seed: args.seed,
        threads: args.threads.map_or(0, |n| n as usize),
        backend: args.backend,
    };
    let waiting = Waiting::begin(Verbosity::Normal, "solving and rendering");
    let found = verify::verify(&scene, &options)?;
    drop(waiting);
    let text = if args.json { to_json(&record(&scene, &options, &found)) } else { table(&options, &found) };
    print(&text)?;
    scene.check_textures()?;
    Ok(if found.agrees() { EXIT_OK } else { EXIT_TARGET_MISSED })
}

fn record(scene: &Scene, options: &VerifyOptions, found: &Verification) -> Record {
    let term = |c: &Comparison| TermRecord {
        length: length(c.edges),
        region: c.region.name(),
        solver: c.channels.map(|t| t.solver),
        discretisation: c.channels.map(|t| t.discretisation),
        path_tracer: c.channels.map(|t| t.path_tracer),
        standard_error: c.channels.map(|t| t.standard_error),
        sigmas: c.channels.map(|t| t.sigmas()),
        judged: c.channels.map(|t| t.judged),
        agrees: c.agrees(),
    };
    Record {
        scene: scene.file.display().to_string(),
        resolution: [options.resolution.0, options.resolution.1],
        spp: found.spp,
        max_depth: options.max_depth,
        patches: found.patches,
        terms: found.comparisons.iter().map(term).collect(),
        spectral_radius: found.spectral_radius,
        beyond_depth: found.beyond_depth,
        agrees: found.agrees(),
    }
}

fn length(edges: usize) -> String {
    if edges == LENGTHS - 1 { "bounce_tail".into() } else { format!("bounce_{:02}", edges - 1) }
}

fn table(options: &VerifyOptions, found: &Verification) -> String {
    let (width, height) = options.resolution;
    let mut lines = vec![
        format!(
            "solver: {:?} patches; path tracer: {} samples for each of {width}x{height} rays through pixel centres",
            found.patches, found.spp
        ),
        "mean radiance over the picture, W/(sr m²), in the channel that agrees least; ± is the discretisation \
         of the solver"
            .into(),
        "and the standard error of the path tracer; rare: too few paths to judge; the last column counts \
         regions that agree"
            .into(),
        String::new(),
        format!(
            "{:<12} {:>12} {:>9} {:>12} {:>9} {:>10} {:>7} {:>9}",
            "length", "solver", "±", "path tracer", "±", "difference", "in σ", "regions"
        ),
    ];
    for comparison in found.comparisons.iter().filter(|c| c.region == Region::Whole) {
        let regions: Vec<&Comparison> = found.comparisons.iter().filter(|c| c.edges == comparison.edges).collect();
        let agreeing = regions.iter().filter(|c| c.agrees()).count();
        let t = comparison.worst();
        lines.push(format!(
            "{:<12} {:>12.5e} {:>9.1e} {:>12.5e} {:>9.1e} {:>10.1e} {:>7} {:>9}",
            length(comparison.edges),
            t.solver,
            t.discretisation,
            t.path_tracer,
            t.standard_error,
            t.difference(),
            if t.judged { format!("{:.2}", t.sigmas()) } else { "rare".into() },
            format!("{agreeing} of {}", regions.len())
        ));
    }
    let radius = found.spectral_radius.iter().copied().fold(0.0, f64::max);
    let [r, g, b] = found.spectral_radius;
    lines.push(String::new());
    lines.push(format!(
        "spectral radius {r:.4} {g:.4} {b:.4} (R G B): what the last scattering told apart leaves of the one before"
    ));
    lines.push(format!(
        "depth limit {}: longer paths carry {:.1e} of the picture's energy{}",
        options.max_depth,
        found.beyond_depth,
        depth_for(radius)
    ));
    let disagreeing: Vec<&Comparison> = found.comparisons.iter().filter(|c| !c.agrees()).collect();
    for c in &disagreeing {
        let t = c.worst();
        lines.push(format!(
            "DISAGREES: {} ({}): {:.5e} by the solver, {:.5e} by the path tracer, off by {:.1e}, allowed are {:.1e}",
            length(c.edges),
            c.region.name(),
            t.solver,
            t.path_tracer,
            t.difference(),
            t.limit()
        ));
    }
    let verdict = match disagreeing.len() {
        0 => format!("all {} terms agree within {SIGMAS} σ and the discretisation", found.comparisons.len()),
        n => format!("{n} of {} terms disagree", found.comparisons.len()),
    };
    lines.push(verdict);
    lines.join("\n") + "\n"
}

/// What the spectral radius says of other depth limits.
fn depth_for(radius: f64) -> String {
    if radius > 0.0 && radius < 1.0 {
        format!("; each {:.1} scatterings more leave a tenth of that", -(10f64.ln()) / radius.ln())
    } else {
        String::new()
    }
}
