//! KHR_texture_basisu: an image of Basis Universal (KTX2) beside or instead of the texture's `source`, which is for
//! readers without it.

use super::super::document::Document;
use super::extension::{Extension, Place};
use super::texture_source;
use crate::error::Result;

pub(super) const EXTENSION: Extension = Extension { name: "KHR_texture_basisu", place: Place::Texture };

/// The image of the texture at `pointer` and the pointer that names it.
pub(crate) fn source(document: &Document, pointer: &str) -> Result<Option<(usize, String)>> {
    texture_source::named(document, pointer, EXTENSION.name)
}
