//! Images that stay in files: texels come in tiles through the cache, in batches of one look-up.
//!
//! The arithmetic is that of texels in memory, and so are the levels, so both give the same bits. Every texel was
//! looked at once at load: what is broken or not finite is known before the first ray, and what comes later is held
//! against a checksum of each tile. What cannot be had then, or is not what it was, is counted and noted with file
//! and material ([`Tiles::faults`]); the look-up gives magenta.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use glam::{Vec2, Vec3, Vec4};

use super::cache::{Cache, Key};
use super::color::{ColorSpace, linear, srgb};
#[cfg(feature = "oiio")]
use super::files::{FileTiles, Files};
use super::mean::{Extremes, Histogram, Sums, one_for_all};
use super::plane::Rows;
use super::scratch::Scratch;
use super::stats::{TextureFault, TextureStats};
use super::taps::{Sampler, Taps};
use crate::error::Error;

/// One look-up in so many is timed.
const TIMED: u64 = 64;

/// What a look-up that fails gives.
const MAGENTA: Vec4 = Vec4::new(1.0, 0.0, 1.0, 1.0);

/// Columns and rows of a tile of copies: 2 to this.
const COPY_SHIFT: u32 = 6;

/// The tiles of a scene's images, and what look-ups did.
#[derive(Debug)]
pub struct Tiles {
    cache: Cache,
    scratch: Scratch,
    #[cfg(feature = "oiio")]
    files: Files,
    /// Whether a look-up that fails ends a render.
    strict: bool,
    any_fault: AtomicBool,
    faults: Mutex<Vec<TextureFault>>,
    lookups: AtomicU64,
    timed_nanoseconds: AtomicU64,
}

impl Tiles {
    /// A cache of so many bytes. `strict` says that a look-up that fails ends a render.
    pub(super) fn new(most_bytes: u64, strict: bool) -> Self {
        Tiles {
            cache: Cache::new(most_bytes),
            scratch: Scratch::default(),
            #[cfg(feature = "oiio")]
            files: Files::new(),
            strict,
            any_fault: AtomicBool::new(false),
            faults: Mutex::default(),
            lookups: AtomicU64::new(0),
            timed_nanoseconds: AtomicU64::new(0),
        }
    }

    /// What it did so far.
    pub fn stats(&self) -> TextureStats {
        let (found, faults) = (self.cache.counts(), self.faults());
        let lookups = self.lookups.load(Ordering::Relaxed);
        TextureStats {
            cache_hits: (4 * lookups).saturating_sub(found.misses),
            cache_misses: found.misses,
            cache_peak_bytes: found.peak_bytes,
            cache_seconds: TIMED as f64 * 1e-9 * self.timed_nanoseconds.load(Ordering::Relaxed) as f64,
            read_seconds: found.read_seconds,
            failed: faults.iter().map(|fault| fault.lookups).sum(),
        }
    }

    /// The images of which look-ups failed, in the order in which they first did.
    pub fn faults(&self) -> Vec<TextureFault> {
        self.faults.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Whether a look-up failed, and that is no picture to go on with.
    #[inline]
    pub fn must_stop(&self) -> bool {
        self.strict && self.any_fault.load(Ordering::Relaxed)
    }

    #[cold]
    fn note(&self, stored: &Stored, problem: String) {
        let mut faults = self.faults.lock().unwrap_or_else(PoisonError::into_inner);
        match faults.iter_mut().find(|fault| fault.image == stored.name) {
            Some(fault) => fault.lookups += 1,
            None => faults.push(TextureFault { image: stored.name.clone(), lookups: 1, problem }),
        }
        self.any_fault.store(true, Ordering::Relaxed);
    }

    #[cfg(feature = "oiio")]
    pub(super) fn files(&self) -> &Files {
        &self.files
    }

    /// Copies a level into the scratch file, tile by tile, and shows its texels to `look` in order. `part` gives
    /// some of them.
    pub(super) fn copy(
        &self,
        (width, height): (usize, usize),
        part: &dyn Fn(Range<usize>) -> Rows,
        mut look: impl FnMut(&Rows),
    ) -> Result<Level, Error> {
        let texel_bytes = part(0..1).bytes();
        let begin = self.scratch.reserve((width * height) as u64 * texel_bytes);
        let mut level = Level::new((width, height), (COPY_SHIFT, COPY_SHIFT), Place::Copy { begin });
        for first in (0..height).step_by(1 << COPY_SHIFT) {
            let texels = first * width..(first + (1 << COPY_SHIFT)).min(height) * width;
            let place = begin + texels.start as u64 * texel_bytes;
            let strip = part(texels);
            look(&strip);
            self.scratch.write(level.cut(&strip).as_bytes(), place)?;
        }
        Ok(level)
    }
}

/// Where the tiles of a level are.
#[derive(Clone, Debug)]
enum Place {
    /// In the scratch file, behind one another from this byte on.
    Copy {
        /// First byte.
        begin: u64,
    },
    /// In the image's own file.
    #[cfg(feature = "oiio")]
    File(Arc<FileTiles>),
}

/// One level of an image: its tiles, row-major, those at the right and lower edge cut off there.
#[derive(Clone, Debug)]
pub(super) struct Level {
    width: usize,
    height: usize,
    /// Columns and rows of a tile are powers of two.
    shift: (u32, u32),
    place: Place,
    /// Checksum of each tile.
    sums: Vec<u64>,
}

impl Level {
    fn new((width, height): (usize, usize), shift: (u32, u32), place: Place) -> Self {
        Level { width, height, shift, place, sums: Vec::new() }
    }

