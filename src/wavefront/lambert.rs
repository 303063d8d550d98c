//! The lean kernel: untextured exact Lambert surfaces, sixteen lanes at a time.
//!
//! Every step is a branch-free loop over columns that LLVM turns into vector code; lookups by index (triangles, materials),
//! lights that have to be chosen, and the squeeze go lane by lane. The numbers are those of the general kernel in
//! `shade`, which a test holds against this one.

use super::columns::{Lane, Lane3, Mask, Points, ZERO, ZERO3, bits, get, set, spread};
use super::isa::Isa;
use super::light_sample::LightLanes;
use super::state::{Carried, NO_MEDIUM, PathBlock, Paths, ShadowLanes, Shadows, Sums, Survivors, Wave};
use super::{Context, shade};
use crate::backend::batch::{LANES, RayHitBlock};
use crate::math::float;
use crate::math::frame::Frame;
use crate::math::warp;
use crate::plan::options::{Roulette, Strategy};
use crate::sampler::{Scheme, dims};
use crate::shading::interaction::Interaction;
use crate::shading::{mis, roulette};
use std::f32::consts::FRAC_1_PI;

/// Where a block's shadow rays, survivors and emission go.
struct Outputs<'w> {
    next: &'w mut Paths,
    shadows: &'w mut Shadows,
    sums: &'w mut Sums,
}

/// Sixteen surface points and the paths that met them, as columns.
#[repr(C, align(64))]
struct Block {
    /// Lanes that are shaded.
    active: Mask,
    beta: Lane3,
    albedo: Lane3,
    p: Lane3,
    /// Geometric normal, turned to the side of the viewer.
    n_g: Lane3,
    /// Shading normal, turned likewise.
    n_s: Lane3,
    error: Lane,
}

/// Shades the dense blocks where they lie, then the queue. Returns how many paths the depth limit ended.
#[inline(always)]
pub fn run<S: Scheme, I: Isa>(context: &Context, wave: &mut Wave, edge: u32) -> u64 {
    let blocks = wave.current.blocks();
    let Wave { current, next, shadows, queues, dense, sums, .. } = wave;
    let mut outputs = Outputs { next, shadows, sums };
    let mut capped = 0;
    for block in 0..blocks {
        let lanes = dense[block];
        if lanes != 0 {
            capped +=
                shade_block::<S, I>(context, &current.rays[block], &current.paths[block], lanes, &mut outputs, edge);
        }
    }
    for lanes in queues[super::queue::Kind::Lambert as usize].chunks(LANES) {
        let (rays, paths) = pack(current, lanes);
        let lanes = (0xFFFFu32 >> (LANES - lanes.len())) as u16;
        capped += shade_block::<S, I>(context, &rays, &paths, lanes, &mut outputs, edge);
    }
    capped
}

/// Copies scattered lanes into one block.
fn pack(current: &Paths, lanes: &[u32]) -> (RayHitBlock, PathBlock) {
    let (mut rays, mut paths) = (RayHitBlock::EMPTY, PathBlock::EMPTY);
    for (to, &lane) in lanes.iter().enumerate() {
        let (block, i) = (lane as usize / LANES, lane as usize % LANES);
        let from = &current.rays[block];
        rays.ray.set(to, from.ray.org(i), from.ray.dir(i), from.ray.tfar[i]);
        rays.hit.u[to] = from.hit.u[i];
        rays.hit.v[to] = from.hit.v[i];
        rays.hit.prim[to] = from.hit.prim[i];
        rays.hit.geom[to] = from.hit.geom[i];
        rays.hit.inst[to] = from.hit.inst[i];
        paths.set(to, &current.paths[block].get(i));
    }
    (rays, paths)
}

#[inline(always)]
fn shade_block<S: Scheme, I: Isa>(
    context: &Context,
    rays: &RayHitBlock,
    paths: &PathBlock,
    lanes: u16,
    outputs: &mut Outputs,
    edge: u32,
) -> u64 {
    let mut block = Block::gather::<I>(context, rays, paths, lanes, outputs.sums, edge);
    if edge >= context.plan.max_depth {
        for i in (0..LANES).filter(|i| lanes >> i & 1 == 1) {
            outputs.sums.capped.add(get(&block.beta, i) * get(&block.albedo, i) * paths.eta_scale[i]);
        }
        return u64::from(lanes.count_ones());
    }
    block.shade::<S, I>(context, paths, outputs, edge);
    0
}

