//! The loop over the edges of light paths, and their connections with the camera.
//!
//! Kernels are those of camera paths, in the baseline, which gives the bits of every instruction set; what they sample
//! with is seen from the light. A direction that is drawn there counts with the value that it has seen from the camera:
//! where it is not a delta the BSDF is asked for the way back ([`Lanes::reverse`]), which covers shading normals and
//! refraction (Veach 1997 §5.3); a delta's weight is turned around in closed form. So a path counts the same from
//! whichever end it was found.

use glam::{DVec3, Vec2, Vec3};

use super::lit::LightPaths;
use super::ratio::{self, Facing};
use super::start::{self, Batch, Numbers, State};
use super::weights;
use crate::backend::Coherence;
use crate::backend::batch::{BLOCKED, INVALID_ID, LANES, RayHitBlock};
use crate::camera::{CameraRays, Sight};
use crate::film::filter::FilterTable;
use crate::film::shares::Belongs;
use crate::film::splats::Splats;
use crate::math::columns::{Lane, Lane3, Mask, ZERO, ZERO3, bits, get, set};
use crate::math::float;
use crate::math::lanes::lanes_of;
use crate::math::simd::isa::{Baseline, Isa, Kernel};
use crate::plan::aov::Lobes;
use crate::sampler::{Scheme, WithScheme, dims};
use crate::shading::bsdf::clearcoat::Clearcoat;
use crate::shading::bsdf::compensated::Compensated;
use crate::shading::bsdf::model::Bsdf;
use crate::shading::surface::Surface;
use crate::texture;
use crate::transport::counters::Counters;
use crate::transport::directions::Mixture;
use crate::transport::job::Job;
use crate::transport::kernel::{FLAT, Lanes};
use crate::transport::kind::Kind;
use crate::transport::parts::{Origin, Wanted};
use crate::transport::tape::Silent;
use crate::transport::vertices::Vertices;
use crate::transport::wave::{PathBlock, RayLanes, ShadowLight, Wave};
use crate::transport::{departure, lobes, media, origin, pass_through, path, shutter, spectrum};

/// What a worker traces light paths with.
pub struct Desk {
    wave: Wave,
    /// By slot.
    states: Vec<State>,
    /// Where the connections go, by shadow ray.
    places: Vec<Place>,
}

/// Where on the film a connection goes.
#[derive(Clone, Copy)]
struct Place {
    /// Pixels.
    film: Vec2,
    /// Densities of BSDF samples and of light samples over that of the light paths.
    others: [f32; 2],
    /// Its light, and how the surface that the camera sees scatters it; empty where no layer tells them apart.
    origin: Origin,
}

/// What an open connection brings.
#[derive(Clone, Copy, Debug)]
pub struct Brought {
    /// Where: the point of the picture, pixels.
    pub film: Vec2,
    /// To which half of the film.
    pub half: usize,
    /// Radiance times the area of a pixel.
    pub rgb: DVec3,
    /// Edges of the path from the camera to the light.
    pub edges: u32,
    /// Its light, and how it was scattered where the camera sees it.
    pub origin: Origin,
    /// Densities of BSDF samples and of light samples for the path over that of light paths.
    pub others: [f32; 2],
}

/// What becomes of what light paths find.
pub trait Sink {
    /// Takes what an open connection brings.
    fn take(&mut self, brought: &Brought);
}

/// Adds it to the pixels whose filter reaches the place.
pub struct ToPixels<'a> {
    splats: &'a Splats,
    filter: &'a FilterTable,
    /// Numbers of the layers' sums and what belongs to them, of one connection.
    shares: Vec<(usize, DVec3)>,
}

impl<'a> ToPixels<'a> {
    /// To sums, by a pixel filter.
    pub fn new(splats: &'a Splats, filter: &'a FilterTable) -> Self {
        ToPixels { splats, filter, shares: Vec::new() }
    }

    /// Finds out which layers have a share in it.
    fn share(&mut self, brought: &Brought) {
        let &Brought { rgb, edges, origin, .. } = brought;
        let mut parts = [(Lobes::Diffuse, [0.0; 3]); 2];
        let mut count = 0;
        origin.first.unwrap_or_default().split(rgb.as_vec3(), |kind, part| {
            parts[count] = (kind, part.as_dvec3().to_array());
            count += 1;
        });
        let belongs = Belongs { edges: edges as usize, group: origin.group.into(), scattered: &parts[..count] };
        self.shares.clear();
        self.splats.shares().each(rgb.to_array(), &belongs, |number, part| self.shares.push((number, part.into())));
    }
}

