//! Plots of a report as SVG text. Colours are CSS variables of the page (`--c0` … `--c7`, `--ink`, `--faint`), so that they
//! follow its light and dark scheme; sizes are in units of the view box, which scales with the page.

use std::fmt::Write;

use super::report::{Report, Row};
use super::settings::Role;
use super::table::{error_of, saved, short};

/// View box.
const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 430.0;

/// Margins of the frame: left, right, top, bottom.
const MARGIN: [f64; 4] = [72.0, 20.0, 14.0, 52.0];

/// Series that a plot tells apart by colour.
pub const COLOURS: usize = 8;

/// One axis: its range, how it runs, what it is.
struct Axis {
    low: f64,
    high: f64,
    log: bool,
    label: String,
}

impl Axis {
    /// A logarithmic axis around `values` (those above 0), with some air.
    fn log(values: impl Iterator<Item = f64>, label: &str) -> Self {
        let usable = values.filter(|v| *v > 0.0 && v.is_finite());
        let (low, high) = usable.fold((f64::INFINITY, 0.0f64), |(a, b), v| (a.min(v), b.max(v)));
        let (low, high) = if low <= high { (low / 1.3, high * 1.3) } else { (0.1, 1.0) };
        // Half a decade at least, so that there are ticks to read.
        let middle = (low * high).sqrt();
        Axis { low: low.min(middle / 1.8), high: high.max(middle * 1.8), log: true, label: label.into() }
    }

    /// A linear axis around `values`.
    fn linear(values: impl Iterator<Item = f64>, label: &str) -> Self {
        let (low, high) =
            values.filter(|v| v.is_finite()).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        let (low, high) = if low < high { (low, high) } else { (0.0, 1.0) };
        let air = 0.08 * (high - low);
        Axis { low: low - air, high: high + air, log: false, label: label.into() }
    }

    /// Where `v` lies on the axis, 0 to 1; outside values are held at the ends.
    fn at(&self, v: f64) -> f64 {
        let place = if self.log {
            (v.max(self.low) / self.low).ln() / (self.high / self.low).ln()
        } else {
            (v - self.low) / (self.high - self.low)
        };
        place.clamp(0.0, 1.0)
    }

    /// Values with a line and a number.
    fn ticks(&self) -> Vec<f64> {
        let inside = |v: &f64| *v >= self.low * (1.0 - 1e-9) && *v <= self.high * (1.0 + 1e-9);
        if self.log {
            let decades = (self.high / self.low).log10();
            let fine = [1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0];
            let steps: &[f64] = if decades < 0.8 {
                &fine
            } else if decades > 3.5 {
                &[1.0]
            } else if decades > 1.6 {
                &[1.0, 3.0]
            } else {
                &[1.0, 2.0, 5.0]
            };
            let first = self.low.log10().floor() as i32;
            let all =
                (first..=self.high.log10().ceil() as i32).flat_map(|d| steps.iter().map(move |s| s * 10f64.powi(d)));
            return all.filter(inside).collect();
        }
        let rough = (self.high - self.low) / 6.0;
        let power = 10f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|s| s * power).into_iter().find(|s| *s >= rough).unwrap_or(10.0 * power);
        let first = (self.low / step).ceil() as i64;
        (first..).map(|k| k as f64 * step).take_while(|v| *v <= self.high).collect()
    }
}

/// A frame with two axes, and what is drawn in it.
struct Plot {
    x: Axis,
    y: Axis,
    body: String,
}

impl Plot {
    fn new(x: Axis, y: Axis) -> Self {
        Plot { x, y, body: String::new() }
    }

    fn place(&self, x: f64, y: f64) -> (f64, f64) {
        let [left, right, top, bottom] = MARGIN;
        let (w, h) = (WIDTH - left - right, HEIGHT - top - bottom);
        (left + w * self.x.at(x), top + h * (1.0 - self.y.at(y)))
    }

    fn path(&self, points: &[(f64, f64)]) -> String {
        let places: Vec<String> = points
            .iter()
            .map(|&(x, y)| {
                let (x, y) = self.place(x, y);
                format!("{x:.1},{y:.1}")
            })
            .collect();
        places.join(" ")
    }

