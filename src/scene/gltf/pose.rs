//! Poses in f64: as scenes hold them, and without scale, as cameras need them.

use glam::{Affine3A, DAffine3, DMat3};

/// A pose as scenes hold it.
pub(super) fn to_f32(world: &DAffine3) -> Affine3A {
    Affine3A { matrix3: world.matrix3.as_mat3().into(), translation: world.translation.as_vec3a() }
}

/// `world_from_node` without its scale; `None` where that has no orientation.
pub(super) fn rigid_pose(world_from_node: &DAffine3) -> Option<DAffine3> {
    Some(DAffine3 { matrix3: rigid(world_from_node.matrix3)?, translation: world_from_node.translation })
}

/// The rotation that looks along the same −Z with the same up direction.
fn rigid(linear: DMat3) -> Option<DMat3> {
    let z = linear.z_axis.try_normalize()?;
    // Where up lies along the view (a flattened node), any perpendicular serves.
    let y = (linear.y_axis - z * z.dot(linear.y_axis)).try_normalize().unwrap_or_else(|| z.any_orthonormal_vector());
    Some(DMat3::from_cols(y.cross(z), y, z))
}
