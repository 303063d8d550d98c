//! One mesh ready to be traced: its triangles in leaf order, four to a block, and the nodes over the blocks.
//!
//! Triangles that are points, lines or not finite are left out, and of exact copies only the first is kept: it would
//! win every tie anyway (HARDCASES §5.3, 4), but for rays that go on past it.

use glam::Vec3;

use super::collapse;
use super::leaf::{Block, LEAF_SIZE};
use super::node::Node;
use super::reference::Reference;
use crate::backend::bounds::Bounds;
use crate::backend::triangle::is_degenerate;
use crate::math::float::UNIT_ROUNDOFF;
use crate::scene::geometry::TriangleMesh;

/// Triangles and hierarchy of one mesh.
#[derive(Debug)]
pub(super) struct MeshTree {
    pub nodes: Vec<Node>,
    pub blocks: Vec<Block>,
    /// Of a mesh that changes its shape, in the place of `blocks`: for each leaf one block a shape, in their order.
    pub changing: Vec<Block>,
    /// Parts that the shutter is cut into for it; 0 where the mesh keeps its shape.
    pub parts: usize,
    pub root: Reference,
    /// Bounds of the triangles that are kept, not grown.
    pub bounds: Bounds,
    /// How many triangles are kept.
    pub triangles: u64,
}

impl MeshTree {
    /// Builds over `mesh`; `scene_diagonal` is the extent of everything in the same space, at least the mesh's own.
    /// `copies` says whether exact copies are kept.
    pub fn build(mesh: &TriangleMesh, scene_diagonal: f64, copies: bool) -> Self {
        if !mesh.later.is_empty() {
            return Self::changing(mesh, scene_diagonal);
        }
        let corner = |i: u32| mesh.vertices.get(i as usize).copied().unwrap_or(Vec3::NAN);
        let triangle = |prim: u32| mesh.indices[prim as usize].map(corner);
        let mut kept: Vec<u32> =
            (0..mesh.indices.len() as u32).filter(|&prim| !is_degenerate(&triangle(prim))).collect();
        if !copies {
            drop_copies(&mut kept, triangle);
        }

        let bounds = kept.iter().fold(Bounds::EMPTY, |b, &prim| b.union(Bounds::of(&triangle(prim))));
        let diagonal = scene_diagonal.max(bounds.diagonal());
        let boxes: Vec<Bounds> = kept.iter().map(|&prim| grown(Bounds::of(&triangle(prim)), diagonal)).collect();
        let store = || Vec::with_capacity(kept.len().div_ceil(2));
        let (nodes, mut blocks, root) = collapse::build(&boxes, LEAF_SIZE, store, |blocks, members| {
            let prims = members.iter().map(|&item| kept[item as usize]);
            blocks.push(Block::new(prims.map(|prim| (prim, triangle(prim)))));
            Reference::triangles(blocks.len() - 1)
        });
        blocks.shrink_to_fit();
        MeshTree { nodes, blocks, changing: Vec::new(), parts: 0, root, bounds, triangles: kept.len() as u64 }
    }

    /// Builds over a mesh that changes its shape: boxes hold all shapes, and so what is between them. Copies stay.
    fn changing(mesh: &TriangleMesh, scene_diagonal: f64) -> Self {
        let kept: Vec<(u32, Vec<[Vec3; 3]>)> = mesh.traced_moving().collect();
        let around =
            |shapes: &[[Vec3; 3]]| shapes.iter().fold(Bounds::EMPTY, |b, corners| b.union(Bounds::of(corners)));
        let bounds = kept.iter().fold(Bounds::EMPTY, |b, (_, shapes)| b.union(around(shapes)));
        let diagonal = scene_diagonal.max(bounds.diagonal());
        // A corner between two shapes is rounded to what may lie beside both.
        let rounding = |b: Bounds| b.grown(b.lo.abs().max(b.hi.abs()) * (8.0 * UNIT_ROUNDOFF));
        let bounds = if bounds.is_empty() { bounds } else { rounding(bounds) };
        let boxes: Vec<Bounds> = kept.iter().map(|(_, shapes)| grown(rounding(around(shapes)), diagonal)).collect();
        let (nodes, mut changing, root) = collapse::build(&boxes, LEAF_SIZE, Vec::new, |blocks, members| {
            let first = blocks.len();
            for shape in 0..=mesh.later.len() {
                let triangle = |&item: &u32| (kept[item as usize].0, kept[item as usize].1[shape]);
                blocks.push(Block::new(members.iter().map(triangle)));
            }
            Reference::changing(first)
        });
        changing.shrink_to_fit();
        let (parts, triangles) = (mesh.later.len(), kept.len() as u64);
        MeshTree { nodes, blocks: Vec::new(), changing, parts, root, bounds, triangles }
    }
}

/// Grows the box of a triangle: by 4·10⁻⁷ of the diagonal of everything (HARDCASES §5.3, measured: less leaves
/// misses at vertices), then by one ulp.
pub(super) fn grown(bounds: Bounds, diagonal: f64) -> Bounds {
    bounds.grown(Vec3::splat((4e-7 * diagonal) as f32))
}

/// Keeps the first of triangles whose corners agree bit for bit (−0.0 and 0.0 are one), in the same order.
fn drop_copies(kept: &mut Vec<u32>, triangle: impl Fn(u32) -> [Vec3; 3]) {
    let key = |prim: u32| triangle(prim).map(|p| (p + Vec3::ZERO).to_array().map(f32::to_bits));
    let mut keyed: Vec<_> = kept.iter().map(|&prim| (key(prim), prim)).collect();
    keyed.sort_unstable();
    keyed.dedup_by_key(|(key, _)| *key);
    if keyed.len() < kept.len() {
        *kept = keyed.into_iter().map(|(_, prim)| prim).collect();
        kept.sort_unstable();
    }
}
