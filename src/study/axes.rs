//! Axes and the frame that they span, as SVG text. Colours are CSS variables of the page around it (`--c0` … `--c7`, `--ink`,
//! `--faint`, `--paper`); [`standalone`] gives them values for a file of its own. Sizes are in units of the view box.

use std::fmt::Write;

/// View box.
pub const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 430.0;

/// Margins of the frame: left, right, top, bottom.
pub const MARGIN: [f64; 4] = [72.0, 20.0, 14.0, 52.0];

/// One axis: its range, how it runs, what it is.
pub struct Axis {
    /// Least value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// Whether it is logarithmic.
    pub log: bool,
    /// What it shows, with its unit.
    pub label: String,
}

impl Axis {
    /// A logarithmic axis around `values` (those above 0), with some air.
    pub fn log(values: impl Iterator<Item = f64>, label: &str) -> Self {
        let usable = values.filter(|v| *v > 0.0 && v.is_finite());
        let (low, high) = usable.fold((f64::INFINITY, 0.0f64), |(a, b), v| (a.min(v), b.max(v)));
        let (low, high) = if low <= high { (low / 1.3, high * 1.3) } else { (0.1, 1.0) };
        // Half a decade at least, so that there are ticks to read.
        let middle = (low * high).sqrt();
        Axis { low: low.min(middle / 1.8), high: high.max(middle * 1.8), log: true, label: label.into() }
    }

    /// A linear axis around `values`.
    pub fn linear(values: impl Iterator<Item = f64>, label: &str) -> Self {
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
pub struct Plot {
    /// The axis to the right.
    pub x: Axis,
    /// The axis upwards.
    pub y: Axis,
    /// What is drawn so far, as SVG.
    pub body: String,
}

impl Plot {
    /// An empty plot.
    pub fn new(x: Axis, y: Axis) -> Self {
        Plot { x, y, body: String::new() }
    }

    /// Where a point lies in the view box.
    pub fn place(&self, x: f64, y: f64) -> (f64, f64) {
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

    /// A line through points in the units of the axes, with a style of CSS.
    pub fn line(&mut self, points: &[(f64, f64)], style: &str) {
        let path = self.path(points);
        let _ = writeln!(self.body, r#"<polyline points="{path}" fill="none" style="{style}"/>"#);
    }

    /// A filled outline in one of the colours.
    pub fn area(&mut self, points: &[(f64, f64)], colour: usize) {
        let path = self.path(points);
        let _ = writeln!(self.body, r#"<polygon points="{path}" style="fill:var(--c{colour});opacity:.18"/>"#);
    }

    /// A dot with a text that shows when the pointer rests on it.
    pub fn dot(&mut self, (x, y): (f64, f64), colour: usize, hollow: bool, title: &str) {
        let (x, y) = self.place(x, y);
        let fill = if hollow { "var(--paper)".into() } else { format!("var(--c{colour})") };
        let _ = writeln!(
            self.body,
            r#"<circle cx="{x:.1}" cy="{y:.1}" r="4" style="fill:{fill};stroke:var(--c{colour});stroke-width:1.5"><title>{}</title></circle>"#,
            escaped(title)
        );
    }

    /// Text at a place in the view box; `anchor` is SVG's `text-anchor`.
    pub fn text(&mut self, (x, y): (f64, f64), anchor: &str, text: &str) {
        let text = escaped(text);
        let _ = writeln!(self.body, r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}">{text}</text>"#);
    }

    /// The finished picture; `title` is read out to those who do not see it.
    pub fn svg(self, title: &str) -> String {
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

/// A plot as a file of its own: with the namespace, and colours on white that colour-blind readers can tell apart (Okabe and Ito).
pub fn standalone(svg: &str) -> String {
    const STYLE: &str = "svg{--c0:#0072b2;--c1:#d55e00;--c2:#009e73;--c3:#cc79a7;--c4:#e69f00;--c5:#56b4e9;--c6:#000;--c7:#999;\
--ink:#222;--faint:#999;--paper:#fff;background:#fff;font:12px sans-serif;fill:#222}\
.grid{stroke:#ddd}.frame{fill:none;stroke:#888}.label{font-size:13px}";
    let open = format!("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{HEIGHT}\" ");
    svg.replacen("<svg ", &open, 1).replacen("<title>", &format!("<style>{STYLE}</style><title>"), 1)
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
