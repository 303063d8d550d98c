//! Rays walk through lazy hierarchies of a scene, one over each mesh and one over the instances, and what they visit is
//! counted: nearest child first, the world before the instances, as `backend::obvhs` does it.
//!
//! Limit: the boxes are not grown, so a ray may slip between triangles that it meets exactly at an edge: that is no
//! matter for a count.

use glam::Vec3;
use serde::Serialize;

use super::lazy::{Item, Lazy};
use crate::backend::bounds::{self, Bounds};
use crate::backend::triangle::{Ray, RayShear, TriangleHit};
use crate::scene::geometry::{Geometry, TriangleMesh};

/// Triangles of a leaf.
const LEAF_SIZE: usize = 4;

/// Triangles of a run, and of meshes that are made of runs: counting should be felt nowhere.
const RUN: usize = 16;
const MESH_OF_RUNS: usize = 1 << 13;

/// What some rays have visited.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Visits {
    /// Nodes of eight boxes.
    pub nodes: u64,
    /// Leaves of up to four triangles.
    pub leaves: u64,
    /// Instances that were entered.
    pub instances: u64,
}

/// What a ray has met.
#[derive(Clone, Copy, Debug)]
pub(super) struct Met {
    pub hit: TriangleHit,
    /// Number of the instance, if it is one's.
    pub instance: Option<u32>,
    /// Triangle of the mesh.
    pub prim: u32,
}

/// A ray and when it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Timed {
    pub ray: Ray,
    /// Fraction of the shutter.
    pub time: f32,
    /// Whether any hit will do.
    pub any: bool,
}

/// The hierarchies of a scene.
pub(super) struct Walk<'g> {
    geometry: &'g Geometry,
    world: Lazy,
    top: Lazy,
    /// Those of instanced meshes that a ray has entered.
    meshes: Vec<Option<Lazy>>,
}

impl<'g> Walk<'g> {
    /// Over the triangles of the world mesh that are wanted, and all instances.
    pub fn new(geometry: &'g Geometry, wanted: impl Fn(u32) -> bool) -> Self {
        let scene = Bounds { lo: geometry.bounds.0, hi: geometry.bounds.1 };
        let world = Lazy::new(items(geometry, 0, &wanted), LEAF_SIZE);
        let mut boxes: Vec<Option<Bounds>> = vec![None; geometry.meshes.len()];
        let mut instances = Vec::with_capacity(geometry.instances.len());
        for (i, placement) in geometry.instances.iter().enumerate() {
            let Some(known) = boxes.get_mut(placement.mesh as usize) else { continue };
            let all = || items(geometry, placement.mesh, &|_| true);
            let mesh = *known
                .get_or_insert_with(|| all().iter().fold(Bounds::EMPTY, |bounds, item| bounds.union(item.bounds)));
            if !mesh.is_empty() {
                let bounds = bounds::of_instance(geometry, i, mesh, bounds::reach_of(scene));
                instances.push(Item { bounds, number: i as u32, count: 1 });
            }
        }
        let meshes = geometry.meshes.iter().map(|_| None).collect();
        Walk { geometry, world, top: Lazy::new(instances, 1), meshes }
    }

    /// The closest hit of a ray, or any; what it visits is added to `visits`.
    pub fn trace(&mut self, timed: &Timed, visits: &mut Visits) -> Option<Met> {
        let Walk { geometry, world, top, meshes } = self;
        let mut ray = timed.ray;
        let mut met = in_mesh(world, geometry, 0, &mut ray, timed.any, visits).map(|(prim, hit)| Met {
            hit,
            instance: None,
            prim,
        });
        if top.is_empty() || (timed.any && met.is_some()) {
            return met;
        }
        let mut entered = Visits::default();
        visit(top, &|_| None, &mut ray, visits, &mut |item, ray, visits| {
            visits.leaves -= 1;
            entered.instances += 1;
            let moved = geometry.moving.at(item[0].number, timed.time);
            let placement = moved.as_ref().unwrap_or(&geometry.instances[item[0].number as usize]);
            let Some(mut inner) = ray.to_object(placement) else { return false };
            let mesh = &mut meshes[placement.mesh as usize];
            let mesh = mesh.get_or_insert_with(|| Lazy::new(items(geometry, placement.mesh, &|_| true), LEAF_SIZE));
            if let Some((prim, hit)) = in_mesh(mesh, geometry, placement.mesh, &mut inner, timed.any, visits) {
                met = Some(Met { hit, instance: Some(item[0].number), prim });
                ray.tfar = hit.t;
            }
            timed.any && met.is_some()
        });
        visits.instances += entered.instances;
        met
    }
}

