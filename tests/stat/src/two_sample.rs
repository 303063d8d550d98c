//! Two samples against each other, and p-values against the uniform distribution.

use crate::Moments;
use crate::limits::t_tail;

/// Outcome of Welch's test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Welch {
    /// Difference of the means in standard errors.
    pub t: f64,
    /// Welch–Satterthwaite degrees of freedom.
    pub dof: f64,
    /// Two-sided probability of a |t| at least as large for equal means.
    pub p_value: f64,
}

/// Welch's t-test of equal means. Two constant samples agree (t = 0, p = 1) or differ for certain (t = ±∞, p = 0).
pub fn welch(a: &Moments, b: &Moments) -> Welch {
    let (va, vb) = (a.variance() / a.n as f64, b.variance() / b.n as f64);
    let difference = a.mean - b.mean;
    let total = va + vb;
    if total == 0.0 {
        let equal = difference == 0.0;
        let t = if equal { 0.0 } else { f64::INFINITY.copysign(difference) };
        return Welch { t, dof: (a.n + b.n) as f64 - 2.0, p_value: if equal { 1.0 } else { 0.0 } };
    }
    let t = difference / total.sqrt();
    let dof = total * total / (va * va / (a.n - 1) as f64 + vb * vb / (b.n - 1) as f64);
    Welch { t, dof, p_value: t_tail(t, dof) }
}

/// Kolmogorov–Smirnov test that the values are uniform from 0 to 1: probability of a deviation at least as large
/// (asymptotic series with Stephens' correction, good from about ten values).
pub fn ks_uniform(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len() as f64;
    let deviation =
        sorted.iter().enumerate().map(|(i, &x)| ((i + 1) as f64 / n - x).max(x - i as f64 / n)).fold(0.0, f64::max);
    let x = (n.sqrt() + 0.12 + 0.11 / n.sqrt()) * deviation;
    if x < 0.2 {
        // The series converges slowly here and its value is 1 to fifteen digits.
        return 1.0;
    }
    let term = |k: i32| (-2.0 * f64::from(k * k) * x * x).exp() * if k % 2 == 0 { -1.0 } else { 1.0 };
    (2.0 * (1..=100).map(term).sum::<f64>()).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Pcg32;

    /// Oracle: Welch's p-values of equal means are uniform (KS), those of shifted means are small. False-alarm rate
    /// 1e-6.
    #[test]
    fn p_values_are_uniform_under_the_hypothesis() {
        let mut rng = Pcg32::new(7, 2);
        let mut sample = |n: usize, scale: f64, shift: f64| {
            let mut m = Moments::default();
            m.extend((0..n).map(|_| shift + scale * (0..12).map(|_| rng.next_f64()).sum::<f64>()));
            m
        };
        let p: Vec<f64> = (0..500).map(|_| welch(&sample(20, 1.0, 0.0), &sample(30, 3.0, -12.0)).p_value).collect();
        assert!(ks_uniform(&p) > 1e-6, "{}", ks_uniform(&p));
        assert!(welch(&sample(1000, 1.0, 0.0), &sample(1000, 1.0, 0.5)).p_value < 1e-6);
        let constant = Moments { n: 4, mean: 2.0, ..Moments::default() };
        assert_eq!(welch(&constant, &constant).p_value, 1.0);
    }

    /// Oracle: the 1 % point of the asymptotic distribution is 1.6276; squares of uniform numbers are refused.
    #[test]
    fn ks_matches_tables() {
        let n = 10_000;
        let d = 1.6276 / ((n as f64).sqrt() + 0.12 + 0.11 / (n as f64).sqrt());
        let shifted: Vec<f64> = (0..n).map(|i| ((i as f64 + 0.5) / n as f64 * (1.0 - d) + d).min(1.0)).collect();
        assert!((ks_uniform(&shifted) - 0.01).abs() < 1e-3, "{}", ks_uniform(&shifted));
        let squares: Vec<f64> = (0..1000).map(|i| ((i as f64 + 0.5) / 1000.0).powi(2)).collect();
        assert!(ks_uniform(&squares) < 1e-6);
    }
}
