//! The page of `render --report`: picture, noise, layers, plan, biases, how the error fell, statistics, command line.

use super::{picture, record};
use crate::cli::live::frame::Frame;
use crate::cli::report::duration;
use crate::cli::words;
use crate::error::Result;
use crate::film::Film;
use crate::film::channel::Channel;
use crate::film::ids::Ids;
use crate::film::look::Look;
use crate::machine::Processor;
use crate::plan::Aov;
use crate::plan::aov::Gathers;
use crate::plan::bias::Bias;
use crate::plot::axes::{Axis, Plot};
use crate::plot::heat::HeatMap;
use crate::plot::html::{self, Page};
use crate::plot::number::short;
use crate::plot::svg::escaped;
use crate::render::{Render, Renderer, StopReason};
use crate::stats::Stats;
use crate::stats::curve::{CurvePoint, ErrorCurve};

/// Most columns and rows of the small pictures of layers.
const SMALL: usize = 320;

/// Options that say when a render ends.
const LIMITS: [&str; 6] = ["spp", "time", "error", "min_spp", "best_effort", "sample_range"];

/// What the page shows besides the render.
pub struct Shown<'s> {
    /// Its statistics.
    pub stats: &'s Stats,
    /// What the picture looks like.
    pub look: &'s Look,
    /// Layers that were asked for.
    pub aovs: &'s [Aov],
    /// How the error fell.
    pub curve: Option<&'s ErrorCurve>,
    /// Whether it went on from a saved state, before which the clock of the curve did not run.
    pub resumed: bool,
    /// The options that it was given, by their names.
    pub given: Vec<(String, Vec<String>)>,
    /// Which frame of a sequence it is.
    pub frame: Option<u32>,
}

/// The page.
///
/// # Errors
/// As [`Look::preview`].
pub fn page(renderer: &Renderer, render: &Render, shown: &Shown) -> Result<String> {
    let (stats, film) = (shown.stats, &render.film);
    let frame = shown.frame.map_or(String::new(), |frame| format!(", frame {frame}"));
    let name = format!("{}{frame}", stats.scene.file);
    let mut page = Page::new(&format!("pathspace render: {name}"), &name);
    page.facts(facts(renderer, render, stats));
    let size = (film.window.width, film.window.height);
    let picture = html::picture(&shown.look.preview(film)?.png(), size, "the picture");
    let looks = format!("The picture, exposure {} EV, tone curve {}.", shown.look.exposure_ev, shown.look.tone_map);
    let mut pictures = vec![html::figure(&picture, &looks)];
    if stats.error.is_some() {
        let what = "Standard error of each pixel, relative to it or to a tenth of the mean";
        pictures.push(picture::map(&noise(film), size, "its noise", what));
    }
    page.pair(pictures);
    let layers: Vec<String> = shown.aovs.iter().flat_map(|&aov| layer(film, aov, renderer.plan().max_depth)).collect();
    if !layers.is_empty() {
        page.heading("Layers");
        page.markup("<div class=\"pair many\">\n");
        layers.iter().for_each(|layer| page.markup(layer));
        page.markup("</div>\n");
    }
    plan(renderer, &mut page);
    ledger(&stats.bias, &mut page);
    curves(shown, &mut page);
    page.heading("Statistics");
    page.table(&["of --stats", "value"], &record::rows(stats, &["effects", "bias"]));
    commands(render, shown, &mut page);
    Ok(page.finish())
}

