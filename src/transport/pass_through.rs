//! Surfaces that rays go straight through: where alpha cuts them out, or by chance under blending, backs that are
//! hidden, and boundaries that change nothing but the medium.
//!
//! Two stages, run only where the plan has such surfaces. After closest hits: lanes whose hit is passed start again
//! behind it, packed, until none is left; what they meet in the end is written to their lane as if it had been met at
//! once, so that the path has as many edges as before, and the origin of its edge (which emission MIS asks for) is
//! unchanged. Instead of any hits: shadow rays go from hit to hit and keep the fraction that each surface and medium
//! lets pass, without random numbers.
//!
//! A ray that goes on keeps origin, direction and end, and leaves out the triangles that it has passed by their
//! numbers ([`Past`](crate::backend::past::Past)), so that it meets nothing twice and skips nothing, however close
//! surfaces lie.
//! Triangles that meet at an edge or a corner are one surface there: a ray that hits both has passed one. Source: glTF
//! 2.0 §3.9.4 (see [`AlphaMode`]).

use glam::Vec3;

use super::coincident::{self, Met};
use super::counters::Counters;
use super::departure;
use super::job::Job;
use super::material::{self, Place};
use super::media::{self, Boundaries, Straight, Stretch};
use super::passing::{Passing, Pending};
use super::start::Start;
use super::volume;
use super::wave::{Paths, Wave};
use super::world::World;
use crate::backend::Coherence;
use crate::backend::batch::{BLOCKED, Hit, INVALID_ID, LANES, RayHitBlock};
use crate::backend::past::{Passed, Past};
use crate::math::columns::{get, set};
use crate::sampler::{Scheme, dims};
use crate::scene::AlphaMode;
use crate::scene::geometry::NO_SOLID;
use crate::shading::interaction::Interaction;
use crate::shading::medium::Media;

/// Traces all rays of `passing` past what they have passed; returns how many.
fn trace(job: &Job, passing: &mut Passing, counters: &mut Counters) -> u64 {
    let len = passing.pending.len();
    let blocks = &mut passing.rays[..len.div_ceil(LANES)];
    counters.invalid_rays += job.backend.closest_hit_past(blocks, len, &passing.past);
    len as u64
}

/// A surface on the way of a ray and the probability that it is there; `None` where it surely is. Where backs are
/// hidden to the ray, those of one-sided surfaces are not there.
#[inline(always)]
fn sheer(world: &World, hit: &Hit, dir: Vec3, hides_backs: bool) -> Option<(Interaction, f32)> {
    if hides_backs && let Some(at) = hidden_back(world, hit, dir) {
        return Some((at, 0.0));
    }
    let material = world.geometry.triangle(hit.geom, hit.prim).material;
    if world.alpha.mode(material) == AlphaMode::Opaque {
        return None;
    }
    let at = Interaction::at(world.geometry, hit, false);
    let coverage = material::coverage(world, material, Place::of(&at));
    (coverage < 1.0).then_some((at, coverage))
}

/// The back of a one-sided surface.
#[inline(never)]
fn hidden_back(world: &World, hit: &Hit, dir: Vec3) -> Option<Interaction> {
    let at = Interaction::at(world.geometry, hit, false);
    (at.n_g.dot(dir) > 0.0 && world.scene.materials[at.material as usize].is_one_sided()).then_some(at)
}

/// What becomes of a ray at a hit.
enum Way {
    /// It meets a surface.
    Ends(Hit),
    /// It passes one, which lies there, and another one at the same place.
    Goes(Hit, Interaction, Option<Hit>),
    /// It starts behind one, though it seems to hit it.
    Skips(Hit, Interaction),
    /// It does not get there.
    Collides,
}

/// A ray at a hit.
struct AtHit<'r> {
    lane: usize,
    /// Its origin.
    org: Vec3,
    /// Its direction.
    dir: Vec3,
    hit: Hit,
    /// Surfaces passed before.
    surfaces: u32,
    /// Triangles passed before.
    past: (&'r Past, Passed),
}

