//! Tone curves: scene-linear Rec.709 radiance, exposed, to display-linear Rec.709 in [0, 1]. They belong to previews;
//! the EXR never sees them.
//!
//! Sources: Khronos PBR Neutral (KhronosGroup/ToneMapping, PBR_Neutral/README.md); AgX as Filament and three.js r182
//! have it, after Troy Sobotka's: Rec.2020 primaries, an inset, log₂, a polynomial for the sigmoid, an outset.

use std::fmt;
use std::str::FromStr;

/// A tone curve.
///
/// ```
/// use pathspace::film::tone::ToneMap;
/// // Neutral leaves a base colour alone but for the 4 % that a dielectric reflects, and keeps highlights apart.
/// let [grey, light, brighter] = [0.5, 2.0, 8.0].map(|value| ToneMap::Neutral.apply([value; 3])[0]);
/// assert!((grey - 0.46).abs() < 1e-12 && light < brighter && brighter < 1.0);
/// assert_eq!(ToneMap::Clip.apply([0.5, 2.0, -1.0]), [0.5, 1.0, 0.0]);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ToneMap {
    /// None: what lies outside of [0, 1] is cut off.
    #[default]
    Clip,
    /// Khronos PBR Neutral: base colours stay what they are, highlights are compressed and lose their colour.
    Neutral,
    /// AgX: as film; softer, and paler where it is bright.
    Agx,
}

impl ToneMap {
    /// Every curve, in the order of the help text.
    pub const ALL: [ToneMap; 3] = [ToneMap::Clip, ToneMap::Neutral, ToneMap::Agx];

    /// Spelling on the command line.
    pub fn name(self) -> &'static str {
        match self {
            ToneMap::Clip => "clip",
            ToneMap::Neutral => "neutral",
            ToneMap::Agx => "agx",
        }
    }

    /// The curve at a colour; negative values count as 0, the result lies in [0, 1].
    pub fn apply(self, rgb: [f64; 3]) -> [f64; 3] {
        let rgb = rgb.map(|value| value.max(0.0));
        let mapped = match self {
            ToneMap::Clip => rgb,
            ToneMap::Neutral => neutral(rgb),
            ToneMap::Agx => agx(rgb),
        };
        mapped.map(|value| value.clamp(0.0, 1.0))
    }
}

impl fmt::Display for ToneMap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for ToneMap {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let found = ToneMap::ALL.into_iter().find(|curve| curve.name().eq_ignore_ascii_case(text));
        found.ok_or_else(|| format!("'{text}' is not one of {}", ToneMap::ALL.map(ToneMap::name).join(", ")))
    }
}

/// Reflectance of a dielectric at normal incidence, which the curve takes off base colours.
const F90: f64 = 0.04;
/// Where compression begins.
const START: f64 = 0.8 - F90;
/// How fast compressed colours lose their saturation.
const DESATURATION: f64 = 0.15;

fn neutral(rgb: [f64; 3]) -> [f64; 3] {
    let least = rgb[0].min(rgb[1]).min(rgb[2]);
    let offset = if least < 2.0 * F90 { least - least * least / (4.0 * F90) } else { F90 };
    let rgb = rgb.map(|value| value - offset);
    let peak = rgb[0].max(rgb[1]).max(rgb[2]);
    if peak <= START {
        return rgb;
    }
    let room = 1.0 - START;
    let compressed = 1.0 - room * room / (peak + room - START);
    let kept = 1.0 / (DESATURATION * (peak - compressed) + 1.0);
    rgb.map(|value| value * (compressed / peak) * kept + compressed * (1.0 - kept))
}

type Matrix = [[f64; 3]; 3];

/// Rec.709 to Rec.2020 and back, to the four digits of the sources.
const REC2020_FROM_REC709: Matrix = [[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0113], [0.0164, 0.0880, 0.8956]];
const REC709_FROM_REC2020: Matrix =
    [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]];

