//! Sixteen path vertices as columns: where the lanes of a block met surfaces, what their paths carry, and what the surfaces
//! give by themselves. The kernels in `lambert`, `opaque` and `general` say how they scatter; `shade` drives them.

use glam::Vec3;

use super::columns::{Lane, Lane3, Mask, Points, ZERO, ZERO3, get, set, spread};
use super::isa::Isa;
use super::state::{PathBlock, Sums};
use super::{Context, emission, footprint};
use crate::backend::batch::{LANES, RayHitBlock};
use crate::math::float;
use crate::plan::options::Roulette;
use crate::shading::roulette;

/// See the module.
#[repr(C, align(64))]
pub struct Vertices {
    /// Lanes that are shaded.
    pub active: Mask,
    /// Throughput.
    pub beta: Lane3,
    /// World position.
    pub p: Lane3,
    /// Bound of its error, metres.
    pub error: Lane,
    /// Unit direction to where the path came from.
    pub wo: Lane3,
    /// Geometric normal, turned to the side of the viewer.
    pub n_g: Lane3,
    /// Shading normal, turned likewise; the geometric one where it faces away.
    pub n_s: Lane3,
    /// 1 where the viewer is on the authored front side, −1 behind: times this, normals point to the front.
    pub side: Lane,
    /// Index into `Scene::materials`.
    pub material: [u32; LANES],
    /// Light that the triangle is, or `u32::MAX`.
    pub light: [u32; LANES],
    /// Width of the path here, metres; 0 unless textures are averaged over it.
    pub width: Lane,
    /// Cosine between the front's geometric normal and `wo`.
    cos_g: Lane,
}

impl Vertices {
    /// Looks the hits of the lanes in `lanes` (not empty) up; the other lanes repeat one of them.
    #[inline(always)]
    pub fn gather<I: Isa>(context: &Context, rays: &RayHitBlock, paths: &PathBlock, lanes: u16) -> Self {
        let features = &context.plan.features;
        let points = Points::gather::<I>(context.geometry, rays, lanes, features.smooth_normals, features.instancing);
        let Points { p, error, mut n_g, mut n_s, material, light } = points;
        let (mut wo, mut side, mut cos_g) = (ZERO3, ZERO, ZERO);
        for i in 0..LANES {
            wo[0][i] = -rays.ray.dir_x[i];
            wo[1][i] = -rays.ray.dir_y[i];
            wo[2][i] = -rays.ray.dir_z[i];
        }
        for i in 0..LANES {
            let to = get(&wo, i);
            let cos = get(&n_g, i).dot(to);
            let turn = 1.0f32.copysign(cos);
            let (g, s) = (get(&n_g, i) * turn, get(&n_s, i) * turn);
            // An interpolated normal that faces away from the viewer has no meaning there: shade flat.
            let facing = s.dot(to) > 0.0;
            set(&mut n_g, i, g);
            n_s[0][i] = if facing { s.x } else { g.x };
            n_s[1][i] = if facing { s.y } else { g.y };
            n_s[2][i] = if facing { s.z } else { g.z };
            side[i] = turn;
            cos_g[i] = cos;
        }
        Vertices {
            active: spread(lanes),
            beta: paths.beta,
            p,
            error,
            wo,
            n_g,
            n_s,
            side,
            material,
            light,
            width: ZERO,
            cos_g,
        }
    }

    /// Takes off what the solids on the last edge absorbed.
    #[inline(always)]
    pub fn absorb(&mut self, context: &Context, rays: &RayHitBlock, paths: &PathBlock) {
        for i in 0..LANES {
            if self.active[i] != 0 {
                let material = &context.scene.materials[self.material[i] as usize];
                let medium = paths.medium[i];
                let left = emission::absorption(context, material, medium, self.side[i] > 0.0, rays.ray.tfar[i]);
                let beta = get(&self.beta, i) * left;
                set(&mut self.beta, i, beta);
            }
        }
    }

    /// Adds what emissive surfaces give on their front side.
    #[inline(always)]
    pub fn emit(&self, context: &Context, rays: &RayHitBlock, paths: &PathBlock, sums: &mut Sums, edge: u32) {
        for i in 0..LANES {
            if self.active[i] == 0 || !(self.cos_g[i] > 0.0) {
                continue;
            }
            let material = &context.scene.materials[self.material[i] as usize];
            if !material.is_emissive() {
                continue;
            }
            let path = paths.get(i);
            let hit =
                emission::Emitter { light: self.light[i], distance_m: rays.ray.tfar[i], cos_light: self.cos_g[i] };
            let weight = emission::weight(context, &path, rays.ray.org(i), &hit);
            if weight > 0.0 {
                let radiance =
                    emission::textured(context, &rays.hit_unchecked(i), material.emissive, material.emissive_texture);
                sums.add(path.slot, edge, get(&self.beta, i) * radiance * weight);
            }
        }
    }

    /// Adds the colour of unlit surfaces and ends their paths.
    #[inline(always)]
    pub fn show_unlit(&mut self, context: &Context, rays: &RayHitBlock, paths: &PathBlock, sums: &mut Sums, edge: u32) {
        for i in 0..LANES {
            let material = &context.scene.materials[self.material[i] as usize];
            if self.active[i] != 0 && material.unlit {
                let hit = rays.hit_unchecked(i);
                let color = if context.plan.features.footprints {
                    footprint::unlit_color(context, rays, self, i, material)
                } else {
                    emission::unlit_color(context, &hit, material)
                };
                sums.add(paths.slot[i], edge, get(&self.beta, i) * color);
                self.active[i] = 0;
            }
        }
    }

    /// Notes what the depth limit cuts off. Returns how many paths it ends.
    #[inline(always)]
    pub fn cap(&self, context: &Context, paths: &PathBlock, sums: &mut Sums) -> u64 {
        let mut ended = 0;
        for i in (0..LANES).filter(|&i| self.active[i] != 0) {
            let bound = context.scene.materials[self.material[i] as usize].reflectance_bound();
            sums.capped.add(get(&self.beta, i) * bound * paths.eta_scale[i]);
            ended += 1;
        }
        ended
    }

    /// Ends paths that cannot return their cost and scales up the others.
    #[inline(always)]
    pub fn roulette(&mut self, context: &Context, eta_scale: &Lane, u: &Lane, edge: u32) {
        let mut q = [1.0; LANES];
        match context.plan.roulette {
            Roulette::Off => return,
            // A path that carries nothing ends at any vertex.
            Roulette::On if edge < context.plan.roulette_start => {
                for i in 0..LANES {
                    q[i] = roulette::survival(get(&self.beta, i), eta_scale[i], edge, context.plan.roulette_start);
                }
            }
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
            self.active[i] &= u32::from(u[i] < q[i]);
        }
    }

    /// Where rays leave on the viewer's side.
    #[inline(always)]
    pub fn receivers(&self) -> Lane3 {
        let mut receiver = ZERO3;
        for i in 0..LANES {
            let n_g = get(&self.n_g, i);
            set(&mut receiver, i, float::spawn_origin(get(&self.p, i), n_g, self.error[i], n_g));
        }
        receiver
    }

    /// One lane as the emissive triangle that it met after `distance_m`.
    #[inline(always)]
    pub fn emitter(&self, i: usize, distance_m: f32) -> emission::Emitter {
        emission::Emitter { light: self.light[i], distance_m, cos_light: self.cos_g[i] }
    }

    /// The geometric normal of the authored front side of one lane.
    #[inline(always)]
    pub fn front_n_g(&self, i: usize) -> Vec3 {
        get(&self.n_g, i) * self.side[i]
    }
}
