//! Open Image Denoise 2, loaded at run time: a neural filter for noise. Nothing of it is needed to build, and nothing
//! is loaded before a picture is to be filtered. Source: its documentation, "API", and `oidn.h`.
//!
//! Found by the path that is given, else by [`VARIABLE`], else by the dynamic linker, else in Python's folders of
//! packages, where `pip install pyoidn` puts it. It runs on the processor. Its bits are its own: they may differ from
//! machine to machine and between versions, so what it makes has no part in the promise of equal bits.

use std::ffi::{CStr, c_char, c_int, c_void};
use std::fmt;
use std::path::{Path, PathBuf};
use std::ptr::{self, NonNull};

use libloading::Library;

use crate::error::{Error, Result};

/// Environment variable that names the library, or a folder that has it.
pub const VARIABLE: &str = "PATHSPACE_OIDN";

/// Name of the library; the number is that of its interface.
const FILE: &str = "libOpenImageDenoise.so.2";

/// Where it lies in a folder that is named.
const WITHIN: [&str; 3] = ["", "lib", "pyoidn/oidn/lib"];

/// `OIDN_DEVICE_TYPE_CPU`.
const CPU: c_int = 1;

/// `OIDN_FORMAT_FLOAT3`.
const FLOAT3: c_int = 3;

/// An `OIDNDevice`.
type Device = NonNull<c_void>;

/// An `OIDNFilter`.
type Filter = NonNull<c_void>;

/// The functions that are called, as `oidn.h` declares them.
struct Api {
    new_device: unsafe extern "C" fn(c_int) -> Option<Device>,
    set_device_bool: unsafe extern "C" fn(Device, *const c_char, bool),
    set_device_int: unsafe extern "C" fn(Device, *const c_char, c_int),
    get_device_int: unsafe extern "C" fn(Device, *const c_char) -> c_int,
    commit_device: unsafe extern "C" fn(Device),
    get_device_error: unsafe extern "C" fn(Option<Device>, *mut *const c_char) -> c_int,
    release_device: unsafe extern "C" fn(Device),
    new_filter: unsafe extern "C" fn(Device, *const c_char) -> Option<Filter>,
    set_shared_filter_image:
        unsafe extern "C" fn(Filter, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize),
    set_filter_bool: unsafe extern "C" fn(Filter, *const c_char, bool),
    commit_filter: unsafe extern "C" fn(Filter),
    execute_filter: unsafe extern "C" fn(Filter),
    release_filter: unsafe extern "C" fn(Filter),
    /// What the functions are in.
    _library: Library,
}

impl Api {
    fn load(file: &Path) -> std::result::Result<Self, libloading::Error> {
        // SAFETY: a library's initialisers run with this process's rights. It is the one that the user names, or one of
        // this name where the system or Python keeps libraries, which is trusted as they are.
        let library = unsafe { Library::new(file) }?;
        macro_rules! function {
            ($name:literal) => {
                // SAFETY: libraries of this name and number have the function with the type of the field, which is
                // that of the header; the library is kept as long as the pointer.
                *unsafe { library.get(concat!($name, "\0").as_bytes()) }?
            };
        }
        Ok(Api {
            new_device: function!("oidnNewDevice"),
            set_device_bool: function!("oidnSetDeviceBool"),
            set_device_int: function!("oidnSetDeviceInt"),
            get_device_int: function!("oidnGetDeviceInt"),
            commit_device: function!("oidnCommitDevice"),
            get_device_error: function!("oidnGetDeviceError"),
            release_device: function!("oidnReleaseDevice"),
            new_filter: function!("oidnNewFilter"),
            set_shared_filter_image: function!("oidnSetSharedFilterImage"),
            set_filter_bool: function!("oidnSetFilterBool"),
            commit_filter: function!("oidnCommitFilter"),
            execute_filter: function!("oidnExecuteFilter"),
            release_filter: function!("oidnReleaseFilter"),
            _library: library,
        })
    }

    /// The error that a device (or, without one, this thread) has met since it was last asked.
    fn check(&self, device: Option<Device>) -> Result<()> {
        let mut text = ptr::null();
        // SAFETY: the device is alive; the function writes a pointer to `text`.
        let code = unsafe { (self.get_device_error)(device, &mut text) };
        match code {
            0 => Ok(()),
            // SAFETY: not null, it is a string that lives until the device is used again.
            _ if !text.is_null() => Err(problem(unsafe { CStr::from_ptr(text) }.to_string_lossy())),
            code => Err(problem(format!("error {code} of Open Image Denoise"))),
        }
    }
}

