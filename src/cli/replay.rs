//! `pathspace render --pixel`: no picture, but what the paths of one pixel did, on stdout as text or JSON. Floats are
//! printed with the fewest digits that read back as the same bits.

use std::fmt::Write;
use std::time::Instant;

use serde::Serialize;

use super::args::RenderArgs;
use super::job::{self, Fallback};
use super::output::{EXIT_NONFINITE, EXIT_OK, print, to_json};
use super::report::Verbosity;
use super::waiting::Waiting;
use crate::error::{Error, Result};
use crate::film::Pixel;
use crate::plain::one_line;
use crate::render::{DEFAULT_SPP, Renderer};
use crate::transport::replay::Replay;
use crate::transport::vertex::{Emission, LightSample, Met, Number, Roulette, Scattering, Shadow, Surface, Vertex};

/// Samples that are listed at most: some hundred bytes of memory each.
const MOST_SAMPLES: u64 = 1 << 22;

/// Runs `render` for the samples of one pixel.
///
/// # Errors
/// As a render's; and for a pixel outside the picture.
pub fn run(args: &RenderArgs, pixel: (u32, u32)) -> Result<u8> {
    job::check(&args.settings)?;
    let count = args.spp.unwrap_or(if args.time.is_some() { MOST_SAMPLES } else { DEFAULT_SPP });
    if count > MOST_SAMPLES {
        let problem = format!("{count} samples of a pixel; expected at most {MOST_SAMPLES}, or one by --sample");
        return Err(Error::Option { option: "--spp", problem });
    }
    let verbosity = Verbosity::of(args.quiet, args.verbose);
    let waiting = Waiting::begin(verbosity, "loading and building");
    let scene = &job::load(&args.scene, &args.settings, Fallback::of(args))?;
    verbosity.warnings(&scene.warnings);
    let renderer = Renderer::new(scene, job::options(args, scene))?;
    drop(waiting);
    if let Some(sample) = args.sample {
        let replay = renderer.replay(pixel, sample)?;
        print(&if args.json { to_json(&replay) } else { story(&replay) })?;
        scene.check_textures()?;
        return Ok(if replay.nonfinite_bounce.is_some() { EXIT_NONFINITE } else { EXIT_OK });
    }
    let waiting = Waiting::begin(verbosity, "replaying");
    let start = Instant::now();
    // One at least, so that there is something to tell.
    let goes_on = |sample: &u64| *sample == 0 || args.time.is_none_or(|time| start.elapsed() < time);
    let samples = (0..count).take_while(goes_on).map(|sample| renderer.replay(pixel, sample).map(|r| Line::of(&r)));
    let summary = Summary::of(pixel, samples.collect::<Result<_>>()?);
    drop(waiting);
    print(&if args.json { to_json(&summary) } else { table(&summary) })?;
    scene.check_textures()?;
    Ok(if summary.nonfinite > 0 { EXIT_NONFINITE } else { EXIT_OK })
}

/// All samples of a pixel.
#[derive(Serialize)]
struct Summary {
    pixel: [u32; 2],
    /// The pixel of the film: mean of R, G, B and coverage over the samples.
    mean: [f64; 4],
    /// Samples that are not finite and count as 0.
    nonfinite: usize,
    /// The sample that adds the most, by the largest of its channels; the first of equals.
    largest: Option<u64>,
    samples: Vec<Line>,
}

/// One sample in a line.
#[derive(Serialize)]
struct Line {
    sample: u64,
    /// Vertices of its path.
    vertices: usize,
    radiance: [Number; 3],
    /// What the film adds for it.
    film: [f64; 4],
    /// Share of its largest channel in the sum of that channel over the pixel's samples.
    share: f64,
    nonfinite_bounce: Option<u32>,
    end: &'static str,
}

impl Line {
    fn of(replay: &Replay) -> Self {
        Line {
            sample: replay.sample,
            vertices: replay.vertices.len(),
            radiance: replay.radiance,
            film: replay.film,
            share: 0.0,
            nonfinite_bounce: replay.nonfinite_bounce,
            end: replay.vertices.last().and_then(|vertex| vertex.end).map_or("", |end| end.name()),
        }
    }
}

