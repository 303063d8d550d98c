//! Next-event estimation: light samples for sixteen receivers, and their shadow rays. One area light is sampled in
//! columns; where lights have to be chosen, the choice and the points on emissive surfaces are; other kinds go lane by
//! lane. The numbers are those of [`Lights::sample`](crate::shading::light::Lights::sample).

use super::choose::{self, Chosen};
use super::departure;
use super::estimator;
use super::kernel::Scattered;
use super::material;
use super::media;
use super::parts::Origin;
use super::start::Start;
use super::tape::{Event, LANE, Tape};
use super::vertex::{self, Number, Shadow, triple};
use super::vertices::Vertices;
use super::wave::{PathBlock, RayLanes, ShadowBlock, Shadows};
use super::world::World;
use crate::backend::batch::{LANES, RayHitBlock};
use crate::math::columns::{Lane, Lane3, Mask, ZERO, ZERO3, bits, get, set, spread};
use crate::math::float;
use crate::math::lanes::lanes_of;
use crate::math::simd::isa::Isa;
use crate::plan::options::{Heuristic, Strategy, Techniques};
use crate::shading::light::area::AreaLight;
use crate::shading::light::environment::EnvironmentLight;
use crate::shading::light::select::ByReceiver;
use crate::shading::light::tree::Receivers;
use crate::shading::light::{self, LightSample};
use crate::shading::medium::{Boundary, Media};
use crate::shading::mis;
use glam::Vec3;

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
    /// Their numbers.
    pub number: [u32; LANES],
    /// 1 where the light is at infinity.
    pub infinite: Mask,
    /// 0 for delta lights, which BSDF sampling cannot find, else 1.
    pub shared: Lane,
}

/// Where the light samples of a block arrive.
pub struct Samples<'a> {
    /// Receiving surfaces.
    pub vertices: &'a Vertices,
    /// What they scatter of light from the sampled directions.
    pub scattered: &'a Scattered,
    /// Lanes for which there is a sample.
    pub lit: &'a Mask,
    /// The paths, and how they came there.
    pub from: (&'a RayHitBlock, &'a PathBlock),
    /// Their lights, where layers tell these apart.
    pub origins: Option<[Origin; LANES]>,
}

impl LightLanes {
    /// Draws a light and a point on it for the lanes of `active`, by the first three numbers of `u`. Receivers are
    /// where rays will start; `n` are their shading normals.
    #[inline(always)]
    pub fn sample<I: Isa>(world: &World, active: &Mask, receiver: &Lane3, n: &Lane3, u: &[Lane; 4]) -> Self {
        let mut light = LightLanes {
            wi: [ZERO, ZERO, [1.0; LANES]],
            radiance: ZERO3,
            pdf_sa: ZERO,
            target: ZERO3,
            normal: ZERO3,
            error: ZERO,
            number: [0; LANES],
            infinite: [0; LANES],
            shared: [1.0; LANES],
        };
        if let Some((area, radiance)) = world.only_area {
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
        } else if let Some(environment) = world.lights.only_environment() {
            light.draw_environment((world.lights.environment_number(), environment), active, u);
        } else if let Some(by_receiver) = world.lights.by_receiver() {
            light.choose::<I>(world, by_receiver, active, (receiver, n), u);
        } else {
            for i in (0..LANES).filter(|&i| active[i] != 0) {
                let chosen = world.lights.sample(get(receiver, i), get(n, i), [u[0][i], u[1][i], u[2][i]]);
                light.put(world, i, chosen);
            }
        }
        light
    }

