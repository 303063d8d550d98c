//! Everything that can go wrong, typed by what a caller would do about it. Each error is one line that names the file
//! and, inside a glTF, the JSON pointer (RFC 6901) of the offending value and what was found there.

use std::path::PathBuf;

/// The library's result type.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// An error of the library. `exit_code` maps it to the command line's contract.
///
/// ```
/// use pathspace::{Error, Scene};
///
/// match Scene::load("scenes/absent.gltf") {
///     Err(Error::Io { path, .. }) => assert!(path.ends_with("absent.gltf")),
///     Err(Error::InvalidScene { pointer, problem, .. }) => println!("at {pointer}: {problem}"),
///     Err(other) => println!("{other}"),
///     Ok(_) => unreachable!("there is no such file"),
/// }
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be read or written.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// File concerned.
        path: PathBuf,
        /// "read", "write", "rename", …
        action: &'static str,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The scene file is broken or hostile at `pointer`.
    #[error("{}: {pointer}: {problem}", file.display())]
    InvalidScene {
        /// The glTF or GLB file.
        file: PathBuf,
        /// JSON pointer of the value, `/accessors/3/count`; `/` when the file as a whole is meant.
        pointer: String,
        /// Expected and found, in one clause.
        problem: String,
    },
    /// `extensionsRequired` names an extension that is not implemented.
    #[error("{}: /extensionsRequired: {extension} is required by the file and not supported", file.display())]
    UnsupportedExtension {
        /// The glTF or GLB file.
        file: PathBuf,
        /// Name of the extension.
        extension: String,
    },
    /// An image (texture, environment, EXR to compare) is missing, broken or of a wrong kind.
    #[error("{}: {problem}", path.display())]
    Image {
        /// Image file, or `FILE#/images/N` for an image inside a glTF.
        path: PathBuf,
        /// What was expected and found.
        problem: String,
    },
    /// A part of a picture cannot be joined with the others.
    #[error("{}: {problem}", path.display())]
    Part {
        /// The part.
        path: PathBuf,
        /// Why not.
        problem: String,
    },
    /// The ray backend could not be made ready.
    #[error("{backend}: {problem}")]
    Backend {
        /// "embree", "obvhs" or "brute".
        backend: &'static str,
        /// What failed and, where known, the package to install.
        problem: String,
    },
    /// The job takes more memory than there is.
    #[error("{what} needs {} MB ({parts}), {} MB are left by {limit}: {advice}", needed >> 20, available >> 20)]
    Memory {
        /// What was about to be made.
        what: &'static str,
        /// Bytes that it takes at most at one time.
        needed: u64,
        /// Its parts with their sizes.
        parts: String,
        /// Bytes that may still be taken.
        available: u64,
        /// What sets that limit.
        limit: &'static str,
        /// What makes it smaller.
        advice: String,
    },
    /// An option is out of its range, or options contradict each other.
    #[error("{option}: {problem}")]
    Option {
        /// Name of the option as the command line spells it.
        option: &'static str,
        /// What was given and what is accepted.
        problem: String,
    },
}

impl Error {
    /// Exit code of the command line's contract: 1 I/O or internal, 2 usage, 4 scene invalid or extension unsupported.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::InvalidScene { .. } | Error::UnsupportedExtension { .. } => 4,
            Error::Option { .. } | Error::Part { .. } => 2,
            Error::Io { .. } | Error::Image { .. } | Error::Backend { .. } | Error::Memory { .. } => 1,
        }
    }

    /// An [`Error::Io`] for `path`.
    pub fn io(path: impl Into<PathBuf>, action: &'static str, source: std::io::Error) -> Self {
        Error::Io { path: path.into(), action, source }
    }
}