fn facts(renderer: &Renderer, render: &Render, stats: &Stats) -> Vec<(&'static str, String)> {
    let (plan, window) = (renderer.plan(), render.film.window);
    let [width, height] = stats.resolution;
    let mut picture = format!("{width} × {height} pixels");
    if (window.width, window.height) != (width, height) {
        picture +=
            &format!(", of which {} × {} at {},{} are rendered", window.width, window.height, window.x, window.y);
    }
    let stop = match render.stop {
        StopReason::Spp => "all samples are done",
        StopReason::Time => "the time was up",
        StopReason::Error => "the error target was met",
        StopReason::Callback => "a signal",
        StopReason::Fault => "a worker failed",
        StopReason::Texture => "a texture could not be read",
    };
    let spp = match stats.spp.min == stats.spp.max {
        true => stats.spp.min.to_string(),
        false => format!("{} to {}", stats.spp.min, stats.spp.max),
    };
    let noise = stats.error.as_ref().map_or("not known: it takes two samples per pixel".into(), |error| {
        let percent = |relmse: f64| short(100.0 * relmse.sqrt());
        let [low, high] = error.interval.map(percent);
        let target = error.target.map_or(String::new(), |target| format!("; asked for {} %", short(100.0 * target)));
        format!("{} % relative RMSE, estimated (95 %: {low} to {high} %){target}", percent(error.relmse))
    });
    vec![
        ("picture", picture),
        ("samples", format!("{spp} per pixel, seed {}", stats.seed)),
        ("noise", noise),
        ("time", format!("{} of rendering, {} in all", duration(stats.seconds.render), duration(stats.seconds.total))),
        ("ended by", stop.into()),
        ("machine", format!("{}, {} threads, {}", Processor::detect().name, plan.threads, stats.isa)),
        ("version", format!("pathspace {}", env!("CARGO_PKG_VERSION"))),
    ]
}

/// The standard error of each pixel's mean, relative to the pixel.
fn noise(film: &Film) -> HeatMap {
    let frame = Frame::of(film);
    let (colors, errors): (Vec<[f32; 3]>, Vec<f64>) =
        frame.pixels.chunks_exact(4).map(|p| ([p[0], p[1], p[2]], f64::from(p[3]))).unzip();
    HeatMap::of(&picture::relative(&errors, &colors))
}

/// Small pictures of a layer: one, or one for each number of scatterings that carries light.
fn layer(film: &Film, aov: Aov, max_depth: u32) -> Vec<String> {
    if let Some(lists) = film.ids(aov) {
        return vec![ids(film, aov, lists)];
    }
    let channels = film.channels(&[aov], max_depth);
    let groups = channels.chunk_by(|a, b| a.layer() == b.layer());
    let lit = |group: &&[Channel]| {
        aov.gathers() != Gathers::PathLengths || group.iter().any(|c| c.values.iter().any(|value| *value != 0.0))
    };
    groups.filter(lit).map(|group| small(film, aov, group)).collect()
}

/// A small picture of one to three channels. Errors are drawn as a map, colours as they are, and other values from dark
/// to light between their least and their largest, each component in a primary colour.
fn small(film: &Film, aov: Aov, channels: &[Channel]) -> String {
    let (places, size) = places(film);
    let value = |channel: usize, p: usize| f64::from(channels[channel].values[p]);
    let name = channels[0].layer();
    let is_color = channels.len() == 3 && channels[0].name.ends_with(".R");
    let (bytes, range) = if is_color && aov.gathers() == Gathers::Nothing {
        let mean = |&p: &usize| (0..3).map(|c| value(c, p)).sum::<f64>() / 3.0;
        let map = HeatMap::of(&places.iter().map(mean).collect::<Vec<_>>());
        let range = format!(": <span class=\"scale\"></span> 0 to {} and above", short(map.end));
        (map.bytes, range)
    } else if is_color {
        // What a first hit has needs no light; parts of the light are often too faint to be seen beside the whole.
        let stops = match aov.gathers() {
            Gathers::FirstHit => 0,
            _ => stops(places.iter().map(|&p| (0..3).map(|c| value(c, p)).fold(0.0, f64::max))),
        };
        let color = |&p: &usize| picture::clipped([0, 1, 2].map(|c| value(c, p) * f64::from(stops).exp2()));
        let range = if stops > 0 { format!(", exposure +{stops} EV") } else { String::new() };
        (places.iter().flat_map(color).collect(), range)
    } else {
        // The largest f32 stands for nothing there.
        let there = |value: &f32| value.abs() < f32::MAX;
        let values = || channels.iter().flat_map(|c| &c.values).copied().filter(there).map(f64::from);
        let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        let code = |value: f64| (255.0 * ((value - low) / (high - low)).clamp(0.0, 1.0)).round() as u8;
        let pixel = |&p: &usize| match channels.len() {
            1 => [code(value(0, p)); 3],
            n => [0, 1, 2].map(|c| if c < n { code(value(c, p)) } else { 0 }),
        };
        let range = if low <= high { format!(": {} to {}", short(low), short(high)) } else { String::new() };
        (places.iter().flat_map(pixel).collect(), range)
    };
    picture::figure(&bytes, size, name, &format!("<code>{}</code>{range}", escaped(name)))
}

