//! One mesh ready to be traced: its triangles in leaf order, four to a block, and the hierarchy over the blocks.
//!
//! Triangles that are points, lines or not finite are left out, and of exact copies only the first is kept: it would win
//! every tie anyway (HARDCASES §5.3, 4).

use std::ops::ControlFlow;

use glam::Vec3;

use super::tree::{Bounds, LEAF_SIZE, Tree};
use super::wide::{BoxRay, SLACK, Stack, Wide, grown};
use crate::backend::triangle::{Closest, Lanes, Ray, RayShear, TriangleHit, is_degenerate};
use crate::scene::geometry::TriangleMesh;

/// Up to four triangles of a leaf; unused lanes hold NaN and are never hit.
#[repr(C, align(32))]
#[derive(Clone, Copy, Debug)]
struct Block {
    vertices: Lanes<LEAF_SIZE>,
    prim: [u32; LEAF_SIZE],
}

/// Triangles and hierarchy of one mesh.
#[derive(Debug)]
pub(super) struct MeshBvh {
    wide: Wide,
    blocks: Vec<Block>,
    /// Bounds of the triangles that are kept, not grown.
    pub bounds: Bounds,
    /// How many triangles are kept.
    pub triangles: u64,
}

impl MeshBvh {
    /// Builds over `mesh`; `scene_diagonal` is the extent of everything in the same space, at least the mesh's own.
    pub fn build(mesh: &TriangleMesh, scene_diagonal: f64) -> Self {
        let corner = |i: u32| mesh.vertices.get(i as usize).copied().unwrap_or(Vec3::NAN);
        let triangle = |prim: u32| mesh.indices[prim as usize].map(corner);
        let mut kept: Vec<u32> =
            (0..mesh.indices.len() as u32).filter(|&prim| !is_degenerate(&triangle(prim))).collect();
        drop_copies(&mut kept, triangle);

        let bounds = kept.iter().fold(Bounds::EMPTY, |b, &prim| b.union(Bounds::of(&triangle(prim))));
        let diagonal = scene_diagonal.max(bounds.diagonal());
        let boxes: Vec<Bounds> = kept.iter().map(|&prim| grown(Bounds::of(&triangle(prim)), diagonal)).collect();
        let items = || (0..kept.len() as u32).collect();

        let fold = |tree: &Tree| {
            let mut blocks = Vec::with_capacity(kept.len().div_ceil(2));
            let wide = Wide::fold(tree, |members| {
                let mut block = Block { vertices: [[[f32::NAN; 4]; 3]; 3], prim: [u32::MAX; 4] };
                for (lane, &item) in members.iter().enumerate() {
                    let prim = kept[item as usize];
                    block.prim[lane] = prim;
                    for (vertex, p) in triangle(prim).iter().enumerate() {
                        for axis in 0..3 {
                            block.vertices[vertex][axis][lane] = p[axis];
                        }
                    }
                }
                blocks.push(block);
                blocks.len() as u32 - 1
            });
            wide.map(|wide| (wide, blocks))
        };
        let (wide, blocks) = fold(&Tree::build(&boxes, items()))
            .or_else(|| fold(&Tree::by_median(&boxes, items())))
            .expect("median splits of 2^31 boxes are 31 levels deep, fewer than the stack allows");
        MeshBvh { wide, blocks, bounds, triangles: kept.len() as u64 }
    }

    /// Bytes of nodes and blocks.
    pub fn bytes(&self) -> u64 {
        self.wide.bytes() + size_of_val(self.blocks.as_slice()) as u64
    }

    /// Offers every triangle that may be the closest to `closest`; `inst` and `geom` are the first parts of their rank.
    #[inline(always)]
    pub fn closest(&self, ray: &Ray, (inst, geom): (u32, u32), closest: &mut Closest, stack: &mut Stack) {
        let shear = RayShear::new(ray);
        let mut reach = closest.hit.t * SLACK;
        self.wide.walk(&BoxRay::new(ray), &mut reach, stack, |leaf, reach| {
            let block = &self.blocks[leaf as usize];
            let hits = shear.intersect_lanes(&block.vertices, ray.tnear, closest.hit.t);
            let mut mask = hits.mask;
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize & (LEAF_SIZE - 1);
                mask &= mask - 1;
                let hit = TriangleHit { t: hits.t[lane], u: hits.u[lane], v: hits.v[lane] };
                closest.offer(hit, (inst, geom, block.prim[lane]));
                *reach = closest.hit.t * SLACK;
            }
            ControlFlow::Continue(())
        });
    }

    /// True if the segment meets any triangle.
    #[inline(always)]
    pub fn any(&self, ray: &Ray, stack: &mut Stack) -> bool {
        let shear = RayShear::new(ray);
        let mut found = false;
        self.wide.walk(&BoxRay::new(ray), &mut (ray.tfar * SLACK), stack, |leaf, _| {
            let block = &self.blocks[leaf as usize];
            found = shear.intersect_lanes(&block.vertices, ray.tnear, ray.tfar).mask != 0;
            if found { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        found
    }
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
