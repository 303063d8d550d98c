//! Plots of a report as SVG text. Colours are CSS variables of the page, so that they follow its light and dark scheme.

use super::report::{Report, Row};
use super::settings::Role;
use super::table::{error_of, saved};
use crate::plot::axes::{Axis, MARGIN, Plot, WIDTH};
use crate::plot::number::short;
use crate::plot::svg::{Anchor, COLOURS};

/// The techniques that are drawn: the default and those that change one thing, as many as there are colours.
pub fn drawn(report: &Report) -> Vec<&Row> {
    let single = |row: &&Row| row.role != Role::Knob && row.name.matches("--").count() <= 1 && row.curve.len() > 1;
    report.settings.iter().filter(single).take(COLOURS).collect()
}

/// Relative RMSE against seconds from the start of the program, a line a technique, bands of 95 %.
pub fn error_against_time(report: &Report) -> String {
    let fixed = report.setup.fixed_s;
    let rows = drawn(report);
    let own = report.reference.as_ref().and_then(|r| r.own_relmse).map(|own| 100.0 * error_of(own.value));
    let points = |row: &Row| -> Vec<(f64, f64)> {
        row.curve.iter().map(|p| (fixed + p.seconds, 100.0 * error_of(p.relmse.value))).collect()
    };
    let all: Vec<(f64, f64)> = rows.iter().flat_map(|row| points(row)).collect();
    let x = Axis::log(all.iter().map(|p| p.0), "seconds from the start of the program");
    let y = Axis::log(all.iter().map(|p| p.1).chain(own), "relative RMSE, %");
    let mut plot = Plot::new(x, y);
    // Guides through the middle of the default's line.
    if let Some(&(t, e)) = rows.first().map(|row| points(row)).as_ref().and_then(|p| p.get(p.len() / 2)) {
        // The label of the flatter one stands above its line, that of the steeper one below.
        for (power, name, shift) in [(-0.5, "slope −1/2", -5.0), (-0.75, "slope −3/4", 15.0)] {
            let (a, b) = (plot.x.low, plot.x.high);
            let at = |x: f64| e * (x / t).powf(power);
            let ends: Vec<(f64, f64)> = (0..=60)
                .map(|i| a * (b / a).powf(f64::from(i) / 60.0))
                .map(|x| (x, at(x)))
                .filter(|p| p.1 > plot.y.low && p.1 < plot.y.high)
                .collect();
            plot.line(&ends, "stroke:var(--faint);stroke-width:1;stroke-dasharray:2 4");
            if let Some(&(x, y)) = ends.last() {
                let (x, y) = plot.place(x, y);
                plot.text((x.min(WIDTH - MARGIN[1] - 4.0), y + shift), Anchor::End, name);
            }
        }
    }
    if let Some(own) = own {
        plot.line(&[(plot.x.low, own), (plot.x.high, own)], "stroke:var(--ink);stroke-width:1;stroke-dasharray:6 4");
        let (x, y) = plot.place(plot.x.low, own);
        plot.text(
            (x + 6.0, y - 5.0),
            Anchor::Start,
            &format!("the reference's own error, {} % (subtracted)", short(own)),
        );
    }
    for (colour, row) in rows.iter().enumerate() {
        let band = |end: &dyn Fn(&super::runs::Interval) -> f64| -> Vec<(f64, f64)> {
            let point = |p: &super::report::CurvePoint| (fixed + p.seconds, 100.0 * error_of(end(&p.relmse)));
            row.curve.iter().filter(|p| p.relmse.high.is_finite()).map(point).collect()
        };
        let mut outline = band(&|r| r.low);
        outline.extend(band(&|r| r.high).into_iter().rev());
        plot.area(&outline, colour);
        let line = points(row);
        plot.line(&line, &format!("stroke:var(--c{colour});stroke-width:2"));
        for (point, p) in line.iter().zip(&row.curve) {
            let title = format!("{}: {} spp, {} s, {} %", row.name, p.spp, short(point.0), short(point.1));
            plot.dot(*point, colour, false, &title);
        }
    }
    plot.svg.inline("Relative error against time, by technique")
}

/// What the targets cost: predicted with intervals, and measured.
pub fn price_list(report: &Report) -> String {
    let prices = &report.prices;
    let measured = prices.iter().filter_map(|p| p.measured);
    let reached = |m: &super::report::MeasuredRecord| m.error.or(m.estimated.map(|e| e.value)).map(|e| 100.0 * e);
    let xs = prices.iter().flat_map(|p| [p.seconds.low, p.seconds.high]).chain(measured.clone().map(|m| m.seconds));
    let ys = prices.iter().map(|p| 100.0 * p.error).chain(measured.clone().filter_map(|m| reached(&m)));
    let mut plot = Plot::new(Axis::log(xs, "seconds, load and build included"), Axis::log(ys, "relative RMSE, %"));
    let side = |f: &dyn Fn(&super::runs::Interval) -> f64| -> Vec<(f64, f64)> {
        prices.iter().map(|p| (f(&p.seconds), 100.0 * p.error)).collect()
    };
    let mut outline = side(&|s| s.low);
    outline.extend(side(&|s| s.high).into_iter().rev());
    plot.area(&outline, 0);
    plot.line(&side(&|s| s.value), "stroke:var(--c0);stroke-width:2");
    for price in prices {
        let title = format!("{} %: predicted {} s", short(100.0 * price.error), short(price.seconds.value));
        plot.dot((price.seconds.value, 100.0 * price.error), 0, true, &title);
        if let Some((m, error)) = price.measured.and_then(|m| Some((m, reached(&m)?))) {
            let title = format!("measured: {} spp, {} s, {} %", m.spp, short(m.seconds), short(error));
            plot.dot((m.seconds, error), 1, false, &title);
        }
    }
    plot.svg.inline("What an error costs: predicted and measured")
}

