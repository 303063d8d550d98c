//! What a command leaves to its caller: text on stdout, and an exit code.

use std::io::{self, Write};

use crate::error::{Error, Result};
use crate::plain::plain;

/// Exit code: done, and the target was met.
pub const EXIT_OK: u8 = 0;
/// Exit code: a worker failed.
pub const EXIT_FAULT: u8 = 1;
/// Exit code: stopped by time or samples before the error target.
pub const EXIT_TARGET_MISSED: u8 = 3;
/// Exit code: non-finite samples were met.
pub const EXIT_NONFINITE: u8 = 5;

/// Writes text to stdout. A reader that has gone away (`| head`) is not an error.
pub fn print(text: &str) -> Result<()> {
    write_stdout(plain(text).as_bytes())
}

/// Writes bytes to stdout, as [`print`].
pub fn write_stdout(bytes: &[u8]) -> Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Error::io("stdout", "write", error)),
        _ => Ok(()),
    }
}

/// Pretty JSON with a final newline.
pub fn to_json(value: &impl serde::Serialize) -> String {
    let mut text = serde_json::to_string_pretty(value).expect("records of numbers and strings are valid JSON");
    text.push('\n');
    text
}
