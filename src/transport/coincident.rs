//! Triangles that lie on one another ([`Coincident`](crate::scene::geometry::Coincident)): which of them a ray meets.
//!
//! Of those that a ray has not passed, it meets one that fronts it; of several such, one that bounds no solid, then the
//! one of the inner solid, then the first in the order of the geometry. The boundary of another solid at the same place
//! is crossed with it: wine that touches its glass is one boundary between wine and glass. Decided here, after the
//! backend has said where the ray ends, so that the answer is every backend's.

use glam::{DVec3, Vec3};

use super::media;
use super::wave::{Paths, Wave};
use super::world::World;
use crate::backend::batch::{Hit, INVALID_ID, LANES, RayHitBlock};
use crate::math::lanes::lanes_of;
use crate::scene::geometry::{NO_SOLID, Partners, corners};
use crate::shading::medium::Boundary;

/// Least weight of a corner, at which a point still counts as inside: twice what f32 weights are rounded by.
const INSIDE: f64 = -2.4e-7;

/// Cosine up to which normals of one plane may disagree about the side that a ray comes from: more than √3/256, by
/// which those of partners differ at most.
const GRAZING: f32 = 1.0 / 128.0;

/// What a ray meets at one place.
#[derive(Clone, Copy, Debug)]
pub struct Met {
    /// The surface that counts.
    pub hit: Hit,
    /// The boundary of another solid at the same place.
    pub touching: Option<(Hit, Boundary)>,
}

/// A triangle at that place, and what the rule asks of it.
#[derive(Clone, Copy)]
struct Face {
    hit: Hit,
    fronts: bool,
    solid: u32,
}

impl Face {
    fn new(world: &World, hit: Hit, dir: DVec3) -> Face {
        let n = Vec3::from(world.geometry.triangle_at(hit.geom, hit.prim, hit.time).n_g).as_dvec3();
        Face { hit, fronts: n.dot(dir) < 0.0, solid: media::solid_of(world, &hit) }
    }

    /// Descending: the first is met.
    fn order(&self) -> (bool, bool, u32, std::cmp::Reverse<u32>) {
        (self.fronts, self.solid == NO_SOLID, self.solid, std::cmp::Reverse(self.hit.prim))
    }
}

/// What a ray of direction `dir` meets that the backend says hits `hit`. `is_passed` says which triangles do not count.
#[inline(always)]
pub fn settle(world: &World, hit: Hit, dir: Vec3, is_passed: impl Fn(&Hit) -> bool) -> Met {
    let geometry = world.geometry;
    let record = geometry.meshes[hit.geom as usize].first_triangle + hit.prim;
    let alone = || {
        let front = || Vec3::from(geometry.triangles[record as usize].n_g).dot(dir) < -GRAZING * dir.length();
        !touches(world) && hit.inst == INVALID_ID && !geometry.coincident.is_contested(record) && front()
    };
    if !geometry.coincident.has(record) || alone() {
        return Met { hit, touching: None };
    }
    choose(world, hit, dir, geometry.coincident.of(record), &is_passed)
}

/// Whether it matters which boundaries are crossed along.
#[inline(always)]
fn touches(world: &World) -> bool {
    let features = &world.features;
    features.media | features.alpha | features.boundaries
}