const AGX_INSET: Matrix = [
    [0.856627153315983, 0.0951212405381588, 0.0482516061458583],
    [0.137318972929847, 0.761241990602591, 0.101439036467562],
    [0.11189821299995, 0.0767994186031903, 0.811302368396859],
];
const AGX_OUTSET: Matrix = [
    [1.1271005818144368, -0.11060664309660323, -0.016493938717834573],
    [-0.1413297634984383, 1.157823702216272, -0.016493938717834257],
    [-0.14132976349843826, -0.11060664309660294, 1.2519364065950405],
];

/// Range of log₂ radiance: −10 and +6.5 stops about 0.18.
const AGX_STOPS: [f64; 2] = [-12.47393, 4.026069];

/// The sigmoid of AgX on [0, 1], from x⁶ down to 1.
const AGX_SIGMOID: [f64; 7] = [15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.00232];

fn agx(rgb: [f64; 3]) -> [f64; 3] {
    let inset = multiply(&AGX_INSET, multiply(&REC2020_FROM_REC709, rgb));
    let curved = inset.map(|value| {
        let stops = value.max(1e-10).log2();
        let x = ((stops - AGX_STOPS[0]) / (AGX_STOPS[1] - AGX_STOPS[0])).clamp(0.0, 1.0);
        AGX_SIGMOID.into_iter().fold(0.0, |sum, factor| sum * x + factor)
    });
    let linear = multiply(&AGX_OUTSET, curved).map(|value| value.max(0.0).powf(2.2));
    multiply(&REC709_FROM_REC2020, linear)
}

fn multiply(m: &Matrix, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: the formulas of the sources, evaluated by numpy (production/tm.py of the shared notes). Deterministic.
    #[test]
    fn curves_agree_with_their_sources() {
        let cases = [
            ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
            ([0.02, 0.05, 0.1], [0.0025, 0.0325, 0.0825], [0.0203733, 0.0678176, 0.1332969]),
            ([0.18, 0.18, 0.18], [0.14, 0.14, 0.14], [0.2145486, 0.2145024, 0.2144992]),
            ([0.8, 0.1, 0.05], [0.7654962, 0.0656275, 0.0156369], [0.607619, 0.1771564, 0.1125247]),
            ([1.0, 1.0, 1.0], [0.8690909, 0.8690909, 0.8690909], [0.5902294, 0.5901361, 0.5901023]),
            ([4.0, 0.5, 0.1], [0.9832558, 0.3824731, 0.3138122], [0.9863471, 0.5248745, 0.3542651]),
            ([100.0, 100.0, 50.0], [0.9994208, 0.9994208, 0.9678689], [0.9969783, 0.9968787, 0.996779]),
            ([0.03, 0.9, 3.0], [0.2266968, 0.4463489, 0.9765436], [0.3293909, 0.6231276, 0.8804004]),
        ];
        for (rgb, neutral, agx) in cases {
            for (curve, expected) in [(ToneMap::Neutral, neutral), (ToneMap::Agx, agx)] {
                let found = curve.apply(rgb);
                let near = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6);
                assert!(near, "{curve} of {rgb:?}: {found:?}, expected {expected:?}");
            }
        }
    }

    /// Whatever comes in, what comes out is a colour; brighter grey is never darker.
    #[test]
    fn curves_stay_in_range_and_rise() {
        for curve in ToneMap::ALL {
            assert_eq!(curve.name().parse(), Ok(curve));
            let mut last = -1.0;
            for step in -40..40 {
                let value = curve.apply([f64::from(step).exp2(); 3])[1];
                assert!(value >= last && (0.0..=1.0).contains(&value), "{curve} at 2^{step}: {value} after {last}");
                last = value;
            }
            for odd in [[f64::MAX, 0.0, 1.0], [-1.0, -2.0, 0.5], [1e-300, 1e300, 0.0], [f64::NAN, 1.0, 0.0]] {
                assert!(curve.apply(odd).iter().all(|v| (0.0..=1.0).contains(v)), "{curve} of {odd:?}");
            }
        }
        assert!("filmic".parse::<ToneMap>().is_err());
    }
}
