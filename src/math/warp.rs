//! Measure-preserving maps from the unit square to the shapes that are sampled. Each takes u in [0,1)² (the samplers
//! never return 1; a 1 is harmless here all the same) and turns stratified points into stratified points.
//!
//! Local frames have n = +z. `*_pdf` is the density of the matching map: sr⁻¹ on the sphere, m⁻² on the unit
//! disk. Sources: Shirley and Chiu 1997 (concentric map), Heitz 2019 (triangle by folding, "A low-distortion map
//! between triangle and square"), Archimedes (sphere).

use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, FRAC_PI_4, PI, TAU};

/// Cosine of the steepest hemisphere sample: z = √(1 − r²) with r² ≤ 1 − 2⁻²⁴ (HARDCASES B19).
pub const MIN_COS: f32 = 1.0 / 4096.0;

/// Uniform on the unit disk. Concentric squares go to concentric circles.
#[inline(always)]
pub fn concentric_disk(u: [f32; 2]) -> Vec2 {
    let (x, y) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    // Both wedges are computed and one is selected: no branch, so lanes vectorise up to sine and cosine.
    let wide = x.abs() > y.abs();
    let (radius, other) = if wide { (x, y) } else { (y, x) };
    let ratio = if radius != 0.0 { other / radius } else { 0.0 };
    // In the tall wedge the angle runs from the y axis: swap sine and cosine instead of subtracting from π/2.
    let (sin, cos) = sin_cos_octant(FRAC_PI_4 * ratio);
    if wide { Vec2::new(radius * cos, radius * sin) } else { Vec2::new(radius * sin, radius * cos) }
}

/// Cosine-distributed on the upper hemisphere: pdf = z/π. `z ≥ MIN_COS` always, so value over pdf never is 0/0.
#[inline(always)]
pub fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let d = concentric_disk(u);
    let z = (1.0 - d.length_squared()).max(MIN_COS * MIN_COS).sqrt();
    Vec3::new(d.x, d.y, z)
}

/// Density of [`cosine_hemisphere`].
#[inline(always)]
pub fn cosine_hemisphere_pdf(cos: f32) -> f32 {
    cos.max(0.0) * FRAC_1_PI
}

/// Uniform on the upper hemisphere: pdf = 1/2π.
#[inline(always)]
pub fn uniform_hemisphere(u: [f32; 2]) -> Vec3 {
    spherical_cap(u, 0.0)
}

/// Density of [`uniform_hemisphere`].
pub const UNIFORM_HEMISPHERE_PDF: f32 = 1.0 / TAU;

/// Uniform on the sphere: pdf = 1/4π.
#[inline(always)]
pub fn uniform_sphere(u: [f32; 2]) -> Vec3 {
    spherical_cap(u, -1.0)
}

/// Density of [`uniform_sphere`].
pub const UNIFORM_SPHERE_PDF: f32 = 1.0 / (2.0 * TAU);

/// Uniform on the cap of directions with z ≥ `cos_max`. Thin caps keep their precision: the height below the pole is
/// sampled, not the cosine.
#[inline(always)]
pub fn spherical_cap(u: [f32; 2], cos_max: f32) -> Vec3 {
    let d = concentric_disk(u);
    // r² is uniform in [0,1): Archimedes' height below the pole is h = r²·(1 − cos_max), and sin² = h·(2 − h).
    let r2 = d.length_squared().min(1.0);
    let below = r2 * (1.0 - cos_max);
    // (x, y) = d/r · sin = d · √((1 − cos_max)·(2 − h)), without dividing by r.
    let scale = ((1.0 - cos_max) * (2.0 - below)).max(0.0).sqrt();
    Vec3::new(d.x * scale, d.y * scale, 1.0 - below)
}

/// Density of [`spherical_cap`]; infinite for an empty cap.
#[inline(always)]
pub fn spherical_cap_pdf(cos_max: f32) -> f32 {
    1.0 / (TAU * (1.0 - cos_max))
}

/// Barycentric weights of the second and third vertex, uniform over any triangle. Folds the square along its diagonal
/// with little distortion; the weight of the first vertex is never negative.
#[inline(always)]
pub fn triangle_barycentric(u: [f32; 2]) -> [f32; 2] {
    let (half_x, half_y) = (0.5 * u[0], 0.5 * u[1]);
    // Above the diagonal the square is sheared one way, below it the other.
    if u[1] > u[0] { [half_x, u[1] - half_x] } else { [u[0] - half_y, half_y] }
}

/// Solid angle of the cap of half-angle `radius_rad`, sr, exact to rounding for any size: 4π sin²(θ/2).
#[inline(always)]
pub fn cap_solid_angle(radius_rad: f32) -> f32 {
    let s = (0.5 * radius_rad).sin();
    4.0 * PI * s * s
}

/// Sine and cosine for |x| ≤ π/4, to 1 ulp, without a branch or a call: the Taylor polynomials to x⁹ and x¹⁰
/// (the first terms left out are below 2e-9 and 2e-10 there).
#[inline(always)]
pub(super) fn sin_cos_octant(x: f32) -> (f32, f32) {
    debug_assert!(x.abs() <= FRAC_PI_4 * 1.000_001, "octant reduction is the caller's: {x}");
    let x2 = x * x;
    let sin = 1.0 / 362_880.0 * x2 - 1.0 / 5_040.0;
    let sin = sin * x2 + 1.0 / 120.0;
    let sin = sin * x2 - 1.0 / 6.0;
    let sin = sin * x2 * x + x;
    let cos = -1.0 / 3_628_800.0 * x2 + 1.0 / 40_320.0;
    let cos = cos * x2 - 1.0 / 720.0;
    let cos = cos * x2 + 1.0 / 24.0;
    let cos = cos * x2 - 0.5;
    let cos = cos * x2 + 1.0;
    (sin, cos)
}