impl Summary {
    fn of(pixel: (u32, u32), mut samples: Vec<Line>) -> Self {
        let first = samples.first().map_or(0, |line| line.sample);
        let film = Pixel::of_samples(first, &samples.iter().map(|line| line.film).collect::<Vec<_>>());
        let sums: [f64; 4] = std::array::from_fn(|c| film.sum[0][c] + film.sum[1][c]);
        for line in &mut samples {
            let shares = (0..3).filter(|&c| sums[c] != 0.0).map(|c| line.film[c] / sums[c]);
            line.share = shares.fold(0.0, |most: f64, share| if share.abs() > most.abs() { share } else { most });
        }
        let brightest = |line: &Line| line.film[..3].iter().fold(0.0, |most: f64, c| most.max(c.abs()));
        let most = samples.iter().map(brightest).fold(0.0, f64::max);
        Summary {
            pixel: [pixel.0, pixel.1],
            mean: film.mean(),
            nonfinite: samples.iter().filter(|line| line.nonfinite_bounce.is_some()).count(),
            largest: samples.iter().find(|line| most > 0.0 && brightest(line) == most).map(|line| line.sample),
            samples,
        }
    }
}

fn table(summary: &Summary) -> String {
    let [x, y] = summary.pixel;
    let mut text = format!("pixel {x},{y}: {} samples; radiance in W/(sr·m²)\n", summary.samples.len());
    text += "    sample  vertices             R             G             B     share  path ended by\n";
    for line in &summary.samples {
        let mark = match line.nonfinite_bounce {
            Some(_) => '!',
            None if summary.largest == Some(line.sample) => '*',
            None => ' ',
        };
        let [r, g, b] = line.radiance.map(|c| format!("{:.6e}", c.0));
        let share = 100.0 * line.share;
        let _ = write!(
            text,
            "{mark} {:>8}  {:>8}  {r:>12}  {g:>12}  {b:>12}  {share:>6.2} %  {}",
            line.sample, line.vertices, line.end
        );
        let _ = match line.nonfinite_bounce {
            Some(bounce) => writeln!(text, "; not finite from bounce {bounce} on"),
            None => writeln!(text),
        };
    }
    let [r, g, b, a] = summary.mean;
    let _ = writeln!(text, "mean of the pixel: {r:?}, {g:?}, {b:?}; coverage {a:?}");
    if let Some(line) = summary.samples.iter().find(|line| summary.largest == Some(line.sample)) {
        let share = 100.0 * line.share;
        let _ = writeln!(text, "* largest: {share:.2} % of the pixel's sum; --sample {} shows its path", line.sample);
    }
    if summary.nonfinite > 0 {
        let _ = writeln!(text, "! {} samples are not finite and count as 0", summary.nonfinite);
    }
    text
}

/// One path, vertex by vertex.
pub fn story(replay: &Replay) -> String {
    let [x, y] = replay.pixel;
    let [film_x, film_y] = replay.film_position.map(|p| p.0);
    let mut text = format!(
        "pixel {x},{y} sample {}: camera ray through {film_x:?}, {film_y:?} px; filter weight {:?}\n\
         positions in m, densities in 1/sr, radiance in W/(sr·m²)\n",
        replay.sample, replay.filter_weight.0
    );
    if let Some(time) = replay.time {
        let _ = writeln!(text, "time {:?} of the shutter (0 open, 1 closed)", time.0);
    }
    replay.vertices.iter().for_each(|vertex| tell(&mut text, vertex));
    let (radiance, [r, g, b, a]) = (list(&replay.radiance), replay.film);
    let _ = writeln!(text, "\nradiance {radiance}; coverage {:?}", replay.coverage.0);
    if let Some(bounce) = replay.nonfinite_bounce {
        let _ = writeln!(text, "not finite from bounce {bounce} on: the film counts it as 0");
    }
    let told = replay.told().map(Number);
    if told.map(|c| c.0.to_bits()) != replay.radiance.map(|c| c.0.to_bits()) && replay.nonfinite_bounce.is_none() {
        let _ = writeln!(text, "the contributions above add up to {} instead: please report this", list(&told));
    }
    let _ = writeln!(text, "the film adds weight · (R, G, B, coverage) = ({r:?}, {g:?}, {b:?}, {a:?})");
    text
}

