//! Files that appear complete or not at all. A file is written without a name in the target's own folder (`O_TMPFILE`),
//! flushed to the disk, and only then linked to the target; whatever ends the process before, SIGKILL included, the
//! system frees it, and an older target stays as it was.
//!
//! A link cannot replace a file, so where the target exists the complete file is linked to `.NAME.PID-N.partial` and
//! renamed in the next system call: between the two SIGKILL leaves that name behind. File systems without
//! `O_TMPFILE` or links get the file under that name from the start; then SIGKILL leaves what was written by then. The
//! next render of the same file [sweeps](sweep) that away; files that are on their way are locked (flock(2)).
//! Permissions are those of the file that is replaced, else of any new file (0666 less the umask). Links are not
//! followed: one at the target is replaced, and the name on the way is new, or another is taken.

use std::collections::{HashMap, HashSet};
use std::ffi::OsStr;
use std::fs::{self, File};
use std::hash::{BuildHasher, RandomState};
use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use crate::error::{Error, Result};

/// A file on its way under a name; removed on drop unless it was renamed.
struct Partial {
    path: PathBuf,
    renamed: bool,
}

impl Partial {
    /// A name for `path`, in the same folder, which no other writer makes up: processes in different containers may
    /// have the same number, so there is a part by chance. Nothing is there yet.
    fn of(path: &Path) -> io::Result<Self> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let not_a_file = || io::Error::new(io::ErrorKind::InvalidInput, "not a file name");
        let name = path.file_name().ok_or_else(not_a_file)?;
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let mut partial = std::ffi::OsString::from(".");
        partial.push(name);
        let chance = RandomState::new().hash_one(count);
        partial.push(format!(".{}-{count}-{chance:016x}.partial", std::process::id()));
        Ok(Partial { path: folder_of(path).join(partial), renamed: false })
    }

    /// Makes the file, locked, unless there is anything of this name, be it a link that leads nowhere.
    fn create(&self) -> io::Result<File> {
        loop {
            let file = File::options().read(true).write(true).create_new(true).open(&self.path)?;
            // Where there are no locks nothing is swept away; elsewhere it may have been until now.
            let _ = file.lock();
            if self.path.exists() {
                return Ok(file);
            }
        }
    }

    /// Takes the target's place.
    fn rename(mut self, path: &Path) -> io::Result<()> {
        fs::rename(&self.path, path)?;
        self.renamed = true;
        Ok(())
    }
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

#[cfg(target_os = "linux")]
mod unnamed {
    use std::fs::File;
    use std::io;
    use std::os::fd::AsRawFd;
    use std::path::Path;

    use rustix::fs::{AtFlags, CWD, Mode, OFlags, linkat, open};

    /// A file without a name in `folder`; `None` where the file system has none.
    pub fn create(folder: &Path) -> Option<File> {
        let mode = Mode::from_raw_mode(0o666);
        let file = open(folder, OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC, mode).ok()?;
        Some(File::from(file))
    }

    /// Gives the file a name that is not taken.
    pub fn link(file: &File, path: &Path) -> io::Result<()> {
        let open_file = format!("/proc/self/fd/{}", file.as_raw_fd());
        Ok(linkat(CWD, open_file, CWD, path, AtFlags::SYMLINK_FOLLOW)?)
    }
}

#[cfg(not(target_os = "linux"))]
mod unnamed {
    use std::fs::File;
    use std::io;
    use std::path::Path;

    pub fn create(_: &Path) -> Option<File> {
        None
    }

    pub fn link(_: &File, _: &Path) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }
}

/// What is written to: the file, and its name if it has one.
type Sink = (File, Option<Partial>);

fn create(path: &Path) -> io::Result<Sink> {
    if let Some(file) = unnamed::create(folder_of(path)) {
        let _ = file.lock();
        return Ok((file, None));
    }
    let partial = Partial::of(path)?;
    Ok((partial.create()?, Some(partial)))
}

