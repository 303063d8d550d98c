//! GGX microfacets with separable Smith masking, G = G1(wo)·G1(wi), and sampling of visible normals.
//! Directions in the shading frame, n = +z; wo is above the surface; pdfs in sr⁻¹, of normals or of directions as named.
//!
//! Sources: Walter et al. 2007 (distribution, masking), Heitz 2014 (anisotropic Λ), Dupuy and Benyoub 2023 (visible
//! normals by a spherical cap). Every formula is arranged so that no difference of near-equal numbers and no division
//! by a bare cosine appears: D is a sum of squares of slopes (HARDCASES B04) and G1 is only used as G1/cos, which stays
//! finite at cos → 0 (B06).
//!
//! Limit: below [`ALPHA_DELTA`] a lobe is treated as a mirror by the materials built on this file.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use crate::math::angle::sin_cos_turns;

/// GGX alpha below which a lobe is a delta mirror. The reflected cone then has a half angle under 2e-4 rad, a 23rd of
/// the sun's radius, and the half vector of two f32 directions (error about 1e-7) would no longer resolve the slope to
/// better than a thousandth of alpha, which sampling and evaluation need in order to agree.
pub const ALPHA_DELTA: f32 = 1e-4;

/// A GGX distribution of normals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ggx {
    /// RMS-like slope width along x and y of the shading frame, > 0.
    pub alpha: Vec2,
}

/// Mirror reflection off a distribution with unit Fresnel reflectance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflection {
    /// D·G1(wo)·G1(wi)/(4·cos_o): f·cos_i for F = 1, sr⁻¹.
    pub f_cos: f32,
    /// Density of the reflected direction, sr⁻¹.
    pub pdf_sa: f32,
}

impl Ggx {
    /// The same width in every direction.
    #[inline(always)]
    pub fn isotropic(alpha: f32) -> Self {
        Ggx { alpha: Vec2::splat(alpha) }
    }

    /// Widths along x and y.
    #[inline(always)]
    pub fn anisotropic(alpha_x: f32, alpha_y: f32) -> Self {
        Ggx { alpha: Vec2::new(alpha_x, alpha_y) }
    }

    /// Density D(m) of microfacet area over solid angle, sr⁻¹; m above the surface and of unit length.
    #[inline(always)]
    pub fn density(self, m: Vec3) -> f32 {
        let sx = m.x / self.alpha.x;
        let sy = m.y / self.alpha.y;
        let t = sx * sx + sy * sy + m.z * m.z;
        1.0 / (PI * self.alpha.x * self.alpha.y * (t * t))
    }

    /// Length of the direction stretched by alpha: √(αx²x² + αy²y² + z²).
    #[inline(always)]
    fn stretched_length(self, w: Vec3) -> f32 {
        let x = self.alpha.x * w.x;
        let y = self.alpha.y * w.y;
        (x * x + y * y + w.z * w.z).sqrt()
    }

    /// Smith masking G1(w)/|cos|: finite down to cos = 0.
    #[inline(always)]
    pub fn masking_over_cos(self, w: Vec3) -> f32 {
        2.0 / (w.z.abs() + self.stretched_length(w))
    }

    /// Smith masking G1(w) from 0 to 1.
    #[inline(always)]
    pub fn masking(self, w: Vec3) -> f32 {
        (w.z.abs() * self.masking_over_cos(w)).min(1.0)
    }

    /// Density over solid angle of normals, as `sample_visible` draws them, sr⁻¹.
    #[inline(always)]
    pub fn visible_pdf(self, wo: Vec3, m: Vec3) -> f32 {
        self.masking_over_cos(wo) * wo.dot(m).max(0.0) * self.density(m)
    }

    /// Draws a normal in proportion to the area that `wo` sees of it. Of unit length with m.z > 0 for wo.z > 0.
    #[inline(always)]
    pub fn sample_visible(self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        // In the space where the distribution is a hemisphere, the half vector of a direction uniform over the cap
        // that a sphere shows to the viewer is a visible normal.
        let o = Vec3::new(self.alpha.x * wo.x, self.alpha.y * wo.y, wo.z).normalize();
        let (sin, cos) = sin_cos_turns(u[0]);
        // z of the cap direction is 1 − t; written by t, neither its sine nor the half vector's z cancels.
        let t = u[1] * (1.0 + o.z);
        let r = (t * (2.0 - t)).max(0.0).sqrt();
        let h_z = (1.0 - u[1]) * (1.0 + o.z);
        Vec3::new(self.alpha.x * (r * cos + o.x), self.alpha.y * (r * sin + o.y), h_z).normalize()
    }

    /// Reflection from `wo` to `wi` about the normal `m`, all above the surface.
    #[inline(always)]
    pub fn reflection(self, wo: Vec3, wi: Vec3, m: Vec3) -> Reflection {
        let pdf_sa = 0.25 * self.density(m) * self.masking_over_cos(wo);
        Reflection { f_cos: pdf_sa * self.masking(wi), pdf_sa }
    }
}

