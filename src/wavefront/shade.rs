//! The general kernel: any material, one lane at a time. Emission, roulette, a light sample, a BSDF sample: gathers a
//! lane, calls pure functions of numbers, scatters survivors to the next edge and shadow rays to their batch.

use glam::Vec3;

use super::queue::Kind;
use super::state::{NO_MEDIUM, PathLane, Wave};
use super::{Context, estimator};
use crate::backend::batch::LANES;
use crate::math::float;
use crate::math::frame::Frame;
use crate::plan::options::Roulette;
use crate::sampler::{Scheme, dims};
use crate::scene::{Material, TextureSlot};
use crate::shading::bsdf::BsdfSample;
use crate::shading::interaction::{self, Interaction};
use crate::shading::light::{EmitterHit, TexturePoint};
use crate::shading::roulette;
use crate::shading::surface::{Surface, Textured};
use crate::texture;

/// What a lane met, as numbers.
struct Vertex {
    /// Where.
    at: Interaction,
    /// Unit direction to where the path came from.
    wo: Vec3,
    /// Length of the last edge, metres.
    t: f32,
    /// Whether `wo` lies on the authored front side.
    front: bool,
}

/// Shades every lane of the general queue. Returns how many paths the depth limit ended.
#[inline(always)]
pub fn run<S: Scheme>(context: &Context, wave: &mut Wave, edge: u32) -> u64 {
    let mut capped = 0;
    let queue = std::mem::take(&mut wave.queues[Kind::General as usize]);
    for &lane in &queue {
        let (block, i) = (lane as usize / LANES, lane as usize % LANES);
        let rays = &wave.current.rays[block];
        let path = wave.current.paths[block].get(i);
        let hit = rays.hit_unchecked(i);
        let (org, dir) = (rays.ray.org(i), rays.ray.dir(i));
        let at = Interaction::at(context.geometry, &hit, context.plan.features.smooth_normals);
        let front = at.n_g.dot(dir) < 0.0;
        let vertex = Vertex { at, wo: -dir, t: hit.t, front };
        capped += shade_lane::<S>(context, wave, path, org, &vertex, edge) as u64;
    }
    wave.queues[Kind::General as usize] = queue;
    capped
}

/// One lane. Returns whether the depth limit ended a path that could have gone on.
#[inline(always)]
fn shade_lane<S: Scheme>(
    context: &Context,
    wave: &mut Wave,
    mut path: PathLane,
    org: Vec3,
    vertex: &Vertex,
    edge: u32,
) -> bool {
    let plan = context.plan;
    let material = &context.scene.materials[vertex.at.material as usize];
    if plan.features.absorption {
        path.beta *= absorption(context, material, &path, vertex);
    }

    // Light that the surface gives by itself ends here or was found by the last BSDF sample.
    if material.unlit {
        let mut color = textured(context, &vertex.at, material.base_color, material.base_color_texture);
        if material.vertex_colors {
            color *= vertex.at.color(context.geometry).truncate();
        }
        wave.add(path.slot, edge, path.beta * color);
        return false;
    }
    if material.is_emissive() && vertex.front {
        let cos = vertex.at.n_g.dot(vertex.wo);
        let weight = emission_weight(context, &path, org, &vertex.at, vertex.t, cos);
        if weight > 0.0 {
            let radiance = textured(context, &vertex.at, material.emissive, material.emissive_texture);
            wave.add(path.slot, edge, path.beta * radiance * weight);
        }
    }
    if edge >= plan.max_depth {
        wave.sums.capped.add(path.beta * material.reflectance_bound() * path.eta_scale);
        return true;
    }

    // A path that cannot return its cost is ended before its material is looked up.
    let u_light = S::sample_4d(path.index, path.seed, dims::light(edge));
    let survival = match plan.roulette {
        Roulette::Off => 1.0,
        Roulette::On => roulette::survival(path.beta, path.eta_scale, edge, plan.roulette_start),
        Roulette::Constant(q) => roulette::on_lattice(q),
    };
    if survival < 1.0 {
        if u_light[3] >= survival {
            return false;
        }
        path.beta *= 1.0 / survival;
    }

    let u_bsdf = S::sample_4d(path.index, path.seed, dims::bsdf(edge));
    let Some((surface, frame)) = resolve(context, material, vertex, u_bsdf[3]) else { return false };
    let wo = frame.to_local(vertex.wo);

    path.last_n = if surface.is_transmissive() { Vec3::ZERO } else { frame.n };
    if plan.samples_lights() && (!surface.is_delta() || plan.features.lights_at_deltas) {
        sample_light(context, wave, &path, vertex, &surface, &frame, [u_light[0], u_light[1], u_light[2]]);
    }

    let Some((sample, frame)) = sample_bsdf(&surface, frame, wo, vertex, [u_bsdf[0], u_bsdf[1], u_bsdf[2]]) else {
        return false;
    };
    let wi = frame.to_world(sample.wi);
    let beta = path.beta * sample.weight;
    if beta.max_element() <= 0.0 {
        return false;
    }
    let transmitted = (vertex.at.n_g.dot(wi) > 0.0) != vertex.front;
    if transmitted && material.thickness > 0.0 {
        path.medium = if vertex.front { vertex.at.material } else { NO_MEDIUM };
    }
    path.beta = beta;
    path.eta_scale *= sample.eta * sample.eta;
    path.last_pdf_sa = sample.pdf_sa;
    let org = float::spawn_origin(vertex.at.p, vertex.at.n_g, vertex.at.error, wi);
    wave.next.push(&path, org, wi);
    false
}

