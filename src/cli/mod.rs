//! The command line: [`args`] (raw, typed) → [`job`] (validated against the scene) → one module per subcommand →
//! [`report`] and [`progress`]. stdout carries only what was asked for (JSON, tables, `--progress ndjson`); everything
//! else goes to stderr. Nothing here computes light.

pub mod accuracy;
pub mod args;
pub mod bench;
pub mod compare;
pub mod doctor;
pub mod error_log;
pub mod info;
pub mod job;
pub mod progress;
pub mod render;
pub mod replay;
pub mod report;
pub mod signal;
pub mod units;
pub mod verify;

use std::io::{self, Write};

use crate::error::{Error, Result};
use args::{Cli, Command};

/// Exit code: done, and the target was met.
pub const EXIT_OK: u8 = 0;
/// Exit code: stopped by time or samples before the error target.
pub const EXIT_TARGET_MISSED: u8 = 3;
/// Exit code: non-finite samples were met.
pub const EXIT_NONFINITE: u8 = 5;

/// Runs one command and returns its exit code.
///
/// # Errors
/// Whatever stopped the command; [`Error::exit_code`] says how the process should end.
pub fn run(cli: &Cli) -> Result<u8> {
    match &cli.command {
        Command::Render(args) => render::run(args),
        Command::Info(args) => info::run(args),
        Command::Compare(args) => compare::run(args),
        Command::Verify(args) => verify::run(args),
        Command::Bench(args) => bench::run(args),
        Command::Accuracy(args) => accuracy::run(args),
        Command::Doctor => doctor::run(),
    }
}

/// Writes to stdout. A reader that has gone away (`| head`) is not an error.
fn print(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Error::io("stdout", "write", error)),
        _ => Ok(()),
    }
}

/// Pretty JSON with a final newline.
fn to_json(value: &impl serde::Serialize) -> String {
    let mut text = serde_json::to_string_pretty(value).expect("records of numbers and strings are valid JSON");
    text.push('\n');
    text
}
