//! The discretised operator KG and its Neumann series.
//!
//! Unknowns are radiances at [`POINTS`] on every side of every patch, the nodes. A row is what a point sees of them:
//! each patch's closed form factor, shared equally by the nodes of the side that faces the point, of which those count
//! that it sees (any-hit rays of the backend). So the kernel's singularity in corners is integrated exactly, rows of
//! closed surroundings sum to 1, and a patch that a shadow edge or another surface cuts is lit where it is lit. Limit:
//! shadow edges are resolved to a node, so the error is of first order in the patch's side there.

use std::time::Instant;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::form_factor::point_to_triangle;
use super::patches::{Patch, Patches};
use crate::backend::batch::{BLOCKED, LANES, RayBlock};
use crate::backend::{Backend, Coherence};
use crate::math::float;

/// Nodes of a patch as barycentric weights: the rule of degree 2 on a triangle (Strang and Fix 1973), all alike.
pub const POINTS: [[f64; 3]; 3] =
    [[2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0], [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0], [1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0]];

/// Scatterings of the series. Terms of a closed room of albedo ρ fall at least with ρᵏ.
pub const TERMS: usize = 256;

/// Share of the first term below which the rest of the series is left out.
const NEGLIGIBLE: f64 = 1e-14;

/// A point that receives light.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// World.
    pub p: DVec3,
    /// Unit, to the side that receives.
    pub n: DVec3,
    /// How far off the surface a ray must start, metres.
    pub error: f32,
}

/// What part of a receiver's hemisphere one side of a patch fills.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factor {
    /// Side: twice the patch, plus one for its back. Its nodes are 3·side, 3·side + 1, 3·side + 2.
    pub side: u32,
    /// Which of its nodes are seen: bits 0 to 2.
    pub seen: u32,
    /// Share of the cosine-weighted hemisphere of each node.
    pub share: f64,
}

impl Factor {
    /// The nodes that are seen.
    fn nodes(&self) -> impl Iterator<Item = usize> {
        (0..POINTS.len()).filter(|k| self.seen >> k & 1 == 1).map(|k| POINTS.len() * self.side as usize + k)
    }
}

/// The row of `receiver`: its factors in the order of the patches; sides that it does not see are absent.
pub fn row(receiver: &Receiver, patches: &Patches, backend: &dyn Backend) -> Vec<Factor> {
    let mut factors = Vec::new();
    let mut rays: Vec<RayBlock> = Vec::new();
    let mut len = 0;
    for (index, patch) in patches.iter().enumerate() {
        let facing = patch.normal.dot(receiver.p - patch.corners[0]);
        // In the patch's own plane, within the rounding of the vertices, a point sees nothing of it.
        if facing.abs() <= f64::from(patch.error) + f64::from(receiver.error) {
            continue;
        }
        let share = point_to_triangle(receiver.p, receiver.n, patch.corners);
        if share > 0.0 {
            let side = 2 * index as u32 + u32::from(facing < 0.0);
            factors.push(Factor { side, seen: 0, share: share / POINTS.len() as f64 });
            for weights in POINTS {
                if len % LANES == 0 {
                    rays.push(RayBlock::EMPTY);
                }
                aim(&mut rays[len / LANES], len % LANES, receiver, patch, patch.point(weights));
                len += 1;
            }
        }
    }
    backend.any_hit(&mut rays, len, Coherence::Incoherent);
    let blocked = |ray: usize| rays[ray / LANES].tfar[ray % LANES] == BLOCKED;
    for (i, factor) in factors.iter_mut().enumerate() {
        factor.seen = (0..POINTS.len()).filter(|k| !blocked(POINTS.len() * i + k)).map(|k| 1 << k).sum();
    }
    factors.retain(|factor| factor.seen != 0);
    factors
}

/// The segment from the receiver to a point of a patch; where there is none (they touch), nothing is between them.
fn aim(block: &mut RayBlock, lane: usize, receiver: &Receiver, patch: &Patch, target: DVec3) {
    let to_target = (target - receiver.p).as_vec3();
    let normal = receiver.n.as_vec3();
    // A point below the horizon represents the part above it: the ray leaves on the receiver's side all the same.
    let away = if normal.dot(to_target) < 0.0 { -normal } else { normal };
    let origin = float::spawn_origin(receiver.p.as_vec3(), away, receiver.error, to_target);
    let segment = float::shadow_segment(origin, target.as_vec3(), patch.normal.as_vec3(), patch.error);
    if let Some(segment) = segment {
        block.set(lane, origin, segment.dir, segment.tfar);
    } else {
        block.set(lane, origin, Vec3::X, 0.0);
    }
}