    /// Next-event estimation: appends the shadow rays that could carry something.
    #[inline(always)]
    pub fn shadow_rays<I: Isa, T: Tape>(
        &mut self,
        world: &World,
        samples: &Samples,
        (shadows, media): (&mut Shadows, (&[Media], &[Option<Boundary>])),
        tape: &mut T,
    ) {
        let told = T::ON && samples.lit[LANE] != 0 && self.pdf_sa[LANE] > 0.0;
        let emitted = get(&self.radiance, LANE);
        // The heuristic is chosen once, outside the loop. A delta light counts as one that the BSDF never finds.
        let Strategy { heuristic, techniques } = world.strategy;
        match (techniques, heuristic) {
            (Techniques { light: false, .. }, _) => return,
            (Techniques { bsdf: false, .. }, _) => self.weigh(samples, |_, _| 1.0),
            (_, Heuristic::Power) => self.weigh(samples, mis::power_weight),
            (_, Heuristic::Balance) => self.weigh(samples, mis::balance_weight),
        }
        let vertices = samples.vertices;
        let (mut rays, mut tfar) = (RayLanes { org: ZERO3, dir: ZERO3 }, ZERO);
        let mut keep: Mask = [0; LANES];
        for i in 0..LANES {
            let wi = get(&self.wi, i);
            let origin = float::spawn_origin(get(&vertices.p, i), get(&vertices.n_g, i), vertices.error[i], wi);
            let segment = float::segment_to(origin, get(&self.target, i), get(&self.normal, i), self.error[i]);
            let finite = self.infinite[i] == 0;
            set(&mut rays.org, i, origin);
            rays.dir[0][i] = if finite { segment.dir.x } else { wi.x };
            rays.dir[1][i] = if finite { segment.dir.y } else { wi.y };
            rays.dir[2][i] = if finite { segment.dir.z } else { wi.z };
            let end = if finite { segment.tfar } else { f32::MAX };
            let carried = self.radiance[0][i].max(self.radiance[1][i]).max(self.radiance[2][i]);
            keep[i] = u32::from(end > 0.0) & u32::from(end < f32::INFINITY) & u32::from(carried > 0.0);
            tfar[i] = if finite { end } else { f32::INFINITY };
        }
        if world.features.exact_starts {
            self.start_at_vertices(world, samples, (&mut rays, &mut tfar, &mut keep), &mut shadows.starts);
        }
        if world.features.boundaries {
            let lanes = (&rays.dir, bits(&keep));
            media::start_shadows(world, vertices, samples.from, lanes, media, &mut shadows.media);
        } else if world.features.media {
            media::attenuate(world, vertices, samples.from, (&rays.dir, &tfar), media, &mut self.radiance);
        }
        if told {
            tape.note(|| self.told(world, samples, emitted, keep[LANE] != 0));
        }
        if let Some(origins) = &samples.origins {
            shadows.origins.extend(lanes_of(bits(&keep)).map(|i| origins[i]));
        }
        let light = ShadowBlock { radiance: self.radiance, slot: samples.from.1.slot };
        shadows.append::<I>(&rays, &tfar, &light, bits(&keep));
    }

    /// The shadow rays of the lanes `keep` start exactly where they leave surfaces: see [`departure`].
    #[inline(never)]
    fn start_at_vertices(
        &self,
        world: &World,
        samples: &Samples,
        (rays, tfar, keep): (&mut RayLanes, &mut Lane, &mut Mask),
        starts: &mut Vec<Start>,
    ) {
        for i in lanes_of(bits(keep)) {
            let start = departure::start(world, samples.vertices, samples.from.0, (i, get(&rays.dir, i)));
            set(&mut rays.org, i, start.p);
            if self.infinite[i] == 0 {
                let target = (get(&self.target, i), get(&self.normal, i), self.error[i]);
                let Some(segment) = float::shadow_segment(start.p, target.0, target.1, target.2) else {
                    keep[i] = 0;
                    continue;
                };
                set(&mut rays.dir, i, segment.dir);
                tfar[i] = segment.tfar;
            }
            starts.push(start);
        }
    }

