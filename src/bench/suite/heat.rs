//! The table of the suite as a map: a row a scene, a column a backend, lighter where it takes longer. What a render
//! takes has a frame.

use super::{NEAR, Report};
use crate::plot::heat;
use crate::plot::svg::{Anchor, Svg};

/// Sizes in the drawing.
const LABELS: f64 = 190.0;
const CELL: (f64, f64) = (92.0, 20.0);
const TOP: f64 = 84.0;
const MARGIN: f64 = 16.0;

/// Time over the fastest that is drawn in the lightest colour.
const END: f64 = 2.0;

/// Draws the report.
pub fn svg(report: &Report) -> String {
    let rows = report.scenes.len() as f64;
    let width = 2.0 * MARGIN + LABELS + CELL.0 * (report.backends.len() as f64 + 1.0);
    let mut out = Svg::new(width, TOP + rows * CELL.1 + 30.0);
    let title = "Time of a path's rays over the fastest backend's";
    out.styled_text((MARGIN, 26.0), Anchor::Start, r#"font-size="16" font-weight="bold""#, title);
    let machine = &report.machine;
    let line = format!("{} ({}), {} threads; framed: what a render takes", machine.cpu, machine.isa, machine.threads);
    out.text((MARGIN, 46.0), Anchor::Start, &line);
    for (column, name) in report.backends.iter().enumerate() {
        let x = MARGIN + LABELS + (column as f64 + 0.5) * CELL.0;
        out.styled_text((x, TOP - 8.0), Anchor::Middle, r#"font-weight="bold""#, name);
    }
    for (i, row) in report.scenes.iter().enumerate() {
        let y = TOP + i as f64 * CELL.1;
        out.text((MARGIN, y + 14.0), Anchor::Start, &row.name);
        for (column, name) in report.backends.iter().enumerate() {
            let Some(timed) = row.timed.iter().find(|timed| timed.name == *name) else { continue };
            let x = MARGIN + LABELS + column as f64 * CELL.0;
            let value = (timed.over_fastest - 1.0) / (END - 1.0);
            let [r, g, b] = heat::heat(value);
            let frame = if row.chosen == *name { ";stroke:var(--c0);stroke-width:3" } else { "" };
            let title = format!("{}, {name}: {:.3} µs a path", row.name, timed.us_per_path);
            let (size, at) = ((CELL.0 - 4.0, CELL.1 - 4.0), (x + 2.0, y + 2.0));
            out.rect(at, size, &format!("fill:rgb({r},{g},{b}){frame}"), &title);
            let ink = if value > 0.55 { "fill:#000" } else { "fill:#fff" };
            let style = format!(r#"style="{ink}""#);
            let place = (x + 0.5 * CELL.0, y + 14.0);
            out.styled_text(place, Anchor::Middle, &style, &format!("{:.2}", timed.over_fastest));
        }
        let x = MARGIN + LABELS + report.backends.len() as f64 * CELL.0 + 8.0;
        let verdict = if row.chosen_over_fastest <= NEAR { "within 5 %" } else { "beyond 5 %" };
        out.text((x, y + 14.0), Anchor::Start, verdict);
    }
    let line = format!("the choice is within 5 % of the fastest on {} of {} scenes", report.near, report.scenes.len());
    out.text((MARGIN, TOP + rows * CELL.1 + 18.0), Anchor::Start, &line);
    out.file(title)
}
