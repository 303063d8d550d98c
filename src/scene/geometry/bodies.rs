//! Finding the bodies in flattened geometry, and which of them are around a point.

use std::collections::HashMap;

use glam::{Affine3A, DVec3, Vec3};

use super::records::{Geometry, TriangleMesh};
use super::solids::{NO_SOLID, Solid, Solids};
use crate::scene::{Fact, Facts, Material};

/// Farthest from an integer that a winding number may be, so that it tells inside from outside.
const CLEAR_WINDING: f64 = 0.1;

/// A connected part of a mesh.
#[derive(Clone, Copy, Debug)]
struct Body {
    material: u32,
    bounds: (DVec3, DVec3),
    /// Signed by the normals, m³ of the mesh's space.
    volume: f64,
    closed: bool,
}

/// Finds the solids of flattened geometry. A scene without materials that have an inside costs a look at those.
pub(super) fn find(geometry: &Geometry, materials: &[Material]) -> Solids {
    let is_solid: Vec<bool> = materials.iter().map(|material| Facts::of(material).has(Fact::Solid)).collect();
    let mut solids = Solids::default();
    if !geometry.triangles.iter().any(|triangle| is_solid[triangle.material as usize]) {
        return solids;
    }
    solids.bodies = vec![NO_SOLID; geometry.triangles.len()];
    let bodies: Vec<Vec<Body>> =
        geometry.meshes.iter().map(|mesh| find_bodies(geometry, mesh, &is_solid, &mut solids.bodies)).collect();

    let mut placed: Vec<(f64, usize, Solid)> = Vec::new();
    let world = std::iter::once((0, u32::MAX, Affine3A::IDENTITY));
    let instances = (0u32..).zip(&geometry.instances).map(|(i, p)| (p.mesh, i, p.world_from_object));
    for (mesh, instance, world_from_object) in world.chain(instances) {
        solids.first.push(placed.len() as u32);
        let scale = f64::from(world_from_object.matrix3.determinant().abs());
        for (number, body) in bodies[mesh as usize].iter().enumerate() {
            let size = body.bounds.1 - body.bounds.0;
            let bounds = transformed(body.bounds, &world_from_object);
            let of = [mesh, number as u32, instance];
            let solid = Solid { material: body.material, bounds, closed: body.closed, of };
            placed.push((size.x * size.y * size.z * scale, placed.len(), solid));
        }
    }
    solids.numbers = vec![0; placed.len()];
    // The largest box first; of equal ones, the first in the file.
    placed.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut open: HashMap<u32, u32> = HashMap::new();
    for &(_, place, solid) in &placed {
        let next = solids.list.len() as u32;
        let number = if solid.closed { next } else { *open.entry(solid.material).or_insert(next) };
        solids.numbers[place] = number;
        match solids.list.get_mut(number as usize) {
            None => solids.list.push(solid),
            Some(whole) => {
                whole.bounds = (whole.bounds.0.min(solid.bounds.0), whole.bounds.1.max(solid.bounds.1));
            }
        }
    }
    solids
}

impl Geometry {
    /// The closed solids around a point, by rank, and those of which it cannot be said. Oracle of where a path begins:
    /// the winding number, the sum of the solid angles of a body's triangles over 4π (Van Oosterom and Strackee 1983).
    pub fn solids_around(&self, point: Vec3) -> (Vec<u32>, Vec<u32>) {
        let (mut around, mut unclear) = (Vec::new(), Vec::new());
        for (number, solid) in (0u32..).zip(self.solids.list()) {
            let (low, high) = solid.bounds;
            if !(low.cmple(point).all() && high.cmpge(point).all()) {
                continue;
            }
            let winding = self.winding(solid, point);
            if !solid.closed || (winding - winding.round()).abs() > CLEAR_WINDING {
                unclear.push(number);
            } else if winding.round() != 0.0 {
                around.push(number);
            }
        }
        (around, unclear)
    }

    fn winding(&self, solid: &Solid, point: Vec3) -> f64 {
        let [geom, body, instance] = solid.of;
        let mesh = &self.meshes[geom as usize];
        let place = |p: Vec3| match self.instances.get(instance as usize) {
            Some(placement) => placement.world_from_object.transform_point3(p),
            None => p,
        };
        let mut sum = 0.0;
        for (triangle, corners) in mesh.indices.iter().enumerate() {
            if self.solids.bodies[mesh.first_triangle as usize + triangle] != body {
                continue;
            }
            let to = corners.map(|i| place(mesh.vertices[i as usize]).as_dvec3() - point.as_dvec3());
            let [a, b, c] = to.map(DVec3::length);
            let over = to[0].dot(to[1].cross(to[2]));
            let below = a * b * c + to[0].dot(to[1]) * c + to[0].dot(to[2]) * b + to[1].dot(to[2]) * a;
            sum += 2.0 * over.atan2(below);
        }
        sum / (4.0 * std::f64::consts::PI)
    }
}

