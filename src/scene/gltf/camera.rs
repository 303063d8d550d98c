//! Cameras of the file, and the one that is framed when the file has none.
//!
//! Source: glTF 2.0 §3.10. A camera's node may be scaled; the scale is removed, keeping the view and up directions.
//! `znear` and `zfar` belong to depth buffers and are not read.

use glam::{Affine3A, DAffine3, DMat3, DVec3};
use gltf::json::camera::Type;

use super::super::{Camera, Projection};
use super::document::Document;
use super::json::one_line;
use super::moving::to_f32;
use super::node::Placed;
use crate::error::Result;

/// Vertical field of view of the automatic camera: that of a 50 mm lens over 24 mm of film height, 2·atan(12/50).
const FRAMED_YFOV_RAD: f64 = 0.471_089_96;

/// The camera that hangs on a node.
pub(super) fn read(document: &Document, node: &Placed, index: usize, origin: DVec3) -> Result<Camera> {
    let camera: gltf::json::Camera = document.element("cameras", index, &format!("{}/camera", node.pointer))?;
    let pointer = format!("/cameras/{index}");
    let at = |member: &str| format!("{pointer}/{member}");
    let projection =
        match document.checked(camera.type_, &at("type"))? {
            Type::Perspective => {
                let perspective = camera
                    .perspective
                    .ok_or_else(|| document.error(at("perspective"), "expected an object, found nothing"))?;
                let yfov_rad = perspective.yfov;
                if !(yfov_rad > 0.0 && yfov_rad < std::f32::consts::PI) {
                    return Err(document
                        .error(at("perspective/yfov"), format!("expected an angle in (0, π), found {yfov_rad}")));
                }
                let aspect = perspective.aspect_ratio;
                if let Some(aspect) = aspect.filter(|aspect| !(aspect.is_finite() && *aspect > 0.0)) {
                    return Err(document
                        .error(at("perspective/aspectRatio"), format!("expected a number above 0, found {aspect}")));
                }
                Projection::Perspective { yfov_rad, aspect }
            }
            Type::Orthographic => {
                let orthographic = camera
                    .orthographic
                    .ok_or_else(|| document.error(at("orthographic"), "expected an object, found nothing"))?;
                let magnification = |value: f32, member: &str| -> Result<f32> {
                    let value = document.finite(value, &at(member))?;
                    if value == 0.0 {
                        return Err(document.error(at(member), "expected a number other than 0, found 0"));
                    }
                    if value < 0.0 {
                        document.warn(at(member), format!("{value} is negative; its magnitude is used"));
                    }
                    Ok(value.abs())
                };
                Projection::Orthographic {
                    xmag_m: magnification(orthographic.xmag, "orthographic/xmag")?,
                    ymag_m: magnification(orthographic.ymag, "orthographic/ymag")?,
                }
            }
        };
    let world_from_camera = placed(&node.world_from_node, origin).ok_or_else(|| {
        document.error(&node.pointer, "expected a node with an orientation for its camera, found a scale of zero")
    })?;
    Ok(Camera {
        name: camera
            .name
            .as_ref()
            .or(node.name.as_ref())
            .map_or_else(|| format!("camera {index}"), |name| one_line(name)),
        world_from_camera,
        projection,
    })
}

/// Camera to world of a camera whose node is at `world_from_node`; `None` where that has no orientation.
pub(super) fn placed(world_from_node: &DAffine3, origin: DVec3) -> Option<Affine3A> {
    let pose = rigid_pose(world_from_node)?;
    Some(to_f32(&DAffine3 { translation: pose.translation - origin, ..pose }))
}

/// `world_from_node` without its scale; `None` where that has no orientation.
pub(super) fn rigid_pose(world_from_node: &DAffine3) -> Option<DAffine3> {
    Some(DAffine3 { matrix3: rigid(world_from_node.matrix3)?, translation: world_from_node.translation })
}

/// The rotation that looks along the same −Z with the same up direction.
fn rigid(linear: DMat3) -> Option<DMat3> {
    let z = linear.z_axis.try_normalize()?;
    // Where up lies along the view (a flattened node), any perpendicular serves.
    let y = (linear.y_axis - z * z.dot(linear.y_axis)).try_normalize().unwrap_or_else(|| z.any_orthonormal_vector());
    Some(DMat3::from_cols(y.cross(z), y, z))
}

/// A camera in front of the scene (glTF assets face +Z) from which the sphere around its bounds fills the height.
pub(super) fn framed(least: DVec3, most: DVec3) -> Camera {
    let radius = 0.5 * (most - least).length();
    let distance = radius / (0.5 * FRAMED_YFOV_RAD).sin();
    let eye = 0.5 * (least + most) + DVec3::Z * distance;
    Camera {
        name: "automatic".into(),
        world_from_camera: Affine3A::from_translation(eye.as_vec3()),
        projection: Projection::Perspective { yfov_rad: FRAMED_YFOV_RAD as f32, aspect: Some(1.0) },
    }
}
