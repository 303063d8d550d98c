//! Motion on the film over the shutter: how far what a camera ray meets as the shutter opens goes until it closes,
//! pixels to the right and upwards. A point of a surface stays at its place on its triangle; the camera is where it is
//! at either end. 0 for what is not before the camera at one of them.

use glam::{Vec2, Vec3};

use super::job::Job;
use super::shutter;
use crate::backend::batch::Hit;
use crate::camera::CameraRays;
use crate::shading::interaction::Interaction;

/// Middle of the lens.
const MIDDLE: [f32; 2] = [0.5; 2];

/// Of the point that a ray hits.
pub fn of_surface(job: &Job, hit: &Hit) -> Vec2 {
    over_shutter(job, |camera, time| {
        let at = Interaction::at(job.world.geometry, &Hit { time, ..*hit }, false);
        camera.sight(at.p, MIDDLE).map(|sight| sight.film)
    })
}

/// Of what is infinitely far off in a direction.
pub fn of_infinity(job: &Job, dir: Vec3) -> Vec2 {
    over_shutter(job, |camera, _| camera.vanishing_point(dir))
}

fn over_shutter(job: &Job, film: impl Fn(&CameraRays, f32) -> Option<Vec2>) -> Vec2 {
    let at = |time| film(&shutter::camera(job, time), time);
    let (Some(open), Some(close)) = (at(0.0), at(1.0)) else { return Vec2::ZERO };
    // Rows count downwards.
    Vec2::new(close.x - open.x, open.y - close.y)
}
