//! What a layer is: name, values, channels. All of them: [`LAYERS`](super::LAYERS).

use super::beauty::Pixel;
use crate::plan::aov::Aov;

/// One layer besides the beauty.
#[derive(Debug)]
pub struct Layer {
    /// Name, and what has to be gathered.
    pub aov: Aov,
    /// What it shows, for the help text: "depth along the view axis through the pixel's centre, metres".
    pub about: &'static str,
    /// Where a pixel's values come from.
    pub values: Values,
    /// Channels with the value that each shows, for paths of at most so many edges.
    pub channels: fn(max_depth: u32) -> Vec<(String, usize)>,
}

/// Where a layer's values come from.
#[derive(Debug)]
pub enum Values {
    /// From the beauty's sums; nothing is kept.
    Beauty(fn(&Pixel) -> [f64; 3]),
    /// Means over the samples, so many values a pixel; sums are kept.
    Mean(usize),
    /// Three values, kept as gathered once, before the pixel's first sample.
    Once {
        /// Where nothing is met.
        missing: [f32; 3],
    },
}

impl Layer {
    /// Values that are kept for each pixel.
    pub fn width(&self) -> usize {
        match self.values {
            Values::Beauty(_) => 0,
            Values::Mean(width) => width,
            Values::Once { .. } => 3,
        }
    }

    /// What a pixel without samples has, value by value.
    pub(crate) fn initial(&self, value: usize) -> f64 {
        match self.values {
            Values::Once { missing } => f64::from(missing[value]),
            _ => 0.0,
        }
    }
}

/// Channels `LAYER.R`, `.G`, `.B` of values 0, 1, 2.
pub(super) fn rgb(layer: &str) -> Vec<(String, usize)> {
    components(layer, &["R", "G", "B"])
}

/// Channels `LAYER.X`, `.Y`, `.Z` of values 0, 1, 2.
pub(super) fn xyz(layer: &str) -> Vec<(String, usize)> {
    components(layer, &["X", "Y", "Z"])
}

/// Channels `LAYER.COMPONENT` of values 0, 1, …
pub(super) fn components(layer: &str, names: &[&str]) -> Vec<(String, usize)> {
    names.iter().enumerate().map(|(value, component)| (format!("{layer}.{component}"), value)).collect()
}
