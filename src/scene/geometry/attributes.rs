//! Vertex attributes of the flattened geometry: which of them a mesh's triangles carry, and their values in the space
//! that hits are shaded in.

use glam::{DMat3, Vec2, Vec3, Vec4};

use super::records::{Geometry, NO_ATTRIBUTES};
use crate::scene::{Material, Mesh};

/// Which attributes a mesh's triangles carry, richest first: the order in which meshes are laid out.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Attributes {
    /// Colours or more than one channel of texture coordinates, and a place for all the others.
    Extras,
    Tangents,
    Uvs,
    Normals,
    None,
}

/// Whether a mesh has attributes beyond [`Attributes`] that its material reads: colours, or more than one channel of
/// texture coordinates.
pub(super) fn has_extras(mesh: &Mesh, material: &Material) -> bool {
    (material.vertex_colors && mesh.colors.is_some()) || (mesh.uvs.is_some() && material.uv_channels() > 1)
}

impl Attributes {
    /// What triangles get arrays for: those with extras for all.
    pub(super) fn laid_out(mesh: &Mesh, material: &Material) -> Self {
        if has_extras(mesh, material) { Attributes::Extras } else { Attributes::of(mesh, material) }
    }

    fn of(mesh: &Mesh, material: &Material) -> Self {
        if mesh.uvs.is_some() && mesh.tangents.is_some() && material.tangent_channel().is_some() {
            Attributes::Tangents
        } else if mesh.uvs.is_some() && material.reads_textures() {
            Attributes::Uvs
        } else if mesh.normals.is_some() {
            Attributes::Normals
        } else {
            Attributes::None
        }
    }
}

impl Geometry {
    /// Adds the attributes of one triangle; their index, or [`NO_ATTRIBUTES`].
    pub(super) fn push_attributes(
        &mut self,
        mesh: &Mesh,
        richness: Attributes,
        corner: [u32; 3],
        n_g: Vec3,
        normal_matrix: &DMat3,
    ) -> u32 {
        if richness == Attributes::None {
            return NO_ATTRIBUTES;
        }
        let to_world = |v: Vec3| (*normal_matrix * v.as_dvec3()).normalize_or_zero().as_vec3();
        let at = corner.map(|i| i as usize);
        self.normals.push(match &mesh.normals {
            Some(normals) => at.map(|i| {
                let n = to_world(normals[i]);
                if n == Vec3::ZERO || !n.is_finite() { n_g } else { n }
            }),
            None => [n_g; 3],
        });
        let finite = |uvs: &Vec<Vec2>| at.map(|i| if uvs[i].is_finite() { uvs[i] } else { Vec2::ZERO });
        if richness <= Attributes::Uvs {
            self.uvs.push(mesh.uvs.as_ref().map_or([Vec2::ZERO; 3], finite));
        }
        if richness == Attributes::Extras {
            for (channel, uvs) in self.more_uvs.iter_mut().enumerate() {
                uvs.push(mesh.more_uvs.get(channel).map_or([Vec2::ZERO; 3], finite));
            }
            self.colors.push(mesh.colors.as_ref().map_or([Vec4::ONE; 3], |colors| at.map(|i| colors[i])));
        }
        if richness <= Attributes::Tangents {
            let linear = normal_matrix.inverse().transpose();
            let placed = |tangent: Vec4| {
                let t = (linear * tangent.truncate().as_dvec3()).normalize_or_zero().as_vec3();
                t.extend(if linear.determinant() < 0.0 { -tangent.w } else { tangent.w })
            };
            let tangents = mesh.tangents.as_ref();
            self.tangents.push(tangents.map_or([Vec4::ZERO; 3], |tangents| at.map(|i| placed(tangents[i]))));
        }
        (self.normals.len() - 1) as u32
    }
}
