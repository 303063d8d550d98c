//! Which triangles of the world mesh are faces, and what bodies the rest of the scene consists of.
//!
//! Triangles hang together when they share a vertex, by index or by position. Connected faces stay together: the two
//! tests of triangles may disagree about a ray by an edge that both own, and it would slip through. Of the groups that
//! are small enough those become faces which rays meet often for their number: the chance that a line through the scene
//! meets a convex body is the ratio of their surfaces.

use std::collections::HashMap;

use glam::Vec3;

use crate::backend::bounds::{self, Bounds};
use crate::backend::flat::{self, Triangle};
use crate::scene::geometry::{Geometry, TriangleMesh};

/// Bounds of the search, set by `backend::select`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Faces at most.
    pub faces: usize,
    /// Cost of a face, over that of a ray in one hierarchy of everything.
    pub face_cost: f32,
    /// Volumes around the rest at most.
    pub volumes: usize,
    /// Corners at most, of all groups that are small enough for faces.
    pub corners: usize,
    /// Bodies of the rest at most.
    pub bodies: usize,
}

/// Something that is left to the hierarchy. All of it lies in its box, and within `radius` of the box's centre.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body {
    pub bounds: Bounds,
    /// Metres.
    pub radius: f32,
}

/// A scene in two parts.
pub(super) struct Parts {
    /// Triangles of the world mesh.
    pub faces: Vec<Triangle>,
    /// What the rest of the world mesh and the instances consist of.
    pub bodies: Vec<Body>,
    groups: Groups,
    /// Whether a group is one of the faces.
    is_face: Vec<bool>,
}

impl Parts {
    /// `None` where no triangles are worth it, or the scene has too many small things in it.
    pub fn of(geometry: &Geometry, limits: &Limits) -> Option<Self> {
        let mesh = geometry.meshes.first()?;
        if geometry.instances.len() > limits.bodies {
            return None;
        }
        let scene = Bounds { lo: geometry.bounds.0, hi: geometry.bounds.1 };
        let mut groups = Groups::of_indices(mesh);
        groups.join_small(mesh, limits)?;
        let is_face = groups.choose(mesh, scene.half_area(), limits);
        let chosen = groups.triangles(mesh).filter(|(_, group, _)| is_face[*group as usize]);
        let faces: Vec<_> = chosen.map(|(prim, _, v)| Triangle { prim, v }).collect();
        if faces.is_empty() || !flat::in_range(faces.iter().copied()) {
            return None;
        }
        let mut bodies = groups.bodies(mesh, &is_face);
        bodies.extend(instances(geometry));
        (bodies.len() <= limits.bodies).then_some(Parts { faces, bodies, groups, is_face })
    }

    /// Whether a triangle of the world mesh belongs to a face.
    pub fn is_face(&self, prim: u32) -> bool {
        let group = self.groups.of_triangle[prim as usize];
        group != NONE && self.is_face[group as usize]
    }

    /// The world mesh without the faces, whose triangles lose their corners; all keep their numbers.
    pub fn rest(&self, mesh: &TriangleMesh) -> TriangleMesh {
        // A triangle that is not finite is left out by the backend of the mesh.
        let nowhere = mesh.vertices.len() as u32;
        let vertices = mesh.vertices.iter().copied().chain([Vec3::NAN]).collect();
        let is_rest = |group: u32| group != NONE && !self.is_face[group as usize];
        let all = self.groups.of_triangle.iter().zip(&mesh.indices);
        let indices = all.map(|(&group, &triangle)| if is_rest(group) { triangle } else { [nowhere; 3] }).collect();
        TriangleMesh { vertices, indices, first_triangle: mesh.first_triangle, later: Vec::new() }
    }
}

/// The triangles that can be traced, in groups that hang together.
struct Groups {
    /// Group of each triangle; [`NONE`] of those that cannot be traced.
    of_triangle: Vec<u32>,
    /// Triangles of each group.
    count: Vec<u32>,
}

const NONE: u32 = u32::MAX;

