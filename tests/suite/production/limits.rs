//! Limits that a render meets on its way: sizes of files, processor time, full and read-only disks, folders that go.
//! Oracle: exit code, words, and what lies in the folders afterwards; of what is saved, the bits of a render that met
//! none. Deterministic, whenever the limits are met.

use std::path::Path;
use std::process::{Command, Stdio};

use pathspace::film::exr::read_exr;
use pathspace::render::checkpoint::Checkpoint;

use super::{Bench, SCENE, wait_for};
use crate::common::{signal, wait_for_samples};

/// A bench with a folder for temporary files, a picture of 4 samples and its state.
fn bench() -> Bench {
    let b = Bench::new();
    std::fs::create_dir(b.path("tmp")).expect("a folder");
    b.run(0, b.render("--spp 4 -o a.exr --checkpoint 1h"));
    b
}

impl Bench {
    /// `command`, started by a shell behind `script`.
    fn behind(&self, script: &str, command: &Command) -> Command {
        self.by(&["sh"], &format!("{script}; exec \"$@\""), command)
    }

    /// A script that finds `command` in `"$@"`, run by a `shell`.
    fn by(&self, shell: &[&str], script: &str, command: &Command) -> Command {
        let mut by = Command::new(shell[0]);
        by.args(&shell[1..]).args(["-c", script, "sh"]).arg(command.get_program()).args(command.get_args());
        by.current_dir(self.folder.path()).env("TMPDIR", self.path("tmp"));
        by
    }

    /// A shell that may mount on the folder `disk`; `None`, with a message, where this process makes none.
    fn mounting_shell(&self) -> Option<&'static [&'static str]> {
        std::fs::create_dir(self.path("disk")).expect("a folder");
        let shells: [&[&str]; 2] = [&["unshare", "-rm", "sh"], &["unshare", "-m", "sh"]];
        let can_mount = |shell: &&&[&str]| {
            let mut probe = self.by(shell, "mount -t tmpfs none disk", &Command::new("true"));
            probe.stderr(Stdio::null()).status().is_ok_and(|status| status.success())
        };
        let found = shells.iter().find(can_mount).copied();
        if found.is_none() {
            eprintln!("SKIPPED: small disks: this process may not mount");
        }
        found
    }

    fn names_in(&self, folder: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.path(folder)).expect("a folder").flatten();
        let mut names: Vec<String> = entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

/// What was said is a line for each of these words.
fn assert_lines(said: &str, words: &[&str]) {
    let lines: Vec<&str> = said.lines().collect();
    assert!(lines.len() == words.len() && lines.iter().zip(words).all(|(line, word)| line.contains(word)), "{said}");
}

fn assert_picture(path: &Path) {
    let picture = read_exr(path).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((picture.width, picture.height), (24, 20));
}

/// What would be larger than files may be (`ulimit -f`, blocks of 512 bytes) is an error, not a signal.
#[test]
fn files_beyond_their_limit_are_errors() {
    let b = bench();
    let state = b.bytes("a.checkpoint");
    let more = b.render("--spp 8 -o a.exr --resume a.checkpoint --checkpoint 1h");
    // The picture fits, the state does not.
    let half = format!("ulimit -f {}", state.len() / 1024);
    let said = b.run(1, b.behind(&half, &more));
    assert_lines(&said, &["a.checkpoint: cannot write: File too large"]);
    assert_picture(&b.path("a.exr"));
    // Neither fits.
    let picture = b.bytes("a.exr");
    let said = b.run(1, b.behind("ulimit -f 1", &more));
    assert_lines(&said, &["a.checkpoint: cannot write: File too large", "a.exr: cannot write: File too large"]);
    assert!(b.bytes("a.checkpoint") == state && b.bytes("a.exr") == picture);
    // While it renders.
    let said = b.run(1, b.behind(&half, &b.render("--time 300ms -o b.exr --checkpoint 5ms")));
    assert_lines(&said, &["b.checkpoint: cannot write: File too large"]);
    assert_picture(&b.path("b.exr"));
    assert_eq!(b.names(), ["a.checkpoint", "a.exr", "b.exr", "tmp"]);
    let said = b.run(1, b.behind("ulimit -f 0; exec >out", &b.command(&["info", SCENE, "--json", "--size", "32x32"])));
    assert_lines(&said, &["stdout: cannot write: File too large"]);
    assert_eq!(b.names_in("tmp"), [""; 0]);
}

/// The soft limit of processor time ends a render as SIGTERM does, although its signal comes again each second.
#[test]
fn processor_time_that_runs_out_saves_picture_and_state() {
    let b = Bench::new();
    let endless = b.part("--spp 1000000000 -o a.exr --checkpoint 1h");
    let said = b.run(152, b.behind("ulimit -S -t 2", &endless));
    assert_lines(&said, &["ulimit -t"]);
    assert_picture(&b.path("a.exr"));
    assert_eq!(b.names(), ["a.checkpoint", "a.exr"]);
    assert!(b.stat_of_resumed() > 0);

    let mut command = b.part("--spp 1000000000 -o d.exr --progress ndjson");
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("the binary starts");
    wait_for_samples(&mut child);
    (0..3).for_each(|_| signal(&child, "XCPU"));
    assert_eq!(child.wait().expect("it ends").code(), Some(152));
    assert_picture(&b.path("d.exr"));
}

