//! KHR_lights_punctual: point, spot and directional lights. 1 cd is taken as 1 W/sr and 1 lx as 1 W/m²; angles in
//! radians.

use glam::{DVec3, Vec3};
use gltf::json::extensions::scene::khr_lights_punctual::{Light, Type};
use serde_json::Value;

use super::super::document::Document;
use super::super::node::Placed;
use super::extension::{Extension, Place};
use crate::error::Result;
use crate::scene::{PunctualKind, PunctualLight};

pub(super) const EXTENSION: Extension = Extension { name: "KHR_lights_punctual", place: Place::Node };

/// The light that hangs on a node.
pub(crate) fn read(document: &Document, node: &Placed, index: usize, origin: DVec3) -> Result<PunctualLight> {
    let table = "extensions/KHR_lights_punctual/lights";
    let from = format!("{}/extensions/KHR_lights_punctual/light", node.pointer);
    let pointer = format!("/{table}/{index}");
    let light: Light = document.element(table, index, &from)?;
    let at = |member: &str| format!("{pointer}/{member}");

    let strength = at_least_zero(document, light.intensity, &at("intensity"))?;
    let mut intensity = Vec3::ZERO;
    for channel in 0..3 {
        let color = at_least_zero(document, light.color[channel], &at(&format!("color/{channel}")))?;
        intensity[channel] = document.finite(color * strength, &at("intensity"))?;
    }
    let range_m = light.range.unwrap_or(f32::INFINITY);
    if !(range_m > 0.0) {
        return Err(document.error(at("range"), format!("expected a distance above 0, found {range_m}")));
    }
    let kind = match document.checked(light.type_, &at("type"))? {
        Type::Directional => PunctualKind::Directional,
        Type::Point => PunctualKind::Point,
        Type::Spot => {
            let spot = light
                .spot
                .ok_or_else(|| document.error(at("spot"), "expected the angles of a spot light, found none"))?;
            // As the file has them: angles that differ in f64 alone are still two.
            let stated = |member: &str, read: f32| {
                let value = document.value(&at(&format!("spot/{member}"))).and_then(Value::as_f64);
                value.unwrap_or_else(|| f64::from(read))
            };
            let inner = stated("innerConeAngle", spot.inner_cone_angle);
            let outer = stated("outerConeAngle", spot.outer_cone_angle);
            // π/2 may be written as the f32 above it.
            if !(0.0 <= inner && inner < outer && outer as f32 <= std::f32::consts::FRAC_PI_2) {
                let expected = "expected 0 ≤ innerConeAngle < outerConeAngle ≤ π/2";
                let problem = format!("{expected}, found {inner} and {outer}");
                return Err(document.error(at("spot"), problem));
            }
            PunctualKind::Spot { cos_inner: (inner as f32).cos(), cos_outer: (outer as f32).cos() }
        }
    };
    let direction = (-node.world_from_node.matrix3.z_axis).try_normalize().map(|direction| direction.as_vec3());
    let direction = match (kind, direction) {
        (_, Some(direction)) => direction,
        (PunctualKind::Point, None) => Vec3::NEG_Z,
        (_, None) => {
            return Err(document.error(&node.pointer, "expected a node with an orientation, found a scale of zero"));
        }
    };
    Ok(PunctualLight {
        name: light.name.or_else(|| node.name.clone()).unwrap_or_else(|| format!("light {index}")),
        position: (node.world_from_node.translation - origin).as_vec3(),
        direction,
        intensity,
        kind,
        range_m,
        profile: None,
    })
}

fn at_least_zero(document: &Document, value: f32, pointer: &str) -> Result<f32> {
    if document.finite(value, pointer)? < 0.0 {
        document.warn(pointer, format!("{value} is negative and clamped to 0"));
    }
    Ok(value.max(0.0))
}
