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