/// Weight of the emission of an emissive triangle met by the path's last BSDF sample from `org`, at distance `t` under
/// the cosine `cos_light`.
#[inline(always)]
pub(super) fn emission_weight(
    context: &Context,
    path: &PathLane,
    org: Vec3,
    at: &Interaction,
    t: f32,
    cos_light: f32,
) -> f32 {
    if path.last_pdf_sa == f32::INFINITY || !context.plan.samples_lights() || at.light == u32::MAX {
        return 1.0;
    }
    let hit = EmitterHit { light: at.light, distance_m: t, cos_light, area_m2: context.lights.area_m2(at.light) };
    let light_pdf = context.lights.pdf_triangle(org, path.last_n, &hit);
    estimator::emission_weight(context.plan.strategy, path.last_pdf_sa, light_pdf)
}

/// The resolved BSDF and its frame. For opaque surfaces the frame's normal faces the viewer; for transmissive ones it
/// faces the authored outside. `None` where a normal map turns the surface away from the viewer.
#[inline(always)]
fn resolve<'c>(
    context: &Context<'c>,
    material: &Material,
    vertex: &Vertex,
    u_material: f32,
) -> Option<(Surface<'c>, Frame)> {
    let at = &vertex.at;
    let features = &context.plan.features;
    let (mut base_color, mut metallic, mut roughness) = (material.base_color, material.metallic, material.roughness);
    let mut n_s = at.n_s;
    // An interpolated normal that faces away from a viewer of this side has no meaning there: shade flat.
    if (n_s.dot(vertex.wo) > 0.0) != vertex.front {
        n_s = at.n_g;
    }
    let mut mapped = false;
    if features.textures
        && material.reads_textures()
        && let Some(uv) = at.uv(context.geometry)
    {
        let fetch = |slot: Option<TextureSlot>| {
            slot.map(|slot| {
                let uv = if slot.uv_set == 0 { uv } else { at.uv_of(context.geometry, slot.uv_set).unwrap_or(uv) };
                texture::lookup(&context.scene.textures[slot.texture.index()], uv)
            })
        };
        if let Some(texel) = fetch(material.base_color_texture) {
            base_color *= texel.truncate();
        }
        if let Some(texel) = fetch(material.metallic_roughness_texture) {
            roughness *= texel.y;
            metallic *= texel.z;
        }
        if let (Some(texel), Some(tangent)) = (fetch(material.normal_texture), at.tangent(context.geometry)) {
            let scale = material.normal_scale;
            let map = Vec3::new((texel.x * 2.0 - 1.0) * scale, (texel.y * 2.0 - 1.0) * scale, texel.z * 2.0 - 1.0);
            n_s = interaction::tilt(n_s, tangent, map);
            mapped = true;
        }
    }
    if features.vertex_colors && material.vertex_colors {
        base_color *= at.color(context.geometry).truncate();
    }
    let textured = Textured { base_color, metallic, roughness };
    let surface = Surface::from_material(material, textured, context.albedo, u_material);
    if !surface.is_transmissive() && !vertex.front {
        n_s = -n_s;
    }
    if mapped && !surface.is_transmissive() && n_s.dot(vertex.wo) <= 0.0 {
        return None;
    }
    Some((surface, Frame::from_normal(n_s)))
}

/// Draws a direction; refuses one that lies on the wrong geometric side. A delta lobe whose interpolated normal sends
/// it there is drawn again about the geometric normal, so that smooth glass loses nothing at its silhouette.
#[inline(always)]
fn sample_bsdf(surface: &Surface, frame: Frame, wo: Vec3, vertex: &Vertex, u: [f32; 3]) -> Option<(BsdfSample, Frame)> {
    let sample = surface.sample(wo, u)?;
    if consistent(&frame, wo, sample.wi, vertex) {
        return Some((sample, frame));
    }
    if !surface.is_delta() {
        return None;
    }
    let facing = if surface.is_transmissive() || vertex.front { vertex.at.n_g } else { -vertex.at.n_g };
    let frame = Frame::from_normal(facing);
    let wo = frame.to_local(vertex.wo);
    let sample = surface.sample(wo, u)?;
    consistent(&frame, wo, sample.wi, vertex).then_some((sample, frame))
}

