//! The leanest kernel: untextured exact Lambert surfaces.

use std::f32::consts::FRAC_1_PI;

use super::Context;
use super::columns::{Lane, Lane3, Mask, ZERO, ZERO3, get, set};
use super::shade::{Bsdfs, Scattered};
use super::state::Survivors;
use super::vertices::Vertices;
use crate::backend::batch::{LANES, RayHitBlock};
use crate::math::frame::Frame;
use crate::math::warp;

/// Reflected fractions.
#[repr(C, align(64))]
pub struct LambertLanes {
    albedo: Lane3,
}

impl<'c> Bsdfs<'c> for LambertLanes {
    const UNLIT: bool = false;

    #[inline(always)]
    fn resolve(context: &Context<'c>, _: &RayHitBlock, vertices: &mut Vertices, _: &Lane) -> Self {
        let mut albedo = ZERO3;
        for i in 0..LANES {
            set(&mut albedo, i, context.scene.materials[vertices.material[i] as usize].base_color);
        }
        // Surfaces without any albedo end all paths.
        for i in 0..LANES {
            vertices.active[i] &= u32::from(albedo[0][i].max(albedo[1][i]).max(albedo[2][i]) > 0.0);
        }
        LambertLanes { albedo }
    }

    #[inline(always)]
    fn lit(&self, vertices: &Vertices, _: bool) -> Mask {
        vertices.active
    }

    #[inline(always)]
    fn receiver_n(&self, vertices: &Vertices) -> Lane3 {
        vertices.n_s
    }

    #[inline(always)]
    fn eval(&self, vertices: &Vertices, wi: &Lane3) -> Scattered {
        let mut scattered = Scattered { f_cos: ZERO3, pdf_sa: ZERO };
        for i in 0..LANES {
            let wi = get(wi, i);
            let cos = get(&vertices.n_s, i).dot(wi);
            let above = (cos > 0.0) & (get(&vertices.n_g, i).dot(wi) > 0.0);
            let pdf = if above { cos * FRAC_1_PI } else { 0.0 };
            for c in 0..3 {
                scattered.f_cos[c][i] = self.albedo[c][i] * pdf;
            }
            scattered.pdf_sa[i] = pdf;
        }
        scattered
    }

    #[inline(always)]
    fn sample(&self, _: &Context, vertices: &Vertices, u: &[Lane; 4], to: &mut Survivors) -> Mask {
        let mut keep: Mask = [0; LANES];
        for i in 0..LANES {
            let local = warp::cosine_hemisphere([u[1][i], u[2][i]]);
            let wi = Frame::from_normal(get(&vertices.n_s, i)).to_world(local);
            set(&mut to.dir, i, wi);
            to.last_pdf_sa[i] = warp::cosine_hemisphere_pdf(local.z);
            keep[i] = u32::from(get(&vertices.n_g, i).dot(wi) > 0.0);
        }
        to.beta = self.albedo;
        keep
    }
}
