//! The wavefront: batches of paths advance one edge at a time. This page is the loop; each verb is a file.
//!
//! All paths of a wave have the same number of edges, so the depth, its dimension sets and its roulette are the same for
//! all lanes. A worker owns its wave; nothing is shared but the read-only context, so the picture depends on neither
//! threads nor tiles: a pixel's samples are added in ascending order.

pub mod accumulate;
pub mod alpha;
pub mod capped;
pub mod choose;
pub mod classify;
pub mod columns;
pub mod emission;
pub mod estimator;
pub mod factors;
pub mod first_hit;
pub mod footprint;
pub mod general;
#[allow(unsafe_code)] // Fence 3 of 5: calls into code compiled for AVX-512.
pub mod isa;
pub mod lambert;
pub mod light_sample;
pub mod observe;
pub mod opaque;
pub mod queue;
pub mod raygen;
pub mod replay;
pub mod shade;
pub mod shutter;
pub mod state;
pub mod vertex;
pub mod vertices;

use glam::Vec3;

use crate::backend::{Backend, Coherence};
use crate::camera::CameraRays;
use crate::film::Pixel;
use crate::film::filter::FilterTable;
use crate::plan::RenderPlan;
use crate::sampler::Scheme;
use crate::scene::Scene;
use crate::scene::geometry::Geometry;
use crate::shading::bsdf::albedo::SpecularAlbedo;
use crate::shading::light::Lights;
use crate::shading::light::area::AreaLight;
use crate::texture;
use capped::Capped;
use general::Surfaces;
use isa::Isa;
use lambert::LambertLanes;
use observe::{Observer, Stage};
use opaque::OpaqueLanes;
use queue::Kind;
use raygen::Chunk;
use state::{Carried, NO_MEDIUM, Wave};

/// Everything the stages read; shared by all workers.
pub struct Context<'a> {
    /// The decisions.
    pub plan: &'a RenderPlan,
    /// Materials and textures.
    pub scene: &'a Scene,
    /// Triangles.
    pub geometry: &'a Geometry,
    /// Emitters.
    pub lights: &'a Lights,
    /// Ray queries.
    pub backend: &'a dyn Backend,
    /// Camera rays.
    pub camera: &'a CameraRays,
    /// The same at equal intervals of the shutter; empty where the camera is at rest.
    pub camera_steps: &'a [CameraRays],
    /// Pixel filter.
    pub filter: &'a FilterTable,
    /// Kernel of each material.
    pub kinds: &'a [Kind],
    /// The kernel of every material, where it is one for all.
    pub only_kind: Option<Kind>,
    /// What survivors carry.
    pub carried: Carried,
    /// The one light of the scene with its radiance, if it is an untextured area light.
    pub only_area: Option<(&'a AreaLight, Vec3)>,
    /// Where surfaces are there.
    pub alpha: &'a alpha::AlphaTable,
    /// Directional albedo of dielectric coats; empty when no material has one.
    pub albedo: &'a SpecularAlbedo,
    /// Who looks at the wave between the stages; nobody in a render.
    pub observer: Option<&'a dyn Observer>,
}

impl Context<'_> {
    /// Whether `medium` lets nothing through to infinity.
    fn absorbs_fully(&self, medium: u32) -> bool {
        medium != NO_MEDIUM
            && self.plan.features.absorption
            && emission::transmittance(&self.scene.materials[medium as usize], f32::MAX) == Vec3::ZERO
    }
}

/// What a render traced and met. Sums over workers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Camera paths begun.
    pub paths: u64,
    /// Camera rays.
    pub rays_camera: u64,
    /// Rays after a scattering.
    pub rays_bounce: u64,
    /// Shadow rays.
    pub rays_shadow: u64,
    /// Rays that were refused because a component was NaN, infinite or out of range.
    pub invalid_rays: u64,
    /// Samples whose radiance was not finite; they enter the film as 0.
    pub nonfinite: u64,
    /// The first of them.
    pub nonfinite_first: Vec<NonFinite>,
    /// Paths ended by the depth limit.
    pub capped_paths: u64,
    /// What those could still have carried.
    pub capped: Capped,
    /// Look-ups of textures.
    pub texture_lookups: u64,
}

impl Counters {
    /// Rays of all classes.
    pub fn rays(&self) -> u64 {
        self.rays_camera + self.rays_bounce + self.rays_shadow
    }

