//! One camera sample again, by the very loop, kernels and random numbers of the render, with every vertex written down.
//!
//! A wave of one path runs; between the stages a `Witness` reads its columns: rays, hits, throughput, shadow rays, sums.
//! What the columns do not hold (normals, densities, weights, the lobe) is computed again by the pure functions that the
//! kernels call, from the same numbers. [`Replay::told`] adds up what was written down, so that a story that no longer is the
//! kernels' shows: tests hold it against the sums, bit for bit.

use std::cell::{Cell, RefCell};

use glam::Vec3;
use serde::Serialize;

use super::columns::get;
use super::general::{Surfaces, consistent};
use super::isa::Baseline;
use super::observe::{Observer, Stage};
use super::raygen::Chunk;
use super::shade::Bsdfs;
use super::state::{PathLane, Wave};
use super::vertex::{
    Emission, End, LightSample, Met, Number, Roulette, Scattering, Shadow, Surface, Triple, Vertex, triple,
};
use super::vertices::Vertices;
use super::{Context, Counters, emission, estimator};
use crate::backend::batch::{BLOCKED, INVALID_ID, LANES, RayHitBlock, valid_lanes};
use crate::film::Pixel;
use crate::plan::options;
use crate::sampler::{self, IndependentScheme, SamplerKind, Scheme, SobolScheme, dims};
use crate::scene::Material;
use crate::shading::bsdf::BsdfSample;
use crate::shading::bsdf::dielectric::{Body, Dielectric};
use crate::shading::roulette;
use crate::shading::surface::Surface as Bsdf;

/// A camera sample and its path.
#[derive(Clone, Debug, Serialize)]
pub struct Replay {
    /// Pixel of the full image.
    pub pixel: [u32; 2],
    /// Sample index of the pixel.
    pub sample: u64,
    /// Where on the film the ray went through, pixels from the top left corner.
    pub film_position: [Number; 2],
    /// Signed weight of the pixel filter.
    pub filter_weight: Number,
    /// Time of the path, a fraction of the shutter; `None` where nothing moves.
    pub time: Option<Number>,
    /// The path.
    pub vertices: Vec<Vertex>,
    /// Radiance of the sample: the last vertex's `gathered`.
    pub radiance: Triple,
    /// 1 where the camera ray met something visible.
    pub coverage: Number,
    /// What the film adds for this sample: weight · (R, G, B, coverage); 0 in place of a radiance that is not finite.
    pub film: [f64; 4],
    /// Scatterings of the contribution with which the sum ceased to be finite; `None` for a finite sample.
    pub nonfinite_bounce: Option<u32>,
}

impl Replay {
    /// Sum of the contributions that the vertices list, in the order of the path. It has the bits of `radiance`.
    pub fn told(&self) -> [f32; 3] {
        let mut sum = Vec3::ZERO;
        for vertex in &self.vertices {
            let seen = vertex.emission.map(|emission| emission.contribution);
            let lit = vertex.light.filter(|light| light.outcome == Shadow::Visible).map(|light| light.contribution);
            for contribution in [seen, lit].into_iter().flatten() {
                sum += Vec3::from(contribution.map(|c| c.0));
            }
        }
        sum.into()
    }
}

/// Renders sample `sample` of `pixel` again and writes it down; `pixel` lies in the full image.
pub fn run(context: &Context, pixel: (u32, u32), sample: u64) -> Replay {
    let witness = Witness::new(context);
    let watched = Context { observer: Some(&witness), ..*context };
    let (film, wave) = single(&watched, pixel, sample);
    let gathered = &wave.sums.gathered[0];
    let vertices = witness.vertices.into_inner();
    Replay {
        pixel: [pixel.0, pixel.1],
        sample,
        film_position: film_position(context, pixel, sample),
        filter_weight: Number(gathered.weight),
        time: wave.times.first().copied().map(Number),
        vertices,
        radiance: triple(gathered.radiance),
        coverage: Number(gathered.coverage),
        film: film.sum[(sample & 1) as usize],
        nonfinite_bounce: witness.nonfinite.into_inner(),
    }
}

