//! All images of a scene within a budget of memory: which are held, and which stay in their files behind the tile
//! cache.
//!
//! If all fit (with a third on top, for pyramids), all are held. Else the smallest are held, up to half of the budget,
//! and the cache gets three quarters of the rest (decoders have buffers of their own). Those that stay out and are not
//! stored in tiles are copied, see `scratch`. The picture does not depend on it, the speed does. Where memory is short,
//! the budget is half of what is left.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;

use super::color::ColorSpace;
#[cfg(feature = "oiio")]
use super::decode::stores_the_image;
use super::decode::{Decoder, Problem, decode, inspect};
use super::encoded::Encoded;
#[cfg(feature = "oiio")]
use super::encoded::{Format, broken, not_finite};
use super::image::Image;
#[cfg(feature = "oiio")]
use super::oiio::{Info, Reader};
use super::plane::Rows;
#[cfg(feature = "oiio")]
use super::pyramid::{EightBits, Floats, halved_from};
#[cfg(feature = "oiio")]
use super::reader::open;
#[cfg(feature = "oiio")]
use super::stored::Level;
use super::stored::{Scan, Stored, Tiles};
use super::texels::Texels;
use crate::error::Error;
use crate::room::Room;

/// Default of [`Budget::bytes`]: 4 GiB.
pub const DEFAULT_BYTES: u64 = 4 << 30;

/// Least of [`Budget::bytes`]: some hundred tiles a thread.
pub const LEAST_BYTES: u64 = 24 << 20;

/// What may be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Bytes of decoded texels, held and cached together.
    pub bytes: u64,
    /// Who decodes, and what.
    pub decoder: Decoder,
}

impl Default for Budget {
    fn default() -> Self {
        Budget { bytes: DEFAULT_BYTES, decoder: Decoder::Default }
    }
}

/// An image to be loaded.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Where it is.
    pub encoded: Encoded<'a>,
    /// What its texels are read as, so that averages are made of the right values; one of them at least.
    pub color_spaces: [Option<ColorSpace>; 2],
    /// Its file and the material that asks for it, for messages of look-ups that fail.
    pub name: &'a str,
}

/// A loaded image: of each colour space that was asked for.
pub type Loaded = [Option<Image>; 2];

/// The `.tx` beside an image file, if there is one: the same image in tiles with its pyramid.
pub fn beside(path: &Path) -> Option<PathBuf> {
    let tx = path.with_extension("tx");
    (cfg!(feature = "oiio") && tx != path && tx.is_file()).then_some(tx)
}

/// Loads images within a budget; each, or what is wrong with it, in the order of the requests. `strict` says that a
/// look-up that fails later ends the render.
pub fn load(requests: &[Request], budget: Budget, strict: bool) -> Vec<Result<Loaded, Problem>> {
    let headers: Vec<_> = requests.par_iter().map(|request| inspect(request.encoded, budget.decoder)).collect();
    // A header that is broken costs nothing; its error is reported by the decoder.
    let size = |i: usize| headers[i].as_ref().map_or(0, |header| header.bytes + header.bytes / 3);
    let all: u64 = (0..requests.len()).map(size).sum();
    let left = if all > LEAST_BYTES { Room::left(rayon::current_num_threads()) } else { None };
    let most = left.map_or(u64::MAX, |room| (room.bytes / 2).max(LEAST_BYTES));
    let budget = Budget { bytes: budget.bytes.min(most), ..budget };
    let mut held = vec![true; requests.len()];
    let mut held_bytes = all;
    if all > budget.bytes {
        let mut order: Vec<usize> = (0..requests.len()).collect();
        order.sort_by_key(|&i| (size(i), i));
        held_bytes = 0;
        for i in order {
            held[i] = held_bytes + size(i) <= budget.bytes / 2;
            held_bytes += if held[i] { size(i) } else { 0 };
        }
    }
    let sizes: Vec<u64> = (0..requests.len()).map(size).collect();
    let decoded: Vec<Option<Result<Loaded, Problem>>> = (requests.par_iter().zip(headers).enumerate())
        .map(|(i, (request, header))| match header {
            Err(problem) => Some(Err(problem)),
            Ok(_) if held[i] => Some(decode(request.encoded, budget.decoder).map(|image| {
                let of = |color_space: ColorSpace| Image { texels: image.texels_in(color_space), ..image.clone() };
                request.color_spaces.map(|color_space| color_space.map(of))
            })),
            Ok(_) => None,
        })
        .collect();
    let mut store = None;
    let all = decoded.into_iter().enumerate();
    all.map(|(i, image)| match image {
        Some(image) => image,
        None => {
            let cache_bytes = budget.bytes.saturating_sub(held_bytes) / 4 * 3;
            store.get_or_insert_with(|| Store::new(cache_bytes, budget, strict)).add(requests[i], sizes[i])
        }
    })
    .collect()
}

