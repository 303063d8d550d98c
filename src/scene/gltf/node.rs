//! The node tree, flattened to one level: world transforms in f64, and what hangs on each node.
//!
//! Source: glTF 2.0 §3.5.3. Transforms are read from the JSON text as f64, not through the crate's f32, so that scenes far from
//! the origin keep their precision. The walk keeps its own stack: depth is bounded by the number of nodes only.
//! A node reached twice (a cycle, or two parents) is an error.

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, DVec4};
use serde_json::Value;

use super::document::Document;
use super::json::brief;
use crate::error::Result;

/// A node that carries something.
#[derive(Debug)]
pub(super) struct Placed {
    /// `/nodes/N`.
    pub(super) pointer: String,
    pub(super) name: Option<String>,
    pub(super) world_from_node: DAffine3,
    pub(super) mesh: Option<usize>,
    pub(super) camera: Option<usize>,
    pub(super) light: Option<usize>,
}

/// The chosen scene's nodes that carry something, parents before children, in file order.
pub(super) fn flatten(document: &Document) -> Result<Vec<Placed>> {
    let nodes = document.table("nodes")?;
    let mut reached = vec![false; nodes.len()];
    let mut placed = Vec::new();
    // Pending nodes with their parent's transform and the pointer that refers to them; the last is visited next.
    let mut pending: Vec<(usize, DAffine3, String)> = Vec::new();
    for (root, from) in roots(document)?.into_iter().rev() {
        pending.push((root, DAffine3::IDENTITY, from));
    }
    while let Some((index, world_from_parent, from)) = pending.pop() {
        let node = nodes.get(index).ok_or_else(|| document.out_of_range("nodes", index, &from))?;
        if std::mem::replace(&mut reached[index], true) {
            let problem =
                format!("node {index} is reached a second time: the nodes form a cycle, or it has two parents");
            return Err(document.error(from, problem));
        }
        let pointer = format!("/nodes/{index}");
        let reader = Reader { document, node, pointer: &pointer };
        let world_from_node = world_from_parent * reader.parent_from_node()?;
        if !world_from_node.is_finite() {
            return Err(document.error(pointer, "expected a finite world transform, found one that overflows"));
        }
        for (place, child) in reader.array("children")?.iter().enumerate().rev() {
            let from = format!("{pointer}/children/{place}");
            pending.push((index_value(document, child, &from)?, world_from_node, from));
        }
        let mesh = reader.index("/mesh")?;
        let camera = reader.index("/camera")?;
        let light = reader.index("/extensions/KHR_lights_punctual/light")?;
        if mesh.is_some() || camera.is_some() || light.is_some() {
            reader.warn_ignored();
            let name = node.get("name").and_then(Value::as_str).map(str::to_owned);
            placed.push(Placed { pointer, name, world_from_node, mesh, camera, light });
        }
    }
    Ok(placed)
}

/// Pointer of the chosen scene (glTF 2.0 §3.5.1: the default one, else the first), if the file has scenes.
pub(super) fn chosen_scene(document: &Document) -> Result<Option<String>> {
    let scenes = document.table("scenes")?.len();
    let chosen = match document.value("/scene") {
        Some(value) => index_value(document, value, "/scene")?,
        None if scenes == 0 => return Ok(None),
        None => 0,
    };
    if chosen >= scenes {
        return Err(document.out_of_range("scenes", chosen, "/scene"));
    }
    Ok(Some(format!("/scenes/{chosen}")))
}

/// Root nodes of the chosen scene and the pointers that name them; every parentless node if the file has no scenes.
fn roots(document: &Document) -> Result<Vec<(usize, String)>> {
    if let Some(scene) = chosen_scene(document)? {
        let pointer = format!("{scene}/nodes");
        let listed = document.array(&pointer)?.iter().enumerate();
        return listed
            .map(|(place, root)| {
                let from = format!("{pointer}/{place}");
                Ok((index_value(document, root, &from)?, from))
            })
            .collect();
    }
    let nodes = document.table("nodes")?;
    let mut is_child = vec![false; nodes.len()];
    for child in nodes.iter().filter_map(|node| node.get("children")?.as_array()).flatten().filter_map(Value::as_u64) {
        if let Some(mark) = usize::try_from(child).ok().and_then(|child| is_child.get_mut(child)) {
            *mark = true;
        }
    }
    if !nodes.is_empty() && is_child.iter().all(|&child| child) {
        return Err(document.error("/nodes", "expected a node without a parent, found none: the nodes form a cycle"));
    }
    Ok((0..nodes.len()).filter(|&node| !is_child[node]).map(|node| (node, format!("/nodes/{node}"))).collect())
}