fn tell(text: &mut String, vertex: &Vertex) {
    let _ = writeln!(text, "\nvertex {}, bounce {}", vertex.edge, vertex.edge - 1);
    let mut line = |name: &str, what: String| {
        let _ = writeln!(text, "  {name:<11} {what}");
    };
    line("ray", format!("from {:?} along -wo = {}", vertex.origin_m, list(&vertex.direction)));
    line("throughput", list(&vertex.throughput));
    match &vertex.met {
        Met::Infinity => line("met", "nothing".into()),
        Met::Medium(medium) => {
            line("met", format!("'{}' after {} m", one_line(&medium.medium), medium.distance_m.0));
        }
        Met::Surface(surface) => met(&mut line, surface),
    }
    if let Some(Emission { radiance, bsdf_pdf_sa, light_pdf_sa, mis_weight, contribution }) = &vertex.emission {
        let (radiance, added) = (list(radiance), list(contribution));
        let pdfs = format!("density of the BSDF sample {:?}, of light sampling {:?}", bsdf_pdf_sa.0, light_pdf_sa.0);
        line("emission", format!("{radiance}; {pdfs}; MIS weight {:?}", mis_weight.0));
        line("", format!("contribution {added}"));
    }
    if let Some(Roulette { survival, number, survived }) = vertex.roulette {
        let verdict = if survived { "goes on" } else { "ends" };
        line("roulette", format!("survival {:?}, number {:?}: {verdict}", survival.0, number.0));
    }
    if let Some(sample) = &vertex.light {
        light(&mut line, sample);
    }
    if let Some(Scattering { lobe, alpha, wi, pdf_sa, weight, eta }) = &vertex.scattering {
        let rough = 0.0 < alpha.0 && alpha.0 < 1.0;
        let alpha = if rough { format!(" of alpha {:?}", alpha.0) } else { String::new() };
        let eta = if eta.0 == 1.0 { String::new() } else { format!(", relative index {:?}", eta.0) };
        line("scattering", format!("{lobe}{alpha}, wi = {}, density {:?}{eta}", list(wi), pdf_sa.0));
        line("", format!("f·cos/density {}", list(weight)));
    }
    line("gathered", list(&vertex.gathered));
    if let Some(end) = vertex.end {
        line("end", end.name().into());
    }
}

fn met(line: &mut impl FnMut(&str, String), surface: &Surface) {
    let kind = surface.kind.map_or(String::new(), |kind| format!(", {kind}"));
    let side = if surface.front { "front" } else { "back" };
    let instance = surface.instance.map_or(String::new(), |instance| format!(" of placement {instance}"));
    let place = format!("mesh {} triangle {}{instance}", surface.mesh, surface.triangle);
    line(
        "met",
        format!("\"{}\"{kind}, {side} side, {:?} m away; {place}", one_line(&surface.material), surface.distance_m.0),
    );
    line("position", format!("{:?} ± {:?} along the normal", surface.position_m, surface.error_m.0));
    let (geometric, shading) = (list(&surface.normal_geometric), list(&surface.normal_shading));
    line("normals", format!("geometric {geometric}, shading {shading}"));
    if let Some(transmittance) = &surface.transmittance {
        line("absorption", format!("transmittance of the way here {}", list(transmittance)));
    }
}

fn light(line: &mut impl FnMut(&str, String), sample: &LightSample) {
    let far = sample.distance_m.map_or("infinity".into(), |distance| format!("{:?} m", distance.0));
    line("light", format!("wi = {}, {far}; radiance {}", list(&sample.wi), list(&sample.radiance)));
    let (light, bsdf) = (sample.light_pdf_sa.0, sample.bsdf_pdf_sa.0);
    let weight = sample.mis_weight.0;
    line("", format!("density of light sampling {light:?}, of the BSDF {bsdf:?}; MIS weight {weight:?}"));
    let outcome = match sample.outcome {
        Shadow::Visible => "visible, added",
        Shadow::Blocked => "blocked",
        Shadow::NotTraced => "not traced",
    };
    line("", format!("f·cos {}; contribution {}: {outcome}", list(&sample.f_cos), list(&sample.contribution)));
}

fn list(values: &[Number; 3]) -> String {
    let [a, b, c] = values.map(|value| value.0);
    format!("({a:?}, {b:?}, {c:?})")
}