/// On a disk that is full the last good state stays, and the picture goes where there is room.
#[test]
fn full_disks_keep_what_is_there() {
    let b = bench();
    let Some(shell) = b.mounting_shell() else { return };
    let state = b.bytes("a.checkpoint");
    let more = b.render("--spp 8 -o disk/a.exr --resume disk/a.checkpoint --checkpoint 1h");
    // Room for a picture besides the state, not for another state.
    let bytes = (state.len().div_ceil(4096) + 6) * 4096;
    let run = |fill: &str| {
        let before = format!("mount -t tmpfs -o size={bytes} none disk && cp a.checkpoint disk || exit 99; {fill}");
        let after = "\"$@\"; code=$?; ls -A disk >names; cp disk/* .; exit $code";
        b.run(1, b.by(shell, &format!("{before}; {after}"), &more))
    };
    assert_lines(&run(":"), &["disk/a.checkpoint: cannot write: No space left"]);
    assert_eq!(b.bytes("names"), b"a.checkpoint\na.exr\n");
    assert!(b.bytes("a.checkpoint") == state);
    assert_picture(&b.path("a.exr"));

    let said = run("dd if=/dev/zero of=disk/rest bs=4096 2>/dev/null");
    assert_lines(&said, &["disk/a.checkpoint: cannot write: No space left", "disk/a.exr: cannot write: No space left"]);
    assert_eq!(b.bytes("names"), b"a.checkpoint\nrest\n");
    assert!(b.bytes("a.checkpoint") == state);
    let saved = b.names_in("tmp");
    assert!(saved.len() == 1 && said.contains(&saved[0]), "{saved:?}: {said}");
    assert_picture(&b.path("tmp").join(&saved[0]));
}

/// A disk that is read-only from the start is refused; one that becomes so keeps the last good state.
#[test]
fn read_only_disks_are_named() {
    let b = bench();
    let Some(shell) = b.mounting_shell() else { return };
    let script = "mount -t tmpfs -o ro none disk || exit 99; exec \"$@\"";
    let said = b.run(1, b.by(shell, script, &b.render("--spp 1 -o disk/a.exr")));
    assert_lines(&said, &["disk/a.exr: cannot write: Read-only"]);

    let script = "mount -t tmpfs none disk || exit 99; \"$@\" & child=$!
        while kill -0 $child && [ ! -e disk/d.checkpoint ]; do sleep 0.01; done
        n=0; until mount -o remount,ro disk 2>/dev/null || [ $n = 1000 ]; do n=$((n + 1)); sleep 0.01; done
        sleep 0.1; kill -TERM $child; wait $child; code=$?
        ls -A disk >names; cp disk/d.checkpoint .; exit $code";
    let endless = b.render("--spp 1000000000 -o disk/d.exr --checkpoint 10ms disk/d.checkpoint");
    let said = b.run(1, b.by(shell, script, &endless));
    assert_lines(&said, &["disk/d.checkpoint: cannot write: Read-only", "disk/d.exr: cannot write: Read-only"]);
    assert_eq!(b.bytes("names"), b"d.checkpoint\n");
    assert_eq!(b.names_in("tmp").len(), 1);
    Checkpoint::restore(b.path("d.checkpoint")).expect("whole");
}

/// Folders that are files, that become files in mid-render, and that refuse new files.
#[test]
fn folders_that_take_no_files_are_named() {
    let b = bench();
    std::fs::write(b.path("file"), "").expect("a writable folder");
    assert_lines(&b.run(1, b.render("--spp 1 -o file/a.exr")), &["file/a.exr: cannot write"]);

    std::fs::create_dir(b.path("folder")).expect("a folder");
    let mut command = b.render("--spp 1000000000 -o folder/d.exr --checkpoint 20ms folder/d.checkpoint");
    command.env("TMPDIR", b.path("tmp")).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the binary starts");
    wait_for(&b.path("folder/d.checkpoint"), &mut child);
    std::fs::rename(b.path("folder"), b.path("gone")).expect("a folder");
    std::fs::write(b.path("folder"), "a file").expect("a writable folder");
    signal(&child, "TERM");
    let output = child.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert_lines(&said, &["folder/d.checkpoint: cannot ", "folder/d.exr: cannot write"]);
    let saved = b.names_in("tmp");
    assert!(saved.len() == 1 && said.contains(&saved[0]), "{saved:?}: {said}");
    assert_picture(&b.path("tmp").join(&saved[0]));
    assert_eq!(b.bytes("folder"), b"a file");
    Checkpoint::restore(b.path("gone/d.checkpoint")).expect("whole");

    use std::os::unix::fs::PermissionsExt;
    std::fs::create_dir(b.path("closed")).expect("a folder");
    std::fs::set_permissions(b.path("closed"), std::fs::Permissions::from_mode(0o555)).expect("an own folder");
    if std::fs::write(b.path("closed/probe"), "").is_ok() {
        eprintln!("SKIPPED: folders without permission: root may write to them");
        return;
    }
    let said = b.run(1, b.render("--spp 1 -o closed/a.exr"));
    assert_lines(&said, &["closed/a.exr: cannot write: Permission denied"]);
    assert_eq!(b.names_in("closed"), [""; 0]);
}
