//! KHR_node_visibility: a node that is not visible shows neither its mesh and light nor those of the nodes below it.
//! Cameras and joints are not affected.

use serde_json::Value;

use super::super::document::Document;
use super::super::json::brief;
use super::extension::{Extension, Place};
use crate::error::Result;

pub(super) const EXTENSION: Extension = Extension { name: "KHR_node_visibility", place: Place::Node };

/// Whether the node at `node` is visible where those above it are.
pub(crate) fn is_visible(document: &Document, node: &str) -> Result<bool> {
    let pointer = format!("{node}/extensions/{}/visible", EXTENSION.name);
    match document.value(&pointer) {
        None => Ok(true),
        Some(Value::Bool(visible)) => Ok(*visible),
        Some(other) => Err(document.error(&pointer, format!("expected true or false, found {}", brief(other)))),
    }
}
