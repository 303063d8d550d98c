//! Numbers from independent runs, with 95 % intervals whose unit is the run, never the pixel of one run (HARDCASES
//! §6.2).
//!
//! Means by Student's t; ratios by t on their logarithms; slopes by least squares on log-log points; bias² by products
//! of different runs, ⟨Dᵢ, Dⱼ⟩ with i ≠ j, whose expectation is the square of the mean difference with no
//! noise in it. Such an estimate may come out negative; it is not clipped. Limits: t assumes runs that are not too
//! skewed; too few runs give infinite intervals, not small ones.

use serde::Serialize;

/// A value and its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// The estimate.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// `value` ± `half_width`.
    pub fn around(value: f64, half_width: f64) -> Self {
        Interval { value, low: value - half_width, high: value + half_width }
    }

    /// Whether `x` lies inside.
    pub fn contains(&self, x: f64) -> bool {
        self.low <= x && x <= self.high
    }

    /// Each number through a growing function.
    pub fn map(&self, f: impl Fn(f64) -> f64) -> Self {
        Interval { value: f(self.value), low: f(self.low), high: f(self.high) }
    }
}

/// Two-sided 95 % point of Student's t with `dof` degrees of freedom; infinite without any.
///
/// Exact to four digits: tabulated below 5, above by Abramowitz & Stegun 26.7.5 (checked against statrs).
pub fn t95(dof: usize) -> f64 {
    const SMALL: [f64; 5] = [f64::INFINITY, 12.706205, 4.302653, 3.182446, 2.776445];
    const Z: f64 = 1.959964;
    if let Some(&t) = SMALL.get(dof) {
        return t;
    }
    let v = dof as f64;
    let g1 = (Z.powi(3) + Z) / 4.0;
    let g2 = (5.0 * Z.powi(5) + 16.0 * Z.powi(3) + 3.0 * Z) / 96.0;
    let g3 = (3.0 * Z.powi(7) + 19.0 * Z.powi(5) + 17.0 * Z.powi(3) - 15.0 * Z) / 384.0;
    let g4 = (79.0 * Z.powi(9) + 776.0 * Z.powi(7) + 1482.0 * Z.powi(5) - 1920.0 * Z.powi(3) - 945.0 * Z) / 92160.0;
    Z + g1 / v + g2 / v.powi(2) + g3 / v.powi(3) + g4 / v.powi(4)
}

/// Mean of independent values; `None` without values.
pub fn mean(values: &[f64]) -> Option<Interval> {
    let n = values.len();
    if n == 0 {
        return None;
    }
    let mean = values.iter().sum::<f64>() / n as f64;
    if n == 1 {
        return Some(Interval::around(mean, f64::INFINITY));
    }
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1) as f64;
    Some(Interval::around(mean, t95(n - 1) * (variance / n as f64).sqrt()))
}

/// Geometric mean of independent ratios; `None` when one is not above 0.
pub fn geometric_mean(ratios: &[f64]) -> Option<Interval> {
    if ratios.iter().any(|r| !(*r > 0.0 && r.is_finite())) {
        return None;
    }
    let logs: Vec<f64> = ratios.iter().map(|r| r.ln()).collect();
    mean(&logs).map(|m| m.map(f64::exp))
}

/// A straight line through points, by least squares.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Line {
    /// Its slope.
    pub slope: f64,
    /// Standard error of the slope, from the scatter of the points about the line.
    pub slope_error: f64,
    /// Mean of the abscissae.
    pub x: f64,
    /// Ordinate there.
    pub y: f64,
    /// Standard deviation of a point about the line.
    pub scatter: f64,
    /// Number of points.
    pub points: usize,
    /// Σ(x − x̄)².
    spread: f64,
}

/// Fits a line; `None` for fewer than three points or a single abscissa.
pub fn line(points: &[(f64, f64)]) -> Option<Line> {
    let n = points.len() as f64;
    let x = points.iter().map(|p| p.0).sum::<f64>() / n;
    let y = points.iter().map(|p| p.1).sum::<f64>() / n;
    let spread: f64 = points.iter().map(|p| (p.0 - x).powi(2)).sum();
    if points.len() < 3 || !(spread > 0.0) || !y.is_finite() {
        return None;
    }
    let slope = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>() / spread;
    let square: f64 = points.iter().map(|p| (p.1 - y - slope * (p.0 - x)).powi(2)).sum();
    let scatter = (square / (n - 2.0)).sqrt();
    Some(Line { slope, slope_error: scatter / spread.sqrt(), x, y, scatter, points: points.len(), spread })
}

impl Line {
    /// Ordinate at `x`, with the interval of the line (not of a point).
    pub fn at(&self, x: f64) -> Interval {
        let sd = self.scatter * (1.0 / self.points as f64 + (x - self.x).powi(2) / self.spread).sqrt();
        Interval::around(self.y + self.slope * (x - self.x), t95(self.points - 2) * sd)
    }

    /// Abscissa at which the line reaches `y`; `None` when the slope is not surely below 0.
    pub fn solve_falling(&self, y: f64) -> Option<Interval> {
        let t = t95(self.points - 2);
        if !(self.slope + t * self.slope_error < 0.0) {
            return None;
        }
        let ahead = (y - self.y) / self.slope;
        let sd = self.scatter / self.slope.abs() * (1.0 / self.points as f64 + ahead * ahead / self.spread).sqrt();
        Some(Interval::around(self.x + ahead, t * sd))
    }
}

