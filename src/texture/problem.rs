//! Why an image cannot be had: it is the image's own fault, for which something else may be shown, or the machine's.

use std::io;
use std::path::Path;

use crate::error::Error;
use crate::plain::one_line;

/// What is wrong.
#[derive(Debug)]
pub enum Problem {
    /// The file is missing, broken or not what is expected: what was expected and found.
    Image(String),
    /// The machine does not do what every load needs: no descriptor, no room in the folder of temporary files, a
    /// library that does not load.
    Machine(Error),
}

impl Problem {
    /// Of a file that cannot be read.
    pub(super) fn reading(path: &Path, reason: io::Error) -> Self {
        /// EIO, ENOMEM, ENFILE and EMFILE of Linux.
        const MACHINE: [i32; 4] = [5, 12, 23, 24];
        match reason.raw_os_error() {
            Some(code) if MACHINE.contains(&code) => Problem::Machine(Error::io(path, "read", reason)),
            _ => Problem::Image(reason.to_string()),
        }
    }
}

impl std::fmt::Display for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Problem::Image(problem) => f.write_str(problem),
            Problem::Machine(error) => error.fmt(f),
        }
    }
}

impl From<String> for Problem {
    fn from(problem: String) -> Self {
        // A decoder's reason may have several lines.
        Problem::Image(one_line(problem.trim_end()))
    }
}

impl From<Error> for Problem {
    fn from(error: Error) -> Self {
        Problem::Machine(error)
    }
}
