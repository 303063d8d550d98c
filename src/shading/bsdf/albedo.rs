//! Directional albedo of a GGX lobe with Schlick Fresnel: E(μ, α) = f0·scale + f90·bias, tabulated.
//! What the specular lobe of a dielectric takes is what the diffuse base below it must give up.
//!
//! The table is linear between its nodes and its hemispherical average is the exact integral of that interpolant, so a
//! base scaled by (1−E(μo))(1−E(μi))/(1−E_avg) reflects exactly 1−E(μo) of what the table says; only the
//! table's own error reaches the energy balance: below 1.5e-3 for cosines above 0.1, 2.5e-3 above 0.01, 1e-2 below
//! (tested). Both axes are spaced by the fourth root, because E bends where μ and alpha are alike, however small.
//!
//! Origin: quadrature in f64 over the visible normals of `microfacet` (separable Smith), weight F·G1(wi), 32 by 32
//! midpoints graded towards the rim of the cap; the row of alpha 0 in closed form. Made anew, in a fixed order, by
//! every process that needs it.

use std::f64::consts::PI;

use super::fresnel::schlick_weight;
use crate::math::columns::array_column;
use crate::scene::Material;
use crate::scene::material::facts::Facts;

/// Nodes along μ^¼.
const MU_NODES: usize = 48;
/// Nodes along alpha^¼.
const ALPHA_NODES: usize = 48;
/// Midpoints per dimension of the quadrature.
const QUADRATURE: usize = 32;
/// 1 − E_avg below which a base receives no light worth a division: E itself is stored to f32 rounding, 2⁻²⁴.
const OPAQUE_COAT: f32 = 1.0 / (1 << 20) as f32;

/// A node: E = f0·scale + f90·bias.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ScaleBias {
    scale: f32,
    bias: f32,
}

/// One alpha.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Row {
    nodes: [ScaleBias; MU_NODES],
    average: ScaleBias,
}

const ZERO_ROW: Row =
    Row { nodes: [ScaleBias { scale: 0.0, bias: 0.0 }; MU_NODES], average: ScaleBias { scale: 0.0, bias: 0.0 } };

/// The table. Zero, and never read, when no material of the scene has a specular lobe over a base.
#[derive(Clone, Debug, PartialEq)]
pub struct SpecularAlbedo {
    rows: Box<[Row; ALPHA_NODES]>,
}

/// 1 − E of one lobe, ready for any direction.
#[derive(Clone, Copy, Debug)]
pub struct Complement<'t> {
    rows: [&'t Row; 2],
    fraction: f32,
    f0: f32,
    f90: f32,
    /// 1/(1 − E_avg); 0 when nothing gets below.
    inverse_average: f32,
}

impl SpecularAlbedo {
    /// The table if any of the materials needs it, else an empty one.
    pub fn for_materials(materials: &[Material]) -> Self {
        if materials.iter().any(|material| Facts::of(material).is_layered()) { Self::compute() } else { Self::empty() }
    }

    /// A table of zeros, for scenes of pure diffuse, metal and glass.
    pub fn empty() -> Self {
        SpecularAlbedo { rows: Box::new([ZERO_ROW; ALPHA_NODES]) }
    }

    /// The filled table; some tens of milliseconds.
    pub fn compute() -> Self {
        let directions = half_turn(QUADRATURE);
        let mut table = Self::empty();
        for (r, row) in table.rows.iter_mut().enumerate() {
            let y = r as f64 / (ALPHA_NODES - 1) as f64;
            for (m, node) in row.nodes.iter_mut().enumerate() {
                let x = m as f64 / (MU_NODES - 1) as f64;
                *node = integrate(x.powi(4), y.powi(4), &directions);
            }
            row.average = average(&row.nodes);
        }
        table
    }

