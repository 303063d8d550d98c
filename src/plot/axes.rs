//! Axes and the frame that they span. Points are in the units of the axes, unless a place is said: that is in units of
//! the view box.

use super::svg::{Anchor, Svg};

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
    /// The drawing, for what the functions below do not draw.
    pub svg: Svg,
}

impl Plot {
    /// An empty plot.
    pub fn new(x: Axis, y: Axis) -> Self {
        let mut plot = Plot { x, y, svg: Svg::new(WIDTH, HEIGHT) };
        plot.frame();
        plot
    }

    /// Where a point lies in the view box.
    pub fn place(&self, x: f64, y: f64) -> (f64, f64) {
        let [left, right, top, bottom] = MARGIN;
        let (w, h) = (WIDTH - left - right, HEIGHT - top - bottom);
        (left + w * self.x.at(x), top + h * (1.0 - self.y.at(y)))
    }

    fn places(&self, points: &[(f64, f64)]) -> Vec<(f64, f64)> {
        points.iter().map(|&(x, y)| self.place(x, y)).collect()
    }

    /// A line with a style of CSS.
    pub fn line(&mut self, points: &[(f64, f64)], style: &str) {
        self.svg.line(&self.places(points), style);
    }

    /// A filled outline in one of the colours.
    pub fn area(&mut self, points: &[(f64, f64)], colour: usize) {
        self.svg.area(&self.places(points), colour);
    }

    /// A dot with a text that shows when the pointer rests on it.
    pub fn dot(&mut self, (x, y): (f64, f64), colour: usize, hollow: bool, title: &str) {
        self.svg.dot(self.place(x, y), colour, hollow, title);
    }

    /// A line of text at a place.
    pub fn text(&mut self, place: (f64, f64), anchor: Anchor, text: &str) {
        self.svg.text(place, anchor, text);
    }

    /// Grid, numbers and names of the axes; everything else is drawn over them.
    fn frame(&mut self) {
        let [left, right, top, bottom] = MARGIN;
        let (end, base) = (WIDTH - right, HEIGHT - bottom);
        for tick in self.x.ticks() {
            let x = self.place(tick, self.y.low).0;
            self.svg.rule((x, top), (x, base), "grid");
            self.svg.text((x, base + 18.0), Anchor::Middle, &plain(tick));
        }
        for tick in self.y.ticks() {
            let y = self.place(self.x.low, tick).1;
            self.svg.rule((left, y), (end, y), "grid");
            self.svg.text((left - 8.0, y + 4.0), Anchor::End, &plain(tick));
        }
        let corners = [(left, top), (end, top), (end, base), (left, base), (left, top)];
        self.svg.line(&corners, "stroke:var(--faint);stroke-width:1");
        let (cx, cy) = (0.5 * (left + end), 0.5 * (top + base));
        self.svg.styled_text((cx, HEIGHT - 10.0), Anchor::Middle, r#"class="label""#, &self.x.label);
        let turned = format!(r#"class="label" transform="rotate(-90 16 {cy:.1})""#);
        self.svg.styled_text((16.0, cy), Anchor::Middle, &turned, &self.y.label);
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
    }
}
