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

    /// Traces all; returns how many.
    fn trace(&mut self, context: &Context, counters: &mut Counters) -> u64 {
        let len = self.pending.len();
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
    let passing = &mut wave.passing;
    passing.clear(wave.current.len);
    for lane in 0..wave.current.len {
        let (block, i) = (lane / LANES, lane % LANES);
        let rays = &wave.current.rays[block];
        let Some(hit) = rays.hit(i) else { continue };
        let path = wave.current.paths[block].get(i);
        if let Some(org) = passed::<S>(context, &hit, rays.ray.dir(i), (path.index, path.seed), (edge, 0)) {
            let pending = Pending { lane: lane as u32, passed: 1, carried: hit.t.into(), end: DVec3::INFINITY };
            passing.put(passing.pending.len(), pending, org, rays.ray.dir(i), f32::INFINITY);
        }
    }
    let mut traced = 0;
    while !passing.pending.is_empty() {
        traced += passing.trace(context, counters);
        let mut left = 0;
        for place in 0..passing.pending.len() {
            let pending = passing.pending[place];
            let (block, i) = (pending.lane as usize / LANES, pending.lane as usize % LANES);
            let found = passing.rays[place / LANES].hit(place % LANES);
            let rays = &mut wave.current.rays[block];
            let Some(hit) = found else {
                (rays.hit.geom[i], rays.hit.inst[i]) = (INVALID_ID, INVALID_ID);
                continue;
            };
            let path = wave.current.paths[block].get(i);
            let dir = rays.ray.dir(i);
            let carried = pending.carried + f64::from(hit.t);
            match passed::<S>(context, &hit, dir, (path.index, path.seed), (edge, pending.passed)) {
                Some(org) => {
                    let pending = Pending { passed: pending.passed + 1, carried, ..pending };
                    passing.put(left, pending, org, dir, f32::INFINITY);
                    left += 1;
                }
                None => write(rays, i, &Hit { t: carried as f32, ..hit }),
            }
        }
        passing.pending.truncate(left);
    }
    traced
}

/// Where a ray of direction `dir` goes on that passes what it hit; `None` where it meets it. `sample`: index and seed;
/// `place`: edge, and surfaces passed on it before.
#[inline(always)]
fn passed<S: Scheme>(
    context: &Context,
    hit: &Hit,
    dir: Vec3,
    sample: (u32, [u32; 2]),
    place: (u32, u32),
) -> Option<Vec3> {
    let (at, coverage) = sheer(context, hit)?;
    if coverage > 0.0 {
        let (set, number) = dims::alpha(place.0, place.1)?;
        if S::sample_4d(sample.0, sample.1, set)[number] < coverage {
            return None;
        }
    }
    Some(float::spawn_origin(at.p, at.n_g, at.error, dir))
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
        traced += passing.trace(context, counters);
        let mut left = 0;
        for place in 0..passing.pending.len() {
            let pending = passing.pending[place];
            let (block, i) = (pending.lane as usize / LANES, pending.lane as usize % LANES);
            let Some(hit) = passing.rays[place / LANES].hit(place % LANES) else {
                if pending.passed > 0 {
                    let radiance = &mut shadows.carried[block].radiance;
                    radiance.iter_mut().for_each(|channel| channel[i] *= pending.carried as f32);
                }
                continue;
            };
            let dir = passing.rays[place / LANES].ray.dir(place % LANES);
            let (carried, org, dir, tfar) = match sheer(context, &hit) {
                None => (0.0, Vec3::ZERO, Vec3::Z, 0.0),
                Some((at, coverage)) => {
                    let org = float::spawn_origin(at.p, at.n_g, at.error, dir);
                    // Aimed anew, so that the end stays where it falls short of the light.
                    let way = pending.end - org.as_dvec3();
                    let (dir, tfar) = match way.is_finite() {
                        true => (way.normalize_or_zero().as_vec3(), way.length() as f32),
                        false => (dir, f32::INFINITY),
                    };
                    (pending.carried * (1.0 - f64::from(coverage)), org, dir, tfar)
                }
            };
            if carried > 0.0 && pending.passed < dims::MOST_PASSED {
                passing.put(left, Pending { passed: pending.passed + 1, carried, ..pending }, org, dir, tfar);
                left += 1;
            } else {
                shadows.rays[block].tfar[i] = BLOCKED;
            }
        }
        passing.pending.truncate(left);
    }
    traced
}
