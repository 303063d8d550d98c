//! Where the meshes stand: bounds and recentring in f64, then instances in f32.
//!
//! Far from the origin f32 has few bits left for a scene's own detail, so its centre, rounded to a lattice, is
//! subtracted from all placements before they are rounded to f32. The step of the lattice is the power of two next
//! above the scene's diagonal: then coordinates never exceed 1.5 diagonals; a scene whose bounds hold the origin stays
//! where it is; and the same scene elsewhere, moved by a multiple of the step or scaled by a power of two, gives the
//! same bits.

use std::rc::Rc;

use glam::{Affine3A, DAffine3, DVec3};

use super::super::geometry::LARGEST_COORDINATE_M;
use super::super::motion::Track;
use super::super::{Instance, Mesh, Node, NodeId};
use super::document::Document;
use super::meshes::{Meshes, Shown};
use super::moving::Way;
use super::node::Placed;
use super::pose::to_f32;
use crate::error::Result;

/// Diagonals between the origin and the centre above which it is said that the scene is moved: what the file itself
/// holds in f32 has then lost more than four bits.
const FAR_IN_DIAGONALS: f64 = 16.0;

/// All placements of the scene.
pub(super) struct Placement {
    pub(super) instances: Vec<Instance>,
    /// The nodes that the instances name.
    pub(super) nodes: Vec<Node>,
    /// Of the instances that move.
    pub(super) tracks: Vec<Track>,
    /// Instances that an animation drives.
    pub(super) animated: Vec<usize>,
    pub(super) origin: DVec3,
}

/// Places the meshes of every node; `ways` has the poses of those that move, and may be shorter.
pub(super) fn place(document: &Document, nodes: &[Placed], ways: &[Way], meshes: &Meshes) -> Result<Placement> {
    let bounds: Vec<(DVec3, DVec3)> = meshes.list.iter().map(object_bounds).collect();
    let (mut least, mut most) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let mut placed: Vec<(Shown, DAffine3, NodeId)> = Vec::new();
    let mut called: Vec<&Rc<Node>> = Vec::new();
    let (mut moving, mut animated): (Vec<(usize, Way, bool)>, _) = (Vec::new(), Vec::new());
    let mut collapsed = 0;
    for (place, node) in nodes.iter().enumerate() {
        let way = ways.get(place).filter(|way| !way.is_empty() && node.skin.is_none());
        let (shown, world_from_mesh) = (meshes.of(place), node.world_from_mesh());
        if shown.is_empty() {
            continue;
        }
        // Every instance has the poses of its node.
        document.charge(shown.len() * (1 + way.map_or(0, Vec::len)), &node.pointer)?;
        let linear = world_from_mesh.matrix3.as_mat3();
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
        // Instances of one node come one after the other.
        if !called.last().is_some_and(|last| Rc::ptr_eq(last, &node.called)) {
            called.push(&node.called);
        }
        let id = NodeId(called.len() as u32 - 1);
        for &part in shown {
            let (low, high) = bounds[part.mesh.index()];
            for corner in 0..8 {
                let choose = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
                for pose in way.map_or(std::slice::from_ref(&world_from_mesh), Vec::as_slice) {
                    let point = pose.transform_point3(DVec3::new(choose(0), choose(1), choose(2)));
                    // Also true of NaN, which overflow may leave.
                    if !point.abs().cmple(DVec3::splat(f64::from(LARGEST_COORDINATE_M))).all() {
                        let problem =
                            format!("expected world coordinates up to {LARGEST_COORDINATE_M:e} m, found {point}");
                        return Err(document.error(&node.pointer, problem));
                    }
                    least = least.min(point);
                    most = most.max(point);
                }
            }
            animated.extend(node.animated.then_some(placed.len()));
            let changes = !meshes.list[part.mesh.index()].later.is_empty();
            match way {
                Some(way) => moving.push((placed.len(), way.clone(), changes)),
                // It stays where it is, and moves nevertheless.
                None if changes => moving.push((placed.len(), vec![world_from_mesh; 2], changes)),
                None => {}
            }
            placed.push((part, world_from_mesh, id));
        }
    }
    if collapsed > 0 {
        document.warn("/nodes", format!("{collapsed} nodes are scaled to nothing and left out"));
    }
    if placed.is_empty() {
        return Err(document.error("/nodes", "expected at least one node that shows triangles, found none"));
    }
    let centre = 0.5 * (least + most);
    let diagonal = (most - least).length();
    let origin = lattice_point(centre, diagonal);
    if centre.length() > FAR_IN_DIAGONALS * diagonal {
        document
            .warn("/nodes", format!("the scene lies far from the origin; {origin} is subtracted from all positions"));
    }
    let relative =
        |world: &DAffine3| to_f32(&DAffine3 { matrix3: world.matrix3, translation: world.translation - origin });
    let track = |(index, way, changes): (usize, Way, bool)| {
        let steps: Vec<Affine3A> = way.iter().map(relative).collect();
        // What moves by less than f32 can tell stands still.
        (changes || steps.iter().any(|step| *step != steps[0])).then_some(Track { index, steps })
    };
    Ok(Placement {
        tracks: moving.into_iter().filter_map(track).collect(),
        animated,
        instances: (placed.iter())
            .map(|&(part, ref world, node)| {
                let placed = Instance::new(part.mesh, relative(world));
                Instance { material: part.material, node: Some(node), ..placed }
            })
            .collect(),
        nodes: called.into_iter().map(|node| (**node).clone()).collect(),
        origin,
    })
}

/// The point nearest to `centre` whose coordinates are multiples of the power of two next above `diagonal`.
fn lattice_point(centre: DVec3, diagonal: f64) -> DVec3 {
    let step = diagonal.log2().ceil().exp2();
    // Also false of a diagonal of 0. Halves go to even, so that a scene standing on the origin stays; the sum makes
    // −0 a 0.
    if step > 0.0 && step.is_finite() {
        (centre / step).map(f64::round_ties_even) * step + DVec3::ZERO
    } else {
        DVec3::ZERO
    }
}

/// Bounds of a mesh in all its shapes.
fn object_bounds(mesh: &Mesh) -> (DVec3, DVec3) {
    let later = mesh.later.iter().flat_map(|shape| &shape.positions);
    mesh.positions.iter().chain(later).fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(least, most), position| {
        let position = position.as_dvec3();
        (least.min(position), most.max(position))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: the page above, exactly.
    #[test]
    fn origins_lie_on_a_lattice_of_the_scenes_own_size() {
        let size = DVec3::new(2.0, 1.0, 2.0);
        // Bounds that hold the origin.
        for corner in [DVec3::ZERO, -size, -0.5 * size, DVec3::new(-2.0, 0.0, 0.0)] {
            assert_eq!(lattice_point(corner + 0.5 * size, size.length()), DVec3::ZERO, "{corner}");
        }
        let centre = DVec3::new(1.0, 0.3, -17.7);
        let origin = lattice_point(centre, size.length());
        assert_eq!(origin, DVec3::new(0.0, 0.0, -16.0));
        for power in [-20, 20] {
            let scale = f64::exp2(power.into());
            assert_eq!(lattice_point(centre * scale, size.length() * scale), origin * scale);
        }
        let moved = DVec3::new(1e5, -1_048_576.0, 4.0);
        assert_eq!(lattice_point(centre + moved, size.length()), origin + moved);
        assert_eq!(lattice_point(DVec3::ONE, 0.0), DVec3::ZERO);
    }
}
