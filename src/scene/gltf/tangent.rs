//! Tangents for normal maps whose file has none, by MikkTSpace (glTF 2.0 §3.7.2.1 asks for it).
//!
//! The crate computes one tangent for each corner; corners of one vertex that disagree are split into separate
//! vertices. Its two corrections of the C original are on: sorting of edges and merging of vertices by the standard
//! library, in n log n and without recursion. Grouping still recurses around a point, which is bounded before it is
//! called.

use std::collections::HashMap;

use bevy_mikktspace::TangentSpace;
use glam::{DVec3, Vec2, Vec3, Vec4};

use super::super::Mesh;

/// MikkTSpace recurses, and compares pairwise, over the corners at one position: this many cost about 1 MB of stack.
const MOST_CORNERS_AT_A_POINT: usize = 4096;

/// Gives `mesh` tangents along a channel of its texture coordinates, and flat normals if it has none. The error is a
/// clause that says why it cannot have them.
pub(super) fn generate(mesh: &mut Mesh, channel: u32) -> Result<(), &'static str> {
    let uvs = if channel == 0 { mesh.uvs.as_ref() } else { mesh.more_uvs.get(channel as usize - 1) };
    let Some(uvs) = uvs else { return Err("has no texture coordinates") };
    let mut corners_at: HashMap<[u32; 3], usize> = HashMap::new();
    for &corner in mesh.triangles.as_flattened() {
        // −0 and 0 are one place.
        let place = (mesh.positions[corner as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
        *corners_at.entry(place).or_default() += 1;
    }
    if corners_at.values().any(|&corners| corners > MOST_CORNERS_AT_A_POINT) {
        return Err("has a point where more than 4096 triangles meet");
    }
    let own = of_corners(mesh, uvs)?;
    let later: Vec<Tangents> =
        mesh.later.iter().map(|shape| of_corners(&mesh.shaped(shape), uvs)).collect::<Result<_, _>>()?;
    split(mesh, &own, &later);
    Ok(())
}

/// Flat normals by triangle, and tangents by corner.
struct Tangents {
    flat: Vec<Vec3>,
    tangents: Vec<Vec4>,
}

fn of_corners(mesh: &Mesh, uvs: &[Vec2]) -> Result<Tangents, &'static str> {
    // Scaling by a power of two is exact, leaves tangents alone, and keeps squares from overflowing.
    let extent = mesh.positions.iter().fold(0.0f32, |extent, position| extent.max(position.abs().max_element()));
    let scale = (-f64::from(extent).log2().ceil()).exp2();
    let flat: Vec<Vec3> = mesh.triangles.iter().map(|triangle| flat_normal(mesh, triangle)).collect();
    let mut corners = Corners { mesh, uvs, flat: &flat, scale, tangents: vec![Vec4::ZERO; 3 * mesh.triangles.len()] };
    if bevy_mikktspace::generate_tangents(&mut corners).is_err() {
        return Err("has no geometry that MikkTSpace accepts");
    }
    let tangents = corners.tangents;
    Ok(Tangents { flat, tangents })
}

fn flat_normal(mesh: &Mesh, triangle: &[u32; 3]) -> Vec3 {
    let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize].as_dvec3());
    (b - a).cross(c - a).try_normalize().unwrap_or(DVec3::Y).as_vec3()
}

/// Rewrites the mesh so that each vertex has one normal and one tangent; its later shapes as the first one is divided.
fn split(mesh: &mut Mesh, Tangents { flat, tangents }: &Tangents, later: &[Tangents]) {
    let mut vertices: HashMap<(u32, [u32; 7]), u32> = HashMap::new();
    let (mut positions, mut normals, mut kept) = (Vec::new(), Vec::new(), Vec::new());
    // Where each new vertex comes from, and its first corner.
    let (mut origins, mut firsts) = (Vec::new(), Vec::new());
    for (number, triangle) in mesh.triangles.iter_mut().enumerate() {
        for (corner, vertex) in triangle.iter_mut().enumerate() {
            let old = *vertex as usize;
            let normal = mesh.normals.as_ref().map_or(flat[number], |normals| normals[old]);
            let tangent = perpendicular(tangents[3 * number + corner], normal);
            let [x, y, z] = normal.to_array().map(f32::to_bits);
            let [a, b, c, w] = tangent.to_array().map(f32::to_bits);
            let next = positions.len() as u32;
            *vertex = *vertices.entry((*vertex, [x, y, z, a, b, c, w])).or_insert(next);
            if *vertex == next {
                positions.push(mesh.positions[old]);
                normals.push(normal);
                origins.push(old);
                firsts.push(3 * number + corner);
                kept.push(tangent);
            }
        }
    }
    mesh.positions = positions;
    mesh.normals = Some(normals);
    for (shape, Tangents { flat, tangents }) in mesh.later.iter_mut().zip(later) {
        let normal = |(&old, &corner): (&usize, &usize)| match &shape.normals {
            Some(normals) => normals[old],
            None => flat[corner / 3],
        };
        let normals: Vec<Vec3> = origins.iter().zip(&firsts).map(normal).collect();
        let tangent = |(&corner, &normal): (&usize, &Vec3)| perpendicular(tangents[corner], normal);
        shape.tangents = Some(firsts.iter().zip(&normals).map(tangent).collect());
        shape.positions = origins.iter().map(|&old| shape.positions[old]).collect();
        shape.normals = Some(normals);
    }
    for uvs in mesh.uvs.iter_mut().chain(&mut mesh.more_uvs) {
        *uvs = origins.iter().map(|&old| uvs[old]).collect();
    }
    if let Some(colors) = &mut mesh.colors {
        *colors = origins.iter().map(|&old| colors[old]).collect();
    }
    mesh.tangents = Some(kept);
}

