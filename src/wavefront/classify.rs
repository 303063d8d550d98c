//! After tracing: rays that left the scene meet the environment; the others are sorted into one queue per kind of kernel.

use super::Context;
use super::estimator;
use super::state::Wave;
use crate::backend::batch::{INVALID_ID, LANES};

/// Adds the environment to the lanes that missed and fills the queues with those that hit. `edge` counts the edges of
/// the path up to here (1: camera ray).
#[inline(always)]
pub fn run(context: &Context, wave: &mut Wave, edge: u32) {
    for queue in &mut wave.queues {
        queue.clear();
    }
    let environment = context.plan.features.environment;
    for lane in 0..wave.current.len {
        let (block, i) = (lane / LANES, lane % LANES);
        let hits = &wave.current.rays[block].hit;
        if hits.geom[i] != INVALID_ID {
            let material = context.geometry.triangle(hits.geom[i], hits.prim[i]).material;
            wave.queues[context.kinds[material as usize] as usize].push(lane as u32);
            if edge == 1 {
                wave.gathered[wave.current.paths[block].slot[i] as usize].coverage = 1.0;
            }
        } else if environment {
            let ray = &wave.current.rays[block].ray;
            let path = wave.current.paths[block].get(i);
            let dir = ray.dir(i);
            let light_pdf = if path.last_pdf_sa < f32::INFINITY && context.plan.samples_lights() {
                context.lights.pdf_environment(dir, ray.org(i), path.last_n)
            } else {
                0.0
            };
            let weight = estimator::emission_weight(context.plan.strategy, path.last_pdf_sa, light_pdf);
            // Inside an absorbing solid the way to infinity absorbs everything.
            let absorbed = context.absorbs_fully(path.medium);
            if weight > 0.0 && !absorbed {
                wave.add(path.slot, edge, path.beta * context.lights.environment_radiance(dir) * weight);
            }
            if edge == 1 {
                wave.gathered[path.slot as usize].coverage = 1.0;
            }
        }
    }
}
