//! A report as one page: what errors look like, price list, techniques, knobs, path lengths, pictures.

use super::class_tables;
use super::crops;
use super::effects_page;
use super::findings::Study;
use super::plot;
use super::reference::values;
use super::report::{Report, Row};
use super::runs::Interval;
use super::settings::Role;
use super::table::{bias_percent, error_of, predicted_text, saved};
use super::words::with_interval;
use crate::film::png;
use crate::plot::heat::HeatMap;
use crate::plot::html::{self, Page, mark};
use crate::plot::number::short;
use crate::plot::svg::{COLOURS, escaped};

/// The page.
pub fn page(report: &Report, study: &Study) -> String {
    let s = &report.setup;
    let mut page = Page::new(&format!("pathspace accuracy: {}", s.scene), &format!("What accuracy costs: {}", s.scene));
    crops::section(report, study, &mut page);
    page.heading("The study");
    let mut facts = vec![
        ("picture", format!("{} × {} pixels", s.resolution[0], s.resolution[1])),
        ("machine", format!("{}, {} threads", s.cpu, s.threads)),
        ("backend", s.backend.clone()),
        ("default", s.options.clone()),
        ("time", format!("{:.1} s of {:.1} s; load and build {:.3} s", s.seconds, s.budget_s, s.fixed_s)),
        ("load", s.load.map_or("not known".into(), |l| format!("{l:.2} runnable processes per processor"))),
        ("seeds", format!("pilot {}, runs from {}, reference from {}", s.seeds[0], s.seeds[1], s.seeds[2])),
        ("version", format!("pathspace {}", s.version)),
    ];
    if let Some(r) = &report.reference {
        let own = r.own_relmse.map_or("not known".into(), |o| with_interval(&o.map(error_of), 100.0) + " %");
        let runs = if r.spp > 0 { format!("{} runs of {} spp", r.runs, r.spp) } else { r.what.clone() };
        facts.push(("reference", format!("{runs}; its own relative RMSE {own}; ε = {:.3e}", r.epsilon)));
    }
    page.facts(facts);
    prices(report, &mut page);
    techniques(report, &mut page);
    knobs(report, &mut page);
    lengths(report, &mut page);
    if let Some(classes) = &report.classes {
        class_tables::section(classes, &mut page);
    }
    effects_page::html(report, study, &mut page);
    pictures(study, &mut page);
    page.heading("How to read this");
    page.list(report.notes.iter().map(String::as_str));
    page.finish()
}

/// A value, and its interval in small print below.
fn cell(i: &Interval, scale: f64, signs: bool) -> String {
    let i = i.map(|v| v * scale);
    let number = |v: f64| format!("{}{}", if signs && v > 0.0 { "+" } else { "" }, short(v));
    if i.low.is_finite() && i.high.is_finite() {
        format!("{}<small>{} to {}</small>", number(i.value), number(i.low), number(i.high))
    } else {
        number(i.value)
    }
}

/// [`cell`], or a dash.
fn cell_or_dash(i: Option<Interval>, scale: f64, signs: bool) -> String {
    i.map_or("–".into(), |i| cell(&i, scale, signs))
}

fn prices(report: &Report, page: &mut Page) {
    if report.prices.is_empty() {
        return;
    }
    page.heading("Price list");
    let rows: Vec<Vec<String>> = report
        .prices
        .iter()
        .map(|p| {
            let predicted = |of: &Interval| match p.caution {
                Some(_) => escaped(&predicted_text(p, of)),
                None => cell(of, 1.0, false),
            };
            let mut row = vec![format!("{} %", 100.0 * p.error), predicted(&p.spp), predicted(&p.seconds)];
            row.extend(match p.measured {
                Some(m) => [
                    m.spp.to_string(),
                    short(m.seconds),
                    m.error.map_or("–".into(), |e| format!("{:.2} %", 100.0 * e)),
                    cell_or_dash(m.estimated, 100.0, false),
                ],
                None => ["beyond the budget".into(), "–".into(), "–".into(), "–".into()],
            });
            row
        })
        .collect();
    let head = [
        "relative RMSE",
        "spp, predicted",
        "seconds, predicted",
        "spp, run",
        "seconds, run",
        "error, run",
        "own estimate",
    ];
    page.table(&head, &rows);
    let slope = report.pilot_slope.map_or(String::new(), |[s, e]| {
        format!("Pilot: relMSE falls as spp to the power {s:.3} ± {e:.3} (the error as half of that).")
    });
    let legend = mark(0, "predicted, with 95 % interval") + &mark(1, "measured") + &slope;
    page.figure(&plot::price_list(report), &legend);
}

/// The ratio; a rule of honesty puts words in its place when it may be 1.
fn efficiency_cell(row: &Row) -> String {
    match row.efficiency {
        Some(e) if row.no_measurable_difference && e.high.is_finite() => {
            format!("no measurable difference<small>{} to {}</small>", short(e.low), short(e.high))
        }
        None if row.role == Role::Default => "1".into(),
        e => cell_or_dash(e, 1.0, false),
    }
}

