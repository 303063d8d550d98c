//! The faces of a scene: triangles and parallelograms, with what the loops over them read.

use std::collections::BTreeMap;

use glam::{DVec3, Vec3};

use crate::math::float::UNIT_ROUNDOFF;
use crate::math::quad::Quad;
use crate::scene::geometry::TriangleMesh;

/// How far, over the largest coordinate, the fourth corner of a pair of triangles may lie from where a parallelogram
/// has it: four roundings.
const CORNER: f64 = 4.0 * UNIT_ROUNDOFF as f64;

/// How far, over the longest edge, it may lie out of the plane of the other three: a ray that leaves the one triangle
/// is tested against the plane of the other, and starts five such roundings above its own (`math::float`).
const BEND: f64 = UNIT_ROUNDOFF as f64;

/// A face with `N` edges, as the loop over rays reads it. A ray of direction d and moment r = o × d passes the edge a
/// → b on the side of the sign of e·r + m·d, with e = (b − a)/|b − a| and m = a × e (Plücker coordinates):
/// the lines' distance times the sine of the angle between them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face<const N: usize> {
    /// e and m of each edge.
    pub edges: [[f32; 6]; N],
    /// The least height of the triangle at `corner` over its edges, metres.
    pub height: f32,
    /// A corner.
    pub corner: [f32; 3],
    /// Unit normal.
    pub normal: [f32; 3],
}

/// What the hit of a face is computed from: a corner c and its neighbours a and b, with the winding c → a → b.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Corner {
    pub c: [f32; 3],
    /// a − c.
    pub ca: [f32; 3],
    /// b − c.
    pub cb: [f32; 3],
    /// Unit normal.
    pub normal: [f32; 3],
    /// Triangle (c, a, b), and (a + b − c, b, a) or the same again.
    pub prim: [u32; 2],
    /// Which of (c, a, b), or of (a + b − c, b, a), is the triangle's first vertex.
    pub first: [u32; 2],
}

/// All faces: parallelograms first.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct Faces {
    pub(super) quads: Vec<Face<4>>,
    pub(super) triangles: Vec<Face<3>>,
    /// One for each face, in their order, and one more.
    pub(super) corners: Vec<Corner>,
    /// The corners of each face in f64, in the order of its edges; of a triangle the last one twice.
    pub(super) exact: Vec<[DVec3; 4]>,
    /// Face of each triangle, by its number in the mesh.
    by_prim: Vec<(u32, u32)>,
    /// Largest sum of a corner's coordinates, metres.
    pub(super) reach: f32,
}

/// A triangle and its corners.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct Triangle {
    /// Number in the mesh.
    pub prim: u32,
    pub v: [Vec3; 3],
}

impl Triangle {
    /// Those of a mesh that can be traced.
    pub fn of(mesh: &TriangleMesh) -> impl Iterator<Item = Self> {
        mesh.traced().map(|(prim, v)| Triangle { prim, v })
    }
}

impl Faces {
    /// Of triangles that can be traced.
    pub fn new(triangles: &[Triangle]) -> Self {
        let all = triangles;
        // The triangles at each edge as they turn around it, by the bits of its ends.
        let mut around: BTreeMap<Edge, Vec<usize>> = BTreeMap::new();
        for (i, triangle) in all.iter().enumerate() {
            for k in 0..3 {
                around.entry(edge(triangle.v[k], triangle.v[(k + 1) % 3])).or_default().push(i);
            }
        }
        let mut taken = vec![false; all.len()];
        let (mut quads, mut triangles, mut exact) = (Vec::new(), Vec::new(), Vec::new());
        for (i, first) in all.iter().enumerate() {
            if std::mem::replace(&mut taken[i], true) {
                continue;
            }
            let neighbours = (0..3).filter_map(|k| around.get(&edge(first.v[(k + 1) % 3], first.v[k]))).flatten();
            let mut free = neighbours.copied().filter(|&j| !taken[j]);
            match free.find_map(|j| Some((j, joined(first, &all[j])?))) {
                Some((j, quad)) => {
                    taken[j] = true;
                    quads.push(quad);
                }
                None => triangles.push(face(first.v, [first.prim; 2], [0; 2])),
            }
        }
        exact.extend(quads.iter().map(|quad| quad.2.map(|v| v.as_dvec3())));
        exact.extend(triangles.iter().map(|(_, _, v)| [v[0], v[1], v[2], v[2]].map(|v| v.as_dvec3())));
        let corners = quads.iter().map(|quad| quad.1).chain(triangles.iter().map(|triangle| triangle.1));
        let nothing = Corner { c: [0.0; 3], ca: [0.0; 3], cb: [0.0; 3], normal: [0.0; 3], prim: [0; 2], first: [0; 2] };
        let corners: Vec<Corner> = corners.chain([nothing]).collect();
        let numbered = (0u32..).zip(&corners[..corners.len() - 1]);
        let mut by_prim: Vec<_> = numbered.flat_map(|(face, corner)| corner.prim.map(|prim| (prim, face))).collect();
        by_prim.sort_unstable();
        by_prim.dedup();
        let (quads, triangles) =
            (quads.into_iter().map(|quad| quad.0).collect(), triangles.into_iter().map(|t| t.0).collect());
        let reach = all.iter().flat_map(|triangle| triangle.v).map(|v| v.abs().element_sum()).fold(0.0, f32::max);
        Faces { quads, triangles, corners, exact, by_prim, reach }
    }

