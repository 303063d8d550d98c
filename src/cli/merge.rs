//! `pathspace merge`: parts of one picture, saved by `render --checkpoint`, become the picture.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use clap::builder::PossibleValuesParser;
use serde::Serialize;

use super::denoising::Filtered;
use super::exr::ExrArgs;
use super::output::{EXIT_NONFINITE, EXIT_OK, to_json};
use super::report::Verbosity;
use super::units;
use crate::error::{Error, Result};
use crate::film::atomic::{check_writable, write_atomically};
use crate::film::look::Look;
use crate::film::oidn::Oidn;
use crate::input;
use crate::machine;
use crate::render::identity::MAY_DIFFER;
use crate::render::merge::{MergeOptions, Merged, merge};
use crate::stats::denoise::DenoiseStats;

/// `merge`.
#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "\
Parts are ranges of samples (--sample-range), windows of pixels (--crop), or both, of one scene with the same \
settings. The picture has the bits of one render of them all.\n\
Example: pathspace render s.gltf --sample-range 0..32 --checkpoint a.part; pathspace render s.gltf --sample-range \
32..64 --checkpoint b.part; pathspace merge a.part b.part -o s.exr"
)]
pub struct MergeArgs {
    /// States saved by `render --checkpoint`
    #[arg(required = true, value_name = "PART")]
    pub parts: Vec<PathBuf>,
    /// Picture to write, .exr or .png
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Also write an 8-bit sRGB preview
    #[arg(long, value_name = "FILE.png")]
    pub png: Option<PathBuf>,
    /// Exposure of PNG previews, in stops
    #[arg(long, value_name = "EV", default_value = "0", value_parser = units::finite)]
    pub exposure: f32,
    /// Write R, G, B and A of the EXR in 16 bits
    #[arg(long)]
    pub half: bool,
    /// Leave the clock out of the EXR
    #[arg(long)]
    pub reproducible: bool,
    /// What the EXR is like.
    #[command(flatten)]
    pub exr: ExrArgs,
    /// Filter the picture as `render --denoise` does, with the layers of --denoiser-layers if the parts have them
    #[arg(long)]
    pub denoise: bool,
    /// Library of Open Image Denoise 2, or a folder that has it
    #[arg(long, value_name = "PATH", requires = "denoise")]
    pub oidn: Option<PathBuf>,
    /// Write what was joined as JSON: parts, samples, fingerprint of the film
    #[arg(long, value_name = "FILE.json")]
    pub stats: Option<PathBuf>,
    /// Join parts although samples or pixels are missing; they are named
    #[arg(long)]
    pub allow_gaps: bool,
    /// Join parts of different instruction sets or builds
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = PossibleValuesParser::new(MAY_DIFFER))]
    pub accept_different: Vec<String>,
    /// Print errors only
    #[arg(short, long)]
    pub quiet: bool,
}

/// What `--stats` writes. Keys may be added, never renamed.
#[derive(Serialize)]
struct Record {
    schema: u32,
    command: &'static str,
    parts: Vec<PartRecord>,
    resolution: [u32; 2],
    spp: [u64; 2],
    paths: u64,
    nonfinite: u64,
    gaps: Vec<String>,
    accepted: String,
    film_hash: String,
    film_digest: String,
    /// Of rendering the parts, all together, and of joining them.
    seconds_render: f64,
    seconds_merge: f64,
    /// The filtered picture beside this one; `null` unless it was asked for.
    denoised: Option<DenoiseStats>,
}

/// A part in the record.
#[derive(Serialize)]
struct PartRecord {
    file: String,
    /// The first sample and the one behind the last.
    samples: [u64; 2],
    /// Columns, rows, left column, top row.
    window: [u32; 4],
}

