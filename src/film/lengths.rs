//! One image per path length: the terms of the Neumann series L = Σ (KG)ⁿ Le, so that each can be held against its own
//! reference. Kept only when asked for.

use crate::plan::options::Crop;

/// Number of accumulators: entry e holds the paths of e edges, the last one those of that many or more.
pub const LENGTHS: usize = 17;

/// Sums of radiance by pixel and number of edges.
#[derive(Clone, Debug, PartialEq)]
pub struct LengthSums {
    /// The window that holds pixels.
    pub window: Crop,
    /// `LENGTHS` sums of (weighted) radiance per pixel, pixels row-major.
    pub sums: Vec<[[f64; 3]; LENGTHS]>,
    /// Samples per pixel.
    pub n: Vec<u64>,
}

impl LengthSums {
    /// Nothing yet.
    pub fn new(window: Crop) -> Self {
        let pixels = window.width as usize * window.height as usize;
        LengthSums { window, sums: vec![[[0.0; 3]; LENGTHS]; pixels], n: vec![0; pixels] }
    }

    /// Mean radiance of the paths with `edge` edges (1: directly seen emission), per pixel. The last entry holds the
    /// tail.
    pub fn image(&self, edge: usize) -> Vec<[f64; 3]> {
        self.sums.iter().zip(&self.n).map(|(sums, n)| sums[edge].map(|s| s / (*n).max(1) as f64)).collect()
    }
}