    /// Adds another worker's counts. The list of non-finite samples is kept in order of pixel and sample, so that it does
    /// not depend on which worker came first.
    pub fn merge(&mut self, other: &Counters) {
        self.paths += other.paths;
        self.rays_camera += other.rays_camera;
        self.rays_bounce += other.rays_bounce;
        self.rays_shadow += other.rays_shadow;
        self.invalid_rays += other.invalid_rays;
        self.nonfinite += other.nonfinite;
        self.capped_paths += other.capped_paths;
        self.capped.merge(&other.capped);
        self.texture_lookups += other.texture_lookups;
        other.nonfinite_first.iter().for_each(|&met| self.list(met));
    }

    /// Keeps the first non-finite samples in order of sample, row and column: the same ones whatever the order in which
    /// they are met.
    fn list(&mut self, met: NonFinite) {
        let listed = &mut self.nonfinite_first;
        let at = listed.partition_point(|other| other.place() < met.place());
        listed.insert(at, met);
        listed.truncate(accumulate::NONFINITE_LISTED);
    }
}

/// Where a non-finite sample was met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NonFinite {
    /// Pixel in the full image.
    pub pixel: (u32, u32),
    /// Sample index of the pixel.
    pub sample: u64,
    /// Scatterings of the path whose contribution it was (0: light seen directly). Found by a replay at the end of the
    /// render; `None` until then.
    pub bounce: Option<u32>,
}

impl NonFinite {
    /// The order in which samples are listed, which is no matter of tiles and passes.
    fn place(&self) -> (u64, u32, u32) {
        (self.sample, self.pixel.1, self.pixel.0)
    }
}

/// Renders the samples of `chunk` (which must fit the wave) into `pixels`, one per pixel of the chunk.
pub fn run<S: Scheme>(
    context: &Context,
    chunk: &Chunk,
    wave: &mut Wave,
    pixels: &mut [Pixel],
    counters: &mut Counters,
) {
    isa::run::<S>(context, chunk, wave, pixels, counters)
}

/// The loop over edges; compiled once per instruction set, so everything below is inlined here.
#[inline(always)]
fn run_inline<S: Scheme, I: Isa>(
    context: &Context,
    chunk: &Chunk,
    wave: &mut Wave,
    pixels: &mut [Pixel],
    counters: &mut Counters,
) {
    raygen::run::<S>(context, chunk, wave);
    counters.paths += chunk.len() as u64;
    let mut coherence = Coherence::Coherent;
    let mut edge = 1;
    while wave.current.len > 0 {
        let rays = if edge == 1 { &mut counters.rays_camera } else { &mut counters.rays_bounce };
        *rays += wave.current.len as u64;
        if context.plan.features.shutter && edge > 1 {
            shutter::stamp_paths(&wave.times, &mut wave.current);
        }
        let blocks = wave.current.blocks();
        let current = &mut wave.current;
        counters.invalid_rays += context.backend.closest_hit(&mut current.rays[..blocks], current.len, coherence);
        if edge == 1 {
            raygen::start_at_origin(&mut wave.current.rays[..blocks]);
        }

        if context.plan.features.alpha {
            let traced = alpha::closest::<S>(context, wave, edge, counters);
            *(if edge == 1 { &mut counters.rays_camera } else { &mut counters.rays_bounce }) += traced;
        }
        classify::run(context, wave, edge);
        wave.next.len = 0;
        wave.shadows.len = 0;
        counters.capped_paths += I::shade::<LambertLanes, S>(context, wave, Kind::Lambert, edge);
        counters.capped_paths += I::shade::<OpaqueLanes, S>(context, wave, Kind::Opaque, edge);
        counters.capped_paths += I::shade::<Surfaces, S>(context, wave, Kind::General, edge);
        observe::look(context, Stage::Shaded, edge, wave);

        if context.plan.features.shutter {
            shutter::stamp_shadows(&wave.times, &mut wave.shadows);
        }
        if wave.shadows.len > 0 && context.plan.features.alpha {
            counters.rays_shadow += alpha::shadows(context, wave, counters);
            accumulate::shadows(wave, edge + 1);
        } else if wave.shadows.len > 0 {
            counters.rays_shadow += wave.shadows.len as u64;
            let blocks = wave.shadows.blocks();
            let shadows = &mut wave.shadows;
            counters.invalid_rays += context.backend.any_hit(&mut shadows.rays[..blocks], shadows.len, coherence);
            accumulate::shadows(wave, edge + 1);
        }
        observe::look(context, Stage::Connected, edge, wave);
        std::mem::swap(&mut wave.current, &mut wave.next);
        coherence = Coherence::Incoherent;
        edge += 1;
    }
    counters.capped.merge(&std::mem::take(&mut wave.sums.capped));
    counters.texture_lookups += texture::take_lookups();
    accumulate::samples(chunk, wave, pixels, counters);
}
