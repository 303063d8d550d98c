//! A texture: an image, how its numbers are to be read, and how coordinates outside of it are folded.
//!
//! Where the numbers are kept is [`Texels`]' own affair: a look-up gives the same bits from memory and from the tile
//! cache.

use std::borrow::Cow;
use std::sync::Arc;

use glam::Vec3;

use super::color::ColorSpace;
use super::mean::{Extremes, Histogram, Sums, one_for_all};
use super::plane::Plane;
use super::pyramid::{EightBits, Floats, complete};
use super::stored::{Stored, Tiles};
use super::taps::{Sampler, Wrap};
use super::udim::Udim;

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
    /// In files, read tile by tile.
    Stored(Arc<Stored>),
    /// Several images side by side.
    Udim(Arc<Udim<Texture>>),
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
            Texels::Stored(_) => 0,
            Texels::Udim(udim) => udim.pages().map(|(_, page)| page.texels.bytes()).sum(),
        }
    }

    /// The tiles behind these texels, if they are not in memory; the same for all images of a scene.
    pub fn tiles(&self) -> Option<&Arc<Tiles>> {
        match self {
            Texels::Stored(stored) => Some(stored.tiles()),
            Texels::Udim(udim) => udim.pages().find_map(|(_, page)| page.texels.tiles()),
            _ => None,
        }
    }

    /// Whether some texel is not opaque.
    pub fn may_have_alpha(&self) -> bool {
        match self {
            Texels::Eight(plane) => plane.iter().any(|texel| texel[3] < u8::MAX),
            Texels::Float(plane) => plane.iter().any(|texel| texel[3] < 1.0),
            Texels::Stored(stored) => stored.may_have_alpha(),
            Texels::Udim(udim) => udim.pages().any(|(_, page)| page.texels.may_have_alpha()),
        }
    }

    /// Least and largest value of a channel as stored, with 8-bit channels over 255.
    pub fn range(&self, channel: usize) -> [f32; 2] {
        match self {
            Texels::Eight(plane) => Extremes::of_bytes(plane.iter()).channel(channel),
            Texels::Float(plane) => Extremes::of_floats(plane.iter()).channel(channel),
            Texels::Stored(stored) => stored.range(channel),
            Texels::Udim(udim) => {
                let ranges = udim.pages().map(|(_, page)| page.texels.range(channel));
                ranges.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]).unwrap_or([0.0, 1.0])
            }
        }
    }

    /// The value of every texel as stored, with 8-bit channels over 255, if it is one for all.
    pub fn constant(&self) -> Option<[f32; 4]> {
        match self {
            Texels::Eight(plane) => one_for_all(plane.iter()).map(|texel| texel.map(|c| f32::from(c) / 255.0)),
            Texels::Float(plane) => one_for_all(plane.iter()),
            Texels::Stored(stored) => stored.constant(),
            Texels::Udim(_) => None,
        }
    }
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
    /// How its coordinates become texels.
    #[inline(always)]
    pub(super) fn sampler(&self) -> Sampler {
        Sampler { wrap_u: self.wrap_u, wrap_v: self.wrap_v, bilinear: self.bilinear }
    }

    /// What is wrong with the number of texels, if anything.
    pub fn problem(&self) -> Option<String> {
        let expected = self.width.checked_mul(self.height).filter(|&texels| texels > 0);
        let found = match &self.texels {
            Texels::Eight(plane) => plane.len(),
            Texels::Float(plane) => plane.len(),
            Texels::Stored(_) => return None,
            Texels::Udim(udim) => return udim.pages().find_map(|(_, page)| page.problem()),
        };
        (expected != Some(found)).then(|| format!("expected {} × {} texels, found {found}", self.width, self.height))
    }

    /// Makes the coarser levels that [`lookup_filtered`](super::lookup_filtered) reads, where the image's file has
    /// none.
    pub fn make_levels(&self) {
        let size = (self.width, self.height);
        match &self.texels {
            Texels::Eight(plane) => {
                let codec = EightBits(self.color_space);
                plane.coarser.get_or_init(|| complete(size, &plane.contiguous(), Vec::new(), codec));
            }
            // Colours in memory are decoded.
            Texels::Float(plane) => {
                plane.coarser.get_or_init(|| complete(size, &plane.contiguous(), Vec::new(), Floats));
            }
            Texels::Stored(_) => {}
            Texels::Udim(udim) => udim.pages().for_each(|(_, page)| page.make_levels()),
        }
    }

    /// Number of the last level there is by now; the image itself is 0.
    pub(super) fn coarsest_level(&self) -> usize {
        match &self.texels {
            Texels::Eight(plane) => plane.levels().len(),
            Texels::Float(plane) => plane.levels().len(),
            Texels::Stored(stored) => stored.levels() - 1,
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
            Texels::Stored(stored) => stored.mean(self.color_space),
            Texels::Udim(udim) => {
                let pages: Vec<Vec3> = udim.pages().map(|(_, page)| page.mean()).collect();
                pages.iter().copied().sum::<Vec3>() / pages.len().max(1) as f32
            }
        }
    }
}