impl Block {
    /// Looks the lanes' hits up and adds what emissive surfaces give by themselves.
    #[inline(always)]
    fn gather<I: Isa>(
        context: &Context,
        rays: &RayHitBlock,
        paths: &PathBlock,
        lanes: u16,
        sums: &mut Sums,
        edge: u32,
    ) -> Self {
        let features = &context.plan.features;
        let (smooth, special) = (features.smooth_normals, features.smooth_normals || features.instancing);
        let points = Points::gather::<I>(context.geometry, rays, lanes, smooth, special);
        let mut beta = paths.beta;
        if features.absorption {
            for i in 0..LANES {
                if lanes >> i & 1 == 1 && paths.medium[i] != NO_MEDIUM {
                    let medium = &context.scene.materials[paths.medium[i] as usize];
                    let transmitted = shade::transmittance(medium, rays.ray.tfar[i]);
                    let absorbed = get(&beta, i) * transmitted;
                    set(&mut beta, i, absorbed);
                }
            }
        }
        let mut albedo = ZERO3;
        for i in 0..LANES {
            set(&mut albedo, i, context.scene.materials[points.material[i] as usize].base_color);
        }

        let Points { p, error, mut n_g, mut n_s, .. } = points;
        let mut cos_g = ZERO;
        for i in 0..LANES {
            let wo_x = -rays.ray.dir_x[i];
            let wo_y = -rays.ray.dir_y[i];
            let wo_z = -rays.ray.dir_z[i];
            let (gx, gy, gz) = (n_g[0][i], n_g[1][i], n_g[2][i]);
            let cos = gx * wo_x + gy * wo_y + gz * wo_z;
            let side = 1.0f32.copysign(cos);
            let (gx, gy, gz) = (gx * side, gy * side, gz * side);
            let (sx, sy, sz) = (n_s[0][i] * side, n_s[1][i] * side, n_s[2][i] * side);
            // An interpolated normal that faces away from the viewer has no meaning there: shade flat.
            let facing = sx * wo_x + sy * wo_y + sz * wo_z > 0.0;
            n_g[0][i] = gx;
            n_g[1][i] = gy;
            n_g[2][i] = gz;
            n_s[0][i] = if facing { sx } else { gx };
            n_s[1][i] = if facing { sy } else { gy };
            n_s[2][i] = if facing { sz } else { gz };
            cos_g[i] = cos;
        }
        if features.area_lights {
            for i in 0..LANES {
                if lanes >> i & 1 == 1 && points.light[i] != u32::MAX && cos_g[i] > 0.0 {
                    let path = paths.get(i);
                    let at = Interaction::at(context.geometry, &rays.hit_unchecked(i), false);
                    let weight =
                        shade::emission_weight(context, &path, rays.ray.org(i), &at, rays.ray.tfar[i], cos_g[i]);
                    if weight > 0.0 {
                        let emitted = context.scene.materials[points.material[i] as usize].emissive;
                        sums.add(path.slot, edge, get(&beta, i) * emitted * weight);
                    }
                }
            }
        }
        Block { active: spread(lanes), beta, albedo, p, n_g, n_s, error }
    }

    /// Roulette, light sample, BSDF sample; appends shadow rays and survivors.
    #[inline(always)]
    fn shade<S: Scheme, I: Isa>(&mut self, context: &Context, paths: &PathBlock, outputs: &mut Outputs, edge: u32) {
        let u_light = random::<S>(paths, dims::light(edge));
        let u_bsdf = random::<S>(paths, dims::bsdf(edge));
        self.roulette(context, &paths.eta_scale, &u_light[3], edge);
        if context.plan.samples_lights() {
            let receiver = self.receivers();
            let mut light = LightLanes::sample(context, &self.active, &receiver, &self.n_s, &u_light);
            self.shadow_rays::<I>(context, &mut light, paths, outputs.shadows);
        }
        self.scatter::<I>(paths, &u_bsdf, context.carried, outputs.next);
    }

    /// Ends paths that cannot return their cost and scales up the others. Surfaces without any albedo end all.
    #[inline(always)]
    fn roulette(&mut self, context: &Context, eta_scale: &Lane, u: &Lane, edge: u32) {
        let mut q = [1.0; LANES];
        match context.plan.roulette {
            Roulette::Off => {}
            Roulette::On if edge < context.plan.roulette_start => {}
            Roulette::On => {
                for i in 0..LANES {
                    q[i] = roulette::survival_from(get(&self.beta, i), eta_scale[i]);
                }
            }
            Roulette::Constant(constant) => q = [roulette::on_lattice(constant); LANES],
        }
        for i in 0..LANES {
            let scale = 1.0 / q[i];
            self.beta[0][i] *= scale;
            self.beta[1][i] *= scale;
            self.beta[2][i] *= scale;
            let albedo = self.albedo[0][i].max(self.albedo[1][i]).max(self.albedo[2][i]);
            self.active[i] &= u32::from(u[i] < q[i]) & u32::from(albedo > 0.0);
        }
    }

    /// Where rays leave on the viewer's side.
    #[inline(always)]
    fn receivers(&self) -> Lane3 {
        let mut receiver = ZERO3;
        for i in 0..LANES {
            let n_g = get(&self.n_g, i);
            set(&mut receiver, i, float::spawn_origin(get(&self.p, i), n_g, self.error[i], n_g));
        }
        receiver
    }

