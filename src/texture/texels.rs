//! A texture: an image, how its numbers are to be read, and how coordinates outside of it are folded.
//!
//! Where the numbers are kept is [`Texels`]' own affair: a look-up gives the same bits from memory and from the tile cache.

use std::borrow::Cow;
use std::sync::Arc;

use glam::Vec3;

use super::plane::Plane;
use super::pyramid;
use super::srgb::{SRGB_TO_LINEAR, srgb_to_linear};
use super::stats::TextureStats;
#[cfg(feature = "oiio")]
use super::stored::Stored;
use super::udim::Udim;

/// How texture coordinates outside [0,1) are folded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// glTF 10497.
    Repeat,
    /// glTF 33648.
    MirroredRepeat,
    /// glTF 33071.
    ClampToEdge,
}

/// How stored texel values map to linear ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColorSpace {
    /// Base colour and emissive: decoded by the sRGB curve before filtering. Images of floats are linear already.
    Srgb,
    /// Data: metallic-roughness and normals.
    Linear,
}

/// Decoded image and its sampler.
#[derive(Clone, Debug)]
pub struct Texture {
    /// File name, or `image N`.
    pub name: String,
    /// Columns, > 0.
    pub width: usize,
    /// Rows, > 0.
    pub height: usize,
    /// RGBA as stored, row-major from the top.
    pub texels: Texels,
    /// How to read `texels`.
    pub color_space: ColorSpace,
    /// Horizontal wrap.
    pub wrap_u: Wrap,
    /// Vertical wrap.
    pub wrap_v: Wrap,
    /// False for the NEAREST magnification filter.
    pub bilinear: bool,
}

/// RGBA texels of an image and, where its file has a pyramid, of its coarser levels.
#[derive(Clone, Debug)]
pub enum Texels {
    /// 8 bits a channel, in memory.
    Eight(Plane<[u8; 4]>),
    /// Floats, in memory; finite. Integers of 16 bits are here divided by 65535 and, in colours, decoded.
    Float(Plane<[f32; 4]>),
    /// In a tiled file, looked at through the tile cache.
    #[cfg(feature = "oiio")]
    Stored(Arc<Stored>),
    /// Several images side by side.
    Udim(Arc<Udim>),
}

/// Texels of some rows.
#[derive(Clone, Debug, PartialEq)]
pub enum Rows {
    /// 8 bits a channel.
    Eight(Vec<[u8; 4]>),
    /// Anything else.
    Float(Vec<[f32; 4]>),
}

impl Texels {
    /// Texels of 8 bits, if they are that and in memory; copied where they are woven with those of other images.
    pub fn eight(&self) -> Option<Cow<'_, [[u8; 4]]>> {
        match self {
            Texels::Eight(plane) => Some(plane.contiguous()),
            _ => None,
        }
    }

    /// Whether both are the same memory or the same stored image.
    pub fn shares(&self, other: &Texels) -> bool {
        match (self, other) {
            (Texels::Eight(a), Texels::Eight(b)) => a.shares(b),
            (Texels::Float(a), Texels::Float(b)) => a.shares(b),
            #[cfg(feature = "oiio")]
            (Texels::Stored(a), Texels::Stored(b)) => Arc::ptr_eq(a, b),
            (Texels::Udim(a), Texels::Udim(b)) => Arc::ptr_eq(a, b),
            _ => false,
        }
    }

    /// Bytes in memory, without what the tile cache holds.
    pub fn bytes(&self) -> u64 {
        match self {
            Texels::Eight(plane) => plane.bytes(),
            Texels::Float(plane) => plane.bytes(),
            #[cfg(feature = "oiio")]
            Texels::Stored(_) => 0,
            Texels::Udim(udim) => udim.pages().map(|(_, page)| page.texels.bytes()).sum(),
        }
    }

    /// What the tile cache behind these texels did, if there is one.
    pub fn cache_stats(&self) -> Option<TextureStats> {
        match self {
            #[cfg(feature = "oiio")]
            Texels::Stored(stored) => Some(stored.tiles().stats()),
            Texels::Udim(udim) => udim.pages().find_map(|(_, page)| page.texels.cache_stats()),
            _ => None,
        }
    }

    /// Whether some texel may not be opaque; of images that are not in memory this is assumed.
    pub fn may_have_alpha(&self) -> bool {
        match self {
            Texels::Eight(plane) => plane.iter().any(|texel| texel[3] < u8::MAX),
            Texels::Float(plane) => plane.iter().any(|texel| texel[3] < 1.0),
            #[cfg(feature = "oiio")]
            Texels::Stored(_) => true,
            Texels::Udim(udim) => udim.pages().any(|(_, page)| page.texels.may_have_alpha()),
        }
    }

    /// The value of every texel as stored, with 8-bit channels over 255, if it is one for all.
    pub fn constant(&self) -> Option<[f32; 4]> {
        match self {
            Texels::Eight(plane) => one_for_all(plane.iter()).map(|texel| texel.map(|c| f32::from(c) / 255.0)),
            Texels::Float(plane) => one_for_all(plane.iter()),
            #[cfg(feature = "oiio")]
            Texels::Stored(stored) => stored.constant(),
            Texels::Udim(_) => None,
        }
    }
}

