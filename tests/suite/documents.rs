//! README.md and GUIDE.md as a stranger follows them, and all documents as files.
//!
//! Every `pathspace …` command of their `sh` blocks is run word for word, in order, in an empty folder where
//! `scenes/` is reachable. Oracle: exit code 0, or the one that the line announces (`# exit 3`). Deterministic but for
//! `--error … --time`, which has 20 s for what takes one. (The Rust examples are doctests.) Links must lead to a file
//! and a heading that exist, files that are named must exist (from the root, or in `src/`), lines keep to 120 bytes,
//! and some documents to their size.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::mpsc;
use std::time::Duration;

const README: &str = include_str!("../../README.md");
const GUIDE: &str = include_str!("../../GUIDE.md");

/// Commands of set-up and build, which the CI runs elsewhere; any other word at a line's start is a mistake.
const NOT_RUN: [&str; 5] = ["apt-get", "git", "make", "cargo", "export"];

/// Far more than any example takes.
const TIME_LIMIT: Duration = Duration::from_secs(120);

/// Longest line of a document, bytes.
const LINE_BYTES: usize = 120;

/// Documents with a limit of their size, bytes.
const SIZES: [(&str, usize); 3] =
    [("README.md", 10_000), ("ARCHITECTURE.md", 16_000), ("docs/cornell-box.png", 150_000)];

/// Folders that are built, not written.
const NOT_OURS: [&str; 3] = ["target", ".git", "findings"];

/// One command to be run.
#[derive(Debug, PartialEq, Eq)]
struct Example {
    arguments: Vec<String>,
    exit: i32,
}

/// The examples of `markdown`, in order. A line that ends in a backslash goes on in the next.
fn examples(markdown: &str) -> Vec<Example> {
    let mut list = Vec::new();
    let mut inside = false;
    let whole = markdown.replace("\\\n", " ");
    for line in whole.lines() {
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
            Some(first) if inside => assert!(NOT_RUN.contains(&first.as_str()), "what is '{line}'?"),
            _ => {}
        }
    }
    list
}

/// The exit code of a comment that begins with `exit N`, else 0.
fn announced(comment: &str) -> i32 {
    let Some(code) = comment.trim().strip_prefix("exit ") else { return 0 };
    let digits: String = code.chars().take_while(char::is_ascii_digit).collect();
    digits.parse().unwrap_or_else(|_| panic!("no exit code in '# exit {code}'"))
}

#[test]
fn examples_are_read_from_sh_blocks() {
    let text =
        "pathspace no\n```sh\nmake test\npathspace info \\\n  a --json  # exit 4: gone\n```\n```text\npathspace no\n";
    let expected = Example { arguments: vec!["info".into(), "a".into(), "--json".into()], exit: 4 };
    assert_eq!(examples(text), [expected]);
}

#[test]
fn every_subcommand_has_an_example() {
    let list = examples(GUIDE);
    for command in ["render", "merge", "farm", "info", "compare", "accuracy", "verify", "bench", "doctor"] {
        assert!(list.iter().any(|e| e.arguments[0] == command), "GUIDE.md has no example of {command}");
    }
}

#[test]
fn every_example_of_the_readme_runs() {
    run(&examples(README));
}

#[test]
fn every_example_of_the_guide_runs() {
    run(&examples(GUIDE));
}

