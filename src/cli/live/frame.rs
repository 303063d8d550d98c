//! What is shown of a film: means and their standard errors, four f32 a pixel.

use crate::film::Film;

/// A picture on its way.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// Columns and rows.
    pub size: (u32, u32),
    /// R, G, B and the standard error of their mean (0 where unknown), row-major.
    pub pixels: Vec<f32>,
}

impl Frame {
    /// The frame of a film.
    pub fn of(film: &Film) -> Self {
        let mut pixels = Vec::with_capacity(4 * film.pixels.len());
        for pixel in &film.pixels {
            let [r, g, b, _] = pixel.mean();
            let error = pixel.variance().map_or(0.0, |v| (v.iter().sum::<f64>() / 3.0).sqrt());
            pixels.extend([r, g, b, error].map(|value| value as f32));
        }
        Frame { size: (film.window.width, film.window.height), pixels }
    }

    /// Its file for the page: columns and rows as u32, then the pixels; little-endian.
    pub fn bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(8 + 4 * self.pixels.len());
        bytes.extend(self.size.0.to_le_bytes());
        bytes.extend(self.size.1.to_le_bytes());
        for value in &self.pixels {
            bytes.extend(value.to_le_bytes());
        }
        bytes
    }
}