    /// Of a tiled file; its texels are shown to [`cut`](Self::cut), a row of tiles after the other.
    #[cfg(feature = "oiio")]
    pub(super) fn of_file(size: (usize, usize), shift: (u32, u32), file: Arc<FileTiles>) -> Self {
        Level::new(size, shift, Place::File(file))
    }

    /// Columns of tiles.
    fn across(&self) -> usize {
        self.width.div_ceil(1 << self.shift.0)
    }

    /// Columns and rows of a tile, as ranges of the level's.
    fn area(&self, tile: usize) -> [Range<usize>; 2] {
        let (column, row) = (tile % self.across(), tile / self.across());
        let along = |i: usize, shift: u32, size: usize| (i << shift)..((i + 1) << shift).min(size);
        [along(column, self.shift.0, self.width), along(row, self.shift.1, self.height)]
    }

    /// Cuts the texels of the next row of tiles, row-major, into its tiles, and notes their checksums.
    pub(super) fn cut(&mut self, strip: &Rows) -> Rows {
        let mut all = strip.empty();
        for _ in 0..self.across() {
            let [columns, _] = self.area(self.sums.len());
            let tile = strip.columns(self.width, columns);
            self.sums.push(checksum(tile.as_bytes()));
            all.extend(&tile);
        }
        all
    }
}

/// An image in tiles.
#[derive(Debug)]
pub struct Stored {
    pub(super) tiles: Arc<Tiles>,
    /// File and material, for messages.
    pub(super) name: String,
    /// Its number in the cache.
    pub(super) number: u32,
    pub(super) levels: Vec<Level>,
    pub(super) eight_bits: bool,
    /// Colours of 16 bits, which are decoded as tiles come from the file; copies are decoded already.
    #[cfg_attr(not(feature = "oiio"), allow(dead_code))]
    pub(super) encoded: bool,
    pub(super) scan: Scan,
}

impl Stored {
    /// The tile cache.
    pub fn tiles(&self) -> &Arc<Tiles> {
        &self.tiles
    }

    /// Levels there are, the image among them.
    pub fn levels(&self) -> usize {
        self.levels.len()
    }

    pub(super) fn mean(&self, color_space: ColorSpace) -> Vec3 {
        self.scan.mean(color_space)
    }

    pub(super) fn constant(&self) -> Option<[f32; 4]> {
        self.scan.constant
    }

    pub(super) fn range(&self, channel: usize) -> [f32; 2] {
        self.scan.range.channel(channel)
    }

    pub(super) fn may_have_alpha(&self) -> bool {
        self.scan.has_alpha
    }

    /// Value at `uv` of a level that there is.
    pub(super) fn lookup_level(&self, sampler: Sampler, color_space: ColorSpace, level: usize, uv: Vec2) -> Vec4 {
        let count = self.tiles.lookups.fetch_add(1, Ordering::Relaxed);
        let start = count.is_multiple_of(TIMED).then(Instant::now);
        let taps = Taps::new(sampler, self.levels[level].width, self.levels[level].height, uv);
        let value = self.mixed(color_space, level, &taps).unwrap_or_else(|problem| {
            self.tiles.note(self, problem);
            MAGENTA
        });
        if let Some(start) = start {
            self.tiles.timed_nanoseconds.fetch_add(start.elapsed().as_nanos() as u64, Ordering::Relaxed);
        }
        value
    }

    fn mixed(&self, color_space: ColorSpace, level: usize, taps: &Taps) -> Result<Vec4, String> {
        let mut corners = [Vec4::ZERO; 4];
        for (k, corner) in corners.iter_mut().enumerate() {
            *corner = self.texel(color_space, level, taps.columns[k % 2], taps.rows[k / 2])?;
        }
        let ([left, _], [top, _]) = (taps.columns, taps.rows);
        // Its place tells which of them is meant.
        Ok(taps.mix(|x, y| corners[2 * usize::from(y != top) + usize::from(x != left)]))
    }

