//! Extra outputs of a render as EXR channels. Names are dotted, `LAYER.COMPONENT`; `Z` alone has no layer.
//!
//! | `--aov` | channels | what |
//! | --- | --- | --- |
//! | `variance` | `variance.R/G/B` | estimated variance of the pixel's mean, radiance² |
//! | `stderr` | `stderr.R/G/B` | its square root, radiance |
//! | `spp` | `spp.Y` | samples |
//! | `bounces` | `bounce_00.R/G/B` … `bounce_14`, `bounce_tail` | radiance of paths with that many scatterings; 15 and more |
//! | `albedo` | `albedo.R/G/B` | base colour with its texture at the first hit |
//! | `N` | `N.X/Y/Z` | unit shading normal there (before normal maps), turned to the viewer, in the world |
//! | `Z` | `Z` | distance along the view axis, metres |
//! | `P` | `P.X/Y/Z` | world position, metres |
//!
//! `albedo` and `N` are means over the pixel filter, 0 where a ray leaves the scene. `Z` and `P` belong to the one ray
//! through the pixel's centre, because a mean across an edge is a point on no surface; where it leaves the scene, `Z` is
//! the largest f32 and `P` is 0. The bounces of a pixel sum to its beauty. Lengths beyond the depth limit are not written.

use super::Film;
use super::exr::stored;
use super::lengths::{LENGTHS, LengthSums};

pub use crate::plan::options::Aov;

impl Aov {
    /// Every extra output, in the order of the help text.
    pub const ALL: [Aov; 8] =
        [Aov::Variance, Aov::Stderr, Aov::Spp, Aov::Bounces, Aov::Albedo, Aov::Normal, Aov::Depth, Aov::Position];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Aov::Variance => "variance",
            Aov::Stderr => "stderr",
            Aov::Spp => "spp",
            Aov::Bounces => "bounces",
            Aov::Albedo => "albedo",
            Aov::Normal => "N",
            Aov::Depth => "Z",
            Aov::Position => "P",
        }
    }

    /// Whether it needs the pass over what camera rays meet first.
    pub fn is_of_first_hit(self) -> bool {
        matches!(self, Aov::Albedo | Aov::Normal | Aov::Depth | Aov::Position)
    }
}

impl std::str::FromStr for Aov {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        let names = || Aov::ALL.map(Aov::name).join(", ");
        Aov::ALL.into_iter().find(|aov| aov.name() == s).ok_or_else(|| format!("'{s}' is not one of {}", names()))
    }
}

/// One channel of a file: a value for each pixel of the window, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Full name, `variance.R`.
    pub name: String,
    /// Finite values.
    pub values: Vec<f32>,
}

/// What the camera rays of one pixel meet first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstHit {
    /// Mean base colour.
    pub albedo: [f32; 3],
    /// Mean of the unit normals.
    pub normal: [f32; 3],
    /// Along the view axis through the pixel's centre, metres; [`f32::MAX`] where there is nothing.
    pub depth: f32,
    /// World position through the pixel's centre, metres; 0 where there is nothing.
    pub position: [f32; 3],
}

impl FirstHit {
    /// A pixel that sees no surface.
    pub const NONE: FirstHit = FirstHit { albedo: [0.0; 3], normal: [0.0; 3], depth: f32::MAX, position: [0.0; 3] };
}

/// What a render has kept for its extra outputs.
#[derive(Clone, Copy, Debug)]
pub struct Sources<'a> {
    /// The picture.
    pub film: &'a Film,
    /// Its parts by path length; without them `bounces` has no channels.
    pub lengths: Option<&'a LengthSums>,
    /// One entry a pixel of the window; without them the channels of the first hit are missing.
    pub first_hits: Option<&'a [FirstHit]>,
    /// Largest number of path edges: longer paths have no channels.
    pub max_depth: u32,
}

/// The channels of `aovs`.
pub fn channels(aovs: &[Aov], sources: &Sources) -> Vec<Channel> {
    aovs.iter().flat_map(|&aov| channels_of(aov, sources)).collect()
}

/// How many channels `aov` has with a depth limit of `max_depth` edges.
pub fn channel_count(aov: Aov, max_depth: u32) -> usize {
    match aov {
        Aov::Spp | Aov::Depth => 1,
        Aov::Bounces => 3 * (max_depth as usize).min(LENGTHS - 1),
        _ => 3,
    }
}

fn channels_of(aov: Aov, sources: &Sources) -> Vec<Channel> {
    let film = sources.film;
    let variance = |p: usize| film.pixels[p].variance().unwrap_or_default();
    let first = sources.first_hits.filter(|hits| hits.len() == film.pixels.len());
    let hits = |layer, components, value: fn(&FirstHit) -> [f32; 3]| {
        first.map_or(Vec::new(), |hits| triple(layer, components, hits.len(), |p| value(&hits[p]).map(f64::from)))
    };
    match aov {
        Aov::Variance => triple("variance", RGB, film.pixels.len(), variance),
        Aov::Stderr => triple("stderr", RGB, film.pixels.len(), |p| variance(p).map(f64::sqrt)),
        Aov::Spp => vec![single("spp.Y", film.pixels.iter().map(|pixel| pixel.samples() as f64))],
        Aov::Bounces => sources.lengths.map_or(Vec::new(), |lengths| bounces(lengths, sources.max_depth)),
        Aov::Albedo => hits("albedo", RGB, |hit| hit.albedo),
        Aov::Normal => hits("N", XYZ, |hit| hit.normal),
        Aov::Position => hits("P", XYZ, |hit| hit.position),
        Aov::Depth => first.map_or(Vec::new(), |hits| vec![single("Z", hits.iter().map(|hit| f64::from(hit.depth)))]),
    }
}

/// One image per number of scatterings, which is one less than the path has edges; the last holds all longer paths.
fn bounces(lengths: &LengthSums, max_depth: u32) -> Vec<Channel> {
    let last = (LENGTHS - 1).min(max_depth as usize);
    let layer = |edges: usize| match edges == LENGTHS - 1 {
        true => "bounce_tail".to_string(),
        false => format!("bounce_{:02}", edges - 1),
    };
    (1..=last)
        .flat_map(|edges| {
            let image = lengths.image(edges);
            triple(&layer(edges), RGB, image.len(), |p| image[p])
        })
        .collect()
}

const RGB: [&str; 3] = ["R", "G", "B"];
const XYZ: [&str; 3] = ["X", "Y", "Z"];

fn triple(layer: &str, components: [&str; 3], pixels: usize, value: impl Fn(usize) -> [f64; 3]) -> Vec<Channel> {
    let channel = |(c, component)| Channel {
        name: format!("{layer}.{component}"),
        values: (0..pixels).map(|p| stored(value(p)[c])).collect(),
    };
    components.into_iter().enumerate().map(channel).collect()
}

fn single(name: &str, values: impl Iterator<Item = f64>) -> Channel {
    Channel { name: name.into(), values: values.map(stored).collect() }
}