    /// Turns the radiance of each light sample into what its shadow ray carries; 0 where nothing can arrive.
    #[inline(always)]
    fn weigh(&mut self, samples: &Samples, heuristic: impl Fn(f32, f32) -> f32) {
        let Samples { vertices, scattered, lit, .. } = samples;
        for i in 0..LANES {
            let weight = heuristic(self.pdf_sa[i], scattered.pdf_sa[i] * self.shared[i]);
            let usable = (self.pdf_sa[i] > 0.0) & (lit[i] != 0);
            let factor = if usable { weight / self.pdf_sa[i] } else { 0.0 };
            for c in 0..3 {
                self.radiance[c][i] = vertices.beta[c][i] * scattered.f_cos[c][i] * self.radiance[c][i] * factor;
            }
        }
    }

    fn told(&self, world: &World, samples: &Samples, emitted: Vec3, traced: bool) -> Event {
        let Samples { vertices, scattered, .. } = samples;
        let (light_pdf, delta) = (self.pdf_sa[LANE], self.shared[LANE] == 0.0);
        let bsdf_pdf = scattered.pdf_sa[LANE] * self.shared[LANE];
        let distance = get(&self.target, LANE).distance(get(&vertices.receivers(), LANE));
        Event::Light(vertex::LightSample {
            wi: triple(get(&self.wi, LANE)),
            distance_m: (self.infinite[LANE] == 0).then_some(Number(distance)),
            radiance: triple(emitted),
            light_pdf_sa: Number(light_pdf),
            bsdf_pdf_sa: Number(bsdf_pdf),
            f_cos: triple(get(&scattered.f_cos, LANE)),
            mis_weight: Number(estimator::light_weight(world.strategy, light_pdf, bsdf_pdf, delta)),
            contribution: triple(get(&self.radiance, LANE)),
            outcome: if traced { Shadow::Visible } else { Shadow::NotTraced },
        })
    }

    #[inline(always)]
    fn draw_environment(&mut self, (number, environment): (u32, &EnvironmentLight), active: &Mask, u: &[Lane; 4]) {
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
        self.number = [number; LANES];
        self.wi = drawn.wi;
        self.radiance = environment.lookup(&drawn.points, bits(active));
        self.infinite = [1; LANES];
    }

    /// Chooses lights, then draws points: on the emissive surfaces among them in columns.
    #[inline(always)]
    fn choose<I: Isa>(
        &mut self,
        world: &World,
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
        let areas = world.lights.areas();
        let (mut on_areas, mut elsewhere) = (0u16, 0u16);
        for i in lanes_of(bits(active)) {
            let found = chosen.p_select[i] > 0.0;
            let area = (chosen.light[i] as usize) < areas.len();
            on_areas |= u16::from(found & area) << i;
            elsewhere |= u16::from(found & !area) << i;
        }
        if on_areas != 0 {
            self.draw_areas::<I>(world, &chosen, on_areas, receiver, u);
        }
        self.number = chosen.light;
        for i in lanes_of(elsewhere) {
            let sample = world.lights.sample_chosen(&chosen.get(i), get(receiver, i), [u[1][i], u[2][i]]);
            self.put(world, i, sample);
        }
    }

    /// Points on the chosen emissive surfaces of `drawn` (not empty).
    #[inline(always)]
    fn draw_areas<I: Isa>(&mut self, world: &World, chosen: &Chosen, drawn: u16, receiver: &Lane3, u: &[Lane; 4]) {
        let areas = world.lights.areas();
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
            let emission = world.lights.emission(light.material());
            let mut radiance = emission.radiance();
            if emission.is_textured() && self.pdf_sa[i] > 0.0 {
                radiance *= material::emission_texel(world, &light.texture_point([weights[0][i], weights[1][i]]));
            }
            set(&mut self.radiance, i, radiance);
        }
    }

    /// Scatters one scalar sample into its lane.
    #[inline(always)]
    fn put(&mut self, world: &World, i: usize, sample: Option<LightSample>) {
        let Some(sample) = sample else { return };
        self.number[i] = sample.light;
        let mut radiance = sample.radiance;
        if let Some(point) = sample.texture_point {
            radiance *= material::emission_texel(world, &point);
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
