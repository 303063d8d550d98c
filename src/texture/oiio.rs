//! The safe side of OpenImageIO: readers of image files, a writer of tiled ones, and a tile cache with a memory limit.
//! Messages are the library's own, on one line.

use std::ffi::{CStr, CString, c_char, c_int};
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::ptr::{self, NonNull};

use pathspace_oiio_sys as sys;

use super::Rows;

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
    /// Rows of a tile; `None` where the file is stored by scan lines.
    pub tile_rows: Option<u32>,
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
            // SAFETY: the strings end in 0 and live through the call; the bytes live as long as the reader, by its lifetime;
            // the other pointers are to variables of this frame.
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
    pub fn read(&mut self, level: usize, rows: std::ops::Range<usize>) -> Result<Rows, String> {
        let (width, height) = *self.info.levels.get(level).ok_or("no such level")?;
        if rows.start > rows.end || rows.end > height {
            return Err(format!("expected rows of {height}, found {rows:?}"));
        }
        let texels = width * rows.len();
        let (mut eight, mut float) = (Vec::new(), Vec::new());
        let place = if self.info.eight_bits {
            eight.resize(texels, [0u8; 4]);
            eight.as_mut_ptr().cast()
        } else {
            float.resize(texels, [0f32; 4]);
            float.as_mut_ptr().cast()
        };
        call(|message, size| {
            // SAFETY: the reader is open; `place` has room for the texels of these rows, checked against the header above:
            // the shim refuses a level whose size is not the header's.
            unsafe {
                (self.api.read)(
                    self.raw.as_ptr(),
                    level as u32,
                    rows.start as u32,
                    rows.end as u32,
                    place,
                    message,
                    size,
                )
            }
        })?;
        Ok(if self.info.eight_bits { Rows::Eight(eight) } else { Rows::Float(float) })
    }
}

impl Drop for Reader<'_> {
    fn drop(&mut self) {
        // SAFETY: opened in `open`, closed here alone.
        unsafe { (self.api.close)(self.raw.as_ptr()) }
    }
}

/// Writes levels (columns, rows, texels; all of one kind) as a tiled TIFF without compression.
pub fn write_tiled(path: &Path, levels: &[(usize, usize, &Rows)]) -> Result<(), String> {
    let api = sys::api()?;
    let path = c_string(path.as_os_str().as_bytes())?;
    let mut info = EMPTY;
    let mut places = Vec::new();
    if levels.is_empty() || levels.len() > sys::LEVELS {
        return Err(format!("expected 1 to {} levels, found {}", sys::LEVELS, levels.len()));
    }
    info.levels = levels.len() as u32;
    for (level, &(width, height, rows)) in levels.iter().enumerate() {
        (info.width[level], info.height[level]) = (width as u32, height as u32);
        let (kind, texels, place) = match rows {
            Rows::Eight(texels) => (0, texels.len(), texels.as_ptr().cast()),
            Rows::Float(texels) => (3, texels.len(), texels.as_ptr().cast()),
        };
        if texels != width * height || (level > 0 && kind != info.kind) {
            return Err(format!("expected {width} × {height} texels of one kind, found {texels}"));
        }
        info.kind = kind;
        places.push(place);
    }
    call(|message, size| {
        // SAFETY: `places` has as many pointers as `info.levels` says, each to the texels of its level, as checked above.
        unsafe { (api.write)(path.as_ptr(), &info, places.as_ptr(), message, size) }
    })
}

/// Tiles of files, held up to a limit. Any number of threads may look into it.
pub struct Cache {
    api: &'static sys::Api,
    raw: NonNull<sys::Cache>,
}

impl std::fmt::Debug for Cache {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_tuple("Cache").field(&self.raw).finish()
    }
}

// SAFETY: the shim's functions on a cache, but for `add` (which takes `&mut self`) and the end, may be called by any number of
// threads at once, and any thread may end it.
unsafe impl Send for Cache {}
// SAFETY: see above.
unsafe impl Sync for Cache {}

/// The texel of a level.
pub use sys::Texel;

impl Cache {
    /// An empty one that holds at most `max_bytes` (OpenImageIO takes 10 MB for anything less).
    pub fn new(max_bytes: u64) -> Result<Self, String> {
        let api = sys::api()?;
        // SAFETY: no pointers.
        let raw = unsafe { (api.cache_new)(max_bytes) };
        NonNull::new(raw).map(|raw| Cache { api, raw }).ok_or_else(|| "no memory for a texture cache".into())
    }

    /// Adds a tiled file; its number.
    pub fn add(&mut self, path: &Path) -> Result<u32, String> {
        let path = c_string(path.as_os_str().as_bytes())?;
        let mut image = 0;
        call(|message, size| {
            // SAFETY: the cache lives; the path ends in 0.
            unsafe { (self.api.cache_add)(self.raw.as_ptr(), path.as_ptr(), &mut image, message, size) }
        })?;
        Ok(image)
    }

    /// Texels of an image of 8 bits.
    pub fn eight<const N: usize>(&self, image: u32, wanted: &[Texel; N]) -> Result<[[u8; 4]; N], String> {
        let mut texels = [[0; 4]; N];
        self.texels(image, wanted, texels.as_mut_ptr().cast())?;
        Ok(texels)
    }

    /// Texels of any other image.
    pub fn float<const N: usize>(&self, image: u32, wanted: &[Texel; N]) -> Result<[[f32; 4]; N], String> {
        let mut texels = [[0.0; 4]; N];
        self.texels(image, wanted, texels.as_mut_ptr().cast())?;
        Ok(texels)
    }

    /// `texels` has room for as many as are wanted of the image's kind: the callers above are called by
    /// [`Stored`](super::stored::Stored), which knows the kind from the header.
    fn texels(&self, image: u32, wanted: &[Texel], texels: *mut std::ffi::c_void) -> Result<(), String> {
        call(|message, size| {
            // SAFETY: the cache lives; `wanted` is as long as said; `texels` has room, see above.
            unsafe { (self.api.texels)(self.raw.as_ptr(), image, wanted.len(), wanted.as_ptr(), texels, message, size) }
        })
    }

    /// What it has done so far.
    pub fn stats(&self) -> sys::Stats {
        let mut stats = sys::Stats::default();
        // SAFETY: the cache lives; `stats` is of this frame.
        unsafe { (self.api.cache_stats)(self.raw.as_ptr(), &mut stats) };
        stats
    }
}

impl Drop for Cache {
    fn drop(&mut self) {
        // SAFETY: made in `new`, ended here alone; threads that still hold tiles keep what they need of it.
        unsafe { (self.api.cache_free)(self.raw.as_ptr()) }
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
        tile_rows: (info.tile_height > 0).then_some(info.tile_height),
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
