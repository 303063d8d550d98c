//! Where the meshes stand: bounds and recentring in f64, then instances in f32.
//!
//! A scene that lies further from the origin than 16 of its diagonals loses more than four bits of every coordinate's fraction;
//! its centre is then subtracted from all placements before they are rounded.

use glam::{Affine3A, DAffine3, DVec3};

use super::super::geometry::LARGEST_COORDINATE_M;
use super::super::{Instance, MeshId};
use super::Meshes;
use super::document::Document;
use super::node::Placed;
use crate::error::Result;

/// Diagonals between the origin and the centre above which a scene is recentred.
const FAR_IN_DIAGONALS: f64 = 16.0;

/// All placements of the scene.
pub(super) struct Placement {
    pub(super) instances: Vec<Instance>,
    pub(super) origin: DVec3,
    /// World bounds, relative to `origin`.
    pub(super) least: DVec3,
    pub(super) most: DVec3,
}

/// Places the meshes of every node.
pub(super) fn place(document: &Document, nodes: &[Placed], meshes: &Meshes) -> Result<Placement> {
    let bounds: Vec<(DVec3, DVec3)> = meshes.list.iter().map(|mesh| object_bounds(&mesh.positions)).collect();
    let (mut least, mut most) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let mut placed: Vec<(MeshId, DAffine3)> = Vec::new();
    let mut collapsed = 0;
    for node in nodes {
        let ids = node.mesh.and_then(|mesh| meshes.of_gltf_mesh.get(&mesh)).map_or(&[][..], Vec::as_slice);
        if ids.is_empty() {
            continue;
        }
        document.charge(ids.len(), &node.pointer)?;
        let linear = node.world_from_node.matrix3.as_mat3();
        if !linear.is_finite() {
            return Err(
                document.error(&node.pointer, "expected a scale that 32-bit floats can hold, found a larger one")
            );
        }
        // A node scaled to nothing (how files hide things) has no inverse and shows nothing.
        if linear.determinant() == 0.0 || !linear.inverse().is_finite() {
            collapsed += 1;
            continue;
        }
        for &id in ids {
            let (low, high) = bounds[id.index()];
            for corner in 0..8 {
                let choose = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
                let point = node.world_from_node.transform_point3(DVec3::new(choose(0), choose(1), choose(2)));
                // Also true of NaN, which overflow may leave.
                if !point.abs().cmple(DVec3::splat(f64::from(LARGEST_COORDINATE_M))).all() {
                    let problem = format!("expected world coordinates up to {LARGEST_COORDINATE_M:e} m, found {point}");
                    return Err(document.error(&node.pointer, problem));
                }
                least = least.min(point);
                most = most.max(point);
            }
            placed.push((id, node.world_from_node));
        }
    }
    if collapsed > 0 {
        document.warn("/nodes", format!("{collapsed} nodes are scaled to nothing and left out"));
    }
    if placed.is_empty() {
        return Err(document.error("/nodes", "expected at least one node that shows triangles, found none"));
    }
    let centre = 0.5 * (least + most);
    let far = centre.length() > FAR_IN_DIAGONALS * (most - least).length();
    let origin = if far { centre.as_vec3().as_dvec3() } else { DVec3::ZERO };
    if far {
        document
            .warn("/nodes", format!("the scene lies far from the origin; {origin} is subtracted from all positions"));
    }
    let instance = |(mesh, world): (MeshId, DAffine3)| {
        let relative = DAffine3 { matrix3: world.matrix3, translation: world.translation - origin };
        Instance { mesh, world_from_object: to_f32(&relative) }
    };
    Ok(Placement {
        instances: placed.into_iter().map(instance).collect(),
        origin,
        least: least - origin,
        most: most - origin,
    })
}

fn object_bounds(positions: &[glam::Vec3]) -> (DVec3, DVec3) {
    positions.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(least, most), position| {
        let position = position.as_dvec3();
        (least.min(position), most.max(position))
    })
}

fn to_f32(world: &DAffine3) -> Affine3A {
    Affine3A { matrix3: world.matrix3.as_mat3().into(), translation: world.translation.as_vec3a() }
}
