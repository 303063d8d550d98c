//! First stage: camera samples become paths. Consecutive lanes are samples of one pixel, then of its neighbour along a
//! Morton curve, so that packets of camera rays are coherent.

use super::Context;
use super::state::{Gathered, NO_MEDIUM, PathLane, Wave};
use crate::film::filter::FilterSample;
use crate::film::lengths::LENGTHS;
use crate::sampler::{self, Scheme, dims};

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

    /// Pixel and sample index of a slot.
    pub fn of_slot(&self, slot: usize) -> ((u32, u32), u64) {
        (self.pixels[slot / self.samples], self.first_sample + (slot % self.samples) as u64)
    }
}

/// Fills `wave.current` with the camera rays of `chunk` and resets what the samples gather.
#[inline(always)]
pub fn run<S: Scheme>(context: &Context, chunk: &Chunk, wave: &mut Wave) {
    wave.current.len = 0;
    for slot in 0..chunk.len() {
        let ((x, y), sample) = chunk.of_slot(slot);
        let address = sampler::address(sample);
        let pixel = x as u64 + y as u64 * context.plan.resolution.0 as u64;
        let seed = sampler::pixel_seed(context.plan.seed, pixel, address.half, address.high);
        let u = S::sample_4d(address.index, seed, dims::CAMERA);
        let FilterSample { dx, dy, weight } = context.filter.sample(u[0], u[1]);
        let (film_x, film_y) = (x as f32 + 0.5 + dx, y as f32 + 0.5 + dy);
        let (org, dir) = if context.plan.features.lens {
            context.camera.ray(film_x, film_y, [u[2], u[3]])
        } else {
            context.camera.pinhole_ray(film_x, film_y)
        };
        wave.sums.gathered[slot] = Gathered { radiance: [0.0; 3], coverage: 0.0, weight };
        let path = PathLane {
            beta: glam::Vec3::ONE,
            eta_scale: 1.0,
            last_n: glam::Vec3::ZERO,
            last_pdf_sa: f32::INFINITY,
            slot: slot as u32,
            seed,
            index: address.index,
            medium: NO_MEDIUM,
        };
        wave.current.push(&path, org, dir);
    }
    wave.sums.per_length.fill([[0.0; 3]; LENGTHS]);
}