/// Scatterings of the contribution with which the sum of a sample ceases to be finite; `None` if it stays finite.
pub(crate) fn nonfinite_bounce(context: &Context, pixel: (u32, u32), sample: u64) -> Option<u32> {
    let gauge = Gauge(Cell::new(None));
    single(&Context { observer: Some(&gauge), ..*context }, pixel, sample);
    gauge.0.into_inner()
}

/// The loop over a wave of one path.
fn single(context: &Context, pixel: (u32, u32), sample: u64) -> (Pixel, Wave) {
    let mut wave = Wave::new(1, false);
    let chunk = Chunk { pixels: &[pixel], first_sample: sample, samples: 1 };
    let (mut film, mut counters) = ([Pixel::default()], Counters::default());
    match context.plan.sampler {
        SamplerKind::Sobol => super::run::<SobolScheme>(context, &chunk, &mut wave, &mut film, &mut counters),
        SamplerKind::Independent => {
            super::run::<IndependentScheme>(context, &chunk, &mut wave, &mut film, &mut counters)
        }
    }
    (film[0], wave)
}

/// Four numbers of the render's sampler.
fn random(context: &Context, path: &PathLane, set: u32) -> [f32; 4] {
    match context.plan.sampler {
        SamplerKind::Sobol => SobolScheme::sample_4d(path.index, path.seed, set),
        SamplerKind::Independent => IndependentScheme::sample_4d(path.index, path.seed, set),
    }
}

fn film_position(context: &Context, pixel: (u32, u32), sample: u64) -> [Number; 2] {
    let address = sampler::address(sample);
    let number = u64::from(pixel.0) + u64::from(pixel.1) * u64::from(context.plan.resolution.0);
    let seed = sampler::pixel_seed(context.plan.seed, number, address.half, address.high);
    let u = match context.plan.sampler {
        SamplerKind::Sobol => SobolScheme::sample_4d(address.index, seed, dims::CAMERA),
        SamplerKind::Independent => IndependentScheme::sample_4d(address.index, seed, dims::CAMERA),
    };
    let displaced = context.filter.sample(u[0], u[1]);
    [pixel.0 as f32 + 0.5 + displaced.dx, pixel.1 as f32 + 0.5 + displaced.dy].map(Number)
}

/// Looks at the sum alone.
struct Gauge(Cell<Option<u32>>);

impl Observer for Gauge {
    fn look(&self, stage: Stage, edge: u32, wave: &Wave) {
        if self.0.get().is_none() && !wave.sums.gathered[0].radiance.iter().all(|c| c.is_finite()) {
            self.0.set(Some(scatterings(stage, edge)));
        }
    }
}

/// Scatterings of the paths that entered the sum at this stage.
fn scatterings(stage: Stage, edge: u32) -> u32 {
    match stage {
        Stage::Shaded => edge - 1,
        Stage::Connected => edge,
    }
}

/// Writes the path down while it runs.
struct Witness<'c> {
    context: &'c Context<'c>,
    vertices: RefCell<Vec<Vertex>>,
    nonfinite: Cell<Option<u32>>,
}