/// A picture's colours, row-major, and what guides the filter besides; all of one size.
#[derive(Clone, Copy, Debug)]
pub struct Noisy<'p> {
    /// Columns and rows.
    pub size: (usize, usize),
    /// Radiance, linear.
    pub color: &'p [[f32; 3]],
    /// Base colours in [0, 1], and normals of length 1 at most.
    pub guides: Option<[&'p [[f32; 3]]; 2]>,
}

/// The library with a device that is ready.
pub struct Oidn {
    api: Api,
    device: Device,
    file: PathBuf,
}

impl Oidn {
    /// Loads the library from `path`, a file or a folder, or from where it is found, for so many threads (0: all).
    ///
    /// # Errors
    /// [`Error::Backend`]: it is not there, or does not load.
    pub fn open(path: Option<&Path>, threads: usize) -> Result<Self> {
        let named = path.map(Path::to_owned).or_else(|| std::env::var_os(VARIABLE).map(PathBuf::from));
        let mut reason = None;
        for file in named.as_deref().map_or_else(usual_places, within) {
            match Api::load(&file) {
                Ok(api) => return Oidn::start(api, file, threads),
                // What is there and does not load says more than what is not there.
                Err(error) if file.is_file() || named.is_some() && reason.is_none() => reason = Some(error.to_string()),
                Err(_) => {}
            }
        }
        let advice = format!("`pip install pyoidn` has it; --oidn PATH or {VARIABLE} says where it is");
        Err(problem(match (reason, named) {
            (Some(reason), _) => format!("Open Image Denoise 2 does not load: {reason}; {advice}"),
            (None, Some(path)) => format!("{}: there is no {FILE}; {advice}", path.display()),
            (None, None) => format!("Open Image Denoise 2 ({FILE}) is not found; {advice}"),
        }))
    }

    fn start(api: Api, file: PathBuf, threads: usize) -> Result<Self> {
        // SAFETY: a constant of the header.
        let Some(device) = (unsafe { (api.new_device)(CPU) }) else {
            api.check(None)?;
            return Err(problem("Open Image Denoise makes no device for this processor"));
        };
        let oidn = Oidn { api, device, file };
        let threads = c_int::try_from(threads).unwrap_or(0);
        // SAFETY: the device is alive, the names end in 0. Threads are not pinned: there are others in this process.
        unsafe {
            (oidn.api.set_device_int)(device, c"numThreads".as_ptr(), threads);
            (oidn.api.set_device_bool)(device, c"setAffinity".as_ptr(), false);
            (oidn.api.commit_device)(device);
        }
        oidn.api.check(Some(device))?;
        Ok(oidn)
    }

    /// The file that was loaded.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Filters a picture of high dynamic range.
    ///
    /// # Errors
    /// [`Error::Backend`] with the library's reason.
    ///
    /// # Panics
    /// Where the images do not have the size that is said.
    pub fn filter(&self, picture: &Noisy) -> Result<Vec<[f32; 3]>> {
        let ((width, height), api) = (picture.size, &self.api);
        let guides = picture.guides.into_iter().flatten();
        assert!(guides.chain([picture.color]).all(|image| image.len() == width * height), "images of one size");
        let mut output = vec![[0.0f32; 3]; width * height];
        // SAFETY: the device is alive, the name ends in 0.
        let Some(filter) = (unsafe { (api.new_filter)(self.device, c"RT".as_ptr()) }) else {
            api.check(Some(self.device))?;
            return Err(problem("Open Image Denoise makes no filter"));
        };
        let set = |name: &CStr, image: *mut c_void| {
            // SAFETY: the filter is alive, the name ends in 0; the image has width × height triples of floats without
            // gaps (strides of 0 say so), lives until the filter is released, and is aligned for floats.
            unsafe { (api.set_shared_filter_image)(filter, name.as_ptr(), image, FLOAT3, width, height, 0, 0, 0) }
        };
        // Inputs are not written to; the header has no constant pointers.
        let input = |image: &[[f32; 3]]| image.as_ptr().cast_mut().cast();
        set(c"color", input(picture.color));
        if let Some([albedo, normal]) = picture.guides {
            set(c"albedo", input(albedo));
            set(c"normal", input(normal));
        }
        set(c"output", output.as_mut_ptr().cast());
        // SAFETY: the filter is alive until it is released, and so is every image; `output` is borrowed by nothing
        // else.
        unsafe {
            (api.set_filter_bool)(filter, c"hdr".as_ptr(), true);
            (api.commit_filter)(filter);
            (api.execute_filter)(filter);
            (api.release_filter)(filter);
        }
        api.check(Some(self.device))?;
        Ok(output)
    }
}