    /// 1 − E for a lobe of this alpha (0 for a mirror), reflectance `f0` at the normal and `f90` at grazing.
    #[inline(always)]
    pub fn complement(&self, alpha: f32, f0: f32, f90: f32) -> Complement<'_> {
        let y = alpha.clamp(0.0, 1.0).sqrt().sqrt() * (ALPHA_NODES - 1) as f32;
        let r = (y as usize).min(ALPHA_NODES - 2);
        let rows = [&self.rows[r], &self.rows[r + 1]];
        let fraction = y - r as f32;
        let [a, b] = rows.map(|row| row.average.at(f0, f90));
        let below = 1.0 - (a + (b - a) * fraction);
        let inverse_average = if below > OPAQUE_COAT { 1.0 / below } else { 0.0 };
        Complement { rows, fraction, f0, f90, inverse_average }
    }
}

impl ScaleBias {
    #[inline(always)]
    fn at(self, f0: f32, f90: f32) -> f32 {
        self.scale * f0 + self.bias * f90
    }
}

impl Complement<'_> {
    /// 1 − E(cos), from 0 to 1.
    #[inline(always)]
    pub fn at(&self, cos: f32) -> f32 {
        let x = cos.clamp(0.0, 1.0).sqrt().sqrt() * (MU_NODES - 1) as f32;
        let m = (x as usize).min(MU_NODES - 2);
        let t = x - m as f32;
        let [a, b] = self.rows.map(|row| {
            let near = row.nodes[m].at(self.f0, self.f90);
            let far = row.nodes[m + 1].at(self.f0, self.f90);
            near + (far - near) * t
        });
        (1.0 - (a + (b - a) * self.fraction)).clamp(0.0, 1.0)
    }

    /// (1−E(cos_o))(1−E(cos_i))/(1−E_avg), given both complements: symmetric, and averaging to the first over
    /// cos_i.
    #[inline(always)]
    pub fn split(&self, below_o: f32, below_i: f32) -> f32 {
        below_o * below_i * self.inverse_average
    }
}