/// The texel that all are, if they are.
pub(super) fn one_for_all<'t, T: Copy + PartialEq + 't>(texels: impl IntoIterator<Item = &'t T>) -> Option<T> {
    let mut texels = texels.into_iter();
    let &first = texels.next()?;
    texels.all(|texel| *texel == first).then_some(first)
}

impl From<Arc<[[u8; 4]]>> for Texels {
    fn from(texels: Arc<[[u8; 4]]>) -> Self {
        Texels::Eight(Plane::new(texels))
    }
}

impl From<Vec<[u8; 4]>> for Texels {
    fn from(texels: Vec<[u8; 4]>) -> Self {
        Texels::Eight(Plane::new(texels.into()))
    }
}

impl From<&[[u8; 4]]> for Texels {
    fn from(texels: &[[u8; 4]]) -> Self {
        Texels::Eight(Plane::new(texels.into()))
    }
}

impl From<Vec<[f32; 4]>> for Texels {
    fn from(texels: Vec<[f32; 4]>) -> Self {
        Texels::Float(Plane::new(texels.into()))
    }
}

impl FromIterator<[u8; 4]> for Texels {
    fn from_iter<I: IntoIterator<Item = [u8; 4]>>(texels: I) -> Self {
        Texels::Eight(Plane::new(texels.into_iter().collect()))
    }
}

impl Texture {
    /// What is wrong with the number of texels, if anything.
    pub fn problem(&self) -> Option<String> {
        let expected = self.width.checked_mul(self.height).filter(|&texels| texels > 0);
        let found = match &self.texels {
            Texels::Eight(plane) => plane.len(),
            Texels::Float(plane) => plane.len(),
            #[cfg(feature = "oiio")]
            Texels::Stored(_) => return None,
            Texels::Udim(udim) => return udim.pages().find_map(|(_, page)| page.problem()),
        };
        (expected != Some(found)).then(|| format!("expected {} × {} texels, found {found}", self.width, self.height))
    }

    /// Makes the coarser levels that [`lookup_filtered`](super::lookup_filtered) reads, where the image's file has none.
    pub fn make_levels(&self) {
        let size = (self.width, self.height);
        match &self.texels {
            Texels::Eight(plane) => {
                let next = |(width, height), texels: &[[u8; 4]]| {
                    pyramid::halved_eight(width, height, texels, self.color_space)
                };
                plane.coarser.get_or_init(|| pyramid::levels(size, &plane.contiguous(), next));
            }
            Texels::Float(plane) => {
                // Colours in memory are decoded.
                let next = |(width, height), texels: &[[f32; 4]]| pyramid::halved_float(width, height, texels, false);
                plane.coarser.get_or_init(|| pyramid::levels(size, &plane.contiguous(), next));
            }
            #[cfg(feature = "oiio")]
            Texels::Stored(_) => {}
            Texels::Udim(udim) => udim.pages().for_each(|(_, page)| page.make_levels()),
        }
    }

