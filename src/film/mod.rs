//! The film: per pixel, f64 sums of radiance and coverage in two halves of independent scrambles.

pub mod exr;
pub mod filter;
pub mod png;

use crate::plan::options::Crop;

/// Sums of one pixel. Half `h` holds the samples whose index has parity `h`; the halves use independent scrambles of
/// the sampler, so a quarter of the squared difference of their means is an unbiased estimate of the variance of the
/// pixel (HARDCASES §6.2).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Sums of R, G, B radiance (times the filter's signed weight) and of coverage, by half.
    pub sum: [[f64; 4]; 2],
    /// Number of samples by half.
    pub n: [u64; 2],
}

/// A picture being made: the pixels of the crop window, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    /// Full image: columns, rows.
    pub resolution: (u32, u32),
    /// The window that holds pixels.
    pub window: Crop,
    /// `window.width × window.height` pixels.
    pub pixels: Vec<Pixel>,
}

impl Film {
    /// An empty film.
    pub fn new(resolution: (u32, u32), window: Crop) -> Self {
        Film { resolution, window, pixels: vec![Pixel::default(); window.width as usize * window.height as usize] }
    }

    /// Pixel at `(x, y)` of the window.
    pub fn pixel(&self, x: u32, y: u32) -> &Pixel {
        &self.pixels[y as usize * self.window.width as usize + x as usize]
    }
}

impl Pixel {
    /// Mean of R, G, B and coverage over all samples; 0 without samples.
    pub fn mean(&self) -> [f64; 4] {
        let n = (self.n[0] + self.n[1]).max(1) as f64;
        std::array::from_fn(|c| (self.sum[0][c] + self.sum[1][c]) / n)
    }
}
