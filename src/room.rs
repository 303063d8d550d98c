//! Memory that this process may still take, and what says so: the machine, its control groups, its own limits.
//!
//! An allocation that succeeds says nothing, because Linux promises more than it has. Sources: `/proc/meminfo`
//! (`MemAvailable`), `/proc/self/limits` and `/proc/self/status` (proc(5)), control groups of version 2 (`memory.max`,
//! `memory.current`) and 1 (`memory.limit_in_bytes`, `memory.usage_in_bytes`), whose caches of files (`inactive_file`)
//! make room when it is needed. Where the system does not say, nothing limits.

use std::fs;
use std::path::{Path, PathBuf};

/// Address space beside what is asked for: stacks of threads and the allocator's reserves, each thread.
const ADDRESSES_PER_THREAD: u64 = 16 << 20;

/// Room in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// Bytes that may still be taken.
    pub bytes: u64,
    /// What sets the limit: "free memory", "the control group", "the address space (ulimit -v)".
    pub limit: &'static str,
}

impl Room {
    /// What is left by the tightest limit, for a job of this many threads; `None` where the system does not say.
    pub fn left(threads: usize) -> Option<Room> {
        let status = read("/proc/self/status");
        let limits = read("/proc/self/limits");
        let threads = threads as u64 * ADDRESSES_PER_THREAD;
        let own = |name: &str, used: &str| {
            let left = limit(&limits, name)?.saturating_sub(kilobytes(&status, used)? + threads);
            // Growing arrays are moved, and freed addresses are not given back at once.
            Some(left / 4 * 3)
        };
        let all = [
            (kilobytes(&read("/proc/meminfo"), "MemAvailable:"), "free memory"),
            (groups(&read("/proc/self/cgroup"), Path::new("/sys/fs/cgroup")), "the control group"),
            (own("Max address space", "VmSize:"), "the address space (ulimit -v)"),
            (own("Max data size", "VmData:"), "the data size (ulimit -d)"),
        ];
        let known = all.into_iter().filter_map(|(bytes, limit)| Some(Room { bytes: bytes?, limit }));
        known.min_by_key(|room| room.bytes)
    }
}

/// Bytes of this process that are in memory now; `None` where the system does not say.
pub fn resident() -> Option<u64> {
    kilobytes(&read("/proc/self/status"), "VmRSS:")
}

/// The most that they have been so far.
pub fn most_resident() -> Option<u64> {
    kilobytes(&read("/proc/self/status"), "VmHWM:")
}

/// Descriptors that this process may still open; `None` where the system does not say.
pub fn descriptors() -> Option<u64> {
    let open = fs::read_dir("/proc/self/fd").ok()?.count() as u64;
    Some(limit(&read("/proc/self/limits"), "Max open files")?.saturating_sub(open))
}

fn read(path: impl AsRef<Path>) -> String {
    fs::read_to_string(path).unwrap_or_default()
}

/// Bytes of a line `name N kB`.
fn kilobytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_whitespace().next()?.parse::<u64>().ok()?.checked_mul(1024)
}

/// The soft limit of a line of `/proc/self/limits`, bytes; `None` for "unlimited".
fn limit(text: &str, name: &str) -> Option<u64> {
    text.lines().find_map(|line| line.strip_prefix(name))?.split_whitespace().next()?.parse().ok()
}

/// Bytes left in the control groups that `text` (`/proc/self/cgroup`) names and in those above them, mounted at
/// `mount`.
fn groups(text: &str, mount: &Path) -> Option<u64> {
    let mut left: Option<u64> = None;
    for line in text.lines() {
        let mut fields = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(path)) = (fields.next(), fields.next()) else { continue };
        let (mount, names) = match controllers {
            "" => (mount.to_path_buf(), ["memory.max", "memory.current", "inactive_file "]),
            _ if controllers.split(',').any(|name| name == "memory") => {
                let names = ["memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file "];
                (mount.join("memory"), names)
            }
            _ => continue,
        };
        // A container sees its own group as the mount itself, whatever it is called outside.
        let mut folder: PathBuf = mount.join(path.trim_start_matches('/'));
        loop {
            if let Some(room) = group(&folder, names) {
                left = Some(left.map_or(room, |left| left.min(room)));
            }
            if folder == mount || !folder.pop() {
                break;
            }
        }
    }
    left
}

/// Bytes left in one group, by the names of its limit, of what it uses, and of the caches in that.
fn group(folder: &Path, [limit, used, caches]: [&str; 3]) -> Option<u64> {
    let number = |name: &str| read(folder.join(name)).trim().parse::<u64>().ok();
    let stat = read(folder.join("memory.stat"));
    let caches = stat.lines().find_map(|line| line.strip_prefix(caches)?.trim().parse::<u64>().ok());
    Some(number(limit)?.saturating_sub(number(used)?.saturating_sub(caches.unwrap_or(0))))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: files written by hand as the kernel writes them. Deterministic.
    #[test]
    fn the_tightest_limit_counts() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let write = |path: &str, text: &str| {
            let path = folder.path().join(path);
            fs::create_dir_all(path.parent().expect("a folder")).expect("a temporary folder");
            fs::write(path, text).expect("a temporary folder");
        };
        // Version 2: the group itself has no limit, the one above it does.
        write("a/memory.max", "1000\n");
        write("a/memory.current", "700\n");
        write("a/memory.stat", "anon 500\ninactive_file 200\nactive_file 10\n");
        write("a/b/memory.max", "max\n");
        write("a/b/memory.current", "100\n");
        assert_eq!(groups("0::/a/b\n", folder.path()), Some(500));
        assert_eq!(groups("0::/c\n", folder.path()), None);
        // Version 1, seen from inside a container: the path does not exist, the mount is the group.
        write("memory/memory.limit_in_bytes", "400\n");
        write("memory/memory.usage_in_bytes", "300\n");
        write("memory/memory.stat", "inactive_file 1\ntotal_inactive_file 50\n");
        assert_eq!(groups("4:cpu,memory:/docker/x\n0::/a\n", folder.path()), Some(150));
        assert_eq!(groups("3:cpuset:/\n", folder.path()), None);

        let limits = "Limit   Soft Limit  Hard Limit  Units\nMax address space  1048576  unlimited  bytes\nMax data \
                      size  unlimited  unlimited  bytes\n";
        assert_eq!((limit(limits, "Max address space"), limit(limits, "Max data size")), (Some(1 << 20), None));
        assert_eq!(kilobytes("VmRSS:\t  12 kB\n", "VmRSS:"), Some(12 << 10));
        if cfg!(target_os = "linux") {
            assert!(Room::left(1).is_some_and(|room| room.bytes > 0) && resident() <= most_resident());
        }
    }
}
