//! Surfaces that are there in part: rays that meet one where it is cut out, or by chance under blending, go straight on.
//!
//! Two stages, run only where the plan has such surfaces. After closest hits: lanes whose hit is passed start again behind
//! it, packed, until none is left; what they meet in the end is written to their lane as if it had been met at once, so that the
//! path has as many edges as before, and the origin of its edge (which emission MIS asks for) is unchanged. Instead of any
//! hits: shadow rays go from hit to hit and keep the fraction that each surface lets pass, without random numbers.
//!
//! Going on starts like a scattered ray, off the surface by its error bound (`math::float`): it meets neither the triangle
//! again nor skips what lies behind that bound. Limit: sheets closer to each other than the bound count as one.
//! Source: glTF 2.0 §3.9.4 (see [`AlphaMode`]).

use glam::{DVec3, Vec3};

use super::state::Wave;
use super::{Context, Counters};
use crate::backend::Coherence;
use crate::backend::batch::{BLOCKED, Hit, INVALID_ID, LANES, RayHitBlock};
use crate::math::float;
use crate::sampler::{Scheme, dims};
use crate::scene::{AlphaMode, Scene};
use crate::shading::interaction::Interaction;
use crate::texture;

/// How each material covers, resolved once per render.
#[derive(Clone, Debug, Default)]
pub struct AlphaTable {
    /// One entry a material; empty where every surface is there everywhere.
    modes: Vec<AlphaMode>,
}

impl AlphaTable {
    /// Of all materials of the scene.
    pub fn new(scene: &Scene) -> Self {
        let modes: Vec<_> = scene.materials.iter().map(|material| material.effective_alpha(&scene.textures)).collect();
        let opaque = modes.iter().all(|mode| *mode == AlphaMode::Opaque);
        AlphaTable { modes: if opaque { Vec::new() } else { modes } }
    }

    #[inline(always)]
    fn mode(&self, material: u32) -> AlphaMode {
        self.modes.get(material as usize).copied().unwrap_or_default()
    }

    /// Probability that a ray meets the surface of `material` at a point: `(attributes, weights of the second and third
    /// corner)` of its triangle.
    #[inline]
    pub fn coverage(&self, context: &Context, material: u32, (attributes, weights): (u32, [f32; 2])) -> f32 {
        let mode = self.mode(material);
        if mode == AlphaMode::Opaque {
            return 1.0;
        }
        let material = &context.scene.materials[material as usize];
        let mut alpha = material.base_alpha;
        if let Some(slot) = material.base_color_texture
            && let Some(uv) = context.geometry.uv(attributes, slot.uv_set, weights)
        {
            alpha *= texture::lookup(&context.scene.textures[slot.texture.index()], uv).w;
        }
        if material.vertex_colors {
            alpha *= context.geometry.color(attributes, weights).w;
        }
        mode.coverage(alpha)
    }
}

/// Rays that go on, in lanes `0..pending.len()`. Grows to a wave's size where it is used at all.
#[derive(Default)]
pub struct Passing {
    rays: Vec<RayHitBlock>,
    pending: Vec<Pending>,
}

/// One ray that goes on.
#[derive(Clone, Copy)]
struct Pending {
    /// Lane of the path or shadow ray.
    lane: u32,
    /// Surfaces passed so far.
    passed: u32,
    /// Path: distance from its edge's origin, metres. Shadow ray: fraction left.
    carried: f64,
    /// Shadow ray: where it ends; not finite for lights at infinity.
    end: DVec3,
}

impl Passing {
    fn clear(&mut self, capacity: usize) {
        self.pending.clear();
        if self.rays.len() * LANES < capacity {
            self.rays.resize(capacity.div_ceil(LANES), RayHitBlock::EMPTY);
        }
    }

    #[inline(always)]
    fn put(&mut self, place: usize, pending: Pending, org: Vec3, dir: Vec3, tfar: f32) {
        self.rays[place / LANES].ray.set(place % LANES, org, dir, tfar);
        if place == self.pending.len() {
            self.pending.push(pending);
        } else {
            self.pending[place] = pending;
        }
    }

