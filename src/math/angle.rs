//! Angles in turns by polynomials: no call, no branch, no table, so loops over lanes vectorise.
//!
//! Errors, against f64 over the whole range (tested): sine and cosine 1.5e-7 for |t| ≤ 1 and exact at the quarters,
//! angle 6e-8 of a turn. Source of the arctangent: Moshier 1989, Cephes `atanf` (reduction at tan π/8, degree 9).

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use super::warp::sin_cos_octant;

/// Sine and cosine of `turns` whole turns.
#[inline(always)]
pub fn sin_cos_turns(turns: f32) -> (f32, f32) {
    let quarter = (4.0 * turns).round_ties_even();
    // Exact: the two are within a factor of 2 of each other, or the quarter is 0.
    let (sin, cos) = sin_cos_octant((turns - 0.25 * quarter) * TAU);
    let quarter = quarter as i32;
    let (sin, cos) = if quarter & 1 == 0 { (sin, cos) } else { (cos, sin) };
    let sin = if quarter & 2 == 0 { sin } else { -sin };
    let cos = if (quarter + 1) & 2 == 0 { cos } else { -cos };
    (sin, cos)
}

/// Angle of the point (x, y) in turns, in [−½, ½]; 0 at the origin.
#[inline(always)]
pub fn atan2_turns(y: f32, x: f32) -> f32 {
    /// tan π/8.
    const TAN_PI_8: f32 = 0.414_213_57;
    let (across, along) = (y.abs(), x.abs());
    let steep = across > along;
    let (large, small) = if steep { (across, along) } else { (along, across) };
    // tan(a − π/4) above π/8.
    let upper = small > TAN_PI_8 * large;
    let (top, bottom) = if upper { (small - large, small + large) } else { (small, large) };
    let z = top / bottom.max(f32::MIN_POSITIVE);
    let z2 = z * z;
    let poly = ((8.053_744_5e-2 * z2 - 1.387_768_6e-1) * z2 + 1.997_771_1e-1) * z2 - 3.333_295e-1;
    let angle = poly * z2 * z + z;
    let angle = if upper { angle + FRAC_PI_4 } else { angle };
    let angle = if steep { FRAC_PI_2 - angle } else { angle };
    let angle = if x < 0.0 { PI - angle } else { angle };
    angle.copysign(y) * (1.0 / TAU)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: f64. Deterministic.
    #[test]
    fn sine_and_cosine() {
        let mut worst = 0.0f64;
        for i in -1_000_000..=1_000_000 {
            let turns = i as f32 * 1e-6;
            let (sin, cos) = sin_cos_turns(turns);
            let (sine, cosine) = (f64::from(turns) * std::f64::consts::TAU).sin_cos();
            worst = worst.max((f64::from(sin) - sine).abs()).max((f64::from(cos) - cosine).abs());
        }
        assert!(worst < 1.5e-7, "worst error {worst:e}");
        let quarters = [0.0, 0.25, 0.5, 0.75, 1.0, -0.25, -0.5].map(sin_cos_turns);
        let expected = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)];
        for (found, expected) in quarters.into_iter().zip(expected) {
            assert_eq!((found.0.abs() + 0.0, found.1), (f32::abs(expected.0), expected.1));
        }
    }

    /// Oracle: f64. Deterministic. Axes, diagonals and the origin included.
    #[test]
    fn angle() {
        let mut worst = 0.0f64;
        for i in 0..=1_000_000 {
            let a = std::f64::consts::TAU * f64::from(i) / 1e6;
            let (y, x) = (a.sin() as f32, a.cos() as f32);
            let expected = f64::from(y).atan2(f64::from(x)) / std::f64::consts::TAU;
            worst = worst.max((f64::from(atan2_turns(y, x)) - expected).abs());
        }
        assert!(worst < 6e-8, "worst error {worst:e}");
        assert_eq!(atan2_turns(0.0, 0.0), 0.0);
        assert_eq!(atan2_turns(0.0, 1.0), 0.0);
        assert_eq!(atan2_turns(0.0, -1.0), 0.5);
        assert_eq!(atan2_turns(1e-30, 0.0), 0.25);
    }
}