/// Runs the command.
pub fn run(args: &MergeArgs) -> Result<u8> {
    let start = Instant::now();
    let verbosity = Verbosity::of(args.quiet, false);
    let (exr, pngs) = outputs(args)?;
    let filter = args.denoise.then(|| Oidn::open(args.oidn.as_deref(), machine::threads(0))).transpose()?;
    let options = MergeOptions { allow_gaps: args.allow_gaps, accept_different: args.accept_different.clone() };
    let merged = merge(&args.parts, &options)?;
    for gap in &merged.gaps {
        verbosity.note(format_args!("pathspace: warning: {gap}"));
    }
    let film = &merged.render.film;
    let filtered = filter.map(|filter| Filtered::of(film, &filter)).transpose()?;
    if let Some(path) = exr {
        let exr = merged.about.exr_options(&merged.render).half(args.half).reproducible(args.reproducible);
        let mut exr = args.exr.apply(exr);
        filtered.iter().for_each(|filtered| filtered.add_to(&mut exr));
        film.write_exr(path, &exr)?;
    }
    let look = Look::default().exposure_ev(args.exposure);
    let look = filtered.as_ref().map_or(look.clone(), |filtered| filtered.shown_by(&look));
    for path in &pngs {
        film.write_preview(path, &look)?;
    }
    let mut record = record(&merged, start.elapsed().as_secs_f64());
    record.denoised = filtered.map(|filtered| filtered.stats);
    if let Some(path) = &args.stats {
        write_atomically(path, |writer| std::io::Write::write_all(writer, to_json(&record).as_bytes()))?;
    }
    let ([w, h], spp) = (record.resolution, record.spp[0]);
    let written = exr.into_iter().chain(pngs).chain(args.stats.as_deref());
    let written = written.map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ");
    verbosity.note(format_args!("wrote {written} ({w}x{h}, {spp} spp of {} parts)", merged.parts.len()));
    Ok(if record.nonfinite > 0 { EXIT_NONFINITE } else { EXIT_OK })
}

/// Whether it is an OpenEXR file, by its first bytes: of a picture too little is left to be joined to the bits of one.
fn is_picture(path: &Path) -> bool {
    input::read_at_most(path, 4).is_ok_and(|bytes| bytes == [0x76, 0x2f, 0x31, 0x01])
}

/// The EXR and the previews.
fn outputs(args: &MergeArgs) -> Result<(Option<&Path>, Vec<&Path>)> {
    let refuse = |option, problem: String| Err(Error::Option { option, problem });
    if let Some(picture) = args.parts.iter().find(|path| is_picture(path)) {
        let problem =
            "it is a picture, which has not kept the sums; render parts with --sample-range A..B and merge the \
                       .checkpoint that each saves"
                .into();
        return Err(Error::Part { path: picture.clone(), problem });
    }
    let extension = |path: &Path| path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    let (mut exr, mut pngs) = (None, Vec::new());
    match extension(&args.output).as_deref() {
        Some("exr") => exr = Some(args.output.as_path()),
        Some("png") => pngs.push(args.output.as_path()),
        _ => return refuse("--output", format!("{}: the name must end in .exr or .png", args.output.display())),
    }
    if let Some(png) = &args.png {
        if extension(png).as_deref() != Some("png") {
            return refuse("--png", format!("{}: the name must end in .png", png.display()));
        }
        pngs.push(png);
    }
    if exr.is_none() && (args.half || args.reproducible) {
        return refuse("--half", "it and --reproducible apply to OpenEXR only: the output must end in .exr".into());
    }
    if let Some(option) = args.exr.given().filter(|_| exr.is_none()) {
        return refuse(option, "it applies to OpenEXR only: the output must end in .exr".into());
    }
    let inputs: Vec<PathBuf> = args.parts.iter().filter_map(|path| path.canonicalize().ok()).collect();
    for path in exr.into_iter().chain(pngs.iter().copied()).chain(args.stats.as_deref()) {
        check_writable(path)?;
        if path.canonicalize().is_ok_and(|file| inputs.contains(&file)) {
            return refuse("--output", format!("{} is also a part", path.display()));
        }
    }
    Ok((exr, pngs))
}

fn record(merged: &Merged, seconds_merge: f64) -> Record {
    let (film, counters) = (&merged.render.film, &merged.render.counters);
    let part = |part: &crate::render::merge::Part| PartRecord {
        file: part.path.display().to_string(),
        samples: [part.samples.0, part.samples.1],
        window: [part.window.width, part.window.height, part.window.x, part.window.y],
    };
    Record {
        schema: crate::stats::SCHEMA,
        command: "merge",
        parts: merged.parts.iter().map(part).collect(),
        resolution: [film.resolution.0, film.resolution.1],
        spp: [film.spp().min, film.spp().max],
        paths: counters.paths,
        nonfinite: counters.nonfinite,
        gaps: merged.gaps.clone(),
        accepted: merged.about.accepted.clone(),
        film_hash: format!("{:016x}", film.hash()),
        film_digest: format!("{:016x}", film.digest()),
        seconds_render: merged.render.render_time.as_secs_f64(),
        seconds_merge,
        denoised: None,
    }
}
