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

use std::f32::consts::FRAC_1_PI;
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
    /// What a white lobe loses up to each node, of the hemisphere, for directions to be drawn in proportion; with a
    /// little of everything. By alpha; of the filled table.
    lost: Vec<[f32; MU_NODES]>,
}

/// How what a white lobe loses is spread over cosines.
#[derive(Clone, Copy, Debug)]
pub struct Spread<'t> {
    rows: [&'t [f32; MU_NODES]; 2],
    fraction: f32,
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
    /// The table if any of the materials needs it, else an empty one. `whole`: so do those that lose light between
    /// facets.
    pub fn for_materials(materials: &[Material], whole: bool) -> Self {
        let needs = |facts: Facts| facts.is_layered() || whole && facts.loses();
        if materials.iter().any(|material| needs(Facts::of(material))) { Self::compute() } else { Self::empty() }
    }

    /// A table of zeros, for scenes of pure diffuse, metal and glass.
    pub fn empty() -> Self {
        SpecularAlbedo { rows: Box::new([ZERO_ROW; ALPHA_NODES]), lost: Vec::new() }
    }

    /// The filled table; some tens of milliseconds.
    pub fn compute() -> Self {
        let directions = half_turn(QUADRATURE);
        Self::fill(|mu, alpha| integrate(mu, alpha, &directions))
    }

    /// A table of other scales and biases, functions of μ and alpha.
    pub(super) fn tabulate(of: impl Fn(f64, f64) -> [f64; 2]) -> Self {
        Self::fill(|mu, alpha| {
            let [scale, bias] = of(mu, alpha).map(|x| x as f32);
            ScaleBias { scale, bias }
        })
    }

    fn fill(of: impl Fn(f64, f64) -> ScaleBias) -> Self {
        let mut table = Self::empty();
        for (r, row) in table.rows.iter_mut().enumerate() {
            let y = r as f64 / (ALPHA_NODES - 1) as f64;
            for (m, node) in row.nodes.iter_mut().enumerate() {
                let x = m as f64 / (MU_NODES - 1) as f64;
                *node = of(x.powi(4), y.powi(4));
            }
            row.average = average(&row.nodes);
        }
        table.lost = table.rows.iter().map(lost).collect();
        table
    }

    /// What the lobe of this alpha loses, by cosine, if it is white.
    #[inline(always)]
    pub fn spread(&self, alpha: f32) -> Spread<'_> {
        let (r, fraction) = place(alpha);
        Spread { rows: [&self.lost[r], &self.lost[r + 1]], fraction }
    }

    /// 1 − E for a lobe of this alpha (0 for a mirror), reflectance `f0` at the normal and `f90` at grazing.
    #[inline(always)]
    pub fn complement(&self, alpha: f32, f0: f32, f90: f32) -> Complement<'_> {
        let (r, fraction) = place(alpha);
        let rows = [&self.rows[r], &self.rows[r + 1]];
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

    /// 1 − E_avg, of the hemisphere; 0 where hardly anything gets below.
    #[inline(always)]
    pub fn average(&self) -> f32 {
        if self.inverse_average > 0.0 { 1.0 / self.inverse_average } else { 0.0 }
    }

    /// (1−E(cos_o))(1−E(cos_i))/(1−E_avg), given both complements: symmetric, and averaging to the first over
    /// cos_i.
    #[inline(always)]
    pub fn split(&self, below_o: f32, below_i: f32) -> f32 {
        below_o * below_i * self.inverse_average
    }
}

impl Spread<'_> {
    #[inline(always)]
    fn up_to(&self, node: usize) -> f32 {
        let [a, b] = self.rows.map(|row| row[node]);
        a + (b - a) * self.fraction
    }

    /// A cosine, drawn in proportion to what is lost of light that arrives under it; with its square.
    #[inline(always)]
    pub fn sample(&self, u: f32) -> (f32, f32) {
        let target = u * self.up_to(MU_NODES - 1);
        let (mut low, mut high) = (0, MU_NODES - 1);
        while high - low > 1 {
            let middle = (low + high) / 2;
            if self.up_to(middle) <= target { low = middle } else { high = middle }
        }
        let [from, to] = [low, high].map(|node| self.up_to(node));
        // Within a segment, cosines as of light from everywhere.
        let [a, b] = [low, high].map(squared);
        let cos2 = a + (b - a) * ((target - from) / (to - from)).clamp(0.0, 1.0);
        (cos2.sqrt(), cos2)
    }

    /// Density of directions under a cosine, sr⁻¹.
    #[inline(always)]
    pub fn pdf_sa(&self, cos: f32) -> f32 {
        let segment = ((cos.clamp(0.0, 1.0).sqrt().sqrt() * (MU_NODES - 1) as f32) as usize).min(MU_NODES - 2);
        let [from, to] = [segment, segment + 1].map(|node| self.up_to(node));
        let [a, b] = [segment, segment + 1].map(squared);
        (to - from) / (self.up_to(MU_NODES - 1) * (b - a)) * (cos * FRAC_1_PI)
    }
}

/// Squared cosine of a node.
#[inline(always)]
fn squared(node: usize) -> f32 {
    let x = node as f32 / (MU_NODES - 1) as f32;
    let x2 = x * x;
    let x4 = x2 * x2;
    x4 * x4
}

/// Share of directions that are drawn evenly: what the spread leaves out is small, and not nothing.
const EVEN: f64 = 0.02;

