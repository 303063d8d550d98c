//! The safe side of OpenImageIO: readers of image files. Messages are the library's own, on one line.

use std::ffi::{CStr, CString, c_char, c_int};
use std::ops::Range;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::ptr::{self, NonNull};

use pathspace_oiio_sys as sys;

use super::plane::Rows;

/// Bytes of the longest message.
const MESSAGE: usize = 1024;

/// The library that runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Version {
    /// "2.4.7".
    pub number: String,
    /// The shared library it was loaded from.
    pub file: String,
}

/// What a header says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Info {
    /// OpenImageIO's name of the format.
    pub format: String,
    /// 8 bits a channel; else texels come as floats.
    pub eight_bits: bool,
    /// Integers, so that colours are encoded by the sRGB curve.
    pub integers: bool,
    /// Channels in the file.
    pub channels: u32,
    /// Columns and rows of a tile, of every level; `None` where the file is stored by scan lines.
    pub tile: Option<(u32, u32)>,
    /// Columns and rows of each level, the image first.
    pub levels: Vec<(usize, usize)>,
}

/// Which library runs.
///
/// # Errors
/// What the dynamic linker says where it does not load.
pub fn version() -> Result<Version, String> {
    let api = sys::api()?;
    let (mut number, mut file) = ([0 as c_char; 64], [0 as c_char; MESSAGE]);
    // SAFETY: both buffers are as long as said; the function writes strings that end in 0 into them.
    unsafe { (api.version)(number.as_mut_ptr(), number.len(), file.as_mut_ptr(), file.len()) };
    Ok(Version { number: text(&number), file: text(&file) })
}

/// Loads the library, if that has not been done.
///
/// # Errors
/// As [`version`].
pub(super) fn ready() -> Result<(), String> {
    sys::api().map(|_| ())
}

/// An open image. `'b` is the life of the bytes it may read from.
pub struct Reader<'b> {
    api: &'static sys::Api,
    raw: NonNull<sys::Reader>,
    info: Info,
    _bytes: std::marker::PhantomData<&'b [u8]>,
}

impl<'b> Reader<'b> {
    /// Opens a file, or `bytes`, as an image of `format` (an extension without its dot).
    pub fn open(path: &Path, format: &str, bytes: Option<&'b [u8]>) -> Result<Self, String> {
        let api = sys::api()?;
        let (path, format) = (c_string(path.as_os_str().as_bytes())?, c_string(format.as_bytes())?);
        let (data, size) = bytes.map_or((ptr::null(), 0), |bytes| (bytes.as_ptr().cast(), bytes.len()));
        let mut raw = ptr::null_mut();
        let mut info = EMPTY;
        call(|message, size_of_message| {
            // SAFETY: the strings end in 0 and live through the call; the bytes live as long as the reader, by its
            // lifetime; the other pointers are to variables of this frame.
            unsafe {
                (api.open)(path.as_ptr(), format.as_ptr(), data, size, &mut raw, &mut info, message, size_of_message)
            }
        })?;
        let raw = NonNull::new(raw).ok_or("no reader was returned")?;
        Ok(Reader { api, raw, info: described(&info), _bytes: std::marker::PhantomData })
    }

    /// What the header says.
    pub fn info(&self) -> &Info {
        &self.info
    }

    /// Rows of a level. In a tiled file `rows` begins at a multiple of the tile's rows and ends at one or at the end.
    pub(super) fn read(&mut self, level: usize, rows: Range<usize>) -> Result<Rows, String> {
        let (width, _) = *self.info.levels.get(level).ok_or("no such level")?;
        let mut texels = if self.info.eight_bits { Rows::Eight(Vec::new()) } else { Rows::Float(Vec::new()) };
        let count = width.checked_mul(rows.len()).ok_or("more texels than there are numbers")?;
        texels.try_reserve(count).map_err(|()| format!("no memory for {count} texels"))?;
        texels.resize(count);
        self.read_into(level, 0..width, rows, &mut texels)?;
        Ok(texels)
    }

