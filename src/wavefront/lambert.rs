//! The lean kernel: untextured exact Lambert surfaces, sixteen lanes at a time.
//!
//! Gathers the queue's lanes into columns, then every step is a branch-free loop over the columns that LLVM turns into
//! vector code; only lookups by index (triangles, lights) and the final squeeze go lane by lane. The numbers are those of
//! the general kernel in `shade`, which a test holds against this one.

use glam::Vec3;

use super::state::{NO_MEDIUM, PathLane, Paths, Wave};
use super::{Context, shade};
use crate::backend::batch::LANES;
use crate::math::float;
use crate::math::frame::Frame;
use crate::math::warp;
use crate::plan::options::{Roulette, Strategy};
use crate::sampler::{Scheme, dims};
use crate::shading::interaction::Interaction;
use crate::shading::{mis, roulette};
use std::f32::consts::FRAC_1_PI;

type Lane = [f32; LANES];
type Lane3 = [Lane; 3];

/// A condition per lane, 1 or 0. As wide as the numbers it selects among: loops that mix widths do not vectorise.
type Mask = [u32; LANES];

const ZERO: Lane = [0.0; LANES];
const ZERO3: Lane3 = [ZERO; 3];

#[inline(always)]
fn get(column: &Lane3, i: usize) -> Vec3 {
    Vec3::new(column[0][i], column[1][i], column[2][i])
}

#[inline(always)]
fn set(column: &mut Lane3, i: usize, v: Vec3) {
    column[0][i] = v.x;
    column[1][i] = v.y;
    column[2][i] = v.z;
}

/// Sixteen surface points and the paths that met them, as columns.
#[repr(C, align(64))]
struct Block {
    beta: Lane3,
    eta_scale: Lane,
    albedo: Lane3,
    wo: Lane3,
    p: Lane3,
    /// Geometric normal, turned to the side of `wo`.
    n_g: Lane3,
    /// Shading normal, turned likewise.
    n_s: Lane3,
    error: Lane,
    slot: [u32; LANES],
    seed_lo: [u32; LANES],
    seed_hi: [u32; LANES],
    index: [u32; LANES],
    medium: [u32; LANES],
}

/// A light sample for each lane.
#[repr(C, align(64))]
struct LightBlock {
    wi: Lane3,
    radiance: Lane3,
    /// 0 where there is no sample.
    pdf_sa: Lane,
    target: Lane3,
    normal: Lane3,
    error: Lane,
    /// 1 where the light is at infinity.
    infinite: Mask,
    /// 0 for delta lights, which BSDF sampling cannot find, else 1.
    shared: Lane,
}

/// Shades every lane of `queue`. Returns how many paths the depth limit ended.
#[inline(always)]
pub fn run<S: Scheme>(context: &Context, wave: &mut Wave, queue: &[u32], edge: u32) -> u64 {
    let mut capped = 0;
    for lanes in queue.chunks(LANES) {
        let mut block = Block::gather(context, wave, lanes, edge);
        if edge >= context.plan.max_depth {
            capped += lanes.len() as u64;
            for i in 0..lanes.len() {
                wave.capped.add(get(&block.beta, i) * get(&block.albedo, i) * block.eta_scale[i]);
            }
            continue;
        }
        block.shade::<S>(context, wave, lanes.len(), edge);
    }
    capped
}

impl Block {
    /// Looks the lanes' hits up and adds what emissive surfaces give by themselves.
    #[inline(always)]
    fn gather(context: &Context, wave: &mut Wave, lanes: &[u32], edge: u32) -> Self {
        let mut b = Block {
            beta: ZERO3,
            eta_scale: [1.0; LANES],
            albedo: ZERO3,
            wo: [ZERO, ZERO, [1.0; LANES]],
            p: ZERO3,
            n_g: [ZERO, ZERO, [1.0; LANES]],
            n_s: [ZERO, ZERO, [1.0; LANES]],
            error: ZERO,
            slot: [0; LANES],
            seed_lo: [0; LANES],
            seed_hi: [0; LANES],
            index: [0; LANES],
            medium: [NO_MEDIUM; LANES],
        };
        let smooth = context.plan.features.smooth_normals;
        for (i, &lane) in lanes.iter().enumerate() {
            let (block, at) = (lane as usize / LANES, lane as usize % LANES);
            let rays = &wave.current.rays[block];
            let paths = &wave.current.paths[block];
            let hit = rays.hit_unchecked(at);
            let surface = Interaction::at(context.geometry, &hit, smooth);
            let material = &context.scene.materials[surface.material as usize];
            let (org, wo) = (rays.ray.org(at), -rays.ray.dir(at));
            let cos = surface.n_g.dot(wo);
            let mut path = paths.get(at);
            if context.plan.features.absorption && path.medium != NO_MEDIUM {
                path.beta *= shade::transmittance(&context.scene.materials[path.medium as usize], hit.t);
            }

            let side = 1.0f32.copysign(cos);
            let n_g = surface.n_g * side;
            // An interpolated normal that faces away from the viewer has no meaning there: shade flat.
            let n_s = surface.n_s * side;
            let n_s = if n_s.dot(wo) > 0.0 { n_s } else { n_g };
            set(&mut b.beta, i, path.beta);
            set(&mut b.albedo, i, material.base_color);
            set(&mut b.wo, i, wo);
            set(&mut b.p, i, surface.p);
            set(&mut b.n_g, i, n_g);
            set(&mut b.n_s, i, n_s);
            b.error[i] = surface.error;
            b.eta_scale[i] = path.eta_scale;
            b.slot[i] = path.slot;
            b.seed_lo[i] = path.seed[0];
            b.seed_hi[i] = path.seed[1];
            b.index[i] = path.index;
            b.medium[i] = path.medium;

            if cos > 0.0 && material.is_emissive() {
                let weight = shade::emission_weight(context, &path, org, &surface, hit.t, cos);
                if weight > 0.0 {
                    wave.add(path.slot, edge, path.beta * material.emissive * weight);
                }
            }
        }
        b
    }