/// Makes the complete file appear as `path`.
fn publish((mut file, partial): Sink, path: &Path) -> io::Result<()> {
    keep_permissions(&file, path);
    if let Some(partial) = partial {
        return partial.rename(path);
    }
    match unnamed::link(&file, path) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
        // Also where a link is refused, a file under a name may be accepted.
        done => return done.or_else(|_| copy(&mut file, path)),
    }
    let partial = Partial::of(path)?;
    match unnamed::link(&file, &partial.path) {
        Ok(()) => partial.rename(path),
        Err(_) => copy(&mut file, path),
    }
}

/// Gives a new file the permissions of the one that it replaces, if there is one.
fn keep_permissions(file: &File, path: &Path) {
    if let Ok(old) = fs::symlink_metadata(path)
        && old.is_file()
    {
        // Where the system refuses, the file has those of any new one.
        let _ = file.set_permissions(old.permissions());
    }
}

/// The same bytes under a name, for file systems that cannot link an unnamed file.
fn copy(file: &mut File, path: &Path) -> io::Result<()> {
    let partial = Partial::of(path)?;
    let mut named = partial.create()?;
    keep_permissions(&named, path);
    file.rewind()?;
    io::copy(file, &mut named)?;
    named.sync_all()?;
    partial.rename(path)
}

/// Creates or replaces `path` with what `write` writes, all or nothing.
///
/// # Errors
/// [`Error::Io`] naming `path` when the folder is missing, not writable or full, or when `write` fails.
pub fn write_atomically(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<()> {
    let failed = |source| Error::io(path, "write", source);
    let (file, partial) = create(path).map_err(failed)?;
    let mut writer = BufWriter::with_capacity(1 << 20, file);
    write(&mut writer).map_err(failed)?;
    writer.flush().map_err(failed)?;
    let file = writer.into_inner().map_err(|error| failed(error.into_error()))?;
    file.sync_all().map_err(failed)?;
    publish((file, partial), path).map_err(|source| Error::io(path, "rename", source))?;
    // The name itself reaches the disk with the folder; file systems that cannot sync a folder need no help here.
    if let Ok(folder) = File::open(folder_of(path)) {
        let _ = folder.sync_all();
    }
    Ok(())
}

/// Finds out now, by creating a file that does not stay, whether [`write_atomically`] could write `path` later.
///
/// # Errors
/// [`Error::Io`] naming `path`: its folder does not exist or refuses new files, or `path` is a folder itself.
pub fn check_writable(path: &Path) -> Result<()> {
    let refuse = |kind, problem: String| Err(Error::io(path, "write", io::Error::new(kind, problem)));
    if path.is_dir() {
        return refuse(io::ErrorKind::IsADirectory, "it is a folder".into());
    }
    // `Path` drops a slash at the end.
    let ends_as_folder = [&b"/"[..], b"/."].iter().any(|end| path.as_os_str().as_encoded_bytes().ends_with(end));
    if path.file_name().is_none() || ends_as_folder {
        return refuse(io::ErrorKind::InvalidInput, "not a file name".into());
    }
    let folder = folder_of(path);
    if !folder.is_dir() {
        return refuse(io::ErrorKind::NotFound, format!("folder {} does not exist", folder.display()));
    }
    create(path).map_err(|source| Error::io(path, "write", source))?;
    Ok(())
}

/// Takes away what writers of `paths` left that were killed: names on the way to them whose files nobody has locked.
/// Each folder is read once.
pub fn sweep<'p>(paths: impl IntoIterator<Item = &'p Path>) {
    let mut targets: HashMap<&Path, HashSet<&[u8]>> = HashMap::new();
    for path in paths {
        targets.entry(folder_of(path)).or_default().extend(path.file_name().map(OsStr::as_encoded_bytes));
    }
    for (folder, names) in targets {
        let Ok(entries) = fs::read_dir(folder) else { continue };
        let is_left = |entry: &fs::DirEntry| target_of(&entry.file_name()).is_some_and(|name| names.contains(name));
        let is_file = |entry: &fs::DirEntry| entry.file_type().is_ok_and(|kind| kind.is_file());
        for entry in entries.flatten().filter(|entry| is_left(entry) && is_file(entry)) {
            // (Locks of network file systems may ask for writing, files on their way to read-only ones forbid it.)
            let opened = File::options().write(true).open(entry.path()).or_else(|_| File::open(entry.path()));
            let Ok(file) = opened else { continue };
            if file.try_lock().is_ok() {
                let _ = fs::remove_file(entry.path());
            }
        }
    }
}