impl Sink for ToPixels<'_> {
    fn take(&mut self, brought: &Brought) {
        let &Brought { film, half, rgb, .. } = brought;
        if self.splats.shares().count() > 0 {
            self.share(brought);
        }
        let radius = self.filter.kind().radius();
        let first = |x: f32| (x - 0.5 - radius).ceil() as i32;
        let last = |x: f32| (x - 0.5 + radius).floor() as i32;
        for y in first(film.y)..=last(film.y) {
            let down = self.filter.value(film.y - 0.5 - y as f32);
            for x in first(film.x)..=last(film.x) {
                let share = f64::from(self.filter.value(film.x - 0.5 - x as f32) * down);
                self.splats.add((x, y), half, (rgb * share).to_array());
                for &(number, part) in &self.shares {
                    self.splats.add_share((x, y), half, number, (part * share).to_array());
                }
            }
        }
    }
}

impl Desk {
    /// For `capacity` paths.
    pub fn new(capacity: usize) -> Self {
        Desk { wave: Wave::new(capacity, &Wanted::default()), states: Vec::new(), places: Vec::new() }
    }
}

/// Traces the paths of `batch`, which fit the desk, and hands what they bring to `sink`.
pub fn run(job: &Job, batch: &Batch, desk: &mut Desk, sink: &mut impl Sink, counters: &mut Counters) {
    let Some(light_paths) = &job.world.light_paths else { return };
    job.sampler.with(Run { job, light_paths, batch, desk, sink, counters });
}

struct Run<'w, 'j, K> {
    job: &'w Job<'j>,
    light_paths: &'w LightPaths<'j>,
    batch: &'w Batch,
    desk: &'w mut Desk,
    sink: &'w mut K,
    counters: &'w mut Counters,
}

/// What depends on the sampler: numbers, and rays that pass surfaces by chance.
#[derive(Clone, Copy)]
struct Drawn {
    numbers: Numbers,
    trace: fn(&Job, &mut Wave, (u32, Coherence), &mut Counters),
}

impl<K: Sink> WithScheme for Run<'_, '_, K> {
    type Output = ();

    fn run<S: Scheme>(self) {
        let drawn = Drawn { numbers: S::sample_4d, trace: path::trace::<S> };
        trace(self, drawn);
    }
}

/// The loop.
fn trace<K: Sink>(run: Run<K>, drawn: Drawn) {
    let Run { job, light_paths, batch, desk, sink, counters } = run;
    let world = &job.world;
    start::run(world, light_paths, (batch, job.seed), drawn.numbers, (&mut desk.wave, &mut desk.states));
    let model = model_for_all(world.kinds);
    let mut edge = 1;
    while desk.wave.current.len > 0 && edge < world.max_depth {
        desk.places.clear();
        let wave = &mut desk.wave;
        wave.next.len = 0;
        wave.shadows.len = 0;
        wave.shadows.media.clear();
        wave.shadows.starts.clear();
        let of_camera = counters.rays_camera;
        (drawn.trace)(job, wave, (edge, Coherence::Incoherent), counters);
        counters.rays_bounce += std::mem::replace(&mut counters.rays_camera, of_camera) - of_camera;
        let numbers = drawn.numbers;
        match model {
            Kind::Compensated => {
                Baseline::call(Shade::<Compensated> { job, light_paths, desk, edge, numbers, of: Default::default() })
            }
            Kind::Layers => {
                Baseline::call(Shade::<Clearcoat> { job, light_paths, desk, edge, numbers, of: Default::default() })
            }
            _ => Baseline::call(Shade::<Surface> { job, light_paths, desk, edge, numbers, of: Default::default() }),
        }
        connect(job, desk, sink, (batch.per_sample, edge + 1), counters);
        std::mem::swap(&mut desk.wave.current, &mut desk.wave.next);
        edge += 1;
    }
    counters.texture_lookups += texture::take_lookups();
}

/// The kind whose model shades every material of a scene with these `kinds`: light paths have too few hits to sort. A
/// model that can stand for no other, and for which none can, needs a queue of its own here.
fn model_for_all(kinds: &[Kind]) -> Kind {
    let mut all = Kind::General;
    for &kind in kinds {
        all = match (kind, all) {
            (Kind::Compensated, _) | (_, Kind::Compensated) => Kind::Compensated,
            (Kind::Layers, _) => Kind::Layers,
            (Kind::Lambert | Kind::Opaque | Kind::General, _) => all,
        };
    }
    all
}