impl Observer for Witness<'_> {
    fn look(&self, stage: Stage, edge: u32, wave: &Wave) {
        let radiance = wave.sums.gathered[0].radiance;
        if self.nonfinite.get().is_none() && !radiance.iter().all(|c| c.is_finite()) {
            self.nonfinite.set(Some(scatterings(stage, edge)));
        }
        let mut vertices = self.vertices.borrow_mut();
        match stage {
            Stage::Shaded => {
                let vertex = self.vertex(&wave.current.rays[0], wave.current.paths[0].get(0), edge, wave);
                vertices.push(vertex);
            }
            Stage::Connected => {
                let vertex = vertices.last_mut().expect("a wave is shaded before it is connected");
                vertex.gathered = triple(radiance);
                if let Some(light) = vertex.light.as_mut().filter(|light| light.outcome == Shadow::Visible) {
                    // What the kernels traced has the last word.
                    if wave.shadows.len == 0 {
                        light.outcome = Shadow::NotTraced;
                    } else if wave.shadows.rays[0].tfar[0] == BLOCKED {
                        light.outcome = Shadow::Blocked;
                    } else if self.context.plan.features.alpha {
                        // Surfaces on the way have taken their share.
                        light.contribution = triple(get(&wave.shadows.carried[0].radiance, 0));
                    }
                }
            }
        }
    }
}

impl<'c> Witness<'c> {
    fn new(context: &'c Context<'c>) -> Self {
        Witness { context, vertices: RefCell::new(Vec::new()), nonfinite: Cell::new(None) }
    }

    /// Position in the world as the file has it.
    fn world(&self, p: Vec3) -> [f64; 3] {
        (p.as_dvec3() + self.context.scene.origin).into()
    }

    /// Writes down the vertex at the end of the ray in lane 0. The order is that of `shade`.
    fn vertex(&self, rays: &RayHitBlock, path: PathLane, edge: u32, wave: &Wave) -> Vertex {
        let context = self.context;
        let (org, dir) = (rays.ray.org(0), rays.ray.dir(0));
        let mut told = Vertex {
            edge,
            origin_m: self.world(org),
            direction: triple(dir),
            throughput: triple(path.beta),
            met: Met::Infinity,
            emission: None,
            roulette: None,
            light: None,
            scattering: None,
            end: Some(End::LeftScene),
            gathered: triple(wave.sums.gathered[0].radiance),
        };
        match rays.hit(0) {
            None => {
                // `tfar` of a ray that was refused is as it was: infinite.
                if valid_lanes(&rays.ray, 1) == 0 {
                    told.end = Some(End::InvalidRay);
                }
                told.emission = self.environment(org, dir, &path);
            }
            Some(hit) => {
                let vertices = Vertices::gather::<Baseline>(context, rays, &wave.current.paths[0], 1);
                let mut surface = self.surface(&vertices, hit.t);
                (surface.mesh, surface.triangle) = (hit.geom, hit.prim);
                surface.instance = (hit.inst != INVALID_ID).then_some(hit.inst);
                self.shade(&mut told, &mut surface, vertices, rays, path);
                told.met = Met::Surface(surface);
                // What the kernels did has the last word.
                if wave.next.len > 0 {
                    told.end = None;
                }
            }
        }
        told
    }

    fn surface(&self, vertices: &Vertices, distance_m: f32) -> Surface {
        let side = vertices.side[0];
        Surface {
            distance_m: Number(distance_m),
            position_m: self.world(get(&vertices.p, 0)),
            error_m: Number(vertices.error[0]),
            normal_geometric: triple(vertices.front_n_g(0)),
            normal_shading: triple(get(&vertices.n_s, 0) * side),
            front: side > 0.0,
            material: self.context.scene.materials[vertices.material[0] as usize].name.clone(),
            kind: None,
            mesh: 0,
            triangle: 0,
            instance: None,
            transmittance: None,
        }
    }

    fn environment(&self, org: Vec3, dir: Vec3, path: &PathLane) -> Option<Emission> {
        let context = self.context;
        if !context.plan.features.environment {
            return None;
        }
        let seen = context.lights.environment_seen(dir, org, path.last_n);
        let light_pdf = if context.plan.samples_lights() { seen.pdf_sa } else { 0.0 };
        let weight = estimator::emission_weight(context.plan.strategy, path.last_pdf_sa, light_pdf);
        let weight = if context.absorbs_fully(path.medium) { 0.0 } else { weight };
        let added = weight > 0.0;
        let contribution = if added { path.beta * seen.radiance * weight } else { Vec3::ZERO };
        Some(Emission {
            radiance: triple(seen.radiance),
            bsdf_pdf_sa: Number(path.last_pdf_sa),
            light_pdf_sa: Number(light_pdf),
            mis_weight: Number(weight),
            contribution: triple(contribution),
        })
    }

