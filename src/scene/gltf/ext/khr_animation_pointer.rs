//! KHR_animation_pointer: animations of anything. Translations, rotations, scales and weights of nodes move like those
//! of other channels (`animation`); members of materials, lights, cameras and switches of visibility are written into
//! the document as they are when the shutter opens.
//!
//! Limits: those stand still while the shutter is open; weights of meshes and all other members are named and not
//! animated.

use serde_json::Value;

use super::super::animation::{POINTER, Pointed};
use super::super::document::Document;
use super::extension::{Extension, Place};
use crate::scene::motion::Unmoved;

pub(super) const EXTENSION: Extension = Extension { name: POINTER, place: Place::None };

/// Where members are animated; switches of visibility besides.
const TABLES: [&str; 3] = ["/materials/", "/cameras/", "/extensions/KHR_lights_punctual/lights/"];

/// Writes values into the document; what moves later is returned.
pub(crate) fn apply(document: &mut Document, pointed: Vec<Pointed>) -> Vec<Unmoved> {
    let mut unmoved = Vec::new();
    for Pointed { pointer, value, moves } in pointed {
        let is_switch = pointer.starts_with("/nodes/") && pointer.ends_with("/extensions/KHR_node_visibility/visible");
        let value = if is_switch { Value::Bool(value.as_f64() != Some(0.0)) } else { value };
        let known = is_switch || TABLES.iter().any(|table| pointer.starts_with(table));
        if !known || !document.set_below(&pointer, value) {
            document.warn(&pointer, "is driven by an animation and not animated");
        } else if moves {
            unmoved.push(Unmoved {
                what: format!("animation of {pointer}"),
                why: "it stands as the shutter opens".into(),
            });
        }
    }
    unmoved
}
