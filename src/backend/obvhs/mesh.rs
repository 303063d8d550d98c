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
use crate::scene::geometry::TriangleMesh;

/// Triangles and hierarchy of one mesh.
#[derive(Debug)]
pub(super) struct MeshTree {
    pub nodes: Vec<Node>,
    pub blocks: Vec<Block>,
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
        MeshTree { nodes, blocks, root, bounds, triangles: kept.len() as u64 }
    }
}

/// Grows the box of a triangle: by 4·10⁻⁷ of the diagonal of everything (HARDCASES §5.3, measured: less leaves
/// misses at vertices), then by one ulp.
fn grown(bounds: Bounds, diagonal: f64) -> Bounds {
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
