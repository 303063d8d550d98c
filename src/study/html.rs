//! A report as one page that needs nothing else: plots as SVG, pictures as PNG in data URIs, no script, light and dark
//! by the reader's scheme.

use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::findings::Study;
use super::plot;
use super::reference::values;
use super::report::{Report, Row};
use super::runs::Interval;
use super::settings::Role;
use super::table::{bias_percent, error_of, saved, short, with_interval};
use crate::film::png;
use crate::plot::svg::{COLOURS, escaped};

const STYLE: &str = include_str!("report.css");

/// The page.
pub fn page(report: &Report, study: &Study) -> String {
    let s = &report.setup;
    let scene = escaped(&s.scene);
    let mut body = format!("<h1>What accuracy costs: {scene}</h1>\n");
    let facts = [
        ("picture", format!("{} × {} pixels", s.resolution[0], s.resolution[1])),
        ("machine", format!("{}, {} threads", s.cpu, s.threads)),
        ("backend", s.backend.clone()),
        ("default", s.options.clone()),
        ("time", format!("{:.1} s of {:.1} s; load and build {:.3} s", s.seconds, s.budget_s, s.fixed_s)),
        ("load", s.load.map_or("not known".into(), |l| format!("{l:.2} runnable processes per processor"))),
        ("seeds", format!("pilot {}, runs from {}, reference from {}", s.seeds[0], s.seeds[1], s.seeds[2])),
        ("version", format!("pathspace {}", s.version)),
    ];
    body.push_str("<dl>");
    for (name, value) in facts {
        let _ = write!(body, "<dt>{name}</dt><dd>{}</dd>", escaped(&value));
    }
    if let Some(r) = &report.reference {
        let own = r.own_relmse.map_or("not known".into(), |o| with_interval(&o.map(error_of), 100.0) + " %");
        let runs = if r.spp > 0 { format!("{} runs of {} spp", r.runs, r.spp) } else { escaped(&r.what) };
        let _ = write!(body, "<dt>reference</dt><dd>{runs}; its own relative RMSE {own}; ε = {:.3e}</dd>", r.epsilon);
    }
    body.push_str("</dl>\n");
    prices(report, &mut body);
    techniques(report, &mut body);
    knobs(report, &mut body);
    lengths(report, &mut body);
    pictures(study, &mut body);
    body.push_str("<h2>How to read this</h2>\n<ul>");
    for note in &report.notes {
        let _ = write!(body, "<li>{}</li>", escaped(note));
    }
    body.push_str("</ul>\n");
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>pathspace accuracy: {scene}</title>\n<style>\n{STYLE}</style></head>\n<body>\n{body}</body></html>\n"
    )
}

/// A table; the first column is text, the others numbers.
fn table(head: &[&str], rows: &[Vec<String>], body: &mut String) {
    body.push_str("<div class=\"wide\"><table><thead><tr>");
    for name in head {
        let _ = write!(body, "<th>{}</th>", escaped(name));
    }
    body.push_str("</tr></thead><tbody>\n");
    for row in rows {
        body.push_str("<tr>");
        for cell in row {
            let _ = write!(body, "<td>{cell}</td>");
        }
        body.push_str("</tr>\n");
    }
    body.push_str("</tbody></table></div>\n");
}

fn figure(svg: &str, legend: &str, body: &mut String) {
    let _ = writeln!(body, "<figure>{svg}<figcaption>{legend}</figcaption></figure>");
}

