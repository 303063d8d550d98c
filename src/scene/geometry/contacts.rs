//! Which placements come near others, so that faces of the two may lie on one another: by boxes alone.

use glam::{Affine3A, Vec3};

use crate::scene::Mesh;

/// A box: min and max, metres.
pub(super) type Bounds = (Vec3, Vec3);

/// Pairs of boxes that are looked at: for each placement, and at least.
const MOST_LOOKS: usize = 64;
const LEAST_LOOKS: usize = 1 << 20;

/// Boxes are larger by this share of what their coordinates are sums of: placing rounds them.
const SLACK: f32 = 1.0 / (1 << 20) as f32;

/// A box that holds `bounds` once placed.
pub(super) fn placed((low, high): Bounds, world_from_object: &Affine3A) -> Bounds {
    let mut all = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for corner in 0..8 {
        let pick = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
        let p = world_from_object.transform_point3(Vec3::new(pick(0), pick(1), pick(2)));
        all = (all.0.min(p), all.1.max(p));
    }
    // Of the terms of the sums, which may cancel.
    let (m, reach) = (world_from_object.matrix3, low.abs().max(high.abs()));
    let terms = m.x_axis.abs() * reach.x + m.y_axis.abs() * reach.y + m.z_axis.abs() * reach.z;
    let slack = Vec3::from(terms + world_from_object.translation.abs()) * SLACK;
    (all.0 - slack, all.1 + slack)
}

/// For each box the part of it that others reach into, of pairs in which one is `asked` for; `None` altogether if they
/// are so crowded that not all pairs can be looked at.
pub(super) fn reached(boxes: &[Bounds], asked: &[bool]) -> Option<Vec<Option<Bounds>>> {
    let mut order: Vec<usize> = (0..boxes.len()).collect();
    order.sort_by(|&a, &b| boxes[a].0.x.total_cmp(&boxes[b].0.x).then(a.cmp(&b)));
    let mut reached: Vec<Option<Bounds>> = vec![None; boxes.len()];
    let mut looks = LEAST_LOOKS.max(MOST_LOOKS * boxes.len());
    let mut open: Vec<usize> = Vec::new();
    for i in order {
        open.retain(|&other| boxes[other].1.x >= boxes[i].0.x);
        looks = looks.checked_sub(open.len())?;
        for &other in open.iter().filter(|&&other| asked[i] || asked[other]) {
            let shared = (boxes[i].0.max(boxes[other].0), boxes[i].1.min(boxes[other].1));
            if shared.0.cmple(shared.1).all() {
                for of in [i, other] {
                    let (low, high) = reached[of].unwrap_or(shared);
                    reached[of] = Some((low.min(shared.0), high.max(shared.1)));
                }
            }
        }
        open.push(i);
    }
    Some(reached)
}

/// The triangles of a mesh whose boxes, once placed, meet `region`; corners in object space, three a triangle.
pub(super) fn part_within(mesh: &Mesh, world_from_object: &Affine3A, (low, high): Bounds) -> Mesh {
    let mut part = Mesh::default();
    for triangle in &mesh.triangles {
        let corners = triangle.map(|i| mesh.positions[i as usize]);
        let [a, b, c] = corners.map(|p| world_from_object.transform_point3(p));
        if a.min(b).min(c).cmple(high).all() && a.max(b).max(c).cmpge(low).all() {
            let first = part.positions.len() as u32;
            part.positions.extend(corners);
            part.triangles.push([first, first + 1, first + 2]);
        }
    }
    part
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_boxes_that_meet_reach_into_each_other() {
        let boxed = |x: f32| (Vec3::new(x, 0.0, 0.0), Vec3::new(x + 1.0, 1.0, 1.0));
        let boxes = [boxed(0.0), boxed(0.5), boxed(3.0), boxed(4.0)];
        let all = reached(&boxes, &[true, false, false, false]).expect("four boxes are few");
        let shared = Some((Vec3::new(0.5, 0.0, 0.0), Vec3::ONE));
        // The last two touch, and neither is asked for.
        assert_eq!(all, [shared, shared, None, None]);
        // A thousand boxes in one place: half a million pairs are looked at, ten thousand boxes are too many.
        assert!(reached(&vec![boxed(0.0); 1000], &[true; 1000]).is_some());
        assert!(reached(&vec![boxed(0.0); 10_000], &[true; 10_000]).is_none());
    }
}
