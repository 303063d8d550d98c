//! Values as colours of increasing lightness, black through violet, red and orange to pale yellow, so that more is
//! lighter for every reader, in grey as well. Bytes are sRGB, R, G, B, row-major.
//!
//! Source: five points of matplotlib's `inferno` (van der Walt and Smith 2015, CC0), straight between.

use super::number::short;

const STOPS: [[f64; 3]; 5] =
    [[0.0, 0.0, 4.0], [87.0, 16.0, 110.0], [188.0, 55.0, 84.0], [249.0, 142.0, 9.0], [252.0, 255.0, 164.0]];

/// Share of the values that lie below the end of a scale: a single firefly would turn all others black.
const SHOWN: f64 = 0.99;

/// A map of values from 0 on.
#[derive(Clone, Debug, PartialEq)]
pub struct HeatMap {
    /// The colours.
    pub bytes: Vec<u8>,
    /// Value of the lightest colour, which all above have as well.
    pub end: f64,
}

impl HeatMap {
    /// Draws `values` on a scale that ends where 99 % of them do, at 1, 2 or 5 times a power of ten. What is not finite
    /// has the lightest colour.
    pub fn of(values: &[f64]) -> Self {
        HeatMap::up_to(end_of(values), values)
    }

    /// Draws `values` on a scale that ends there.
    pub fn up_to(end: f64, values: &[f64]) -> Self {
        HeatMap { bytes: values.iter().flat_map(|value| heat(value / end)).collect(), end }
    }

    /// With the scale in percent printed below: bar and numbers. Returns columns, rows and bytes; the picture stays in
    /// its place, and one that is narrower than the numbers gets white beside it.
    pub fn with_scale(&self, width: usize) -> (usize, usize, Vec<u8>) {
        let unit = (width / 320).max(1);
        let numbers = [String::from("0"), percent(self.end / 2.0), percent(self.end) + "+"];
        let lengths = numbers.each_ref().map(|text| (text.len() * ADVANCE - 1) * unit);
        let gap = ADVANCE * unit;
        let wide = width.max(lengths[0] + gap + lengths[2]);
        let above = self.bytes.len() / 3 / width.max(1);
        let rows = above + STRIP * unit;
        let mut bytes = vec![255; 3 * wide * rows];
        for (y, row) in self.bytes.chunks_exact(3 * width.max(1)).enumerate() {
            bytes[3 * wide * y..][..row.len()].copy_from_slice(row);
        }
        for y in above + unit..above + (1 + BAR) * unit {
            for x in 0..wide {
                bytes[3 * (wide * y + x)..][..3].copy_from_slice(&heat(x as f64 / (wide - 1) as f64));
            }
        }
        let starts = [0, (wide - lengths[1]) / 2, wide - lengths[2]];
        let has_room = wide >= 2 * (lengths[0].max(lengths[2]) + gap) + lengths[1];
        for (i, (text, start)) in numbers.iter().zip(starts).enumerate() {
            if i == 1 && !has_room {
                continue;
            }
            for (column, line) in pixels_of(text) {
                for (dy, dx) in (0..unit).flat_map(|dy| (0..unit).map(move |dx| (dy, dx))) {
                    let (x, y) = (start + column * unit + dx, above + (2 + BAR + line) * unit + dy);
                    bytes[3 * (wide * y + x)..][..3].fill(0);
                }
            }
        }
        (wide, rows, bytes)
    }
}

/// Rows of the bar, of bar and numbers with gaps, and columns from one digit to the next, in units of a digit's pixel.
const BAR: usize = 4;
const STRIP: usize = 1 + BAR + 1 + 5 + 1;
const ADVANCE: usize = 4;

/// Digits of 3 × 5 pixels: five octal digits, a row each from the top, the leftmost pixel in bit 2.
const DIGITS: [(char, u16); 15] = [
    ('0', 0o75557),
    ('1', 0o26227),
    ('2', 0o71747),
    ('3', 0o71717),
    ('4', 0o55711),
    ('5', 0o74717),
    ('6', 0o74757),
    ('7', 0o71111),
    ('8', 0o75757),
    ('9', 0o75717),
    ('%', 0o51245),
    ('.', 0o00002),
    ('+', 0o02720),
    ('-', 0o00700),
    ('e', 0o02743),
];

