//! The density of light paths over that of camera paths, along a camera path.
//!
//! With N light paths for each camera sample of a pixel, the ratio for the path x₀ … x_k is, as squared distances
//! cancel edge by edge,
//!
//! N / (pixels per m² at x₁ across x₁x₀ · cos x₁→x₀) · cos x₁→x₂ / p(x₁→x₂)
//!   · Π_(i=2…k−1) p(x_i→x_(i−1)) cos x_i→x_(i+1) / (p(x_i→x_(i+1)) cos x_i→x_(i−1)) · bracket of the light,
//!
//! p per steradian, cosines with the geometric normals; the bracket is that of `shading/light/emit.rs`. A delta has the
//! same factor with the ratio of its solid angles, cos x_i→x_(i−1) / (η² cos x_i→x_(i+1)) by the shading normal. The
//! product up to a vertex is one number of each camera sample. Its sign says whether the last vertex is a caster from
//! x₂ on (+), so that light there counts; 0 stays 0.
//!
//! Weights need no exact densities, only the same function on both sides: where one is approximated (that a delta lobe
//! is drawn with one probability from both sides), [`trace`](super::trace) approximates it alike.

use glam::Vec3;

use super::lit::LightPaths;
use super::weights;
use crate::backend::batch::{LANES, RayHitBlock};
use crate::camera::CameraRays;
use crate::math::columns::{Lane3, Mask, bits, get};
use crate::math::lanes::lanes_of;
use crate::math::simd::isa::Baseline;
use crate::shading::bsdf::model::Bsdf;
use crate::transport::connect::LightLanes;
use crate::transport::job::Job;
use crate::transport::kernel::{FLAT, Lanes, Scattered};
use crate::transport::points::Points;
use crate::transport::shutter;
use crate::transport::vertices::Vertices;
use crate::transport::wave::{PathBlock, Wave};
use crate::transport::world::World;

/// After camera rays are traced: what depends on the camera.
pub fn start(job: &Job, wave: &mut Wave) {
    let Some(paths) = &job.world.light_paths else { return };
    for lane in 0..wave.current.len {
        let (block, i) = (lane / LANES, lane % LANES);
        let ray = &wave.current.rays[block].ray;
        let at = |camera: &CameraRays| camera.per_area(ray.dir(i), ray.tfar[i]);
        let still = job.camera_steps.is_empty();
        let per_area = if still { at(job.camera) } else { at(&shutter::camera(job, ray.time[i])) };
        let ratio = paths.per_sample / per_area;
        wave.ratios[wave.current.paths[block].slot[i] as usize] = -ratio;
    }
}

/// Interpolated normals of the front where there are any: a pair of directions that they do not face as the geometric
/// normals do is no way of light paths.
pub struct Facing(Option<Lane3>);

impl Facing {
    /// At the hits of `rays`.
    pub fn gather(world: &World, rays: &RayHitBlock, lanes: u16) -> Self {
        let features = world.features;
        let smooth = features.smooth_normals && lanes != 0;
        Facing(smooth.then(|| Points::gather::<Baseline>(world.geometry, rays, lanes, true, features.instancing).n_s))
    }

    /// Whether lane `i` faces both directions.
    #[inline]
    pub fn both(&self, vertices: &Vertices, i: usize, wi: Vec3) -> bool {
        let Some(n_s) = &self.0 else { return true };
        let (n_s, n_g) = (get(n_s, i), get(&vertices.n_g, i) * vertices.side[i]);
        let same = |dir: Vec3| (n_s.dot(dir) > 0.0) == (n_g.dot(dir) > 0.0);
        same(get(&vertices.wo, i)) && same(wi)
    }
}

/// Factor of a scattering that a light path passes as well, from `wo` to `wi`; `pdf_sa` and `eta2` (η² of what the
/// direction enters) are those of the draw, `reverse` is the density of the way back.
#[inline]
pub fn factor(vertices: &Vertices, i: usize, wi: Vec3, [pdf_sa, eta2, reverse]: [f32; 3]) -> f32 {
    if pdf_sa == f32::INFINITY { turned(vertices, i, wi) / eta2 } else { reverse / pdf_sa * cosines(vertices, i, wi) }
}

/// |cos wi| over |cos wo|, by the geometric normal.
#[inline]
pub fn cosines(vertices: &Vertices, i: usize, wi: Vec3) -> f32 {
    let n_g = get(&vertices.n_g, i);
    (n_g.dot(wi) / n_g.dot(get(&vertices.wo, i))).abs()
}

/// The same over that ratio by the shading normal: 1 where both normals are one.
#[inline]
pub fn turned(vertices: &Vertices, i: usize, wi: Vec3) -> f32 {
    let n_s = get(&vertices.n_s, i);
    cosines(vertices, i, wi) / (n_s.dot(wi) / n_s.dot(get(&vertices.wo, i))).abs()
}