/// The images that stay in files.
struct Store {
    tiles: Arc<Tiles>,
    budget: Budget,
    count: u32,
}

impl Store {
    fn new(cache_bytes: u64, budget: Budget, strict: bool) -> Self {
        Store { tiles: Arc::new(Tiles::new(cache_bytes, strict)), budget, count: 0 }
    }

    /// One image: looked at once, and copied if need be. `bytes` is what it would take in memory.
    fn add(&mut self, request: Request, bytes: u64) -> Result<Loaded, Problem> {
        #[cfg(feature = "oiio")]
        if let Encoded::File(path) = request.encoded
            && self.budget.decoder != Decoder::Crates
        {
            let format = request.encoded.format(self.budget.decoder)?;
            if stores_the_image(request.encoded, &format)? {
                let mut reader = open(request.encoded, &format)?;
                if let Some(shift) = tile_shift(reader.info()) {
                    return self.add_tiled(request, (path, &format), &mut reader, shift);
                }
            }
        }
        if bytes > self.budget.bytes {
            let problem = format!(
                "expected an image that fits into --texture-memory ({} MB) or is stored in tiles, found {} MB of \
                 texels in scan lines; convert it with maketx or raise --texture-memory",
                self.budget.bytes >> 20,
                bytes >> 20
            );
            return Err(problem.into());
        }
        let image = decode(request.encoded, self.budget.decoder)?;
        let mut loaded = [None, None];
        for (place, color_space) in loaded.iter_mut().zip(request.color_spaces) {
            let Some(color_space) = color_space else { continue };
            *place = Some(self.copied(request, &image, color_space)?);
        }
        Ok(loaded)
    }

    /// A copy of an image in memory and its levels, as look-ups read them.
    fn copied(&mut self, request: Request, image: &Image, color_space: ColorSpace) -> Result<Image, Problem> {
        let (width, height) = (image.width, image.height);
        let mut scan = Scan::default();
        let mut levels = Vec::new();
        image.levels_in(color_space, |width, height, part| {
            let is_first = levels.is_empty();
            let look = |rows: &Rows| {
                if is_first {
                    scan.add(rows);
                }
            };
            levels.push(self.tiles.copy((width, height), part, look)?);
            Ok::<_, Error>(())
        })?;
        let eight_bits = matches!(image.texels, Texels::Eight(_));
        let stored = Stored {
            tiles: self.tiles.clone(),
            name: request.name.into(),
            number: self.count,
            levels,
            eight_bits,
            encoded: false,
            scan,
        };
        self.count += 1;
        Ok(Image { width, height, texels: Texels::Stored(Arc::new(stored)), integers: image.integers })
    }

