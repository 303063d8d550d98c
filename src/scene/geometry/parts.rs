//! The world mesh in two: what all frames of an animation have, and what others have elsewhere ([`Frames`]).
//!
//! [`Frames`]: super::frames::Frames

use glam::Vec3;

use super::records::{Geometry, TriangleMesh};

impl Geometry {
    /// The world mesh in two where that is worth it; the second part may be nothing. `world` stands for the geometry's
    /// own. All triangles keep their numbers; in the part that they do not belong to their corners are not finite. The
    /// first has the same bits in all frames.
    pub fn parts(&self, world: &TriangleMesh) -> Option<[TriangleMesh; 2]> {
        let is_moved = self.frames.moved(world.indices.len())?;
        if !is_moved.contains(&true) {
            return Some([world.clone(), TriangleMesh::default()]);
        }
        Some([false, true].map(|moved| part(world, &is_moved, moved)))
    }
}

/// The triangles of one part.
fn part(world: &TriangleMesh, is_moved: &[bool], moved: bool) -> TriangleMesh {
    // Vertices from the first to the last that belong to it; others lie in the origin.
    let belongs = |&(_, &of): &(&[u32; 3], &bool)| of == moved;
    let indices = || world.indices.iter().zip(is_moved);
    let vertices = || indices().filter(belongs).flat_map(|(index, _)| index).map(|&i| i as usize);
    let known = world.vertices.len();
    let (first, end) =
        vertices().filter(|&i| i < known).fold((usize::MAX, 0), |(first, end), i| (first.min(i), end.max(i + 1)));
    let first = first.min(end);
    let mut mesh = TriangleMesh { first_triangle: world.first_triangle, ..TriangleMesh::default() };
    mesh.vertices = vec![Vec3::ZERO; end - first];
    vertices().filter(|&i| i < known).for_each(|i| mesh.vertices[i - first] = world.vertices[i]);
    let nowhere = mesh.vertices.len() as u32;
    // And one behind the last, for 16-byte reads.
    mesh.vertices.extend([Vec3::NAN; 2]);
    let shifted = |index: [u32; 3]| {
        if index.iter().all(|&i| (i as usize) < known) { index.map(|i| i - first as u32) } else { [nowhere; 3] }
    };
    mesh.indices = indices().map(|(&index, &of)| if of == moved { shifted(index) } else { [nowhere; 3] }).collect();
    mesh
}
