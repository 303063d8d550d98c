//! Dispersion: solids whose index of refraction depends on the wavelength (`KHR_materials_dispersion`).
//!
//! Light is stated by three channels. Each is taken as even over a band of wavelengths; a path that meets a dispersive
//! surface has one wavelength from there on, drawn evenly from all of them, and the share of each channel in it as a
//! weight. Means over wavelengths are 1 in every channel: what is white stays white, and the estimate is unbiased for
//! these bands. The index follows Cauchy's formula as the extension's text has it, by dispersion = 20/V, V the Abbe
//! number. Limit: a medium around a solid has the index that its file states, whatever the wavelength.

use glam::Vec3;

/// Shortest and longest wavelength, nm.
pub const VISIBLE_NM: [f32; 2] = [400.0, 700.0];

/// Bands of R, G and B, nm: where each rises from 0, is 1 from and to, and falls to 0.
const BANDS: [[f32; 4]; 3] = [[540.0, 620.0, 700.0, 700.0], [450.0, 540.0, 540.0, 620.0], [400.0, 400.0, 450.0, 520.0]];

/// The wavelength of a number in [0, 1), nm.
#[inline(always)]
pub fn wavelength_nm(u: f32) -> f32 {
    VISIBLE_NM[0] + (VISIBLE_NM[1] - VISIBLE_NM[0]) * u
}

/// What a path of one wavelength carries of each channel, over the density of drawing it. Its mean is 1.
#[inline(always)]
pub fn weight(wavelength_nm: f32) -> Vec3 {
    let channel = |[from, first, last, to]: [f32; 4]| {
        let rising = if first > from { (wavelength_nm - from) / (first - from) } else { 1.0 };
        let falling = if to > last { (to - wavelength_nm) / (to - last) } else { 1.0 };
        let area = 0.5 * (to - from + last - first);
        rising.min(falling).clamp(0.0, 1.0) * (VISIBLE_NM[1] - VISIBLE_NM[0]) / area
    };
    Vec3::from(BANDS.map(channel))
}

/// Index of refraction at a wavelength of a solid of index `ior` at 587.6 nm; at least 1. glTF's 0, which is infinite,
/// is the same at all.
#[inline(always)]
pub fn index(ior: f32, dispersion: f32, wavelength_nm: f32) -> f32 {
    if ior < 1.0 {
        return ior;
    }
    let inverse_abbe = dispersion / 20.0;
    (ior + (ior - 1.0) * inverse_abbe * (523_655.0 / (wavelength_nm * wavelength_nm) - 1.5168)).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracles: weights average to 1 in every channel; the Abbe number of the lines F, d and C is 20/dispersion.
    #[test]
    fn white_stays_white_and_glass_has_its_abbe_number() {
        let n = 30_000;
        let mean = (0..n).map(|i| weight(wavelength_nm((i as f32 + 0.5) / n as f32))).sum::<Vec3>() / n as f32;
        assert!((mean - Vec3::ONE).abs().max_element() < 1e-3, "{mean}");
        for dispersion in [0.1, 0.36, 2.0] {
            let [f, d, c] = [486.13, 587.56, 656.27].map(|line| index(1.6, dispersion, line));
            assert!((d - 1.6).abs() < 1e-4, "{d}");
            // An infinite index is one, whatever the wavelength.
            assert_eq!(index(0.0, dispersion, 400.0), 0.0);
            assert!(((d - 1.0) / (f - c) - 20.0 / dispersion).abs() < 1e-2 * 20.0 / dispersion, "{f} {d} {c}");
        }
    }
}
