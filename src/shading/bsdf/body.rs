//! What lies below the layers of a material: a plain surface, or one with a grain, a film, or a base that light passes.

use glam::Vec3;

use super::dielectric::Dielectric;
use super::finish::{Fine, Grain};
use super::glossy::GlossyParams;
use super::model::{Bsdf, BsdfEval, BsdfSample, Extended, Lobe, Tables, Textured};
use super::translucent::{Through, Translucent};
use crate::math::frame::Frame;
use crate::shading::surface::Surface;

/// A surface under the layers.
#[derive(Clone, Copy, Debug)]
pub enum Body<'t> {
    /// Without any of this.
    Plain(Surface<'t>),
    /// Opaque or translucent.
    Translucent(Translucent<'t>, Grain),
    /// Clear.
    Clear(Dielectric<Fine>, Grain),
}

impl<'t> Body<'t> {
    /// Resolves the material that these numbers describe at a hit; a grain runs along a direction in the world until it
    /// is [oriented](Self::orient).
    #[inline(always)]
    pub fn resolve(extended: &Extended, textured: Textured, tables: &Tables<'t>, u_material: f32) -> Self {
        let surface = Surface::resolve(&extended.boundary, textured, tables, u_material);
        let through = Through { fraction: extended.diffuse_transmission, color: extended.diffuse_transmission_color };
        let fine = extended.anisotropy > 0.0 || extended.film.weight > 0.0;
        let roughness = textured.roughness;
        let finish = Fine::new(roughness * roughness, extended.anisotropy, extended.film);
        match surface {
            Surface::Glossy(glossy) if fine || through.fraction > 0.0 => {
                Body::Translucent(Translucent::new(glossy.params, finish, through, tables.albedo), Grain::X)
            }
            Surface::Black | Surface::Lambert(_) if through.fraction > 0.0 => {
                let params = GlossyParams { metallic: 0.0, ..GlossyParams::of(&extended.boundary, &textured) };
                Body::Translucent(Translucent::new(params, finish, through, tables.albedo), Grain::X)
            }
            Surface::Dielectric(glass) if fine && glass != Dielectric::NOTHING => {
                Body::Clear(glass.finished(finish), Grain::X)
            }
            plain => Body::Plain(plain),
        }
    }

    /// Lets the grain run along `tangent`, a direction in the world.
    #[inline(always)]
    pub fn orient(&mut self, frame: &Frame, tangent: Vec3) {
        if let Body::Translucent(_, grain) | Body::Clear(_, grain) = self {
            *grain = Grain::along(frame.to_local(tangent));
        }
    }

    /// How the grain runs in the shading frame.
    #[inline(always)]
    pub fn grain(&self) -> Grain {
        match self {
            Body::Plain(_) => Grain::X,
            Body::Translucent(_, grain) | Body::Clear(_, grain) => *grain,
        }
    }

    /// f·|cos θ_i| and the density of `sample`; zero for delta lobes.
    #[inline(always)]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        match self {
            Body::Plain(surface) => surface.eval(wo, wi),
            Body::Translucent(surface, grain) => surface.eval(grain.to_local(wo), grain.to_local(wi)),
            Body::Clear(glass, grain) => glass.eval(grain.to_local(wo), grain.to_local(wi)),
        }
    }

    /// The part of [`eval`](Self::eval) that the diffuse base reflects.
    pub fn diffuse(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        match self {
            Body::Plain(surface) => surface.diffuse(wo, wi),
            Body::Translucent(surface, grain) => surface.diffuse(grain.to_local(wo), grain.to_local(wi)),
            Body::Clear(..) => Vec3::ZERO,
        }
    }

    /// Draws a direction; `u` = lobe, u, v. `None` ends the path: absorbed, or masked by the surface itself.
    #[inline(always)]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> Option<BsdfSample> {
        let (sample, grain) = match self {
            Body::Plain(surface) => return surface.sample(wo, u),
            Body::Translucent(surface, grain) => (surface.sample(grain.to_local(wo), u)?, grain),
            Body::Clear(glass, grain) => (glass.sample(grain.to_local(wo), u)?, grain),
        };
        Some(BsdfSample { wi: grain.to_frame(sample.wi), ..sample })
    }

    /// Whether `eval` is zero for every pair, so that sampling a light is wasted.
    #[inline(always)]
    pub fn is_delta(&self) -> bool {
        match self {
            Body::Plain(surface) => surface.is_delta(),
            Body::Translucent(surface, _) => surface.is_delta(),
            Body::Clear(glass, _) => glass.is_delta(),
        }
    }

    /// Whether light can arrive from the far side: the frame must then be the outward one.
    #[inline(always)]
    pub fn is_transmissive(&self) -> bool {
        match self {
            Body::Plain(surface) => surface.is_transmissive(),
            Body::Translucent(surface, _) => surface.is_transmissive(),
            Body::Clear(..) => true,
        }
    }

    /// Largest albedo, about: it serves the choice between this surface and layers on it.
    #[inline(always)]
    pub fn albedo(&self) -> f32 {
        match self {
            Body::Plain(surface) => surface.albedo(),
            Body::Translucent(..) | Body::Clear(..) => 1.0,
        }
    }

    /// What the surface is here, for reports.
    pub fn name(&self) -> &'static str {
        match self {
            Body::Plain(surface) => surface.name(),
            Body::Translucent(surface, _) if surface.is_transmissive() => "translucent",
            Body::Translucent(..) => "glossy",
            Body::Clear(..) => "dielectric",
        }
    }

    /// The lobe that a sample came from: `u` is the number that chose it, `reflected` says on which side it went.
    pub fn lobe(&self, wo: Vec3, u: f32, reflected: bool) -> Lobe {
        match self {
            Body::Plain(surface) => surface.lobe(wo, u, &(), reflected),
            Body::Translucent(surface, grain) => surface.lobe(grain.to_local(wo), u, reflected),
            Body::Clear(glass, _) => glass.lobe(reflected),
        }
    }

    /// [`Lobe::alpha`] of its widest lobe, for reports.
    pub fn widest_alpha(&self) -> f32 {
        match self {
            Body::Plain(surface) => surface.widest_alpha(),
            Body::Translucent(surface, _) => surface.widest_alpha(),
            Body::Clear(glass, _) => glass.lobe(true).alpha,
        }
    }
}

impl<'t> From<Surface<'t>> for Body<'t> {
    fn from(surface: Surface<'t>) -> Self {
        Body::Plain(surface)
    }
}
