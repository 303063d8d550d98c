//! Pearson's chi-square of counts against expectations, and the bins over the sphere that samplers of directions need.

use crate::limits::chi2_tail;
use crate::quadrature::{GaussLegendre, integrate};

/// Outcome of a chi-square test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chi2 {
    /// Σ(observed − expected)²/expected over the cells after pooling.
    pub statistic: f64,
    /// Cells after pooling, less one.
    pub dof: usize,
    /// Probability of a statistic at least as large if the expectations are right.
    pub p_value: f64,
    /// Samples that fell into cells where none was expected.
    pub impossible: u64,
}

/// Expected counts below which cells are pooled.
const POOL_BELOW: f64 = 5.0;

/// Tests counts against expectations with the same total. Cells are pooled, smallest first, until every cell expects at
/// least five; samples in cells that expect exactly nothing are counted apart and fail the test by themselves.
pub fn chi2_test(observed: &[u64], expected: &[f64]) -> Chi2 {
    assert_eq!(observed.len(), expected.len(), "one expectation per cell");
    let mut order: Vec<usize> = (0..observed.len()).collect();
    order.sort_by(|&a, &b| expected[a].total_cmp(&expected[b]));
    let (mut statistic, mut cells, mut impossible) = (0.0, 0usize, 0);
    let (mut pooled_o, mut pooled_e) = (0.0, 0.0);
    let add = |o: f64, e: f64, statistic: &mut f64, cells: &mut usize| {
        *statistic += (o - e) * (o - e) / e;
        *cells += 1;
    };
    for &i in &order {
        if expected[i] <= 0.0 {
            impossible += observed[i];
            continue;
        }
        pooled_o += observed[i] as f64;
        pooled_e += expected[i];
        if pooled_e >= POOL_BELOW {
            add(pooled_o, pooled_e, &mut statistic, &mut cells);
            (pooled_o, pooled_e) = (0.0, 0.0);
        }
    }
    // Only a total below five can be left over.
    if pooled_e > 0.0 {
        add(pooled_o, pooled_e, &mut statistic, &mut cells);
    }
    let dof = cells.saturating_sub(1);
    let p_value = match (dof, impossible) {
        (_, 1..) => 0.0,
        (0, 0) => 1.0,
        _ => chi2_tail(statistic, dof),
    };
    Chi2 { statistic, dof, p_value, impossible }
}

/// Equal cells in (cos θ, φ) over a band of the sphere, and one more for samples that were rejected.
#[derive(Clone, Debug)]
pub struct SphereBins {
    /// cos θ of the lower and upper edge.
    pub cos: [f64; 2],
    /// Rows in cos θ.
    pub rows: usize,
    /// Columns in φ.
    pub columns: usize,
}

impl SphereBins {
    /// The upper hemisphere, 64 × 128 cells.
    pub fn hemisphere() -> Self {
        SphereBins { cos: [0.0, 1.0], rows: 64, columns: 128 }
    }

    /// The whole sphere, 64 × 64 cells.
    pub fn sphere() -> Self {
        SphereBins { cos: [-1.0, 1.0], rows: 64, columns: 64 }
    }

    /// Cell of a unit direction.
    pub fn cell(&self, [x, y, z]: [f64; 3]) -> usize {
        let row = (z - self.cos[0]) / (self.cos[1] - self.cos[0]) * self.rows as f64;
        let turn = (y.atan2(x) / std::f64::consts::TAU).rem_euclid(1.0);
        let row = (row.max(0.0) as usize).min(self.rows - 1);
        let column = ((turn * self.columns as f64) as usize).min(self.columns - 1);
        row * self.columns + column
    }

    /// Counts per cell of `n` draws; `None` counts as rejected, in the last cell.
    pub fn observe(&self, n: u64, mut draw: impl FnMut() -> Option<[f64; 3]>) -> Vec<u64> {
        let mut counts = vec![0; self.rows * self.columns + 1];
        for _ in 0..n {
            let cell = draw().map_or(self.rows * self.columns, |d| self.cell(d));
            counts[cell] += 1;
        }
        counts
    }

    /// Expected counts of `n` draws from a density over solid angle; what the density lacks to 1 is rejection. Each
    /// cell is integrated by four panels of 4×4 points or more, until the error is a hundredth of the count's
    /// deviation.
    pub fn expect(&self, n: u64, pdf: &impl Fn([f64; 3]) -> f64) -> Vec<f64> {
        let rule = GaussLegendre::new(4);
        let step_cos = (self.cos[1] - self.cos[0]) / self.rows as f64;
        let step_phi = std::f64::consts::TAU / self.columns as f64;
        let density = |z: f64, phi: f64| {
            let r = ((1.0 - z) * (1.0 + z)).max(0.0).sqrt();
            pdf([r * phi.cos(), r * phi.sin(), z])
        };
        let mut expected = Vec::with_capacity(self.rows * self.columns + 1);
        let n = n as f64;
        for row in 0..self.rows {
            let z = self.cos[0] + row as f64 * step_cos;
            for column in 0..self.columns {
                let phi = column as f64 * step_phi;
                let (z, phi) = ([z, z + step_cos], [phi, phi + step_phi]);
                let coarse = n * rule.integrate_2d(z, phi, &density);
                let tolerance = 1e-2 * coarse.max(1e-2).sqrt() / n;
                expected.push(n * integrate(&rule, z, phi, tolerance, 6, &density));
            }
        }
        let total: f64 = expected.iter().sum();
        expected.push((n - total).max(0.0));
        expected
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Pcg32;

    /// Oracle: uniform cells pass; a tilt of 2 % and a sample in an impossible cell do not. False-alarm rate 1e-6.
    #[test]
    fn accepts_right_and_rejects_wrong_counts() {
        let (n, cells) = (1_000_000u64, 256);
        let mut rng = Pcg32::new(3, 9);
        let mut observed = vec![0; cells];
        for _ in 0..n {
            observed[(rng.next_f64() * cells as f64) as usize] += 1;
        }
        let uniform = vec![n as f64 / cells as f64; cells];
        assert!(chi2_test(&observed, &uniform).p_value > 1e-6);
        let tilted: Vec<f64> =
            uniform.iter().enumerate().map(|(i, e)| e * (1.0 + 0.02 * (i as f64 / 127.5 - 1.0))).collect();
        assert!(chi2_test(&observed, &tilted).p_value < 1e-6);
        let mut holed = uniform.clone();
        holed[7] = 0.0;
        let verdict = chi2_test(&observed, &holed);
        assert_eq!((verdict.p_value, verdict.impossible), (0.0, observed[7]));
    }

    /// Oracle: pooling keeps every cell at five or more; many tiny cells become few.
    #[test]
    fn pools_small_cells() {
        let verdict = chi2_test(&[1; 100], &[1.0; 100]);
        assert_eq!((verdict.dof, verdict.statistic), (19, 0.0));
    }
}
