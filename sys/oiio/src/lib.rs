//! Declarations of the shim over the installed OpenImageIO (`shim.h`, where each function is described). No policy, no
//! wrapper: the safe layer is `pathspace::texture::oiio`. The shim is carried in the binary and opened from memory when
//! it is first asked for, so that a render without images does not load OpenImageIO.

use std::ffi::{CStr, CString, c_char, c_int, c_uint, c_void};
use std::fs::File;
use std::io::Write;
use std::os::fd::{AsRawFd, FromRawFd};
use std::sync::OnceLock;

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

// The same number is asserted in shim.cpp.
const _: () = assert!(size_of::<Info>() == 244);

/// An open image.
#[repr(C)]
pub struct Reader {
    _private: [u8; 0],
}

/// The shim, compiled: a shared library.
static SHIM: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/shim.so"));

/// The functions of the shim; `shim.h` describes each.
#[allow(missing_docs)]
pub struct Api {
    pub version: unsafe extern "C" fn(version: *mut c_char, version_size: usize, file: *mut c_char, file_size: usize),
    pub open: unsafe extern "C" fn(
        name: *const c_char,
        format: *const c_char,
        bytes: *const c_void,
        size: usize,
        reader: *mut *mut Reader,
        info: *mut Info,
        error: *mut c_char,
        error_size: usize,
    ) -> c_int,
    pub read: unsafe extern "C" fn(
        reader: *mut Reader,
        level: u32,
        area: *const u32,
        texels: *mut c_void,
        error: *mut c_char,
        error_size: usize,
    ) -> c_int,
    pub close: unsafe extern "C" fn(reader: *mut Reader),
}

/// The shim, opened with OpenImageIO and all that it brings along at the first call.
///
/// # Errors
/// The dynamic linker's message where a library is missing.
pub fn api() -> Result<&'static Api, String> {
    static API: OnceLock<Result<Api, String>> = OnceLock::new();
    API.get_or_init(Api::open).as_ref().map_err(Clone::clone)
}

unsafe extern "C" {
    fn dlopen(file: *const c_char, flags: c_int) -> *mut c_void;
    fn dlsym(library: *mut c_void, name: *const c_char) -> *mut c_void;
    fn dlerror() -> *const c_char;
    fn memfd_create(name: *const c_char, flags: c_uint) -> c_int;
}

impl Api {
    fn open() -> Result<Self, String> {
        const RTLD_NOW: c_int = 2;
        const MFD_CLOEXEC: c_uint = 1;
        // SAFETY: the name ends in 0; a descriptor that is not negative is new and unshared.
        let mut file = unsafe {
            let descriptor = memfd_create(c"pathspace_oiio".as_ptr(), MFD_CLOEXEC);
            if descriptor < 0 {
                return Err(format!("no file in memory: {}", std::io::Error::last_os_error()));
            }
            File::from_raw_fd(descriptor)
        };
        file.write_all(SHIM).map_err(|problem| format!("no file in memory: {problem}"))?;
        let path = CString::new(format!("/proc/self/fd/{}", file.as_raw_fd())).expect("digits and letters");
        // SAFETY: the path ends in 0; the library is our own shim, whose initialisers are OpenImageIO's. It stays open.
        let library = unsafe { dlopen(path.as_ptr(), RTLD_NOW) };
        if library.is_null() {
            return Err(problem());
        }
        // SAFETY: each symbol is the function of that signature, as shim.h declares it.
        unsafe {
            Ok(Api {
                version: symbol(library, c"pathspace_oiio_version")?,
                open: symbol(library, c"pathspace_oiio_open")?,
                read: symbol(library, c"pathspace_oiio_read")?,
                close: symbol(library, c"pathspace_oiio_close")?,
            })
        }
    }
}

/// Address of a function.
///
/// # Safety
/// `F` is the type of that function.
unsafe fn symbol<F: Copy>(library: *mut c_void, name: &CStr) -> Result<F, String> {
    const { assert!(size_of::<F>() == size_of::<*mut c_void>()) };
    // SAFETY: the library is open; the name ends in 0.
    let address = unsafe { dlsym(library, name.as_ptr()) };
    if address.is_null() {
        return Err(problem());
    }
    // SAFETY: an address that is not 0, of the caller's type.
    Ok(unsafe { std::mem::transmute_copy(&address) })
}

/// What the dynamic linker says of this thread's last failure.
fn problem() -> String {
    // SAFETY: null, or a string that ends in 0 and lives until the next call.
    unsafe {
        let message = dlerror();
        if message.is_null() { "unknown".into() } else { CStr::from_ptr(message).to_string_lossy().into_owned() }
    }
}
