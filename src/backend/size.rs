//! What a hierarchy takes, before it is built.
//!
//! Bytes a triangle, measured as growth of resident memory on grids, soups and scans of 0.1 to 1 million triangles
//! (Embree 3.13.5, AVX-512; obvhs 0.4): Embree keeps 57 to 70 and its copies of vertices and indices, obvhs 55 to 66,
//! and building takes 27 to 32 and 223 to 229 more. obvhs builds over each mesh by itself, as many at once as there are
//! threads, and joins the trees in the end: of several meshes only the largest are built at one time, and beside them
//! are the trees that are done.

use super::BackendKind;
use crate::scene::geometry::{Geometry, TriangleMesh};

/// Bytes of a hierarchy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// That stay, with the copies of vertices and indices.
    pub bytes: u64,
    /// Beside them while it is built.
    pub building: u64,
}

/// What the backend `kind` takes over `geometry`, built by so many threads.
pub fn of(kind: BackendKind, geometry: &Geometry, threads: usize) -> Size {
    let triangles = geometry.meshes.iter().map(|mesh| mesh.indices.len() as u64).sum::<u64>();
    let of_shapes = |mesh: &TriangleMesh| ((1 + mesh.later.len()) * mesh.vertices.len()) as u64;
    let vertices = geometry.meshes.iter().map(of_shapes).sum::<u64>();
    // Of meshes that change their shape, every triangle in every shape.
    let triangles = triangles + geometry.later.len() as u64;
    let instances = geometry.instances.len() as u64;
    let (bytes, building) = match kind {
        BackendKind::Embree => ((12 + 64) * triangles + 12 * vertices + 1000 * instances, 30 * triangles + (4 << 20)),
        BackendKind::Obvhs | BackendKind::FlatObvhs => {
            let at_once = at_once(geometry, threads) + geometry.later.len() as u64;
            (64 * triangles + 256 * instances, (226 * at_once + 64 * triangles).min(226 * triangles))
        }
        BackendKind::Flat | BackendKind::Brute => (64 * triangles, 0),
    };
    Size { bytes, building }
}

/// Triangles of the largest meshes, one a thread.
fn at_once(geometry: &Geometry, threads: usize) -> u64 {
    let mut meshes: Vec<u64> = geometry.meshes.iter().map(|mesh| mesh.indices.len() as u64).collect();
    meshes.sort_unstable_by_key(|&triangles| std::cmp::Reverse(triangles));
    meshes.iter().take(threads.max(1)).sum()
}
