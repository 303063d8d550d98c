//! Morph targets: displacements of a primitive's attributes, added to it by weight before a skin moves it.
//!
//! Source: glTF 2.0 §3.7.2.2. An attribute is its base and Σ weight·displacement; a node's weights take the place of
//! its mesh's, and an animation's the place of both. Positions, normals, the vectors of tangents, texture coordinates
//! and colours. A target that names an attribute which the primitive lacks changes nothing. Where weights change while
//! the shutter is open, targets are read for each shape that the mesh takes (`changing`).

use serde_json::Value;

use super::accessor::Accessor;
use super::document::Document;
use super::json::brief;
use crate::error::Result;

/// The weights of a mesh on a node that has weights of its own or not; empty where nothing is displaced.
pub(super) fn weights(document: &Document, of_node: Option<&[f64]>, mesh: usize) -> Result<Vec<f64>> {
    let given = match of_node {
        Some(weights) => weights.to_vec(),
        None => numbers(document, &format!("/meshes/{mesh}/weights"))?.unwrap_or_default(),
    };
    Ok(if given.iter().any(|&weight| weight != 0.0) { given } else { Vec::new() })
}

/// The array of finite numbers at `pointer`, if there is one.
pub(super) fn numbers(document: &Document, pointer: &str) -> Result<Option<Vec<f64>>> {
    if document.value(pointer).is_none() {
        return Ok(None);
    }
    let number = |(place, value): (usize, &Value)| {
        value.as_f64().filter(|number| number.is_finite()).ok_or_else(|| {
            document.error(format!("{pointer}/{place}"), format!("expected a number, found {}", brief(value)))
        })
    };
    document.array(pointer)?.iter().enumerate().map(number).collect::<Result<_>>().map(Some)
}

/// Number of targets of the mesh at `/meshes/mesh`.
pub(super) fn count(document: &Document, mesh: usize) -> Result<usize> {
    Ok(document.array(&format!("/meshes/{mesh}/primitives/0/targets"))?.len())
}

/// Whether targets of the mesh displace colours or texture coordinates.
pub(super) fn paints(document: &Document, mesh: Option<usize>) -> bool {
    let primitives = mesh.and_then(|mesh| document.value(&format!("/meshes/{mesh}/primitives"))?.as_array());
    let targets = primitives.into_iter().flatten().filter_map(|primitive| primitive.get("targets")?.as_array());
    let mut attributes = targets.flatten().filter_map(Value::as_object).flat_map(|target| target.keys());
    attributes.any(|name| name.starts_with("COLOR_") || name.starts_with("TEXCOORD_"))
}

/// The targets of a primitive that have a weight.
#[derive(Default)]
pub(super) struct Morph {
    /// Pointer and weight.
    targets: Vec<(String, f64)>,
}

impl Morph {
    /// Of the primitive at `primitive`, `count` vertices of which are shown.
    pub(super) fn read(document: &Document, primitive: &str, weights: &[f64], count: usize) -> Result<Morph> {
        let listed = document.array(&format!("{primitive}/targets"))?.len();
        let weighted = weights.iter().enumerate().take(listed).filter(|(_, weight)| **weight != 0.0);
        let pointer = |(target, weight): (usize, &f64)| (format!("{primitive}/targets/{target}"), *weight);
        let targets: Vec<_> = weighted.map(pointer).collect();
        // Targets may share one accessor, and a vertex of a target costs less than a triangle.
        document.charge(targets.len().saturating_mul(count) / 8, primitive)?;
        Ok(Morph { targets })
    }

    /// The displacements of an attribute of `count` elements.
    pub(super) fn of<'d>(&self, document: &'d Document, name: &str, count: usize) -> Result<Displacement<'d>> {
        let mut parts = Vec::new();
        for (target, weight) in &self.targets {
            let at = format!("{target}/{name}");
            let Some(value) = document.value(&at) else { continue };
            let accessor = Accessor::open(document, document.index(value, &at)?, &at)?;
            if accessor.count != count {
                let problem = format!("expected {count} elements as POSITION has, found {}", accessor.count);
                return Err(document.error(format!("{}/count", accessor.pointer), problem));
            }
            let components: &[usize] = match name.split('_').next() {
                Some("TEXCOORD") => &[2],
                Some("COLOR") => &[3, 4],
                _ => &[3],
            };
            accessor.expect_components(document, components)?;
            parts.push((accessor, *weight));
        }
        Ok(Displacement { parts })
    }
}

/// What is added to one attribute.
pub(super) struct Displacement<'d> {
    parts: Vec<(Accessor<'d>, f64)>,
}

impl Displacement<'_> {
    /// Whether there is something to add.
    pub(super) fn is_some(&self) -> bool {
        !self.parts.is_empty()
    }

    /// `base` of vertex `vertex`, displaced; components that no target has stay.
    pub(super) fn applied<const N: usize>(&self, vertex: u32, base: [f32; N]) -> [f32; N] {
        if self.parts.is_empty() {
            return base;
        }
        // The base last: displacements that cancel leave it whole.
        let mut sum = [0.0; N];
        for (accessor, weight) in &self.parts {
            for (sum, displacement) in sum.iter_mut().zip(accessor.vector::<N>(vertex as usize)) {
                *sum += weight * f64::from(displacement);
            }
        }
        std::array::from_fn(|i| (f64::from(base[i]) + sum[i]) as f32)
    }
}