/// Runs `list` in order, in a fresh folder.
fn run(list: &[Example]) {
    let scenes = root().join("scenes");
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::os::unix::fs::symlink(scenes, folder.path().join("scenes")).expect("a link in a fresh folder");
    assert!(!list.is_empty());
    for example in list {
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
fn every_render_flag_is_in_the_guide() {
    let output = Command::new(env!("CARGO_BIN_EXE_pathspace")).args(["render", "--help"]).output();
    let help = String::from_utf8(output.expect("the binary starts").stdout).expect("help in UTF-8");
    let flags = help.split_whitespace().filter(|word| word.starts_with("--") && word.len() > 2);
    // A value that may be left out stands in brackets.
    let flags = flags.map(|word| word.split('[').next().unwrap_or(word));
    for flag in flags.map(|word| word.trim_end_matches(|c: char| !c.is_ascii_alphanumeric())) {
        assert!(["--help", "--version"].contains(&flag) || GUIDE.contains(&format!("`{flag}`")), "{flag} is missing");
    }
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every Markdown file of the project.
fn documents() -> Vec<PathBuf> {
    let (mut files, mut folders) = (Vec::new(), vec![root().to_owned()]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder of the project") {
            let path = entry.expect("an entry").path();
            let ours = path.file_name().is_some_and(|name| NOT_OURS.iter().all(|n| name != *n));
            if path.is_dir() && ours {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "md") {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

/// `markdown` without its fenced blocks.
fn prose(markdown: &str) -> String {
    markdown.split("```").step_by(2).collect()
}

/// The anchors of the headings of `markdown`, as GitHub makes them.
fn anchors(markdown: &str) -> Vec<String> {
    let slug = |heading: &str| -> String {
        let kept = |c: &char| c.is_alphanumeric() || " -_".contains(*c);
        heading.to_lowercase().chars().filter(kept).map(|c| if c == ' ' { '-' } else { c }).collect()
    };
    let headings = prose(markdown);
    headings.lines().filter(|l| l.starts_with('#')).map(|l| slug(l.trim_start_matches('#').trim())).collect()
}

/// The targets of the links of `markdown`, but those to other places.
fn links(markdown: &str) -> Vec<String> {
    let text = prose(markdown);
    let targets = text.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(target, _)| target);
    targets.filter(|t| !t.contains("://")).map(String::from).collect()
}

#[test]
fn links_lead_somewhere() {
    for file in documents() {
        let text = std::fs::read_to_string(&file).expect("UTF-8");
        for link in links(&text) {
            let (path, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let target = if path.is_empty() { file.clone() } else { file.with_file_name(path) };
            assert!(target.exists(), "{}: {link} leads nowhere", file.display());
            if !anchor.is_empty() {
                let there = anchors(&std::fs::read_to_string(&target).expect("UTF-8"));
                assert!(there.iter().any(|a| a == anchor), "{}: no heading for {link}", file.display());
            }
        }
    }
}

/// What `markdown` puts in backquotes and looks like a file or folder of this project.
fn paths(markdown: &str) -> Vec<&str> {
    let quoted = markdown.split('`').skip(1).step_by(2);
    // (`NAME.rs` stands for a file to come.)
    let plain = |t: &str| !t.contains(|c: char| c.is_whitespace() || "<>$:*{".contains(c)) && !t.contains("NAME");
    let ours = |t: &str| t.ends_with(".rs") || t.ends_with('/') || t.starts_with("src/") || t.starts_with("tests/");
    quoted.filter(|t| t.trim_end_matches('/').contains('/') && plain(t) && ours(t)).collect()
}

#[test]
fn files_that_are_named_exist() {
    for file in documents().iter().filter(|file| !file.ends_with("CHANGELOG.md")) {
        let text = std::fs::read_to_string(file).expect("UTF-8");
        for path in paths(&prose(&text)) {
            let there = root().join(path).exists() || root().join("src").join(path).exists();
            assert!(there, "{}: there is no {path}", file.display());
        }
    }
}

#[test]
fn documents_keep_to_their_sizes() {
    for file in documents() {
        let text = std::fs::read_to_string(&file).expect("UTF-8");
        for (number, line) in text.lines().enumerate() {
            assert!(line.len() <= LINE_BYTES, "{}:{}: {} bytes", file.display(), number + 1, line.len());
        }
    }
    for (file, limit) in SIZES {
        let bytes = std::fs::metadata(root().join(file)).expect("a document").len();
        assert!(bytes <= limit as u64, "{file}: {bytes} bytes of {limit}");
    }
}

#[test]
fn links_and_anchors_are_read() {
    let text = "# One *two*-three\n[a](b.md#c) ```\n# no [x](y)\n``` [d](https://e)\n## B & 4\n";
    assert_eq!(links(text), ["b.md#c"]);
    assert_eq!(anchors(text), ["one-two-three", "b--4"]);
    assert_eq!(paths("`a/b.rs` `c/d/` `e/` `R/G/B` `x y/` `src/<z>.rs` or `d.rs`"), ["a/b.rs", "c/d/"]);
}
