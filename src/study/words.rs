//! Values with their intervals as text, to about three digits.

use super::runs::Interval;
use crate::plot::number::short;

/// "(1.10 to 1.36)".
pub fn range(i: &Interval) -> String {
    format!("({} to {})", short(i.low), short(i.high))
}

/// "1.23 (1.10 to 1.36)", times `scale`.
pub fn with_interval(i: &Interval, scale: f64) -> String {
    let i = i.map(|v| v * scale);
    if i.low.is_finite() && i.high.is_finite() && (i.low, i.high) != (0.0, f64::INFINITY) {
        format!("{} {}", short(i.value), range(&i))
    } else {
        short(i.value)
    }
}

/// "-1.2e-3 (-2e-3 to +1e-4)", times `scale`, with signs.
pub fn signed(i: &Interval, scale: f64) -> String {
    let i = i.map(|v| v * scale);
    let sign = |v: f64| format!("{}{}", if v > 0.0 { "+" } else { "" }, short(v));
    if i.low.is_finite() && i.high.is_finite() {
        format!("{} ({} to {})", sign(i.value), sign(i.low), sign(i.high))
    } else {
        sign(i.value)
    }
}