/// Traces the connections, of paths of so many edges, and hands over the open ones.
fn connect(job: &Job, desk: &mut Desk, sink: &mut impl Sink, (per_sample, edges): (u64, u32), counters: &mut Counters) {
    let Desk { wave, states, places } = desk;
    if wave.shadows.len == 0 {
        return;
    }
    if job.world.features.shutter {
        shutter::stamp_shadows(&wave.times, &mut wave.shadows);
    }
    if job.world.features.shadows_pass() {
        counters.rays_shadow += pass_through::shadows(job, wave, counters);
    } else {
        let shadows = &mut wave.shadows;
        let (len, blocks) = (shadows.len, shadows.blocks());
        counters.rays_shadow += len as u64;
        counters.invalid_rays += job.backend.any_hit(&mut shadows.rays[..blocks], len, Coherence::Incoherent);
    }
    for (lane, place) in places.iter().enumerate() {
        let (block, i) = (lane / LANES, lane % LANES);
        if wave.shadows.rays[block].tfar[i] != BLOCKED {
            let carried = &wave.shadows.carried[block];
            let rgb = get(&carried.radiance, i).as_dvec3() / per_sample as f64;
            let half = states[carried.slot[i] as usize].half as usize;
            let Place { film, others, origin } = *place;
            sink.take(&Brought { film, half, rgb, edges, origin, others });
        }
    }
}

/// Shades all hits of the wave.
struct Shade<'w, 'j, B> {
    job: &'w Job<'j>,
    light_paths: &'w LightPaths<'j>,
    desk: &'w mut Desk,
    edge: u32,
    numbers: Numbers,
    of: std::marker::PhantomData<B>,
}

impl<'j, B: Bsdf<'j>> Kernel for Shade<'_, 'j, B> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let Shade { job, light_paths, desk, edge, numbers, .. } = self;
        for block in 0..desk.wave.current.blocks() {
            let (rays, paths) = (desk.wave.current.rays[block], desk.wave.current.paths[block]);
            let lanes = (desk.wave.current.len - block * LANES).min(LANES);
            let mut hit = 0u16;
            for i in 0..lanes {
                hit |= u16::from(rays.hit.geom[i] != INVALID_ID) << i;
            }
            if hit != 0 {
                shade::<B>(job, light_paths, (&rays, &paths, hit), desk, (edge, numbers));
            }
        }
    }
}

/// Connects the vertices of a block with the camera, and lets their paths go on.
#[inline(always)]
fn shade<'c, B: Bsdf<'c>>(
    job: &Job<'c>,
    light_paths: &LightPaths,
    (rays, paths, hit): (&RayHitBlock, &PathBlock, u16),
    desk: &mut Desk,
    (edge, numbers): (u32, Numbers),
) {
    let world = &job.world;
    let mut vertices = Vertices::gather::<Baseline>(world, rays, paths, hit);
    for i in lanes_of(hit) {
        let (material, state) = (vertices.material[i] as usize, &desk.states[paths.slot[i] as usize]);
        let ends = edge == 1 && !light_paths.roles[material].caster;
        vertices.active[i] &= u32::from(!(ends || world.scene.materials[material].unlit));
        if edge == 1 {
            let left = world.lights.window(state.light, rays.ray.tfar[i] * rays.ray.tfar[i]);
            let beta = get(&vertices.beta, i) * left;
            set(&mut vertices.beta, i, beta);
        }
    }
    if world.features.media {
        media::arrive(world, &mut vertices, (rays, paths), &desk.wave.media, &desk.wave.touching);
    }
    let u_camera = paths.random(dims::light(edge), numbers);
    vertices.roulette(world, &[1.0; LANES], &u_camera[3], edge, &mut Silent);
    if bits(&vertices.active) == 0 {
        return;
    }
    if B::EXTENDED && world.features.dispersion {
        let u = paths.random(dims::TIME, numbers);
        spectrum::arrive(world, &mut vertices, paths, &u[1], &mut desk.wave.split);
    }
    let u = paths.random(dims::bsdf(edge), numbers);
    let arriving = vertices.beta;
    let bsdfs = Lanes::<B>::resolve(world, rays, &mut vertices, &u[3]);
    if edge > 1 {
        see::<B>(job, light_paths, (rays, paths), (&vertices, &bsdfs, &arriving), desk, (&u_camera, &u[3]));
    }
    if edge + 1 < world.max_depth {
        scatter::<B>(job, light_paths, (rays, paths), (&vertices, &bsdfs), (desk, &u, edge));
    }
}

