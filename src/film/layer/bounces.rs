//! `bounce_00.R/G/B` … `bounce_14`, `bounce_tail`: radiance by number of scatterings, which is one less than the path
//! has edges; 15 and more in the tail. They sum to the beauty. The terms of the Neumann series L = Σ (KG)ⁿ Le, so
//! that each can be compared with its own reference. Lengths beyond the depth limit have no channels.

use super::beauty::Pixel;
use super::kind::{Layer, Shape, Values, rgb};
use crate::plan::aov::{Aov, Gathers};

/// Number of accumulators of a pixel: entry e holds the paths of e edges, the last one those of that many or more.
pub const LENGTHS: usize = 17;

impl Aov {
    /// One image per number of scatterings.
    pub const BOUNCES: Aov = Aov::new("bounces", Gathers::PathLengths);
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::BOUNCES,
    about: "one image per number of scatterings",
    values: Values::Mean(3 * LENGTHS),
    channels,
};

fn channels(shape: &Shape) -> Vec<(String, usize)> {
    let name = |edges: usize| match edges == LENGTHS - 1 {
        true => "bounce_tail".to_string(),
        false => format!("bounce_{:02}", edges - 1),
    };
    let last = (LENGTHS - 1).min(shape.max_depth as usize);
    (1..=last).flat_map(|edges| rgb(&name(edges)).into_iter().map(move |(name, c)| (name, 3 * edges + c))).collect()
}

/// The images by path length that a film has kept.
#[derive(Clone, Copy, Debug)]
pub struct PathLengths<'a> {
    pub(in crate::film) pixels: &'a [Pixel],
    /// [`LENGTHS`] sums of R, G, B a pixel.
    pub(in crate::film) sums: &'a [f64],
}

impl PathLengths<'_> {
    /// Mean radiance of the paths with `edges` edges (1: directly seen emission), per pixel. The last entry holds the
    /// tail.
    pub fn image(&self, edges: usize) -> Vec<[f64; 3]> {
        let mean = |(pixel, sums): (&Pixel, &[f64])| {
            std::array::from_fn(|c| sums[3 * edges + c] / pixel.samples().max(1) as f64)
        };
        self.pixels.iter().zip(self.sums.chunks_exact(3 * LENGTHS)).map(mean).collect()
    }
}
