//! After tracing: rays that left the scene meet the environment; the others are sorted by kind of kernel. Blocks full
//! of one kind are shaded where they lie; what is sparse goes through a queue.

use super::emission;
use super::estimator;
use super::kind::{KINDS, Kind};
use super::light_paths::ratio;
use super::media;
use super::origin;
use super::tape::{LANE, Tape};
use super::wave::{Path, Wave};
use super::world::World;
use crate::backend::batch::{INVALID_ID, LANES};
use crate::math::columns::{Column, ZERO, get};
use crate::math::lanes::lanes_of;
use crate::math::simd::prefetch::fetch;

/// Lanes of one kind above which a block is shaded where it lies, its other lanes idle: gathering a lane costs about as
/// much as shading it.
const DENSE: u32 = LANES as u32 / 2;

/// Adds the environment to the lanes that missed and sorts those that hit into `wave.dense` and `wave.queues`. `edge`
/// counts the edges of the path up to here (1: camera ray).
#[inline(always)]
pub fn run<T: Tape>(world: &World, wave: &mut Wave, edge: u32, tape: &mut T) {
    for queue in &mut wave.queues {
        queue.clear();
    }
    let environment = world.features.environment;
    // The stage may be forced where there is nothing to see.
    let visible = environment && world.lights.counts().environment > 0;
    for block in 0..wave.current.blocks() {
        let lanes = (wave.current.len - block * LANES).min(LANES);
        let hits = &wave.current.rays[block].hit;
        let mut hit = 0u16;
        for i in 0..LANES {
            hit |= u16::from(hits.geom[i] != INVALID_ID) << i;
        }
        let mut used = (0xFFFFu32 >> (LANES - lanes)) as u16;
        if world.features.scattering {
            used &= !wave.gone[block];
        }
        hit &= used;
        wave.dense[block] = sort(world, wave, block, hit);
        if edge == 1 {
            cover(wave, block, if visible { used } else { hit });
        }
        if environment {
            escape(world, wave, (block, used & !hit), edge, tape);
        }
    }
}

/// The lanes of `hit` that are shaded in place; the others enter the queue of their kind.
#[inline(always)]
fn sort(world: &World, wave: &mut Wave, block: usize, hit: u16) -> (Kind, u16) {
    let hits = &wave.current.rays[block].hit;
    let mut of_kind = [0u16; KINDS];
    match world.only_kind {
        Some(kind) => of_kind[kind as usize] = hit,
        None => {
            for i in lanes_of(hit) {
                let triangle = world.geometry.triangle(hits.geom[i], hits.prim[i]);
                let material = world.geometry.material(hits.inst[i], triangle);
                of_kind[world.kinds[material as usize] as usize] |= 1 << i;
                let normals = world.geometry.normals.as_ptr().wrapping_add(triangle.attributes as usize);
                fetch::<1>(normals.cast());
            }
        }
    }
    let first = (block * LANES) as u32;
    let mut dense = (Kind::Lambert, 0);
    for kind in Kind::ALL {
        let lanes = of_kind[kind as usize];
        if lanes.count_ones() > DENSE {
            dense = (kind, lanes);
        } else {
            wave.queues[kind as usize].extend(lanes_of(lanes).map(|i| first + i as u32));
        }
    }
    dense
}

#[inline(always)]
fn cover(wave: &mut Wave, block: usize, seen: u16) {
    for i in lanes_of(seen) {
        wave.sums.gathered[wave.current.paths[block].slot[i] as usize].coverage = 1.0;
    }
}

/// Radiance of the environment for the lanes that left the scene.
#[inline(always)]
fn escape<T: Tape>(world: &World, wave: &mut Wave, (block, missed): (usize, u16), edge: u32, tape: &mut T) {
    let Some(light) = world.lights.environment().filter(|_| missed != 0) else { return };
    let (ray, paths) = (&wave.current.rays[block].ray, &wave.current.paths[block]);
    let points = light.map_points(&[ray.dir_x, ray.dir_y, ray.dir_z]);
    let mut light_pdf = ZERO;
    if world.samples_lights() {
        light_pdf = light.pdfs(&points, missed);
        for i in lanes_of(missed) {
            light_pdf[i] *= world.lights.p_environment(ray.org(i), get(&paths.last_n, i));
        }
    }
    let radiance = light.lookup(&points, missed);
    for i in lanes_of(missed) {
        let mut weight = estimator::emission_weight(world.strategy, paths.last_pdf_sa[i], light_pdf[i]);
        if world.features.light_paths {
            let (ratio, densities) = (wave.ratios[paths.slot[i] as usize], [paths.last_pdf_sa[i], light_pdf[i]]);
            let shared = ratio::weight_of_environment(world, (ray.org(i), ray.dir(i)), (ratio, densities));
            weight = shared.unwrap_or(weight);
        }
        let mut arrives = get(&radiance, i);
        if world.features.media {
            arrives *= media::left_to_infinity(world, &wave.media[paths.slot[i] as usize]);
        }
        if weight > 0.0 {
            let origin = || origin::of_environment(world);
            wave.sums.add(paths.slot[i], edge, origin, get(&paths.beta, i) * arrives * weight);
        }
        if T::ON && i == LANE {
            let path = Path::get(paths, i);
            tape.note(|| emission::told(path.beta, arrives, &path, [light_pdf[i], weight]));
        }
    }
}
