//! What camera rays meet first, for the layers that show it: `film/layer` declares them, this page says what their
//! values are. A mean is gathered from the samples of the picture themselves ([`gather`] and [`see_through`], between
//! tracing and shading of the first edge); what belongs to the pixel's centre is traced once, before the pixel's first
//! sample ([`centres`]). Renders without such layers pay a test or two a wave.

use glam::Vec3;

use super::coincident;
use super::counters::Counters;
use super::job::Job;
use super::material::{self, Place};
use super::media;
use super::motion;
use super::pass_through;
use super::wave::Wave;
use crate::backend::Coherence;
use crate::backend::batch::{Hit, INVALID_ID, LANES, RayHitBlock};
use crate::film::store::Plane;
use crate::math::columns::get;
use crate::plan::aov::{Aov, Gathers};
use crate::shading::interaction::Interaction;
use crate::texture;

/// What a ray meets first.
pub(super) struct FirstHit {
    hit: Hit,
    at: Interaction,
    /// Whether the ray comes from the back of the triangle.
    from_behind: bool,
    /// Base colour with texture and vertex colour.
    pub albedo: Vec3,
    /// Unit shading normal before normal maps, turned to the viewer.
    pub normal: Vec3,
    /// Along the view axis, metres.
    depth: f32,
}

/// The value of a layer there.
type Value = fn(&Job, &FirstHit) -> Vec3;

/// How the value of `aov` is found; the list of what this page gathers.
fn value_of(aov: Aov) -> Value {
    match aov {
        Aov::ALBEDO => |_, hit| hit.albedo,
        Aov::NORMAL => |_, hit| hit.normal,
        Aov::GEOMETRIC_NORMAL => |_, hit| if hit.from_behind { -hit.at.n_g } else { hit.at.n_g },
        Aov::DEPTH => |_, hit| Vec3::splat(hit.depth),
        Aov::POSITION => |job, hit| (hit.at.p.as_dvec3() + job.world.scene.origin).as_vec3(),
        Aov::UV => |job, hit| hit.at.uv(job.world.geometry).unwrap_or_default().extend(0.0),
        Aov::MOTION => |job, hit| motion::of_surface(job, &hit.hit).extend(0.0),
        Aov::BACKGROUND => |_, _| Vec3::ZERO,
        Aov::COVERAGE => |_, _| Vec3::ONE,
        Aov::CRYPTO_OBJECT => |job, hit| hit.id(job, &job.names.objects),
        Aov::CRYPTO_MATERIAL => |job, hit| hit.id(job, &job.names.materials),
        Aov::CRYPTO_ASSET => |job, hit| hit.id(job, &job.names.assets),
        _ => unreachable!("{aov} is not of the first hit"),
    }
}

/// Writes down what the traced camera rays of `wave` meet, three numbers a layer and camera sample.
#[inline(never)]
pub fn gather(job: &Job, wave: &mut Wave) {
    let values: Vec<Value> = layers(job, Gathers::FirstHit).map(value_of).collect();
    let first_hits = &mut wave.sums.first_hits;
    first_hits.clear();
    first_hits.resize(wave.current.len * values.len(), [0.0; 3]);
    if values.is_empty() {
        return;
    }
    for lane in 0..wave.current.len {
        let (block, i) = (lane / LANES, lane % LANES);
        let rays = &wave.current.rays[block];
        let slot = wave.current.paths[block].slot[i] as usize;
        let Some(hit) = rays.hit(i) else { continue };
        let met = FirstHit::at(job, &hit, rays.ray.dir(i));
        for (sum, value) in first_hits[slot * values.len()..].iter_mut().zip(&values) {
            *sum = value(job, &met).into();
        }
    }
}

