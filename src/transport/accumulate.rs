//! Last stages: unblocked shadow rays add what they carry; finished camera samples enter the layers.

use super::counters::{Counters, NonFinite};
use super::raygen::Chunk;
use super::wave::Wave;
use crate::backend::batch::{BLOCKED, LANES};
use crate::film::Pixel;
use crate::film::ids::Ids;
use crate::film::layer::bounces::LENGTHS;
use crate::film::pairwise;
use crate::film::store::Plane;
use crate::math::columns::get;
use crate::plan::aov::{Gathers, Guide, Lobes};

/// Adds the radiance of every shadow ray that was not blocked; the path through the light has `edge` edges.
#[inline(always)]
pub fn shadows(wave: &mut Wave, edge: u32) {
    let Wave { shadows, sums, .. } = wave;
    let mut left = shadows.len;
    for (block, (rays, carried)) in shadows.rays.iter().zip(&shadows.carried).enumerate() {
        for i in 0..left.min(LANES) {
            if rays.tfar[i] != BLOCKED {
                let origin = || shadows.origins.get(block * LANES + i).copied().unwrap_or_default();
                sums.add(carried.slot[i], edge, origin, get(&carried.radiance, i));
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
            Gathers::LightGroups => light_groups(chunk, wave, plane, first),
            Gathers::Scattered(kind) => scattered(chunk, wave, plane, first, kind),
            Gathers::FirstHit => {
                let met = |slot: usize| &wave.sums.first_hits[slot * first_hits + number];
                if plane.layer.is_of_ids() {
                    ids(chunk, wave, &mut plane.ids[first..], met);
                } else {
                    add(chunk, wave, plane, first, met);
                }
                number += 1;
            }
            Gathers::Followed(guide) => followed(chunk, wave, plane, first, guide),
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

/// [`add`] for what paths come to through mirrors and glass, by halves.
fn followed(chunk: &Chunk, wave: &Wave, plane: &mut Plane, first: usize, guide: Guide) {
    for p in 0..chunk.pixels.len() {
        for (half, kept) in plane.pixel_mut(first + p).as_chunks_mut::<3>().0.iter_mut().enumerate() {
            let skipped = (chunk.first_sample as usize ^ half) & 1;
            *kept = pairwise::sum((chunk.samples + 1 - skipped) / 2, |i| {
                let slot = p * chunk.samples + skipped + 2 * i;
                let weight = f64::from(wave.sums.gathered[slot].weight);
                wave.sums.followed[slot].of(guide).map(|value| weight * f64::from(value))
            });
        }
    }
}

/// Writes the ids of the chunk's samples to its pixels, the first of `lists`.
fn ids<'w>(chunk: &Chunk, wave: &Wave, lists: &mut [Ids], met: impl Fn(usize) -> &'w [f32; 3]) {
    for (p, list) in lists.iter_mut().enumerate().take(chunk.pixels.len()) {
        list.clear();
        for slot in p * chunk.samples..(p + 1) * chunk.samples {
            let sign = if wave.sums.gathered[slot].weight < 0.0 { -1 } else { 1 };
            list.add(met(slot)[0].to_bits(), sign);
        }
    }
}

/// [`add`] for parts of the radiance: what the film counts as 0 is 0 in every part of it.
fn share<const W: usize>(chunk: &Chunk, wave: &Wave, p: usize, part: impl Fn(usize) -> [f64; W]) -> [f64; W] {
    pairwise::sum(chunk.samples, |s| {
        let slot = p * chunk.samples + s;
        let gathered = &wave.sums.gathered[slot];
        if !gathered.radiance.iter().all(|c| c.is_finite()) {
            return [0.0; W];
        }
        let weight = f64::from(gathered.weight);
        part(slot).map(|value| weight * value)
    })
}

/// [`share`] by path length, whose number is known: the loop is then straight vector code.
fn path_lengths(chunk: &Chunk, wave: &Wave, plane: &mut Plane, first: usize) {
    let part = |slot: usize| -> [f64; TERMS] {
        let terms = wave.sums.parts.by_length(slot).as_flattened();
        std::array::from_fn(|i| f64::from(terms[i]))
    };
    for p in 0..chunk.pixels.len() {
        plane.pixel_mut(first + p).copy_from_slice(&share(chunk, wave, p, part));
    }
}

/// [`path_lengths`] of some lengths together.
fn edges(chunk: &Chunk, wave: &Wave, plane: &mut Plane, first: usize, [least, most]: [usize; 2]) {
    let part = |slot: usize| -> [f64; 3] {
        let terms = &wave.sums.parts.by_length(slot)[least..=most];
        std::array::from_fn(|c| terms.iter().map(|term| f64::from(term[c])).sum::<f64>())
    };
    for p in 0..chunk.pixels.len() {
        plane.pixel_mut(first + p).copy_from_slice(&share(chunk, wave, p, part));
    }
}

/// [`share`] by light group.
fn light_groups(chunk: &Chunk, wave: &Wave, plane: &mut Plane, first: usize) {
    for p in 0..chunk.pixels.len() {
        for (group, sum) in plane.pixel_mut(first + p).as_chunks_mut::<3>().0.iter_mut().enumerate() {
            *sum = share(chunk, wave, p, |slot| wave.sums.parts.by_group(slot)[group].map(f64::from));
        }
    }
}

/// [`share`] by kind of lobe at the first vertex.
fn scattered(chunk: &Chunk, wave: &Wave, plane: &mut Plane, first: usize, kind: Lobes) {
    let part = |slot: usize| wave.sums.parts.by_lobe(slot, kind).map(f64::from);
    for p in 0..chunk.pixels.len() {
        plane.pixel_mut(first + p).copy_from_slice(&share(chunk, wave, p, part));
    }
}

/// Values of a sample by path length and channel.
const TERMS: usize = 3 * LENGTHS;
