//! The import rule: `use` items and paths of `src/` run leftwards only (lib.rs states the order), and no files import
//! each other in a ring, inside folders either.
//!
//! Oracle: the table below, and the graph of imports. Deterministic, no false alarms. Tests inside a file (from its
//! `#[cfg(test)]` on) may look anywhere; so may lib.rs, which is the root.

mod graph;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use graph::{Graph, Module, code_of, owner};

/// Modules by layer, left to right.
const LAYERS: &[&[&str]] = &[
    &["error", "input", "math", "machine", "plain", "plot", "room", "setters"],
    &["texture"],
    &["scene"],
    &["backend"],
    &["plan"],
    &["camera", "sampler", "shading", "film"],
    &["transport", "accuracy"],
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

/// The graph of this crate's own files.
fn of_src() -> Graph {
    let graph = Graph::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"));
    assert!(graph.files.len() > 20, "only {} files found", graph.files.len());
    graph
}

/// The module behind a name of the crate's root.
fn reexported(name: &str) -> &str {
    match name {
        "Error" | "Result" => "error",
        "Scene" => "scene",
        "RenderOptions" | "Renderer" => "render",
        other => other,
    }
}

#[test]
fn imports_run_leftwards() {
    let graph = of_src();
    let mut faults = Vec::new();
    for (module, imports) in graph.imports.iter().filter(|(module, _)| !module.is_empty()) {
        for to in imports.iter().filter_map(|to| to.first()) {
            if let Err(why) = allowed(&module[0], reexported(to)) {
                faults.push(format!("src/{}: {why}", graph.files[module].display()));
            }
        }
    }
    assert!(faults.is_empty(), "imports against the order of lib.rs:\n{}", faults.join("\n"));
}

#[test]
fn no_files_import_each_other_in_a_ring() {
    let graph = of_src();
    let name = |module: &Module| graph.files[module].display().to_string();
    let line = |ring: &Vec<Module>| ring.iter().map(name).collect::<Vec<_>>().join(" → ");
    let rings: Vec<String> = graph.rings().iter().map(line).collect();
    assert!(rings.is_empty(), "rings of imports (the last file imports the first):\n{}", rings.join("\n"));
}

/// Oracle: imports written here by hand.
#[test]
fn the_reader_of_imports_sees_what_is_there() {
    let source = r#"
//! crate::cli in a comment
use crate::error::{Error, Result};
use crate::{math::float, scene::{Scene, ids}, plan};
use super::pixel::Pixel;
use super::super::render::X as Y;
pub use tone::curve;
const S: &str = "crate::transport"; // crate::stats
pub(crate) fn f() -> crate::Error { my_crate::backend::g(); self::hdr::write(); other::thing() }
#[cfg(test)]
mod tests { use crate::cli::X; }
"#;
    let module = |path: &str| path.split("::").filter(|p| !p.is_empty()).map(String::from).collect::<Module>();
    let others = "error math::float math scene scene::ids plan film film::pixel render film::png::tone film::png::hdr \
                  backend stats transport cli";
    let mut sources: BTreeMap<_, _> =
        others.split_whitespace().map(|name| (module(name), (name.into(), String::new()))).collect();
    sources.insert(module("film::png"), ("film/png/mod.rs".into(), source.into()));
    sources.insert(module("film::png::tone"), ("film/png/tone.rs".into(), "use super::Format;".into()));
    sources.insert(Module::new(), ("lib.rs".into(), String::new()));
    let graph = Graph::of(sources);
    let mut seen: Vec<String> = graph.imports[&module("film::png")].iter().map(|m| m.join("::")).collect();
    seen.sort();
    let expected =
        ["", "error", "film::pixel", "film::png::hdr", "film::png::tone", "math::float", "plan", "render", "scene"];
    assert_eq!(seen[..8], expected[..8]);
    assert!(seen.contains(&"scene::ids".into()) && seen.len() == 10, "{seen:?}");
    assert_eq!(graph.rings(), [vec![module("film::png"), module("film::png::tone")]]);
    assert!(!code_of(source).contains("stats"));
    let modules: BTreeSet<Module> = graph.files.keys().cloned().collect();
    assert_eq!(owner(&module("main"), &module("pathspace::scene::Mesh"), &modules), Some(module("scene")));
    assert_eq!(owner(&module("scene"), &module("std::fs"), &modules), None);

    assert!(allowed("film", "plan").is_ok() && allowed("shading", "texture").is_ok());
    assert!(allowed("texture", "scene").is_err() && allowed("shading", "sampler").is_err());
    assert!(allowed("film", "render").is_err() && allowed("film", "nowhere").is_err());
}
