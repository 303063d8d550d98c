//! Declarations of the shim over the installed OpenImageIO (`shim.h`, where each function is described). No policy, no
//! wrapper: the safe layer is `pathspace::texture::oiio`.

use std::ffi::{c_char, c_int, c_void};

/// Most levels of a pyramid.
pub const LEVELS: usize = 24;

/// `pathspace_oiio_info`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Info {
    /// Channels in the file.
    pub channels: u32,
    /// 0: 8 bits, 1: integers of 16 bits, 2: half, 3: float and all else.
    pub kind: u32,
    /// 0 where the file is stored by scan lines.
    pub tile_width: u32,
    /// The same.
    pub tile_height: u32,
    /// Levels, 1 at least.
    pub levels: u32,
    /// Of each level.
    pub width: [u32; LEVELS],
    /// Of each level.
    pub height: [u32; LEVELS],
    /// OpenImageIO's name of the format, ends in 0.
    pub format: [c_char; 32],
}

/// `pathspace_oiio_texel`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Texel {
    /// Level of the pyramid, 0 is the image.
    pub level: u32,
    /// Column.
    pub x: u32,
    /// Row from the top.
    pub y: u32,
}

/// `pathspace_oiio_stats`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct Stats {
    /// Texels asked for.
    pub requests: u64,
    /// Tiles read from their files.
    pub tile_misses: u64,
    /// Texels served without reading.
    pub tile_hits: u64,
    /// Bytes held.
    pub bytes: u64,
    /// Most bytes held.
    pub peak_bytes: u64,
    /// Seconds of waiting for files, over all threads.
    pub read_seconds: f64,
}

// The same numbers are asserted in shim.cpp.
const _: () = assert!(size_of::<Info>() == 244 && size_of::<Texel>() == 12 && size_of::<Stats>() == 48);

/// An open image.
#[repr(C)]
pub struct Reader {
    _private: [u8; 0],
}

/// A tile cache.
#[repr(C)]
pub struct Cache {
    _private: [u8; 0],
}

#[allow(missing_docs)] // See shim.h.
unsafe extern "C" {
    pub fn pathspace_oiio_version(version: *mut c_char, version_size: usize, file: *mut c_char, file_size: usize);
    pub fn pathspace_oiio_open(
        name: *const c_char,
        format: *const c_char,
        bytes: *const c_void,
        size: usize,
        reader: *mut *mut Reader,
        info: *mut Info,
        error: *mut c_char,
        error_size: usize,
    ) -> c_int;
    pub fn pathspace_oiio_read(
        reader: *mut Reader,
        level: u32,
        begin: u32,
        end: u32,
        texels: *mut c_void,
        error: *mut c_char,
        error_size: usize,
    ) -> c_int;
    pub fn pathspace_oiio_close(reader: *mut Reader);
    pub fn pathspace_oiio_write(
        path: *const c_char,
        info: *const Info,
        levels: *const *const c_void,
        error: *mut c_char,
        error_size: usize,
    ) -> c_int;
    pub fn pathspace_oiio_cache_new(max_bytes: u64) -> *mut Cache;
    pub fn pathspace_oiio_cache_add(
        cache: *mut Cache,
        path: *const c_char,
        image: *mut u32,
        error: *mut c_char,
        error_size: usize,
    ) -> c_int;
    pub fn pathspace_oiio_texels(
        cache: *mut Cache,
        image: u32,
        count: usize,
        wanted: *const Texel,
        texels: *mut c_void,
        error: *mut c_char,
        error_size: usize,
    ) -> c_int;
    pub fn pathspace_oiio_cache_stats(cache: *mut Cache, stats: *mut Stats);
    pub fn pathspace_oiio_cache_free(cache: *mut Cache);
}