    /// Traces all; returns how many. `time` is asked for the time of a lane, where anything moves.
    fn trace(&mut self, context: &Context, counters: &mut Counters, time: impl Fn(usize) -> f32) -> u64 {
        let len = self.pending.len();
        if context.plan.features.shutter {
            for (place, pending) in self.pending.iter().enumerate() {
                self.rays[place / LANES].ray.time[place % LANES] = time(pending.lane as usize);
            }
        }
        let blocks = &mut self.rays[..len.div_ceil(LANES)];
        // The coherent hint is for camera rays alone.
        counters.invalid_rays += context.backend.closest_hit(blocks, len, Coherence::Incoherent);
        len as u64
    }
}

/// A surface on the way of a ray and the probability that it is there; `None` where it surely is.
#[inline(always)]
fn sheer(context: &Context, hit: &Hit) -> Option<(Interaction, f32)> {
    let material = context.geometry.triangle(hit.geom, hit.prim).material;
    if context.alpha.mode(material) == AlphaMode::Opaque {
        return None;
    }
    let at = Interaction::at(context.geometry, hit, false);
    let coverage = context.alpha.coverage(context, material, at.corner());
    (coverage < 1.0).then_some((at, coverage))
}

/// After closest hits: `wave.current` as if surfaces that rays pass were not there. `edge` counts the edges of the path up
/// to here. Returns the rays that were traced.
#[inline(always)]
pub fn closest<S: Scheme>(context: &Context, wave: &mut Wave, edge: u32, counters: &mut Counters) -> u64 {
    let (current, passing) = (&mut wave.current, &mut wave.passing);
    let paths = &current.paths;
    let meets = |lane: usize, passed: u32, coverage: f32| {
        let (block, i) = (&paths[lane / LANES], lane % LANES);
        // Certain cases need no number; a ray that has used up its own meets what comes.
        let number = || {
            let (set, number) = dims::alpha(edge, passed)?;
            Some(S::sample_4d(block.index[i], [block.seed_lo[i], block.seed_hi[i]], set)[number])
        };
        coverage > 0.0 && number().is_none_or(|u| u < coverage)
    };
    go_on(context, passing, &mut current.rays, current.len, meets, counters)
}

/// [`closest`] for the rays through the pixels' centres, which have no random numbers: they meet what is there by half.
pub fn closest_of_centres(context: &Context, rays: &mut [RayHitBlock], len: usize, counters: &mut Counters) -> u64 {
    go_on(context, &mut Passing::default(), rays, len, |_, _, coverage| coverage >= 0.5, counters)
}

/// Rays whose hit is not met go on; `rays` then say what they meet in the end. `meets` is asked with lane, number of
/// surfaces passed before, and coverage below 1.
#[inline(always)]
fn go_on(
    context: &Context,
    passing: &mut Passing,
    rays: &mut [RayHitBlock],
    len: usize,
    meets: impl Fn(usize, u32, f32) -> bool,
    counters: &mut Counters,
) -> u64 {
    let behind = |lane: usize, passed: u32, hit: &Hit, dir: Vec3| {
        let (at, coverage) = sheer(context, hit)?;
        (!meets(lane, passed, coverage)).then(|| float::spawn_origin(at.p, at.n_g, at.error, dir))
    };
    passing.clear(len);
    for lane in 0..len {
        let (block, i) = (&rays[lane / LANES], lane % LANES);
        let (Some(hit), dir) = (block.hit(i), block.ray.dir(i)) else { continue };
        if let Some(org) = behind(lane, 0, &hit, dir) {
            let pending = Pending { lane: lane as u32, passed: 1, carried: hit.t.into(), end: DVec3::INFINITY };
            passing.put(passing.pending.len(), pending, org, dir, f32::INFINITY);
        }
    }
    let mut traced = 0;
    while !passing.pending.is_empty() {
        traced += passing.trace(context, counters, |lane| rays[lane / LANES].ray.time[lane % LANES]);
        let mut left = 0;
        for place in 0..passing.pending.len() {
            let pending = passing.pending[place];
            let (lane, i) = (pending.lane as usize, pending.lane as usize % LANES);
            let block = &mut rays[lane / LANES];
            let Some(hit) = passing.rays[place / LANES].hit(place % LANES) else {
                (block.hit.geom[i], block.hit.inst[i]) = (INVALID_ID, INVALID_ID);
                block.ray.tfar[i] = f32::INFINITY;
                continue;
            };
            let dir = block.ray.dir(i);
            let carried = pending.carried + f64::from(hit.t);
            match behind(lane, pending.passed, &hit, dir) {
                Some(org) => {
                    let pending = Pending { passed: pending.passed + 1, carried, ..pending };
                    passing.put(left, pending, org, dir, f32::INFINITY);
                    left += 1;
                }
                None => write(block, i, &Hit { t: carried as f32, ..hit }),
            }
        }
        passing.pending.truncate(left);
    }
    traced
}

