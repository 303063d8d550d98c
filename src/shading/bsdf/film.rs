//! Thin films: what interference does to the reflectance of a surface under a film (`KHR_materials_iridescence`).
//!
//! Source: the extension's text, after Belcour and Barla (2017): two interfaces, by Schlick's reflectance each, with
//! reflections of first and second order, integrated over the observer's response in Fourier space. Colours are linear
//! Rec.709; thickness in nanometres. Reflectances are clamped to [0, 1]. Limit: unpolarised, no absorption.

use std::f32::consts::{PI, TAU};

use glam::{Mat3, Vec3};

use super::fresnel::schlick_weight;

/// A film on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Film {
    /// How much of the reflectance is the film's, from 0 to 1.
    pub weight: f32,
    /// Index of refraction, ≥ 1.
    pub ior: f32,
    /// Thickness, nm.
    pub thickness_nm: f32,
}

/// Below this thickness a film fades into nothing, nm (so in the text).
const FADES_NM: f32 = 0.03;

impl Film {
    /// No film.
    pub const NONE: Film = Film { weight: 0.0, ior: 1.0, thickness_nm: 0.0 };

    /// Reflectance of a surface of reflectance `f0` at the normal, in [0, 1], under the film, for light under `cos`.
    #[inline(always)]
    pub fn reflectance(&self, cos: f32, f0: Vec3) -> Vec3 {
        let cos = cos.clamp(0.0, 1.0);
        let t = (self.thickness_nm / FADES_NM).clamp(0.0, 1.0);
        let eta = 1.0 + (self.ior - 1.0) * (t * t * (3.0 - 2.0 * t));
        let sin2 = (1.0 - cos * cos) / (eta * eta);
        if sin2 >= 1.0 {
            return Vec3::ONE;
        }
        let cos_in = (1.0 - sin2).sqrt();

        // From air to film, and from film to what is below.
        let r12 = mix(normal(eta), cos);
        let t121 = 1.0 - r12;
        let below = f0.clamp(Vec3::ZERO, Vec3::splat(0.9999)).map(|f0| {
            let root = f0.sqrt();
            (1.0 + root) / (1.0 - root)
        });
        let r23 = below.map(|below| mix(normal(below / eta), cos_in));
        // Reflected at a denser medium, a wave is turned by π.
        let turned =
            below.map(|below| if below < eta { PI } else { 0.0 }) + Vec3::splat(if eta < 1.0 { 0.0 } else { PI });

        let both = (r23 * r12).clamp(Vec3::splat(1e-5), Vec3::splat(0.9999));
        let amplitude = both.map(f32::sqrt);
        let all = r23 * (t121 * t121) / (Vec3::ONE - both);
        let path_nm = 2.0 * eta * self.thickness_nm * cos_in;
        let mut sum = all + r12;
        let mut order = all - t121;
        for m in 1..=2 {
            order *= amplitude;
            sum += order * 2.0 * sensitivity(m as f32 * path_nm, m as f32 * turned);
        }
        sum.clamp(Vec3::ZERO, Vec3::ONE)
    }

    /// `plain`, with the film's part of it in its place.
    #[inline(always)]
    pub fn over(&self, plain: Vec3, film: impl FnOnce() -> Vec3) -> Vec3 {
        if self.weight > 0.0 { plain.lerp(film(), self.weight) } else { plain }
    }
}

/// Reflectance at the normal of a relative index.
#[inline(always)]
fn normal(eta: f32) -> f32 {
    let root = (eta - 1.0) / (eta + 1.0);
    root * root
}

#[inline(always)]
fn mix(f0: f32, cos: f32) -> f32 {
    f0 + (1.0 - f0) * schlick_weight(cos)
}

