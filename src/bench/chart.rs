//! The report as a chart: one panel per class of rays with a bar for each backend and query mode, and the frame figure
//! below. SVG 1.1 without scripts or fonts of its own; every number is also written out.

use std::fmt::Write;

use super::Report;
use super::rates::{BackendRates, Rate};
use super::record::RayClass;

/// Sizes in pixels of the drawing.
const WIDTH: f64 = 960.0;
const MARGIN: f64 = 24.0;
const LABELS: f64 = 150.0;
const ROW: f64 = 17.0;
const PANEL_GAP: f64 = 20.0;
const HEADER: f64 = 76.0;
const FOOTER: f64 = 104.0;

/// Colours of one thread and of all (Okabe and Ito 2008: told apart by every kind of colour vision).
const ONE: &str = "#56b4e9";
const ALL: &str = "#0072b2";
const ACCENT: &str = "#d55e00";
const INK: &str = "#222222";
const FAINT: &str = "#d8d8d8";

/// Draws the report.
pub fn svg(report: &Report) -> String {
    let rows: Vec<Row> = report.backends.iter().flat_map(rows_of).collect();
    let threads = report.machine.threads;
    let per_row = if threads > 1 { 2.0 } else { 1.0 };
    let panel_height = rows.len() as f64 * (ROW * per_row * 0.62 + 7.0) + 24.0;
    let height = HEADER + panel_height + FOOTER;
    let panel_width = (WIDTH - 2.0 * MARGIN - LABELS - 2.0 * PANEL_GAP) / 3.0;

    let mut out = String::new();
    let _ = writeln!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height:.0}\" width=\"{WIDTH}\" \
         height=\"{height:.0}\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"12\" fill=\"{INK}\">"
    );
    let _ = writeln!(out, "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>");
    text(&mut out, (MARGIN, 28.0), Look::Title, &format!("Ray throughput: {}", report.scene.file));
    let machine = format!(
        "{} triangles · {} ({}) · pathspace {}",
        report.scene.triangles, report.machine.cpu, report.machine.isa, report.pathspace
    );
    text(&mut out, (MARGIN, 47.0), Look::Plain, &machine);
    legend(&mut out, threads);

    for (panel, class) in RayClass::ALL.into_iter().enumerate() {
        let x = MARGIN + LABELS + panel as f64 * (panel_width + PANEL_GAP);
        text(&mut out, (x, HEADER + 10.0), Look::Bold, &format!("{} rays, 10⁶/s", class.name()));
        let rates = || rows.iter().flat_map(|row| row.rates.iter()).filter(|rate| rate.class == class.name());
        let largest = rates().map(|rate| rate.mrays_per_s).fold(0.0, f64::max);
        // Room for the number behind the longest bar.
        let scale = (panel_width - 40.0) / largest.max(f64::MIN_POSITIVE);
        let mut y = HEADER + 20.0;
        for row in &rows {
            if panel == 0 {
                let middle = y + ROW * per_row * 0.31 + 4.0;
                text(&mut out, (MARGIN + LABELS - 10.0, middle), Look::Right, &row.label);
            }
            for rate in row.rates.iter().filter(|rate| rate.class == class.name()) {
                let colour = if rate.threads == threads { ALL } else { ONE };
                bar(&mut out, (x, y), rate.mrays_per_s * scale, (colour, &number(rate.mrays_per_s)));
                y += ROW * 0.62;
            }
            y += 7.0;
        }
        let _ = writeln!(
            out,
            "<line x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{:.1}\" y2=\"{y:.1}\" stroke=\"{INK}\"/>",
            HEADER + 16.0
        );
    }
    frame(&mut out, report, HEADER + panel_height + 14.0);
    out.push_str("</svg>\n");
    out
}

/// One mode of one backend.
struct Row<'r> {
    label: String,
    rates: Vec<&'r Rate>,
}

fn rows_of(backend: &BackendRates) -> Vec<Row<'_>> {
    let mut rows: Vec<Row> = Vec::new();
    for rate in &backend.rays {
        let label = format!("{} {}", backend.name, rate.mode_effective);
        match rows.last_mut().filter(|row| row.label == label) {
            Some(row) => row.rates.push(rate),
            None => rows.push(Row { label, rates: vec![rate] }),
        }
    }
    rows
}

