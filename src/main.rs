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
