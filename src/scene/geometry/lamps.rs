//! Emissive triangles that repeat each other.

use std::collections::HashSet;

use glam::Vec3;

use super::records::MeshRecords;
use crate::scene::Material;

/// Leaves out emissive triangles that repeat the corners of an earlier one in the same turn, and says how many: a
/// ray meets one of the two, but light sampling would find both, and the picture would depend on who found the
/// light. Lamps that overlap otherwise (cut another way, moved a little, back to back) are not recognised.
pub(super) fn drop_copied_lamps(world: &mut MeshRecords, materials: &[Material]) -> usize {
    let mut seen = HashSet::new();
    let vertices = &world.mesh.vertices;
    let keep: Vec<bool> = (world.mesh.indices.iter().zip(&world.records))
        .map(|(corners, record)| {
            !materials[record.material as usize].is_emissive() || {
                // Whichever corner comes first, and whatever the sign of a zero.
                let mut bits = corners.map(|i| (vertices[i as usize] + Vec3::ZERO).to_array().map(f32::to_bits));
                let least = (0..3).min_by_key(|&i| bits[i]).expect("three corners");
                bits.rotate_left(least);
                // A mirroring placement has swapped two corners, so their turn says where the front is.
                seen.insert(bits)
            }
        })
        .collect();
    // Where placements begin moves with what is left out before.
    let (mut counted, mut left) = (0, 0);
    for part in &mut world.parts {
        left += keep[counted..part.first as usize].iter().filter(|kept| **kept).count() as u32;
        (counted, part.first) = (part.first as usize, left);
    }
    let mut kept = keep.iter();
    world.mesh.indices.retain(|_| *kept.next().expect("a verdict each"));
    let mut kept = keep.iter();
    world.records.retain(|_| *kept.next().expect("a verdict each"));
    keep.len() - world.records.len()
}