    /// Roulette, light sample, BSDF sample; pushes shadow rays and survivors.
    #[inline(always)]
    fn shade<S: Scheme>(&mut self, context: &Context, wave: &mut Wave, n: usize, edge: u32) {
        let u_light = self.random::<S>(dims::light(edge));
        let u_bsdf = self.random::<S>(dims::bsdf(edge));
        let alive = self.roulette(context, &u_light[3], n, edge);

        if context.plan.samples_lights() {
            let mut light = self.sample_lights(context, &alive, &u_light);
            self.shadow_rays(context, wave, &mut light);
        }
        self.scatter(&mut wave.next, &alive, &u_bsdf);
    }

    /// One set of four numbers per lane.
    #[inline(always)]
    fn random<S: Scheme>(&self, set: u32) -> [Lane; 4] {
        let mut u = [ZERO; 4];
        for i in 0..LANES {
            let point = S::sample_4d(self.index[i], [self.seed_lo[i], self.seed_hi[i]], set);
            for d in 0..4 {
                u[d][i] = point[d];
            }
        }
        u
    }

    /// Ends paths that cannot return their cost and scales up the others. Surfaces without any albedo end all.
    #[inline(always)]
    fn roulette(&mut self, context: &Context, u: &Lane, n: usize, edge: u32) -> Mask {
        let mut q = [1.0; LANES];
        match context.plan.roulette {
            Roulette::Off => {}
            Roulette::On if edge < context.plan.roulette_start => {}
            Roulette::On => {
                for i in 0..LANES {
                    q[i] = roulette::survival_from(get(&self.beta, i), self.eta_scale[i]);
                }
            }
            Roulette::Constant(constant) => q = [roulette::on_lattice(constant); LANES],
        }
        let mut alive = [0; LANES];
        for i in 0..LANES {
            let scale = 1.0 / q[i];
            self.beta[0][i] *= scale;
            self.beta[1][i] *= scale;
            self.beta[2][i] *= scale;
            let albedo = self.albedo[0][i].max(self.albedo[1][i]).max(self.albedo[2][i]);
            alive[i] = u32::from(u[i] < q[i]) & u32::from(albedo > 0.0);
        }
        for dead in &mut alive[n..] {
            *dead = 0;
        }
        alive
    }

    /// Draws one light point per living lane; lookups by index, lane by lane.
    #[inline(always)]
    fn sample_lights(&self, context: &Context, alive: &Mask, u: &[Lane; 4]) -> LightBlock {
        let mut light = LightBlock {
            wi: [ZERO, ZERO, [1.0; LANES]],
            radiance: ZERO3,
            pdf_sa: ZERO,
            target: ZERO3,
            normal: ZERO3,
            error: ZERO,
            infinite: [0; LANES],
            shared: [1.0; LANES],
        };
        for i in 0..LANES {
            if alive[i] == 0 {
                continue;
            }
            // Where the light's ray will start, and a BSDF-sampled one.
            let n_g = get(&self.n_g, i);
            let receiver = float::spawn_origin(get(&self.p, i), n_g, self.error[i], n_g);
            let chosen = context.lights.sample(receiver, get(&self.n_s, i), [u[0][i], u[1][i], u[2][i]]);
            let Some(sample) = chosen else { continue };
            let mut radiance = sample.radiance;
            if let Some(point) = sample.texture_point {
                radiance *= shade::emission_texel(context, &point);
            }
            set(&mut light.wi, i, sample.wi);
            set(&mut light.radiance, i, radiance);
            light.pdf_sa[i] = sample.pdf_sa;
            light.shared[i] = if sample.delta { 0.0 } else { 1.0 };
            match sample.target {
                None => light.infinite[i] = 1,
                Some(target) => {
                    set(&mut light.target, i, target.position);
                    set(&mut light.normal, i, target.normal);
                    light.error[i] = target.error;
                }
            }
        }
        light
    }