impl Groups {
    /// By the indices of vertices.
    fn of_indices(mesh: &TriangleMesh) -> Self {
        let mut sets = Sets::new(mesh.vertices.len());
        let mut of_triangle = vec![NONE; mesh.indices.len()];
        for (prim, _) in mesh.traced() {
            let [a, b, c] = mesh.indices[prim as usize];
            sets.join(a, b);
            sets.join(b, c);
            of_triangle[prim as usize] = a;
        }
        // A vertex of each becomes the number of its group.
        let (mut number, mut count) = (vec![NONE; mesh.vertices.len()], Vec::new());
        for group in of_triangle.iter_mut().filter(|vertex| **vertex != NONE) {
            let numbered = &mut number[sets.find(*group) as usize];
            if *numbered == NONE {
                *numbered = count.len() as u32;
                count.push(0);
            }
            *group = *numbered;
            count[*group as usize] += 1;
        }
        Groups { of_triangle, count }
    }

    /// The triangles of groups, with their corners.
    fn triangles(&self, mesh: &TriangleMesh) -> impl Iterator<Item = (u32, u32, [Vec3; 3])> {
        let corners = |prim: usize| mesh.indices[prim].map(|i| mesh.vertices[i as usize]);
        let traced = (0u32..).zip(&self.of_triangle).filter(|(_, group)| **group != NONE);
        traced.map(move |(prim, &group)| (prim, group, corners(prim as usize)))
    }

    fn is_small(&self, group: u32, limits: &Limits) -> bool {
        self.count[group as usize] as usize <= 2 * limits.faces
    }

    /// Joins groups of few triangles that share a position. `None` if there are too many of them.
    fn join_small(&mut self, mesh: &TriangleMesh, limits: &Limits) -> Option<()> {
        let mut sets = Sets::new(self.count.len());
        let mut owners = HashMap::new();
        for (_, group, corners) in self.triangles(mesh).filter(|(_, group, _)| self.is_small(*group, limits)) {
            for corner in corners {
                sets.join(*owners.entry(position(corner)).or_insert(group), group);
            }
            if owners.len() > limits.corners {
                return None;
            }
        }
        let mut count = vec![0; self.count.len()];
        for group in self.of_triangle.iter_mut().filter(|group| **group != NONE) {
            *group = sets.find(*group);
            count[*group as usize] += 1;
        }
        self.count = count;
        Some(())
    }

    /// Which groups become faces; `scene` is half the surface of its box, m².
    fn choose(&self, mesh: &TriangleMesh, scene: f32, limits: &Limits) -> Vec<bool> {
        let mut boxes = vec![Bounds::EMPTY; self.count.len()];
        for (_, group, corners) in self.triangles(mesh) {
            boxes[group as usize] = boxes[group as usize].union(Bounds::of(&corners));
        }
        // Pairs of triangles are taken for parallelograms here.
        let faces = |group: u32| self.count[group as usize].div_ceil(2);
        let met = |group: u32| boxes[group as usize].half_area() / scene / faces(group) as f32;
        let is_small = |group: u32| self.is_small(group, limits);
        let all = (0..self.count.len() as u32).filter(|&group| self.count[group as usize] > 0 && is_small(group));
        let mut worth: Vec<u32> = all.filter(|&group| met(group) >= limits.face_cost / 2.0).collect();
        worth.sort_by(|&a, &b| met(b).total_cmp(&met(a)).then(a.cmp(&b)));
        let (mut left, mut is_face) = (limits.faces as u32, vec![false; self.count.len()]);
        for group in worth {
            if faces(group) <= left {
                left -= faces(group);
                is_face[group as usize] = true;
            }
        }
        // None that touches a larger one.
        let mut corners: Vec<_> = (self.triangles(mesh).filter(|(_, group, _)| is_face[*group as usize]))
            .flat_map(|(_, group, corners)| corners.map(|corner| (position(corner), group)))
            .collect();
        corners.sort_unstable();
        let large = self.triangles(mesh).filter(|(_, group, _)| !is_small(*group));
        for corner in large.flat_map(|(_, _, corners)| corners) {
            if let Ok(at) = corners.binary_search_by_key(&position(corner), |(at, _)| *at) {
                is_face[corners[at].1 as usize] = false;
            }
        }
        is_face
    }

