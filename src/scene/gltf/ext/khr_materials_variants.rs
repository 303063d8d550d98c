//! KHR_materials_variants: other materials of primitives under one name. The chosen variant's are written over the
//! primitives' own; without a choice those stand.

use serde_json::Value;

use super::super::document::Document;
use super::extension::{Extension, Place};
use crate::error::Result;

pub(crate) const NAME: &str = "KHR_materials_variants";

pub(super) const EXTENSION: Extension = Extension { name: NAME, place: Place::None };

/// Where variants are listed.
pub(crate) const LIST: &str = "/extensions/KHR_materials_variants/variants";

/// Gives every primitive the material that it has in variant `variant`, if it has another there.
pub(crate) fn apply(document: &mut Document, variant: usize) -> Result<()> {
    let mut changes = Vec::new();
    for mesh in 0..document.table("meshes")?.len() {
        for place in 0..document.array(&format!("/meshes/{mesh}/primitives"))?.len() {
            let primitive = format!("/meshes/{mesh}/primitives/{place}");
            let mappings = document.array(&format!("{primitive}/extensions/{}/mappings", EXTENSION.name))?;
            let is_meant = |mapping: &&Value| {
                let variants = mapping.get("variants").and_then(Value::as_array);
                variants.is_some_and(|variants| variants.iter().any(|other| other.as_u64() == Some(variant as u64)))
            };
            let material = mappings.iter().find(is_meant).and_then(|mapping| mapping.get("material"));
            changes.extend(material.map(|material| (format!("{primitive}/material"), material.clone())));
        }
    }
    for (pointer, material) in changes {
        document.set(&pointer, material);
    }
    Ok(())
}
