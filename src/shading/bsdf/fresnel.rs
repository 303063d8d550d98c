//! Fresnel reflectance of smooth interfaces, unpolarised.
//!
//! The dielectric form is exact and stable at index match and at the critical angle (HARDCASES B07–B09): with g² =
//! (η−1)(η+1) + cos², r_s = −(η−1)(η+1)/(cos+g)² and r_p = (η²cos − g)/(η²cos + g). It is computed in
//! f64, because monotonicity over consecutive f32 cosines and a relative index of exactly 1/η from the inside both
//! need it.

use glam::Vec3;

/// Largest relative index of a body. No clear material comes near (germanium has 4); beyond it, an f32 cosine inside no
/// longer resolves the critical angle (1 − cos is 2e-3 here, 2e-9 at 1e4).
pub const MAX_INDEX: f32 = 16.0;

/// Hemispherical average of Schlick's (1−μ)⁵: 2∫(1−μ)⁵ μ dμ.
pub const SCHLICK_AVERAGE: f32 = 1.0 / 21.0;

/// (1−cos)⁵.
#[inline(always)]
pub fn schlick_weight(cos: f32) -> f32 {
    let x = (1.0 - cos).clamp(0.0, 1.0);
    let x2 = x * x;
    x2 * x2 * x
}

/// Schlick's reflectance between `f0` at the normal and `f90` at grazing (Schlick 1994; glTF 2.0 appendix B).
#[inline(always)]
pub fn schlick(f0: Vec3, f90: f32, cos: f32) -> Vec3 {
    f0 + (Vec3::splat(f90) - f0) * schlick_weight(cos)
}

/// What a dielectric interface does to a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interface {
    /// Reflected fraction of the energy, from 0 to 1; 1 beyond the critical angle.
    pub reflectance: f32,
    /// Cosine of the refracted ray with the far side of the normal; 0 beyond the critical angle.
    pub cos_t: f32,
    /// n(far side)/n(near side).
    pub eta: f32,
}

/// Exact dielectric reflectance. `cos_o` > 0 arrives from outside, < 0 from inside; `eta` = n(inside)/n(outside).
#[inline(always)]
pub fn dielectric(cos_o: f32, eta: f32) -> Interface {
    let c = f64::from(cos_o.abs());
    let eta = if cos_o < 0.0 { 1.0 / f64::from(eta) } else { f64::from(eta) };
    let d = (eta - 1.0) * (eta + 1.0);
    let g = (d + c * c).max(0.0).sqrt();
    let s = c + g;
    let r_s = d / (s * s);
    let p = eta * eta * c;
    let r_p = (p - g) / (p + g);
    // d = 0 is an interface that is not there (0/0 above when the cosine underflows); g = 0 is total reflection.
    let reflectance = if d == 0.0 {
        0.0
    } else if g == 0.0 {
        1.0
    } else {
        (0.5 * (r_s * r_s + r_p * r_p)).min(1.0)
    };
    let cos_t = if d == 0.0 { c } else { g / eta };
    Interface { reflectance: reflectance as f32, cos_t: cos_t as f32, eta: eta as f32 }
}

/// Exact reflectance of a conductor of complex index n + ik seen from vacuum (Born and Wolf §14.2).
#[inline(always)]
pub fn conductor(cos_o: f32, n: f32, k: f32) -> f32 {
    let (c, n, k) = (f64::from(cos_o.abs().min(1.0)), f64::from(n), f64::from(k));
    let c2 = c * c;
    let s2 = 1.0 - c2;
    // a² + b² = |n̂² − sin²| with a + ib the refracted ray's complex cosine times n̂.
    let q = n * n - k * k - s2;
    let ab = (q * q + 4.0 * n * n * k * k).sqrt();
    let a = (0.5 * (ab + q)).max(0.0).sqrt();
    let denominator = ab + c2 + 2.0 * a * c;
    if denominator == 0.0 {
        // Index 1 at exactly grazing: nothing there to reflect.
        return 0.0;
    }
    let r_s = (ab + c2 - 2.0 * a * c) / denominator;
    let t = (c2 * ab + s2 * s2 - 2.0 * a * c * s2) / (c2 * ab + s2 * s2 + 2.0 * a * c * s2);
    (0.5 * r_s * (1.0 + t)) as f32
}

/// Hemispherical average 2∫F(μ)μ dμ of a dielectric; `eta` > 1 as seen from the thin medium, < 1 from the dense
/// one. Closed form for the thin side (Walsh 1926), 1 − F_in = (1 − F_out)/η² for the other. Absolute error about
/// 1e-16/(η−1)² by cancellation; exactly 0 at an index match.
pub fn dielectric_average(eta: f64) -> f64 {
    if eta == 1.0 {
        return 0.0;
    }
    if eta < 1.0 {
        return 1.0 - (1.0 - dielectric_average(1.0 / eta)) * (eta * eta);
    }
    let n = eta;
    let (n2, n3, n4) = (n * n, n * n * n, n * n * n * n);
    let f = 0.5
        + (n - 1.0) * (3.0 * n + 1.0) / (6.0 * (n + 1.0).powi(2))
        + n2 * (n2 - 1.0).powi(2) / (n2 + 1.0).powi(3) * ((n - 1.0) / (n + 1.0)).ln()
        - 2.0 * n3 * (n2 + 2.0 * n - 1.0) / ((n2 + 1.0) * (n4 - 1.0))
        + 8.0 * n4 * (n4 + 1.0) / ((n2 + 1.0) * (n4 - 1.0).powi(2)) * n.ln();
    f.clamp(0.0, 1.0)
}

/// Largest index of a coat that is distinguished from infinity: F0 is then within 4e-4 of 1.
const MAX_IOR: f32 = 1e4;

/// Reflectance at the normal of a dielectric of glTF's `ior`; 1 where that is 0.
#[inline(always)]
pub fn normal_reflectance(ior: f32) -> f32 {
    let n = relative_index(ior);
    let root = (n - 1.0) / (n + 1.0);
    if ior > 0.0 { root * root } else { 1.0 }
}

/// glTF's `ior` as a relative index; 0 is KHR_materials_ior's spelling of infinity.
#[inline(always)]
pub fn relative_index(ior: f32) -> f32 {
    if ior >= 1.0 { ior.min(MAX_IOR) } else { MAX_IOR }
}