    /// A file whose tiles are read where they are. Levels that it lacks are copies.
    #[cfg(feature = "oiio")]
    fn add_tiled(
        &mut self,
        request: Request,
        (path, format): (&Path, &Format),
        reader: &mut Reader,
        shift: (u32, u32),
    ) -> Result<Loaded, Problem> {
        let info = reader.info().clone();
        let file = self.tiles.files().add(path.into(), format.clone(), info.clone());
        let mut scans = request.color_spaces.map(|color_space| color_space.map(|_| Scan::default()));
        let mut levels = Vec::new();
        for (number, &(width, height)) in info.levels.iter().enumerate() {
            let mut level = Level::of_file((width, height), shift, file.clone());
            for first in (0..height).step_by(1 << shift.1) {
                let rows = first..(first + (1 << shift.1)).min(height);
                let mut strip = reader.read(number, rows).map_err(|reason| broken(format, &reason))?;
                if let Rows::Float(texels) = &strip {
                    not_finite(texels, width, first).map_or(Ok(()), Err)?;
                }
                level.cut(&strip);
                if number > 0 {
                    continue;
                }
                let spaces = scans.iter_mut().zip(request.color_spaces);
                // Data before colours, which are decoded in place.
                for (scan, color_space) in spaces.rev() {
                    let (Some(scan), Some(color_space)) = (scan, color_space) else { continue };
                    strip.decode(info.integers && color_space == ColorSpace::Srgb);
                    scan.add(&strip);
                }
            }
            levels.push(level);
        }
        let mut loaded = [None, None];
        for (i, place) in loaded.iter_mut().enumerate() {
            let (Some(color_space), Some(scan)) = (request.color_spaces[i], scans[i].take()) else { continue };
            let mut levels = levels.clone();
            levels.extend(self.missing_levels(reader, &info, color_space)?);
            let encoded = info.integers && color_space == ColorSpace::Srgb;
            let (width, height) = info.levels[0];
            let stored = Stored {
                tiles: self.tiles.clone(),
                name: request.name.into(),
                number: self.count,
                levels,
                eight_bits: info.eight_bits,
                encoded,
                scan,
            };
            self.count += 1;
            let texels = Texels::Stored(Arc::new(stored));
            *place = Some(Image { width, height, texels, integers: info.integers });
        }
        Ok(loaded)
    }

    /// Copies of the levels below the last one of a tiled file.
    #[cfg(feature = "oiio")]
    fn missing_levels(&self, reader: &mut Reader, info: &Info, color_space: ColorSpace) -> Result<Vec<Level>, Problem> {
        let number = info.levels.len() - 1;
        let size = info.levels[number];
        if size.0.max(size.1) <= 1 {
            return Ok(Vec::new());
        }
        let bytes = (size.0 as u64 * size.1 as u64) / 4 * if info.eight_bits { 4 } else { 16 };
        if bytes > self.budget.bytes {
            let problem = format!(
                "expected its coarser levels in the file, or such that fit into --texture-memory ({} MB), found {} MB; \
                 convert it with maketx or raise --texture-memory",
                self.budget.bytes >> 20,
                bytes >> 20
            );
            return Err(problem.into());
        }
        let tile_rows = info.tile.map_or(1, |(_, rows)| rows as usize);
        let encoded = info.integers && color_space == ColorSpace::Srgb;
        let mut rows = |rows: std::ops::Range<usize>| {
            let begin = rows.start / tile_rows * tile_rows;
            let end = rows.end.next_multiple_of(tile_rows).min(size.1);
            let mut read = reader.read(number, begin..end)?;
            read.decode(encoded);
            Ok::<_, String>(read.part((rows.start - begin) * size.0..(rows.end - begin) * size.0))
        };
        let of_kind = || "texels of another kind".to_owned();
        let image = if info.eight_bits {
            let eight = |range| rows(range)?.into_eight().ok_or_else(of_kind);
            let (width, height, texels) = halved_from(size, EightBits(color_space), eight)?;
            Image { width, height, texels: texels.into(), integers: info.integers }
        } else {
            let float = |range| rows(range)?.into_float().ok_or_else(of_kind);
            let (width, height, texels) = halved_from(size, Floats, float)?;
            // Decoded by now.
            Image { width, height, texels: texels.into(), integers: false }
        };
        let mut levels = Vec::new();
        image.levels_in(color_space, |width, height, part| {
            levels.push(self.tiles.copy((width, height), part, |_| {})?);
            Ok::<_, Error>(())
        })?;
        Ok(levels)
    }
}

/// Columns and rows of the tiles of a file as powers of two, if they are such that look-ups read them where they are.
#[cfg(feature = "oiio")]
fn tile_shift(info: &Info) -> Option<(u32, u32)> {
    /// Texels of the largest such tile: a megabyte, or four.
    const MOST: u32 = 1 << 18;
    let (columns, rows) = info.tile?;
    let tiles = info.levels[0].0.div_ceil(columns.max(1) as usize) * info.levels[0].1.div_ceil(rows.max(1) as usize);
    let fits = columns.is_power_of_two() && rows.is_power_of_two() && columns.checked_mul(rows)? <= MOST;
    (fits && columns >= 16 && rows >= 16 && tiles <= u32::MAX as usize)
        .then(|| (columns.trailing_zeros(), rows.trailing_zeros()))
}