/// Whether `wi` lies on the same side (reflection) or the other side (transmission) of both normals.
#[inline(always)]
fn consistent(frame: &Frame, wo: Vec3, wi: Vec3, vertex: &Vertex) -> bool {
    let reflected = (wo.z > 0.0) == (wi.z > 0.0);
    let same_side = (vertex.at.n_g.dot(frame.to_world(wi)) > 0.0) == vertex.front;
    reflected == same_side
}

/// Next-event estimation: one light sample, its shadow ray into the batch.
#[inline(always)]
fn sample_light(
    context: &Context,
    wave: &mut Wave,
    path: &PathLane,
    vertex: &Vertex,
    surface: &Surface,
    frame: &Frame,
    u: [f32; 3],
) {
    let facing = if vertex.front { vertex.at.n_g } else { -vertex.at.n_g };
    // Rays to lights on the viewer's side start here; through a transmissive surface they start within its error bound.
    let receiver = float::spawn_origin(vertex.at.p, vertex.at.n_g, vertex.at.error, facing);
    let Some(light) = context.lights.sample(receiver, path.last_n, u) else { return };
    let wo = frame.to_local(vertex.wo);
    let wi = frame.to_local(light.wi);
    if !consistent(frame, wo, wi, vertex) {
        return;
    }
    let scattered = surface.eval(wo, wi);
    let weight = estimator::light_weight(context.plan.strategy, light.pdf_sa, scattered.pdf_sa, light.delta);
    let mut emitted = light.radiance;
    if let Some(point) = light.texture_point {
        emitted *= emission_texel(context, &point);
    }
    let radiance = path.beta * scattered.f_cos * emitted * (weight / light.pdf_sa);
    if !(radiance.max_element() > 0.0) {
        return;
    }
    let org = float::spawn_origin(vertex.at.p, vertex.at.n_g, vertex.at.error, light.wi);
    match light.target {
        None => wave.shadows.push(path.slot, radiance, org, light.wi, f32::INFINITY),
        Some(target) => {
            if let Some(segment) = float::shadow_segment(org, target.position, target.normal, target.error) {
                wave.shadows.push(path.slot, radiance, org, segment.dir, segment.tfar);
            }
        }
    }
}

/// Value of the emission texture at a sampled light point, times the probability that the emitter is there.
#[inline(always)]
pub(super) fn emission_texel(context: &Context, point: &TexturePoint) -> Vec3 {
    let triangle = &context.geometry.triangles[point.triangle as usize];
    let slot = context.scene.materials[triangle.material as usize].emissive_texture;
    let uv = slot.and_then(|slot| context.geometry.uv(triangle.attributes, slot.uv_set, point.barycentric));
    let there = if context.plan.features.alpha {
        context.alpha.coverage(context, triangle.material, (triangle.attributes, point.barycentric))
    } else {
        1.0
    };
    match (slot, uv) {
        (Some(slot), Some(uv)) => texture::lookup(&context.scene.textures[slot.texture.index()], uv).truncate() * there,
        _ => Vec3::splat(there),
    }
}

/// A factor times its texture, where there is one.
#[inline(always)]
fn textured(context: &Context, at: &Interaction, factor: Vec3, slot: Option<TextureSlot>) -> Vec3 {
    match (slot, slot.and_then(|slot| at.uv_of(context.geometry, slot.uv_set))) {
        (Some(slot), Some(uv)) => {
            factor * texture::lookup(&context.scene.textures[slot.texture.index()], uv).truncate()
        }
        _ => factor,
    }
}

/// Beer–Lambert over the last edge: through the medium the path carries, or, when the camera started inside a solid,
/// through the solid whose inside was hit.
#[inline(always)]
fn absorption(context: &Context, material: &Material, path: &PathLane, vertex: &Vertex) -> Vec3 {
    let inside = if path.medium != NO_MEDIUM {
        &context.scene.materials[path.medium as usize]
    } else if !vertex.front && material.transmission > 0.0 && material.thickness > 0.0 {
        material
    } else {
        return Vec3::ONE;
    };
    transmittance(inside, vertex.t)
}

/// Fraction of light left after `distance_m` inside a solid of this material.
pub(super) fn transmittance(material: &Material, distance_m: f32) -> Vec3 {
    let exponent = distance_m / material.attenuation_distance_m;
    let c = material.attenuation_color;
    if exponent == 0.0 { Vec3::ONE } else { Vec3::new(c.x.powf(exponent), c.y.powf(exponent), c.z.powf(exponent)) }
}