/// A coloured mark and its label.
fn mark(colour: usize, text: &str) -> String {
    format!("<span class=\"mark\"><i style=\"background:var(--c{colour})\"></i>{}</span> ", escaped(text))
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

fn prices(report: &Report, body: &mut String) {
    if report.prices.is_empty() {
        return;
    }
    body.push_str("<h2>Price list</h2>\n");
    let rows: Vec<Vec<String>> = report
        .prices
        .iter()
        .map(|p| {
            let mut row =
                vec![format!("{} %", 100.0 * p.error), cell(&p.spp, 1.0, false), cell(&p.seconds, 1.0, false)];
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
    table(&head, &rows, body);
    let slope = report.pilot_slope.map_or(String::new(), |[s, e]| {
        format!("Pilot: relMSE falls as spp to the power {s:.3} ± {e:.3} (the error as half of that).")
    });
    let legend = mark(0, "predicted, with 95 % interval") + &mark(1, "measured") + &slope;
    figure(&plot::price_list(report), &legend, body);
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

fn techniques(report: &Report, body: &mut String) {
    let rows: Vec<&Row> = report.settings.iter().filter(|row| row.role != Role::Knob).collect();
    let Some(first) = rows.first() else { return };
    body.push_str("<h2>Techniques: error against time</h2>\n");
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
    figure(&plot::error_against_time(report), &legend, body);
    let _ = writeln!(body, "<p>At {} samples per pixel, {} runs of each:</p>", first.spp, first.runs);
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
    table(&head, &rows.iter().map(cells).collect::<Vec<_>>(), body);
}

fn knobs(report: &Report, body: &mut String) {
    let rows = plot::knobs(report);
    if rows.is_empty() {
        return;
    }
    body.push_str("<h2>Knobs: bias against time saved</h2>\n");
    let legend: String =
        rows.iter().enumerate().map(|(i, row)| mark(i % COLOURS, &format!("{} {}", i + 1, row.name))).collect();
    let legend = legend + "Hollow with an arrow: no bias was seen; it lies below the mark. Bars: 95 %.";
    figure(&plot::bias_against_time(report), &legend, body);
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
    table(&head, &default.chain(rows.iter().copied()).map(cells).collect::<Vec<_>>(), body);
    body.push_str("<p>The default's own row is against the reference, all others are against the default.</p>\n");
}

fn lengths(report: &Report, body: &mut String) {
    let Some(lengths) = &report.lengths else { return };
    body.push_str("<h2>Path lengths</h2>\n");
    let own = format!(
        "The default's own limit leaves out about {} % (a geometric tail, estimated).",
        short(-100.0 * lengths.default_truncation)
    );
    let legend = mark(0, "share of the mean") + &mark(1, "left out by a depth limit there") + &own;
    figure(&plot::path_lengths(report), &legend, body);
}

fn pictures(study: &Study, body: &mut String) {
    let (Some(film), Some(reference)) = (&study.film, &study.reference) else { return };
    let (w, h) = (film.window.width, film.window.height);
    let picture = values(film);
    let shown: Vec<u8> = picture.iter().map(|v| png::srgb_byte(f64::from(*v))).collect();
    let squares = reference.relative_squares(&picture);
    let mut sorted = squares.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    // The scale ends where 99 % of the pixels do: a single firefly would turn all others black.
    let top = sorted[(sorted.len() - 1) * 99 / 100].sqrt().max(f64::MIN_POSITIVE);
    let errors: Vec<u8> = squares.iter().flat_map(|s| heat(s.sqrt() / top)).collect();
    let _ = writeln!(body, "<h2>Pictures</h2>\n<div class=\"pair\">");
    let uri = |bytes: &[u8]| format!("data:image/png;base64,{}", STANDARD.encode(png::encode_rgb(bytes, w, h)));
    let _ = writeln!(
        body,
        "<figure><img src=\"{}\" width=\"{w}\" height=\"{h}\" alt=\"the picture\"><figcaption>The default at {} \
         samples per \
         pixel, one run.</figcaption></figure>",
        uri(&shown),
        study.top_spp
    );
    let _ = writeln!(
        body,
        "<figure><img src=\"{}\" width=\"{w}\" height=\"{h}\" alt=\"its error\"><figcaption>Relative error of \
         each pixel \
         against the reference: <span class=\"scale\"></span> 0 to {} % and above.</figcaption></figure>\n</div>",
        uri(&errors),
        short(100.0 * top)
    );
}

/// Colours of increasing lightness for values from 0 to 1: matplotlib's `inferno` at five points, straight between.
fn heat(value: f64) -> [u8; 3] {
    const STOPS: [[f64; 3]; 5] =
        [[0.0, 0.0, 4.0], [87.0, 16.0, 110.0], [188.0, 55.0, 84.0], [249.0, 142.0, 9.0], [252.0, 255.0, 164.0]];
    let place = 4.0 * if value.is_finite() { value.clamp(0.0, 1.0) } else { 1.0 };
    let below = (place as usize).min(3);
    let share = place - below as f64;
    std::array::from_fn(|c| (STOPS[below][c] * (1.0 - share) + STOPS[below + 1][c] * share).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::heat;

    #[test]
    fn heat_runs_from_dark_to_light() {
        assert_eq!(heat(0.0), [0, 0, 4]);
        assert_eq!(heat(1.0), [252, 255, 164]);
        assert_eq!(heat(0.5), [188, 55, 84]);
        assert_eq!((heat(7.0), heat(f64::NAN)), (heat(1.0), heat(1.0)));
    }
}
