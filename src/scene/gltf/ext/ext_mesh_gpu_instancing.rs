//! EXT_mesh_gpu_instancing: a node's mesh shown many times, each with its own translation, rotation and scale below the
//! node. Other attributes of instances (their names begin with `_`) are the application's and not read.

use glam::{DAffine3, DQuat, DVec3, DVec4};

use super::super::accessor::Accessor;
use super::super::document::Document;
use super::extension::{Extension, Place};
use crate::error::Result;

pub(super) const EXTENSION: Extension = Extension { name: "EXT_mesh_gpu_instancing", place: Place::Node };

/// Instance to node, of every instance of the node at `node`; `None` if its mesh is shown once.
pub(crate) fn placements(document: &Document, node: &str) -> Result<Option<Vec<DAffine3>>> {
    let pointer = format!("{node}/extensions/{}", EXTENSION.name);
    if document.value(&pointer).is_none() {
        return Ok(None);
    }
    let open = |name: &str, components: usize| -> Result<Option<Accessor>> {
        let at = format!("{pointer}/attributes/{name}");
        let Some(value) = document.value(&at) else { return Ok(None) };
        let accessor = Accessor::open(document, document.index(value, &at)?, &at)?;
        accessor.expect_components(document, &[components])?;
        accessor.expect_floats(document, name == "ROTATION")?;
        Ok(Some(accessor))
    };
    let (translation, rotation, scale) = (open("TRANSLATION", 3)?, open("ROTATION", 4)?, open("SCALE", 3)?);
    let all = [&translation, &rotation, &scale];
    let mut given = all.into_iter().flatten();
    let Some(count) = given.next().map(|first| first.count) else {
        let problem = "expected TRANSLATION, ROTATION or SCALE, found none of them";
        return Err(document.error(format!("{pointer}/attributes"), problem));
    };
    if let Some(other) = given.find(|other| other.count != count) {
        let problem = format!("expected {count} instances as the attribute before has, found {}", other.count);
        return Err(document.error(format!("{}/count", other.pointer), problem));
    }
    document.charge(count, &pointer)?;
    let vector = |accessor: &Option<Accessor>, i: usize, default: DVec3| {
        accessor.as_ref().map_or(default, |accessor| DVec3::from_array(accessor.vector::<3>(i).map(f64::from)))
    };
    let placement = |i: usize| {
        let turned = match &rotation {
            None => DQuat::IDENTITY,
            Some(rotation) => {
                let value = DVec4::from_array(rotation.vector::<4>(i).map(f64::from)).try_normalize();
                let problem = || format!("expected a unit quaternion, found one without direction (instance {i})");
                DQuat::from_vec4(value.ok_or_else(|| document.error(&rotation.pointer, problem()))?)
            }
        };
        let (moved, scaled) = (vector(&translation, i, DVec3::ZERO), vector(&scale, i, DVec3::ONE));
        let placed = DAffine3::from_scale_rotation_translation(scaled, turned, moved);
        let problem = || document.error(&pointer, format!("expected finite placements, found none at instance {i}"));
        if placed.is_finite() { Ok(placed) } else { Err(problem()) }
    };
    (0..count).map(placement).collect::<Result<_>>().map(Some)
}