/// A usable tangent: unit, not along the normal; any perpendicular where texture coordinates give none.
fn perpendicular(tangent: Vec4, normal: Vec3) -> Vec4 {
    let sign = if tangent.w < 0.0 { -1.0 } else { 1.0 };
    let direction = tangent.truncate();
    match direction.try_normalize().filter(|direction| direction.cross(normal) != Vec3::ZERO) {
        Some(direction) => direction.extend(sign),
        None => normal.any_orthonormal_vector().extend(sign),
    }
}

/// The mesh as the crate wants to see it.
struct Corners<'m> {
    mesh: &'m Mesh,
    uvs: &'m [Vec2],
    flat: &'m [Vec3],
    scale: f64,
    tangents: Vec<Vec4>,
}

impl Corners<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.mesh.triangles[face][corner] as usize
    }
}

impl bevy_mikktspace::Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.mesh.triangles.len()
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        // Corners are merged by their bits: −0 becomes 0.
        let position = (self.mesh.positions[self.vertex(face, corner)].as_dvec3() * self.scale).as_vec3();
        (position + Vec3::ZERO).to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        let flat = self.flat[face];
        let normal = self.mesh.normals.as_ref().map_or(flat, |normals| normals[self.vertex(face, corner)]);
        (normal + Vec3::ZERO).to_array()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        // glTF's v runs down the image and its bitangent up (green is +Y): without the flip every sign would be the
        // other.
        let uv = self.uvs[self.vertex(face, corner)];
        [uv.x + 0.0, 0.0 - uv.y]
    }

    fn set_tangent(&mut self, tangent: Option<TangentSpace>, face: usize, corner: usize) {
        self.tangents[3 * face + corner] = tangent.map_or(Vec4::ZERO, |tangent| tangent.tangent_encoded().into());
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::MaterialId;
    use super::*;

    fn quad(uvs: [[f32; 2]; 4]) -> Mesh {
        Mesh {
            name: String::new(),
            positions: [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]].map(|[x, y]| Vec3::new(x, y, 0.0)).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            uvs: Some(uvs.map(Vec2::from_array).to_vec()),
            material: MaterialId(0),
            ..Mesh::default()
        }
    }

    /// Oracle: ∂P/∂u of a planar mapping, and w so that cross(n, t)·w points up the image. No randomness.
    #[test]
    fn planar_mapping_gives_its_own_axes() {
        let mut mesh = quad([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
        generate(&mut mesh, 0).expect("a quad has tangents");
        assert_eq!((mesh.positions.len(), mesh.normals.as_deref()), (4, Some(&[Vec3::Z; 4][..])));
        for tangent in mesh.tangents.expect("generated") {
            assert!((tangent - Vec3::X.extend(1.0)).length() < 1e-6, "{tangent}");
        }
        let mut turned = quad([[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]);
        generate(&mut turned, 0).expect("a quad has tangents");
        for tangent in turned.tangents.expect("generated") {
            // u runs along +Y and v along +X, so that up the image is −X = cross(Z, Y).
            assert!((tangent - Vec3::Y.extend(1.0)).length() < 1e-6, "{tangent}");
        }
    }

    /// Oracle: the invariant "unit, perpendicular to nothing in particular, finite". Uvs without area, and absurd ones.
    #[test]
    fn useless_texture_coordinates_still_give_unit_tangents() {
        for uvs in [[[0.5; 2]; 4], [[1e38, -1e38], [-1e38, 3e38], [0.0, 1e-45], [1e30, 7.0]]] {
            let mut mesh = quad(uvs);
            mesh.positions.iter_mut().for_each(|position| *position *= 1e18);
            generate(&mut mesh, 0).expect("a quad has tangents");
            for tangent in mesh.tangents.expect("generated") {
                assert!((tangent.truncate().length() - 1.0).abs() < 1e-6, "{tangent}");
            }
        }
    }
}
