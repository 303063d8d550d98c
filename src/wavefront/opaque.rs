//! The kernel for opaque materials: metals, coats and diffuse bases with their textures, in columns.

use super::Context;
use super::columns::{Lane, Lane3, Mask, ZERO, ZERO3, get, set};
use super::factors::Factors;
use super::shade::{Bsdfs, Scattered};
use super::state::Survivors;
use super::vertices::Vertices;
use crate::backend::batch::{LANES, RayHitBlock};
use crate::math::frame::Frame;
use crate::shading::bsdf::albedo::Complement;
use crate::shading::bsdf::glossy::{Drawn, GlossyParams, Lobes};
use crate::shading::bsdf::microfacet::half_vector;
use crate::shading::surface;

/// Sixteen mixtures of lobes with the viewer's side of them worked out.
#[repr(C, align(64))]
pub struct OpaqueLanes<'c> {
    base_color: Lane3,
    metallic: Lane,
    alpha: Lane,
    f0: Lane3,
    f90: Lane,
    /// 1 where there is neither metal nor coat: the weight of a sample is then the base colour itself.
    lambert: Mask,
    /// What the coats leave to their bases.
    below: [Complement<'c>; LANES],
    /// Directions to the viewers in the shading frames.
    wo: Lane3,
    below_o: Lane,
    p_specular: Lane,
}

impl<'c> Bsdfs<'c> for OpaqueLanes<'c> {
    const UNLIT: bool = false;

    #[inline(always)]
    fn resolve(context: &Context<'c>, rays: &RayHitBlock, vertices: &mut Vertices, _: &Lane) -> Self {
        let factors = Factors::look_up(context, rays, vertices);
        let mut lanes = OpaqueLanes {
            base_color: ZERO3,
            metallic: ZERO,
            alpha: ZERO,
            f0: ZERO3,
            f90: ZERO,
            lambert: [0; LANES],
            below: [context.albedo.complement(0.0, 0.0, 0.0); LANES],
            wo: ZERO3,
            below_o: [1.0; LANES],
            p_specular: ZERO,
        };
        for i in 0..LANES {
            let material = &context.scene.materials[vertices.material[i] as usize];
            let params = surface::opaque(material, &factors.textured(i));
            set(&mut lanes.base_color, i, params.base_color);
            set(&mut lanes.f0, i, params.f0);
            lanes.metallic[i] = params.metallic;
            lanes.alpha[i] = params.alpha;
            lanes.f90[i] = params.f90;
            lanes.lambert[i] = u32::from(params.metallic == 0.0) & u32::from(params.f90 == 0.0);
        }
        for i in 0..LANES {
            let n_s = get(&vertices.n_s, i);
            let wo = Frame::from_normal(n_s).to_local(get(&vertices.wo, i));
            set(&mut lanes.wo, i, wo);
            // A normal map may have turned the surface away.
            vertices.active[i] &= u32::from(wo.z > 0.0);
        }
        if context.plan.features.coated {
            for i in 0..LANES {
                if lanes.lambert[i] == 0 {
                    lanes.below[i] = lanes.params(i).complement(context.albedo);
                    lanes.below_o[i] = lanes.below[i].at(lanes.wo[2][i]);
                }
            }
        }
        for i in 0..LANES {
            lanes.p_specular[i] = lanes.lobes(i).p_specular(lanes.wo[2][i], lanes.below_o[i]);
        }
        lanes
    }

    #[inline(always)]
    fn lit(&self, vertices: &Vertices, at_deltas: bool) -> Mask {
        let mut lit = vertices.active;
        for i in 0..LANES {
            lit[i] &= u32::from(at_deltas | !self.lobes(i).is_delta());
        }
        lit
    }

    #[inline(always)]
    fn receiver_n(&self, vertices: &Vertices) -> Lane3 {
        vertices.n_s
    }

    #[inline(always)]
    fn eval(&self, vertices: &Vertices, wi: &Lane3) -> Scattered {
        let (mut local, mut above) = (ZERO3, [0; LANES]);
        for i in 0..LANES {
            let world = get(wi, i);
            let wi = Frame::from_normal(get(&vertices.n_s, i)).to_local(world);
            set(&mut local, i, wi);
            above[i] = u32::from(wi.z > 0.0) & u32::from(get(&vertices.n_g, i).dot(world) > 0.0);
        }
        let split = self.split(&local[2]);
        let mut scattered = Scattered { f_cos: ZERO3, pdf_sa: ZERO };
        for i in 0..LANES {
            let (wo, wi) = (get(&self.wo, i), get(&local, i));
            let eval = self.lobes(i).eval(wo, wi, half_vector(wo, wi), split[i], self.p_specular[i]);
            let seen = above[i] != 0;
            for c in 0..3 {
                scattered.f_cos[c][i] = if seen { eval.f_cos[c] } else { 0.0 };
            }
            scattered.pdf_sa[i] = if seen { eval.pdf_sa } else { 0.0 };
        }
        scattered
    }

    #[inline(always)]
    fn sample(&self, _: &Context, vertices: &Vertices, u: &[Lane; 4], to: &mut Survivors) -> Mask {
        let mut local = ZERO3;
        for i in 0..LANES {
            set(&mut local, i, self.draw(i, u).wi);
        }
        let split = self.split(&local[2]);
        let mut keep: Mask = [0; LANES];
        for i in 0..LANES {
            // Drawn again rather than kept: sixteen facets would leave the registers.
            let drawn = self.draw(i, u);
            let (weight, pdf_sa) = self.lobes(i).weigh(get(&self.wo, i), &drawn, split[i], self.p_specular[i]);
            let lambert = self.lambert[i] != 0;
            for c in 0..3 {
                to.beta[c][i] = if lambert { self.base_color[c][i] } else { weight[c] };
            }
            let wi = Frame::from_normal(get(&vertices.n_s, i)).to_world(drawn.wi);
            set(&mut to.dir, i, wi);
            to.last_pdf_sa[i] = pdf_sa;
            keep[i] = u32::from(pdf_sa > 0.0) & u32::from(get(&vertices.n_g, i).dot(wi) > 0.0);
        }
        for i in 0..LANES {
            if keep[i] == 0 && vertices.active[i] != 0 && self.lobes(i).is_delta() {
                keep[i] = self.mirror_flat(vertices, i, u, to);
            }
        }
        keep
    }
}