impl AtHit<'_> {
    /// What the ray meets there.
    #[inline(always)]
    fn settled(&self, world: &World) -> Met {
        let (past, passed) = self.past;
        if world.features.coincident {
            coincident::settle(world, self.hit, self.dir, |hit| past.holds(passed, hit))
        } else {
            Met { hit: self.hit, touching: None }
        }
    }
}

/// The boundaries of what a ray meets, and how it goes straight on through them, if it does.
#[inline(always)]
fn through(world: &World, around: &Media, met: &Met, dir: Vec3) -> Option<(Interaction, Boundaries, Straight)> {
    if media::solid_of(world, &met.hit) == NO_SOLID {
        return None;
    }
    let at = Interaction::at(world.geometry, &met.hit, false);
    let own = media::boundary(world, &met.hit, at.n_g.dot(dir) < 0.0);
    let boundaries = [own, met.touching.map(|(_, boundary)| boundary)];
    let straight = media::straight(world, around, boundaries, at.material)?;
    Some((at, boundaries, straight))
}

/// After closest hits: `wave.current` as if surfaces that rays pass were not there. `edge` counts the edges of the path
/// up to here. Returns the rays that were traced.
#[inline(always)]
pub fn closest<S: Scheme>(job: &Job, wave: &mut Wave, edge: u32, counters: &mut Counters) -> u64 {
    let Wave { current, passing, media, starts, touching, collisions, .. } = wave;
    let Paths { rays, paths, len } = current;
    let world = &job.world;
    let features = world.features;
    if features.scattering {
        collisions.clear();
        collisions.resize(*len, f32::INFINITY);
    }
    let started = features.exact_starts && edge > 1;
    let hides_backs = features.hides_backs(edge);
    if !started {
        passing.clear(*len);
    }
    let decide = |ray: &AtHit| {
        let (block, i) = (&mut paths[ray.lane / LANES], ray.lane % LANES);
        let mut met = ray.settled(world);
        if started {
            let slot = block.slot[i] as usize;
            if !judge(world, &starts[slot], &media[slot], &mut met, ray.dir) {
                return Way::Skips(met.hit, Interaction::at(world.geometry, &met.hit, false));
            }
        }
        if let Some((at, coverage)) = sheer(world, &met.hit, ray.dir, hides_backs) {
            // Certain cases need no number; a ray that has used up its numbers meets the next surface.
            let number = || {
                let (set, number) = dims::alpha(edge, ray.surfaces)?;
                Some(S::sample_4d(block.index[i], [block.seed_lo[i], block.seed_hi[i]], set)[number])
            };
            if !(coverage > 0.0 && number().is_none_or(|u| u < coverage)) {
                return Way::Goes(met.hit, at, None);
            }
        }
        let slot = block.slot[i] as usize;
        if features.boundaries
            && let Some((at, boundaries, straight)) = through(world, &media[slot], &met, ray.dir)
        {
            let around = &mut media[slot];
            let between = [around.since_m, met.hit.t];
            let stretch = Stretch { org: ray.org, dir: ray.dir, medium: straight.from, between };
            let mut left = straight.tint;
            if !features.scattering {
                left *= media::left(world, &stretch);
            } else if let Some(distance_m) = volume::travel::<S>(world, block, i, &stretch, (edge, ray.surfaces)) {
                collisions[ray.lane] = distance_m;
                return Way::Collides;
            }
            let beta = get(&block.beta, i) * left;
            set(&mut block.beta, i, beta);
            media::cross(around, boundaries, met.hit.t);
            return Way::Goes(met.hit, at, met.touching.map(|(hit, _)| hit));
        }
        if let Some(touching) = touching.get_mut(slot) {
            *touching = met.touching.map(|(_, boundary)| boundary);
        }
        Way::Ends(met.hit)
    };
    go_on(job, passing, rays, *len, decide, counters)
}