array_column!(Complement<'_>);

/// Cosines and sines of `n` midpoints of half a turn: the integrand is even in the azimuth.
fn half_turn(n: usize) -> Vec<(f64, f64)> {
    (0..n).map(|i| PI * (i as f64 + 0.5) / n as f64).map(|phi| (phi.cos(), phi.sin())).collect()
}

/// Scale and bias at one (μ, α): the mean of F·G1(wi) over the normals visible from μ, by as many
/// midpoints in height as there are directions.
fn integrate(mu: f64, alpha: f64, directions: &[(f64, f64)]) -> ScaleBias {
    if alpha == 0.0 {
        let bias = schlick_weight(mu as f32);
        return ScaleBias { scale: 1.0 - bias, bias };
    }
    let o = (f64::sqrt(1.0 - mu * mu), mu);
    let length = f64::hypot(alpha * o.0, o.1);
    let stretched = (alpha * o.0 / length, o.1 / length);
    let (mut scale, mut bias) = (0.0, 0.0);
    let n = directions.len();
    for j in 0..n {
        // Graded towards the rim, where few normals decide how much goes below the horizon.
        let q = (j as f64 + 0.5) / n as f64;
        let (rest, weight) = (q * q * q, 3.0 * q * q);
        let t = (1.0 - rest) * (1.0 + stretched.1);
        let r = (t * (2.0 - t)).max(0.0).sqrt();
        let h_z = rest * (1.0 + stretched.1);
        for &(cos, sin) in directions {
            let (x, y) = (alpha * (r * cos + stretched.0), alpha * r * sin);
            let norm = (x * x + y * y + h_z * h_z).sqrt();
            let (m_x, m_z) = (x / norm, h_z / norm);
            let o_m = (o.0 * m_x + o.1 * m_z).clamp(0.0, 1.0);
            let i_z = 2.0 * o_m * m_z - o.1;
            if i_z > 0.0 {
                let sin2 = (1.0 - i_z * i_z).max(0.0);
                let g1 = weight * 2.0 * i_z / (i_z + (alpha * alpha * sin2 + i_z * i_z).sqrt());
                let w = (1.0 - o_m).powi(5);
                scale += (1.0 - w) * g1;
                bias += w * g1;
            }
        }
    }
    let n = (n * n) as f64;
    ScaleBias { scale: (scale / n) as f32, bias: (bias / n) as f32 }
}

/// 2∫E μ dμ of the interpolant that is linear in x = μ^¼: 8∫E(x) x⁷ dx, segment by segment.
fn average(nodes: &[ScaleBias; MU_NODES]) -> ScaleBias {
    let h = 1.0 / (MU_NODES - 1) as f64;
    let (mut scale, mut bias) = (0.0, 0.0);
    for (i, pair) in nodes.windows(2).enumerate() {
        let (a, b) = (i as f64 * h, (i + 1) as f64 * h);
        // ∫x⁷ and ∫x⁷(x−a)/h over [a,b].
        let whole = (b.powi(8) - a.powi(8)) / 8.0;
        let rising = ((b.powi(9) - a.powi(9)) / 9.0 - a * whole) / h;
        let add = |near: f32, far: f32| f64::from(near) * (whole - rising) + f64::from(far) * rising;
        scale += 8.0 * add(pair[0].scale, pair[1].scale);
        bias += 8.0 * add(pair[0].bias, pair[1].bias);
    }
    ScaleBias { scale: scale as f32, bias: bias as f32 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pathspace_stat::GaussLegendre;

    /// Oracle: the same quadrature eight times as fine in each dimension, between the nodes; bounds as on the page.
    #[test]
    fn interpolation_error_is_as_stated() {
        let table = SpecularAlbedo::compute();
        let fine = half_turn(8 * QUADRATURE);
        for a in 0..24 {
            let alpha = ((f64::from(a) + 0.47) / 24.0).powi(2);
            for m in 0..24 {
                let mu = ((f64::from(m) + 0.37) / 24.0).powi(4);
                let exact = integrate(mu, alpha, &fine);
                let bound = match mu {
                    0.1.. => 1.5e-3,
                    0.01.. => 2.5e-3,
                    _ => 1e-2,
                };
                for (f0, f90) in [(0.04, 1.0), (1.0, 1.0)] {
                    let got = 1.0 - table.complement(alpha as f32, f0, f90).at(mu as f32);
                    assert!((got - exact.at(f0, f90)).abs() < bound, "mu {mu} alpha {alpha} f0 {f0}: {got}, {exact:?}");
                }
            }
        }
    }

    /// Oracle: a white base under any coat reflects exactly what the coat left it, 2∫split μ dμ = 1 − E(μo), to
    /// f32 rounding (1e-5), because E_avg is the integral of the interpolant itself.
    #[test]
    fn split_conserves_energy() {
        let table = SpecularAlbedo::compute();
        let rule = GaussLegendre::new(8);
        for alpha in [0.0, 1e-3, 0.04, 0.3, 1.0] {
            for (f0, f90) in [(0.0, 0.0), (0.04, 1.0), (0.5, 0.5), (0.9, 1.0)] {
                let below = table.complement(alpha, f0, f90);
                for mu in [1.0, 0.4, 0.02] {
                    let below_o = below.at(mu);
                    let segment = |i: usize| {
                        let x = [i, i + 1].map(|k| k as f64 / (MU_NODES - 1) as f64);
                        rule.integrate(x, |x| {
                            8.0 * x.powi(7) * f64::from(below.split(below_o, below.at(x.powi(4) as f32)))
                        })
                    };
                    let total: f64 = (0..MU_NODES - 1).map(segment).sum();
                    assert!(
                        (total - f64::from(below_o)).abs() < 1e-5,
                        "alpha {alpha} f0 {f0} mu {mu}: {total}, {below_o}"
                    );
                }
            }
        }
        // Nothing to split: exactly Lambert.
        let lambert = table.complement(0.3, 0.0, 0.0);
        assert_eq!(lambert.split(lambert.at(0.3), lambert.at(0.7)), 1.0);
    }
}