/// What the eye sees of a wave of this path difference, each channel with its phase: Gaussians that fit the responses
/// of CIE 1931 in Fourier space (Belcour and Barla).
#[inline(always)]
fn sensitivity(path_nm: f32, phase: Vec3) -> Vec3 {
    // Beyond 10⁻³ nothing is left of the wave; phases stay numbers.
    let k = (TAU * path_nm * 1e-9).min(1.0);
    let gauss = |size: f32, at: f32, variance: f32, phase: f32| {
        size * (TAU * variance).sqrt() * (at * k + phase).cos() * (-variance * k * k).exp()
    };
    let x = gauss(5.4856e-13, 1.6810e6, 4.3278e9, phase.x) + gauss(9.7470e-14, 2.2399e6, 4.5282e9, phase.x);
    let y = gauss(4.4201e-13, 1.7953e6, 9.3046e9, phase.y);
    let z = gauss(5.2481e-13, 2.2084e6, 6.6121e9, phase.z);
    /// From XYZ.
    const REC709: Mat3 = Mat3::from_cols(
        Vec3::new(3.240_454_2, -0.969_266, 0.055_643_4),
        Vec3::new(-1.537_138_5, 1.876_010_8, -0.204_025_9),
        Vec3::new(-0.498_531_4, 0.041_556, 1.057_225_2),
    );
    REC709 * (Vec3::new(x, y, z) / 1.0685e-7)
}

#[cfg(test)]
mod tests {
    use super::super::fresnel::schlick;
    use super::*;

    /// Oracles: without thickness the film is not there at the normal, and Schlick's reflectance of the surface is left
    /// (1e-2: the text's sum of orders ends at the second; aslant, its Schlick weights stay without a film); of
    /// 12.5 µm, interference averages out and the sum of both interfaces' intensities is left.
    #[test]
    fn limits_of_thickness() {
        for f0 in [Vec3::splat(0.04), Vec3::new(0.9, 0.5, 0.2)] {
            for cos in [1.0, 0.6, 0.3] {
                let none = Film { weight: 1.0, ior: 1.4, thickness_nm: 0.0 }.reflectance(cos, f0);
                let off = (none - schlick(f0, 1.0, cos)).abs().max_element();
                assert!(cos < 1.0 || off < 1e-2, "{cos}: {none} {f0}");
                let thick = Film { weight: 1.0, ior: 1.4, thickness_nm: 12_500.0 }.reflectance(cos, f0);
                let sin2 = (1.0 - cos * cos) / (1.4 * 1.4);
                let below = f0.map(|f0| (1.0 + f0.sqrt()) / (1.0 - f0.sqrt()));
                let (r, s) = (mix(normal(1.4), cos), below.map(|b| mix(normal(b / 1.4), (1.0 - sin2).sqrt())));
                let sum = s.map(|s| r + (1.0 - r) * (1.0 - r) * s / (1.0 - r * s));
                assert!((thick - sum).abs().max_element() < 1e-3, "{cos}: {thick} {sum}");
            }
        }
    }

    /// Soap in air, 400 nm of index 1.33 over nothing (f0 0): dark where the path difference is whole wavelengths of
    /// green, 532 nm · 2 = 2 · 1.33 · 400 nm; bright a quarter wave thinner. Every value is a reflectance.
    #[test]
    fn films_interfere() {
        let at = |thickness_nm: f32| Film { weight: 1.0, ior: 1.33, thickness_nm }.reflectance(1.0, Vec3::ZERO);
        assert!(at(400.0).y < 0.3 * at(300.0).y, "{} {}", at(400.0), at(300.0));
        for thickness in 0..200 {
            for cos in [0.0, 0.1, 0.5, 1.0] {
                for f0 in [0.0, 0.04, 0.5, 1.0] {
                    let film = Film { weight: 1.0, ior: 1.8, thickness_nm: 5.0 * thickness as f32 };
                    let found = film.reflectance(cos, Vec3::splat(f0));
                    assert!(found.min_element() >= 0.0 && found.max_element() <= 1.0, "{film:?} {cos} {f0}: {found}");
                }
            }
        }
    }
}