    fn line(&mut self, points: &[(f64, f64)], style: &str) {
        let path = self.path(points);
        let _ = writeln!(self.body, r#"<polyline points="{path}" fill="none" style="{style}"/>"#);
    }

    fn area(&mut self, points: &[(f64, f64)], colour: usize) {
        let path = self.path(points);
        let _ = writeln!(self.body, r#"<polygon points="{path}" style="fill:var(--c{colour});opacity:.18"/>"#);
    }

    /// A dot with a text that shows when the pointer rests on it.
    fn dot(&mut self, (x, y): (f64, f64), colour: usize, hollow: bool, title: &str) {
        let (x, y) = self.place(x, y);
        let fill = if hollow { "var(--paper)".into() } else { format!("var(--c{colour})") };
        let _ = writeln!(
            self.body,
            r#"<circle cx="{x:.1}" cy="{y:.1}" r="4" style="fill:{fill};stroke:var(--c{colour});stroke-width:1.5"><title>{}</title></circle>"#,
            escaped(title)
        );
    }

    fn text(&mut self, (x, y): (f64, f64), anchor: &str, text: &str) {
        let text = escaped(text);
        let _ = writeln!(self.body, r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}">{text}</text>"#);
    }

    /// The finished picture; `title` is read out to those who do not see it.
    fn svg(self, title: &str) -> String {
        let [left, right, top, bottom] = MARGIN;
        let (end, base) = (WIDTH - right, HEIGHT - bottom);
        let mut frame = String::new();
        for tick in self.x.ticks() {
            let x = self.place(tick, self.y.low).0;
            let _ = write!(frame, r#"<line x1="{x:.1}" y1="{top}" x2="{x:.1}" y2="{base}" class="grid"/>"#);
            let _ = writeln!(
                frame,
                r#"<text x="{x:.1}" y="{:.1}" text-anchor="middle">{}</text>"#,
                base + 18.0,
                plain(tick)
            );
        }
        for tick in self.y.ticks() {
            let y = self.place(self.x.low, tick).1;
            let _ = write!(frame, r#"<line x1="{left}" y1="{y:.1}" x2="{end}" y2="{y:.1}" class="grid"/>"#);
            let _ = writeln!(
                frame,
                r#"<text x="{:.1}" y="{:.1}" text-anchor="end">{}</text>"#,
                left - 8.0,
                y + 4.0,
                plain(tick)
            );
        }
        let (cx, cy) = (0.5 * (left + end), 0.5 * (top + base));
        let title = escaped(title);
        let (x, y) = (escaped(&self.x.label), escaped(&self.y.label));
        format!(
            r#"<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{title}"><title>{title}</title>
{frame}<rect x="{left}" y="{top}" width="{:.1}" height="{:.1}" class="frame"/>
{}<text x="{cx:.1}" y="{:.1}" text-anchor="middle" class="label">{x}</text>
<text x="16" y="{cy:.1}" text-anchor="middle" class="label" transform="rotate(-90 16 {cy:.1})">{y}</text>
</svg>"#,
            end - left,
            base - top,
            self.body,
            HEIGHT - 10.0
        )
    }
}

/// A tick's number without needless zeros.
fn plain(v: f64) -> String {
    if v != 0.0 && !(1e-3..1e5).contains(&v.abs()) {
        return format!("{v:.0e}");
    }
    let text = format!("{v:.4}");
    text.trim_end_matches('0').trim_end_matches('.').into()
}

/// Text inside markup.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

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
                plot.text((x.min(WIDTH - MARGIN[1] - 4.0), y + shift), "end", name);
            }
        }
    }
    if let Some(own) = own {
        plot.line(&[(plot.x.low, own), (plot.x.high, own)], "stroke:var(--ink);stroke-width:1;stroke-dasharray:6 4");
        let (x, y) = plot.place(plot.x.low, own);
        plot.text((x + 6.0, y - 5.0), "start", &format!("the reference's own error, {} % (subtracted)", short(own)));
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
    plot.svg("Relative error against time, by technique")
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
    plot.svg("What an error costs: predicted and measured")
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
            let _ =
                writeln!(plot.body, r#"<path d="M{px:.1} {py:.1}v16m-4 -5l4 5l4 -5" fill="none" style="{style}"/>"#);
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
        plot.text(at, "start", &(i + 1).to_string());
    }
    plot.svg("Bias against the time it saves")
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
        let _ = writeln!(
            plot.body,
            r#"<rect x="{left:.1}" y="{top:.1}" width="{:.1}" height="{:.1}" style="fill:var(--c0);opacity:.55"><title>{} edges: {} %</title></rect>"#,
            right - left,
            base - top,
            i + 1,
            short(100.0 * share.value)
        );
    }
    let edge = |(i, v): (usize, &f64)| ((i + 1) as f64, *v);
    let line: Vec<(f64, f64)> = left_out.iter().enumerate().map(edge).take_while(|(_, v)| *v > plot.y.low).collect();
    plot.line(&line, "stroke:var(--c1);stroke-width:2");
    for (edge, v) in line {
        plot.dot((edge, v), 1, false, &format!("--max-depth {edge}: leaves out {} %", short(v)));
    }
    plot.svg("What each path length carries")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_place_values_and_choose_round_ticks() {
        let axis = Axis::log([0.02, 3.0].into_iter(), "");
        assert!(axis.at(0.02) > 0.0 && axis.at(3.0) < 1.0 && axis.at(0.0) == 0.0);
        assert!((axis.at((0.02f64 * 3.0).sqrt()) - 0.5).abs() < 1e-9);
        assert_eq!(axis.ticks().iter().map(|t| plain(*t)).collect::<Vec<_>>(), ["0.03", "0.1", "0.3", "1", "3"]);
        let axis = Axis::linear([-7.0, 83.0].into_iter(), "");
        assert_eq!(axis.ticks(), [0.0, 20.0, 40.0, 60.0, 80.0]);
        for empty in [Axis::log(std::iter::empty(), ""), Axis::linear([5.0].into_iter(), "")] {
            assert!(!empty.ticks().is_empty() && empty.at(0.5).is_finite());
        }
        assert_eq!([1e-5, 100.0, 0.5].map(plain), ["1e-5", "100", "0.5"]);
        assert_eq!(escaped("a<b & \"c\""), "a&lt;b &amp; &quot;c&quot;");
    }
}