/// By how many stops a small picture of such values is exposed more, so that the brightest hundredth is nearly white;
/// at most 12.
fn stops(values: impl Iterator<Item = f64>) -> i32 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let bright = values.get(values.len() * 99 / 100).copied().unwrap_or(0.0);
    if bright > 0.0 { (0.8 / bright).log2().floor().clamp(0.0, 12.0) as i32 } else { 0 }
}

/// The pixels that a small picture shows, and its size.
fn places(film: &Film) -> (Vec<usize>, (u32, u32)) {
    let (width, height) = (film.window.width as usize, film.window.height as usize);
    let step = width.max(height).div_ceil(SMALL).max(1);
    let row = |y: usize| (0..width.div_ceil(step)).map(move |x| y * step * width + x * step);
    let places = (0..height.div_ceil(step)).flat_map(row).collect();
    (places, (width.div_ceil(step) as u32, height.div_ceil(step) as u32))
}

/// A small picture of ids, each in a colour that is made of its bits, mixed by their shares.
fn ids(film: &Film, aov: Aov, lists: &[Ids]) -> String {
    let (places, size) = places(film);
    let mixed = |&p: &usize| {
        let shares = lists[p].ranked();
        let channel = |shift: u32| {
            let part = |&(id, share): &(u32, f64)| share * f64::from(id >> shift & 0xff) / 255.0;
            shares.iter().map(part).sum::<f64>()
        };
        picture::clipped([0, 7, 14].map(channel))
    };
    let bytes: Vec<u8> = places.iter().flat_map(mixed).collect();
    picture::figure(&bytes, size, aov.name(), &format!("<code>{}</code>", escaped(aov.name())))
}

/// What is simulated, what is not, and by what.
fn plan(renderer: &Renderer, page: &mut Page) {
    let (record, info) = (renderer.record(), renderer.backend_info());
    let list = |names: &[String]| if names.is_empty() { "nothing".to_string() } else { names.join(", ") };
    page.heading("Plan");
    let rays = &record.rays;
    page.facts([
        ("asked for", list(&record.effects.found)),
        ("simulated", list(&record.effects.simulated)),
        ("backend", format!("{} {} ({}): {}", record.backend.name, info.version, info.isa, record.backend.reason)),
        ("rays", format!("camera {}, bounce {}, shadow {}", rays.camera, rays.bounce, rays.shadow)),
        ("stages", record.stages.join(", ")),
    ]);
    let ignored: Vec<String> =
        record.effects.ignored.iter().map(|ignored| format!("{}: {}", ignored.what, ignored.why)).collect();
    match ignored.is_empty() {
        true => page.paragraph("Everything that is asked for is simulated."),
        false => {
            page.paragraph("Not simulated:");
            page.list(ignored.iter().map(String::as_str));
        }
    }
    let warnings: Vec<String> = renderer.scene().warnings.iter().map(|w| format!("{}: {}", w.place, w.what)).collect();
    if !warnings.is_empty() {
        page.paragraph("Warnings of the scene:");
        page.list(warnings.iter().map(String::as_str));
    }
}

