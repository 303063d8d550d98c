//! Meshes that change their shape while the shutter is open: skins whose joints move, and morph targets whose weights
//! do. In how many parts the shutter is cut for each, so that straight lines between shapes stay close to the way of
//! the vertices, and what poses them.
//!
//! As for nodes ([`moving`](super::moving)), [`LOOKS`] times are looked at, here of [`LOOKED_AT`] vertices, and parts
//! doubled until none is further from its way than a 1024th of the mesh's size, or there are as many as there may be.
//! Limits: what a vertex does between two looks is not seen, nor what other vertices do; texture coordinates and
//! colours that morph targets displace stay as the shutter opens.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use glam::{DVec3, Vec3};

use super::super::motion::MOST_PARTS;
use super::document::Document;
use super::looks::{CLOSE_ENOUGH, LOOKS, ROUNDING};
use super::node::{Nodes, Placed};
use super::skin::{self, Skin};
use crate::error::Result;

/// Vertices whose ways are looked at.
const LOOKED_AT: usize = 512;

/// Triangles of all later shapes of a mesh together that more parts may not exceed; each takes about 100 bytes.
const MOST_LATER_TRIANGLES: usize = 1 << 22;

/// What poses the mesh of a node over the shutter.
pub(super) struct Poses<'p> {
    document: &'p Document,
    node: &'p Placed,
    nodes: &'p Nodes,
    /// Of the mesh when the shutter opens, which count where no animation drives them.
    weights: &'p [f64],
    /// Those that were asked for, by look: primitives of a mesh share them.
    known: RefCell<HashMap<usize, Rc<Pose>>>,
}

/// What poses it at one time.
pub(super) struct Pose {
    pub(super) skin: Option<Skin>,
    pub(super) weights: Vec<f64>,
}

impl<'p> Poses<'p> {
    /// `None` where nothing that poses the mesh moves.
    pub(super) fn of(document: &'p Document, node: &'p Placed, nodes: &'p Nodes, weights: &'p [f64]) -> Option<Self> {
        let moves = node.morphs.is_some() || skin::moves(document, node, nodes);
        moves.then(|| Poses { document, node, nodes, weights, known: RefCell::default() })
    }

    /// At look `look`, of [`LOOKS`].
    pub(super) fn at(&self, look: usize) -> Result<Rc<Pose>> {
        if let Some(known) = self.known.borrow().get(&look) {
            return Ok(known.clone());
        }
        let world = |joint: usize| match self.nodes.moving.get(&joint) {
            Some(poses) => poses.get(look).copied(),
            None => self.nodes.worlds.get(&joint).copied(),
        };
        let skin = self.node.skin.map(|skin| Skin::read(self.document, skin, &world)).transpose()?;
        let weights = self.node.morphs.as_ref().and_then(|morphs| morphs.get(look));
        let pose = Rc::new(Pose { skin, weights: weights.map_or_else(|| self.weights.to_vec(), Clone::clone) });
        self.known.borrow_mut().insert(look, pose.clone());
        Ok(pose)
    }
}

/// The looks at which a mesh of so many triangles takes its shapes after the first, and how far, in metres, its
/// vertices are at most from the straight lines between those. None where it keeps its shape. `at` has the vertices of
/// some numbers at a look.
pub(super) fn looks(
    vertices: usize,
    triangles: usize,
    at: impl Fn(usize, &[usize]) -> Result<Vec<Vec3>>,
) -> Result<(Vec<usize>, f64)> {
    let some: Vec<usize> = (0..vertices).step_by(vertices.div_ceil(LOOKED_AT).max(1)).collect();
    let ways: Vec<Vec<Vec3>> = (0..LOOKS).map(|look| at(look, &some)).collect::<Result<_>>()?;
    if ways.iter().all(|points| *points == ways[0]) {
        return Ok((Vec::new(), 0.0));
    }
    let size = |points: &Vec<Vec3>| {
        let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = points.iter().fold(empty, |(low, high), p| (low.min(p.as_dvec3()), high.max(p.as_dvec3())));
        (high - low).length()
    };
    let size = ways.iter().map(size).fold(0.0, f64::max);
    let mut parts = 1;
    loop {
        let stride = (LOOKS - 1) / parts;
        let off = deviation(&ways, stride);
        if off <= CLOSE_ENOUGH * size || parts == MOST_PARTS || 2 * parts * triangles > MOST_LATER_TRIANGLES {
            let seen = if off > ROUNDING * size { off } else { 0.0 };
            return Ok(((1..=parts).map(|part| part * stride).collect(), seen));
        }
        parts *= 2;
    }
}

/// The largest distance of a vertex from the straight lines between every `stride`-th of its places.
fn deviation(ways: &[Vec<Vec3>], stride: usize) -> f64 {
    let mut most = 0.0f64;
    for (look, points) in ways.iter().enumerate().filter(|(look, _)| look % stride != 0) {
        let (start, share) = (look / stride * stride, (look % stride) as f64 / stride as f64);
        for ((p, from), to) in points.iter().zip(&ways[start]).zip(&ways[start + stride]) {
            most = most.max(p.as_dvec3().distance(from.as_dvec3().lerp(to.as_dvec3(), share)));
        }
    }
    most
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: a straight way needs one part, a parabola of height h over a chord is off by h/4 a quarter of the parts;
    /// what comes back to where it was is seen to have been away.
    #[test]
    fn parts_follow_the_way() {
        let share = |look: usize| look as f32 / (LOOKS - 1) as f32;
        let way = |of: fn(f32) -> f32| {
            looks(3, 1, |look, some| {
                Ok(some.iter().map(|&i| Vec3::new(i as f32 * 0.5, of(share(look)), 0.0)).collect())
            })
            .expect("no file is read")
        };
        assert_eq!(way(|_| 1.0), (vec![], 0.0));
        assert_eq!(way(|t| t), (vec![64], 0.0));
        let (parabola, off) = way(|t| t * (1.0 - t));
        // Off by 1/(4 n²) in n parts, of a size of about 1.03.
        assert_eq!(parabola.len(), 16);
        assert!((off - 0.25 / 256.0).abs() < 1e-6, "{off}");
        assert_eq!(way(|t| if t > 0.2 && t < 0.4 { 1.0 } else { 0.0 }).0.len(), MOST_PARTS);
        let large = looks(3, 1 << 21, |look, _| Ok(vec![Vec3::splat(share(look) * share(look)); 3]));
        assert_eq!(large.expect("no file is read").0.len(), 2);
    }
}
