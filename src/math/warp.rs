//! Warps of the unit square onto domains that sampling needs. Each keeps clear of the rim where its density vanishes.

use glam::Vec3;

/// Cosine-distributed direction about +z: pdf = z/π. z = √(1−u₀) is at least 2⁻¹² for u₀ in [0,1) of f32, so the
/// density never reaches 0 (HARDCASES B19).
#[inline(always)]
pub fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let r = u[0].sqrt();
    let (sin, cos) = (std::f32::consts::TAU * u[1]).sin_cos();
    Vec3::new(r * cos, r * sin, (1.0 - u[0]).sqrt())
}
