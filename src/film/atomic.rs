//! Files that appear complete or not at all: written to `.NAME.PID-N.partial` in the target's own folder, flushed to the
//! disk, then renamed over the target. Whatever fails on the way, the partial file is removed and an older target stays
//! as it was.
//! Limit: a process that is killed outright (SIGKILL, power) leaves its partial file behind.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use crate::error::{Error, Result};

/// A file on its way; removed on drop unless it was renamed.
struct Partial {
    path: PathBuf,
    renamed: bool,
}

impl Drop for Partial {
    fn drop(&mut self) {
        if !self.renamed {
            // Nothing can be done about a failure here, and the error that led here is the one to report.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// The folder that holds `path`.
fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// A name for the partial file of `path`, in the same folder, used by no other writer of this machine.
fn partial_name(path: &Path) -> Result<PathBuf> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let name = path
        .file_name()
        .ok_or_else(|| Error::io(path, "write", io::Error::new(io::ErrorKind::InvalidInput, "not a file name")))?;
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let mut partial = std::ffi::OsString::from(".");
    partial.push(name);
    partial.push(format!(".{}-{count}.partial", std::process::id()));
    Ok(folder_of(path).join(partial))
}

/// Creates or replaces `path` with what `write` writes, all or nothing.
///
/// # Errors
/// [`Error::Io`] naming `path` when the folder is missing, not writable or full, or when `write` fails.
pub fn write_atomically(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<()> {
    let failed = |source| Error::io(path, "write", source);
    let mut partial = Partial { path: partial_name(path)?, renamed: false };
    let file = File::create(&partial.path).map_err(failed)?;
    let mut writer = BufWriter::with_capacity(1 << 20, file);
    write(&mut writer).map_err(failed)?;
    writer.flush().map_err(failed)?;
    writer.get_ref().sync_all().map_err(failed)?;
    fs::rename(&partial.path, path).map_err(|source| Error::io(path, "rename", source))?;
    partial.renamed = true;
    // The rename itself reaches the disk with the folder; file systems that cannot sync a folder need no help here.
    if let Ok(folder) = File::open(folder_of(path)) {
        let _ = folder.sync_all();
    }
    Ok(())
}

/// Finds out now, by creating and removing a partial file, whether [`write_atomically`] could write `path` later.
///
/// # Errors
/// [`Error::Io`] naming `path`: its folder does not exist or refuses new files, or `path` is a folder itself.
pub fn check_writable(path: &Path) -> Result<()> {
    if path.is_dir() {
        return Err(Error::io(path, "write", io::Error::new(io::ErrorKind::IsADirectory, "it is a folder")));
    }
    let folder = folder_of(path);
    if !folder.is_dir() {
        let problem = format!("folder {} does not exist", folder.display());
        return Err(Error::io(path, "write", io::Error::new(io::ErrorKind::NotFound, problem)));
    }
    let partial = Partial { path: partial_name(path)?, renamed: false };
    File::create(&partial.path).map_err(|source| Error::io(path, "write", source))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a.txt");
        write_atomically(&path, |w| w.write_all(b"old")).expect("a writable folder");
        let error = write_atomically(&path, |w| {
            w.write_all(b"new")?;
            Err(io::Error::other("disk full"))
        });
        assert!(error.expect_err("the writer failed").to_string().contains("a.txt"));
        assert_eq!(fs::read(&path).expect("still there"), b"old");
        check_writable(&path).expect("writable");
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 1);
    }

    #[test]
    fn missing_folders_and_folders_as_targets_are_found_before_work_begins() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let error = check_writable(&folder.path().join("missing/a.exr")).expect_err("no such folder");
        assert!(error.to_string().contains("missing") && error.exit_code() == 1, "{error}");
        assert!(check_writable(folder.path()).is_err());
        // No folder in the name means the current one, which may well be read-only.
        let here = std::env::current_dir().expect("a current folder").join("no-folder-in-the-name.exr");
        assert_eq!(check_writable(Path::new("no-folder-in-the-name.exr")).is_ok(), check_writable(&here).is_ok());
    }
}
