//! The import rule: `use` lines and paths of `src/` run leftwards only (lib.rs states the order).
//!
//! Oracle: the table below. Deterministic, no false alarms. Tests inside a file (from its `#[cfg(test)]` on) may look
//! anywhere; so may lib.rs, which is the root.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Modules by layer, left to right.
const LAYERS: &[&[&str]] = &[
    &["error", "math", "machine"],
    &["texture"],
    &["scene"],
    &["backend"],
    &["plan"],
    &["camera", "sampler", "shading", "film"],
    &["wavefront", "accuracy"],
    &["render"],
    &["stats", "bench", "study", "verify"],
    &["cli"],
    &["main"],
];

/// Imports within a layer that are meant: (who, whom).
const NEIGHBOURS: &[(&str, &str)] = &[];

fn layer(module: &str) -> Option<usize> {
    LAYERS.iter().position(|layer| layer.contains(&module))
}

/// Whether `from` may import `to`.
fn allowed(from: &str, to: &str) -> Result<(), String> {
    let known = |m: &str| layer(m).ok_or_else(|| format!("module '{m}' has no layer: add it to tests/suite/layers.rs"));
    let (a, b) = (known(from)?, known(to)?);
    if from == to || b < a || NEIGHBOURS.contains(&(from, to)) {
        Ok(())
    } else {
        Err(format!("{from} must not import {to}"))
    }
}

/// Source without comments, string contents and everything from the first `#[cfg(test)]` on.
fn code_of(source: &str) -> String {
    let mut code = String::new();
    let mut in_string = false;
    for line in source.lines().take_while(|line| line.trim() != "#[cfg(test)]") {
        let mut chars = line.chars().peekable();
        while let Some(c) = chars.next() {
            match (in_string, c) {
                (true, '\\') => {
                    chars.next();
                }
                (true, '"') => in_string = false,
                (true, _) => {}
                (false, '/') if chars.peek() == Some(&'/') => break,
                // The quote as a character or byte literal opens no string.
                (false, '\'') if chars.peek() == Some(&'"') => {
                    chars.next();
                }
                (false, '"') => in_string = true,
                (false, c) => code.push(c),
            }
        }
        code.push('\n');
    }
    code
}

/// The identifiers that follow each occurrence of `prefix` as a path, through one level of braces.
fn heads_after<'a>(code: &'a str, prefix: &str) -> Vec<&'a str> {
    let ident = |s: &'a str| {
        let end = s.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(s.len());
        &s[..end]
    };
    let mut found = Vec::new();
    for (at, _) in code.match_indices(prefix) {
        // `my_crate::x`, `$crate::x` and `super::super::x` seen from its second half are other paths.
        let before = code[..at].chars().next_back();
        if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':') {
            continue;
        }
        let rest = &code[at + prefix.len()..];
        if let Some(group) = rest.strip_prefix('{') {
            let (mut depth, mut expecting) = (0, true);
            for (i, c) in group.char_indices() {
                match c {
                    '{' => depth += 1,
                    '}' if depth == 0 => break,
                    '}' => depth -= 1,
                    ',' if depth == 0 => expecting = true,
                    c if c.is_whitespace() => {}
                    _ if expecting => {
                        found.push(ident(&group[i..]));
                        expecting = false;
                    }
                    _ => {}
                }
            }
        } else {
            found.push(ident(rest));
        }
    }
    found
}

/// Modules of the crate that a file names. `depth` is the number of `super` from the file to the root.
fn imports(code: &str, depth: usize) -> BTreeSet<String> {
    let from_root = "super::".repeat(depth);
    let mut heads = heads_after(code, "crate::");
    if depth > 0 {
        heads.extend(heads_after(code, &from_root).into_iter().filter(|head| *head != "super"));
    }
    heads.into_iter().filter(|head| !["", "self", "super"].contains(head)).map(resolve).collect()
}

/// The module behind a name of the crate's root.
fn resolve(head: &str) -> String {
    let module = match head {
        "Error" | "Result" => "error",
        "Scene" => "scene",
        "RenderOptions" | "Renderer" => "render",
        other => other,
    };
    module.to_string()
}

fn rust_files(dir: &Path, out: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> = fs::read_dir(dir).expect("src is readable").map(|e| e.expect("entry").path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            rust_files(&path, out);
        } else if path.extension().is_some_and(|e| e == "rs") {
            out.push(path);
        }
    }
}

#[test]
fn imports_run_leftwards() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    assert!(files.len() > 20, "only {} files found", files.len());

    let mut faults = Vec::new();
    for path in files {
        let relative = path.strip_prefix(&src).expect("below src");
        let parts: Vec<_> = relative.iter().map(|p| p.to_string_lossy().into_owned()).collect();
        if parts == ["lib.rs"] {
            continue;
        }
        let module = parts[0].trim_end_matches(".rs").to_string();
        // Steps of `super` to the crate's root: mod.rs is its folder.
        let depth = parts.len() - usize::from(parts.last().is_some_and(|last| last == "mod.rs"));
        let code = code_of(&fs::read_to_string(&path).expect("UTF-8 source"));
        let mut named = imports(&code, if module == "main" { 0 } else { depth });
        // The binary sees the library by its name.
        if module == "main" {
            named.extend(heads_after(&code, "pathspace::").into_iter().map(resolve));
        }
        for to in named {
            if let Err(why) = allowed(&module, &to) {
                faults.push(format!("src/{}: {why}", relative.display()));
            }
        }
    }
    assert!(faults.is_empty(), "imports against the order of lib.rs:\n{}", faults.join("\n"));
}

/// Oracle: paths written here by hand.
#[test]
fn the_reader_of_imports_sees_what_is_there() {
    let source = r#"
//! crate::cli in a comment
use crate::error::{Error, Result};
use crate::{math::float, scene::{Scene, ids}, plan};
use super::film::Pixel;
use super::super::render::X;
const S: &str = "crate::wavefront"; // crate::stats
pub(crate) fn f() -> crate::Error { my_crate::backend::g() }
#[cfg(test)]
mod tests { use crate::cli::X; }
"#;
    let code = code_of(source);
    let set = |names: &[&str]| names.iter().map(|s| s.to_string()).collect::<BTreeSet<_>>();
    assert_eq!(imports(&code, 1), set(&["error", "film", "math", "plan", "scene"]));
    assert_eq!(imports(&code, 2), set(&["error", "math", "plan", "render", "scene"]));
    assert!(allowed("film", "plan").is_ok() && allowed("shading", "texture").is_ok());
    assert!(allowed("texture", "scene").is_err() && allowed("shading", "sampler").is_err());
    assert!(allowed("film", "render").is_err() && allowed("film", "nowhere").is_err());
}