/// 2∫(1 − E) μ dμ up to each node, of a white lobe, and [`EVEN`] of the whole besides, in proportion to 2μ.
fn lost(row: &Row) -> [f32; MU_NODES] {
    let whole = (1.0 - f64::from(row.average.at(1.0, 1.0))).max(1e-6);
    let (mut sum, mut up_to) = (0.0, [0.0; MU_NODES]);
    for i in 0..MU_NODES - 1 {
        let all = f64::from(squared(i + 1)) - f64::from(squared(i));
        let returned = returned_in(i, |node| row.nodes[node].at(1.0, 1.0));
        sum += (all - returned).max(0.0) + EVEN * whole * all;
        up_to[i + 1] = sum as f32;
    }
    up_to
}

/// Row of an alpha and the fraction of the way to the next.
#[inline(always)]
fn place(alpha: f32) -> (usize, f32) {
    let y = alpha.clamp(0.0, 1.0).sqrt().sqrt() * (ALPHA_NODES - 1) as f32;
    let r = (y as usize).min(ALPHA_NODES - 2);
    (r, y - r as f32)
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
    let normals = VisibleNormals { mu, alpha };
    let (mut scale, mut bias) = (0.0, 0.0);
    normals.each(directions, |weight, facet| {
        let i_z = 2.0 * facet.o_m * facet.m_z - mu;
        if i_z > 0.0 {
            let g1 = normals.masked(weight, i_z);
            let w = (1.0 - facet.o_m).powi(5);
            scale += (1.0 - w) * g1;
            bias += w * g1;
        }
    });
    let n = (directions.len() * directions.len()) as f64;
    ScaleBias { scale: (scale / n) as f32, bias: (bias / n) as f32 }
}

/// Facets of GGX `alpha` > 0 that are visible from the cosine `mu`.
#[derive(Clone, Copy)]
pub(super) struct VisibleNormals {
    pub mu: f64,
    pub alpha: f64,
}

/// A facet: its cosines with the viewer and with the surface's normal.
#[derive(Clone, Copy)]
pub(super) struct Facet {
    pub o_m: f64,
    pub m_z: f64,
}

impl VisibleNormals {
    /// `weight` times Smith's masking of a direction above the surface; 0 below.
    pub fn masked(&self, weight: f64, cos: f64) -> f64 {
        let sin2 = (1.0 - cos * cos).max(0.0);
        if cos > 0.0 { weight * 2.0 * cos / (cos + (self.alpha * self.alpha * sin2 + cos * cos).sqrt()) } else { 0.0 }
    }

    /// The mean of `f`.
    pub fn mean(&self, f: impl Fn(Facet) -> f64) -> f64 {
        let mut sum = 0.0;
        self.each(&half_turn(QUADRATURE), |weight, facet| sum += weight * f(facet));
        sum / (QUADRATURE * QUADRATURE) as f64
    }

    /// Calls `f` with the weight of each facet, 1 in the mean.
    fn each(&self, directions: &[(f64, f64)], mut f: impl FnMut(f64, Facet)) {
        let VisibleNormals { mu, alpha } = *self;
        let o = (f64::sqrt(1.0 - mu * mu), mu);
        let length = f64::hypot(alpha * o.0, o.1);
        let stretched = (alpha * o.0 / length, o.1 / length);
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
                f(weight, Facet { o_m: (o.0 * m_x + o.1 * m_z).clamp(0.0, 1.0), m_z });
            }
        }
    }
}

/// 2∫E μ dμ of the interpolant.
fn average(nodes: &[ScaleBias; MU_NODES]) -> ScaleBias {
    let (mut scale, mut bias) = (0.0, 0.0);
    for i in 0..MU_NODES - 1 {
        scale += returned_in(i, |node| nodes[node].scale);
        bias += returned_in(i, |node| nodes[node].bias);
    }
    ScaleBias { scale: scale as f32, bias: bias as f32 }
}

/// 2∫E μ dμ over segment `i` of an interpolant that is linear in x = μ^¼: 8∫E(x) x⁷ dx.
fn returned_in(i: usize, node: impl Fn(usize) -> f32) -> f64 {
    let h = 1.0 / (MU_NODES - 1) as f64;
    let (a, b) = (i as f64 * h, (i + 1) as f64 * h);
    // ∫x⁷ and ∫x⁷(x−a)/h over [a,b].
    let whole = (b.powi(8) - a.powi(8)) / 8.0;
    let rising = ((b.powi(9) - a.powi(9)) / 9.0 - a * whole) / h;
    8.0 * (f64::from(node(i)) * (whole - rising) + f64::from(node(i + 1)) * rising)
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

    /// Oracles: the density integrates to 1 (to 1e-5), and a drawn cosine lies where the density's integral up to it is
    /// the number that drew it (1e-4).
    #[test]
    fn spreads_are_densities() {
        let table = SpecularAlbedo::compute();
        let n = 1 << 16;
        for alpha in [0.0, 1e-4, 0.01, 0.3, 1.0] {
            let spread = table.spread(alpha);
            // Midpoints in x = μ^¼.
            let at = |i: i32| (f64::from(i) + 0.5) / f64::from(n);
            let mass = |x: f64| {
                let mu = x.powi(4);
                2.0 * PI * f64::from(spread.pdf_sa(mu as f32)) * 4.0 * x.powi(3) / f64::from(n)
            };
            let total: f64 = (0..n).map(|i| mass(at(i))).sum();
            assert!((total - 1.0).abs() < 1e-4, "alpha {alpha}: {total}");
            for u in [0.05f32, 0.5, 0.93] {
                let (cos, cos2) = spread.sample(u);
                assert!((f64::from(cos * cos) - f64::from(cos2)).abs() < 1e-6);
                let below: f64 = (0..n).map(at).filter(|x| x.powi(4) < f64::from(cos)).map(mass).sum();
                assert!((below - f64::from(u)).abs() < 2e-4, "alpha {alpha}: {below} for {u}");
            }
        }
    }
}