    fn texel(&self, color_space: ColorSpace, number: usize, x: usize, y: usize) -> Result<Vec4, String> {
        let level = &self.levels[number];
        let (column, row) = (x >> level.shift.0, y >> level.shift.1);
        let tile = row * level.across() + column;
        let (x, y) = (x - (column << level.shift.0), y - (row << level.shift.1));
        let width = (level.width - (column << level.shift.0)).min(1 << level.shift.0);
        let key = Key { image: self.number, level: number as u32, tile: tile as u32 };
        let read = |texels: &mut Rows| self.read(number, tile, texels);
        // The length of a tile is that of its area, see `read`.
        self.tiles.cache.with(key, self.eight_bits, read, |texels| match (texels, color_space) {
            (Rows::Eight(texels), ColorSpace::Linear) => linear(texels[y * width + x]),
            (Rows::Eight(texels), ColorSpace::Srgb) => srgb(texels[y * width + x]),
            (Rows::Float(texels), _) => Vec4::from_array(texels[y * width + x]),
        })
    }

    /// Reads a tile into an empty buffer of the image's kind.
    fn read(&self, number: usize, tile: usize, texels: &mut Rows) -> Result<(), String> {
        let level = &self.levels[number];
        let [columns, rows] = level.area(tile);
        texels.resize(columns.len() * rows.len());
        match &level.place {
            Place::Copy { begin } => {
                let before = rows.start * level.width + rows.len() * columns.start;
                let texel_bytes = if self.eight_bits { 4 } else { 16 };
                let place = begin + before as u64 * texel_bytes;
                let unread =
                    |reason| format!("its copy in {} cannot be read: {reason}", std::env::temp_dir().display());
                self.tiles.scratch.read(texels.as_bytes_mut(), place).map_err(unread)?;
            }
            #[cfg(feature = "oiio")]
            Place::File(file) => self.tiles.files.read(file, number, [columns, rows], texels)?,
        }
        if level.sums.get(tile) != Some(&checksum(texels.as_bytes())) {
            return Err("its texels are not those that were loaded: it changed meanwhile".into());
        }
        #[cfg(feature = "oiio")]
        texels.decode(self.encoded && matches!(level.place, Place::File(_)));
        Ok(())
    }
}

/// A number that other bytes do not have but by chance.
fn checksum(bytes: &[u8]) -> u64 {
    const PRIME: u64 = 0x9E37_79B9_7F4A_7C15;
    let mut sums = [1u64, 2, 3, 4];
    let mut add = |block: &[u8; 32]| {
        for (sum, word) in sums.iter_mut().zip(block.as_chunks::<8>().0) {
            *sum = (*sum ^ u64::from_le_bytes(*word)).wrapping_mul(PRIME);
            *sum ^= *sum >> 29;
        }
    };
    let (blocks, rest) = bytes.as_chunks::<32>();
    blocks.iter().for_each(&mut add);
    let mut last = [0; 32];
    last[..rest.len()].copy_from_slice(rest);
    add(&last);
    sums.iter().fold(bytes.len() as u64, |sum, part| (sum ^ part).wrapping_mul(PRIME).rotate_left(23))
}

/// What looking once at every texel of an image tells. Float texels are linear.
#[derive(Clone, Debug, Default)]
pub(super) struct Scan {
    histogram: Option<Box<Histogram>>,
    sums: Sums,
    range: Extremes,
    constant: Option<[f32; 4]>,
    has_alpha: bool,
    begun: bool,
}

impl Scan {
    fn mean(&self, color_space: ColorSpace) -> Vec3 {
        match &self.histogram {
            Some(histogram) => histogram.mean(color_space),
            None => self.sums.mean(),
        }
    }

    /// Looks at the next texels.
    pub(super) fn add(&mut self, rows: &Rows) {
        let value = match rows {
            Rows::Eight(texels) => {
                self.histogram.get_or_insert_default().add(texels);
                self.range = self.range.and(Extremes::of_bytes(texels));
                self.has_alpha |= texels.iter().any(|texel| texel[3] < u8::MAX);
                one_for_all(texels).map(|texel| texel.map(|c| f32::from(c) / 255.0))
            }
            Rows::Float(texels) => {
                self.sums.add(texels);
                self.range = self.range.and(Extremes::of_floats(texels));
                self.has_alpha |= texels.iter().any(|texel| texel[3] < 1.0);
                one_for_all(texels)
            }
        };
        self.constant = if self.begun { self.constant.filter(|_| self.constant == value) } else { value };
        self.begun = true;
    }
}
