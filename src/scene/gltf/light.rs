//! Punctual lights of `KHR_lights_punctual`. 1 cd is taken as 1 W/sr and 1 lx as 1 W/m²; angles in radians.
//!
//! Limit: `range` is a rasteriser's cut-off without physical meaning and is ignored with a warning.

use glam::{DVec3, Vec3};
use gltf::json::extensions::scene::khr_lights_punctual::{Light, Type};

use super::super::{PunctualKind, PunctualLight};
use super::document::Document;
use super::node::Placed;
use crate::error::Result;

/// The light that hangs on a node.
pub(super) fn read(document: &Document, node: &Placed, index: usize, origin: DVec3) -> Result<PunctualLight> {
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
    if light.range.is_some() {
        document.warn(&pointer, "range is ignored: light falls off with the square of the distance for ever");
    }
    let kind = match document.checked(light.type_, &at("type"))? {
        Type::Directional => PunctualKind::Directional,
        Type::Point => PunctualKind::Point,
        Type::Spot => {
            let spot = light
                .spot
                .ok_or_else(|| document.error(at("spot"), "expected the angles of a spot light, found none"))?;
            let (inner, outer) = (spot.inner_cone_angle, spot.outer_cone_angle);
            if !(0.0 <= inner && inner < outer && outer <= std::f32::consts::FRAC_PI_2) {
                let problem = format!("expected 0 ≤ innerConeAngle < outerConeAngle ≤ π/2, found {inner} and {outer}");
                return Err(document.error(at("spot"), problem));
            }
            PunctualKind::Spot { cos_inner: inner.cos(), cos_outer: outer.cos() }
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
    })
}

fn at_least_zero(document: &Document, value: f32, pointer: &str) -> Result<f32> {
    if document.finite(value, pointer)? < 0.0 {
        document.warn(pointer, format!("{value} is negative and clamped to 0"));
    }
    Ok(value.max(0.0))
}
