//! What extensions that bring another format of images to textures have in common: a `source` of their own.

use super::super::document::Document;
use crate::error::Result;

/// The image that extension `name` gives the texture at `pointer`, and the pointer that names it.
pub(super) fn named(document: &Document, pointer: &str, name: &str) -> Result<Option<(usize, String)>> {
    let source = format!("{pointer}/extensions/{name}/source");
    let Some(value) = document.value(&source) else { return Ok(None) };
    match value.as_u64().and_then(|image| usize::try_from(image).ok()) {
        Some(image) => Ok(Some((image, source))),
        None => Err(document.error(&source, format!("expected the number of an image, found {value}"))),
    }
}
