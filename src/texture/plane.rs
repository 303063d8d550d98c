//! Texels in memory. Those of several images of one size may be woven: the first texel of each, then the second of each. A
//! material that reads them all at one point finds them in the same cache line, in no more memory than before.

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

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
