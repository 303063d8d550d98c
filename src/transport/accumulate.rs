//! Last stages: unblocked shadow rays add what they carry; finished camera samples enter the layers.

use super::counters::{Counters, NonFinite};
use super::raygen::Chunk;
use super::wave::Wave;
use crate::backend::batch::{BLOCKED, LANES};
use crate::film::Pixel;
use crate::film::layer::bounces::LENGTHS;
use crate::film::pairwise;
use crate::film::store::Plane;
use crate::math::columns::get;
use crate::plan::aov::Gathers;

/// Adds the radiance of every shadow ray that was not blocked; the path through the light has `edge` edges.
#[inline(always)]
pub fn shadows(wave: &mut Wave, edge: u32) {
    let Wave { shadows, sums, .. } = wave;
    let mut left = shadows.len;
    for (rays, carried) in shadows.rays.iter().zip(&shadows.carried) {
        for i in 0..left.min(LANES) {
            if rays.tfar[i] != BLOCKED {
                sums.add(carried.slot[i], edge, get(&carried.radiance, i));
            }
        }
        left = left.saturating_sub(LANES);
        if left == 0 {
            break;
        }
    }
}

/// Writes the sum in pairs of the chunk's samples to `pixels` (one per pixel of the chunk), in f64. A sample that is
/// not finite enters as 0 and is counted and located.
#[inline(always)]
pub fn samples(chunk: &Chunk, wave: &Wave, pixels: &mut [Pixel], counters: &mut Counters) {
    for (p, pixel) in pixels.iter_mut().enumerate() {
        for half in 0..2 {
            // Its samples are every other one, from the first with its parity on.
            let first = (chunk.first_sample as usize ^ half) & 1;
            let n = (chunk.samples + 1 - first) / 2;
            let sum = pairwise::sum(n, |i| {
                let s = first + 2 * i;
                let gathered = &wave.sums.gathered[p * chunk.samples + s];
                let mut rgb = gathered.radiance;
                if !rgb.iter().all(|c| c.is_finite()) {
                    note_nonfinite(chunk, (p, s), counters);
                    rgb = [0.0; 3];
                }
                let weight = f64::from(gathered.weight);
                [rgb[0], rgb[1], rgb[2], gathered.coverage].map(|value| weight * f64::from(value))
            });
            pixel.set_sum(half, sum, n as u64);
        }
    }
}

/// Counts and locates sample `s` of pixel `p` of the chunk.
#[cold]
#[inline(never)]
fn note_nonfinite(chunk: &Chunk, (p, s): (usize, usize), counters: &mut Counters) {
    counters.nonfinite += 1;
    counters.list(NonFinite { pixel: chunk.pixels[p], sample: chunk.first_sample + s as u64, bounce: None });
}

/// Writes what the chunk's samples have gathered for the layers besides the beauty, in pairs, in f64 and weighted as
/// the beauty is. The chunk's pixels are those of `planes` from number `first` on.
pub fn layers(chunk: &Chunk, wave: &Wave, planes: &mut [Plane], first: usize) {
    let of_first_hit = |plane: &Plane| plane.layer.aov.gathers() == Gathers::FirstHit;
    let first_hits = planes.iter().filter(|plane| of_first_hit(plane)).count();
    let mut number = 0;
    for plane in planes {
        match plane.layer.aov.gathers() {
            Gathers::PathLengths => path_lengths(chunk, wave, plane, first),
            Gathers::Edges { least, most } => edges(chunk, wave, plane, first, [least, most.min(LENGTHS - 1)]),
            Gathers::FirstHit => {
                add(chunk, wave, plane, first, |slot| &wave.sums.first_hits[slot * first_hits + number]);
                number += 1;
            }
            Gathers::Nothing | Gathers::Centre => {}
        }
    }
}

/// Writes the sums of `values` of the camera samples, times the filter's weight, to the pixels of `plane` from number
/// `first` on.
fn add<'w>(chunk: &Chunk, wave: &Wave, plane: &mut Plane, first: usize, values: impl Fn(usize) -> &'w [f32; 3]) {
    for p in 0..chunk.pixels.len() {
        let sum = pairwise::sum(chunk.samples, |s| {
            let slot = p * chunk.samples + s;
            let weight = f64::from(wave.sums.gathered[slot].weight);
            values(slot).map(|value| weight * f64::from(value))
        });
        plane.pixel_mut(first + p).copy_from_slice(&sum);
    }
}

/// [`add`] for the terms by path length, whose number is known: the loop is then straight vector code.
fn path_lengths(chunk: &Chunk, wave: &Wave, plane: &mut Plane, first: usize) {
    for p in 0..chunk.pixels.len() {
        let sum = pairwise::sum(chunk.samples, |s| {
            // What the film counts as 0 is 0 in every part of it.
            let slot = p * chunk.samples + s;
            let gathered = &wave.sums.gathered[slot];
            if !gathered.radiance.iter().all(|c| c.is_finite()) {
                return [0.0; TERMS];
            }
            let weight = f64::from(gathered.weight);
            let terms = wave.sums.per_length[slot].as_flattened();
            std::array::from_fn(|i| weight * f64::from(terms[i]))
        });
        plane.pixel_mut(first + p).copy_from_slice(&sum);
    }
}

/// [`path_lengths`] of some lengths together.
fn edges(chunk: &Chunk, wave: &Wave, plane: &mut Plane, first: usize, [least, most]: [usize; 2]) {
    for p in 0..chunk.pixels.len() {
        let sum = pairwise::sum(chunk.samples, |s| {
            let slot = p * chunk.samples + s;
            let gathered = &wave.sums.gathered[slot];
            if !gathered.radiance.iter().all(|c| c.is_finite()) {
                return [0.0; 3];
            }
            let weight = f64::from(gathered.weight);
            let terms = &wave.sums.per_length[slot][least..=most];
            std::array::from_fn(|c| weight * terms.iter().map(|term| f64::from(term[c])).sum::<f64>())
        });
        plane.pixel_mut(first + p).copy_from_slice(&sum);
    }
}

/// Values of a sample by path length and channel.
const TERMS: usize = 3 * LENGTHS;