/// [`closest`] for the rays through the pixels' centres, which have no random numbers: they meet what is there by half.
pub fn closest_of_centres(job: &Job, rays: &mut [RayHitBlock], len: usize, counters: &mut Counters) -> u64 {
    let world = &job.world;
    let mut media = vec![job.media; if world.features.boundaries { len } else { 0 }];
    let decide = |ray: &AtHit| {
        let met = ray.settled(world);
        if let Some((at, coverage)) = sheer(world, &met.hit, ray.dir, world.features.hidden_backs)
            && coverage < 0.5
        {
            return Way::Goes(met.hit, at, None);
        }
        if let Some(around) = media.get_mut(ray.lane)
            && let Some((at, boundaries, _)) = through(world, around, &met, ray.dir)
        {
            media::cross(around, boundaries, met.hit.t);
            return Way::Goes(met.hit, at, met.touching.map(|(hit, _)| hit));
        }
        Way::Ends(met.hit)
    };
    let mut passing = Passing::default();
    passing.clear(len);
    go_on(job, &mut passing, rays, len, decide, counters)
}

/// Whether a ray meets what it seems to, as it starts; takes out boundaries there which it does not.
#[inline(always)]
fn judge(world: &World, start: &Start, around: &Media, met: &mut Met, dir: Vec3) -> bool {
    let meets = departure::meets(start, world, around, &met.hit, dir);
    if meets {
        met.touching = met.touching.filter(|(hit, _)| departure::meets(start, world, around, hit, dir));
    }
    meets
}

/// Rays that pass what they hit continue; `rays` then say what they meet in the end. `passing` has what they had passed
/// before.
#[inline(always)]
fn go_on(
    job: &Job,
    passing: &mut Passing,
    rays: &mut [RayHitBlock],
    len: usize,
    mut decide: impl FnMut(&AtHit) -> Way,
    counters: &mut Counters,
) -> u64 {
    for lane in 0..len {
        let (block, i) = (&mut rays[lane / LANES], lane % LANES);
        let Some(hit) = block.hit(i) else { continue };
        let first =
            Pending { passed: passing.first.get(lane).map_or(Passed::NOTHING, |&passed| passed), ..Pending::new(lane) };
        let past = (&passing.past, first.passed);
        match decide(&AtHit { lane, org: block.ray.org(i), dir: block.ray.dir(i), hit, surfaces: 0, past }) {
            Way::Ends(met) => block.set_hit(i, &met),
            Way::Collides => end_nowhere(block, i),
            Way::Goes(hit, at, also) => {
                let pending = Pending { surfaces: 1, ..first };
                passing.put_past(passing.pending.len(), pending, (&block.ray, i), f32::INFINITY, (&hit, &at), also);
            }
            Way::Skips(hit, at) => passing.put_skipped(passing.pending.len(), first, (&block.ray, i), (&hit, &at)),
        }
    }
    let mut traced = 0;
    while !passing.pending.is_empty() {
        traced += trace(job, passing, counters);
        let mut left = 0;
        for place in 0..passing.pending.len() {
            let pending = passing.pending[place];
            let (lane, i) = (pending.lane as usize, pending.lane as usize % LANES);
            let block = &mut rays[lane / LANES];
            let Some(hit) = passing.rays[place / LANES].hit(place % LANES) else {
                end_nowhere(block, i);
                continue;
            };
            let dir = block.ray.dir(i);
            let (way, surfaces) = match pending.last.filter(|last| is_same_surface(&job.world, [last, &hit], dir)) {
                Some(_) => (Way::Goes(hit, Interaction::at(job.world.geometry, &hit, false), None), pending.surfaces),
                None => {
                    let past = (&passing.past, pending.passed);
                    (
                        decide(&AtHit { lane, org: block.ray.org(i), dir, hit, surfaces: pending.surfaces, past }),
                        pending.surfaces + 1,
                    )
                }
            };
            match way {
                Way::Goes(hit, at, also) => {
                    let pending = Pending { surfaces, ..pending };
                    passing.put_past(left, pending, (&block.ray, i), f32::INFINITY, (&hit, &at), also);
                    left += 1;
                }
                Way::Skips(hit, at) => {
                    let from = (&block.ray, i);
                    passing.put_skipped(left, pending, from, (&hit, &at));
                    left += 1;
                }
                Way::Ends(hit) => block.set_hit(i, &hit),
                Way::Collides => end_nowhere(block, i),
            }
        }
        passing.pending.truncate(left);
    }
    traced
}

