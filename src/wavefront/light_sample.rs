//! Light samples for sixteen receivers. One area light is sampled in columns; lights that have to be chosen, and other
//! kinds, lane by lane: the numbers are those of [`Lights::sample`](crate::shading::light::Lights::sample).

use super::columns::{Lane, Lane3, Mask, ZERO, ZERO3, bits, get, set};
use super::{Context, emission};
use crate::backend::batch::LANES;
use crate::shading::light::environment::EnvironmentLight;

/// A light sample for each lane.
#[repr(C, align(64))]
pub struct LightLanes {
    /// Unit directions from the receivers.
    pub wi: Lane3,
    /// Radiance that arrives; intensity/d² or irradiance of delta lights.
    pub radiance: Lane3,
    /// Density of choice and direction together, sr⁻¹; 0 where there is no sample.
    pub pdf_sa: Lane,
    /// Points on the lights.
    pub target: Lane3,
    /// Their unit normals; 0 for punctual lights.
    pub normal: Lane3,
    /// Error bounds of `target`, metres.
    pub error: Lane,
    /// 1 where the light is at infinity.
    pub infinite: Mask,
    /// 0 for delta lights, which BSDF sampling cannot find, else 1.
    pub shared: Lane,
}

impl LightLanes {
    /// Draws a light and a point on it for the lanes of `active`, by the first three numbers of `u`. Receivers are where
    /// rays will start; `n` are their shading normals.
    #[inline(always)]
    pub fn sample(context: &Context, active: &Mask, receiver: &Lane3, n: &Lane3, u: &[Lane; 4]) -> Self {
        let mut light = LightLanes {
            wi: [ZERO, ZERO, [1.0; LANES]],
            radiance: ZERO3,
            pdf_sa: ZERO,
            target: ZERO3,
            normal: ZERO3,
            error: ZERO,
            infinite: [0; LANES],
            shared: [1.0; LANES],
        };
        if let Some((area, radiance)) = context.only_area {
            for i in 0..LANES {
                let point = area.point(get(receiver, i), [u[1][i], u[2][i]]);
                // A density that overflows is no sample, as in the scalar form.
                light.pdf_sa[i] = if point.pdf_sa < f32::INFINITY { point.pdf_sa } else { 0.0 };
                set(&mut light.wi, i, point.wi);
                set(&mut light.radiance, i, radiance);
                set(&mut light.target, i, point.position);
                set(&mut light.normal, i, point.normal);
                light.error[i] = point.error;
            }
        } else if let Some(environment) = context.lights.only_environment() {
            light.draw_environment(environment, active, u);
        } else {
            for i in 0..LANES {
                if active[i] != 0 {
                    light.choose(context, i, receiver, n, u);
                }
            }
        }
        light
    }

    #[inline(always)]
    fn draw_environment(&mut self, environment: &EnvironmentLight, active: &Mask, u: &[Lane; 4]) {
        // Idle lanes all draw the same: their numbers may be none.
        let (mut across, mut along) = (ZERO, ZERO);
        for i in 0..LANES {
            across[i] = if active[i] != 0 { u[1][i] } else { 0.0 };
            along[i] = if active[i] != 0 { u[2][i] } else { 0.0 };
        }
        let drawn = environment.draw(&across, &along);
        for i in 0..LANES {
            let usable = (active[i] != 0) & (drawn.pdf_sa[i] < f32::INFINITY);
            self.pdf_sa[i] = if usable { drawn.pdf_sa[i] } else { 0.0 };
        }
        self.wi = drawn.wi;
        self.radiance = environment.lookup(&drawn.points, bits(active));
        self.infinite = [1; LANES];
    }

    #[inline(always)]
    fn choose(&mut self, context: &Context, i: usize, receiver: &Lane3, n: &Lane3, u: &[Lane; 4]) {
        let chosen = context.lights.sample(get(receiver, i), get(n, i), [u[0][i], u[1][i], u[2][i]]);
        let Some(sample) = chosen else { return };
        let mut radiance = sample.radiance;
        if let Some(point) = sample.texture_point {
            radiance *= emission::texel(context, &point);
        }
        set(&mut self.wi, i, sample.wi);
        set(&mut self.radiance, i, radiance);
        self.pdf_sa[i] = sample.pdf_sa;
        self.shared[i] = if sample.delta { 0.0 } else { 1.0 };
        match sample.target {
            None => self.infinite[i] = 1,
            Some(target) => {
                set(&mut self.target, i, target.position);
                set(&mut self.normal, i, target.normal);
                self.error[i] = target.error;
            }
        }
    }
}