    /// What the groups that are no faces occupy.
    fn bodies(&self, mesh: &TriangleMesh, is_face: &[bool]) -> Vec<Body> {
        let mut bodies = vec![Body::NOTHING; self.count.len()];
        let triangles = || self.triangles(mesh).filter(|(_, group, _)| !is_face[*group as usize]);
        for (_, group, corners) in triangles() {
            let bounds = &mut bodies[group as usize].bounds;
            *bounds = bounds.union(Bounds::of(&corners));
        }
        for (_, group, corners) in triangles() {
            let body = &mut bodies[group as usize];
            body.radius = body.radius.max(reach(body.bounds.center(), &corners));
        }
        bodies.retain(|body| !body.bounds.is_empty());
        bodies
    }
}

impl Body {
    const NOTHING: Body = Body { bounds: Bounds::EMPTY, radius: 0.0 };

    /// What a mesh occupies in its own space.
    fn of_mesh(mesh: &TriangleMesh) -> Self {
        let corners = || {
            let changing = (!mesh.later.is_empty()).then(|| mesh.traced_moving()).into_iter().flatten();
            mesh.traced().map(|(_, corners)| corners).chain(changing.flat_map(|(_, shapes)| shapes))
        };
        let bounds = corners().fold(Bounds::EMPTY, |all, corners| all.union(Bounds::of(&corners)));
        let radius = corners().map(|corners| reach(bounds.center(), &corners)).fold(0.0, f32::max);
        Body { bounds, radius }
    }
}

/// Largest distance of points from `center`, metres, rounded up. In f64, where no square is lost.
fn reach(center: Vec3, points: &[Vec3]) -> f32 {
    let center = center.as_dvec3();
    (points.iter().map(|p| p.as_dvec3().distance(center)).fold(0.0, f64::max) as f32).next_up()
}

/// What instances occupy, without those of empty meshes.
fn instances(geometry: &Geometry) -> impl Iterator<Item = Body> {
    let scene = Bounds { lo: geometry.bounds.0, hi: geometry.bounds.1 };
    let mut meshes = vec![None; geometry.meshes.len()];
    for placement in &geometry.instances {
        if let Some(mesh) = geometry.meshes.get(placement.mesh as usize) {
            meshes[placement.mesh as usize].get_or_insert_with(|| Body::of_mesh(mesh));
        }
    }
    geometry.instances.iter().enumerate().filter_map(move |(i, placement)| {
        let mesh = meshes.get(placement.mesh as usize).copied()??;
        if mesh.bounds.is_empty() {
            return None;
        }
        let bounds = bounds::of_instance(geometry, i, mesh.bounds, bounds::reach_of(scene));
        let around = 0.5 * (bounds.hi - bounds.lo).length();
        if !geometry.moving.steps(i as u32).is_empty() {
            return Some(Body { bounds, radius: around });
        }
        let rounding = bounds::rounding_of(placement, bounds::reach_of(scene));
        let ball = bounds::stretch(&placement.world_from_object) * f64::from(mesh.radius) + rounding.length();
        Some(Body { bounds, radius: around.min((ball as f32).next_up()) })
    })
}

/// The bits of a position; −0.0 is 0.0.
fn position(p: Vec3) -> [u32; 3] {
    (p + Vec3::ZERO).to_array().map(f32::to_bits)
}

/// Sets of numbers that are joined (Galler and Fischer 1964), paths halved.
struct Sets {
    parent: Vec<u32>,
}

impl Sets {
    fn new(len: usize) -> Self {
        Sets { parent: (0..len as u32).collect() }
    }

    fn find(&mut self, mut i: u32) -> u32 {
        while self.parent[i as usize] != i {
            let above = self.parent[self.parent[i as usize] as usize];
            self.parent[i as usize] = above;
            i = above;
        }
        i
    }

    /// The lower number represents both.
    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.find(a), self.find(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }
}
