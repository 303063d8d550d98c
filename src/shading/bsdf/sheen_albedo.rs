//! Directional albedo of sheen: what fibres take of light, and the surface below must give up; with the lobe itself.
//!
//! The lobe is the extension's (KHR_materials_sheen): D·V with the distribution D ("Charlie"; Estevez and Kulla 2017)
//! and V = 1/((1 + Λ(μo) + Λ(μi))·4·μo·μi), Λ as they fitted it. Cosines below [`HORIZON`] count as that. E
//! is tabulated over roughness^½ and μ^¼, by quadrature in f64, anew in every process that needs it.

use std::f32::consts::PI;

use glam::Vec3;

use super::microfacet::half_vector;
use crate::scene::{Fact, Facts, Material};

/// Nodes along each axis of the table.
const NODES: usize = 40;
/// Midpoints along the azimuth and along the height.
const QUADRATURE: usize = 48;
/// Cosines below it count as it: the lobe divides by them.
pub const HORIZON: f32 = 1e-3;

/// Directional albedo of a white lobe.
#[derive(Clone, Debug, PartialEq)]
pub struct SheenAlbedo {
    nodes: Vec<[f32; NODES]>,
}

impl SheenAlbedo {
    /// The table if any of the materials needs it, else an empty one.
    pub fn for_materials(materials: &[Material]) -> Self {
        if materials.iter().any(|material| Facts::of(material).has(Fact::Sheen)) {
            Self::compute()
        } else {
            SheenAlbedo { nodes: Vec::new() }
        }
    }

    /// The filled table; some tenths of a second.
    pub fn compute() -> Self {
        let node = |x: usize| x as f64 / (NODES - 1) as f64;
        let row = |r: usize| std::array::from_fn(|m| integrate(node(m).powi(4), node(r).powi(2)) as f32);
        SheenAlbedo { nodes: (0..NODES).map(row).collect() }
    }

    /// E, ≥ 0, for a cosine and a glTF roughness.
    #[inline(always)]
    pub fn at(&self, cos: f32, roughness: f32) -> f32 {
        let place = |x: f32| {
            let x = x * (NODES - 1) as f32;
            let first = (x as usize).min(NODES - 2);
            (first, x - first as f32)
        };
        let (m, x) = place(cos.clamp(0.0, 1.0).sqrt().sqrt());
        let (r, y) = place(roughness.clamp(0.0, 1.0).sqrt());
        let [near, far] = [r, r + 1].map(|r| self.nodes[r][m] + (self.nodes[r][m + 1] - self.nodes[r][m]) * x);
        near + (far - near) * y
    }
}

/// E of one cosine and roughness: 2π times the mean over the hemisphere of D·G/(4·μo).
fn integrate(mu: f64, roughness: f64) -> f64 {
    let horizon = f64::from(HORIZON);
    // No fibres are that smooth.
    let (mu, alpha) = (mu.max(horizon), (roughness * roughness).max(1e-6));
    let sin_o = (1.0 - mu * mu).max(0.0).sqrt();
    let mut sum = 0.0;
    for j in 0..QUADRATURE {
        // Graded towards the horizon.
        let q = (j as f64 + 0.5) / QUADRATURE as f64;
        let (z, weight) = (q * q, 2.0 * q * (q * q / horizon).min(1.0));
        let z = z.max(horizon);
        let sin_i = (1.0 - z * z).sqrt();
        let g = weight / (1.0 + lambda(mu, alpha) + lambda(z, alpha));
        for k in 0..QUADRATURE {
            // Graded towards the far side, where half vectors are highest.
            let p = (k as f64 + 0.5) / QUADRATURE as f64;
            let cos = (std::f64::consts::PI * p * p).cos();
            let length2 = sin_o * sin_o + sin_i * sin_i - 2.0 * sin_o * sin_i * cos + (mu + z) * (mu + z);
            let sin2 = (1.0 - (mu + z) * (mu + z) / length2).max(0.0);
            sum += g * 2.0 * p * charlie(sin2, alpha);
        }
    }
    2.0 * std::f64::consts::PI * sum / (QUADRATURE * QUADRATURE) as f64 / (4.0 * mu)
}

/// D: (2 + 1/α)·sin^(1/α)/2π, of the squared sine of the half vector.
fn charlie(sin2: f64, alpha: f64) -> f64 {
    (2.0 + 1.0 / alpha) * sin2.powf(0.5 / alpha) / (2.0 * std::f64::consts::PI)
}

/// Λ of a cosine.
fn lambda(cos: f64, alpha: f64) -> f64 {
    let near = (1.0 - alpha) * (1.0 - alpha);
    let of = |smooth: f64, rough: f64| near * smooth + (1.0 - near) * rough;
    let (a, b, c) = (of(25.3245, 21.5473), of(3.32435, 3.82987), of(0.16801, 0.19823));
    let (d, e) = (of(-1.27393, -1.97760), of(-4.85967, -4.32054));
    let l = |x: f64| a / (1.0 + b * x.powf(c)) + d * x + e;
    if cos < 0.5 { l(cos).exp() } else { (2.0 * l(0.5) - l(1.0 - cos)).exp() }
}

/// D·V·μi of a white lobe, for directions above the surface.
#[inline(always)]
pub fn fibres(wo: Vec3, wi: Vec3, roughness: f32) -> f32 {
    let (m, exponent) = (half_vector(wo, wi), 1.0 / (roughness * roughness));
    // The squared sine of a half vector loses nothing where it is small.
    let sin2 = (m.x * m.x + m.y * m.y).min(1.0);
    let d = (2.0 + exponent) * sin2.powf(0.5 * exponent) * (0.5 / PI);
    let alpha = f64::from(roughness) * f64::from(roughness);
    let [cos_o, cos_i] = [wo.z, wi.z].map(|cos| cos.clamp(HORIZON, 1.0));
    let [o, i] = [cos_o, cos_i].map(|cos| lambda(f64::from(cos), alpha) as f32);
    d / ((1.0 + o + i) * 4.0 * cos_o) * (wi.z / cos_i)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::warp;

    /// Oracle: the mean of the lobe itself over 10⁶ even directions; 5e-3 of it or 2e-3 where fibres are used.
    #[test]
    fn table_is_the_albedo() {
        let table = SheenAlbedo::compute();
        let n = 1000;
        for (roughness, bound) in [(0.15, 2e-2), (0.33, 6e-3), (0.62, 6e-3), (1.0, 6e-3)] {
            for mu in [0.97f32, 0.52, 0.13] {
                let wo = Vec3::new((1.0 - mu * mu).sqrt(), 0.0, mu);
                let mut sum = 0.0;
                for j in 0..n {
                    for k in 0..n / 10 {
                        let u = [(j as f32 + 0.5) / n as f32, (k as f32 + 0.5) / (n / 10) as f32];
                        sum += f64::from(
                            fibres(wo, warp::uniform_hemisphere(u), roughness) / warp::UNIFORM_HEMISPHERE_PDF,
                        );
                    }
                }
                let exact = sum / f64::from(n * n / 10);
                let got = f64::from(table.at(mu, roughness));
                assert!((got - exact).abs() < bound * exact + 2e-3, "{roughness} {mu}: {got} {exact}");
            }
        }
    }
}