/// √bias² against the time that a knob saves; numbers refer to the list under the plot.
pub fn bias_against_time(report: &Report) -> String {
    let rows = knobs(report);
    let bias =
        |row: &Row| row.bias_squared.map(|b| (100.0 * error_of(b.value), b.low > 0.0, b.map(|v| 100.0 * error_of(v))));
    let time = |row: &Row| row.time_ratio.map(|t| saved(&t));
    let finite = |v: f64| if v.is_finite() { Some(100.0 * v) } else { None };
    let xs = rows.iter().flat_map(|row| {
        time(row).map_or(vec![0.0], |t| [t.value, t.low, t.high].into_iter().filter_map(finite).collect())
    });
    let ys = rows.iter().filter_map(|row| bias(row)).map(|(value, seen, ends)| if seen { value } else { ends.high });
    let x = Axis::linear(xs.chain([0.0]), "processor time saved, %");
    let y = Axis::log(ys.filter(|v| v.is_finite()), "bias (√bias²), % of the picture");
    let mut plot = Plot::new(x, y);
    plot.line(&[(0.0, plot.y.low), (0.0, plot.y.high)], "stroke:var(--ink);stroke-width:1;stroke-dasharray:6 4");
    let mut labels: Vec<(f64, f64)> = Vec::new();
    for (i, row) in rows.iter().enumerate() {
        let Some((value, seen, ends)) = bias(row) else { continue };
        let colour = i % COLOURS;
        let t = time(row);
        let x = t.map_or(0.0, |t| 100.0 * t.value);
        let y = if seen { value } else { ends.high };
        if !y.is_finite() || y <= 0.0 {
            continue;
        }
        let style = format!("stroke:var(--c{colour});stroke-width:1.5");
        if let Some(t) = t.filter(|t| t.low.is_finite() && t.high.is_finite()) {
            plot.line(&[(100.0 * t.low, y), (100.0 * t.high, y)], &style);
        }
        if seen {
            plot.line(&[(x, ends.low), (x, ends.high)], &style);
        } else {
            // Nothing was seen: the true value lies below.
            let (px, py) = plot.place(x, y);
            plot.svg.arrow_down((px, py), &style);
        }
        let title =
            format!("{}: bias {}{} %, time saved {} %", row.name, if seen { "" } else { "below " }, short(y), short(x));
        plot.dot((x, y), colour, !seen, &title);
        // Numbers step aside from those already there.
        let (px, py) = plot.place(x, y);
        let mut at = (px + 8.0, (py - 6.0).max(MARGIN[2] + 14.0));
        while labels.iter().any(|l| (l.0 - at.0).abs() < 16.0 && (l.1 - at.1).abs() < 12.0) {
            at.0 += 16.0;
        }
        labels.push(at);
        plot.text(at, Anchor::Start, &(i + 1).to_string());
    }
    plot.svg.inline("Bias against the time it saves")
}

/// The knobs in the order of their numbers.
pub fn knobs(report: &Report) -> Vec<&Row> {
    report.settings.iter().filter(|row| row.role == Role::Knob).collect()
}

/// Share of the mean that each length of path carries, and what a limit there leaves out.
pub fn path_lengths(report: &Report) -> String {
    let Some(lengths) = &report.lengths else { return String::new() };
    let n = lengths.share.len();
    let left_out: Vec<f64> = lengths.truncation.iter().map(|t| -100.0 * t.value).collect();
    let ys = lengths.share.iter().map(|s| 100.0 * s.value).chain(left_out.iter().copied());
    let mut y = Axis::log(ys.filter(|v| *v > 1e-7), "% of the mean");
    // Bars need a foot below the least of them.
    y.low /= 2.0;
    let x = Axis {
        low: 0.4,
        high: n as f64 + 0.6,
        log: false,
        label: "edges of the path (the last: that many or more)".into(),
    };
    let mut plot = Plot::new(x, y);
    for (i, share) in lengths.share.iter().enumerate() {
        let edge = (i + 1) as f64;
        let ((left, top), (right, base)) =
            (plot.place(edge - 0.35, 100.0 * share.value), plot.place(edge + 0.35, plot.y.low));
        let title = format!("{} edges: {} %", i + 1, short(100.0 * share.value));
        plot.svg.rect((left, top), (right - left, base - top), "fill:var(--c0);opacity:.55", &title);
    }
    let edge = |(i, v): (usize, &f64)| ((i + 1) as f64, *v);
    let line: Vec<(f64, f64)> = left_out.iter().enumerate().map(edge).take_while(|(_, v)| *v > plot.y.low).collect();
    plot.line(&line, "stroke:var(--c1);stroke-width:2");
    for (edge, v) in line {
        plot.dot((edge, v), 1, false, &format!("--max-depth {edge}: leaves out {} %", short(v)));
    }
    plot.svg.inline("What each path length carries")
}
