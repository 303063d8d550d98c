//! Running count, mean and central moments to the fourth order, mergeable (Pébay 2008). Stable for long runs: no sums
//! of powers are kept.

/// Moments of a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// Number of values.
    pub n: u64,
    /// Their mean.
    pub mean: f64,
    /// Sum of squared deviations from the mean.
    pub m2: f64,
    /// Sum of cubed deviations.
    pub m3: f64,
    /// Sum of fourth powers of deviations.
    pub m4: f64,
}

impl Moments {
    /// Adds one value.
    pub fn push(&mut self, x: f64) {
        *self = self.merge(&Moments { n: 1, mean: x, ..Moments::default() });
    }

    /// The moments of both samples together.
    pub fn merge(&self, other: &Self) -> Self {
        if self.n == 0 {
            return *other;
        }
        if other.n == 0 {
            return *self;
        }
        let (a, b) = (self.n as f64, other.n as f64);
        let n = a + b;
        let d = other.mean - self.mean;
        let d_n = d / n;
        let m2 = self.m2 + other.m2 + d * d_n * a * b;
        let m3 = self.m3 + other.m3 + d * d_n * d_n * a * b * (a - b) + 3.0 * d_n * (a * other.m2 - b * self.m2);
        let m4 = self.m4
            + other.m4
            + d * d_n * d_n * d_n * a * b * (a * a - a * b + b * b)
            + 6.0 * d_n * d_n * (a * a * other.m2 + b * b * self.m2)
            + 4.0 * d_n * (a * other.m3 - b * self.m3);
        Moments { n: self.n + other.n, mean: self.mean + d_n * b, m2, m3, m4 }
    }

    /// Unbiased variance of one value; 0 below two values.
    pub fn variance(&self) -> f64 {
        if self.n < 2 { 0.0 } else { self.m2 / (self.n - 1) as f64 }
    }

    /// Standard error of the mean.
    pub fn standard_error(&self) -> f64 {
        (self.variance() / self.n.max(1) as f64).sqrt()
    }

    /// Skewness; 0 for a constant sample.
    pub fn skewness(&self) -> f64 {
        if self.m2 == 0.0 { 0.0 } else { (self.n as f64).sqrt() * self.m3 / self.m2.powf(1.5) }
    }

    /// Excess kurtosis; 0 for a constant sample.
    pub fn excess_kurtosis(&self) -> f64 {
        if self.m2 == 0.0 { 0.0 } else { self.n as f64 * self.m4 / (self.m2 * self.m2) - 3.0 }
    }

    /// Deviation of the mean from `expected` in standard errors, after taking off a rounding allowance `tau`.
    /// A constant sample is 0 or infinite.
    pub fn z(&self, expected: f64, tau: f64) -> f64 {
        let excess = ((self.mean - expected).abs() - tau).max(0.0);
        if excess == 0.0 { 0.0 } else { excess / self.standard_error() }
    }
}

impl Extend<f64> for Moments {
    fn extend<T: IntoIterator<Item = f64>>(&mut self, values: T) {
        values.into_iter().for_each(|x| self.push(x));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Pcg32;

    fn direct(values: &[f64]) -> Moments {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let power = |p: i32| values.iter().map(|x| (x - mean).powi(p)).sum();
        Moments { n: values.len() as u64, mean, m2: power(2), m3: power(3), m4: power(4) }
    }

    /// Oracle: the two-pass definition, to rounding, also for halves merged and for a mean of 1e6.
    #[test]
    fn agree_with_the_definition() {
        let mut rng = Pcg32::new(1, 1);
        let values: Vec<f64> = (0..4096).map(|_| 1e6 + rng.next_f64().powi(3)).collect();
        let expected = direct(&values);
        let mut all = Moments::default();
        all.extend(values.iter().copied());
        let (mut a, mut b) = (Moments::default(), Moments::default());
        a.extend(values[..1000].iter().copied());
        b.extend(values[1000..].iter().copied());
        for got in [all, a.merge(&b)] {
            assert_eq!(got.n, expected.n);
            for (x, y) in
                [(got.mean, expected.mean), (got.m2, expected.m2), (got.m3, expected.m3), (got.m4, expected.m4)]
            {
                assert!((x - y).abs() <= 1e-7 * y.abs(), "{x} against {y}");
            }
        }
    }
}
