//! EXT_texture_webp: an image in WebP beside or instead of the texture's `source`. It is the better one; `source` is
//! for readers without WebP.

use super::super::document::Document;
use super::extension::{Extension, Place};
use super::texture_source;
use crate::error::Result;

pub(super) const EXTENSION: Extension = Extension { name: "EXT_texture_webp", place: Place::Texture };

/// The image of the texture at `pointer` and the pointer that names it.
pub(crate) fn source(document: &Document, pointer: &str) -> Result<Option<(usize, String)>> {
    texture_source::named(document, pointer, EXTENSION.name)
}
