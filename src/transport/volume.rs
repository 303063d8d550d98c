//! Scattering on the way: participating media in solids, and fog. Run between tracing and classification, and only
//! where the plan has such media. Paths that collide before they meet a surface are handled here, lane by lane, as
//! shading handles the others: depth limit, roulette, a light sample, a new direction; they take no part in what
//! follows on their edge.
//!
//! Distances are exact: drawn in each stretch of one medium (`shading::scattering`), no steps, no majorants. Fog fills
//! the sphere that the plan gives it, where no solid is.

use glam::Vec3;

use super::counters::Counters;
use super::estimator;
use super::job::Job;
use super::material;
use super::media::{self, Stretch};
use super::origin;
use super::parts::First;
use super::start::Start;
use super::tape::{Event, LANE, Tape};
use super::vertex::{self, End, Number, triple};
use super::wave::{Path, PathBlock, ShadowLight, Wave};
use super::world::World;
use crate::backend::batch::{INVALID_ID, LANES};
use crate::math::columns::Column;
use crate::math::float;
use crate::plan::options::Roulette;
use crate::sampler::{Scheme, dims};
use crate::shading::light::LightSample;
use crate::shading::medium::Media;
use crate::shading::roulette;
use crate::shading::scattering::{Travel, phase, sample_phase};

/// Takes a path along a stretch, number `number` of its edge: multiplies what it carries; where it collided, metres
/// from its origin, if it did.
pub fn travel<S: Scheme>(
    world: &World,
    paths: &mut PathBlock,
    i: usize,
    stretch: &Stretch,
    (edge, number): (u32, u32),
) -> Option<f32> {
    let coefficients = media::coefficients(world, stretch.medium);
    if coefficients.sigma_t == Vec3::ZERO {
        return None;
    }
    let [from, to] = media::reach(world, stretch);
    let mut path = Path::get(paths, i);
    let u = S::sample_4d(path.index, [path.seed_lo, path.seed_hi], dims::medium(edge, number));
    let travel = coefficients.travel(path.beta, to - from, [u[0], u[1]]);
    let (weight, collides) = match travel {
        Travel::Through(weight) => (weight, None),
        Travel::Collides { distance_m, weight } => (weight, Some(from + distance_m)),
    };
    path.beta *= weight;
    Path::set(paths, i, path);
    collides
}

/// Everything that collides on edge `edge`.
pub fn run<S: Scheme, T: Tape>(job: &Job, wave: &mut Wave, edge: u32, counters: &mut Counters, tape: &mut T) {
    let world = &job.world;
    let mut ended = 0;
    wave.gone.clear();
    wave.gone.resize(wave.current.blocks(), 0);
    for lane in 0..wave.current.len {
        let (block, i) = (lane / LANES, lane % LANES);
        let (rays, paths) = (&mut wave.current.rays[block], &mut wave.current.paths[block]);
        let slot = paths.slot[i] as usize;
        let around = wave.media[slot];
        let before = wave.collisions.get(lane).copied().filter(|t| t.is_finite());
        let (org, dir) = (rays.ray.org(i), rays.ray.dir(i));
        let collision = before.or_else(|| {
            let end = if rays.hit.geom[i] == INVALID_ID { f32::INFINITY } else { rays.ray.tfar[i] };
            let stretch = Stretch { org, dir, medium: around.top(), between: [around.since_m, end] };
            travel::<S>(world, paths, i, &stretch, (edge, dims::LAST_STRETCH))
        });
        let Some(distance_m) = collision else { continue };
        wave.gone[block] |= 1 << i;
        (rays.hit.geom[i], rays.hit.inst[i]) = (INVALID_ID, INVALID_ID);
        if edge == 1 {
            wave.sums.gathered[slot].coverage = 1.0;
        }
        let at = Collision { lane, edge, p: org + dir * distance_m, dir, distance_m };
        ended += at.scatter::<S, T>(world, wave, tape);
    }
    counters.capped_paths += ended;
}

/// A path that collides.
struct Collision {
    lane: usize,
    edge: u32,
    p: Vec3,
    /// The way of the path so far.
    dir: Vec3,
    distance_m: f32,
}

