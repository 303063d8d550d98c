//! What of a file is shown, where it holds several of a kind: a scene, an animation, a variant of its materials. Each
//! is chosen by name, or by number from 0 where nothing has that name.
//!
//! Source: glTF 2.0 §3.5.1, KHR_materials_variants. A choice is written into the document before anything else is
//! read, so that readers know of none.

use serde_json::Value;

use super::super::LoadOptions;
use super::document::Document;
use super::ext::khr_materials_variants;
use super::json::one_line;
use crate::error::{Error, Result};

/// Names that an error lists at most.
const LISTED: usize = 20;

/// Chooses scene and variant as the options say; returns the chosen animation.
pub(super) fn apply(document: &mut Document, options: &LoadOptions) -> Result<Option<usize>> {
    if let Some(wanted) = &options.scene {
        let scene = named(document, "/scenes", "--scene", wanted)?;
        document.set("/scene", scene.into());
    }
    if let Some(wanted) = &options.variant {
        let variant = named(document, khr_materials_variants::LIST, "--variant", wanted)?;
        khr_materials_variants::apply(document, variant)?;
    }
    let animation = options.animation.as_ref();
    animation.map(|wanted| named(document, "/animations", "--animation", wanted)).transpose()
}

/// Names of the objects in the table at `table`, empty where they have none.
pub(super) fn names(document: &Document, table: &str) -> Result<Vec<String>> {
    let name = |object: &Value| object.get("name").and_then(Value::as_str).map_or_else(String::new, one_line);
    Ok(document.array(table)?.iter().map(name).collect())
}

/// The place in a table of what is wanted.
fn named(document: &Document, table: &str, option: &'static str, wanted: &str) -> Result<usize> {
    let names = names(document, table)?;
    let by_name = names.iter().position(|name| name == wanted);
    let by_number = || wanted.parse().ok().filter(|&index: &usize| index < names.len());
    by_name.or_else(by_number).ok_or_else(|| {
        let mut listed: Vec<String> = names.iter().take(LISTED).map(|name| format!("'{name}'")).collect();
        if names.len() > LISTED {
            listed.push(format!("{} more", names.len() - LISTED));
        }
        let there = if listed.is_empty() { "none".into() } else { listed.join(", ") };
        Error::Option { option, problem: format!("'{}' is not in the file, which has {there}", one_line(wanted)) }
    })
}