fn index_value(document: &Document, value: &Value, pointer: &str) -> Result<usize> {
    let index = value.as_u64().and_then(|index| usize::try_from(index).ok());
    index.ok_or_else(|| document.error(pointer, format!("expected an index, found {}", brief(value))))
}

struct Reader<'d> {
    document: &'d Document,
    node: &'d Value,
    pointer: &'d str,
}

impl Reader<'_> {
    /// The node's local transform: `matrix`, or translation · rotation · scale.
    fn parent_from_node(&self) -> Result<DAffine3> {
        if let Some(matrix) = self.numbers::<16>("matrix")? {
            let matrix = DMat4::from_cols_array(&matrix);
            if matrix.row(3) != DVec4::W {
                self.document.warn(self.at("matrix"), "has a last row other than 0 0 0 1, which is ignored");
            }
            let columns = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(DVec4::truncate);
            let linear = DMat3::from_cols(columns[0], columns[1], columns[2]);
            return Ok(DAffine3 { matrix3: linear, translation: matrix.w_axis.truncate() });
        }
        let translation = self.numbers::<3>("translation")?.map_or(DVec3::ZERO, DVec3::from);
        let scale = self.numbers::<3>("scale")?.map_or(DVec3::ONE, DVec3::from);
        let rotation = match self.numbers::<4>("rotation")? {
            None => DQuat::IDENTITY,
            Some(rotation) => {
                let length = DVec4::from(rotation).length();
                if length == 0.0 || !length.is_finite() {
                    return Err(self
                        .document
                        .error(self.at("rotation"), "expected a unit quaternion, found one without direction"));
                }
                DQuat::from_vec4(DVec4::from(rotation) / length)
            }
        };
        Ok(DAffine3::from_scale_rotation_translation(scale, rotation, translation))
    }

    fn numbers<const N: usize>(&self, member: &str) -> Result<Option<[f64; N]>> {
        let Some(value) = self.node.get(member) else { return Ok(None) };
        let items = value.as_array().filter(|items| items.len() == N);
        let items = items.ok_or_else(|| {
            self.document.error(self.at(member), format!("expected {N} numbers, found {}", brief(value)))
        })?;
        let mut numbers = [0.0; N];
        for (place, (number, item)) in numbers.iter_mut().zip(items).enumerate() {
            let problem = || {
                self.document
                    .error(format!("{}/{place}", self.at(member)), format!("expected a number, found {}", brief(item)))
            };
            *number = item.as_f64().filter(|number| number.is_finite()).ok_or_else(problem)?;
        }
        Ok(Some(numbers))
    }

    fn index(&self, member: &str) -> Result<Option<usize>> {
        let Some(value) = self.node.pointer(member) else { return Ok(None) };
        index_value(self.document, value, &format!("{}{member}", self.pointer)).map(Some)
    }

    fn array(&self, member: &str) -> Result<&[Value]> {
        match self.node.get(member) {
            None => Ok(&[]),
            Some(Value::Array(items)) => Ok(items),
            Some(other) => {
                Err(self.document.error(self.at(member), format!("expected an array, found {}", brief(other))))
            }
        }
    }

    fn warn_ignored(&self) {
        for (member, what) in [
            ("skin", "is skinned; the mesh is shown as modelled"),
            ("weights", "has morph weights; the mesh is shown unmorphed"),
        ] {
            if self.node.get(member).is_some() {
                self.document.warn(self.pointer, what);
            }
        }
    }

    fn at(&self, member: &str) -> String {
        format!("{}/{member}", self.pointer)
    }
}
