//! First stage: camera samples become paths. Consecutive lanes are samples of one pixel, then of its neighbour along a
//! Morton curve, so that packets of camera rays are coherent.

use super::job::Job;
use super::shutter;
use super::start::Start;
use super::wave::{Gathered, PathBlock, Wave};
use crate::backend::batch::{LANES, RayHitBlock};
use crate::film::filter::FilterSample;
use crate::sampler::{self, Scheme, WithScheme, dims};
use crate::shading::cone::Cone;

/// Camera samples of one chunk: some pixels of a tile, a range of sample indices of each.
pub struct Chunk<'a> {
    /// Pixels in the full image.
    pub pixels: &'a [(u32, u32)],
    /// First sample of each pixel.
    pub first_sample: u64,
    /// Samples of each pixel.
    pub samples: usize,
}

impl Chunk<'_> {
    /// Camera samples in all.
    pub(crate) fn len(&self) -> usize {
        self.pixels.len() * self.samples
    }
}

/// Fills `wave.current` with the camera rays of `chunk` and resets what the samples gather. Sixteen slots at a time:
/// slots are lanes here. Camera rays alone begin away from their origin: see [`start_at_origin`].
#[inline(always)]
pub fn run<S: Scheme>(job: &Job, chunk: &Chunk, wave: &mut Wave) {
    let (len, columns) = (chunk.len(), u64::from(job.columns));
    wave.current.len = len;
    if job.world.features.shutter {
        // Whole blocks: lanes that are not in use have slots too.
        wave.times.resize(wave.sums.gathered.len().next_multiple_of(LANES), 0.0);
    }
    let mut cursor = Cursor { pixel: 0, sample: 0 };
    let near = job.camera_steps.iter().fold(job.camera.near(), |near, step| near.max(step.near()));
    for (block, first) in (0..len).step_by(LANES).enumerate() {
        let rays = &mut wave.current.rays[block].ray;
        let path = &mut wave.current.paths[block];
        *path = PathBlock::default();

        // Where the samples lie. Lanes behind the last slot repeat it.
        let (mut x, mut y, mut pixel, mut sample) = ([0.0; LANES], [0.0; LANES], [0u64; LANES], [0u64; LANES]);
        for i in 0..LANES {
            let (px, py) = chunk.pixels[cursor.pixel];
            (x[i], y[i]) = (px as f32, py as f32);
            pixel[i] = u64::from(px) + u64::from(py) * columns;
            sample[i] = chunk.first_sample + cursor.sample as u64;
            path.slot[i] = (first + i) as u32;
            if first + i + 1 < len {
                cursor.advance(chunk.samples);
            }
        }
        let mut u = [[0.0; LANES]; 4];
        for i in 0..LANES {
            let address = sampler::address(sample[i]);
            let seed = sampler::pixel_seed(job.seed, pixel[i], address.half, address.high);
            path.index[i] = address.index;
            path.seed_lo[i] = seed[0];
            path.seed_hi[i] = seed[1];
        }
        for i in 0..LANES {
            let point = S::sample_4d(path.index[i], [path.seed_lo[i], path.seed_hi[i]], dims::CAMERA);
            for d in 0..4 {
                u[d][i] = point[d];
            }
        }
        for i in 0..LANES.min(len - first) {
            let FilterSample { dx, dy, weight } = job.filter.sample(u[0][i], u[1][i]);
            (x[i], y[i]) = (x[i] + 0.5 + dx, y[i] + 0.5 + dy);
            wave.sums.gathered[first + i] = Gathered { radiance: [0.0; 3], coverage: 0.0, weight };
        }
        if job.world.features.shutter {
            rays.time = shutter::draw::<S>(path);
            wave.times[first..][..LANES.min(len - first)].copy_from_slice(&rays.time[..LANES.min(len - first)]);
        }
        if !job.camera_steps.is_empty() {
            for i in 0..LANES {
                let camera = shutter::camera(job, rays.time[i]);
                let (org, dir) = camera.ray(x[i], y[i], [u[2][i], u[3][i]]);
                rays.set(i, org, dir, f32::INFINITY);
            }
        } else if job.world.features.lens {
            for i in 0..LANES {
                let (org, dir) = job.camera.ray(x[i], y[i], [u[2][i], u[3][i]]);
                rays.set(i, org, dir, f32::INFINITY);
            }
        } else {
            for i in 0..LANES {
                let (org, dir) = job.camera.pinhole_ray(x[i], y[i]);
                rays.set(i, org, dir, f32::INFINITY);
            }
        }
        rays.tnear = [near; LANES];
    }
    wave.sums.parts.clear();
    wave.media.clear();
    if job.world.features.media {
        wave.media.resize(len, job.media);
        if job.world.features.coincident {
            wave.touching.resize(len, None);
        }
    }
    wave.starts.clear();
    if job.world.features.exact_starts {
        wave.starts.resize(len, Start::NOWHERE);
    }
    wave.split.clear();
    if job.world.features.dispersion {
        wave.split.resize(len, false);
    }
    wave.ratios.clear();
    if job.world.features.light_paths {
        wave.ratios.resize(len, 0.0);
    }
    wave.guided.clear();
    if job.world.features.guide {
        wave.guided.resize(len, 1.0);
    }
    wave.cones.clear();
    if job.world.features.footprints {
        let (width_m, spread) = job.camera.pixel_cone();
        wave.cones.resize(len, Cone { width_m, spread });
    }
}

/// Where on the film the ray of a camera sample goes through, pixels from the top left corner: for reports.
pub fn film_position(job: &Job, pixel: (u32, u32), sample: u64) -> [f32; 2] {
    let address = sampler::address(sample);
    let number = u64::from(pixel.0) + u64::from(pixel.1) * u64::from(job.columns);
    let seed = sampler::pixel_seed(job.seed, number, address.half, address.high);
    let u = job.sampler.with(CameraPoint { index: address.index, seed });
    let FilterSample { dx, dy, .. } = job.filter.sample(u[0], u[1]);
    [pixel.0 as f32 + 0.5 + dx, pixel.1 as f32 + 0.5 + dy]
}

/// The numbers of a camera ray.
struct CameraPoint {
    index: u32,
    seed: [u32; 2],
}

impl WithScheme for CameraPoint {
    type Output = [f32; 4];

    fn run<S: Scheme>(self) -> [f32; 4] {
        S::sample_4d(self.index, self.seed, dims::CAMERA)
    }
}

/// Once camera rays are traced, their blocks are used again for rays that begin where they start.
#[inline(always)]
pub fn start_at_origin(blocks: &mut [RayHitBlock]) {
    for block in blocks {
        block.ray.tnear = [0.0; LANES];
    }
}

/// A camera sample of a chunk, advanced without divisions.
struct Cursor {
    pixel: usize,
    sample: usize,
}

impl Cursor {
    #[inline(always)]
    fn advance(&mut self, samples: usize) {
        self.sample += 1;
        if self.sample == samples {
            (self.sample, self.pixel) = (0, self.pixel + 1);
        }
    }
}
