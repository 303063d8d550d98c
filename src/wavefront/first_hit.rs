//! A pass of its own for the channels of the first hit, so that a render without them pays nothing. `albedo` and the
//! normal are means over the render's own first camera samples (at most [`SAMPLES`] a pixel); depth and position belong to
//! the ray through the pixel's centre, when the shutter opens.

use glam::Vec3;

use super::raygen::{self, Chunk};
use super::state::Wave;
use super::{Context, Counters, alpha};
use crate::backend::Coherence;
use crate::backend::batch::{Hit, LANES, RayHitBlock};
use crate::film::aov::FirstHit;
use crate::sampler::{IndependentScheme, SamplerKind, SobolScheme};
use crate::shading::interaction::Interaction;
use crate::texture;

/// Camera samples of a pixel that are looked at: a mean of bounded values is then good to a few percent, as guides for
/// denoising need it.
pub const SAMPLES: u64 = 16;

/// What the camera rays of `pixels` (full-image coordinates) meet first, in the order of `pixels`. `spp` is what the
/// render took; `counters` gets the rays.
pub fn run(context: &Context, pixels: &[(u32, u32)], spp: u64, counters: &mut Counters) -> Vec<FirstHit> {
    let samples = spp.clamp(1, SAMPLES) as usize;
    let mut wave = Wave::new(context.plan.wave.max(samples), false);
    let mut hits = Vec::with_capacity(pixels.len());
    for part in pixels.chunks(wave.capacity() / samples) {
        let chunk = Chunk { pixels: part, first_sample: 0, samples };
        match context.plan.sampler {
            SamplerKind::Sobol => raygen::run::<SobolScheme>(context, &chunk, &mut wave),
            SamplerKind::Independent => raygen::run::<IndependentScheme>(context, &chunk, &mut wave),
        }
        let first = hits.len();
        hits.resize(first + part.len(), FirstHit::NONE);
        filtered(context, &mut wave, samples, &mut hits[first..], counters);
        centred(context, part, &mut hits[first..], counters);
    }
    hits
}

/// Means over the pixel filter: every slot of the wave is one camera sample.
fn filtered(context: &Context, wave: &mut Wave, samples: usize, hits: &mut [FirstHit], counters: &mut Counters) {
    let (len, blocks) = (wave.current.len, wave.current.blocks());
    counters.rays_camera += len as u64;
    context.backend.closest_hit(&mut wave.current.rays[..blocks], len, Coherence::Coherent);
    if context.plan.features.alpha {
        counters.rays_camera += match context.plan.sampler {
            SamplerKind::Sobol => alpha::closest::<SobolScheme>(context, wave, 1, counters),
            SamplerKind::Independent => alpha::closest::<IndependentScheme>(context, wave, 1, counters),
        };
    }
    for lane in 0..len {
        let (block, i) = (lane / LANES, lane % LANES);
        let rays = &wave.current.rays[block];
        let Some(hit) = rays.hit(i) else { continue };
        let slot = wave.current.paths[block].slot[i] as usize;
        let surface = First::at(context, &hit, rays.ray.dir(i));
        let share = wave.sums.gathered[slot].weight / samples as f32;
        let pixel = &mut hits[slot / samples];
        for c in 0..3 {
            pixel.albedo[c] += share * surface.albedo[c];
            pixel.normal[c] += share * surface.normal[c];
        }
    }
}

/// Depth and position along the rays through the pixels' centres.
fn centred(context: &Context, pixels: &[(u32, u32)], hits: &mut [FirstHit], counters: &mut Counters) {
    let mut rays = vec![RayHitBlock::EMPTY; pixels.len().div_ceil(LANES)];
    for (lane, &(x, y)) in pixels.iter().enumerate() {
        let (org, dir) = context.camera.pinhole_ray(x as f32 + 0.5, y as f32 + 0.5);
        let block = &mut rays[lane / LANES].ray;
        block.set(lane % LANES, org, dir, f32::INFINITY);
        block.tnear[lane % LANES] = context.camera.near();
    }
    counters.rays_camera += pixels.len() as u64;
    context.backend.closest_hit(&mut rays, pixels.len(), Coherence::Coherent);
    if context.plan.features.alpha {
        counters.rays_camera += alpha::closest_of_centres(context, &mut rays, pixels.len(), counters);
    }
    for (lane, pixel) in hits.iter_mut().enumerate() {
        if let Some(hit) = rays[lane / LANES].hit(lane % LANES) {
            let p = Interaction::at(context.geometry, &hit, false).p;
            pixel.depth = context.camera.depth(p);
            pixel.position = (p.as_dvec3() + context.scene.origin).as_vec3().into();
        }
    }
}

/// A surface as the channels show it.
struct First {
    albedo: Vec3,
    /// Turned to the viewer.
    normal: Vec3,
}

impl First {
    fn at(context: &Context, hit: &Hit, dir: Vec3) -> Self {
        let at = Interaction::at(context.geometry, hit, context.plan.features.smooth_normals);
        let material = &context.scene.materials[at.material as usize];
        let slot = material.base_color_texture;
        let mut texel = match (slot, slot.and_then(|slot| at.uv_of(context.geometry, slot.uv_set))) {
            (Some(slot), Some(uv)) => texture::lookup(&context.scene.textures[slot.texture.index()], uv).truncate(),
            _ => Vec3::ONE,
        };
        if material.vertex_colors {
            texel *= at.color(context.geometry).truncate();
        }
        let normal = if at.n_g.dot(dir) > 0.0 { -at.n_s } else { at.n_s };
        First { albedo: material.base_color * texel, normal }
    }
}
