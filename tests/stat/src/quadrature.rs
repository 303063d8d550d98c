//! Gauss–Legendre quadrature on rectangles, subdivided where one rule does not resolve the integrand.

/// Nodes and weights from 0 to 1.
#[derive(Clone, Debug)]
pub struct GaussLegendre {
    nodes: Vec<(f64, f64)>,
}

impl GaussLegendre {
    /// The n-point rule: Newton's method on the Legendre polynomial.
    pub fn new(n: usize) -> Self {
        let nodes = (0..n)
            .map(|i| {
                let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
                let mut slope = 0.0;
                for _ in 0..100 {
                    let (mut p0, mut p1) = (1.0, x);
                    for k in 2..=n {
                        let k = k as f64;
                        (p0, p1) = (p1, ((2.0 * k - 1.0) * x * p1 - (k - 1.0) * p0) / k);
                    }
                    slope = n as f64 * (x * p1 - p0) / (x * x - 1.0);
                    let step = p1 / slope;
                    x -= step;
                    if step.abs() < 1e-16 {
                        break;
                    }
                }
                (0.5 * (1.0 - x), 1.0 / ((1.0 - x * x) * slope * slope))
            })
            .collect();
        GaussLegendre { nodes }
    }

    /// Nodes and weights from 0 to 1.
    pub fn nodes(&self) -> &[(f64, f64)] {
        &self.nodes
    }

    /// ∫f over [a, b].
    pub fn integrate(&self, [a, b]: [f64; 2], f: impl Fn(f64) -> f64) -> f64 {
        (b - a) * self.nodes.iter().map(|&(x, w)| w * f(a + (b - a) * x)).sum::<f64>()
    }

    /// ∬f over x × y.
    pub fn integrate_2d(&self, x: [f64; 2], y: [f64; 2], f: &impl Fn(f64, f64) -> f64) -> f64 {
        self.integrate(x, |u| self.integrate(y, |v| f(u, v)))
    }
}

/// ∬f over x × y by the rule, splitting in four until two levels agree to `tolerance` (absolute, shared among the
/// parts) or `depth` splits are done.
pub fn integrate(
    rule: &GaussLegendre,
    x: [f64; 2],
    y: [f64; 2],
    tolerance: f64,
    depth: u32,
    f: &impl Fn(f64, f64) -> f64,
) -> f64 {
    refine(rule, [x, y], rule.integrate_2d(x, y, f), tolerance, depth, f)
}

fn refine(
    rule: &GaussLegendre,
    [x, y]: [[f64; 2]; 2],
    coarse: f64,
    tolerance: f64,
    depth: u32,
    f: &impl Fn(f64, f64) -> f64,
) -> f64 {
    let (mx, my) = (0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]));
    let quarters =
        [[[x[0], mx], [y[0], my]], [[mx, x[1]], [y[0], my]], [[x[0], mx], [my, y[1]]], [[mx, x[1]], [my, y[1]]]];
    let parts = quarters.map(|[x, y]| rule.integrate_2d(x, y, f));
    let fine: f64 = parts.iter().sum();
    if depth == 0 || (fine - coarse).abs() <= tolerance {
        return fine;
    }
    // Errors of disjoint parts add up like a random walk: half each.
    quarters.iter().zip(parts).map(|(&q, p)| refine(rule, q, p, tolerance * 0.5, depth - 1, f)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: polynomials of degree 2n − 1 are integrated exactly; a narrow peak by its closed form.
    #[test]
    fn integrates_polynomials_and_peaks() {
        let rule = GaussLegendre::new(8);
        for degree in 0..16 {
            let got = rule.integrate([0.0, 1.0], |x| x.powi(degree));
            assert!((got - 1.0 / f64::from(degree + 1)).abs() < 1e-15, "degree {degree}");
        }
        let a: f64 = 1e-3;
        let peak = |x: f64, y: f64| a / (a * a + (x - 0.3).powi(2)) * 2.0 * y;
        let exact = ((0.7 / a).atan() + (0.3 / a).atan()) * 1.0;
        let got = integrate(&rule, [0.0, 1.0], [0.0, 1.0], 1e-9, 12, &peak);
        assert!((got / exact - 1.0).abs() < 1e-8, "{got} against {exact}");
    }
}
