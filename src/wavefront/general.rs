//! The kernel for any material: each lane scatters by the surface that its hit turned out to be, one after the other.

use glam::Vec3;

use super::Context;
use super::columns::{Lane, Lane3, Mask, ZERO, ZERO3, get, set};
use super::factors::Factors;
use super::shade::{Bsdfs, Scattered};
use super::state::{NO_MEDIUM, Survivors};
use super::vertices::Vertices;
use crate::backend::batch::{LANES, RayHitBlock};
use crate::math::frame::Frame;
use crate::shading::bsdf::BsdfSample;
use crate::shading::surface::Surface;

/// Sixteen surfaces. A frame's normal faces the viewer on opaque surfaces, and the authored outside on transmissive ones.
pub struct Surfaces<'c> {
    surfaces: [Surface<'c>; LANES],
    frames: [Frame; LANES],
}

impl<'c> Bsdfs<'c> for Surfaces<'c> {
    const UNLIT: bool = true;

    #[inline(always)]
    fn resolve(context: &Context<'c>, rays: &RayHitBlock, vertices: &mut Vertices, u_material: &Lane) -> Self {
        let factors = Factors::look_up(context, rays, vertices);
        let mut surfaces = [Surface::Black; LANES];
        let mut frames = [Frame::from_normal(Vec3::Z); LANES];
        for i in 0..LANES {
            if vertices.active[i] == 0 {
                continue;
            }
            let material = &context.scene.materials[vertices.material[i] as usize];
            let surface = Surface::from_material(material, factors.textured(i), context.albedo, u_material[i]);
            let n_s = get(&vertices.n_s, i);
            if surface.is_transmissive() {
                frames[i] = Frame::from_normal(n_s * vertices.side[i]);
            } else if factors.mapped[i] != 0 && !(n_s.dot(get(&vertices.wo, i)) > 0.0) {
                // A normal map has turned the surface away.
                vertices.active[i] = 0;
            } else {
                frames[i] = Frame::from_normal(n_s);
            }
            surfaces[i] = surface;
        }
        Surfaces { surfaces, frames }
    }

    #[inline(always)]
    fn lit(&self, vertices: &Vertices, at_deltas: bool) -> Mask {
        std::array::from_fn(|i| vertices.active[i] & u32::from(at_deltas || !self.surfaces[i].is_delta()))
    }

    #[inline(always)]
    fn receiver_n(&self, vertices: &Vertices) -> Lane3 {
        let mut n = vertices.n_s;
        for i in 0..LANES {
            if self.surfaces[i].is_transmissive() {
                set(&mut n, i, Vec3::ZERO);
            }
        }
        n
    }

    #[inline(always)]
    fn eval(&self, vertices: &Vertices, wi: &Lane3) -> Scattered {
        let mut scattered = Scattered { f_cos: ZERO3, pdf_sa: ZERO };
        for i in (0..LANES).filter(|&i| vertices.active[i] != 0) {
            let frame = &self.frames[i];
            let (wo, wi) = (frame.to_local(get(&vertices.wo, i)), frame.to_local(get(wi, i)));
            if consistent(vertices, i, frame, wo, wi) {
                let eval = self.surfaces[i].eval(wo, wi);
                set(&mut scattered.f_cos, i, eval.f_cos);
                scattered.pdf_sa[i] = eval.pdf_sa;
            }
        }
        scattered
    }

    #[inline(always)]
    fn sample(&self, context: &Context, vertices: &Vertices, u: &[Lane; 4], to: &mut Survivors) -> Mask {
        let mut keep: Mask = [0; LANES];
        for i in (0..LANES).filter(|&i| vertices.active[i] != 0) {
            let Some((sample, frame)) = self.sample_lane(vertices, i, [u[0][i], u[1][i], u[2][i]]) else { continue };
            let wi = frame.to_world(sample.wi);
            set(&mut to.dir, i, wi);
            set(&mut to.beta, i, sample.weight);
            to.last_pdf_sa[i] = sample.pdf_sa;
            to.eta_scale[i] *= sample.eta * sample.eta;
            let transmitted = !(get(&vertices.n_g, i).dot(wi) > 0.0);
            if transmitted && context.scene.materials[vertices.material[i] as usize].thickness > 0.0 {
                to.medium[i] = if vertices.side[i] > 0.0 { vertices.material[i] } else { NO_MEDIUM };
            }
            keep[i] = 1;
        }
        keep
    }
}

impl<'c> Surfaces<'c> {
    /// The surface of one lane.
    pub fn surface(&self, i: usize) -> &Surface<'c> {
        &self.surfaces[i]
    }

    /// Its frame.
    pub fn frame(&self, i: usize) -> &Frame {
        &self.frames[i]
    }

    /// Draws a direction; refuses one that lies on the wrong geometric side. A delta lobe whose interpolated normal sends it
    /// there is drawn again about the geometric normal, so that smooth glass loses nothing at its silhouette.
    #[inline(always)]
    pub fn sample_lane(&self, vertices: &Vertices, i: usize, u: [f32; 3]) -> Option<(BsdfSample, Frame)> {
        let (surface, frame) = (&self.surfaces[i], self.frames[i]);
        let wo = frame.to_local(get(&vertices.wo, i));
        let sample = surface.sample(wo, u)?;
        if consistent(vertices, i, &frame, wo, sample.wi) {
            return Some((sample, frame));
        }
        if !surface.is_delta() {
            return None;
        }
        let facing = if surface.is_transmissive() { vertices.front_n_g(i) } else { get(&vertices.n_g, i) };
        let frame = Frame::from_normal(facing);
        let wo = frame.to_local(get(&vertices.wo, i));
        let sample = surface.sample(wo, u)?;
        consistent(vertices, i, &frame, wo, sample.wi).then_some((sample, frame))
    }
}

/// Whether the local direction `wi` lies on the same side (reflection) or the other side (transmission) of both normals.
#[inline(always)]
pub fn consistent(vertices: &Vertices, i: usize, frame: &Frame, wo: Vec3, wi: Vec3) -> bool {
    let reflected = (wo.z > 0.0) == (wi.z > 0.0);
    let same_side = get(&vertices.n_g, i).dot(frame.to_world(wi)) > 0.0;
    reflected == same_side
}