/// Everything that makes the expected picture differ from the true one.
fn ledger(biases: &[Bias], page: &mut Page) {
    let percent = |share: Option<f64>| share.map_or("not known".into(), |share| format!("{} %", short(100.0 * share)));
    let row = |bias: &Bias| {
        vec![
            format!("<span class=\"long\">{}</span>", escaped(&bias.what)),
            percent(bias.energy_removed),
            percent(bias.energy_removed_at_most),
            bias.radiance_removed_at_most.map_or("not known".into(), short),
        ]
    };
    page.heading("Ledger of biases");
    let head = ["bias", "energy removed", "at most (95 %)", "any radiance lacks at most, W/(sr·m²)"];
    page.table(&head, &biases.iter().map(row).collect::<Vec<_>>());
}

/// How the estimated error fell, where there are points enough for a line.
fn curves(shown: &Shown, page: &mut Page) {
    let points = shown.curve.map_or(&[][..], ErrorCurve::points);
    let target = shown.stats.error.and_then(|error| error.target);
    let drawn = |x: &dyn Fn(&CurvePoint) -> f64, label: &str| {
        let points: Vec<_> = points.iter().filter(|point| x(point) > 0.0 && point.error > 0.0).collect();
        if points.len() < 2 {
            return None;
        }
        let line: Vec<(f64, f64)> = points.iter().map(|point| (x(point), 100.0 * point.error)).collect();
        let errors = line.iter().map(|point| point.1).chain(target.map(|target| 100.0 * target));
        let mut plot = Plot::new(Axis::log(line.iter().map(|point| point.0), label), Axis::log(errors, "noise, %"));
        if let Some(target) = target {
            let ends = [plot.x.low, plot.x.high].map(|x| (x, 100.0 * target));
            plot.line(&ends, "stroke:var(--ink);stroke-width:1;stroke-dasharray:6 4");
        }
        plot.line(&line, "stroke:var(--c0);stroke-width:2");
        for (at, point) in line.iter().zip(&points) {
            let title = format!("{} spp, {} s, {} %", point.spp, short(point.seconds), short(at.1));
            plot.dot(*at, 0, false, &title);
        }
        Some(html::figure(&plot.svg.inline(&format!("Noise against {label}")), ""))
    };
    let seconds = (!shown.resumed).then(|| drawn(&|point| point.seconds, "seconds of rendering")).flatten();
    let plots: Vec<String> = seconds.into_iter().chain(drawn(&|point| point.spp as f64, "samples per pixel")).collect();
    if plots.is_empty() {
        return;
    }
    page.heading("Noise");
    let dashed = if target.is_some() { " Dashed: the target." } else { "" };
    page.paragraph(&format!("Estimated relative RMSE after passes of samples.{dashed}"));
    page.pair(plots);
}

/// How to render it again.
fn commands(render: &Render, shown: &Shown, page: &mut Page) {
    let mut given = shown.given.clone();
    if let Some(frame) = shown.frame {
        given = words::of_frame(given, frame);
    }
    page.heading("Command line");
    page.code(&format!("pathspace render{}", words::line(&given)));
    if render.stop == StopReason::Spp {
        return;
    }
    let spp = render.film.spp();
    if spp.min == spp.max {
        given.retain(|(option, _)| !LIMITS.contains(&option.as_str()));
        given.push(match render.film.first_sample {
            0 => ("spp".into(), vec!["--spp".into(), spp.min.to_string()]),
            first => ("sample_range".into(), vec!["--sample-range".into(), format!("{first}..{}", first + spp.min)]),
        });
        page.paragraph("The same samples on any clock:");
        page.code(&format!("pathspace render{}", words::line(&given)));
    } else {
        page.paragraph("It ended within a pass: no number of samples per pixel gives the same bits.");
    }
}