/// A triangle; `None` where it is not finite.
fn single(mesh: &TriangleMesh, number: u32) -> Option<Item> {
    let [a, b, c] = mesh.indices[number as usize].map(|i| mesh.vertices.get(i as usize).copied().unwrap_or(Vec3::NAN));
    (a + b + c).is_finite().then(|| Item { bounds: Bounds::of(&[a, b, c]), number, count: 1 })
}

/// The wanted triangles of a mesh. In large ones, those that follow each other are one run if they lie side by side:
/// their common box has no more surface than all of theirs together.
fn items(geometry: &Geometry, mesh: u32, wanted: &dyn Fn(u32) -> bool) -> Vec<Item> {
    let Some(mesh) = geometry.meshes.get(mesh as usize) else { return Vec::new() };
    let run = if mesh.indices.len() > MESH_OF_RUNS { RUN } else { 1 };
    let mut items = Vec::with_capacity(mesh.indices.len() / run);
    let mut singles = Vec::with_capacity(run);
    for first in (0..mesh.indices.len()).step_by(run) {
        let all = first as u32..mesh.indices.len().min(first + run) as u32;
        singles.clear();
        singles.extend(all.clone().filter(|&number| wanted(number)).filter_map(|number| single(mesh, number)));
        let bounds = singles.iter().fold(Bounds::EMPTY, |bounds, item| bounds.union(item.bounds));
        let surfaces: f32 = singles.iter().map(|item| item.bounds.half_area()).sum();
        if run > 1 && singles.len() == all.len() && bounds.half_area() <= surfaces {
            items.push(Item { bounds, number: all.start, count: all.len() as u32 });
        } else {
            items.append(&mut singles);
        }
    }
    items
}

/// What a ray meets in a mesh; its end comes to the hit.
fn in_mesh(
    tree: &mut Lazy,
    geometry: &Geometry,
    mesh: u32,
    ray: &mut Ray,
    any: bool,
    visits: &mut Visits,
) -> Option<(u32, TriangleHit)> {
    let mesh = geometry.meshes.get(mesh as usize)?;
    let shear = RayShear::new(ray);
    let mut met = None;
    visit(tree, &|number| single(mesh, number), ray, visits, &mut |items, ray, _| {
        for number in items.iter().flat_map(|item| item.number..item.number + item.count) {
            let corners = mesh.indices[number as usize].map(|i| mesh.vertices[i as usize]);
            if let Some(hit) = shear.intersect(&corners, ray.tnear, ray.tfar) {
                ray.tfar = hit.t;
                met = Some((number, hit));
            }
        }
        any && met.is_some()
    });
    met
}

/// Goes through a hierarchy, nearest first. `leaf` says whether that was all.
fn visit(
    tree: &mut Lazy,
    single: &dyn Fn(u32) -> Option<Item>,
    ray: &mut Ray,
    visits: &mut Visits,
    leaf: &mut dyn FnMut(&[Item], &mut Ray, &mut Visits) -> bool,
) {
    if tree.is_empty() {
        return;
    }
    let over = Vec3::from_array(ray.dir.to_array().map(|d| 1.0 / if d == 0.0 { f32::MIN_POSITIVE } else { d }));
    let enters = |bounds: Bounds, ray: &Ray| {
        let (a, b) = ((bounds.lo - ray.org) * over, (bounds.hi - ray.org) * over);
        let near = a.min(b).max_element().max(ray.tnear);
        (near <= a.max(b).min_element().min(ray.tfar)).then_some(near)
    };
    let mut stack: Vec<(f32, usize)> = vec![(f32::NEG_INFINITY, 0)];
    while let Some((near, at)) = stack.pop() {
        if near > ray.tfar {
            continue;
        }
        if let Some(items) = tree.leaf(at) {
            visits.leaves += 1;
            if leaf(items, ray, visits) {
                return;
            }
            continue;
        }
        visits.nodes += 1;
        let below = stack.len();
        for child in tree.open(at, single) {
            if let Some(near) = enters(tree.bounds_of(child), ray) {
                stack.push((near, child));
            }
        }
        stack[below..].sort_by(|a, b| b.0.total_cmp(&a.0));
    }
}
