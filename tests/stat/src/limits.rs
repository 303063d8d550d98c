//! Limits of test statistics: a probability in, the largest statistic that passes out. Found by bisection on the tail
//! functions, which are accurate far out where published inverses are not.

use statrs::function::beta::beta_reg;
use statrs::function::erf::erfc;
use statrs::function::gamma::gamma_ur;

/// |z| that m independent standard normal statistics exceed together with probability `family` at most (Bonferroni,
/// two-sided).
pub fn z_limit(m: usize, family: f64) -> f64 {
    let p = family / m.max(1) as f64;
    invert(p, normal_tail)
}

/// P(|z| of a standard normal statistic at least this large).
pub fn normal_tail(z: f64) -> f64 {
    erfc(z.abs() / std::f64::consts::SQRT_2)
}

/// Upper point of chi-square with `dof` degrees of freedom at tail probability `p`.
pub fn chi2_limit(dof: usize, p: f64) -> f64 {
    invert(p, |x| chi2_tail(x, dof))
}

/// |t| of Student's distribution with two-sided tail probability `p`; `dof` may be fractional.
pub fn t_limit(dof: f64, p: f64) -> f64 {
    invert(p, |t| t_tail(t, dof))
}

/// Level for one of m independent tests so that all together stay at `family` (Šidák).
pub fn sidak_level(m: usize, family: f64) -> f64 {
    // 1 − (1 − family)^(1/m) without cancellation.
    -((-family).ln_1p() / m.max(1) as f64).exp_m1()
}

/// P(chi-square with `dof` > x).
pub(crate) fn chi2_tail(x: f64, dof: usize) -> f64 {
    if x <= 0.0 { 1.0 } else { gamma_ur(dof as f64 / 2.0, x / 2.0) }
}

/// P(|Student t with `dof`| > t).
pub(crate) fn t_tail(t: f64, dof: f64) -> f64 {
    beta_reg(dof / 2.0, 0.5, dof / (dof + t * t))
}

/// x ≥ 0 with tail(x) = p for a tail falling from 1 to 0.
fn invert(p: f64, tail: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while tail(high) > p {
        low = high;
        high *= 2.0;
    }
    // 200 halvings reach neighbouring floats from any bracket.
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if tail(middle) > p { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: the limits printed in HARDCASES §1.3.
    #[test]
    fn match_published_values() {
        for (m, z) in [(1, 3.891), (64, 4.8031), (1024, 5.331), (4096, 5.5774), (65_536, 6.0416), (196_608, 6.2164)] {
            assert!((z_limit(m, 1e-4) - z).abs() < 6e-4, "m {m}: {}", z_limit(m, 1e-4));
        }
        for (dof, x) in [(64, 132.787), (1024, 1253.69), (4096, 4540.72), (65_536, 67271.3)] {
            assert!((chi2_limit(dof, 1e-6) / x - 1.0).abs() < 5e-6, "dof {dof}: {}", chi2_limit(dof, 1e-6));
        }
        // B batches have B − 1 degrees of freedom.
        for (batches, t) in [(8, 15.767), (16, 7.9032), (32, 6.072)] {
            assert!((t_limit(f64::from(batches - 1), 1e-6) / t - 1.0).abs() < 1e-4, "B {batches}");
        }
        assert!((sidak_level(1000, 1e-6) / 1e-9 - 1.0).abs() < 1e-5);
    }
}
