//! Last stages: unblocked shadow rays add what they carry; finished camera samples enter the pixels.

use super::raygen::Chunk;
use super::state::Wave;
use super::{Counters, NonFinite};
use crate::backend::batch::{BLOCKED, LANES};
use crate::film::Pixel;
use crate::film::lengths::LengthSums;
use glam::Vec3;

/// How many non-finite samples are kept by place.
pub const NONFINITE_LISTED: usize = 16;

/// Adds the radiance of every shadow ray that was not blocked; the path through the light has `edge` edges.
#[inline(always)]
pub fn shadows(wave: &mut Wave, edge: u32) {
    for lane in 0..wave.shadows.len {
        let (block, i) = (lane / LANES, lane % LANES);
        if wave.shadows.rays[block].tfar[i] != BLOCKED {
            let carried = &wave.shadows.carried[block];
            let radiance = Vec3::new(carried.radiance[0][i], carried.radiance[1][i], carried.radiance[2][i]);
            let slot = carried.slot[i];
            wave.add(slot, edge, radiance);
        }
    }
}

/// Adds the chunk's samples to `pixels` (one per pixel of the chunk) in ascending order of sample index, in f64. A
/// sample that is not finite enters as 0 and is counted and located.
#[inline(always)]
pub fn samples(chunk: &Chunk, wave: &Wave, pixels: &mut [Pixel], counters: &mut Counters) {
    for (p, pixel) in pixels.iter_mut().enumerate() {
        for s in 0..chunk.samples {
            let slot = p * chunk.samples + s;
            let gathered = &wave.sums.gathered[slot];
            let sample = chunk.first_sample + s as u64;
            let mut rgb = gathered.radiance;
            if !rgb.iter().all(|c| c.is_finite()) {
                counters.nonfinite += 1;
                counters.list(NonFinite { pixel: chunk.pixels[p], sample, bounce: None });
                rgb = [0.0; 3];
            }
            pixel.add((sample & 1) as usize, rgb, gathered.weight, gathered.coverage);
        }
    }
}

/// Adds the chunk's samples by path length. `place` gives a pixel's position in `lengths`.
pub fn by_length(chunk: &Chunk, wave: &Wave, lengths: &mut LengthSums, place: impl Fn((u32, u32)) -> usize) {
    for (p, &pixel) in chunk.pixels.iter().enumerate() {
        let at = place(pixel);
        for s in 0..chunk.samples {
            let slot = p * chunk.samples + s;
            // What the film counts as 0 is 0 in every part of it.
            if !wave.sums.gathered[slot].radiance.iter().all(|c| c.is_finite()) {
                continue;
            }
            let weight = wave.sums.gathered[slot].weight as f64;
            for (sum, term) in lengths.sums[at].iter_mut().zip(&wave.sums.per_length[slot]) {
                for c in 0..3 {
                    sum[c] += weight * term[c] as f64;
                }
            }
        }
        lengths.n[at] += chunk.samples as u64;
    }
}
