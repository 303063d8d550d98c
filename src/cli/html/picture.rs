//! Values of pixels as pictures in a page. Row-major, linear Rec.709.

use crate::film::look::srgb_byte;
use crate::film::png;
use crate::film::tone::ToneMap;
use crate::plot::heat::HeatMap;
use crate::plot::html;

/// Share of the mean grey below which errors count as relative to it: shadows have no error of their own scale.
const FLOOR: f64 = 0.1;

/// `errors` of pixels relative to the grey of `colors`, or to a tenth of their mean where that is more. What is no
/// number is infinite.
pub fn relative(errors: &[f64], colors: &[[f32; 3]]) -> Vec<f64> {
    let grey = |rgb: &[f32; 3]| rgb.iter().map(|value| f64::from(*value)).sum::<f64>() / 3.0;
    let finite = colors.iter().map(grey).filter(|grey| grey.is_finite());
    let floor = (FLOOR * finite.sum::<f64>() / colors.len().max(1) as f64).max(f64::MIN_POSITIVE);
    let of_pixel = |(error, rgb): (&f64, &[f32; 3])| {
        let share = error / grey(rgb).max(floor);
        if share.is_nan() { f64::INFINITY } else { share }
    };
    errors.iter().zip(colors).map(of_pixel).collect()
}

/// Colours as a preview without a look shows them: R, G, B of sRGB.
pub fn clipped(rgb: [f64; 3]) -> [u8; 3] {
    ToneMap::Clip.apply(rgb).map(srgb_byte)
}

/// A figure of R, G, B bytes; `legend` is markup.
pub fn figure(bytes: &[u8], (width, height): (u32, u32), alt: &str, legend: &str) -> String {
    html::figure(&html::picture(&png::encode_rgb(bytes, width, height), (width, height), alt), legend)
}

/// A figure of a map of relative errors, with its scale.
pub fn map(map: &HeatMap, size: (u32, u32), alt: &str, what: &str) -> String {
    figure(&map.bytes, size, alt, &format!("{what}: {}.", html::scale(map)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: by hand; the mean of the greys is 1, so that the black pixel's error is relative to 0.1.
    #[test]
    fn errors_are_relative_to_the_pixel_or_the_picture() {
        let colors = [[2.0; 3], [0.0; 3]];
        let found = relative(&[0.5, 0.05], &colors);
        assert!((found[0] - 0.25).abs() < 1e-12 && (found[1] - 0.5).abs() < 1e-12, "{found:?}");
        assert_eq!(relative(&[f64::NAN, 0.0], &[[0.0; 3]; 2]), [f64::INFINITY, 0.0]);
    }
}
