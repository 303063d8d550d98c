//! Numbers for people.

/// Three digits.
pub fn short(v: f64) -> String {
    let a = v.abs();
    if a == 0.0 || !v.is_finite() {
        return if v == 0.0 { "0".into() } else { "-".into() };
    }
    match a {
        _ if a >= 1e6 => format!("{v:.2e}"),
        _ if a >= 100.0 => format!("{v:.0}"),
        _ if a >= 10.0 => format!("{v:.1}"),
        _ if a >= 1.0 => format!("{v:.2}"),
        _ if a >= 0.1 => format!("{v:.3}"),
        _ if a >= 0.001 => format!("{v:.4}"),
        _ => format!("{v:.1e}"),
    }
}
