//! The `pathspace` binary: parses the command line, runs the command, maps its outcome to an exit code.

use std::process::ExitCode;

use pathspace::cli::args::Cli;
use pathspace::cli::{self, report};

/// Variables that libraries read (rayon, the standard library, OpenImageIO) and this program does not: they change the
/// number of threads, their stacks, and which code is loaded.
const UNREAD: [&str; 11] = [
    "RAYON_NUM_THREADS",
    "RAYON_RS_NUM_CPUS",
    "RUST_MIN_STACK",
    "OPENIMAGEIO_THREADS",
    "CUE_THREADS",
    "OPENIMAGEIO_OPTIONS",
    "OPENIMAGEIO_IMAGECACHE_OPTIONS",
    "OPENIMAGEIO_DEBUG",
    "OPENIMAGEIO_LOG_TIMES",
    "OPENIMAGEIO_PLUGIN_PATH",
    "OIIO_LIBRARY_PATH",
];

/// Exit code of everything that is not the library's to classify.
const EXIT_INTERNAL: u8 = 1;

fn main() -> ExitCode {
    start_without(&UNREAD);
    allocator::give_large_blocks_back();
    let cli = Cli::read(std::env::args_os().collect());
    // A panic is a bug, and the contract knows it as "internal". One line says where; RUST_BACKTRACE shows the way
    // there. Workers of a render are silent: the render says which sample they failed at.
    let trace = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if std::env::var_os("RUST_BACKTRACE").is_some_and(|set| set != "0") {
            trace(panic);
        } else if !std::thread::current().name().is_some_and(|name| name.starts_with("render-")) {
            let text = panic.to_string().lines().map(str::trim).collect::<Vec<_>>().join(" ");
            report::stderr_line(format_args!("pathspace: internal error: {text}"));
        }
    }));
    let outcome = std::panic::catch_unwind(|| cli::run(&cli).map_err(anyhow::Error::from));
    match outcome {
        Ok(Ok(code)) => ExitCode::from(code),
        Ok(Err(error)) => {
            // Plain, not `{:#}`: the library's messages carry their causes already.
            report::stderr_line(format_args!("pathspace: error: {error}"));
            ExitCode::from(error.downcast_ref::<pathspace::Error>().map_or(EXIT_INTERNAL, pathspace::Error::exit_code))
        }
        Err(_) => ExitCode::from(EXIT_INTERNAL),
    }
}

/// Starts this program anew, as the same process, where one of these variables is set: a program cannot take them out
/// of its own environment safely.
fn start_without(variables: &[&str]) {
    #[cfg(unix)]
    if variables.iter().any(|name| std::env::var_os(name).is_some())
        && let Ok(program) = std::env::current_exe()
    {
        use std::os::unix::process::CommandExt;
        let mut command = std::process::Command::new(program);
        variables.iter().for_each(|name| _ = command.env_remove(name));
        let mut words = std::env::args_os();
        if let Some(name) = words.next() {
            command.arg0(name);
        }
        // Comes back with an error alone; then the variables have to be lived with.
        let _ = command.args(words).exec();
    }
}

/// glibc's allocator. Large blocks come from the system and go back to it as they are freed; but with each one that is
/// freed, glibc raises the size from which that is so, up to 32 MB, and what is smaller then comes from the threads'
/// heaps, which keep it. Images are decoded by many threads with buffers as large as the image, so a budget of textures
/// would be exceeded by what heaps keep. A size that is set stays (mallopt(3)). Smaller sizes give back more, and make
/// loading slower.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[allow(unsafe_code)] // Fence 5 of 5: one function of the C library.
mod allocator {
    use std::ffi::c_int;

    const M_MMAP_THRESHOLD: c_int = -3;
    /// Bytes of a block that comes from the system.
    const LARGE: c_int = 4 << 20;

    // SAFETY: declared as in malloc.h; takes two numbers, and may be called at any time.
    unsafe extern "C" {
        safe fn mallopt(parameter: c_int, value: c_int) -> c_int;
    }

    pub fn give_large_blocks_back() {
        mallopt(M_MMAP_THRESHOLD, LARGE);
    }
}

/// Other allocators have rules of their own.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
mod allocator {
    pub fn give_large_blocks_back() {}
}