/// Unit half vector of two directions above the surface. Scaled first, so that two opposite grazing directions give
/// the normal and not 0/0.
#[inline(always)]
pub fn half_vector(wo: Vec3, wi: Vec3) -> Vec3 {
    let h = wo + wi;
    let h = h / h.x.abs().max(h.y.abs()).max(h.z.abs());
    h / h.length()
}

/// `wo` mirrored about the unit normal `m`.
#[inline(always)]
pub fn reflect(wo: Vec3, m: Vec3) -> Vec3 {
    (2.0 * wo.dot(m)) * m - wo
}

#[cfg(test)]
mod tests {
    use super::*;

    /// HARDCASES B04. Oracle: the closed form in f64 at the true slope; 1e-5 relative. Albedo at alpha = 1e-3: 3e-6 of 1.
    #[test]
    fn b04_density_of_near_mirrors() {
        let peaks = [
            (0.1, 31.830988),
            (0.01, 3183.099),
            (3e-3, 35367.765),
            (1e-3, 318309.86),
            (3e-4, 3536776.2),
            (1e-4, 31830990.0),
        ];
        for (alpha, peak) in peaks {
            let ggx = Ggx::isotropic(alpha as f32);
            let got = f64::from(ggx.density(Vec3::Z));
            assert!((got / peak - 1.0).abs() <= 1e-5, "alpha {alpha}: peak {got} against {peak}");
            for k in [0.5, 1.0, 3.0] {
                let theta = f64::atan(k * alpha);
                let (s, c) = theta.sin_cos();
                let exact = alpha * alpha / (f64::from(PI) * (s * s + alpha * alpha * c * c).powi(2));
                for turn in [0.0, 0.7_f64] {
                    let m = Vec3::new((s * turn.cos()) as f32, (s * turn.sin()) as f32, c as f32);
                    let got = f64::from(ggx.density(m));
                    assert!((got / exact - 1.0).abs() <= 1e-5, "alpha {alpha} slope {k}: {got} against {exact}");
                }
            }
        }
        let ggx = Ggx::isotropic(1e-3);
        for mu in [1.0, 0.9, 0.5_f32] {
            let wo = Vec3::new((1.0 - mu * mu).sqrt(), 0.0, mu);
            let mut albedo = 0.0;
            for k in 0..64 * 64 {
                let u = [(k / 64) as f32 / 64.0 + 0.5 / 64.0, (k % 64) as f32 / 64.0 + 0.5 / 64.0];
                let wi = reflect(wo, ggx.sample_visible(wo, u));
                albedo += if wi.z > 0.0 { f64::from(ggx.masking(wi)) } else { 0.0 };
            }
            albedo /= 64.0 * 64.0;
            assert!((albedo - 1.0).abs() <= 3e-6, "mu {mu}: {albedo}");
        }
    }

    /// HARDCASES B06, exhaustive grid. Oracle: unit length to 2⁻²¹, above the surface, finite positive density, masking
    /// at most 1.
    #[test]
    fn b06_corners_of_visible_normals() {
        let u = [0.0, 0.5_f32.powi(32), 0.5, 1.0 - 0.5_f32.powi(24)];
        let alphas = [(1e-4, 1e-4), (1e-3, 1e-3), (1.0, 1.0), (1e-3, 1.0), (1.0, 1e-3)];
        for mu in [1.0, 1.0 - 0.5_f32.powi(24), 1e-3, 1e-6, 1e-30] {
            for turn in [0.0, 0.3, 1.6, 4.0_f32] {
                let s = ((1.0 - mu) * (1.0 + mu)).sqrt();
                let wo = Vec3::new(s * turn.cos(), s * turn.sin(), mu);
                for (ax, ay) in alphas {
                    let ggx = Ggx::anisotropic(ax, ay);
                    for u in u.iter().flat_map(|&a| u.map(|b| [a, b])) {
                        let case = format!("mu {mu} turn {turn} alpha {ax} {ay} u {u:?}");
                        let m = ggx.sample_visible(wo, u);
                        assert!(m.is_finite() && (m.length() - 1.0).abs() <= 0.5_f32.powi(21), "{case}: {m}");
                        assert!(m.z > 0.0, "{case}: {m}");
                        let wi = reflect(wo, m);
                        if wi.z > 0.0 {
                            let r = ggx.reflection(wo, wi, m);
                            assert!(r.pdf_sa.is_finite() && r.pdf_sa > 0.0, "{case}: {r:?}");
                            assert!(r.f_cos >= 0.0 && r.f_cos <= r.pdf_sa, "{case}: {r:?}");
                        }
                    }
                }
            }
        }
    }

    /// Oracle: two opposite grazing directions have the normal between them, however grazing.
    #[test]
    fn half_vectors_survive_grazing() {
        for z in [1e-3, 1e-20, 1e-38, 1e-45_f32] {
            let m = half_vector(Vec3::new(1.0, 0.0, z), Vec3::new(-1.0, 0.0, z));
            assert_eq!(m, Vec3::Z, "z {z}");
        }
    }
}
