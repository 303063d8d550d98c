//! Files that are read: regular ones alone, opened once and without waiting, and read no further than they are long.
//!
//! A pipe, a terminal or a device may never end, and some files of `/proc` look regular and wait or do not end either.
//! So files are opened without blocking, judged by the descriptor, and read up to a length that is known before: the
//! file's own, or what the caller can use of it. Memory that cannot be had is an error, not the end of the process.

use std::fs::{File, OpenOptions};
use std::io::{self, Read};
use std::path::Path;

/// Opens a regular file; its length in bytes.
///
/// # Errors
/// Those of the system, and "not a regular file".
pub fn open(path: &Path) -> io::Result<(File, u64)> {
    let regular = |data: &std::fs::Metadata| match data.is_file() {
        true => Ok(data.len()),
        false => Err(io::Error::other("not a regular file")),
    };
    // Looked at before it is opened as well: opening alone makes some devices act.
    regular(&std::fs::metadata(path)?)?;
    let mut options = OpenOptions::new();
    options.read(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        options.custom_flags(rustix::fs::OFlags::NONBLOCK.bits() as i32);
    }
    let file = options.open(path)?;
    let length = regular(&file.metadata()?)?;
    Ok((file, length))
}

/// All bytes of a regular file, as many as it had when it was opened.
///
/// # Errors
/// As [`open`]; also where the file has become shorter, or memory does not suffice.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    let (file, length) = open(path)?;
    let bytes = read_up_to(file, length)?;
    if (bytes.len() as u64) < length {
        return Err(io::Error::other(format!(
            "it became shorter while it was read, {} of {length} bytes",
            bytes.len()
        )));
    }
    Ok(bytes)
}

/// The first `most` bytes of a regular file, or all if it has fewer. Files of `/proc` say that they are empty, and are.
///
/// # Errors
/// As [`open`]; also where memory does not suffice.
pub fn read_at_most(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let (file, length) = open(path)?;
    read_up_to(file, most.min(length))
}

fn read_up_to(file: File, most: u64) -> io::Result<Vec<u8>> {
    /// What is set aside before the first byte is there.
    const AHEAD: u64 = 1 << 30;
    let mut bytes = Vec::new();
    let no_memory = || io::Error::new(io::ErrorKind::OutOfMemory, format!("no memory for {} MB of it", most >> 20));
    bytes.try_reserve_exact(most.min(AHEAD) as usize).map_err(|_| no_memory())?;
    file.take(most).read_to_end(&mut bytes)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: the bytes written, and what Linux documents of `/proc`. Deterministic. Whatever would block fails by the
    /// test runner's time.
    #[test]
    fn files_without_end_end() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a");
        std::fs::write(&path, b"abcdef").expect("a writable folder");
        assert_eq!(read(&path).expect("regular"), b"abcdef");
        assert_eq!(read_at_most(&path, 4).expect("regular"), b"abcd");
        assert_eq!(read_at_most(&path, u64::MAX).expect("regular"), b"abcdef");
        assert!(read(folder.path()).is_err() && read(&folder.path().join("missing")).is_err());
        if cfg!(target_os = "linux") {
            for endless in ["/dev/zero", "/dev/null", "/dev/stdin"].map(Path::new) {
                let is_file = std::fs::metadata(endless).is_ok_and(|data| data.is_file());
                assert!(is_file || read(endless).is_err(), "{}", endless.display());
            }
            let mapped = Path::new("/proc/self/pagemap");
            for read in [read(mapped), read_at_most(mapped, 64), read_at_most(Path::new("/proc/kmsg"), 1 << 40)] {
                assert!(read.map_or(true, |bytes| bytes.is_empty()));
            }
        }
    }
}
