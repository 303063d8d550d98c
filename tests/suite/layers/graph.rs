//! Which file of `src/` imports which: a reader of `use` items and of paths from `crate`, `super` and `self`.
//!
//! A path belongs to the file of its longest prefix that is a module: `crate::scene::Mesh` to scene/mod.rs, whoever
//! defines `Mesh`. What follows the first `#[cfg(test)]` may look anywhere and is left out, and so is lib.rs, the root.
//! Limit: text, not syntax; paths made by macros are not seen.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// A module's path from the root, `["scene", "mesh"]`; the file mod.rs is its folder.
pub type Module = Vec<String>;

/// Files and what they import, each by its module. Files that only tests compile (`tests.rs`) are left out.
pub struct Graph {
    /// The files that a file imports from.
    pub imports: BTreeMap<Module, BTreeSet<Module>>,
    /// Where a module stands, below `src/`.
    pub files: BTreeMap<Module, PathBuf>,
}

impl Graph {
    /// Reads every file below `src`.
    pub fn read(src: &Path) -> Graph {
        let mut paths = Vec::new();
        rust_files(src, &mut paths);
        let sources = paths.into_iter().filter_map(|path| {
            let relative = path.strip_prefix(src).expect("below src").to_path_buf();
            let module = module_of(&relative)?;
            let source = fs::read_to_string(&path).expect("UTF-8 source");
            Some((module, (relative, source)))
        });
        Graph::of(sources.collect())
    }

    /// The graph of these files: module → (path, source).
    pub fn of(sources: BTreeMap<Module, (PathBuf, String)>) -> Graph {
        let modules: BTreeSet<Module> = sources.keys().cloned().collect();
        let mut graph = Graph { imports: BTreeMap::new(), files: BTreeMap::new() };
        for (module, (path, source)) in sources {
            let code = code_of(&source);
            let mut imports: BTreeSet<Module> =
                paths(&code).iter().filter_map(|path| owner(&module, path, &modules)).collect();
            imports.remove(&module);
            graph.imports.insert(module.clone(), imports);
            graph.files.insert(module, path);
        }
        graph
    }

    /// The shortest ring of imports through each file that is in one, without repeats: `a → b → a` is `[a, b]`.
    pub fn rings(&self) -> Vec<Vec<Module>> {
        let mut seen = BTreeSet::new();
        let mut rings = Vec::new();
        for start in self.imports.keys().filter(|module| !module.is_empty()) {
            if let Some(ring) = self.shortest_ring(start)
                && seen.insert(ring.iter().cloned().collect::<BTreeSet<_>>())
            {
                rings.push(ring);
            }
        }
        rings
    }

    fn shortest_ring(&self, start: &Module) -> Option<Vec<Module>> {
        let mut from: BTreeMap<&Module, &Module> = BTreeMap::new();
        let mut front = vec![start];
        while !front.is_empty() {
            let mut next = Vec::new();
            for at in front {
                for to in self.imports.get(at).into_iter().flatten().filter(|to| !to.is_empty()) {
                    if to == start {
                        let mut ring = vec![at];
                        while ring[ring.len() - 1] != start {
                            ring.push(from[ring[ring.len() - 1]]);
                        }
                        return Some(ring.into_iter().rev().cloned().collect());
                    }
                    if !from.contains_key(to) {
                        from.insert(to, at);
                        next.push(to);
                    }
                }
            }
            front = next;
        }
        None
    }
}