#[cold]
#[inline(never)]
fn choose(world: &World, hit: Hit, dir: Vec3, partners: Partners, is_passed: &dyn Fn(&Hit) -> bool) -> Met {
    let geometry = world.geometry;
    let first = geometry.meshes[hit.geom as usize].first_triangle;
    // To the space of the mesh, where the triangles are.
    let moved = geometry.moving.at(hit.inst, hit.time);
    let placement = moved.as_ref().or_else(|| geometry.instances.get(hit.inst as usize));
    let dir = placement.map_or(dir, |placement| placement.object_from_world.transform_vector3(dir)).as_dvec3();
    let own_corners = geometry.triangle_at(hit.geom, hit.prim, hit.time);
    let [a, b, c] = corners(&own_corners);
    let (u, v) = (f64::from(hit.u), f64::from(hit.v));
    let p = a * (1.0 - u - v) + b * u + c * v;

    let at = |record: u32| Face::new(world, Hit { prim: record - first, ..hit }, dir);
    // Whether the ray meets that triangle as well, and where.
    let placed = |face: Face, record: u32| {
        let (u, v) = weights(p, corners(&geometry.triangle_at(hit.geom, record - first, hit.time)))?;
        let hit = Hit { u, v, ..face.hit };
        (!is_passed(&hit)).then_some(Face { hit, ..face })
    };
    // A floor has many partners, few of them here: where one lies is asked last.
    let own = Face::new(world, hit, dir);
    // Where it is certain that partners face the ray as their group does.
    let cos = Vec3::from(own_corners.n_g).as_dvec3().dot(dir);
    let rivals = match cos.abs() < f64::from(GRAZING) * dir.length() {
        true => partners.all,
        false if own.fronts => partners.before,
        false => partners.behind,
    };
    let met = rivals.iter().fold(own, |met, &record| {
        let face = at(record);
        if face.order() > met.order() { placed(face, record).unwrap_or(met) } else { met }
    });
    if !touches(world) {
        return Met { hit: met.hit, touching: None };
    }
    let solid = |face: &Face| face.solid != NO_SOLID && face.solid != met.solid;
    let others = partners.all.iter().map(|&record| (at(record), record)).filter(|(face, _)| solid(face));
    let others = others.filter_map(|(face, record)| placed(face, record)).chain([own].into_iter().filter(solid));
    let touching = others.max_by_key(Face::order);
    let touching = touching.map(|other| (other.hit, Boundary { solid: other.solid, entering: other.fronts }));
    Met { hit: met.hit, touching }
}

/// Weights of the second and third corner of a triangle at the point of its plane below `p`; `None` outside.
fn weights(p: DVec3, [a, b, c]: [DVec3; 3]) -> Option<(f32, f32)> {
    let n = (b - a).cross(c - a);
    let n2 = n.length_squared();
    let u = (p - a).cross(c - a).dot(n) / n2;
    let v = (b - a).cross(p - a).dot(n) / n2;
    let inside = u >= INSIDE && v >= INSIDE && 1.0 - u - v >= INSIDE;
    inside.then(|| (u.clamp(0.0, 1.0) as f32, v.clamp(0.0, 1.0 - u.clamp(0.0, 1.0)) as f32))
}

/// After closest hits of rays that go on past nothing: what they meet.
pub fn settle_all(world: &World, rays: &mut [RayHitBlock], len: usize) {
    for block in 0..len.div_ceil(LANES) {
        for i in lanes_of(in_question(world, &rays[block], len - block * LANES)) {
            settle_lane(world, &mut rays[block], i);
        }
    }
}

/// After closest hits of paths: what they meet, and what they cross there where they keep media.
pub fn settle_paths(world: &World, wave: &mut Wave) {
    let Wave { current: Paths { rays, paths, len }, touching, .. } = wave;
    if !world.features.media {
        return settle_all(world, rays, *len);
    }
    for block in 0..len.div_ceil(LANES) {
        let lanes = in_question(world, &rays[block], *len - block * LANES);
        for i in 0..(*len - block * LANES).min(LANES) {
            let here = if lanes >> i & 1 == 1 { settle_lane(world, &mut rays[block], i) } else { None };
            touching[paths[block].slot[i] as usize] = here;
        }
    }
}

/// Lanes of a block, of the first `len`, that hit triangles which lie on others.
#[inline(always)]
fn in_question(world: &World, rays: &RayHitBlock, len: usize) -> u16 {
    let geometry = world.geometry;
    let mut lanes = 0;
    for i in 0..len.min(LANES) {
        let geom = rays.hit.geom[i];
        if geom != INVALID_ID {
            let record = geometry.meshes[geom as usize].first_triangle + rays.hit.prim[i];
            lanes |= u16::from(geometry.coincident.has(record)) << i;
        }
    }
    lanes
}

fn settle_lane(world: &World, rays: &mut RayHitBlock, i: usize) -> Option<Boundary> {
    let met = settle(world, rays.hit_unchecked(i), rays.ray.dir(i), |_| false);
    rays.set_hit(i, &met.hit);
    met.touching.map(|(_, boundary)| boundary)
}
