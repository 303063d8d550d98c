//! Sixteen path vertices as columns: where the lanes of a block met surfaces, and what their paths carry. `kernel` says
//! how they scatter; `shade` drives it.

use glam::Vec3;

use super::points::Points;
use super::tape::{Event, LANE, Tape};
use super::vertex::{self, End, Number, triple};
use super::wave::{PathBlock, Sums};
use super::world::World;
use crate::backend::batch::{INVALID_ID, LANES, RayHitBlock};
use crate::math::columns::{Lane, Lane3, Mask, ZERO, ZERO3, get, set, spread};
use crate::math::float;
use crate::math::simd::isa::Isa;
use crate::plan::options::Roulette;
use crate::shading::cone::Cone;
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
    pub cos_g: Lane,
    /// Index of refraction outside of the solid whose boundary this is; 1 unless media are kept.
    pub exterior: Lane,
    /// Wavelength of paths at dispersive solids, nm; 0 elsewhere.
    pub wavelength_nm: Lane,
}

impl Vertices {
    /// Looks the hits of the lanes in `lanes` (not empty) up; the other lanes repeat one of them.
    #[inline(always)]
    pub fn gather<I: Isa>(world: &World, rays: &RayHitBlock, paths: &PathBlock, lanes: u16) -> Self {
        let features = &world.features;
        let points = Points::gather::<I>(world.geometry, rays, lanes, features.smooth_normals, features.instancing);
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
            exterior: [1.0; LANES],
            wavelength_nm: ZERO,
        }
    }

    /// Works out how wide the paths are here.
    #[inline(always)]
    pub fn widen(&mut self, cones: &[Cone], rays: &RayHitBlock, paths: &PathBlock) {
        for i in (0..LANES).filter(|&i| self.active[i] != 0) {
            self.width[i] = cones[paths.slot[i] as usize].width_at(rays.ray.tfar[i]);
        }
    }

    /// Notes what the depth limit cuts off. Returns how many paths it ends.
    #[inline(always)]
    pub fn truncate(&self, world: &World, paths: &PathBlock, sums: &mut Sums) -> u64 {
        let mut ended = 0;
        for i in (0..LANES).filter(|&i| self.active[i] != 0) {
            let bound = world.reflectance_bounds[self.material[i] as usize];
            sums.truncated.add(get(&self.beta, i) * bound * paths.eta_scale[i]);
            ended += 1;
        }
        ended
    }

    /// Ends paths that cannot return their cost and scales up the others.
    #[inline(always)]
    pub fn roulette<T: Tape>(&mut self, world: &World, eta_scale: &Lane, u: &Lane, edge: u32, tape: &mut T) {
        let mut q = [1.0; LANES];
        match world.roulette {
            Roulette::Off => {}
            // A path that carries nothing ends at any vertex.
            Roulette::On if edge < world.roulette_start => {
                for i in 0..LANES {
                    q[i] = roulette::survival(get(&self.beta, i), eta_scale[i], edge, world.roulette_start);
                }
            }
            Roulette::On => {
                for i in 0..LANES {
                    q[i] = roulette::survival_from(get(&self.beta, i), eta_scale[i]);
                }
            }
            Roulette::Constant(constant) => q = [roulette::on_lattice(constant); LANES],
        }
        if T::ON && self.active[LANE] != 0 {
            let survived = u[LANE] < q[LANE];
            tape.note(|| {
                Event::Roulette(vertex::Roulette { survival: Number(q[LANE]), number: Number(u[LANE]), survived })
            });
            tape.note(|| Event::End(Some(if survived { End::Absorbed } else { End::Roulette })));
        }
        if world.roulette == Roulette::Off {
            return;
        }
        for i in 0..LANES {
            let scale = 1.0 / q[i];
            self.beta[0][i] *= scale;
            self.beta[1][i] *= scale;
            self.beta[2][i] *= scale;
            self.active[i] &= u32::from(u[i] < q[i]);
        }
    }

    /// Notes where the path that is written down is; `left` is what solids on the way left of its light.
    pub fn tell<T: Tape>(&self, world: &World, rays: &RayHitBlock, left: Vec3, tape: &mut T) {
        let side = self.side[LANE];
        let (hit, p) = (&rays.hit, get(&self.p, LANE).as_dvec3() + world.scene.origin);
        tape.note(|| {
            Event::Surface(vertex::Surface {
                distance_m: Number(rays.ray.tfar[LANE]),
                position_m: p.into(),
                error_m: Number(self.error[LANE]),
                normal_geometric: triple(get(&self.n_g, LANE) * side),
                normal_shading: triple(get(&self.n_s, LANE) * side),
                front: side > 0.0,
                material: world.scene.materials[self.material[LANE] as usize].name.clone(),
                kind: None,
                widest_alpha: None,
                mesh: hit.geom[LANE],
                triangle: hit.prim[LANE],
                instance: (hit.inst[LANE] != INVALID_ID).then_some(hit.inst[LANE]),
                transmittance: (left != Vec3::ONE).then(|| triple(left)),
            })
        });
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
}
