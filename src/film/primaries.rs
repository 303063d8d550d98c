//! Primaries of the colours in a picture: ITU-R BT.709, in which everything is rendered, and those of ACEScg (AP1,
//! Academy S-2014-004), for EXR alone. White stays white: Bradford's transform takes D65 to the white point of ACES.

use std::str::FromStr;

/// Primaries with their white point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Primaries {
    /// ITU-R BT.709, D65.
    #[default]
    Rec709,
    /// ACEScg.
    AcesCg,
}

/// M₁⁻¹·B·M₇₀₉: M the matrices to XYZ by primaries and white, B the Bradford transform (Lindbloom); worked out in exact
/// fractions, and again by the test below.
const ACESCG_FROM_REC709: [[f64; 3]; 3] = [
    [0.6130884972649542, 0.3395317442344878, 0.04737975850055801],
    [0.07019430677386775, 0.9163540110902862, 0.013451682135845983],
    [0.02061550933851681, 0.10956750906566481, 0.8698169815958183],
];

impl Primaries {
    /// All, in the order of the help text.
    pub const ALL: [Primaries; 2] = [Primaries::Rec709, Primaries::AcesCg];

    /// Spelling on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Primaries::Rec709 => "rec709",
            Primaries::AcesCg => "acescg",
        }
    }

    /// Identifier of the Color Interop Forum.
    pub fn interop_id(self) -> &'static str {
        match self {
            Primaries::Rec709 => "lin_rec709_scene",
            Primaries::AcesCg => "lin_ap1_scene",
        }
    }

    /// Chromaticities x, y of red, green, blue and white.
    pub fn chromaticities(self) -> [[f32; 2]; 4] {
        match self {
            Primaries::Rec709 => [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], [0.3127, 0.3290]],
            Primaries::AcesCg => [[0.713, 0.293], [0.165, 0.830], [0.128, 0.044], [0.32168, 0.33766]],
        }
    }

    /// A colour of Rec.709 in these.
    pub fn of_rec709(self, rgb: [f64; 3]) -> [f64; 3] {
        match self {
            Primaries::Rec709 => rgb,
            Primaries::AcesCg => ACESCG_FROM_REC709.map(|row| row[0] * rgb[0] + row[1] * rgb[1] + row[2] * rgb[2]),
        }
    }
}

impl FromStr for Primaries {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        let named = Primaries::ALL.into_iter().find(|primaries| primaries.name() == s);
        named.ok_or_else(|| format!("'{s}' is not one of rec709, acescg"))
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3};

    use super::*;

    /// XYZ from colours of primaries whose sum is the white point, Y = 1 (SMPTE RP 177).
    fn xyz_from(primaries: Primaries) -> (DMat3, DVec3) {
        // The decimals of the standards.
        let decimal = |value: f32| value.to_string().parse::<f64>().expect("a number");
        let [red, green, blue, white] = primaries.chromaticities().map(|[x, y]| {
            let (x, y) = (decimal(x), decimal(y));
            DVec3::new(x / y, 1.0, (1.0 - x - y) / y)
        });
        let directions = DMat3::from_cols(red, green, blue);
        (directions * DMat3::from_diagonal(directions.inverse() * white), white)
    }

    /// Oracle: the definition, in f64 (8 bits of which the inverses may lose).
    #[test]
    fn the_matrix_is_that_of_the_primaries() {
        let bradford = DMat3::from_cols(
            DVec3::new(0.8951, -0.7502, 0.0389),
            DVec3::new(0.2664, 1.7135, -0.0685),
            DVec3::new(-0.1614, 0.0367, 1.0296),
        );
        let ((from, white_from), (to, white_to)) = (xyz_from(Primaries::Rec709), xyz_from(Primaries::AcesCg));
        let scale = DMat3::from_diagonal((bradford * white_to) / (bradford * white_from));
        let matrix = to.inverse() * (bradford.inverse() * scale * bradford) * from;
        for color in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE, DVec3::new(3.0, -0.5, 1e6)] {
            let (expected, found) = (matrix * color, DVec3::from(Primaries::AcesCg.of_rec709(color.into())));
            let most = 256.0 * f64::EPSILON * color.length();
            assert!(found.distance(expected) <= most, "{color}: {found}, expected {expected}");
        }
        assert!(DVec3::from(Primaries::AcesCg.of_rec709([1.0; 3])).distance(DVec3::ONE) < 1e-15);
        assert_eq!(Primaries::Rec709.of_rec709([1.0, -2.0, 3.0]), [1.0, -2.0, 3.0]);
        for primaries in Primaries::ALL {
            assert_eq!(primaries.name().parse(), Ok(primaries));
        }
    }
}
