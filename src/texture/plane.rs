//! Texels in memory. Those of several images of one size may be woven: the first texel of each, then the second of
//! each. A material that reads them all at one point finds them in the same cache line, in no more memory than before.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

#[cfg(feature = "oiio")]
use super::color::decode_colors;

/// Texels of one image.
#[derive(Clone, Debug)]
pub struct Plane<T> {
    /// The image, row-major from the top, or as many images as `stride` woven.
    pub(super) base: Arc<[T]>,
    /// From a texel to the next of the same image.
    pub(super) stride: usize,
    /// Place of the image's first texel, below `stride`.
    pub(super) offset: usize,
    /// Coarser levels, never woven: those of the file, else made when they are first needed.
    pub(super) coarser: Arc<OnceLock<Vec<Level<T>>>>,
}

/// Texels of some rows.
#[derive(Clone, Debug, PartialEq)]
pub enum Rows {
    /// 8 bits a channel.
    Eight(Vec<[u8; 4]>),
    /// Anything else.
    Float(Vec<[f32; 4]>),
}

impl Rows {
    /// None of the same kind.
    pub(super) fn empty(&self) -> Rows {
        match self {
            Rows::Eight(_) => Rows::Eight(Vec::new()),
            Rows::Float(_) => Rows::Float(Vec::new()),
        }
    }

    /// Texels that fit without another allocation.
    pub(super) fn capacity(&self) -> usize {
        match self {
            Rows::Eight(texels) => texels.capacity(),
            Rows::Float(texels) => texels.capacity(),
        }
    }

    /// Bytes of the texels.
    pub(super) fn bytes(&self) -> u64 {
        self.as_bytes().len() as u64
    }

    /// Forgets the texels and keeps the memory.
    pub(super) fn clear(&mut self) {
        self.resize(0);
    }

    /// As many texels; new ones are 0.
    pub(super) fn resize(&mut self, texels: usize) {
        match self {
            Rows::Eight(all) => all.resize(texels, [0; 4]),
            Rows::Float(all) => all.resize(texels, [0.0; 4]),
        }
    }

    /// Makes room for as many more texels, if there is memory.
    #[cfg(feature = "oiio")]
    pub(super) fn try_reserve(&mut self, texels: usize) -> Result<(), ()> {
        let reserved = match self {
            Rows::Eight(all) => all.try_reserve_exact(texels),
            Rows::Float(all) => all.try_reserve_exact(texels),
        };
        reserved.map_err(|_| ())
    }

    /// Appends texels of the same kind.
    pub(super) fn extend(&mut self, more: &Rows) {
        match (self, more) {
            (Rows::Eight(all), Rows::Eight(more)) => all.extend(more),
            (Rows::Float(all), Rows::Float(more)) => all.extend(more),
            _ => unreachable!("levels of an image are of one kind"),
        }
    }

    /// Some of the texels.
    #[cfg(feature = "oiio")]
    pub(super) fn part(&self, range: Range<usize>) -> Rows {
        match self {
            Rows::Eight(texels) => Rows::Eight(texels[range].to_vec()),
            Rows::Float(texels) => Rows::Float(texels[range].to_vec()),
        }
    }

    /// Some of the columns of rows of this width.
    pub(super) fn columns(&self, width: usize, columns: Range<usize>) -> Rows {
        fn cut<T: Copy>(texels: &[T], width: usize, columns: Range<usize>) -> Vec<T> {
            texels.chunks_exact(width).flat_map(|row| row[columns.clone()].iter().copied()).collect()
        }
        match self {
            Rows::Eight(texels) => Rows::Eight(cut(texels, width, columns)),
            Rows::Float(texels) => Rows::Float(cut(texels, width, columns)),
        }
    }

    /// Decodes the colours of 16-bit integers; nothing unless `encoded`.
    #[cfg(feature = "oiio")]
    pub(super) fn decode(&mut self, encoded: bool) {
        if let (Rows::Float(texels), true) = (self, encoded) {
            decode_colors(texels);
        }
    }

    /// The texels, if they have 8 bits.
    #[cfg(feature = "oiio")]
    pub(super) fn into_eight(self) -> Option<Vec<[u8; 4]>> {
        if let Rows::Eight(texels) = self { Some(texels) } else { None }
    }

    /// The texels, if they are floats.
    #[cfg(feature = "oiio")]
    pub(super) fn into_float(self) -> Option<Vec<[f32; 4]>> {
        if let Rows::Float(texels) = self { Some(texels) } else { None }
    }

    pub(super) fn as_bytes(&self) -> &[u8] {
        match self {
            Rows::Eight(texels) => bytemuck::cast_slice(texels),
            Rows::Float(texels) => bytemuck::cast_slice(texels),
        }
    }

    pub(super) fn as_bytes_mut(&mut self) -> &mut [u8] {
        match self {
            Rows::Eight(texels) => bytemuck::cast_slice_mut(texels),
            Rows::Float(texels) => bytemuck::cast_slice_mut(texels),
        }
    }
}

/// Columns, rows and texels of a level.
pub type Level<T> = (usize, usize, Vec<T>);

impl<T> Plane<T> {
    /// An image without coarser levels.
    pub fn new(base: Arc<[T]>) -> Self {
        Plane { base, stride: 1, offset: 0, coarser: Arc::default() }
    }

    /// An image and the levels of its file; none if that has none.
    pub(super) fn with_levels(base: Arc<[T]>, levels: Vec<Level<T>>) -> Self {
        let coarser = if levels.is_empty() { OnceLock::new() } else { OnceLock::from(levels) };
        Plane { coarser: Arc::new(coarser), ..Plane::new(base) }
    }

    /// The coarser levels there are by now.
    pub(super) fn levels(&self) -> &[Level<T>] {
        self.coarser.get().map_or(&[], Vec::as_slice)
    }

    /// Number of texels without those of coarser levels.
    pub(super) fn len(&self) -> usize {
        self.base.len() / self.stride
    }

    /// The texels, row-major from the top.
    pub fn iter(&self) -> impl Iterator<Item = &T> {
        self.base.iter().skip(self.offset).step_by(self.stride)
    }

    /// Whether both are the same image in the same memory.
    pub(super) fn shares(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.base, &other.base) && self.offset == other.offset
    }

    /// Bytes in memory, without those of images woven with this one.
    pub(super) fn bytes(&self) -> u64 {
        let coarser: usize = self.levels().iter().map(|(_, _, texels)| texels.len()).sum();
        ((self.len() + coarser) * size_of::<T>()) as u64
    }
}

impl<T: Copy> Plane<T> {
    /// Texel `i` of the image, row-major from the top.
    #[inline(always)]
    pub(super) fn at(&self, i: usize) -> T {
        self.base[i * self.stride + self.offset]
    }

    /// The texels behind one another, copied if they are not.
    pub(super) fn contiguous(&self) -> Cow<'_, [T]> {
        if self.stride == 1 { Cow::Borrowed(&*self.base) } else { Cow::Owned(self.iter().copied().collect()) }
    }

    /// The same images woven. All have as many texels as the first.
    pub(super) fn woven<const K: usize>(planes: [&Self; K]) -> [Self; K] {
        let base: Arc<[T]> = (0..K * planes[0].len()).map(|i| planes[i % K].at(i / K)).collect();
        std::array::from_fn(|offset| Plane {
            base: Arc::clone(&base),
            stride: K,
            offset,
            coarser: Arc::clone(&planes[offset].coarser),
        })
    }
}
