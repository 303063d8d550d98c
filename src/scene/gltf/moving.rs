//! From the poses of animated nodes to tracks: in how many parts the shutter is cut for each node, so that straight
//! lines between poses stay close to its way, and which motions cannot be shown.
//!
//! A node is sampled [`LOOKS`] times over the shutter. Parts are doubled until the corners of what it carries are
//! nowhere further from their way than a 1024th of its size, or there are as many as there may be. Limit: what a node
//! does between two looks is not seen; a STEP becomes a fast motion.

use glam::{DAffine3, DVec3};

use super::super::motion::{MOST_PARTS, Motion, Off, Shutter, Track, Unmoved};
use super::json::one_line;
use super::looks::{CLOSE_ENOUGH, LOOKS, ROUNDING};
use super::meshes::{Meshes, Shown};
use super::node::Placed;
use super::pose::{rigid_pose, to_f32};

/// Times at which nodes are sampled, seconds: one where it closes as it opens.
pub(super) fn times_s(shutter: Shutter) -> Vec<f64> {
    if shutter.is_instant() {
        return vec![shutter.open_s()];
    }
    let at = |i: usize| {
        let share = i as f64 / (LOOKS - 1) as f64;
        shutter.open_s() * (1.0 - share) + shutter.close_s() * share
    };
    (0..LOOKS).map(at).collect()
}

/// Poses of a node at the ends of the parts that were chosen for it, in f64.
pub(super) type Way = Vec<DAffine3>;

/// The paths of all nodes, empty for those that do not move, that cannot be shown moving, and whose motion nobody sees.
/// What is left out, and how far the worst path is from straight, is noted in `motion`.
pub(super) fn ways(nodes: &[Placed], meshes: &Meshes, motion: &mut Motion) -> Vec<Way> {
    nodes
        .iter()
        .enumerate()
        .map(|(place, node)| way(node, meshes.of(place), meshes, motion).unwrap_or_default())
        .collect()
}

fn way(node: &Placed, shown: &[Shown], meshes: &Meshes, motion: &mut Motion) -> Option<Way> {
    let poses = node.poses.as_deref()?;
    let still = poses.iter().all(|pose| *pose == poses[0]);
    if still {
        return None;
    }
    let name = one_line(node.name.as_ref().unwrap_or(&node.pointer));
    let mut leave_out = |what: String, why: &str| motion.unmoved.push(Unmoved { what, why: why.into() });
    if node.light.is_some() || node.lamp.is_some() {
        leave_out(
            format!("motion of the light of node '{name}'"),
            "punctual lights stay where they are when the shutter opens",
        );
    }
    let corners = corners(node, if node.skin.is_none() { shown } else { &[] }, meshes)?;
    // A camera that carries nothing else moves without the scale of its node.
    let rigid: Option<Vec<DAffine3>> = (node.camera.is_some() && node.mesh.is_none())
        .then(|| poses.iter().map(|pose| rigid_pose(pose).unwrap_or(*pose)).collect());
    let poses = rigid.as_deref().unwrap_or(poses);
    let size = size(&corners, poses);
    let mut parts = 1;
    let (way, off) = loop {
        let way: Way = poses.iter().step_by((LOOKS - 1) / parts).copied().collect();
        let problem = Track { index: 0, steps: way.iter().map(to_f32).collect() }.problem();
        let off = deviation(poses, parts, &corners);
        match problem {
            None if off <= CLOSE_ENOUGH * size || parts == MOST_PARTS => break (way, off),
            Some(problem) if parts == MOST_PARTS => {
                leave_out(format!("motion of node '{name}'"), &format!("{problem}; it is shown as the shutter opens"));
                return None;
            }
            _ => parts *= 2,
        }
    };
    if off > ROUNDING * size && motion.off.as_ref().is_none_or(|worst| worst.distance_m < off) {
        motion.off = Some(Off { name, distance_m: off });
    }
    Some(way)
}

/// Corners of what a node carries, in its space; of a camera the corners of a cube of 2 m, whatever the scene's size
/// (so its eye is within 4 mm of its way). `None` where there is nothing to see.
fn corners(node: &Placed, shown: &[Shown], meshes: &Meshes) -> Option<Vec<DVec3>> {
    let positions = shown.iter().flat_map(|part| &meshes.list[part.mesh.index()].positions);
    let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (mut least, mut most) =
        positions.map(|p| p.as_dvec3()).fold(empty, |(least, most), p| (least.min(p), most.max(p)));
    if node.camera.is_some() {
        (least, most) = (least.min(DVec3::NEG_ONE), most.max(DVec3::ONE));
    }
    let corner = |i: u32| DVec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), most, least);
    least.is_finite().then(|| (0..8).map(corner).collect())
}

/// The largest diagonal over the shutter, metres.
fn size(corners: &[DVec3], poses: &[DAffine3]) -> f64 {
    let diagonal = |pose: &DAffine3| {
        let all = corners.iter().map(|&corner| pose.transform_point3(corner));
        let (least, most) =
            all.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(least, most), p| (least.min(p), most.max(p)));
        (most - least).length()
    };
    poses.iter().map(diagonal).fold(0.0, f64::max)
}

/// The largest distance between a corner's way and the straight lines of `parts` parts, at the same time, metres.
fn deviation(poses: &[DAffine3], parts: usize, corners: &[DVec3]) -> f64 {
    let stride = (LOOKS - 1) / parts;
    let mut most = 0.0f64;
    for (i, pose) in poses.iter().enumerate() {
        let (start, within) = (i / stride * stride, i % stride);
        if within == 0 {
            continue;
        }
        let share = within as f64 / stride as f64;
        for &corner in corners {
            let [from, to] = [poses[start], poses[start + stride]].map(|end| end.transform_point3(corner));
            most = most.max(pose.transform_point3(corner).distance(from.lerp(to, share)));
        }
    }
    most
}