/// The name that `found` is a [`Partial`] of, its bytes.
fn target_of(found: &OsStr) -> Option<&[u8]> {
    let rest = found.as_encoded_bytes().strip_prefix(b".")?.strip_suffix(b".partial")?;
    let dot = rest.iter().rposition(|&byte| byte == b'.')?;
    // Process, count, chance.
    let is_number = |part: &[u8]| !part.is_empty() && part.iter().all(u8::is_ascii_hexdigit);
    let parts: Vec<&[u8]> = rest[dot + 1..].split(|&byte| byte == b'-').collect();
    let is_partial = parts.len() == 3 && parts.into_iter().all(is_number);
    is_partial.then(|| &rest[..dot])
}

#[cfg(test)]
mod tests {
    use std::io::{BufRead, BufReader};
    use std::os::unix::fs::PermissionsExt;
    use std::process::{Command, Stdio};

    use super::*;

    fn entries(folder: &Path) -> usize {
        fs::read_dir(folder).expect("a folder").count()
    }

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
        assert_eq!(entries(folder.path()), 1);
        write_atomically(&path, |w| w.write_all(b"new")).expect("a writable folder");
        assert_eq!((fs::read(&path).expect("replaced"), entries(folder.path())), (b"new".to_vec(), 1));
    }

    /// Every way to the target gives the same file: linked, linked and renamed, named from the start, copied. Oracle:
    /// the bytes, and the permissions that `File::create` gives.
    #[test]
    fn every_way_gives_the_same_file() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (path, usual) = (folder.path().join("a"), folder.path().join("usual"));
        File::create(&usual).expect("a writable folder");
        let mode = |path: &Path| fs::metadata(path).expect("a file").permissions().mode();
        let check = |entries_now: usize| {
            assert_eq!((fs::read(&path).expect("written"), mode(&path)), (b"bytes".to_vec(), mode(&usual)));
            assert_eq!(entries(folder.path()), entries_now);
        };
        let write = || write_atomically(&path, |w| w.write_all(b"bytes")).expect("a writable folder");
        write();
        check(2);
        write();
        check(2);

        // A symbolic link is replaced, what it points to is not touched.
        fs::remove_file(&path).expect("written");
        std::os::unix::fs::symlink(&usual, &path).expect("a link");
        write();
        check(2);
        assert!(fs::symlink_metadata(&path).expect("a file").is_file() && fs::read(&usual).expect("a file").is_empty());

        let partial = Partial::of(&path).expect("a name");
        fs::write(&partial.path, "bytes").expect("a writable folder");
        publish((File::open(&partial.path).expect("a file"), Some(partial)), &path).expect("renamed");
        check(2);
        let mut source = tempfile::tempfile().expect("a temporary file");
        source.write_all(b"bytes").expect("a temporary file");
        copy(&mut source, &path).expect("copied");
        check(2);
    }

    #[test]
    fn permissions_stay_and_names_are_new() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a");
        fs::write(&path, "old").expect("a writable folder");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).expect("an own file");
        write_atomically(&path, |w| w.write_all(b"new")).expect("a writable folder");
        assert_eq!(fs::metadata(&path).expect("a file").permissions().mode() & 0o777, 0o600);

        // A link where the partial file is to be: its target stays as it is.
        let partial = Partial::of(&path).expect("a name");
        std::os::unix::fs::symlink(&path, &partial.path).expect("a link");
        assert!(partial.create().is_err());
        assert_eq!(fs::read(&path).expect("a file"), b"new");
        assert_ne!(Partial::of(&path).expect("a name").path.file_name().map(|name| name.len()), None);
        assert!(check_writable(&folder.path().join("o.exr/")).is_err());
    }

    /// What a killed writer left goes; files on their way, of other targets, and anything else stay.
    #[test]
    fn what_was_left_is_swept_away() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (path, other) = (folder.path().join("a"), folder.path().join("a.5"));
        let [left, alive, others] = [&path, &path, &other].map(|path| Partial::of(path).expect("a name"));
        let _alive = alive.create().expect("a writable folder");
        for partial in [&left, &others] {
            drop(partial.create().expect("a writable folder"));
        }
        for name in ["a", ".a.partial", ".a.1-2.partial", ".a.b.partial"] {
            fs::write(folder.path().join(name), "").expect("a writable folder");
        }
        assert_eq!(entries(folder.path()), 7);
        sweep([path.as_path()]);
        assert!(!left.path.exists() && alive.path.exists() && others.path.exists());
        assert_eq!(entries(folder.path()), 6);
        sweep([path.as_path(), &other]);
        assert!(alive.path.exists() && !others.path.exists());
    }

    #[test]
    fn missing_folders_and_folders_as_targets_are_found_before_work_begins() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let error = check_writable(&folder.path().join("missing/a.exr")).expect_err("no such folder");
        assert!(error.to_string().contains("missing") && error.exit_code() == 1, "{error}");
        assert!(check_writable(folder.path()).is_err() && check_writable(Path::new("..")).is_err());
        // No folder in the name means the current one, which may well be read-only.
        let here = std::env::current_dir().expect("a current folder").join("no-folder-in-the-name.exr");
        assert_eq!(check_writable(Path::new("no-folder-in-the-name.exr")).is_ok(), check_writable(&here).is_ok());
    }

    #[test]
    fn a_full_disk_is_an_error_with_the_path() {
        // Oracle: /dev/full refuses every write; it simulates a disk, so only the writer's part is tested.
        let Ok(mut full) = File::options().write(true).open("/dev/full") else { return };
        let folder = tempfile::tempdir().expect("a temporary folder");
        let error = write_atomically(&folder.path().join("a.exr"), |_| full.write_all(&[0; 1 << 16]));
        let error = error.expect_err("no space").to_string();
        assert!(error.contains("a.exr") && error.contains("space"), "{error}");
        assert_eq!(entries(folder.path()), 0);
    }

    /// Path that a child of the test below writes to.
    const CHILD: &str = "PATHSPACE_ATOMIC_CHILD";

    /// A child is killed by SIGKILL in mid-write, once with no target there and once over an old one. Oracle: the
    /// folder's entries before.
    #[test]
    fn sigkill_leaves_nothing_behind() {
        if let Some(path) = std::env::var_os(CHILD) {
            let _ = write_atomically(Path::new(&path), |writer| {
                writer.write_all(&vec![1; 8 << 20])?;
                writer.flush()?;
                println!("\nwritten");
                std::thread::sleep(std::time::Duration::from_secs(60));
                Ok(())
            });
            return;
        }
        let folder = tempfile::tempdir().expect("a temporary folder");
        if unnamed::create(folder.path()).is_none() {
            eprintln!("SKIPPED: no O_TMPFILE in {}", folder.path().display());
            return;
        }
        let path = folder.path().join("a.exr");
        for before in [0, 1] {
            let mut child = Command::new(std::env::current_exe().expect("this test"))
                .args(["--exact", "film::atomic::tests::sigkill_leaves_nothing_behind", "--nocapture"])
                .env(CHILD, &path)
                .stdout(Stdio::piped())
                .spawn()
                .expect("this test starts again");
            let lines = BufReader::new(child.stdout.take().expect("piped")).lines();
            assert!(lines.map_while(io::Result::ok).any(|line| line == "written"), "the child did not write");
            child.kill().and_then(|()| child.wait()).expect("a running child");
            assert_eq!(entries(folder.path()), before);
            if before == 0 {
                fs::write(&path, "old").expect("a writable folder");
            }
        }
        assert_eq!(fs::read(&path).expect("still there"), b"old");
    }
}