    /// An area of a level, which fills `texels`. In a tiled file it begins and ends at edges of tiles or of the level;
    /// in any other, columns are all.
    pub(super) fn read_into(
        &mut self,
        level: usize,
        columns: Range<usize>,
        rows: Range<usize>,
        texels: &mut Rows,
    ) -> Result<(), String> {
        let (width, height) = *self.info.levels.get(level).ok_or("no such level")?;
        if rows.start > rows.end || rows.end > height || columns.start > columns.end || columns.end > width {
            return Err(format!("expected texels of {width} × {height}, found {columns:?}, {rows:?}"));
        }
        let count = columns.len() * rows.len();
        let place = match texels {
            Rows::Eight(texels) if self.info.eight_bits && texels.len() == count => texels.as_mut_ptr().cast(),
            Rows::Float(texels) if !self.info.eight_bits && texels.len() == count => texels.as_mut_ptr().cast(),
            _ => return Err("texels of another kind or number".into()),
        };
        let area = [columns.start, columns.end, rows.start, rows.end].map(|edge| edge as u32);
        call(|message, size| {
            // SAFETY: the reader is open; `place` has room for the texels of this area, of the header's kind, checked
            // above: the shim refuses a level that is not as the header said.
            unsafe { (self.api.read)(self.raw.as_ptr(), level as u32, area.as_ptr(), place, message, size) }
        })
    }
}

// SAFETY: a reader of OpenImageIO belongs to no thread; `&mut self` keeps calls apart.
unsafe impl Send for Reader<'_> {}

impl Drop for Reader<'_> {
    fn drop(&mut self) {
        // SAFETY: opened in `open`, closed here alone.
        unsafe { (self.api.close)(self.raw.as_ptr()) }
    }
}

const EMPTY: sys::Info = sys::Info {
    channels: 0,
    kind: 0,
    tile_width: 0,
    tile_height: 0,
    levels: 0,
    width: [0; sys::LEVELS],
    height: [0; sys::LEVELS],
    format: [0; 32],
};

fn described(info: &sys::Info) -> Info {
    let levels = (info.levels as usize).clamp(1, sys::LEVELS);
    Info {
        format: text(&info.format),
        eight_bits: info.kind == 0,
        integers: info.kind <= 1,
        channels: info.channels,
        tile: (info.tile_height > 0).then_some((info.tile_width, info.tile_height)),
        levels: (0..levels).map(|level| (info.width[level] as usize, info.height[level] as usize)).collect(),
    }
}

/// Calls a function that fails with a message.
fn call(function: impl FnOnce(*mut c_char, usize) -> c_int) -> Result<(), String> {
    // Not cleared: a lookup that succeeds must not pay for it. The shim ends what it writes.
    let mut message = std::mem::MaybeUninit::<[c_char; MESSAGE]>::uninit();
    match function(message.as_mut_ptr().cast(), MESSAGE) {
        0 => Ok(()),
        _ => {
            // SAFETY: a function that fails has written a string that ends in 0 within the buffer.
            let found = unsafe { CStr::from_ptr(message.as_ptr().cast()) }.to_string_lossy();
            let lines: Vec<&str> = found.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
            Err(lines.join("; "))
        }
    }
}

fn text(buffer: &[c_char]) -> String {
    let bytes: Vec<u8> = buffer.iter().take_while(|&&c| c != 0).map(|&c| c as u8).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}