/// How a line of text looks.
enum Look {
    Title,
    Plain,
    Bold,
    Small,
    Right,
}

fn text(out: &mut String, at: (f64, f64), look: Look, line: &str) {
    let style = match look {
        Look::Title => "font-size=\"17\" font-weight=\"bold\"",
        Look::Plain => "",
        Look::Bold => "font-weight=\"bold\"",
        Look::Small => "font-size=\"10\"",
        Look::Right => "text-anchor=\"end\"",
    };
    let line = line.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    let _ = writeln!(out, "<text x=\"{:.1}\" y=\"{:.1}\" {style}>{line}</text>", at.0, at.1);
}

fn bar(out: &mut String, at: (f64, f64), length: f64, (colour, label): (&str, &str)) {
    let (x, y) = at;
    let _ = writeln!(
        out,
        "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{length:.1}\" height=\"{:.1}\" fill=\"{colour}\"/>",
        ROW * 0.55
    );
    text(out, (x + length + 4.0, y + ROW * 0.5), Look::Small, label);
}

fn legend(out: &mut String, threads: usize) {
    let mut entries = vec![(ALL, format!("{threads} threads"))];
    if threads > 1 {
        entries.insert(0, (ONE, "1 thread".into()));
    } else {
        entries[0].1 = "1 thread".into();
    }
    let mut x = WIDTH - MARGIN - 90.0 * entries.len() as f64;
    for (colour, name) in entries {
        let _ = writeln!(out, "<rect x=\"{x:.1}\" y=\"38\" width=\"10\" height=\"10\" fill=\"{colour}\"/>");
        text(out, (x + 15.0, 47.0), Look::Plain, &name);
        x += 90.0;
    }
}

/// The frame figure: the bare rays' time inside the render's.
fn frame(out: &mut String, report: &Report, y: f64) {
    let frame = &report.frame;
    let [width, height] = frame.resolution;
    let title = format!(
        "Frame: {width}×{height}, {} spp, {}, {} threads: tracing efficiency {:.2}",
        frame.spp, frame.backend, frame.threads, frame.tracing_efficiency
    );
    text(out, (MARGIN, y + 10.0), Look::Bold, &title);
    let full = WIDTH - 2.0 * MARGIN;
    let bare = full * frame.tracing_efficiency.clamp(0.0, 1.0);
    let _ =
        writeln!(out, "<rect x=\"{MARGIN}\" y=\"{:.1}\" width=\"{full}\" height=\"16\" fill=\"{FAINT}\"/>", y + 20.0);
    let _ = writeln!(
        out,
        "<rect x=\"{MARGIN}\" y=\"{:.1}\" width=\"{bare:.1}\" height=\"16\" fill=\"{ACCENT}\"/>",
        y + 20.0
    );
    let [low, high] = frame.tracing_efficiency_range;
    let line = format!(
        "its rays traced bare {:.3} s (orange) of the render's {:.3} s; {low:.2} to {high:.2} in {} pairs; {:.2}·10⁶ paths/s",
        frame.bare_trace_s, frame.render_s, frame.pairs, frame.mpaths_per_s
    );
    text(out, (MARGIN, y + 52.0), Look::Plain, &line);
    let total = &report.agreement.total;
    let against: Vec<&str> = report.agreement.against.iter().map(|other| other.name).collect();
    if !against.is_empty() {
        let line = format!(
            "agreement of {} with {}: of {} rays {} differ in hit, {} in distance",
            against.join(" and "),
            report.agreement.reference,
            total.rays,
            total.hit_differs,
            total.distance_differs
        );
        text(out, (MARGIN, y + 70.0), Look::Plain, &line);
    }
}

/// Three digits.
pub fn number(value: f64) -> String {
    let decimals = if value < 10.0 {
        2
    } else if value < 100.0 {
        1
    } else {
        0
    };
    format!("{value:.decimals$}")
}
