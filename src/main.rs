//! The `pathspace` binary: parses the command line, runs the command, maps its outcome to an exit code.

use std::process::ExitCode;

use clap::Parser;
use pathspace::cli::args::Cli;
use pathspace::cli::{self, report};

/// Exit code of everything that is not the library's to classify.
const EXIT_INTERNAL: u8 = 1;

fn main() -> ExitCode {
    let cli = Cli::parse();
    // A panic is a bug: its message is on stderr by now, and the contract knows it as "internal".
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
