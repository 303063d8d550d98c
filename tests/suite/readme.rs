//! README.md as a stranger follows it: every `pathspace …` line of its `sh` blocks is run word for word, in order, in one
//! empty folder where `scenes/` is reachable. Oracle: exit code 0, or the one that the line announces (`# exit 3`).
//! Deterministic but for `--error … --time`, which has 20 s for what takes one. (The Rust example is a doctest.)

use std::path::Path;
use std::process::Command;
use std::sync::mpsc;
use std::time::Duration;

const README: &str = include_str!("../../README.md");

/// Commands of set-up and build, which the CI runs elsewhere; any other word at a line's start is a mistake.
const NOT_RUN: [&str; 5] = ["apt-get", "git", "make", "cargo", "export"];

/// Far more than any example takes.
const TIME_LIMIT: Duration = Duration::from_secs(120);

/// One line to be run.
#[derive(Debug, PartialEq, Eq)]
struct Example {
    arguments: Vec<String>,
    exit: i32,
}

/// The examples of `markdown`, in order.
fn examples(markdown: &str) -> Vec<Example> {
    let mut list = Vec::new();
    let mut inside = false;
    for line in markdown.lines() {
        if line.starts_with("```") {
            inside = line == "```sh";
            continue;
        }
        let (command, comment) = line.split_once('#').unwrap_or((line, ""));
        let mut words = command.split_whitespace().map(String::from);
        match words.next() {
            Some(first) if inside && first == "pathspace" => {
                list.push(Example { arguments: words.collect(), exit: announced(comment) });
            }
            Some(first) if inside => assert!(NOT_RUN.contains(&first.as_str()), "README.md: what is '{line}'?"),
            _ => {}
        }
    }
    list
}

/// The exit code of a comment that begins with `exit N`, else 0.
fn announced(comment: &str) -> i32 {
    let Some(code) = comment.trim().strip_prefix("exit ") else { return 0 };
    let digits: String = code.chars().take_while(char::is_ascii_digit).collect();
    digits.parse().unwrap_or_else(|_| panic!("README.md: no exit code in '# exit {code}'"))
}

#[test]
fn examples_are_read_from_sh_blocks() {
    let text =
        "pathspace no\n```sh\nmake test\npathspace info a --json  # exit 4: gone\n```\n```text\npathspace no\n```\n";
    let expected = Example { arguments: vec!["info".into(), "a".into(), "--json".into()], exit: 4 };
    assert_eq!(examples(text), [expected]);
}

#[test]
fn every_subcommand_has_an_example() {
    let list = examples(README);
    for command in ["render", "info", "compare", "accuracy", "verify", "bench", "doctor"] {
        assert!(list.iter().any(|e| e.arguments[0] == command), "README.md has no example of {command}");
    }
}

#[test]
fn every_example_runs() {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::os::unix::fs::symlink(scenes, folder.path().join("scenes")).expect("a link in a fresh folder");
    for example in examples(README) {
        let line = format!("pathspace {}", example.arguments.join(" "));
        let mut command = Command::new(env!("CARGO_BIN_EXE_pathspace"));
        command.args(&example.arguments).current_dir(folder.path()).env_remove("SLURM_CPUS_PER_TASK");

        // A command that hangs fails the test instead of stopping the suite.
        let (done, finished) = mpsc::channel();
        std::thread::spawn(move || done.send(command.output().expect("the binary starts")));
        let output = finished.recv_timeout(TIME_LIMIT).unwrap_or_else(|_| panic!("over {TIME_LIMIT:?}: {line}"));
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(example.exit), "{line}\n{stderr}");
    }
}

#[test]
fn every_render_flag_is_in_the_readme() {
    let output = Command::new(env!("CARGO_BIN_EXE_pathspace")).args(["render", "--help"]).output();
    let help = String::from_utf8(output.expect("the binary starts").stdout).expect("help in UTF-8");
    let flags = help.split_whitespace().filter(|word| word.starts_with("--") && word.len() > 2);
    for flag in flags.map(|word| word.trim_end_matches(|c: char| !c.is_ascii_alphanumeric())) {
        assert!(["--help", "--version"].contains(&flag) || README.contains(&format!("`{flag}`")), "{flag} is missing");
    }
}