impl Collision {
    fn scatter<S: Scheme, T: Tape>(&self, world: &World, wave: &mut Wave, tape: &mut T) -> u64 {
        let (lane, edge) = (self.lane, self.edge);
        let mut path = Path::get(&wave.current.paths[lane / LANES], lane % LANES);
        let told = T::ON && lane == LANE;
        let mut around = wave.media[path.slot as usize];
        around.since_m = 0.0;
        let medium = media::coefficients(world, around.top());
        if told {
            let name = media::material_of(world, around.top()).map_or("fog", |material| &material.name);
            let position = (self.p.as_dvec3() + world.scene.origin).into();
            let (distance_m, medium) = (Number(self.distance_m), name.to_string());
            tape.note(|| Event::Medium(vertex::Medium { distance_m, position_m: position, medium }));
        }
        if edge >= world.max_depth {
            wave.sums.truncated.add(path.beta * path.eta_scale);
            if told {
                tape.note(|| Event::End(Some(End::DepthLimit)));
            }
            return 1;
        }
        let seed = [path.seed_lo, path.seed_hi];
        let u_light = S::sample_4d(path.index, seed, dims::light(edge));
        let u_bsdf = S::sample_4d(path.index, seed, dims::bsdf(edge));
        let survival = match world.roulette {
            Roulette::Off => 1.0,
            Roulette::On => roulette::survival(path.beta, path.eta_scale, edge, world.roulette_start),
            Roulette::Constant(constant) => roulette::on_lattice(constant),
        };
        if told {
            let survived = u_light[3] < survival;
            let (survival, number) = (Number(survival), Number(u_light[3]));
            tape.note(|| Event::Roulette(vertex::Roulette { survival, number, survived }));
            tape.note(|| Event::End((!survived).then_some(End::Roulette)));
        }
        if world.roulette != Roulette::Off {
            if u_light[3] >= survival {
                return 0;
            }
            path.beta /= survival;
        }

        if world.features.lobes && edge == 1 {
            wave.sums.parts.scatter_first(path.slot, First::InMedium);
        }
        let u = [u_light[0], u_light[1], u_light[2]];
        if world.samples_lights()
            && let Some(light) = world.lights.sample(self.p, Vec3::ZERO, u)
        {
            let traced = self.sample_light(world, wave, (&path, &around, medium.g), &light, told.then_some(tape));
            if (world.features.light_groups | world.features.lobes) && traced {
                wave.shadows.origins.push(origin::of_sample(world, light.light));
            }
        }
        let (wi, pdf_sa) = sample_phase(medium.g, self.dir, [u_bsdf[1], u_bsdf[2]]);
        if world.features.footprints {
            let cone = &mut wave.cones[path.slot as usize];
            *cone = cone.scattered(cone.width_at(self.distance_m), pdf_sa);
        }
        if told {
            let scattering = vertex::Scattering {
                lobe: "phase function",
                alpha: Number(1.0),
                wi: triple(wi),
                pdf_sa: Number(pdf_sa),
                weight: triple(Vec3::ONE),
                eta: Number(1.0),
            };
            tape.note(|| Event::Scattering(scattering));
        }
        wave.media[path.slot as usize] = around;
        if let Some(start) = wave.starts.get_mut(path.slot as usize) {
            *start = Start::within(self.p, self.distance_m);
        }
        wave.next.push(self.p, wi, Path { last_pdf_sa: pdf_sa, last_n: Vec3::ZERO, ..path });
        0
    }

    /// Whether a shadow ray is to be traced.
    fn sample_light<T: Tape>(
        &self,
        world: &World,
        wave: &mut Wave,
        (path, around, g): (&Path, &Media, f32),
        light: &LightSample,
        tape: Option<&mut T>,
    ) -> bool {
        let mut emitted = light.radiance;
        if let Some(point) = light.texture_point {
            emitted *= material::emission_texel(world, &point);
        }
        let f = phase(g, self.dir.dot(light.wi));
        let bsdf_pdf = if light.delta { 0.0 } else { f };
        let weight = estimator::light_weight(world.strategy, light.pdf_sa, bsdf_pdf, light.delta);
        let mut radiance = path.beta * emitted * (f * weight / light.pdf_sa);
        let (dir, end) = match light.target {
            None => (light.wi, f32::INFINITY),
            Some(target) => {
                let segment = float::segment_to(self.p, target.position, target.normal, target.error);
                (segment.dir, segment.tfar)
            }
        };
        if !world.features.boundaries {
            let stretch = Stretch { org: self.p, dir, medium: around.top(), between: [0.0, end] };
            radiance *= media::left(world, &stretch);
        }
        let traced = radiance.max_element() > 0.0 && end > 0.0;
        if let Some(tape) = tape {
            let told = vertex::LightSample {
                wi: triple(light.wi),
                distance_m: light.target.map(|_| Number(end)),
                radiance: triple(emitted),
                light_pdf_sa: Number(light.pdf_sa),
                bsdf_pdf_sa: Number(bsdf_pdf),
                f_cos: triple(Vec3::splat(f)),
                mis_weight: Number(weight),
                contribution: triple(radiance),
                outcome: if traced { vertex::Shadow::Visible } else { vertex::Shadow::NotTraced },
            };
            tape.note(|| Event::Light(told));
        }
        if traced {
            if world.features.exact_starts {
                wave.shadows.starts.push(Start::within(self.p, self.distance_m));
            }
            wave.shadows.push((self.p, dir, end), ShadowLight { radiance, slot: path.slot });
            if world.features.boundaries {
                wave.shadows.media.push(*around);
            }
        }
        traced
    }
}