    /// Of a mesh.
    #[cfg(test)]
    pub fn of(mesh: &TriangleMesh) -> Self {
        Faces::new(&Triangle::of(mesh).collect::<Vec<_>>())
    }

    /// The face that a triangle is in.
    pub(super) fn of_triangle(&self, prim: u32) -> Option<u32> {
        let at = self.by_prim.binary_search_by_key(&prim, |(prim, _)| *prim).ok()?;
        Some(self.by_prim[at].1)
    }

    pub fn count(&self) -> usize {
        self.quads.len() + self.triangles.len()
    }

    /// Triangles in all faces.
    pub fn triangles(&self) -> u64 {
        (2 * self.quads.len() + self.triangles.len()) as u64
    }

    pub fn bytes(&self) -> u64 {
        let of = size_of_val::<[Face<4>]>(&self.quads) + size_of_val::<[Face<3>]>(&self.triangles);
        (of + size_of_val::<[Corner]>(&self.corners) + size_of_val::<[[DVec3; 4]]>(&self.exact)) as u64
    }
}

/// The bits of an edge's two ends.
type Edge = [[u32; 3]; 2];

fn edge(from: Vec3, to: Vec3) -> Edge {
    // −0.0 is 0.0.
    [from, to].map(|v| (v + Vec3::ZERO).to_array().map(f32::to_bits))
}

/// The face of two triangles that make a parallelogram up to rounding, nearer to one plane than rays start off it.
fn joined(first: &Triangle, second: &Triangle) -> Option<(Face<4>, Corner, [Vec3; 4])> {
    let quad = Quad::of(&first.v, &second.v)?;
    let [c, a, _, b] = quad.corners.map(|v| v.as_dvec3());
    let (ca, cb, gap) = (a - c, b - c, quad.gap());
    let is_parallelogram = gap.abs().max_element() <= CORNER * f64::from(quad.reach())
        && gap.dot(ca.cross(cb).normalize()).abs() <= BEND * ca.length().max(cb.length());
    // (c, a, b) begins with vertex (3 − apex) mod 3 counted from c; so for the other.
    let first_vertex = quad.apex.map(|apex| (3 - apex) as u32 % 3);
    is_parallelogram.then(|| face(quad.corners, [first.prim, second.prim], first_vertex))
}

/// The face with these corners in their winding. Products are formed in f64 and rounded once.
fn face<const N: usize>(corners: [Vec3; N], prim: [u32; 2], first: [u32; 2]) -> (Face<N>, Corner, [Vec3; N]) {
    let exact = corners.map(|v| v.as_dvec3());
    let (c, a, b) = (exact[0], exact[1], exact[N - 1]);
    let normal = (a - c).cross(b - c);
    let longest = [(a - c).length(), (b - c).length(), (b - a).length()].into_iter().fold(0.0, f64::max);
    let height = (normal.length() / longest) as f32;
    let normal = normal.normalize().as_vec3().to_array();
    let edges = std::array::from_fn(|i| {
        let (from, to) = (exact[i], exact[(i + 1) % N]);
        // Formed from the same end for both owners of the edge, so that their numbers differ in the sign alone.
        let turned = to.to_array() < from.to_array();
        let (low, high) = if turned { (to, from) } else { (from, to) };
        let unit = (high - low).normalize() * if turned { -1.0 } else { 1.0 };
        let (e, m) = (unit.as_vec3(), low.cross(unit).as_vec3());
        [e.x, e.y, e.z, m.x, m.y, m.z]
    });
    let (ca, cb) = ((a - c).as_vec3().to_array(), (b - c).as_vec3().to_array());
    let c = corners[0].to_array();
    (Face { edges, height, corner: c, normal }, Corner { c, ca, cb, normal, prim, first }, corners)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(indices: &[[u32; 3]], lift: f32) -> TriangleMesh {
        let vertices = vec![Vec3::ZERO, Vec3::X * 2.0, Vec3::new(2.0, 1.0, lift), Vec3::Y];
        TriangleMesh { vertices, indices: indices.to_vec(), ..TriangleMesh::default() }
    }

    /// Oracle: a rectangle of two triangles, in every order of their vertices; bent or turned over it is none.
    #[test]
    fn parallelograms_are_one_face() {
        for i in 0..3 {
            for j in 0..3 {
                let mut indices = [[0, 1, 3], [2, 3, 1]];
                indices[0].rotate_left(i);
                indices[1].rotate_left(j);
                let faces = Faces::of(&mesh(&indices, 0.0));
                assert_eq!((faces.quads.len(), faces.triangles.len()), (1, 0), "{indices:?}");
                let corner = &faces.corners[0];
                let at = indices[0].map(|k| k as usize);
                let (c, v) = (Vec3::from(corner.c), mesh(&indices, 0.0).vertices);
                let around = [c, c + Vec3::from(corner.ca), c + Vec3::from(corner.cb)];
                assert_eq!(around[corner.first[0] as usize], v[at[0]]);
                let around = [around[1] + around[2] - c, around[2], around[1]];
                assert_eq!(around[corner.first[1] as usize], v[indices[1][0] as usize]);
            }
        }
        assert_eq!(Faces::of(&mesh(&[[0, 1, 3], [2, 3, 1]], 1e-3)).quads.len(), 0);
        assert_eq!(Faces::of(&mesh(&[[0, 1, 3], [2, 1, 3]], 0.0)).quads.len(), 0);
    }
}