/// Welds the corners of solid triangles, finds connected parts, and writes the part of each triangle to `of_triangle`.
fn find_bodies(geometry: &Geometry, mesh: &TriangleMesh, is_solid: &[bool], of_triangle: &mut [u32]) -> Vec<Body> {
    let first = mesh.first_triangle as usize;
    let material = |triangle: usize| geometry.triangles[first + triangle].material;
    let triangles: Vec<usize> = (0..mesh.indices.len()).filter(|&t| is_solid[material(t) as usize]).collect();
    let mut welded: HashMap<(u32, [u32; 3]), u32> = HashMap::new();
    let mut parent: Vec<u32> = Vec::new();
    let mut corners: Vec<[u32; 3]> = Vec::with_capacity(triangles.len());
    for &triangle in &triangles {
        corners.push(mesh.indices[triangle].map(|i| {
            // −0 and 0 are one place.
            let place = (mesh.vertices[i as usize] + 0.0).to_array().map(f32::to_bits);
            *welded.entry((material(triangle), place)).or_insert_with(|| {
                parent.push(parent.len() as u32);
                parent.len() as u32 - 1
            })
        }));
        let [a, b, c] = *corners.last().expect("pushed");
        join(&mut parent, a, b);
        join(&mut parent, a, c);
    }

    // Parts in the order of their first triangle.
    let mut number: HashMap<u32, usize> = HashMap::new();
    let mut parts: Vec<Body> = Vec::new();
    let mut part_of: Vec<usize> = Vec::with_capacity(triangles.len());
    let mut edges: HashMap<[u32; 2], i32> = HashMap::new();
    for (&triangle, &corner) in triangles.iter().zip(&corners) {
        let part = *number.entry(root(&mut parent, corner[0])).or_insert_with(|| {
            let bounds = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            parts.push(Body { material: material(triangle), bounds, volume: 0.0, closed: true });
            parts.len() - 1
        });
        part_of.push(part);
        let body = &mut parts[part];
        let [a, b, c] = mesh.indices[triangle].map(|i| mesh.vertices[i as usize].as_dvec3());
        body.bounds = (body.bounds.0.min(a).min(b).min(c), body.bounds.1.max(a).max(b).max(c));
        // About the first corner of the mesh, so that a body far from the origin keeps its digits.
        let origin = mesh.vertices[mesh.indices[triangles[0]][0] as usize].as_dvec3();
        let n_g = Vec3::from(geometry.triangles[first + triangle].n_g).as_dvec3();
        let twice_area = (b - a).cross(c - a).length();
        body.volume += (a - origin).dot(n_g) * twice_area / 6.0;
        // Along the winding that faces the front, which a mirroring placement has turned already.
        for [from, to] in [[corner[0], corner[1]], [corner[1], corner[2]], [corner[2], corner[0]]] {
            *edges.entry([from.min(to), from.max(to)]).or_default() += if from < to { 1 } else { -1 };
        }
    }
    for (edge, balance) in edges {
        if balance != 0 {
            let part = number[&root(&mut parent, edge[0])];
            parts[part].closed = false;
        }
    }

    // Cavities join the smallest body of their material around them.
    let owner: Vec<usize> = (0..parts.len())
        .map(|i| {
            let cavity = parts[i];
            let around = |&other: &usize| {
                let body = &parts[other];
                body.volume > 0.0
                    && body.material == cavity.material
                    && body.bounds.0.cmple(cavity.bounds.0).all()
                    && body.bounds.1.cmpge(cavity.bounds.1).all()
            };
            let size = |&other: &usize| (parts[other].bounds.1 - parts[other].bounds.0).length();
            let found = (0..parts.len()).filter(around).min_by(|a, b| size(a).total_cmp(&size(b)));
            if cavity.volume < 0.0 { found.unwrap_or(i) } else { i }
        })
        .collect();
    let mut bodies: Vec<Body> = Vec::new();
    let mut body_of: HashMap<usize, u32> = HashMap::new();
    for (&triangle, part) in triangles.iter().zip(part_of) {
        let body = *body_of.entry(owner[part]).or_insert_with(|| {
            bodies.push(parts[owner[part]]);
            bodies.len() as u32 - 1
        });
        bodies[body as usize].closed &= parts[part].closed;
        of_triangle[first + triangle] = body;
    }
    bodies
}

fn root(parent: &mut [u32], mut of: u32) -> u32 {
    while parent[of as usize] != of {
        let above = parent[parent[of as usize] as usize];
        parent[of as usize] = above;
        of = above;
    }
    of
}

fn join(parent: &mut [u32], a: u32, b: u32) {
    let (a, b) = (root(parent, a), root(parent, b));
    parent[a.max(b) as usize] = a.min(b);
}

/// The box around a placed box.
fn transformed((low, high): (DVec3, DVec3), place: &Affine3A) -> (Vec3, Vec3) {
    let mut bounds = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for corner in 0..8 {
        let at = |bit: u32, low: f64, high: f64| if corner >> bit & 1 == 0 { low } else { high };
        let p = DVec3::new(at(0, low.x, high.x), at(1, low.y, high.y), at(2, low.z, high.z)).as_vec3();
        let p = if *place == Affine3A::IDENTITY { p } else { place.transform_point3(p) };
        bounds = (bounds.0.min(p), bounds.1.max(p));
    }
    bounds
}