fn techniques(report: &Report, page: &mut Page) {
    let rows: Vec<&Row> = report.settings.iter().filter(|row| row.role != Role::Knob).collect();
    let Some(first) = rows.first() else { return };
    page.heading("Techniques: error against time");
    let legend: String = plot::drawn(report)
        .iter()
        .enumerate()
        .map(|(colour, row)| {
            let slope = row.slope.map_or(String::new(), |[s, e]| format!(" (slope {s:.2} ± {e:.2})"));
            mark(colour, &(row.name.clone() + &slope))
        })
        .collect();
    let legend =
        legend + "Slopes are of relMSE against samples; the lines show its square root. Bands: 95 % over runs.";
    page.figure(&plot::error_against_time(report), &legend);
    page.paragraph(&format!("At {} samples per pixel, {} runs of each:", first.spp, first.runs));
    let cells = |row: &&Row| {
        let dash = || "–".to_string();
        vec![
            format!("<code>{}</code>", escaped(&row.name)),
            cell_or_dash(row.relmse.map(|r| r.map(error_of)), 100.0, false),
            row.slope.map_or(dash(), |[s, e]| format!("{s:.3}<small>± {e:.3}</small>")),
            row.cpu_s_per_spp.map_or(dash(), |c| short(1e3 * c.value)),
            row.wall_s_per_spp.map_or(dash(), |c| short(1e3 * c.value)),
            efficiency_cell(row),
            cell_or_dash(row.seconds_to_1_percent, 1.0, false),
            cell_or_dash(row.mean_error, 100.0, true),
            row.percentiles.map(|p| short(100.0 * p)).join(" / "),
            row.flip.map_or(dash(), |f| short(f.value)),
        ]
    };
    let head = [
        "setting",
        "relative RMSE, %",
        "slope",
        "CPU ms/spp",
        "wall ms/spp",
        "efficiency",
        "seconds to 1 %",
        "mean error, %",
        "pixels: 50 / 95 / 99.9 %, %",
        "FLIP",
    ];
    page.table(&head, &rows.iter().map(cells).collect::<Vec<_>>());
}

fn knobs(report: &Report, page: &mut Page) {
    let rows = plot::knobs(report);
    if rows.is_empty() {
        return;
    }
    page.heading("Knobs: bias against time saved");
    let legend: String =
        rows.iter().enumerate().map(|(i, row)| mark(i % COLOURS, &format!("{} {}", i + 1, row.name))).collect();
    let legend = legend + "Hollow with an arrow: no bias was seen; it lies below the mark. Bars: 95 %.";
    page.figure(&plot::bias_against_time(report), &legend);
    let default = report.settings.iter().filter(|row| row.role == Role::Default);
    let cells = |row: &Row| {
        let dash = || "–".to_string();
        vec![
            format!("<code>{}</code>", escaped(&row.name)),
            cell_or_dash(row.mean_error, 100.0, true),
            cell_or_dash(row.bias_squared, 1.0, true),
            row.bias_squared.map_or(dash(), |b| escaped(&bias_percent(&b))),
            cell_or_dash(row.time_ratio.map(|t| saved(&t)), 100.0, true),
            row.relmse.map_or(dash(), |r| short(100.0 * error_of(r.value))),
        ]
    };
    let head = [
        "setting",
        "mean error, %",
        "bias² (relMSE)",
        "bias, %",
        "processor time saved, %",
        "relative \
        RMSE, %",
    ];
    page.table(&head, &default.chain(rows.iter().copied()).map(cells).collect::<Vec<_>>());
    page.paragraph("The default's own row is against the reference, all others are against the default.");
}

fn lengths(report: &Report, page: &mut Page) {
    let Some(lengths) = &report.lengths else { return };
    page.heading("Path lengths");
    let own = format!(
        "The default's own limit leaves out about {} % (a geometric tail, estimated).",
        short(-100.0 * lengths.default_truncation)
    );
    let legend = mark(0, "share of the mean") + &mark(1, "left out by a depth limit there") + &own;
    page.figure(&plot::path_lengths(report), &legend);
}

fn pictures(study: &Study, page: &mut Page) {
    let (Some(film), Some(reference)) = (&study.film, &study.reference) else { return };
    let (w, h) = (film.window.width, film.window.height);
    let picture = values(film);
    let shown: Vec<u8> = picture.iter().map(|v| png::srgb_byte(f64::from(*v))).collect();
    let errors: Vec<f64> = reference.relative_squares(&picture).iter().map(|square| square.sqrt()).collect();
    let map = HeatMap::of(&errors);
    let drawn = |bytes: &[u8], alt: &str| html::picture(&png::encode_rgb(bytes, w, h), (w, h), alt);
    let legend = format!("The default at {} samples per pixel, one run.", study.top_spp);
    let error_legend = format!("Relative error of each pixel against the reference: {}.", html::scale(&map));
    page.heading("Pictures");
    page.pair([
        html::figure(&drawn(&shown, "the picture"), &legend),
        html::figure(&drawn(&map.bytes, "its error"), &error_legend),
    ]);
}