/// A ray that meets no surface.
#[inline(always)]
fn end_nowhere(rays: &mut RayHitBlock, i: usize) {
    (rays.hit.geom[i], rays.hit.inst[i]) = (INVALID_ID, INVALID_ID);
    rays.ray.tfar[i] = f32::INFINITY;
}

/// Weight of a corner up to which a hit may lie on the opposite edge.
const RIM: f32 = 1.0 / (1 << 10) as f32;

/// Whether two hits of a ray are one: on triangles that meet in an edge or a corner where the ray passes, and face it
/// alike. On both sides of an outline a ray goes in and out.
#[inline(always)]
fn is_same_surface(world: &World, [a, b]: [&Hit; 2], dir: Vec3) -> bool {
    let least = |hit: &Hit| hit.u.min(hit.v).min(1.0 - hit.u - hit.v);
    least(a) <= RIM && least(b) <= RIM && (a.geom, a.inst) == (b.geom, b.inst) && meet_there(world, [a, b], dir)
}

#[cold]
#[inline(never)]
fn meet_there(world: &World, [a, b]: [&Hit; 2], dir: Vec3) -> bool {
    let geometry = world.geometry;
    let mesh = &geometry.meshes[a.geom as usize];
    let corners = |hit: &Hit| mesh.indices[hit.prim as usize].map(|i| mesh.vertices[i as usize]);
    let weights = |hit: &Hit| [1.0 - hit.u - hit.v, hit.u, hit.v];
    let ([pa, pb], [wa, wb]) = ([corners(a), corners(b)], [weights(a), weights(b)]);
    // The corners near which the ray passes are those that both have.
    let shared = |p: &Vec3, of: &[Vec3; 3]| of.contains(p);
    let near = |p: [Vec3; 3], w: [f32; 3], other: &[Vec3; 3]| (0..3).all(|i| w[i] <= RIM || shared(&p[i], other));
    let same_triangle = (0..3).all(|i| shared(&pa[i], &pb));
    if same_triangle || !near(pa, wa, &pb) || !near(pb, wb, &pa) {
        return false;
    }
    let (at_a, at_b) = (Interaction::at(geometry, a, false), Interaction::at(geometry, b, false));
    let reach = at_a.p.distance(at_b.p);
    let size = (0..3).map(|i| pa[i].distance(pa[(i + 1) % 3])).fold(0.0, f32::max);
    let alike = (at_a.n_g.dot(dir) < 0.0) == (at_b.n_g.dot(dir) < 0.0);
    at_a.material == at_b.material && alike && wind_alike(&pa, &pb) && reach <= RIM * size
}