/// Shadow rays to the camera from vertices that are not deltas. What they scatter there is asked as camera paths would:
/// seen from the camera.
#[inline(always)]
fn see<'c, B: Bsdf<'c>>(
    job: &Job<'c>,
    light_paths: &LightPaths,
    (rays, paths): (&RayHitBlock, &PathBlock),
    (vertices, bsdfs, arriving): (&Vertices, &Lanes<'c, B>, &Lane3),
    desk: &mut Desk,
    (u, u_material): (&[Lane; 4], &Lane),
) {
    let world = &job.world;
    let radius = job.filter.kind().radius();
    let mut sights = [None::<Sight>; LANES];
    let (mut seen, mut toward) = (0u16, *rays);
    for i in lanes_of(bits(&bsdfs.lit(vertices, false))) {
        let sight = |camera: &CameraRays| camera.sight(get(&vertices.p, i), [u[0][i], u[1][i]]);
        let still = job.camera_steps.is_empty();
        let sight = if still { sight(job.camera) } else { sight(&shutter::camera(job, rays.ray.time[i])) };
        let Some(sight) = sight else { continue };
        let near = |x: f32, side: u32| x > -radius && x < side as f32 + radius;
        if near(sight.film.x, job.columns) && near(sight.film.y, job.rows) {
            let dir = sight.dir;
            (toward.ray.dir_x[i], toward.ray.dir_y[i], toward.ray.dir_z[i]) = (dir.x, dir.y, dir.z);
            sights[i] = Some(sight);
            seen |= 1 << i;
        }
    }
    if seen == 0 {
        return;
    }
    let mut eyes = Vertices::gather::<Baseline>(world, &toward, paths, seen);
    (eyes.exterior, eyes.wavelength_nm) = (vertices.exterior, vertices.wavelength_nm);
    let eye_bsdfs = Lanes::<B>::resolve(world, &toward, &mut eyes, u_material);
    let mut scattered = eye_bsdfs.eval(&eyes, &vertices.wo);
    if world.features.guide {
        Mixture::at(world, &eyes, &eye_bsdfs).weigh(world, &vertices.wo, &mut scattered.pdf_sa);
    }

    let mut firsts = [None; LANES];
    if world.features.lobes {
        firsts = lobes::of_light(&eye_bsdfs, &eyes, &vertices.wo, &scattered).map(Some);
    }

    let (mut carried, mut dir, mut tfar, mut keep) = (ZERO3, ZERO3, ZERO, 0u16);
    let (mut origins, mut others) = (ZERO3, [[0.0; 2]; LANES]);
    for i in lanes_of(bits(&eyes.active) & seen) {
        let (Some(sight), state) = (&sights[i], &desk.states[paths.slot[i] as usize]) else { continue };
        let n_g = get(&vertices.n_g, i);
        let (cos_light, cos_camera) = (n_g.dot(get(&vertices.wo, i)).abs(), n_g.dot(sight.dir).abs());
        let on_film = sight.per_area * cos_camera / cos_light;
        let share = on_film * scattered.pdf_sa[i] / light_paths.per_sample;
        others[i] = [state.bsdf * share, state.light_sample * share];
        let weight = match light_paths.alone {
            true => 1.0,
            false => weights::of_light_path(world.strategy, others[i][0], others[i][1]),
        };
        let value = get(&scattered.f_cos, i) * get(arriving, i) * state.power * (on_film * weight);
        if !(value.max_element() > 0.0) {
            continue;
        }
        let org = float::spawn_origin(get(&vertices.p, i), n_g, vertices.error[i], -sight.dir);
        let segment = float::segment_to(org, sight.origin, Vec3::ZERO, 0.0);
        if segment.tfar > 0.0 && segment.tfar < f32::INFINITY {
            set(&mut carried, i, value);
            set(&mut origins, i, org);
            set(&mut dir, i, segment.dir);
            tfar[i] = segment.tfar;
            keep |= 1 << i;
        }
    }
    let Desk { wave, places, states } = desk;
    let (stacks, from) = ((&wave.media[..], &wave.touching[..]), (rays, paths));
    if world.features.boundaries {
        media::start_shadows(world, vertices, from, (&dir, keep), stacks, &mut wave.shadows.media);
    } else if world.features.media {
        media::attenuate(world, vertices, from, (&dir, &tfar), stacks, &mut carried);
    }
    for i in lanes_of(keep) {
        let light = ShadowLight { radiance: get(&carried, i), slot: paths.slot[i] };
        wave.shadows.push((get(&origins, i), get(&dir, i), tfar[i]), light);
        let (film, light) = (sights[i].map_or(Vec2::ZERO, |sight| sight.film), states[paths.slot[i] as usize].light);
        let origin = Origin { first: firsts[i], ..origin::of_sample(world, light) };
        places.push(Place { film, others: others[i], origin });
    }
}

/// Directions in which light paths go on.
#[inline(always)]
fn scatter<'c, B: Bsdf<'c>>(
    job: &Job<'c>,
    light_paths: &LightPaths,
    (rays, paths): (&RayHitBlock, &PathBlock),
    (vertices, bsdfs): (&Vertices, &Lanes<'c, B>),
    (desk, u, edge): (&mut Desk, &[Lane; 4], u32),
) {
    let world = &job.world;
    let mut out = RayLanes { org: ZERO3, dir: ZERO3 };
    let mut to = PathBlock { beta: ZERO3, last_pdf_sa: ZERO, ..*paths };
    let mut keep: Mask = bsdfs.sample(vertices, u, (&mut out, &mut to), &mut Silent);
    for i in 0..LANES {
        keep[i] *= u32::from(vertices.active[i] != 0);
    }
    let facing = Facing::gather(world, rays, bits(&keep));
    let n = bsdfs.receiver_n(vertices);
    let mixture = if world.features.guide { Mixture::at(world, vertices, bsdfs) } else { Mixture::NONE };
    for i in lanes_of(bits(&keep)) {
        let (wi, pdf_sa) = (get(&out.dir, i), to.last_pdf_sa[i]);
        let role = light_paths.roles[vertices.material[i] as usize];
        if !role.passes || keep[i] == FLAT || !facing.both(vertices, i, wi) {
            keep[i] = 0;
            continue;
        }
        let (delta, eta2) = (pdf_sa == f32::INFINITY, to.eta_scale[i] / paths.eta_scale[i]);
        let (value, reverse) = if delta {
            (get(&to.beta, i) * (eta2 * ratio::turned(vertices, i, wi)), 0.0)
        } else {
            let back = bsdfs.reverse(vertices, i, wi);
            let reverse = mixture.pdf_sa(world, i, get(&vertices.wo, i), back.pdf_sa);
            (back.f_cos * (ratio::cosines(vertices, i, wi) / pdf_sa), reverse)
        };
        let beta = get(&vertices.beta, i) * value;
        let factor = ratio::factor(vertices, i, wi, [pdf_sa, eta2, reverse]);
        let state = &mut desk.states[paths.slot[i] as usize];
        if edge == 1 {
            let p = get(&vertices.p, i);
            let bracket = light_paths.emitters.bracket(world.lights, state.light, (state.org, p), state.dir);
            let drawn = || world.lights.pdf_of_start(state.light, (p, get(&n, i)), state.org, state.dir);
            let samples = world.samples_lights() && !delta;
            let light = if samples { drawn() * ratio::cosines(vertices, i, wi) / pdf_sa } else { 0.0 };
            state.bsdf = if world.lights.is_punctual(state.light) { 0.0 } else { factor / bracket };
            state.light_sample = light / bracket;
        } else {
            state.bsdf *= factor;
            state.light_sample *= factor;
        }
        keep[i] = u32::from(beta.max_element() > 0.0 && beta.is_finite() && state.bsdf.is_finite());
        set(&mut to.beta, i, beta);
        set(&mut out.org, i, float::spawn_origin(get(&vertices.p, i), get(&vertices.n_g, i), vertices.error[i], wi));
    }
    to.eta_scale = [1.0; LANES];
    let Desk { wave, .. } = desk;
    if world.features.media {
        media::depart(world, vertices, (rays, paths), (&out.dir, &keep), &mut wave.media, &wave.touching);
    }
    if world.features.exact_starts {
        let lanes = (&paths.slot, bits(&keep));
        departure::depart(world, vertices, rays, lanes, (&mut out.org, &out.dir), &mut wave.starts);
    }
    wave.next.append::<Baseline>(&out, &to, bits(&keep), world.carried);
}
