//! Images that stay in their files: texels come through the tile cache, in batches of one look-up.
//!
//! The arithmetic is that of texels in memory, so both give the same bits. Every texel was looked at once at load: what is broken
//! or not finite is known before the first ray.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Instant;

use glam::{Vec2, Vec3, Vec4};

use super::decode::{Format, STRIP, broken, not_finite};
use super::oiio::{Cache, Reader, Texel};
use super::srgb::srgb_to_linear;
use super::stats::TextureStats;
use super::texels::{Histogram, Sums, decode_colors, one_for_all};
use super::{ColorSpace, Rows, Taps, Texture, linear, srgb};

/// One look-up in so many is timed.
const TIMED: u64 = 64;

/// What a look-up that fails gives.
const MAGENTA: Vec4 = Vec4::new(1.0, 0.0, 1.0, 1.0);

/// The tile cache of a scene, and what it did.
#[derive(Debug, Default)]
pub struct Tiles {
    /// Set once all files are known.
    cache: OnceLock<Cache>,
    failed: AtomicU64,
    lookups: AtomicU64,
    timed_nanoseconds: AtomicU64,
    /// Files that are deleted with it.
    pub(super) scratch: OnceLock<super::scratch::Scratch>,
}

impl Tiles {
    pub(super) fn set(&self, cache: Cache) {
        let _ = self.cache.set(cache);
    }

    /// What it did so far.
    pub fn stats(&self) -> TextureStats {
        let found = self.cache.get().map(Cache::stats).unwrap_or_default();
        TextureStats {
            cache_hits: found.tile_hits,
            cache_misses: found.tile_misses,
            cache_peak_bytes: found.peak_bytes,
            cache_seconds: TIMED as f64 * 1e-9 * self.timed_nanoseconds.load(Ordering::Relaxed) as f64,
            read_seconds: found.read_seconds,
            failed: self.failed.load(Ordering::Relaxed),
        }
    }
}

/// An image in a tiled file.
#[derive(Debug)]
pub struct Stored {
    pub(super) tiles: Arc<Tiles>,
    /// Its number in the cache.
    pub(super) image: u32,
    pub(super) levels: Vec<(usize, usize)>,
    pub(super) eight_bits: bool,
    pub(super) integers: bool,
    pub(super) scan: Scan,
}

impl Stored {
    /// The tile cache.
    pub fn tiles(&self) -> &Arc<Tiles> {
        &self.tiles
    }

    /// Columns and rows of each level.
    pub fn levels(&self) -> &[(usize, usize)] {
        &self.levels
    }

    pub(super) fn mean(&self, color_space: ColorSpace) -> Vec3 {
        self.scan.mean(color_space)
    }

    pub(super) fn constant(&self) -> Option<[f32; 4]> {
        self.scan.constant
    }

    pub(super) fn lookup(&self, texture: &Texture, uv: Vec2) -> Vec4 {
        self.lookup_level(texture, 0, uv)
    }

    /// Value at `uv` of a level that there is.
    pub(super) fn lookup_level(&self, texture: &Texture, level: usize, uv: Vec2) -> Vec4 {
        let count = self.tiles.lookups.fetch_add(1, Ordering::Relaxed);
        let start = count.is_multiple_of(TIMED).then(Instant::now);
        let (width, height) = self.levels[level];
        let value = self.mixed(texture, level, &Taps::new(texture, width, height, uv)).unwrap_or_else(|| {
            self.tiles.failed.fetch_add(1, Ordering::Relaxed);
            MAGENTA
        });
        if let Some(start) = start {
            self.tiles.timed_nanoseconds.fetch_add(start.elapsed().as_nanos() as u64, Ordering::Relaxed);
        }
        value
    }

    fn mixed(&self, texture: &Texture, level: usize, taps: &Taps) -> Option<Vec4> {
        let cache = self.tiles.cache.get()?;
        let texel = |x: usize, y: usize| Texel { level: level as u32, x: x as u32, y: y as u32 };
        let ([left, right], [top, bottom]) = (taps.columns, taps.rows);
        let wanted = [texel(left, top), texel(right, top), texel(left, bottom), texel(right, bottom)];
        let corners = match (self.eight_bits, texture.color_space) {
            (true, ColorSpace::Linear) => cache.eight(self.image, &wanted).ok()?.map(linear),
            (true, ColorSpace::Srgb) => cache.eight(self.image, &wanted).ok()?.map(srgb),
            (false, color_space) => {
                let decoded = self.integers && color_space == ColorSpace::Srgb;
                let texels = cache.float(self.image, &wanted).ok()?.map(Vec4::from_array);
                if decoded { texels.map(|t| t.truncate().map(srgb_to_linear).extend(t.w)) } else { texels }
            }
        };
        // Which of them is asked for is told by its place.
        Some(taps.mix(|x, y| {
            let (column, row) = (usize::from(x != left), usize::from(y != top));
            corners[2 * row + column]
        }))
    }
}

/// What looking once at every texel of an image tells.
#[derive(Clone, Debug, Default)]
pub(super) struct Scan {
    histogram: Option<Box<Histogram>>,
    sums: Sums,
    /// Of the decoded values, where colours are encoded.
    decoded: Sums,
    constant: Option<[f32; 4]>,
}

impl Scan {
    fn mean(&self, color_space: ColorSpace) -> Vec3 {
        match (&self.histogram, color_space) {
            (Some(histogram), _) => histogram.mean(color_space),
            (None, ColorSpace::Srgb) => self.decoded.mean(),
            (None, ColorSpace::Linear) => self.sums.mean(),
        }
    }

    /// Reads the image of an open file strip by strip.
    pub(super) fn of_file(reader: &mut Reader, format: &Format) -> Result<Scan, String> {
        let info = reader.info().clone();
        let (width, height) = info.levels[0];
        let step = info.tile_rows.unwrap_or(STRIP) as usize;
        let mut scan = Scan::default();
        for first in (0..height).step_by(step) {
            let rows = reader.read(0, first..(first + step).min(height)).map_err(|reason| broken(format, &reason))?;
            match &rows {
                Rows::Eight(texels) => scan.add_eight(texels, first == 0),
                Rows::Float(texels) => {
                    if let Some(problem) = not_finite(texels, width, first) {
                        return Err(problem);
                    }
                    scan.add_float(texels, info.integers, first == 0);
                }
            }
        }
        Ok(scan)
    }

    /// Looks at texels in memory, which are finite.
    pub(super) fn of_rows(rows: &Rows, integers: bool) -> Scan {
        let mut scan = Scan::default();
        match rows {
            Rows::Eight(texels) => scan.add_eight(texels, true),
            Rows::Float(texels) => scan.add_float(texels, integers, true),
        }
        scan
    }

    fn add_eight(&mut self, texels: &[[u8; 4]], is_first: bool) {
        self.histogram.get_or_insert_default().add(texels);
        let value = one_for_all(texels).map(|texel| texel.map(|c| f32::from(c) / 255.0));
        self.constant = if is_first { value } else { self.constant.filter(|_| self.constant == value) };
    }

    fn add_float(&mut self, texels: &[[f32; 4]], encoded: bool, is_first: bool) {
        self.sums.add(texels);
        if encoded {
            let mut decoded = texels.to_vec();
            decode_colors(&mut decoded);
            self.decoded.add(&decoded);
        } else {
            self.decoded.add(texels);
        }
        let value = one_for_all(texels);
        self.constant = if is_first { value } else { self.constant.filter(|_| self.constant == value) };
    }
}