/// Module of a file below `src/`; `None` for files of tests.
fn module_of(relative: &Path) -> Option<Module> {
    let mut module: Module = relative.with_extension("").iter().map(|p| p.to_string_lossy().into_owned()).collect();
    match module.last().map(String::as_str) {
        Some("tests") => return None,
        Some("mod") => drop(module.pop()),
        Some("lib") if module.len() == 1 => module.clear(),
        _ => {}
    }
    Some(module)
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

/// Source without comments, string contents and everything from the first `#[cfg(test)]` before a module on.
pub fn code_of(source: &str) -> String {
    let mut code = String::new();
    let mut in_string = false;
    let lines: Vec<&str> = source.lines().collect();
    for (at, line) in lines.iter().enumerate() {
        let next = lines.get(at + 1).map_or("", |next| next.trim());
        if line.trim() == "#[cfg(test)]" && (next.starts_with("mod ") || next.starts_with("pub")) {
            break;
        }
        let mut chars = line.chars().peekable();
        while let Some(c) = chars.next() {
            match (in_string, c) {
                (true, '\\') => drop(chars.next()),
                (true, '"') => in_string = false,
                (true, _) => {}
                (false, '/') if chars.peek() == Some(&'/') => break,
                // The quote as a character or byte literal opens no string.
                (false, '\'') if chars.peek() == Some(&'"') => drop(chars.next()),
                (false, '"') => in_string = true,
                (false, c) => code.push(c),
            }
        }
        code.push('\n');
    }
    code
}

/// Every path that the code names: those of `use` items, and all others that have a `::`.
fn paths(code: &str) -> Vec<Vec<String>> {
    let words = words(code);
    let mut found = Vec::new();
    let mut at = 0;
    while at < words.len() {
        let starts = words[at].starts_with(is_ident) && (at == 0 || words[at - 1] != "::");
        if words[at] == "use" {
            at = tree(&words, at + 1, &[], &mut found);
        } else if starts && words.get(at + 1) == Some(&"::") {
            let mut path = vec![words[at].to_string()];
            at += 1;
            while words.get(at) == Some(&"::") && words.get(at + 1).is_some_and(|word| word.starts_with(is_ident)) {
                path.push(words[at + 1].to_string());
                at += 2;
            }
            found.push(path);
        } else {
            at += 1;
        }
    }
    found
}

/// Reads one tree of a `use` item, `a::{b, c::{self, d}}`, whose first word is at `at`; returns the place behind it.
fn tree(words: &[&str], mut at: usize, prefix: &[String], found: &mut Vec<Vec<String>>) -> usize {
    let mut path = prefix.to_vec();
    while let Some(&word) = words.get(at) {
        match word {
            "{" => {
                at += 1;
                while words.get(at).is_some_and(|word| *word != "}") {
                    at = tree(words, at, &path, found);
                    at += usize::from(words.get(at) == Some(&","));
                }
                return at + 1;
            }
            "::" => {}
            "as" => at += 1,
            "," | "}" | ";" => break,
            "self" if !path.is_empty() => {}
            _ => path.push(word.to_string()),
        }
        at += 1;
    }
    found.push(path);
    at
}

fn is_ident(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Identifiers, `::`, and other characters one by one.
fn words(code: &str) -> Vec<&str> {
    let mut words = Vec::new();
    let mut rest = code;
    while let Some(first) = rest.chars().next() {
        let end = match first {
            c if is_ident(c) => rest.find(|c| !is_ident(c)).unwrap_or(rest.len()),
            ':' if rest.starts_with("::") => 2,
            c => c.len_utf8(),
        };
        if !first.is_whitespace() {
            words.push(&rest[..end]);
        }
        rest = &rest[end..];
    }
    words
}

/// The module that `path` in the file of `module` leads to; `None` for what is not of this crate.
pub fn owner(module: &Module, path: &[String], modules: &BTreeSet<Module>) -> Option<Module> {
    let child = |name: &String| modules.contains(&[module.as_slice(), std::slice::from_ref(name)].concat());
    let (mut base, mut rest): (Module, &[String]) = match path.first()?.as_str() {
        "crate" => (Vec::new(), &path[1..]),
        // The binary sees the library by its name.
        "pathspace" if module.as_slice() == ["main"] => (Vec::new(), &path[1..]),
        "self" | "super" => (module.clone(), path),
        _ if child(&path[0]) => (module.clone(), path),
        _ => return None,
    };
    while let Some("self" | "super") = rest.first().map(String::as_str) {
        if rest[0] == "super" {
            base.pop();
        }
        rest = &rest[1..];
    }
    base.extend_from_slice(rest);
    (0..=base.len()).rev().map(|n| base[..n].to_vec()).find(|prefix| modules.contains(prefix))
}
