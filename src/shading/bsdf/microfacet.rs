//! GGX microfacets with separable Smith masking, G = G1(wo)·G1(wi), and sampling of visible normals. Directions in the
//! shading frame, n = +z; wo is above the surface; pdfs in sr⁻¹, of normals or of directions as named.
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

    /// Oracle: two opposite grazing directions have the normal between them, however grazing.
    #[test]
    fn half_vectors_survive_grazing() {
        for z in [1e-3, 1e-20, 1e-38, 1e-45_f32] {
            let m = half_vector(Vec3::new(1.0, 0.0, z), Vec3::new(-1.0, 0.0, z));
            assert_eq!(m, Vec3::Z, "z {z}");
        }
    }
}
