//! Skins: vertices moved by the joints they hang on.
//!
//! Source: glTF 2.0 §3.7.3. A vertex is at Σ w·(joint's world)·(inverse bind)·p, whatever the transform of the
//! node that carries the mesh; weights are divided by their sum. Normals go by the inverse transpose of the blended
//! matrix. Any number of sets `JOINTS_n`, `WEIGHTS_n`. Where joints move while the shutter is open, a skin is read for
//! each shape that its mesh takes (`changing`).

use glam::{DAffine3, DMat4, DVec4, Vec3};

use super::accessor::Accessor;
use super::document::Document;
use super::node::{Nodes, Placed};
use crate::error::Result;

/// The joints of a skin: bind pose to world.
pub(super) struct Skin {
    joints: Vec<DAffine3>,
}

/// One set of joints and weights of a primitive.
pub(super) struct Influences<'d> {
    pub(super) joints: Accessor<'d>,
    pub(super) weights: Accessor<'d>,
}

impl Skin {
    /// Reads `/skins/index`; `world_of` has the nodes of the scene at some time.
    pub(super) fn read(
        document: &Document,
        index: usize,
        world_of: &dyn Fn(usize) -> Option<DAffine3>,
    ) -> Result<Skin> {
        let pointer = format!("/skins/{index}");
        let listed = document.array(&format!("{pointer}/joints"))?;
        if listed.is_empty() {
            return Err(document.error(format!("{pointer}/joints"), "expected at least one joint, found none"));
        }
        let at = format!("{pointer}/inverseBindMatrices");
        let inverse = match document.value(&at) {
            None => None,
            Some(value) => {
                let matrices = Accessor::open(document, document.index(value, &at)?, &at)?;
                matrices.expect_components(document, &[16])?;
                matrices.expect_floats(document, false)?;
                if matrices.count < listed.len() {
                    let problem = format!("expected {} matrices, one a joint, found {}", listed.len(), matrices.count);
                    return Err(document.error(format!("{}/count", matrices.pointer), problem));
                }
                Some(matrices)
            }
        };
        document.charge(listed.len(), &pointer)?;
        let joint = |(place, node): (usize, &serde_json::Value)| {
            let from = format!("{pointer}/joints/{place}");
            let node = document.index(node, &from)?;
            let outside = || document.error(&from, format!("expected a node of the scene, found node {node} outside"));
            let world = world_of(node).ok_or_else(outside)?;
            let Some(matrices) = &inverse else { return Ok(world) };
            let matrix = DMat4::from_cols_array(&matrices.vector::<16>(place).map(f64::from));
            if !matrix.is_finite() {
                return Err(document.error(&matrices.pointer, format!("expected finite matrices, found {matrix}")));
            }
            Ok(world * DAffine3::from_mat4(matrix))
        };
        Ok(Skin { joints: listed.iter().enumerate().map(joint).collect::<Result<_>>()? })
    }

    /// Fails if a vertex hangs on a joint that is not there.
    pub(super) fn check(&self, document: &Document, sets: &[Influences], vertices: &[u32]) -> Result<()> {
        for Influences { joints, weights } in sets {
            for &vertex in vertices {
                let pair = (joints.integers(vertex as usize), weights.vector::<4>(vertex as usize));
                let past = |i: usize| pair.1[i] != 0.0 && pair.0[i] as usize >= self.joints.len();
                if let Some(i) = (0..4).find(|&i| past(i)) {
                    let (count, found) = (self.joints.len(), pair.0[i]);
                    let problem = format!("expected joints below {count}, found {found} at element {vertex}");
                    return Err(document.error(&joints.pointer, problem));
                }
            }
        }
        Ok(())
    }

    /// What moves a vertex: the mean of its joints by weight; `None` where no weight is above 0.
    pub(super) fn matrix(&self, sets: &[Influences], vertex: u32) -> Option<DAffine3> {
        let (mut sum, mut total) = (DMat4::ZERO, 0.0);
        for Influences { joints, weights } in sets {
            let weights = DVec4::from_array(weights.vector::<4>(vertex as usize).map(f64::from)).to_array();
            for (joint, weight) in joints.integers(vertex as usize).into_iter().zip(weights) {
                if let Some(joint) = self.joints.get(joint as usize).filter(|_| weight > 0.0) {
                    sum += DMat4::from(*joint) * weight;
                    total += weight;
                }
            }
        }
        (total > 0.0 && f64::is_finite(total)).then(|| DAffine3::from_mat4(sum * total.recip()))
    }
}

/// `position` moved by `matrix`.
pub(super) fn moved(matrix: Option<DAffine3>, position: Vec3) -> Vec3 {
    matrix.map_or(position, |matrix| matrix.transform_point3(position.as_dvec3()).as_vec3())
}

/// Whether joints of `node`'s skin move while the shutter is open.
pub(super) fn moves(document: &Document, node: &Placed, nodes: &Nodes) -> bool {
    let joints = |skin| document.array(&format!("/skins/{skin}/joints")).unwrap_or_default();
    let index = |joint: &serde_json::Value| joint.as_u64().and_then(|index| usize::try_from(index).ok());
    node.skin.is_some_and(|skin| joints(skin).iter().filter_map(index).any(|joint| nodes.moving.contains_key(&joint)))
}
