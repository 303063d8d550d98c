//! Where rays start that leave a vertex, in scenes with solids that may lie in each other: at the vertex, with the
//! triangle left out that they leave, and with the stack of media as the judge of what lies nearer than rounding.
//!
//! Elsewhere a ray starts off its surface by the error of the point (`math::float`). Where the surfaces of two solids
//! cross or almost touch, that can be behind a boundary of the other one, which the ray then never meets: its path
//! believes to be in a solid that it has left, or the other way round. No choice of a point helps: on which side of a
//! plane a point lies that is within its rounding, every ray sees anew. So a ray is traced from a little *before* the
//! vertex on its own line, without the triangle that it leaves, and each hit around the vertex is judged:
//!
//! * A closed solid's boundary that lies farther from the vertex than rounding can move it: met if it is ahead, not met
//!   if it is behind.
//! * One that is nearer: the path knows on which side it is, for the stack says whether it is in that solid. So it
//!   meets the boundary if that takes it out of a solid that it is in or into one that it is not in, and else not,
//!   whatever the sign of the distance. Hits of a line on a closed surface go in and out by turns, so after the last of
//!   them the stack says what the line itself says of the place behind. Of the solid that the ray leaves only what lies
//!   ahead of the vertex counts: the triangle that is left out is met first.
//! * Surfaces that bound no closed solid have no side that is known. From a closed solid's boundary they are met if
//!   they are ahead of the surface, but not if they lie on its very triangle; from other surfaces, as everywhere, if
//!   they are ahead of the point off the surface: a wall's neighbouring triangles lie behind that.
//!
//! The vertex stays off its surface by its error and keeps off the edges of its triangle by some, else a line across
//! the outline of a solid may miss the triangle that it leaves and its neighbours alike. Both is less than what the
//! stack decides.
//!
//! Checked by `media::rays_know_their_media`, also 300 units from the origin, where rounding is 300 times as large: of
//! 2·10⁵ refracted rays there 11 pixels showed a wrong medium before, none does now. At 1000 units 9 do, all with the
//! eye inside. The one that was followed to its end grazes a corner of one solid within rounding of another's surface,
//! which would go with the square of rounding (some 10⁻¹⁰ of rays at the origin); that law has not been measured, and
//! none in 2·10⁵ at 300 units does not tell it from a linear one.
//!
//! Limits: solids that overlap themselves are in themselves more than once, which the rule for near boundaries does not
//! count. Directions within 1/256 of a near boundary's plane may have crossed it before they are traced. Surfaces that
//! bound no solid and are nearer than rounding to a boundary are taken by the sign of their distance.

use glam::Vec3;

use super::media;
use super::passing::Passing;
use super::start::{BACK, BLUR, Left, Start};
use super::vertices::Vertices;
use super::wave::Paths;
use super::world::World;
use crate::backend::batch::{Hit, LANES, RayBlock, RayHitBlock};
use crate::backend::past::Passed;
use crate::math::columns::{Lane3, get, set};
use crate::math::float::UNIT_ROUNDOFF;
use crate::math::lanes::lanes_of;
use crate::scene::geometry::{Geometry, NO_SOLID, corners};
use crate::shading::interaction::Interaction;
use crate::shading::medium::Media;

/// Hits this many times farther ahead are met without a look.
const FAR: f32 = 64.0;

/// Weight of a corner up to which a vertex may lie on the opposite edge.
const RIM: f32 = 1.0 / 16.0;

/// Errors by which a vertex keeps off the edges of its triangle.
const INSET: f32 = 4.0;

/// Of a ray in direction `dir` from the surface in lane `i`.
pub fn start(world: &World, vertices: &Vertices, rays: &RayHitBlock, (i, dir): (usize, Vec3)) -> Start {
    let (hit, error, n_g) = (rays.hit_unchecked(i), vertices.error[i], get(&vertices.n_g, i));
    let off = n_g * error.copysign(n_g.dot(dir));
    let p = inset(world.geometry, &hit, get(&vertices.p, i), error) + off;
    let within = Start::within(p, hit.t);
    let from = Some(Left { hit, solid: closed(world, &hit) });
    Start { back_m: within.back_m + BACK * error, blur_m: within.blur_m + BLUR * error, off, from, ..within }
}

/// What the ray in `passing` has passed before it is traced: what it leaves.
fn passed(start: &Start, passing: &mut Passing) -> Passed {
    start.from.map_or(Passed::NOTHING, |left| passing.past.add(Passed::NOTHING, &left.hit))
}

/// Whether a ray in direction `dir`, with these media around, meets what it hits.
#[inline(always)]
pub fn meets(start: &Start, world: &World, around: &Media, hit: &Hit, dir: Vec3) -> bool {
    hit.t - start.back_m > FAR * start.back_m || meets_near(start, world, around, hit, dir)
}

