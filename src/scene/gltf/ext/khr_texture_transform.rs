//! KHR_texture_transform: uv' = offset + R·(scale·uv), R the rotation by which the uvs turn counter-clockwise on the
//! image (v runs down): what the extension's text and its example of a quadrant say, and what three.js and the Khronos
//! viewer do; the sample code in its README turns the other way.

use glam::{DMat2, DVec2};

use super::super::document::Document;
use super::super::uv::UvChannel;
use super::extension::{Extension, Place};
use crate::error::Result;

pub(super) const EXTENSION: Extension = Extension { name: "KHR_texture_transform", place: Place::TextureInfo };

/// What the texture information at `pointer` reads; `set` is its own `texCoord`.
pub(crate) fn channel(document: &Document, set: u32, pointer: &str) -> Result<UvChannel> {
    let at = |member: &str| format!("{pointer}/extensions/{}/{member}", EXTENSION.name);
    let number = |member: &str, default: f64| match document.value(&at(member)) {
        None => Ok(default),
        Some(value) => value
            .as_f64()
            .filter(|number| (*number as f32).is_finite())
            .ok_or_else(|| document.error(at(member), format!("expected a finite number, found {value}"))),
    };
    let pair = |member: &str, default: f64| -> Result<DVec2> {
        Ok(DVec2::new(number(&format!("{member}/0"), default)?, number(&format!("{member}/1"), default)?))
    };
    let set = match document.value(&at("texCoord")) {
        None => set,
        Some(value) => value
            .as_u64()
            .and_then(|set| u32::try_from(set).ok())
            .ok_or_else(|| document.error(at("texCoord"), format!("expected the number of a set, found {value}")))?,
    };
    let rotation = DMat2::from_angle(-number("rotation", 0.0)?);
    Ok(UvChannel { set, linear: rotation * DMat2::from_diagonal(pair("scale", 1.0)?), offset: pair("offset", 0.0)? })
}