    /// Next-event estimation of all lanes; appends the shadow rays that could carry something.
    #[inline(always)]
    fn shadow_rays<I: Isa>(&self, context: &Context, light: &mut LightLanes, paths: &PathBlock, shadows: &mut Shadows) {
        // The heuristic is chosen once, outside the loop. A delta light counts as one that the BSDF never finds.
        match context.plan.strategy {
            Strategy::MisPower => self.weigh(light, mis::power_weight),
            Strategy::MisBalance => self.weigh(light, mis::balance_weight),
            Strategy::LightOnly => self.weigh(light, |_, _| 1.0),
            Strategy::BsdfOnly => return,
        }
        let mut rays = ShadowLanes { org: ZERO3, dir: ZERO3, tfar: ZERO, radiance: light.radiance };
        let mut keep: Mask = [0; LANES];
        for i in 0..LANES {
            let wi = get(&light.wi, i);
            let origin = float::spawn_origin(get(&self.p, i), get(&self.n_g, i), self.error[i], wi);
            let segment = float::segment_to(origin, get(&light.target, i), get(&light.normal, i), light.error[i]);
            let finite = light.infinite[i] == 0;
            set(&mut rays.org, i, origin);
            rays.dir[0][i] = if finite { segment.dir.x } else { wi.x };
            rays.dir[1][i] = if finite { segment.dir.y } else { wi.y };
            rays.dir[2][i] = if finite { segment.dir.z } else { wi.z };
            let end = if finite { segment.tfar } else { f32::MAX };
            let carried = light.radiance[0][i].max(light.radiance[1][i]).max(light.radiance[2][i]);
            keep[i] = u32::from(end > 0.0) & u32::from(end < f32::INFINITY) & u32::from(carried > 0.0);
            rays.tfar[i] = if finite { end } else { f32::INFINITY };
        }
        shadows.append::<I>(&rays, &paths.slot, bits(&keep));
    }

    /// Turns the radiance of each light sample into what its shadow ray carries; 0 where nothing can arrive.
    #[inline(always)]
    fn weigh(&self, light: &mut LightLanes, heuristic: impl Fn(f32, f32) -> f32) {
        for i in 0..LANES {
            let wi = get(&light.wi, i);
            let cos = get(&self.n_s, i).dot(wi);
            let visible = (cos > 0.0) & (get(&self.n_g, i).dot(wi) > 0.0) & (light.pdf_sa[i] > 0.0);
            let visible = visible & (self.active[i] != 0);
            let pdf_bsdf = cos * FRAC_1_PI;
            let weight = heuristic(light.pdf_sa[i], pdf_bsdf * light.shared[i]);
            // In the order of the general kernel, so that both round alike: β · f · radiance · weight/pdf.
            let factor = if visible { weight / light.pdf_sa[i] } else { 0.0 };
            for c in 0..3 {
                let f_cos = self.albedo[c][i] * pdf_bsdf;
                light.radiance[c][i] = self.beta[c][i] * f_cos * light.radiance[c][i] * factor;
            }
        }
    }

    /// Cosine-distributed directions; appends the paths that go on.
    #[inline(always)]
    fn scatter<I: Isa>(&self, paths: &PathBlock, u: &[Lane; 4], carried: Carried, next: &mut Paths) {
        let mut to = Survivors { org: ZERO3, dir: ZERO3, beta: ZERO3, last_pdf_sa: ZERO, last_n: self.n_s };
        let mut keep: Mask = [0; LANES];
        for i in 0..LANES {
            let (n_s, n_g) = (get(&self.n_s, i), get(&self.n_g, i));
            let local = warp::cosine_hemisphere([u[1][i], u[2][i]]);
            let wi = Frame::from_normal(n_s).to_world(local);
            set(&mut to.dir, i, wi);
            set(&mut to.org, i, float::spawn_origin(get(&self.p, i), n_g, self.error[i], wi));
            to.last_pdf_sa[i] = warp::cosine_hemisphere_pdf(local.z);
            keep[i] = self.active[i] & u32::from(n_g.dot(wi) > 0.0);
        }
        for i in 0..LANES {
            let mut largest = 0.0f32;
            for c in 0..3 {
                to.beta[c][i] = self.beta[c][i] * self.albedo[c][i];
                largest = largest.max(to.beta[c][i]);
            }
            // A throughput that is NaN goes on, to be counted.
            keep[i] &= u32::from(!(largest <= 0.0));
        }
        next.append::<I>(&to, paths, bits(&keep), carried);
    }
}

/// One set of four numbers per lane.
#[inline(always)]
fn random<S: Scheme>(paths: &PathBlock, set: u32) -> [Lane; 4] {
    let mut u = [ZERO; 4];
    for i in 0..LANES {
        let point = S::sample_4d(paths.index[i], [paths.seed_lo[i], paths.seed_hi[i]], set);
        for d in 0..4 {
            u[d][i] = point[d];
        }
    }
    u
}
