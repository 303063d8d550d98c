//! All images of a scene within a budget of memory: which are held, and which stay in their files behind the tile cache.
//!
//! If all fit (with a third on top, for pyramids), all are held. Else the smallest are held, up to half of the budget, and the
//! cache gets three quarters of the rest (the library's readers have buffers of their own, and while it evicts it oversteps its
//! limit by up to a fifth). Those that stay and are not stored in tiles are copied, see `scratch`. The picture does not depend on
//! it, the speed does. Without OpenImageIO there is no cache: everything is held.

use std::path::{Path, PathBuf};
#[cfg(feature = "oiio")]
use std::sync::Arc;

use rayon::prelude::*;

use super::ColorSpace;
#[cfg(feature = "oiio")]
use super::Texels;
use super::decode::{Decoder, Encoded, Image, decode, inspect};
#[cfg(feature = "oiio")]
use super::stored::Tiles;

/// Default of [`Budget::bytes`]: 4 GiB.
pub const DEFAULT_BYTES: u64 = 4 << 30;

/// Least of [`Budget::bytes`]: what OpenImageIO's cache takes at least, twice.
pub const LEAST_BYTES: u64 = 24 << 20;

/// What may be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Bytes of decoded texels, held and cached together.
    pub bytes: u64,
    /// Who decodes.
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
}

/// A loaded image: of each colour space that was asked for.
pub type Loaded = [Option<Image>; 2];

/// What was loaded, in the order of the requests.
pub struct Images {
    /// The images, or what is wrong with them.
    pub images: Vec<Result<Loaded, String>>,
    /// Bytes by which the held texels exceed the budget, for want of a cache.
    pub excess_bytes: u64,
}

/// The `.tx` beside an image file, if there is one: the same image in tiles with its pyramid.
pub fn beside(path: &Path) -> Option<PathBuf> {
    let tx = path.with_extension("tx");
    (cfg!(feature = "oiio") && tx != path && tx.is_file()).then_some(tx)
}

/// Loads images within a budget.
pub fn load(requests: &[Request], budget: Budget) -> Images {
    let headers: Vec<_> = requests.par_iter().map(|request| inspect(request.encoded, budget.decoder)).collect();
    // A header that is broken costs nothing; its error is reported by the decoder.
    let size = |i: usize| headers[i].as_ref().map_or(0, |header| header.bytes + header.bytes / 3);
    let all: u64 = (0..requests.len()).map(size).sum();
    let cached = cfg!(feature = "oiio") && budget.decoder == Decoder::Default && all > budget.bytes;
    let mut held = vec![true; requests.len()];
    let mut held_bytes = all;
    if cached {
        let mut order: Vec<usize> = (0..requests.len()).collect();
        order.sort_by_key(|&i| (size(i), i));
        held_bytes = 0;
        for i in order {
            held[i] = held_bytes + size(i) <= budget.bytes / 2;
            held_bytes += if held[i] { size(i) } else { 0 };
        }
    }
    let decoded: Vec<Option<Result<Loaded, String>>> = (requests.par_iter().zip(&headers).enumerate())
        .map(|(i, (request, header))| {
            if let Err(problem) = header {
                return Some(Err(problem.clone()));
            }
            held[i].then(|| {
                let image = decode(request.encoded, budget.decoder)?;
                let of = |color_space: ColorSpace| Image { texels: image.texels_in(color_space), ..image.clone() };
                Ok(request.color_spaces.map(|color_space| color_space.map(of)))
            })
        })
        .collect();
    let mut images = Images { images: Vec::new(), excess_bytes: 0 };
    #[cfg(feature = "oiio")]
    if cached {
        let mut store = Store::new((budget.bytes - held_bytes) / 4 * 3, budget.bytes);
        let all = decoded.into_iter().enumerate();
        images.images = all
            .map(|(i, image)| match (image, &mut store) {
                (Some(image), _) => image,
                (None, Ok(store)) => store.add(i, requests[i], size(i)),
                (None, Err(problem)) => Err(problem.clone()),
            })
            .collect();
        if let Ok(store) = store {
            store.tiles.set(store.cache);
        }
        return images;
    }
    images.excess_bytes = held_bytes.saturating_sub(budget.bytes);
    images.images = decoded.into_iter().flatten().collect();
    images
}

/// The images that stay in files.
#[cfg(feature = "oiio")]
struct Store {
    tiles: Arc<Tiles>,
    cache: super::oiio::Cache,
    budget: u64,
}

#[cfg(feature = "oiio")]
impl Store {
    fn new(cache_bytes: u64, budget: u64) -> Result<Self, String> {
        Ok(Store { tiles: Arc::default(), cache: super::oiio::Cache::new(cache_bytes)?, budget })
    }

    /// One image: looked at once, copied if need be, and put into the cache. `bytes` is what it would take in memory.
    fn add(&mut self, number: usize, request: Request, bytes: u64) -> Result<Loaded, String> {
        let format = request.encoded.format()?;
        let mut reader = super::decode::open(request.encoded, &format)?;
        let info = reader.info().clone();
        if let (Encoded::File(path), Some(_)) = (request.encoded, info.tile_rows) {
            let scan = super::stored::Scan::of_file(&mut reader, &format)?;
            let image = self.cache.add(path)?;
            let image = |_| self.image(image, &info, scan.clone());
            return Ok(request.color_spaces.map(|color_space| color_space.map(image)));
        }
        if bytes > self.budget {
            return Err(format!(
                "expected an image that fits into --texture-memory ({} MB) or is stored in tiles, found {} MB of texels in scan lines; \
                 convert it with maketx or raise --texture-memory",
                self.budget >> 20,
                bytes >> 20
            ));
        }
        let (width, height) = info.levels[0];
        let decoded = (width, height, super::decode::read_level(&mut reader, 0, &format)?);
        drop(reader);
        let scan = super::stored::Scan::of_rows(&decoded.2, info.integers);
        let mut loaded = [None, None];
        for (place, color_space) in loaded.iter_mut().zip(request.color_spaces) {
            let Some(color_space) = color_space else { continue };
            if self.tiles.scratch.get().is_none() {
                let _ = self.tiles.scratch.set(super::scratch::Scratch::new()?);
            }
            let scratch = self.tiles.scratch.get().ok_or("no folder for copies")?;
            let path = scratch.write(number, &decoded, color_space, info.integers)?;
            let copy = super::oiio::Reader::open(&path, "tiff", None)?.info().clone();
            let info = super::oiio::Info { integers: info.integers, ..copy };
            *place = Some((path, info));
        }
        // The copy in memory goes before the cache takes its place.
        drop(decoded);
        let mut images = [None, None];
        for (place, copy) in images.iter_mut().zip(loaded) {
            if let Some((path, info)) = copy {
                let image = self.cache.add(&path)?;
                *place = Some(self.image(image, &info, scan.clone()));
            }
        }
        Ok(images)
    }

    fn image(&self, image: u32, info: &super::oiio::Info, scan: super::stored::Scan) -> Image {
        let (width, height) = info.levels[0];
        let stored = super::stored::Stored {
            tiles: self.tiles.clone(),
            image,
            levels: info.levels.clone(),
            eight_bits: info.eight_bits,
            integers: info.integers,
            scan,
        };
        Image { width, height, texels: Texels::Stored(Arc::new(stored)), integers: info.integers }
    }
}