    /// Next-event estimation of all lanes; pushes the shadow rays that could carry something.
    #[inline(always)]
    fn shadow_rays(&self, context: &Context, wave: &mut Wave, light: &mut LightBlock) {
        // The heuristic is chosen once, outside the loop. A delta light counts as one that the BSDF never finds.
        match context.plan.strategy {
            Strategy::MisPower => self.weigh(light, mis::power_weight),
            Strategy::MisBalance => self.weigh(light, mis::balance_weight),
            Strategy::LightOnly => self.weigh(light, |_, _| 1.0),
            Strategy::BsdfOnly => return,
        }
        let (mut org, mut dir, mut tfar) = (ZERO3, ZERO3, ZERO);
        let mut keep: Mask = [0; LANES];
        for i in 0..LANES {
            let wi = get(&light.wi, i);
            let origin = float::spawn_origin(get(&self.p, i), get(&self.n_g, i), self.error[i], wi);
            let segment = float::segment_to(origin, get(&light.target, i), get(&light.normal, i), light.error[i]);
            let finite = light.infinite[i] == 0;
            set(&mut org, i, origin);
            set(&mut dir, i, if finite { segment.dir } else { wi });
            let end = if finite { segment.tfar } else { f32::MAX };
            let carried = light.radiance[0][i].max(light.radiance[1][i]).max(light.radiance[2][i]);
            keep[i] = u32::from(end > 0.0) & u32::from(end < f32::INFINITY) & u32::from(carried > 0.0);
            tfar[i] = if finite { end } else { f32::INFINITY };
        }
        for i in 0..LANES {
            if keep[i] != 0 {
                wave.shadows.push(self.slot[i], get(&light.radiance, i), get(&org, i), get(&dir, i), tfar[i]);
            }
        }
    }

    /// Turns the radiance of each light sample into what its shadow ray carries; 0 where nothing can arrive.
    #[inline(always)]
    fn weigh(&self, light: &mut LightBlock, heuristic: impl Fn(f32, f32) -> f32) {
        for i in 0..LANES {
            let wi = get(&light.wi, i);
            let cos = get(&self.n_s, i).dot(wi);
            let visible = (cos > 0.0) & (get(&self.n_g, i).dot(wi) > 0.0) & (light.pdf_sa[i] > 0.0);
            let pdf_bsdf = cos * FRAC_1_PI;
            let weight = heuristic(light.pdf_sa[i], pdf_bsdf * light.shared[i]);
            let factor = if visible { pdf_bsdf * (weight / light.pdf_sa[i]) } else { 0.0 };
            for c in 0..3 {
                light.radiance[c][i] *= self.beta[c][i] * self.albedo[c][i] * factor;
            }
        }
    }

    /// Cosine-distributed directions; pushes the paths that go on.
    #[inline(always)]
    fn scatter(&mut self, next: &mut Paths, alive: &Mask, u: &[Lane; 4]) {
        let (mut org, mut dir, mut pdf_sa) = (ZERO3, ZERO3, ZERO);
        let mut keep: Mask = [0; LANES];
        for i in 0..LANES {
            let (n_s, n_g) = (get(&self.n_s, i), get(&self.n_g, i));
            let local = warp::cosine_hemisphere([u[1][i], u[2][i]]);
            let wi = Frame::from_normal(n_s).to_world(local);
            set(&mut dir, i, wi);
            set(&mut org, i, float::spawn_origin(get(&self.p, i), n_g, self.error[i], wi));
            pdf_sa[i] = warp::cosine_hemisphere_pdf(local.z);
            keep[i] = alive[i] & u32::from(n_g.dot(wi) > 0.0);
        }
        for i in 0..LANES {
            let mut largest = 0.0f32;
            for c in 0..3 {
                self.beta[c][i] *= self.albedo[c][i];
                largest = largest.max(self.beta[c][i]);
            }
            // A throughput that is NaN goes on, to be counted.
            keep[i] &= u32::from(!(largest <= 0.0));
        }
        for i in 0..LANES {
            if keep[i] != 0 {
                let path = PathLane {
                    beta: get(&self.beta, i),
                    eta_scale: self.eta_scale[i],
                    last_pdf_sa: pdf_sa[i],
                    last_n: get(&self.n_s, i),
                    slot: self.slot[i],
                    seed: [self.seed_lo[i], self.seed_hi[i]],
                    index: self.index[i],
                    medium: self.medium[i],
                };
                next.push(&path, get(&org, i), get(&dir, i));
            }
        }
    }
}
