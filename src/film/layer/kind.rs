//! What a layer is: name, values, channels. All of them: [`LAYERS`](super::LAYERS).

use std::borrow::Cow;

use super::beauty::Pixel;
use crate::plan::aov::Aov;
use crate::scene::Scene;

/// One layer besides the beauty.
#[derive(Debug)]
pub struct Layer {
    /// Name, and what has to be gathered.
    pub aov: Aov,
    /// What it shows, for the help text: "depth along the view axis through the pixel's centre, metres".
    pub about: &'static str,
    /// Where a pixel's values come from.
    pub values: Values,
    /// Channels with the value that each shows.
    pub channels: fn(&Shape) -> Vec<(String, usize)>,
}

/// What the channels of a layer depend on.
#[derive(Clone, Copy, Debug)]
pub struct Shape<'s> {
    /// Most edges of a path.
    pub max_depth: u32,
    /// Names of the light groups.
    pub groups: &'s [String],
}

/// Where a layer's values come from.
#[derive(Debug)]
pub enum Values {
    /// From the beauty's sums; nothing is kept.
    Beauty(fn(&Pixel) -> [f64; 3]),
    /// Means over the samples, so many values a pixel; sums are kept.
    Mean(usize),
    /// Such means of so many values, whose sums are kept by halves of the samples as the beauty's are.
    Halves(usize),
    /// Such means, three for each light group.
    Groups,
    /// Three values, kept as gathered once, before the pixel's first sample.
    Once {
        /// Where nothing is met.
        missing: [f32; 3],
    },
    /// Lists of ids (`ids.rs`): of names, which the function gives for an instance of the scene by its index.
    Ids(fn(&Scene, usize) -> Cow<'_, str>),
}

impl Layer {
    /// Values that are kept for each pixel where there are so many light groups, lists not counted.
    pub fn width(&self, groups: usize) -> usize {
        match self.values {
            Values::Beauty(_) | Values::Ids(_) => 0,
            Values::Mean(width) => width,
            Values::Halves(width) => 2 * width,
            Values::Groups => 3 * groups,
            Values::Once { .. } => 3,
        }
    }

    /// Whether it keeps lists of ids.
    pub fn is_of_ids(&self) -> bool {
        matches!(self.values, Values::Ids(_))
    }

    /// Whether channel `name` of it is a component of a colour: a mean as R, G or B. (Variances are no means.)
    pub fn is_color(&self, name: &str) -> bool {
        matches!(self.values, Values::Mean(_) | Values::Halves(_) | Values::Groups)
            && [".R", ".G", ".B"].iter().any(|component| name.ends_with(component))
    }

    /// Whether a film with so many light groups keeps anything for it.
    pub fn is_kept(&self, groups: usize) -> bool {
        self.width(groups) > 0 || self.is_of_ids()
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
pub(in crate::film) fn rgb(layer: &str) -> Vec<(String, usize)> {
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
