//! EXT_lights_ies: point lights with the intensities of a photometric file ([`ies`]). 1 cd is taken as 1 W/sr, as for
//! KHR_lights_punctual. The lamp shines along the node's −Z; the node's scale does not count.
//!
//! Not read: type B photometry, which the text asks for, and type A are refused; the tilt of lamps is left out with a
//! warning, as the text allows.

use std::sync::Arc;

use glam::{DVec3, Mat3, Vec3};

use super::super::document::Document;
use super::super::node::Placed;
use super::super::pose::rigid_pose;
use super::super::uri::Resource;
use super::extension::{Extension, Place};
use crate::error::Result;
use crate::input;
use crate::plain::one_line;
use crate::scene::ies::{self, Photometry};
use crate::scene::light::{Aimed, PunctualKind, PunctualLight};

pub(super) const EXTENSION: Extension = Extension { name: "EXT_lights_ies", place: Place::Node };

/// The media type of photometric files in buffers.
const MIME_TYPE: &str = "application/x-ies-lm-63";

/// Bytes of a photometric file at most: far more than any has.
const LARGEST_FILE: u64 = 64 << 20;

/// The lamp that hangs on a node.
pub(crate) fn read(document: &Document, node: &Placed, index: usize, origin: DVec3) -> Result<PunctualLight> {
    let instance = format!("{}/extensions/EXT_lights_ies", node.pointer);
    let pointer = format!("/extensions/EXT_lights_ies/lights/{index}");
    let Photometry { profile, most_cd, tilts } = photometry(document, &pointer)?;
    if tilts {
        document.warn(&pointer, "states the tilt of its lamp, which is not read");
    }
    let number = |member: &str, default: f32| match document.value(&format!("{instance}/{member}")) {
        None => Ok(default),
        Some(value) => {
            let found = value.as_f64().map(|number| number as f32).filter(|number| number.is_finite());
            let at = format!("{instance}/{member}");
            let found = found.ok_or_else(|| document.error(&at, format!("expected a number, found {value}")))?;
            if found < 0.0 {
                document.warn(at, format!("{found} is negative and clamped to 0"));
            }
            Ok(found.max(0.0))
        }
    };
    let multiplier = number("multiplier", 1.0)?;
    let mut intensity = Vec3::ZERO;
    for channel in 0..3 {
        let color = number(&format!("color/{channel}"), 1.0)?.min(1.0);
        intensity[channel] = document.finite(color * multiplier * most_cd, &format!("{instance}/multiplier"))?;
    }
    let Some(pose) = rigid_pose(&node.world_from_node) else {
        return Err(document.error(&node.pointer, "expected a node with an orientation, found a scale of zero"));
    };
    let light_from_world: Mat3 = pose.matrix3.transpose().as_mat3();
    let name = document.text(&format!("{pointer}/name"))?.filter(|name| !name.is_empty()).map(str::to_owned);
    Ok(PunctualLight {
        name: name.or_else(|| node.name.clone()).unwrap_or_else(|| format!("photometric light {index}")),
        position: (node.world_from_node.translation - origin).as_vec3(),
        direction: (-pose.matrix3.z_axis).as_vec3(),
        intensity,
        kind: PunctualKind::Point,
        range_m: f32::INFINITY,
        profile: Some(Aimed { profile: Arc::new(profile), light_from_world }),
    })
}

/// The table of a lamp. The error names the line.
fn photometry(document: &Document, pointer: &str) -> Result<Photometry> {
    let at = |member: &str| format!("{pointer}/{member}");
    if document.value(pointer).is_none() {
        return Err(document.error(pointer, "expected a light profile, found nothing"));
    }
    let (uri, view) = (document.text(&at("uri"))?, document.value(&at("bufferView")));
    let parsed = |bytes: &[u8], file: &str| {
        ies::parse(bytes).map_err(|found| {
            document.error(pointer, one_line(&format!("{file}line {}: {}", found.line, found.problem)))
        })
    };
    match (uri, view) {
        (Some(uri), None) => match document.locate(uri, &at("uri"))? {
            Resource::Inline(bytes) => parsed(&bytes, ""),
            Resource::File(path) => {
                let path = document.admit(&path).map_err(|problem| document.error(at("uri"), problem))?;
                let length = std::fs::metadata(&path).map_or(0, |data| data.len());
                if length > LARGEST_FILE {
                    let problem = format!("expected a file of at most {LARGEST_FILE} bytes, found {length}");
                    return Err(document.error(at("uri"), problem));
                }
                let bytes = input::read(&path).map_err(|source| crate::Error::io(&path, "read", source))?;
                parsed(&bytes, &format!("{}, ", path.display()))
            }
        },
        (None, Some(view)) => {
            if document.text(&at("mimeType"))? != Some(MIME_TYPE) {
                return Err(document.error(at("mimeType"), format!("expected {MIME_TYPE}, found another or none")));
            }
            let index = document.index(view, &at("bufferView"))?;
            parsed(document.view(index, &at("bufferView"))?.bytes, "")
        }
        _ => Err(document.error(pointer, "expected a uri or a bufferView, found neither or both")),
    }
}
