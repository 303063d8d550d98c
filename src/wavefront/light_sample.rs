//! Light samples for sixteen receivers. One area light is sampled in columns; where lights have to be chosen, the choice and
//! the points on emissive surfaces are; other kinds go lane by lane. The numbers are those of
//! [`Lights::sample`](crate::shading::light::Lights::sample).

use super::choose::{self, Chosen};
use super::columns::{Lane, Lane3, Mask, ZERO, ZERO3, bits, get, set, spread};
use super::isa::Isa;
use super::{Context, emission};
use crate::backend::batch::LANES;
use crate::math::lanes::lanes_of;
use crate::shading::light::area::AreaLight;
use crate::shading::light::environment::EnvironmentLight;
use crate::shading::light::select::ByReceiver;
use crate::shading::light::tree::Receivers;
use crate::shading::light::{self, LightSample};

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
    pub fn sample<I: Isa>(context: &Context, active: &Mask, receiver: &Lane3, n: &Lane3, u: &[Lane; 4]) -> Self {
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
        } else if let Some(by_receiver) = context.lights.by_receiver() {
            light.choose::<I>(context, by_receiver, active, (receiver, n), u);
        } else {
            for i in (0..LANES).filter(|&i| active[i] != 0) {
                let chosen = context.lights.sample(get(receiver, i), get(n, i), [u[0][i], u[1][i], u[2][i]]);
                light.put(context, i, chosen);
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

    /// Chooses lights, then draws points: on the emissive surfaces among them in columns.
    #[inline(always)]
    fn choose<I: Isa>(
        &mut self,
        context: &Context,
        by_receiver: &ByReceiver,
        active: &Mask,
        (receiver, n): (&Lane3, &Lane3),
        u: &[Lane; 4],
    ) {
        let mut refined = [0.0; LANES];
        for i in 0..LANES {
            refined[i] = light::refined([u[0][i], u[1][i], u[2][i]]);
        }
        let chosen = choose::choose::<I>(by_receiver, active, &Receivers::new(*receiver, *n), &refined);
        let areas = context.lights.areas();
        let (mut on_areas, mut elsewhere) = (0u16, 0u16);
        for i in lanes_of(bits(active)) {
            let found = chosen.p_select[i] > 0.0;
            let area = (chosen.light[i] as usize) < areas.len();
            on_areas |= u16::from(found & area) << i;
            elsewhere |= u16::from(found & !area) << i;
        }
        if on_areas != 0 {
            self.draw_areas::<I>(context, &chosen, on_areas, receiver, u);
        }
        for i in lanes_of(elsewhere) {
            let sample = context.lights.sample_chosen(&chosen.get(i), get(receiver, i), [u[1][i], u[2][i]]);
            self.put(context, i, sample);
        }
    }

    /// Points on the chosen emissive surfaces of `drawn` (not empty).
    #[inline(always)]
    fn draw_areas<I: Isa>(&mut self, context: &Context, chosen: &Chosen, drawn: u16, receiver: &Lane3, u: &[Lane; 4]) {
        let areas = context.lights.areas();
        let lead = drawn.trailing_zeros() as usize % LANES;
        let rows = std::array::from_fn(|i| {
            let lane = if drawn >> i & 1 == 1 { i } else { lead };
            bytemuck::cast_ref(&areas[chosen.light[lane] as usize])
        });
        let columns = I::transpose(rows);
        let drawn_lanes = spread(drawn);
        let mut weights = [ZERO; 2];
        for i in 0..LANES {
            let point = AreaLight::of_column(&columns, i).point(get(receiver, i), [u[1][i], u[2][i]]);
            let pdf_sa = point.pdf_sa * chosen.p_select[i];
            let usable = (drawn_lanes[i] != 0) & (point.pdf_sa > 0.0) & (pdf_sa < f32::INFINITY);
            self.pdf_sa[i] = if usable { pdf_sa } else { 0.0 };
            set(&mut self.wi, i, point.wi);
            set(&mut self.target, i, point.position);
            set(&mut self.normal, i, point.normal);
            self.error[i] = point.error;
            weights[0][i] = point.barycentric[0];
            weights[1][i] = point.barycentric[1];
        }
        for i in lanes_of(drawn) {
            let light = &areas[chosen.light[i] as usize];
            let emission = context.lights.emission(light.material());
            let mut radiance = emission.radiance();
            if emission.is_textured() && self.pdf_sa[i] > 0.0 {
                radiance *= emission::texel(context, &light.texture_point([weights[0][i], weights[1][i]]));
            }
            set(&mut self.radiance, i, radiance);
        }
    }

    /// A sample that came by itself.
    #[inline(always)]
    fn put(&mut self, context: &Context, i: usize, sample: Option<LightSample>) {
        let Some(sample) = sample else { return };
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
