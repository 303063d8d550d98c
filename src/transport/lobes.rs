//! How the first surface after the camera scatters, for the layers that tell lobes apart: the share of the diffuse base
//! in what is reflected from one direction, by channel, or that the light comes through. The same for a light sample
//! and for a direction that was drawn from the surface, so that the layers do not depend on who found the light.

use glam::Vec3;

use super::kernel::{Lanes, Scattered};
use super::parts::First;
use super::vertices::Vertices;
use crate::backend::batch::LANES;
use crate::math::columns::{Lane, Lane3, get};
use crate::shading::bsdf::model::Bsdf;

/// What a surface that is a diffuse base and nothing else does.
const ALL_DIFFUSE: First = First::Reflected { diffuse: [1.0; 3] };

/// What becomes of light from the directions `wi`, of which surfaces scatter `scattered`.
#[inline(always)]
pub fn of_light<'t, B: Bsdf<'t>>(
    bsdfs: &Lanes<'t, B>,
    vertices: &Vertices,
    wi: &Lane3,
    scattered: &Scattered,
) -> [First; LANES] {
    if B::DIFFUSE { [ALL_DIFFUSE; LANES] } else { told_apart(bsdfs, vertices, wi, scattered) }
}

/// What becomes of light from the directions `wi` that were drawn with the densities `pdf_sa`: an infinite one is that
/// of a lobe without a density, beside which nothing else counts.
#[inline(always)]
pub fn of_drawn<'t, B: Bsdf<'t>>(
    bsdfs: &Lanes<'t, B>,
    vertices: &Vertices,
    wi: &Lane3,
    pdf_sa: &Lane,
) -> [First; LANES] {
    if B::DIFFUSE { [ALL_DIFFUSE; LANES] } else { drawn(bsdfs, vertices, wi, pdf_sa) }
}

#[inline(never)]
fn drawn<'t, B: Bsdf<'t>>(bsdfs: &Lanes<'t, B>, vertices: &Vertices, wi: &Lane3, pdf_sa: &Lane) -> [First; LANES] {
    let mut firsts = told_apart(bsdfs, vertices, wi, &bsdfs.eval(vertices, wi));
    for i in 0..LANES {
        if let First::Reflected { diffuse } = &mut firsts[i]
            && pdf_sa[i] == f32::INFINITY
        {
            *diffuse = [0.0; 3];
        }
    }
    firsts
}

#[inline(never)]
fn told_apart<'t, B: Bsdf<'t>>(
    bsdfs: &Lanes<'t, B>,
    vertices: &Vertices,
    wi: &Lane3,
    scattered: &Scattered,
) -> [First; LANES] {
    let share = |diffuse: f32, all: f32| if all > 0.0 { (diffuse / all).min(1.0) } else { 0.0 };
    std::array::from_fn(|i| {
        let (wi, all) = (get(wi, i), get(&scattered.f_cos, i));
        if vertices.active[i] == 0 {
            return First::Nowhere;
        }
        // The geometric normal faces the viewer.
        if get(&vertices.n_g, i).dot(wi) < 0.0 {
            return First::Transmitted;
        }
        let diffuse: Vec3 = bsdfs.diffuse(vertices, i, wi);
        First::Reflected { diffuse: std::array::from_fn(|c| share(diffuse[c], all[c])) }
    })
}