    /// Number of the last level there is by now; the image itself is 0.
    pub(super) fn coarsest_level(&self) -> usize {
        match &self.texels {
            Texels::Eight(plane) => plane.levels().len(),
            Texels::Float(plane) => plane.levels().len(),
            #[cfg(feature = "oiio")]
            Texels::Stored(stored) => stored.levels().len() - 1,
            Texels::Udim(_) => 0,
        }
    }

    /// Mean of the linear texels, R, G and B; 0 only where every texel is.
    pub fn mean(&self) -> Vec3 {
        match &self.texels {
            Texels::Eight(plane) => Histogram::of(plane.iter()).mean(self.color_space),
            Texels::Float(plane) => {
                let mut sums = Sums::default();
                sums.add(plane.iter());
                sums.mean()
            }
            #[cfg(feature = "oiio")]
            Texels::Stored(stored) => stored.mean(self.color_space),
            Texels::Udim(udim) => {
                let pages: Vec<Vec3> = udim.pages().map(|(_, page)| page.mean()).collect();
                pages.iter().copied().sum::<Vec3>() / pages.len().max(1) as f32
            }
        }
    }
}

/// How often each value of 8 bits occurs in R, G and B.
#[derive(Clone, Debug)]
pub(super) struct Histogram([[u64; 256]; 3]);

impl Default for Histogram {
    fn default() -> Self {
        Histogram([[0; 256]; 3])
    }
}

impl Histogram {
    fn of<'t>(texels: impl IntoIterator<Item = &'t [u8; 4]>) -> Self {
        let mut counts = Histogram::default();
        counts.add(texels);
        counts
    }

    pub(super) fn add<'t>(&mut self, texels: impl IntoIterator<Item = &'t [u8; 4]>) {
        for texel in texels {
            for (channel, counts) in self.0.iter_mut().enumerate() {
                counts[usize::from(texel[channel])] += 1;
            }
        }
    }

    pub(super) fn mean(&self, color_space: ColorSpace) -> Vec3 {
        let texels = self.0[0].iter().sum::<u64>().max(1) as f64;
        let means = self.0.map(|counts| {
            let linear = |value: usize| match color_space {
                ColorSpace::Linear => value as f64 / 255.0,
                ColorSpace::Srgb => f64::from(SRGB_TO_LINEAR[value]),
            };
            let sum: f64 = counts.iter().enumerate().map(|(value, &count)| count as f64 * linear(value)).sum();
            // One texel of the darkest step in 2^31 of them is still above 0 in f32.
            (sum / texels) as f32
        });
        Vec3::from_array(means)
    }
}

/// Sums of float texels that are linear already.
#[derive(Clone, Debug, Default)]
pub(super) struct Sums {
    sum: [f64; 3],
    texels: u64,
}

impl Sums {
    pub(super) fn add<'t>(&mut self, texels: impl IntoIterator<Item = &'t [f32; 4]>) {
        for texel in texels {
            for c in 0..3 {
                self.sum[c] += f64::from(texel[c].max(0.0));
            }
            self.texels += 1;
        }
    }

    pub(super) fn mean(&self) -> Vec3 {
        Vec3::from_array(self.sum.map(|sum| (sum / self.texels.max(1) as f64) as f32))
    }
}

/// Decodes the colours of an image of 16-bit integers.
pub(super) fn decode_colors(texels: &mut [[f32; 4]]) {
    for texel in texels {
        for channel in &mut texel[..3] {
            *channel = srgb_to_linear(*channel);
        }
    }
}