    /// Everything that is decided at a surface. The general kernel tells the story, whichever kernel the render took: they give the
    /// same bits.
    fn shade(
        &self,
        told: &mut Vertex,
        surface: &mut Surface,
        mut vertices: Vertices,
        rays: &RayHitBlock,
        mut path: PathLane,
    ) {
        let context = self.context;
        let plan = context.plan;
        let material = &context.scene.materials[vertices.material[0] as usize];
        if plan.features.absorption {
            let front = vertices.side[0] > 0.0;
            let transmittance = emission::absorption(context, material, path.medium, front, rays.ray.tfar[0]);
            path.beta *= transmittance;
            surface.transmittance = (transmittance != Vec3::ONE).then(|| triple(transmittance));
        }
        told.emission = self.emission(material, &vertices, rays, &path);
        if material.unlit {
            (surface.kind, told.end) = (Some("unlit"), Some(End::Unlit));
            return;
        }
        if told.edge >= plan.max_depth {
            told.end = Some(End::DepthLimit);
            return;
        }

        let u_light = random(context, &path, dims::light(told.edge));
        let survival = match plan.roulette {
            options::Roulette::Off => 1.0,
            options::Roulette::On => roulette::survival(path.beta, path.eta_scale, told.edge, plan.roulette_start),
            options::Roulette::Constant(q) => roulette::on_lattice(q),
        };
        let survived = u_light[3] < survival;
        let number = Number(u_light[3]);
        told.roulette = Some(Roulette { survival: Number(survival), number, survived });
        if !survived {
            told.end = Some(End::Roulette);
            return;
        }
        path.beta *= 1.0 / survival;

        let u_bsdf = random(context, &path, dims::bsdf(told.edge));
        let surfaces = Surfaces::resolve(context, rays, &mut vertices, &[u_bsdf[3]; LANES]);
        let bsdf = surfaces.surface(0);
        if vertices.active[0] == 0 {
            told.end = Some(End::Absorbed);
            return;
        }
        surface.kind = Some(kind(bsdf));
        surface.normal_shading = triple(surfaces.frame(0).n);
        path.last_n = get(&surfaces.receiver_n(&vertices), 0);
        if plan.samples_lights() && (!bsdf.is_delta() || plan.features.lights_at_deltas) {
            told.light = self.light(&vertices, &path, &surfaces, [u_light[0], u_light[1], u_light[2]]);
        }

        let u = [u_bsdf[0], u_bsdf[1], u_bsdf[2]];
        told.end = Some(if matches!(bsdf, Bsdf::Black) { End::Absorbed } else { End::Refused });
        if let Some((sample, frame)) = surfaces.sample_lane(&vertices, 0, u) {
            told.scattering = Some(Scattering {
                lobe: lobe(bsdf, frame.to_local(get(&vertices.wo, 0)), u[0], &sample),
                wi: triple(frame.to_world(sample.wi)),
                pdf_sa: Number(sample.pdf_sa),
                weight: triple(sample.weight),
                eta: Number(sample.eta),
            });
            told.end = Some(End::NothingCarried);
        }
    }