/// Writes down what the camera rays of `wave` see that meet no surface, once media have taken their share: the
/// environment as `classify` counts it. What they pass covers what it does not let through, by the mean over channels;
/// a medium that they collide in covers everything.
#[inline(never)]
pub fn see_through(job: &Job, wave: &mut Wave) {
    let place = |wanted: Aov| layers(job, Gathers::FirstHit).position(|aov| aov == wanted);
    let (background, coverage) = (place(Aov::BACKGROUND), place(Aov::COVERAGE));
    if background.is_none() && coverage.is_none() {
        return;
    }
    let (world, width) = (&job.world, layers(job, Gathers::FirstHit).count());
    let environment = world.lights.environment().filter(|_| world.features.environment);
    for lane in 0..wave.current.len {
        let (block, i) = (lane / LANES, lane % LANES);
        let (rays, paths) = (&wave.current.rays[block], &wave.current.paths[block]);
        if rays.hit.geom[i] != INVALID_ID {
            continue;
        }
        let slot = paths.slot[i] as usize;
        let mut through = get(&paths.beta, i);
        if let Some(around) = wave.media.get(slot) {
            through *= media::left_to_infinity(world, around);
        }
        if wave.gone.get(block).is_some_and(|gone| gone >> i & 1 == 1) {
            through = Vec3::ZERO;
        }
        let values = &mut wave.sums.first_hits[slot * width..];
        if let Some(number) = background {
            let radiance = environment.map_or(Vec3::ZERO, |light| light.radiance(rays.ray.dir(i)));
            values[number] = (through * radiance).into();
        }
        if let Some(number) = coverage {
            values[number] = [1.0 - through.element_sum() / 3.0; 3];
        }
    }
}

/// Traces the rays through the centres of `pixels` (full-image coordinates) as the shutter opens and puts what they
/// meet into the planes that want it. `counters` gets the rays.
pub fn centres(job: &Job, pixels: &[(u32, u32)], planes: &mut [Plane], counters: &mut Counters) {
    let wanted = |plane: &&mut Plane| plane.layer.aov.gathers() == Gathers::Centre;
    if layers(job, Gathers::Centre).next().is_none() {
        return;
    }
    let mut rays = vec![RayHitBlock::EMPTY; pixels.len().div_ceil(LANES)];
    for (lane, &(x, y)) in pixels.iter().enumerate() {
        let (org, dir) = job.camera.pinhole_ray(x as f32 + 0.5, y as f32 + 0.5);
        let block = &mut rays[lane / LANES].ray;
        block.set(lane % LANES, org, dir, f32::INFINITY);
        block.tnear[lane % LANES] = job.camera.near();
    }
    counters.rays_camera += pixels.len() as u64;
    counters.invalid_rays += job.backend.closest_hit(&mut rays, pixels.len(), Coherence::Coherent);
    if job.world.features.passes(1) {
        counters.rays_camera += pass_through::closest_of_centres(job, &mut rays, pixels.len(), counters);
    } else if job.world.features.coincident {
        coincident::settle_all(&job.world, &mut rays, pixels.len());
    }
    for lane in 0..pixels.len() {
        let (block, i) = (&rays[lane / LANES], lane % LANES);
        let dir = block.ray.dir(i);
        let met = block.hit(i).map(|hit| FirstHit::at(job, &hit, dir));
        for plane in planes.iter_mut().filter(wanted) {
            let value = match (plane.layer.aov, &met) {
                (aov, Some(met)) => value_of(aov)(job, met),
                (Aov::MOTION, None) => motion::of_infinity(job, dir).extend(0.0),
                (_, None) => continue,
            };
            plane.pixel_mut(lane).copy_from_slice(&value.to_array().map(f64::from));
        }
    }
    counters.texture_lookups += texture::take_lookups();
}

/// The layers that are gathered so, in the order of the film's planes.
fn layers(job: &Job, gathers: Gathers) -> impl Iterator<Item = Aov> {
    Aov::all().filter(move |aov| aov.gathers() == gathers && job.layers.contains(aov))
}

impl FirstHit {
    pub fn at(job: &Job, hit: &Hit, dir: Vec3) -> Self {
        let at = Interaction::at(job.world.geometry, hit, job.world.features.smooth_normals);
        let material = &job.world.scene.materials[at.material as usize];
        let from_behind = at.n_g.dot(dir) > 0.0;
        let normal = if from_behind { -at.n_s } else { at.n_s };
        let albedo = material::base_color(&job.world, material, Place::of(&at));
        FirstHit { hit: *hit, from_behind, albedo, normal, depth: job.camera.depth(at.p), at }
    }

    /// What `ids` has for the instance that is met, as the first of three numbers. Zeros, where nothing is met, are no
    /// id.
    fn id(&self, job: &Job, ids: &[u32]) -> Vec3 {
        let owner = job.world.geometry.owners.of(self.hit.inst, self.hit.prim);
        Vec3::new(f32::from_bits(ids[owner]), 0.0, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_layer_of_the_first_hit_has_a_value() {
        for aov in Aov::all().filter(|aov| aov.is_of_first_hit()) {
            value_of(aov);
        }
    }
}
