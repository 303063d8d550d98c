//! The plot of the price of effects, as SVG text.

use super::effects::EffectRow;
use super::report::Report;
use super::runs::Interval;
use crate::plot::axes::{Axis, MARGIN, Plot};
use crate::plot::number::short;
use crate::plot::svg::{Anchor, COLOURS};

/// The error of the picture without an effect against the time that this saves: those that were measured and seen.
pub fn svg(report: &Report) -> String {
    let rows = seen(report);
    let points: Vec<(f64, Interval)> =
        rows.iter().filter_map(|row| Some((100.0 * row.time_share?.value, row.error?.map(|e| 100.0 * e)))).collect();
    if points.is_empty() {
        return String::new();
    }
    let x = Axis::linear(points.iter().map(|p| p.0).chain([0.0]), "processor time to equal error that it takes, %");
    let y = Axis::log(points.iter().map(|p| p.1.value), "relative RMSE without it, %");
    let mut plot = Plot::new(x, y);
    plot.line(&[(0.0, plot.y.low), (0.0, plot.y.high)], "stroke:var(--ink);stroke-width:1;stroke-dasharray:6 4");
    for (i, (row, (x, error))) in rows.iter().zip(&points).enumerate() {
        let colour = i % COLOURS;
        let (low, high) = (error.low.max(plot.y.low), error.high.min(plot.y.high));
        plot.line(&[(*x, low), (*x, high)], &format!("stroke:var(--c{colour});stroke-width:1.5"));
        let title = format!("{}: {} % of the time, error without {} %", row.name, short(*x), short(error.value));
        plot.dot((*x, error.value), colour, false, &title);
        let (px, py) = plot.place(*x, error.value);
        plot.text((px + 8.0, (py - 6.0).max(MARGIN[2] + 14.0)), Anchor::Start, &(i + 1).to_string());
    }
    plot.svg.inline("What is lost without an effect, against the time that it takes")
}

/// The effects in the order of their numbers: those whose absence is seen.
pub fn seen(report: &Report) -> Vec<&EffectRow> {
    let is_seen = |row: &&EffectRow| {
        row.time_share.is_some_and(|share| share.value.is_finite())
            && row.error.is_some_and(|error| error.value > 0.0)
            && row.place.is_some()
    };
    report.effects.iter().flatten().filter(is_seen).collect()
}
