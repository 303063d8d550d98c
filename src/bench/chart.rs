//! The report as a chart: one panel per class of rays with a bar for each backend and query mode, and the frame figure
//! below. Every number is also written out.

use super::Report;
use super::rates::{BackendRates, Rate};
use super::record::RayClass;
use crate::plot::svg::{Anchor, Svg};

/// Sizes in pixels of the drawing.
const WIDTH: f64 = 960.0;
const MARGIN: f64 = 24.0;
const LABELS: f64 = 150.0;
const ROW: f64 = 17.0;
const PANEL_GAP: f64 = 20.0;
const HEADER: f64 = 76.0;
const FOOTER: f64 = 104.0;

/// Fills of one thread, of all, of the bare rays, and of the render behind them.
const ONE: &str = "fill:var(--c5)";
const ALL: &str = "fill:var(--c0)";
const ACCENT: &str = "fill:var(--c1)";
const BEHIND: &str = "fill:var(--rule)";

/// Attributes of texts.
const TITLE: &str = r#"font-size="17" font-weight="bold""#;
const BOLD: &str = r#"font-weight="bold""#;
const SMALL: &str = r#"font-size="10""#;

/// Draws the report.
pub fn svg(report: &Report) -> String {
    let rows: Vec<Row> = report.backends.iter().flat_map(rows_of).collect();
    let threads = report.machine.threads;
    let per_row = if threads > 1 { 2.0 } else { 1.0 };
    let panel_height = rows.len() as f64 * (ROW * per_row * 0.62 + 7.0) + 24.0;
    let panel_width = (WIDTH - 2.0 * MARGIN - LABELS - 2.0 * PANEL_GAP) / 3.0;

    let mut out = Svg::new(WIDTH, HEADER + panel_height + FOOTER);
    let title = format!("Ray throughput: {}", report.scene.file);
    out.styled_text((MARGIN, 28.0), Anchor::Start, TITLE, &title);
    let machine = format!(
        "{} triangles · {} ({}) · pathspace {}",
        report.scene.triangles, report.machine.cpu, report.machine.isa, report.pathspace
    );
    out.text((MARGIN, 47.0), Anchor::Start, &machine);
    legend(&mut out, threads);

    for (panel, class) in RayClass::ALL.into_iter().enumerate() {
        let x = MARGIN + LABELS + panel as f64 * (panel_width + PANEL_GAP);
        out.styled_text((x, HEADER + 10.0), Anchor::Start, BOLD, &format!("{} rays, 10⁶/s", class.name()));
        let rates = || rows.iter().flat_map(|row| row.rates.iter()).filter(|rate| rate.class == class.name());
        let largest = rates().map(|rate| rate.mrays_per_s).fold(0.0, f64::max);
        // Room for the number behind the longest bar.
        let scale = (panel_width - 40.0) / largest.max(f64::MIN_POSITIVE);
        let mut y = HEADER + 20.0;
        for row in &rows {
            if panel == 0 {
                let middle = y + ROW * per_row * 0.31 + 4.0;
                out.text((MARGIN + LABELS - 10.0, middle), Anchor::End, &row.label);
            }
            for rate in row.rates.iter().filter(|rate| rate.class == class.name()) {
                let length = rate.mrays_per_s * scale;
                out.rect((x, y), (length, ROW * 0.55), if rate.threads == threads { ALL } else { ONE }, "");
                let end = (x + length + 4.0, y + ROW * 0.5);
                out.styled_text(end, Anchor::Start, SMALL, &number(rate.mrays_per_s));
                y += ROW * 0.62;
            }
            y += 7.0;
        }
        out.line(&[(x, HEADER + 16.0), (x, y)], "stroke:var(--ink)");
    }
    frame(&mut out, report, HEADER + panel_height + 14.0);
    out.file(&title)
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

fn legend(out: &mut Svg, threads: usize) {
    let mut entries = vec![(ALL, format!("{threads} threads"))];
    if threads > 1 {
        entries.insert(0, (ONE, "1 thread".into()));
    } else {
        entries[0].1 = "1 thread".into();
    }
    let mut x = WIDTH - MARGIN - 90.0 * entries.len() as f64;
    for (fill, name) in entries {
        out.rect((x, 38.0), (10.0, 10.0), fill, "");
        out.text((x + 15.0, 47.0), Anchor::Start, &name);
        x += 90.0;
    }
}

/// The frame figure: the bare rays' time inside the render's.
fn frame(out: &mut Svg, report: &Report, y: f64) {
    let frame = &report.frame;
    let [width, height] = frame.resolution;
    let title = format!(
        "Frame: {width}×{height}, {} spp, {}, {} threads: tracing efficiency {:.2}",
        frame.spp, frame.backend, frame.threads, frame.tracing_efficiency
    );
    out.styled_text((MARGIN, y + 10.0), Anchor::Start, BOLD, &title);
    let full = WIDTH - 2.0 * MARGIN;
    out.rect((MARGIN, y + 20.0), (full, 16.0), BEHIND, "");
    out.rect((MARGIN, y + 20.0), (full * frame.tracing_efficiency.clamp(0.0, 1.0), 16.0), ACCENT, "");
    let [low, high] = frame.tracing_efficiency_range;
    let line = format!(
        "its rays traced bare {:.3} s (orange) of the render's {:.3} s; {low:.2} to {high:.2} in {} pairs; \
         {:.2}·10⁶ paths/s",
        frame.bare_trace_s, frame.render_s, frame.pairs, frame.mpaths_per_s
    );
    out.text((MARGIN, y + 52.0), Anchor::Start, &line);
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
        out.text((MARGIN, y + 70.0), Anchor::Start, &line);
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