/// Columns and rows of the dark pixels of `text`.
fn pixels_of(text: &str) -> impl Iterator<Item = (usize, usize)> {
    text.chars().enumerate().flat_map(|(i, c)| {
        let bits = DIGITS.iter().find(|(digit, _)| *digit == c).map_or(0, |(_, bits)| *bits);
        (0..15).filter(move |at| bits >> (14 - at) & 1 == 1).map(move |at| (i * ADVANCE + at % 3, at / 3))
    })
}

/// "2%", "0.5%", "1e-6%".
fn percent(share: f64) -> String {
    let text = short(100.0 * share);
    match text.split_once('e') {
        Some((digits, power)) => format!("{}e{power}%", trimmed(digits)),
        None => trimmed(&text).to_string() + "%",
    }
}

/// Without zeros at the end that say nothing.
fn trimmed(number: &str) -> &str {
    if number.contains('.') { number.trim_end_matches('0').trim_end_matches('.') } else { number }
}

/// Where a scale of `values` ends; 1 without any above 0.
fn end_of(values: &[f64]) -> f64 {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let Some(&largest) = sorted.last() else { return 1.0 };
    let end = match sorted[((sorted.len() - 1) as f64 * SHOWN) as usize] {
        usual if usual > 0.0 => usual,
        // Few values are above 0, and they are what there is to see.
        _ => largest,
    };
    let power = 10f64.powf(end.log10().floor());
    let round = [1.0, 2.0, 5.0].map(|step| step * power).into_iter().find(|round| *round >= end * (1.0 - 1e-9));
    let round = round.unwrap_or(10.0 * power);
    if round.is_normal() && round > 0.0 { round } else { 1.0 }
}

/// The colour of a value from 0 to 1; of others that of the nearest, and of what is no number that of 1.
pub fn heat(value: f64) -> [u8; 3] {
    let place = 4.0 * if value.is_finite() { value.clamp(0.0, 1.0) } else { 1.0 };
    let below = (place as usize).min(3);
    let share = place - below as f64;
    std::array::from_fn(|c| (STOPS[below][c] * (1.0 - share) + STOPS[below + 1][c] * share).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heat_runs_from_dark_to_light() {
        assert_eq!(heat(0.0), [0, 0, 4]);
        assert_eq!(heat(1.0), [252, 255, 164]);
        assert_eq!(heat(0.5), [188, 55, 84]);
        assert_eq!((heat(7.0), heat(f64::NAN)), (heat(1.0), heat(1.0)));
    }

    /// Oracle: the rule, by hand.
    #[test]
    fn scales_end_at_round_numbers() {
        let with_firefly: Vec<f64> = (0..100).map(|i| if i == 99 { 1e9 } else { 0.013 }).collect();
        assert!((end_of(&with_firefly) - 0.02).abs() < 1e-12);
        let one_pixel: Vec<f64> = (0..1000).map(|i| if i == 7 { 0.5 } else { 0.0 }).collect();
        assert!((end_of(&one_pixel) - 0.5).abs() < 1e-12);
        for nothing in [&[][..], &[0.0, 0.0], &[f64::NAN, f64::INFINITY], &[1e-320]] {
            assert_eq!(end_of(nothing), 1.0);
        }
        assert_eq!([0.02, 0.005, 0.5, 10.0, 1e-8].map(percent), ["2%", "0.5%", "50%", "1000%", "1e-6%"]);
    }

    /// Oracle: sizes by hand; the picture's own pixels stay where they were.
    #[test]
    fn a_scale_is_printed_below() {
        let map = HeatMap::up_to(0.5, &[0.0, 0.5, 0.25, 9.0]);
        assert_eq!(map.bytes[..6], [0, 0, 4, 252, 255, 164]);
        let (wide, rows, bytes) = map.with_scale(2);
        // "0" and "50%+": one digit and four, and a gap of one.
        assert_eq!((wide, rows, bytes.len()), (3 + 4 + 15, 2 + 12, 3 * 22 * 14));
        assert_eq!(bytes[..6], map.bytes[..6]);
        assert_eq!(bytes[3 * wide * 3..][..3], heat(0.0));
        let dark = bytes[3 * wide * 8..].chunks_exact(3).filter(|pixel| *pixel == [0; 3]).count();
        let expected = ["0", "50%+"].map(|text| pixels_of(text).count()).iter().sum::<usize>();
        assert_eq!(dark, expected);
        let (wide, rows, _) = HeatMap::up_to(0.5, &vec![0.0; 640 * 3]).with_scale(640);
        assert_eq!((wide, rows), (640, 3 + 24));
    }
}