/// KG without the albedo: one row per node, sparse.
#[derive(Clone, Debug)]
pub struct Operator {
    rows: Vec<Vec<Factor>>,
}

impl Operator {
    /// Computes the rows on the current thread pool. Sides that reflect nothing have none. `None` if it is not done at
    /// `deadline`.
    pub fn new(patches: &Patches, backend: &dyn Backend, deadline: Option<Instant>) -> Option<Self> {
        let nodes = patches.iter().flat_map(|patch| {
            [1.0, -1.0].into_iter().flat_map(move |side| POINTS.map(|weights| (patch, side, weights)))
        });
        let node = |(patch, side, weights): (&Patch, f64, [f64; 3])| {
            if deadline.is_some_and(|deadline| Instant::now() > deadline) {
                return None;
            }
            if patch.albedo == [0.0; 3] {
                return Some(Vec::new());
            }
            let receiver = Receiver { p: patch.point(weights), n: patch.normal * side, error: patch.error };
            Some(row(&receiver, patches, backend))
        };
        let rows = nodes.collect::<Vec<_>>().into_par_iter().map(node).collect::<Option<_>>()?;
        Some(Operator { rows })
    }

    /// Radiance of every node after one more scattering of `radiance`.
    pub fn apply(&self, patches: &Patches, radiance: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let albedos: Vec<[f64; 3]> = patches.iter().flat_map(|patch| [patch.albedo; 2 * POINTS.len()]).collect();
        let node = |(row, albedo): (&Vec<Factor>, &[f64; 3])| {
            let gathered = gather(row, radiance);
            std::array::from_fn(|c| albedo[c] * gathered[c])
        };
        self.rows.par_iter().zip(&albedos).map(node).collect()
    }

    /// Largest sum of a row: 1 in a closed convex room.
    pub fn largest_row(&self) -> f64 {
        let sum = |row: &Vec<Factor>| row.iter().map(|f| f64::from(f.seen.count_ones()) * f.share).sum();
        self.rows.iter().map(sum).fold(0.0, f64::max)
    }
}

/// Mean radiance over the hemisphere that a row describes, in the order of the row.
pub fn gather(row: &[Factor], radiance: &[[f64; 3]]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for factor in row {
        for node in factor.nodes() {
            for c in 0..3 {
                sum[c] += factor.share * radiance[node][c];
            }
        }
    }
    sum
}

/// Radiance of every node by number of scatterings.
#[derive(Clone, Debug)]
pub struct Series {
    /// Term k, by node and channel; term 0 is emission.
    pub terms: Vec<Vec<[f64; 3]>>,
}

impl Series {
    /// Iterates L ← KG·L from the emission until nothing is left.
    pub fn iterate(operator: &Operator, patches: &Patches) -> Self {
        let sides = patches.iter().flat_map(|patch| [patch.emission, [0.0; 3]]);
        let emission: Vec<[f64; 3]> = sides.flat_map(|emission| [emission; POINTS.len()]).collect();
        let mut terms = vec![emission];
        let first = power(patches, &terms[0]);
        while terms.len() <= TERMS {
            let next = operator.apply(patches, terms.last().expect("the emission is there"));
            let left = power(patches, &next);
            terms.push(next);
            if (0..3).all(|c| left[c] <= NEGLIGIBLE * first[c]) {
                break;
            }
        }
        Series { terms }
    }

    /// Ratio of the energies of the last two consecutive terms that carry anything, by channel; 0 where no light is
    /// scattered on.
    pub fn ratio(&self, patches: &Patches) -> [f64; 3] {
        let powers: Vec<[f64; 3]> = self.terms.iter().map(|term| power(patches, term)).collect();
        std::array::from_fn(|c| {
            let pair = powers.windows(2).rfind(|pair| pair[1][c] > 0.0);
            pair.map_or(0.0, |pair| pair[1][c] / pair[0][c])
        })
    }
}

/// Radiance times area, summed over both sides of all patches, m²·W·sr⁻¹·m⁻².
pub fn power(patches: &Patches, radiance: &[[f64; 3]]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (patch, nodes) in patches.iter().zip(radiance.chunks_exact(2 * POINTS.len())) {
        for (node, c) in nodes.iter().flat_map(|node| (0..3).map(move |c| (node, c))) {
            sum[c] += patch.area / POINTS.len() as f64 * node[c];
        }
    }
    sum
}