    /// What the surface gives by itself.
    fn emission(
        &self,
        material: &Material,
        vertices: &Vertices,
        rays: &RayHitBlock,
        path: &PathLane,
    ) -> Option<Emission> {
        let context = self.context;
        let hit = rays.hit_unchecked(0);
        if material.unlit {
            let color = emission::unlit_color(context, &hit, material);
            return Some(Emission {
                radiance: triple(color),
                bsdf_pdf_sa: Number(path.last_pdf_sa),
                light_pdf_sa: Number(0.0),
                mis_weight: Number(1.0),
                contribution: triple(path.beta * color),
            });
        }
        if !(material.is_emissive() && vertices.side[0] > 0.0) {
            return None;
        }
        let emitter = vertices.emitter(0, hit.t);
        let weight = emission::weight(context, path, rays.ray.org(0), &emitter);
        let light_pdf = emission::light_pdf_sa(context, path, rays.ray.org(0), &emitter);
        let radiance = emission::textured(context, &hit, material.emissive, material.emissive_texture);
        let contribution = if weight > 0.0 { path.beta * radiance * weight } else { Vec3::ZERO };
        Some(Emission {
            radiance: triple(radiance),
            bsdf_pdf_sa: Number(path.last_pdf_sa),
            light_pdf_sa: Number(light_pdf),
            mis_weight: Number(weight),
            contribution: triple(contribution),
        })
    }

    /// The light sample, `Visible` for now if a ray is worth tracing.
    fn light(&self, vertices: &Vertices, path: &PathLane, surfaces: &Surfaces, u: [f32; 3]) -> Option<LightSample> {
        let context = self.context;
        let receiver = get(&vertices.receivers(), 0);
        let light = context.lights.sample(receiver, path.last_n, u)?;
        let frame = surfaces.frame(0);
        let (wo, wi) = (frame.to_local(get(&vertices.wo, 0)), frame.to_local(light.wi));
        let mut emitted = light.radiance;
        if let Some(point) = light.texture_point {
            emitted *= emission::texel(context, &point);
        }
        let eval = surfaces.surface(0).eval(wo, wi);
        let weight = estimator::light_weight(context.plan.strategy, light.pdf_sa, eval.pdf_sa, light.delta);
        let contribution = path.beta * eval.f_cos * emitted * (weight / light.pdf_sa);
        let traced = consistent(vertices, 0, frame, wo, wi) && contribution.max_element() > 0.0;
        Some(LightSample {
            wi: triple(light.wi),
            distance_m: light.target.map(|target| Number(target.position.distance(receiver))),
            radiance: triple(emitted),
            light_pdf_sa: Number(light.pdf_sa),
            bsdf_pdf_sa: Number(if light.delta { 0.0 } else { eval.pdf_sa }),
            f_cos: triple(eval.f_cos),
            mis_weight: Number(weight),
            contribution: triple(contribution),
            outcome: if traced { Shadow::Visible } else { Shadow::NotTraced },
        })
    }
}

fn kind(bsdf: &Bsdf) -> &'static str {
    match bsdf {
        Bsdf::Black => "black",
        Bsdf::Lambert { .. } => "lambert",
        Bsdf::Glossy(_) => "glossy",
        Bsdf::Dielectric(Dielectric { body: Body::Solid, .. }) => "dielectric",
        Bsdf::Dielectric(Dielectric { body: Body::Thin, .. }) => "thin",
    }
}

/// The lobe that a sample came from; `u` is the number that chose it.
fn lobe(bsdf: &Bsdf, wo: Vec3, u: f32, sample: &BsdfSample) -> &'static str {
    match bsdf {
        Bsdf::Black => "none",
        Bsdf::Lambert { .. } => "diffuse",
        Bsdf::Glossy(glossy) if !glossy.takes_specular(wo, u) => "diffuse base",
        Bsdf::Glossy(glossy) if glossy.is_mirror() => "mirror",
        Bsdf::Glossy(_) => "rough specular",
        Bsdf::Dielectric(glass) => {
            let reflected = (wo.z > 0.0) == (sample.wi.z > 0.0);
            match (reflected, glass.body, glass.is_delta()) {
                (true, _, true) => "smooth reflection",
                (true, _, false) => "rough reflection",
                (false, Body::Solid, true) => "smooth refraction",
                (false, Body::Solid, false) => "rough refraction",
                (false, Body::Thin, true) => "smooth transmission",
                (false, Body::Thin, false) => "rough transmission",
            }
        }
    }
}