/// Takes the ratios of the lanes `keep` over the scatterings at the end of edge `edge`: `dir` and `to` are what was
/// drawn, `from` is how the paths came there.
#[inline(never)]
pub fn advance<'c, B: Bsdf<'c>>(
    world: &World<'c>,
    (vertices, bsdfs): (&Vertices, &Lanes<'c, B>),
    (rays, paths): (&RayHitBlock, &PathBlock),
    (dir, to, keep): (&Lane3, &PathBlock, &Mask),
    (ratios, edge): (&mut [f32], u32),
) {
    let Some(light_paths) = &world.light_paths else { return };
    let lanes = bits(keep);
    let facing = Facing::gather(world, rays, if edge > 1 { lanes } else { 0 });
    for i in lanes_of(lanes) {
        let ratio = &mut ratios[paths.slot[i] as usize];
        if *ratio == 0.0 {
            continue;
        }
        let (wi, pdf_sa, before) = (get(dir, i), to.last_pdf_sa[i], ratio.abs());
        if edge == 1 {
            let first = cosines(vertices, i, wi) / pdf_sa;
            *ratio = if pdf_sa < f32::INFINITY { -before * first } else { 0.0 };
            continue;
        }
        let role = light_paths.roles[vertices.material[i] as usize];
        if !role.passes || keep[i] == FLAT || !facing.both(vertices, i, wi) {
            *ratio = 0.0;
            continue;
        }
        let reverse = if pdf_sa < f32::INFINITY { bsdfs.reverse(vertices, i, wi).pdf_sa } else { 0.0 };
        let eta2 = to.eta_scale[i] / paths.eta_scale[i];
        let after = before * factor(vertices, i, wi, [pdf_sa, eta2, reverse]);
        let after = if after.is_finite() { after } else { 0.0 };
        *ratio = if role.caster { after } else { -after };
    }
}

/// Weight of the emission of the triangle in lane `i`, which a BSDF-sampled ray meets with these densities; `None`
/// where light paths have no part in it.
#[cold]
#[inline(never)]
pub fn weight_of_area(world: &World, vertices: &Vertices, i: usize, found: (f32, [f32; 2])) -> Option<f32> {
    let light = vertices.light[i] + u32::from(vertices.cos_g[i] < 0.0);
    let way = (get(&vertices.p, i), get(&vertices.wo, i));
    let area_m2 = world.lights.area_m2(light);
    let bracket = |paths: &LightPaths| paths.emitters.bracket_of_area(light, area_m2, way, vertices.cos_g[i].abs());
    weight(world, found, bracket)
}

/// The same of the environment, for a ray from `org` in direction `dir`.
#[cold]
#[inline(never)]
pub fn weight_of_environment(world: &World, (org, dir): (Vec3, Vec3), found: (f32, [f32; 2])) -> Option<f32> {
    let pdf_sa = world.lights.environment()?.pdf_sa(dir);
    weight(world, found, |paths| paths.emitters.bracket_of_environment(world.lights, org, -dir, pdf_sa))
}

/// Weight of light that a BSDF-sampled ray meets, by the ratio of its camera sample and both densities; `bracket` is
/// that of the light.
fn weight(world: &World, (ratio, densities): (f32, [f32; 2]), bracket: impl FnOnce(&LightPaths) -> f32) -> Option<f32> {
    let light_paths = world.light_paths.as_ref().filter(|_| ratio > 0.0)?;
    let light_path = ratio * bracket(light_paths);
    match light_path > 0.0 {
        true if light_paths.alone => Some(0.0),
        true => Some(weights::of_emission(world.strategy, densities, light_path)),
        false => None,
    }
}

/// Leaves their part of the light samples at the end of edge `edge` to light paths.
#[inline(never)]
pub fn share<'c, B: Bsdf<'c>>(
    world: &World<'c>,
    (vertices, bsdfs): (&Vertices, &Lanes<'c, B>),
    (rays, paths): (&RayHitBlock, &PathBlock),
    (light, scattered, lit): (&mut LightLanes, &Scattered, &Mask),
    ratios: &[f32],
) {
    let Some(light_paths) = &world.light_paths else { return };
    let concerned = |i: &usize| {
        let caster = light_paths.roles[vertices.material[*i] as usize].caster;
        caster && light.pdf_sa[*i] > 0.0 && ratios[paths.slot[*i] as usize] != 0.0
    };
    let lanes = lanes_of(bits(lit)).filter(concerned).fold(0u16, |lanes, i| lanes | 1 << i);
    let facing = Facing::gather(world, rays, lanes);
    for i in lanes_of(lanes) {
        let (ratio, wi, pdf_sa) = (ratios[paths.slot[i] as usize].abs(), get(&light.wi, i), light.pdf_sa[i]);
        if !facing.both(vertices, i, wi) {
            continue;
        }
        let (p, target) = (get(&vertices.p, i), get(&light.target, i));
        let bracket = light_paths.emitters.bracket(world.lights, light.number[i], (target, p), -wi);
        let reverse = bsdfs.reverse(vertices, i, wi).pdf_sa;
        let light_path = ratio * reverse * cosines(vertices, i, wi) / pdf_sa * bracket;
        if !(light_path > 0.0) {
            continue;
        }
        let bsdf = scattered.pdf_sa[i] * light.shared[i] / pdf_sa;
        let left = match light_paths.alone {
            true => 0.0,
            false => weights::of_light_sample(world.strategy, bsdf, light_path),
        };
        for c in 0..3 {
            light.radiance[c][i] *= left;
        }
    }
}