#[inline(always)]
fn write(rays: &mut RayHitBlock, i: usize, hit: &Hit) {
    rays.ray.tfar[i] = hit.t;
    rays.hit.u[i] = hit.u;
    rays.hit.v[i] = hit.v;
    rays.hit.prim[i] = hit.prim;
    rays.hit.geom[i] = hit.geom;
    rays.hit.inst[i] = hit.inst;
}

/// Instead of any hits: marks the shadow rays of the wave that nothing gets through, and scales what the others carry.
/// Returns the rays that were traced.
#[inline(always)]
pub fn shadows(context: &Context, wave: &mut Wave, counters: &mut Counters) -> u64 {
    let (passing, shadows) = (&mut wave.passing, &mut wave.shadows);
    passing.clear(shadows.len);
    for lane in 0..shadows.len {
        let ray = &shadows.rays[lane / LANES];
        let i = lane % LANES;
        let (org, dir, tfar) = (ray.org(i), ray.dir(i), ray.tfar[i]);
        let end = org.as_dvec3() + dir.as_dvec3() * f64::from(tfar);
        passing.put(lane, Pending { lane: lane as u32, passed: 0, carried: 1.0, end }, org, dir, tfar);
    }
    let mut traced = 0;
    while !passing.pending.is_empty() {
        traced += passing.trace(context, counters, |lane| shadows.rays[lane / LANES].time[lane % LANES]);
        let mut left = 0;
        for place in 0..passing.pending.len() {
            let mut pending = passing.pending[place];
            let (block, i) = (pending.lane as usize / LANES, pending.lane as usize % LANES);
            let ray = &passing.rays[place / LANES];
            let mut on = None;
            if let Some(hit) = ray.hit(place % LANES) {
                let sheer = sheer(context, &hit).filter(|_| pending.passed < dims::MOST_PASSED);
                pending.carried *= sheer.as_ref().map_or(0.0, |(_, coverage)| 1.0 - f64::from(*coverage));
                pending.passed += 1;
                on = sheer.and_then(|(at, _)| segment_behind(&at, ray.ray.dir(place % LANES), pending.end));
            }
            if !(pending.carried > 0.0) {
                shadows.rays[block].tfar[i] = BLOCKED;
            } else if let Some((org, dir, tfar)) = on {
                passing.put(left, pending, org, dir, tfar);
                left += 1;
            } else if pending.passed > 0 {
                let radiance = &mut shadows.carried[block].radiance;
                radiance.iter_mut().for_each(|channel| channel[i] *= pending.carried as f32);
            }
        }
        passing.pending.truncate(left);
    }
    traced
}

/// What is left of a shadow ray of direction `dir` behind the surface at `at`: origin, direction, length. Aimed anew, so that
/// its end stays where it falls short of the light. `None` where nothing is left.
#[inline(always)]
fn segment_behind(at: &Interaction, dir: Vec3, end: DVec3) -> Option<(Vec3, Vec3, f32)> {
    let org = float::spawn_origin(at.p, at.n_g, at.error, dir);
    if !end.is_finite() {
        return Some((org, dir, f32::INFINITY));
    }
    let way = end - org.as_dvec3();
    let length = way.length();
    (way.dot(dir.as_dvec3()) > 0.0).then(|| (org, (way / length).as_vec3(), length as f32))
}