/// Whether two triangles that share an edge wind alike: one runs along it forwards, the other backwards. Those that
/// share a corner alone are taken to.
fn wind_alike(a: &[Vec3; 3], b: &[Vec3; 3]) -> bool {
    let edges = |t: &[Vec3; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
    let (ea, eb) = (edges(a), edges(b));
    !ea.iter().any(|edge| eb.contains(edge))
}

/// Instead of any hits: marks the shadow rays of the wave that nothing gets through, and scales what the others carry.
/// Returns the rays that were traced.
#[inline(always)]
pub fn shadows(job: &Job, wave: &mut Wave, counters: &mut Counters) -> u64 {
    let (passing, shadows, world) = (&mut wave.passing, &mut wave.shadows, &job.world);
    passing.clear(shadows.len);
    for lane in 0..shadows.len {
        let (ray, i) = (&mut shadows.rays[lane / LANES], lane % LANES);
        let mut pending = Pending::new(lane);
        if let Some(start) = shadows.starts.get(lane) {
            pending.passed = departure::set_out_shadow(start, &mut shadows.media[lane], ray, i, passing);
        }
        passing.put(lane, pending, (ray, i), ray.tfar[i]);
    }
    let mut traced = 0;
    while !passing.pending.is_empty() {
        traced += if traced == 0 && shadows.starts.is_empty() {
            // The coherent hint is for camera rays alone.
            let len = passing.pending.len();
            let blocks = &mut passing.rays[..len.div_ceil(LANES)];
            counters.invalid_rays += job.backend.closest_hit(blocks, len, Coherence::Incoherent);
            len as u64
        } else {
            trace(job, passing, counters)
        };
        let mut left = 0;
        for place in 0..passing.pending.len() {
            let mut pending = passing.pending[place];
            let (lane, block, i) =
                (pending.lane as usize, pending.lane as usize / LANES, pending.lane as usize % LANES);
            let ray = &shadows.rays[block];
            let (org, dir, end) = (ray.org(i), ray.dir(i), ray.tfar[i]);
            let radiance = &mut shadows.carried[block].radiance;
            let (mut on, mut skipped) = (None, false);
            if let Some(hit) = passing.rays[place / LANES].hit(place % LANES) {
                if pending.last.is_some_and(|last| is_same_surface(world, [&last, &hit], dir)) {
                    on = Some((hit, Interaction::at(world.geometry, &hit, false), None));
                } else {
                    let past = (&passing.past, pending.passed);
                    let mut met = AtHit { lane, org, dir, hit, surfaces: pending.surfaces, past }.settled(world);
                    skipped = shadows
                        .starts
                        .get(lane)
                        .is_some_and(|start| !judge(world, start, &shadows.media[lane], &mut met, dir));
                    if skipped {
                        on = Some((met.hit, Interaction::at(world.geometry, &met.hit, false), None));
                    } else if let Some((at, coverage)) = sheer(world, &met.hit, dir, world.features.hidden_to_all)
                        .filter(|(_, coverage)| *coverage == 0.0 || pending.surfaces < dims::MOST_PASSED)
                    {
                        pending.left *= 1.0 - f64::from(coverage);
                        on = Some((met.hit, at, None));
                    } else if let Some(around) = shadows.media.get_mut(lane)
                        && let Some((at, boundaries, straight)) = through(world, around, &met, dir)
                    {
                        let between = [around.since_m, met.hit.t];
                        let left = media::left(world, &Stretch { org, dir, medium: straight.from, between });
                        media::cross(around, boundaries, met.hit.t);
                        let carried = get(radiance, i) * straight.tint * left;
                        set(radiance, i, carried);
                        pending.left = if carried.max_element() > 0.0 { pending.left } else { 0.0 };
                        on = Some((met.hit, at, met.touching.map(|(hit, _)| hit)));
                    } else {
                        pending.left = 0.0;
                    }
                    pending.surfaces += u32::from(!skipped);
                }
            }
            let ray = &shadows.rays[block];
            if !(pending.left > 0.0) {
                shadows.rays[block].tfar[i] = BLOCKED;
            } else if let Some((hit, at, also)) = on {
                passing.put_past(left, pending, (ray, i), end, (&hit, &at), also);
                if skipped {
                    passing.pending[left].last = pending.last;
                }
                left += 1;
            } else {
                if pending.surfaces > 0 {
                    radiance.iter_mut().for_each(|channel| channel[i] *= pending.left as f32);
                }
                if let Some(around) = shadows.media.get(lane) {
                    let stretch = Stretch { org, dir, medium: around.top(), between: [around.since_m, end] };
                    let arrived = get(radiance, i) * media::left(world, &stretch);
                    set(radiance, i, arrived);
                }
            }
        }
        passing.pending.truncate(left);
    }
    traced
}