impl OpaqueLanes<'_> {
    #[inline(always)]
    fn params(&self, i: usize) -> GlossyParams {
        GlossyParams {
            base_color: get(&self.base_color, i),
            metallic: self.metallic[i],
            alpha: self.alpha[i],
            f0: get(&self.f0, i),
            f90: self.f90[i],
        }
    }

    #[inline(always)]
    fn lobes(&self, i: usize) -> Lobes {
        Lobes::new(&self.params(i))
    }

    #[inline(always)]
    fn draw(&self, i: usize, u: &[Lane; 4]) -> Drawn {
        self.lobes(i).draw(get(&self.wo, i), [u[0][i], u[1][i], u[2][i]], self.p_specular[i])
    }

    /// What the coats leave to the bases for light under these cosines.
    #[inline(always)]
    fn split(&self, cos_i: &Lane) -> Lane {
        let mut split = [1.0; LANES];
        for i in 0..LANES {
            if self.lambert[i] == 0 {
                split[i] = self.below[i].split(self.below_o[i], self.below[i].at(cos_i[i]));
            }
        }
        split
    }

    /// A mirror without a base whose interpolated normal sends light into the surface: drawn about the geometric normal, so that a smooth
    /// mirror loses nothing at its silhouette. Returns 1 if the path goes on.
    fn mirror_flat(&self, vertices: &Vertices, i: usize, u: &[Lane; 4], to: &mut Survivors) -> u32 {
        let n_g = get(&vertices.n_g, i);
        let frame = Frame::from_normal(n_g);
        let wo = frame.to_local(get(&vertices.wo, i));
        if !(wo.z > 0.0) {
            return 0;
        }
        let (lobes, below_o) = (self.lobes(i), self.below[i].at(wo.z));
        let p_specular = lobes.p_specular(wo.z, below_o);
        let drawn = lobes.draw(wo, [u[0][i], u[1][i], u[2][i]], p_specular);
        let split = self.below[i].split(below_o, self.below[i].at(drawn.wi.z));
        let (weight, pdf_sa) = lobes.weigh(wo, &drawn, split, p_specular);
        let wi = frame.to_world(drawn.wi);
        set(&mut to.dir, i, wi);
        set(&mut to.beta, i, weight);
        to.last_pdf_sa[i] = pdf_sa;
        u32::from(pdf_sa > 0.0) & u32::from(n_g.dot(wi) > 0.0)
    }
}
