//! Homogeneous participating media: coefficients, distances to the next collision, and the phase function.
//!
//! Coefficients differ by channel; one distance is drawn for all of them, from a channel chosen by what the path
//! carries, and weighed by the mean density over that choice (spectral MIS: Wilkie et al. 2014, "Hero Wavelength
//! Spectral Sampling", with channels for wavelengths). Phase function: Henyey and Greenstein 1941.

use glam::Vec3;

use crate::scene::Material;

/// Largest magnitude of the phase function's anisotropy: beyond, f32 no longer resolves its peak.
pub const MAX_ANISOTROPY: f32 = 0.999;

/// Least one: below, inverting its distribution cancels, and it is taken as 0.
const MIN_ANISOTROPY: f32 = 1e-3;

/// What a medium does to light, by channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients {
    /// Attenuation: absorption and scattering together, m⁻¹, ≥ 0.
    pub sigma_t: Vec3,
    /// Share of attenuation that scatters (single-scattering albedo), in [0, 1].
    pub albedo: Vec3,
    /// Mean cosine of scattering, in (−1, 1).
    pub g: f32,
}

impl Coefficients {
    /// Nothing there.
    pub const VACUUM: Coefficients = Coefficients { sigma_t: Vec3::ZERO, albedo: Vec3::ZERO, g: 0.0 };

    /// Scattering with anisotropy in (−1, 1); see [`MAX_ANISOTROPY`].
    pub fn new(sigma_t: Vec3, albedo: Vec3, anisotropy: f32) -> Coefficients {
        let g = anisotropy.clamp(-MAX_ANISOTROPY, MAX_ANISOTROPY);
        Coefficients { sigma_t, albedo, g: if g.abs() < MIN_ANISOTROPY { 0.0 } else { g } }
    }

    /// Of the inside of a solid: KHR_materials_volume (σ_t = −ln(colour)/distance) and KHR_materials_volume_scatter.
    pub fn of(material: &Material) -> Coefficients {
        let color = material.attenuation_color.max(Vec3::splat(f32::MIN_POSITIVE));
        let sigma_t = (color.map(|c| -c.ln()) / material.attenuation_distance_m).max(Vec3::ZERO);
        let albedo = material.multiscatter_color.map(single_scattering);
        Coefficients::new(sigma_t, albedo, material.scatter_anisotropy)
    }

    /// Whether light is scattered, not only absorbed.
    pub fn scatters(&self) -> bool {
        (self.sigma_t * self.albedo).max_element() > 0.0
    }

    /// Fraction of light left after a way.
    #[inline(always)]
    pub fn transmittance(&self, distance_m: f32) -> Vec3 {
        self.sigma_t.map(|sigma| if sigma > 0.0 { (-sigma * distance_m).exp() } else { 1.0 })
    }

    /// Draws how far a path of throughput `beta` gets on a way of `length_m` (may be infinite) by `u`, two numbers in
    /// [0, 1). Weights multiply the throughput.
    pub fn travel(&self, beta: Vec3, length_m: f32, u: [f32; 2]) -> Travel {
        if !self.scatters() {
            return Travel::Through(self.transmittance(length_m));
        }
        let sum = beta.x + beta.y + beta.z;
        let p = if sum > 0.0 && sum.is_finite() { beta / sum } else { Vec3::splat(1.0 / 3.0) };
        // The sum may be rounded to below 1: a channel of probability 0 is not chosen for it.
        let channel = usize::from(u[0] >= p.x) + usize::from(u[0] >= p.x + p.y && p.z > 0.0);
        let distance_m = -(1.0 - u[1]).ln() / self.sigma_t[channel];
        if distance_m < length_m {
            let left = self.transmittance(distance_m);
            let density = (p * self.sigma_t * left).element_sum();
            Travel::Collides { distance_m, weight: self.sigma_t * self.albedo * left / density }
        } else {
            let left = self.transmittance(length_m);
            let probability = (p * left).element_sum();
            Travel::Through(if probability > 0.0 { left / probability } else { Vec3::ZERO })
        }
    }
}

/// How far a path gets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Travel {
    /// To the end, with this weight.
    Through(Vec3),
    /// It scatters.
    Collides {
        /// Where.
        distance_m: f32,
        /// σ_s times transmittance over density.
        weight: Vec3,
    },
}

/// Single-scattering albedo of a multiple-scattering one, in [0, 1]: Kulla and Conty 2017, "Revisiting Physically Based
/// Shading at Imageworks", as KHR_materials_volume_scatter writes it.
pub fn single_scattering(multiple: f32) -> f32 {
    let rho = f64::from(multiple.clamp(0.0, 1.0));
    let s = 4.09712 + 4.20863 * rho - (9.59217 + 41.6808 * rho + 17.7126 * rho * rho).sqrt();
    // The rounded figures make 10⁻⁶ of 0.
    if rho > 0.0 { (1.0 - s * s).clamp(0.0, 1.0) as f32 } else { 0.0 }
}

/// Henyey and Greenstein's phase function, sr⁻¹; `cos` is that between the ways of light before and after.
#[inline(always)]
pub fn phase(g: f32, cos: f32) -> f32 {
    let below = 1.0 + g * g - 2.0 * g * cos;
    (1.0 - g * g) / (4.0 * std::f32::consts::PI * below * below.sqrt())
}

/// Draws a direction by [`phase`] after light that ran along `dir`; and its density.
pub fn sample_phase(g: f32, dir: Vec3, u: [f32; 2]) -> (Vec3, f32) {
    let cos = if g == 0.0 {
        1.0 - 2.0 * u[0]
    } else {
        let root = (1.0 - g * g) / (1.0 + g - 2.0 * g * u[0]);
        (1.0 + g * g - root * root) / (2.0 * g)
    };
    let cos = cos.clamp(-1.0, 1.0);
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let (sin_phi, cos_phi) = (2.0 * std::f32::consts::PI * u[1]).sin_cos();
    let (s, t) = dir.any_orthonormal_pair();
    let wi = (s * (sin * cos_phi) + t * (sin * sin_phi) + dir * cos).normalize();
    (wi, phase(g, cos))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A blue that a path does not carry, and that a medium lets through, is not chosen by rounding: the path collides
    /// with certainty on an infinite way. Oracle: that.
    #[test]
    fn channels_without_a_share_are_not_chosen() {
        let medium = Coefficients::new(Vec3::new(1.0, 1.0, 0.0), Vec3::splat(0.5), 0.0);
        let last = 1.0 - f32::EPSILON / 2.0;
        let mut rounded = 0;
        for red in 1..997 {
            let beta = Vec3::new(red as f32 * 0.1, 1.0, 0.0);
            let sum = beta.x + beta.y;
            rounded += u32::from(beta.x / sum + beta.y / sum < 1.0);
            let travel = medium.travel(beta, f32::INFINITY, [last, 0.5]);
            let Travel::Collides { distance_m, weight } = travel else { panic!("{beta}: {travel:?}") };
            assert!((distance_m - 0.5f32.ln().abs()).abs() < 1e-6 && weight.x > 0.0, "{beta}: {travel:?}");
        }
        assert!(rounded > 0, "sums that are rounded below 1 are tried");
    }
}