#[cold]
#[inline(never)]
fn meets_near(start: &Start, world: &World, around: &Media, hit: &Hit, dir: Vec3) -> bool {
    let at = Interaction::at(world.geometry, hit, false);
    let cos = at.n_g.dot(dir);
    let ahead_m = hit.t - start.back_m;
    // From the point to the plane, on the ray's way.
    let distance_m = ahead_m * cos.abs();
    let solid = closed(world, hit);
    if solid != NO_SOLID {
        if distance_m.abs() > start.blur_m + BLUR * at.error {
            return distance_m > 0.0;
        }
        let entering = cos < 0.0;
        let own = start.from.is_some_and(|left| left.solid == solid);
        return around.holds(solid) != entering && (!own || ahead_m >= 0.0);
    }
    match &start.from {
        Some(left) if left.solid != NO_SOLID => {
            distance_m + start.off.dot(at.n_g) * 1f32.copysign(cos) > 0.0 && !lies_on(world, &left.hit, hit)
        }
        _ => ahead_m > 0.0,
    }
}

/// Number of the closed solid that a hit lies on, or [`NO_SOLID`].
#[inline(always)]
fn closed(world: &World, hit: &Hit) -> u32 {
    let solid = media::solid_of(world, hit);
    world.geometry.solids.list().get(solid as usize).filter(|solid| solid.closed).map_or(NO_SOLID, |_| solid)
}

/// Whether two triangles lie on one another.
fn lies_on(world: &World, a: &Hit, b: &Hit) -> bool {
    let geometry = world.geometry;
    let record = |hit: &Hit| geometry.meshes[hit.geom as usize].first_triangle + hit.prim;
    let partners = world.features.coincident && a.inst == b.inst && geometry.coincident.has(record(a));
    partners && geometry.coincident.of(record(a)).all.contains(&record(b))
}

/// A point of a triangle that is not on its rim: `p`, or moved towards the middle where it might be.
#[inline(always)]
fn inset(geometry: &Geometry, hit: &Hit, p: Vec3, error: f32) -> Vec3 {
    let least = hit.u.min(hit.v).min(1.0 - hit.u - hit.v);
    if least > RIM { p } else { inwards(geometry, hit, p, error) }
}

#[cold]
#[inline(never)]
fn inwards(geometry: &Geometry, hit: &Hit, p: Vec3, error: f32) -> Vec3 {
    let moved = geometry.moving.at(hit.inst, hit.time);
    let placement = moved.as_ref().or_else(|| geometry.instances.get(hit.inst as usize));
    let [a, b, c] = corners(&geometry.triangle_at(hit.geom, hit.prim, hit.time)).map(|corner| {
        let corner = corner.as_vec3();
        placement.map_or(corner, |placement| placement.world_from_object.transform_point3(corner))
    });
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    let height = (b - a).cross(c - a).length() / longest;
    // Weights that are less than this become so.
    let wanted = (INSET * (error + UNIT_ROUNDOFF * p.abs().max_element()) / height).min(RIM);
    let least = hit.u.min(hit.v).min(1.0 - hit.u - hit.v);
    if least < wanted { p + ((a + b + c) / 3.0 - p) * ((wanted - least) / (1.0 / 3.0 - least)) } else { p }
}

/// Before paths that left vertices are traced: moves them back, and notes what they leave.
pub fn set_out(starts: &[Start], media: &mut [Media], paths: &mut Paths, passing: &mut Passing) {
    passing.clear(paths.len);
    for lane in 0..paths.len {
        let (block, i) = (lane / LANES, lane % LANES);
        let slot = paths.paths[block].slot[i] as usize;
        let start = &starts[slot];
        start.set_back(&mut paths.rays[block].ray, i);
        media[slot].since_m = start.back_m;
        let passed = passed(start, passing);
        passing.past.set(lane, passed);
        passing.first.push(passed);
    }
}

/// Once those paths are traced: distances count from the vertices again.
pub fn count_from_vertices(starts: &[Start], media: &mut [Media], paths: &mut Paths, collisions: &mut [f32]) {
    for lane in 0..paths.len {
        let (block, i) = (lane / LANES, lane % LANES);
        let slot = paths.paths[block].slot[i] as usize;
        let Start { p, back_m, .. } = starts[slot];
        let ray = &mut paths.rays[block].ray;
        (ray.org_x[i], ray.org_y[i], ray.org_z[i]) = (p.x, p.y, p.z);
        ray.tfar[i] = (ray.tfar[i] - back_m).max(0.0);
        media[slot].since_m -= back_m;
        if let Some(distance_m) = collisions.get_mut(lane) {
            *distance_m -= back_m;
        }
    }
}

/// The same for a shadow ray, which is not moved forth again.
pub fn set_out_shadow(
    start: &Start,
    around: &mut Media,
    ray: &mut RayBlock,
    i: usize,
    passing: &mut Passing,
) -> Passed {
    start.set_back(ray, i);
    around.since_m = start.back_m;
    passed(start, passing)
}

/// Where paths start that go on in direction `dir` from the lanes of `keep`, by camera sample.
#[inline(never)]
pub fn depart(
    world: &World,
    vertices: &Vertices,
    rays: &RayHitBlock,
    (slots, keep): (&[u32; LANES], u16),
    (org, dir): (&mut Lane3, &Lane3),
    starts: &mut [Start],
) {
    for i in lanes_of(keep) {
        let start = start(world, vertices, rays, (i, get(dir, i)));
        set(org, i, start.p);
        starts[slots[i] as usize] = start;
    }
}
