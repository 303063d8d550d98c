//! Light paths begin: addresses of their random numbers, and their first rays.
//!
//! Sample index s has N light paths; path j of it is point ⌊s/2⌋·N + j of one scramble for each half, so that aligned
//! ranges of samples are nets, and any split of a render has the same paths.

use glam::Vec3;

use super::lit::LightPaths;
use crate::backend::batch::LANES;
use crate::math::float;
use crate::sampler::{self, dims};
use crate::shading::medium::Media;
use crate::transport::material;
use crate::transport::shutter;
use crate::transport::start::Start;
use crate::transport::wave::{Path, Wave};
use crate::transport::world::World;

/// The pixel whose seed they have: none of a picture.
const PIXEL: u64 = 1 << 40;

/// Some light paths: numbers `first` to `first + len` of those of all sample indices from `sample` on.
#[derive(Clone, Copy, Debug)]
pub struct Batch {
    /// Sample index.
    pub sample: u64,
    /// Number of its light paths, a power of two.
    pub per_sample: u64,
    /// Number of the first one.
    pub first: u64,
    /// How many.
    pub len: usize,
}

/// What a light path carries besides its ray.
#[derive(Clone, Copy, Debug)]
pub struct State {
    /// Power over density where it started.
    pub power: Vec3,
    /// Its light.
    pub light: u32,
    /// Where it started.
    pub org: Vec3,
    /// In which direction.
    pub dir: Vec3,
    /// Half of the film that it is added to.
    pub half: u32,
    /// Density of BSDF samples over that of the light path, but for what depends on the camera.
    pub bsdf: f32,
    /// The same of light samples.
    pub light_sample: f32,
}

/// Four numbers of a set.
pub type Numbers = fn(u32, [u32; 2], u32) -> [f32; 4];

/// Fills `wave.current` with the first rays of `batch`, and `states` by slot. Lights that send nothing there begin
/// nothing.
pub fn run(
    world: &World,
    light_paths: &LightPaths,
    (batch, seed): (&Batch, u64),
    numbers: Numbers,
    (wave, states): (&mut Wave, &mut Vec<State>),
) {
    states.clear();
    wave.current.len = 0;
    wave.media.clear();
    wave.times.clear();
    if world.features.shutter {
        // Lanes that are not in use have slots too.
        wave.times.resize(wave.capacity().next_multiple_of(LANES), 0.0);
    }
    for i in 0..batch.len as u64 {
        let (sample, path) = ((batch.first + i) / batch.per_sample, (batch.first + i) % batch.per_sample);
        let sample = batch.sample + sample;
        let point = (sample >> 1) * batch.per_sample + path;
        let half = (sample & 1) as u32;
        let seed = sampler::pixel_seed(seed, PIXEL, half, (point >> 32) as u32);
        let index = point as u32;
        let (u, v) = (numbers(index, seed, dims::LIGHT), numbers(index, seed, dims::TIME));
        let Some(start) = light_paths.emitters.start(world.lights, u, [v[2], v[3]]) else { continue };
        let mut power = start.power;
        if let Some(point) = start.texture_point {
            power *= material::emission_texel(world, &point);
        }
        if !(power.max_element() > 0.0) {
            continue;
        }
        let slot = states.len() as u32;
        let (light, dir) = (start.light, start.dir);
        let around = light_paths.media.get(light as usize).copied().unwrap_or(Media::NONE);
        states.push(State { power, light, org: start.org, dir, half, bsdf: 0.0, light_sample: 0.0 });
        let org = float::spawn_origin(start.org, start.normal, start.error, dir);
        wave.current.push(org, dir, Path { slot, seed_lo: seed[0], seed_hi: seed[1], index, ..Path::NEW });
        if world.features.media {
            wave.media.push(around);
        }
        if world.features.shutter {
            wave.times[slot as usize] = v[0];
        }
    }
    if world.features.shutter {
        shutter::stamp_paths(&wave.times, &mut wave.current);
    }
    wave.split.clear();
    if world.features.dispersion {
        wave.split.resize(states.len(), false);
    }
    wave.starts.clear();
    if world.features.exact_starts {
        wave.starts.resize(states.len(), Start::NOWHERE);
    }
    if world.features.media && world.features.coincident {
        wave.touching.clear();
        wave.touching.resize(states.len(), None);
    }
}