/// Σ w·(E D)² from independent differences Dᵢ, by products of different runs; interval by the delete-one
/// jackknife. `None` for fewer than three runs.
pub fn bias_squared(differences: &[Vec<f32>], weights: &[f64]) -> Option<Interval> {
    let runs = differences.len();
    if runs < 3 {
        return None;
    }
    let product = |a: &[f32], b: &[f32]| -> f64 {
        a.iter().zip(b).zip(weights).map(|((a, b), w)| w * f64::from(*a) * f64::from(*b)).sum()
    };
    // Row sums of the products of different runs; a run's row is what leaving it out takes away, twice.
    let mut rows = vec![0.0; runs];
    for i in 0..runs {
        for j in 0..i {
            let p = product(&differences[i], &differences[j]);
            rows[i] += p;
            rows[j] += p;
        }
    }
    let r = runs as f64;
    let total: f64 = rows.iter().sum();
    let value = total / (r * (r - 1.0));
    let without = |k: usize| (total - 2.0 * rows[k]) / ((r - 1.0) * (r - 2.0));
    let centre = (0..runs).map(without).sum::<f64>() / r;
    let variance = (r - 1.0) / r * (0..runs).map(|k| (without(k) - centre).powi(2)).sum::<f64>();
    Some(Interval::around(value, t95(runs - 1) * variance.sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// SplitMix64 (Steele et al. 2014) summed to something close to a normal number (Irwin-Hall of 12).
    struct Normal(u64);

    impl Normal {
        fn next(&mut self) -> f64 {
            let mut uniform = || {
                self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
                let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
                ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
            };
            (0..12).map(|_| uniform()).sum::<f64>() - 6.0
        }
    }

    #[test]
    fn points_of_student_are_those_of_statrs() {
        for dof in 1..60 {
            let exact = pathspace_stat::t_limit(dof as f64, 0.05);
            assert!((t95(dof) / exact - 1.0).abs() < 2e-4, "{dof}: {} for {exact}", t95(dof));
        }
        assert_eq!(t95(0), f64::INFINITY);
    }

    /// Oracle: coverage of 1000 simulated means of 5 normal values: binomial of 95 %, 920 to 980 fails with
    /// 2·10⁻⁵.
    #[test]
    fn means_cover() {
        let mut normal = Normal(1);
        let held = (0..1000).filter(|_| mean(&[(); 5].map(|()| 3.0 + normal.next())).expect("values").contains(3.0));
        let held = held.count();
        assert!((920..=980).contains(&held), "{held}");
        assert_eq!(mean(&[]), None);
        assert_eq!(mean(&[2.0]).map(|m| (m.value, m.high)), Some((2.0, f64::INFINITY)));
        let ratio = geometric_mean(&[2.0, 8.0, 4.0]).expect("above 0");
        assert!((ratio.value - 4.0).abs() < 1e-12 && ratio.low > 0.0 && ratio.contains(4.0));
        assert_eq!(geometric_mean(&[1.0, -1.0]), None);
    }

    /// Oracle: the line that made the points; 1000 fits of 6 noisy points cover slope, value and crossing in 95 %.
    #[test]
    fn lines_cover() {
        let exact = line(&[(0.0, 5.0), (1.0, 4.0), (3.0, 2.0)]).expect("three points");
        assert!((exact.slope + 1.0).abs() < 1e-12 && (exact.at(2.0).value - 3.0).abs() < 1e-12);
        assert!((exact.solve_falling(1.0).expect("falls").value - 4.0).abs() < 1e-9);
        assert_eq!(line(&[(1.0, 1.0), (1.0, 2.0), (1.0, 3.0)]), None);
        assert_eq!(line(&[(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)]).and_then(|l| l.solve_falling(9.0)), None);
        let mut normal = Normal(2);
        let mut held = [0; 3];
        for _ in 0..1000 {
            let points: Vec<(f64, f64)> = (0..6).map(|x| (x as f64, 2.0 - x as f64 + 0.1 * normal.next())).collect();
            let l = line(&points).expect("points");
            held[0] += usize::from((l.slope + 1.0).abs() < t95(4) * l.slope_error);
            held[1] += usize::from(l.at(8.0).contains(-6.0));
            held[2] += usize::from(l.solve_falling(-6.0).is_some_and(|x| x.contains(8.0)));
        }
        assert!(held.iter().all(|h| (920..=980).contains(h)), "{held:?}");
    }

    /// Oracle: differences of known mean. 300 pixels, 8 runs, noise three times the bias: unbiased over 400 trials
    /// within 5 standard errors, and the jackknife's interval covers in about 95 % (it is a little too wide or narrow:
    /// 90 to 99).
    #[test]
    fn bias_squared_is_free_of_noise() {
        for bias in [0.0, 0.3] {
            let mut normal = Normal(3);
            let (pixels, trials) = (300, 400);
            let weights = vec![1.0 / pixels as f64; pixels];
            let (mut sum, mut squares, mut held) = (0.0, 0.0, 0);
            for _ in 0..trials {
                let runs: Vec<Vec<f32>> =
                    (0..8).map(|_| (0..pixels).map(|_| (bias + normal.next()) as f32).collect()).collect();
                let found = bias_squared(&runs, &weights).expect("eight runs");
                sum += found.value;
                squares += found.value * found.value;
                held += usize::from(found.contains(bias * bias));
            }
            let n = f64::from(trials);
            let mean = sum / n;
            let error = ((squares / n - mean * mean) / n).sqrt();
            assert!((mean - bias * bias).abs() < 5.0 * error, "{mean} ± {error} for {}", bias * bias);
            assert!((360..=398).contains(&held), "bias {bias}: {held} of {trials}");
        }
        assert_eq!(bias_squared(&[vec![0.0], vec![0.0]], &[1.0]), None);
    }
}
