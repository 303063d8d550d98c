//! The time of a path: one number for each camera sample, a fraction of the shutter in [0, 1), by which every ray of
//! the path is traced and every hit is shaded. Drawn from its own dimension, so that it is independent of the rest of
//! the sample, and kept by camera sample, which a path is for life: nothing has to be moved with the paths.
//!
//! Runs only where something moves; elsewhere no ray has a time. Cameras move along straight lines between their steps
//! as well.

use super::job::Job;
use super::wave::{PathBlock, Paths, Shadows};
use crate::backend::batch::{LANES, RayBlock};
use crate::camera::CameraRays;
use crate::math::columns::Lane;
use crate::sampler::{Scheme, dims};
use crate::scene::motion::part_of;

/// Times of sixteen camera samples.
#[inline(always)]
pub fn draw<S: Scheme>(path: &PathBlock) -> Lane {
    let mut time = [0.0; LANES];
    for i in 0..LANES {
        time[i] = S::sample_4d(path.index[i], [path.seed_lo[i], path.seed_hi[i]], dims::TIME)[0];
    }
    time
}

/// The camera at `time`.
#[inline(always)]
pub fn camera(job: &Job, time: f32) -> CameraRays {
    match job.camera_steps {
        [] | [_] => *job.camera,
        steps => {
            let (part, fraction) = part_of(time, steps.len() - 1);
            steps[part].towards(&steps[part + 1], fraction)
        }
    }
}

/// Gives the rays of a block the times of their camera samples. Lanes that are not in use may get any.
#[inline(always)]
pub fn stamp(times: &[f32], slots: &[u32; LANES], ray: &mut RayBlock) {
    for i in 0..LANES {
        ray.time[i] = times[slots[i] as usize];
    }
}

/// The same for all paths of a wave.
#[inline(always)]
pub fn stamp_paths(times: &[f32], paths: &mut Paths) {
    let blocks = paths.blocks();
    for (rays, path) in paths.rays[..blocks].iter_mut().zip(&paths.paths) {
        stamp(times, &path.slot, &mut rays.ray);
    }
}

/// The same for all shadow rays of a wave.
#[inline(always)]
pub fn stamp_shadows(times: &[f32], shadows: &mut Shadows) {
    let blocks = shadows.blocks();
    for (ray, carried) in shadows.rays[..blocks].iter_mut().zip(&shadows.carried) {
        stamp(times, &carried.slot, ray);
    }
}
