//! Cameras of the file.
//!
//! Source: glTF 2.0 §3.10. A camera's node may be scaled; the scale is removed, keeping the view and up directions.
//! `znear` and `zfar` belong to depth buffers and are not read.

use glam::{Affine3A, DAffine3, DVec3};
use serde_json::Value;

use super::super::{Camera, Projection};
use super::document::Document;
use super::json::{brief, one_line};
use super::node::Placed;
use super::pose::{rigid_pose, to_f32};
use crate::error::Result;

/// The camera that hangs on a node.
pub(super) fn read(document: &Document, node: &Placed, index: usize, origin: DVec3) -> Result<Camera> {
    if index >= document.table("cameras")?.len() {
        return Err(document.out_of_range("cameras", index, &format!("{}/camera", node.pointer)));
    }
    let pointer = format!("/cameras/{index}");
    let at = |member: &str| format!("{pointer}/{member}");
    let number = |member: &str| match document.value(&at(member)) {
        None => Ok(None),
        Some(value) => match value.as_f64() {
            Some(number) => Ok(Some(number as f32)),
            None => Err(document.error(at(member), format!("expected a number, found {}", brief(value)))),
        },
    };
    let needed = |member: &str| -> Result<f32> {
        number(member)?.ok_or_else(|| document.error(at(member), "expected a number, found nothing"))
    };
    let projection = match document.text(&at("type"))? {
        Some("perspective") => {
            let yfov_rad = needed("perspective/yfov")?;
            if !(yfov_rad > 0.0 && yfov_rad < std::f32::consts::PI) {
                let problem = format!("expected an angle in (0, π), found {yfov_rad}");
                return Err(document.error(at("perspective/yfov"), problem));
            }
            let aspect = number("perspective/aspectRatio")?;
            if let Some(aspect) = aspect.filter(|aspect| !(aspect.is_finite() && *aspect > 0.0)) {
                let problem = format!("expected a number above 0, found {aspect}");
                return Err(document.error(at("perspective/aspectRatio"), problem));
            }
            Projection::Perspective { yfov_rad, aspect }
        }
        Some("orthographic") => {
            let magnification = |member: &str| -> Result<f32> {
                let value = document.finite(needed(member)?, &at(member))?;
                if value == 0.0 {
                    return Err(document.error(at(member), "expected a number other than 0, found 0"));
                }
                if value < 0.0 {
                    document.warn(at(member), format!("{value} is negative; its magnitude is used"));
                }
                Ok(value.abs())
            };
            Projection::Orthographic {
                xmag_m: magnification("orthographic/xmag")?,
                ymag_m: magnification("orthographic/ymag")?,
            }
        }
        other => {
            let problem = format!("expected perspective or orthographic, found {}", other.unwrap_or("nothing"));
            return Err(document.error(at("type"), problem));
        }
    };
    let world_from_camera = placed(&node.world_from_node, origin).ok_or_else(|| {
        document.error(&node.pointer, "expected a node with an orientation for its camera, found a scale of zero")
    })?;
    Ok(Camera {
        name: document
            .value(&at("name"))
            .and_then(Value::as_str)
            .or(node.name.as_deref())
            .map_or_else(|| format!("camera {index}"), one_line),
        world_from_camera,
        projection,
    })
}

/// Camera to world of a camera whose node is at `world_from_node`; `None` where that has no orientation.
pub(super) fn placed(world_from_node: &DAffine3, origin: DVec3) -> Option<Affine3A> {
    let pose = rigid_pose(world_from_node)?;
    Some(to_f32(&DAffine3 { translation: pose.translation - origin, ..pose }))
}