impl fmt::Display for Oidn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // SAFETY: the device is alive, the name ends in 0.
        let version = unsafe { (self.api.get_device_int)(self.device, c"version".as_ptr()) };
        write!(f, "Open Image Denoise {}.{}.{}", version / 10_000, version / 100 % 100, version % 100)
    }
}

impl fmt::Debug for Oidn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Oidn").field("file", &self.file).finish_non_exhaustive()
    }
}

impl Drop for Oidn {
    fn drop(&mut self) {
        // SAFETY: made by `start`, and released nowhere else.
        unsafe { (self.api.release_device)(self.device) };
    }
}

fn problem(text: impl Into<String>) -> Error {
    Error::Backend { backend: "denoise", problem: text.into() }
}

/// The file that is named, or those that it may be in the folder that is.
fn within(path: &Path) -> Vec<PathBuf> {
    match path.is_dir() {
        true => WITHIN.iter().map(|folder| path.join(folder).join(FILE)).filter(|file| file.is_file()).collect(),
        false => vec![path.into()],
    }
}

/// Where it may be: the dynamic linker's places, then folders of Python packages.
fn usual_places() -> Vec<PathBuf> {
    let roots = ["VIRTUAL_ENV", "CONDA_PREFIX"].into_iter().filter_map(std::env::var_os).map(PathBuf::from);
    let home = std::env::var_os("HOME").map(|home| Path::new(&home).join(".local"));
    let roots = roots.chain(home).chain(["/usr/local", "/usr"].map(PathBuf::from));
    let mut places = vec![PathBuf::from(FILE)];
    for root in roots {
        let Ok(entries) = root.join("lib").read_dir() else { continue };
        let is_python =
            |path: &PathBuf| path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"python3"));
        let mut pythons: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).filter(is_python).collect();
        // The newest first.
        pythons.sort_by(|a, b| b.cmp(a));
        for python in pythons {
            places
                .extend(["site-packages", "dist-packages"].iter().flat_map(|packages| within(&python.join(packages))));
        }
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is named is all that is looked at, and the one line says what to do.
    #[test]
    fn a_library_that_is_not_there_is_said_to_be() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("none.so");
        std::fs::write(&file, "text").expect("a writable folder");
        for path in [folder.path(), &file, Path::new("/nowhere")] {
            let error = Oidn::open(Some(path), 1).expect_err("there is none");
            let line = error.to_string();
            assert!(line.starts_with("denoise: ") && line.contains("pip install pyoidn"), "{line}");
            assert_eq!(error.exit_code(), 1);
        }
    }

    /// What the library is handed, by a stand-in that adds up what it gets (tests/oidn). Oracle: the same sums here.
    /// (The part `memory` of .ci/run runs this under valgrind: no image is left in part, everything is released.)
    #[test]
    fn images_are_handed_over_whole() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/oidn/stand-in.c");
        let built = std::process::Command::new("cc")
            .args(["-shared", "-fPIC", "-O1", "-o"])
            .arg(folder.path().join(FILE))
            .arg(source)
            .status();
        assert!(built.expect("the compiler that links programs").success());

        let oidn = Oidn::open(Some(folder.path()), 2).expect("the stand-in");
        assert_eq!(oidn.to_string(), "Open Image Denoise 2.3.4");
        let size = (5, 3);
        let image = |first: f32| (0..15).map(|i| [first + i as f32, 0.5, first]).collect::<Vec<_>>();
        let [color, albedo, normal] = [1.0, 20.0, 300.0].map(image);
        let alone = oidn.filter(&Noisy { size, color: &color, guides: None });
        assert_eq!(alone.expect("a picture"), color);
        let guided = oidn.filter(&Noisy { size, color: &color, guides: Some([&albedo, &normal]) });
        let sum = |i: usize| std::array::from_fn(|c| color[i][c] + 2.0 * albedo[i][c] + 4.0 * normal[i][c]);
        assert_eq!(guided.expect("a picture"), (0..15).map(sum).collect::<Vec<[f32; 3]>>());
        let refused = Oidn::open(Some(folder.path()), 99).expect_err("the stand-in refuses that many");
        assert!(refused.to_string().contains("too many threads"), "{refused}");
    }
}
