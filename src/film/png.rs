//! 8-bit sRGB preview: exposure in stops, clip to [0, 1], the sRGB curve of IEC 61966-2-1, rounding to nearest. No tone
//! curve, no dither, no alpha. Only the crop window is written.

use std::path::Path;

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use super::Film;
use crate::error::Result;

/// R, G, B bytes, row-major, as a PNG file in memory.
pub fn encode_rgb(bytes: &[u8], width: u32, height: u32) -> Vec<u8> {
    let mut file = Vec::new();
    PngEncoder::new(&mut file)
        .write_image(bytes, width, height, ExtendedColorType::Rgb8)
        .expect("a vector takes every byte, and there are three per pixel");
    file
}

impl Film {
    /// Writes a preview with every value multiplied by 2^`exposure_ev`, all or nothing.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io) naming `path`.
    pub fn write_png(&self, path: impl AsRef<Path>, exposure_ev: f32) -> Result<()> {
        let gain = f64::from(exposure_ev).exp2();
        let mut bytes = Vec::with_capacity(3 * self.pixels.len());
        for pixel in &self.pixels {
            let mean = pixel.mean();
            bytes.extend(mean[..3].iter().map(|&value| srgb_byte(value * gain)));
        }
        super::atomic::write_atomically(path.as_ref(), |writer| {
            PngEncoder::new(writer)
                .write_image(&bytes, self.window.width, self.window.height, ExtendedColorType::Rgb8)
                .map_err(|error| match error {
                    image::ImageError::IoError(source) => source,
                    other => std::io::Error::other(other),
                })
        })
    }
}

/// Linear value to the 8-bit code of sRGB.
pub fn srgb_byte(linear: f64) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let encoded = if linear <= 0.0031308 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (255.0 * encoded).round() as u8
}

#[cfg(test)]
mod tests {
    use super::srgb_byte;

    #[test]
    fn curve_hits_known_codes() {
        // Oracle: IEC 61966-2-1; 18 % grey is code 118, one half is 188. HARDCASES M11 for what does not fit.
        let codes = [0.0, -0.01, 1e-8, 0.1, 0.18, 0.5, 1.0, 65504.0, f64::MAX].map(srgb_byte);
        assert_eq!(codes, [0, 0, 0, 89, 118, 188, 255, 255, 255]);
    }
}