fn c_string(bytes: &[u8]) -> Result<CString, String> {
    CString::new(bytes).map_err(|_| "expected a path, found a NUL byte".into())
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::texture::ColorSpace;
    use crate::texture::decode::Encoded;
    use crate::texture::load::{Budget, Request, load};
    use crate::texture::{Texels, Texture, Wrap, lookup};

    /// The seeds of the fuzzer whose formats are read here: an image in the ways that they can store it. Not a TGA with
    /// a colour map and hostile ones, which are refused; nor JPEG in tiles, which OpenImageIO 2.4.7 writes and cannot
    /// read again.
    fn seeds() -> Vec<(PathBuf, String)> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds/images");
        let mut all: Vec<_> = std::fs::read_dir(&folder)
            .expect("the seeds")
            .map(|entry| entry.expect("a seed").path())
            .filter_map(|path| Some((path.extension()?.to_str()?.to_owned(), path)))
            .filter(|(end, _)| ["exr", "tif", "tx", "hdr", "tga", "dpx"].contains(&end.as_str()))
            .filter(|(_, path)| !["tiled-jpeg.tif", "palette.tga"].iter().any(|name| path.ends_with(name)))
            .filter(|(_, path)| !path.to_string_lossy().contains("hostile-"))
            .map(|(end, path)| (path, if end == "tx" { "tif".into() } else { end }))
            .collect();
        all.sort();
        all
    }

    /// All texels of a level, row of tiles by row of tiles.
    fn level_of(reader: &mut Reader, level: usize) -> Result<Rows, String> {
        let (_, height) = reader.info().levels[level];
        let step = reader.info().tile.map_or(5, |(_, rows)| rows as usize);
        let mut all = if reader.info().eight_bits { Rows::Eight(Vec::new()) } else { Rows::Float(Vec::new()) };
        for first in (0..height).step_by(step) {
            all.extend(&reader.read(level, first..(first + step).min(height))?);
        }
        Ok(all)
    }

    /// Oracle: an image is the same from a file, from memory and tile by tile, and has as many texels as its header
    /// says. What is cut off or altered is read or refused, on one line. (The part `memory` of .ci/run runs this under
    /// valgrind: nothing beyond a buffer is read or written, and no texel is what memory happened to hold.)
    #[test]
    fn images_are_the_same_from_files_memory_and_tiles() {
        let (mut read, mut from_memory, mut in_tiles) = (0, 0, 0);
        for (path, format) in seeds() {
            let mut reader = Reader::open(&path, &format, None).unwrap_or_else(|line| panic!("{path:?}: {line}"));
            let info = reader.info().clone();
            let levels: Vec<Rows> = (0..info.levels.len())
                .map(|level| level_of(&mut reader, level).unwrap_or_else(|line| panic!("{path:?}: {line}")))
                .collect();
            let bytes = std::fs::read(&path).expect("a seed");
            if let Ok(mut reader) = Reader::open(Path::new("memory"), &format, Some(&bytes)) {
                assert_eq!(reader.info(), &info);
                let level = level_of(&mut reader, 0).unwrap_or_else(|line| panic!("{path:?}: {line}"));
                assert!(level == levels[0], "{path:?}");
                from_memory += 1;
            }
            for (number, (&(width, height), texels)) in info.levels.iter().zip(&levels).enumerate() {
                let texel_bytes = if info.eight_bits { 4 } else { 16 };
                assert_eq!(texels.bytes(), (width * height * texel_bytes) as u64, "{path:?}");
                let Some((across, down)) = info.tile else { continue };
                for (left, top) in (0..height)
                    .step_by(down as usize)
                    .flat_map(|top| (0..width).step_by(across as usize).map(move |left| (left, top)))
                {
                    let columns = left..(left + across as usize).min(width);
                    let rows = top..(top + down as usize).min(height);
                    let mut tile = texels.empty();
                    tile.resize(columns.len() * rows.len());
                    reader.read_into(number, columns.clone(), rows.clone(), &mut tile).expect("a tile");
                    let strip = texels.part(rows.start * width..rows.end * width);
                    assert!(tile == strip.columns(width, columns), "{path:?}");
                    in_tiles += 1;
                }
            }
            read += 1;

            let line = |problem: String| assert!(!problem.contains('\n'), "{problem}");
            let mut altered = bytes.clone();
            for place in [bytes.len() / 3, bytes.len() / 2, bytes.len() - 9] {
                altered[place] ^= 0x55;
            }
            for bytes in [&bytes[..bytes.len() / 2], &altered] {
                match Reader::open(Path::new("memory"), &format, Some(bytes)) {
                    Ok(mut reader) => level_of(&mut reader, 0).map_or_else(line, |_| ()),
                    Err(problem) => line(problem),
                }
            }
        }
        assert!(read > 55 && from_memory > 30 && in_tiles > 30, "{read}, {from_memory}, {in_tiles}");
    }

    /// Oracle: look-ups through the tile cache give what look-ups in memory give. From several threads.
    #[test]
    fn tiles_through_the_cache_are_the_image() {
        let mut stored = 0;
        for (path, _) in seeds().into_iter().filter(|(path, _)| path.to_string_lossy().contains("pyramid")) {
            let request =
                Request { encoded: Encoded::File(&path), color_spaces: [Some(ColorSpace::Srgb), None], name: "a seed" };
            let of = |bytes: u64| {
                let all = load(&[request], Budget { bytes, ..Budget::default() }, false);
                let image = all.into_iter().next().expect("one image").expect("a valid image")[0].take();
                let image = image.expect("the one that was asked for");
                Texture {
                    name: String::new(),
                    width: image.width,
                    height: image.height,
                    texels: image.texels,
                    color_space: ColorSpace::Srgb,
                    wrap_u: Wrap::Repeat,
                    wrap_v: Wrap::Repeat,
                    bilinear: true,
                }
            };
            let (held, kept) = (of(1 << 20), of(1));
            stored += usize::from(matches!(kept.texels, Texels::Stored(_)));
            std::thread::scope(|scope| {
                for thread in 0..2 {
                    let (held, kept) = (&held, &kept);
                    scope.spawn(move || {
                        for i in 0..200 {
                            let uv = glam::Vec2::new(0.037 * (i + 100 * thread) as f32, 0.091 * i as f32);
                            assert_eq!(lookup(held, uv), lookup(kept, uv), "{uv}");
                        }
                    });
                }
            });
        }
        assert!(stored > 1, "{stored}");
    }
}
