//! Where paths go from sixteen surfaces: the BSDF's sampling, and what is mixed with it
//! ([`Directions`](crate::shading::directions)). One density for who draws, for light samples and for light paths.
//!
//! The kernels call this where the table of effects says so; the BSDF alone is drawn from without it. Mixed with are
//! opaque surfaces with a lobe that is rough; a delta lobe stays with the BSDF.

use glam::Vec3;

use super::kernel::Lanes;
use super::log::Log;
use super::vertices::Vertices;
use super::wave::{PathBlock, RayLanes};
use super::world::World;
use crate::backend::batch::LANES;
use crate::math::columns::{Lane, Lane3, Mask, ZERO, bits, get, set};
use crate::math::lanes::lanes_of;
use crate::shading::bsdf::model::Bsdf;
use crate::shading::directions::{self, Directions, Drawn};
use crate::shading::guide::Record;

/// Least GGX alpha of the widest lobe.
const LEAST_ALPHA: f32 = 0.25;

/// Most that a guide is taken out of the throughput.
const MOST_GUIDED: f32 = 1e6;

/// What roulette takes out of the throughput: what refractions and guides did to it. A guide sends many paths, each of
/// which carries less, where light is; ending them for that would undo it.
#[inline(never)]
pub fn unguided(paths: &PathBlock, guided: &[f32]) -> Lane {
    std::array::from_fn(|i| paths.eta_scale[i] * guided.get(paths.slot[i] as usize).copied().unwrap_or(1.0))
}

/// A path goes on in a direction chosen with `ratio` times the density of the BSDF.
fn advance(guided: &mut [f32], slot: u32, ratio: f32) {
    let guided = &mut guided[slot as usize];
    *guided = (*guided * ratio).min(MOST_GUIDED);
}

/// What is mixed with the BSDFs of a block.
pub struct Mixture {
    /// Lanes that have a cell.
    lanes: u16,
    cell: [u32; LANES],
    /// 0 where the BSDF is alone.
    share: Lane,
}

impl Mixture {
    /// Nothing.
    pub const NONE: Mixture = Mixture { lanes: 0, cell: [0; LANES], share: ZERO };

    /// At the active lanes of a block.
    #[inline(never)]
    pub fn at<'c, B: Bsdf<'c>>(world: &World<'c>, vertices: &Vertices, bsdfs: &Lanes<'c, B>) -> Self {
        let mut mixture = Mixture::NONE;
        let Some(directions) = world.directions else { return mixture };
        for i in lanes_of(bits(&vertices.active)).filter(|&i| bsdfs.spreads(i, LEAST_ALPHA)) {
            let cell = directions.cell(get(&vertices.p, i), get(&vertices.n_g, i));
            mixture.lanes |= 1 << i;
            (mixture.cell[i], mixture.share[i]) = (cell, directions.share(cell));
        }
        mixture
    }

    /// Whether anything is mixed with the BSDF of lane `i`.
    pub fn mixes(&self, i: usize) -> bool {
        self.share[i] > 0.0
    }

    /// Density with which a direction is chosen in lane `i`, where the BSDF chooses it with `bsdf_pdf_sa`.
    #[inline]
    pub fn pdf_sa(&self, world: &World, i: usize, wi: Vec3, bsdf_pdf_sa: f32) -> f32 {
        match world.directions {
            Some(directions) if self.share[i] > 0.0 => {
                directions::mixed(self.share[i], directions.pdf_sa(self.cell[i], wi), bsdf_pdf_sa)
            }
            _ => bsdf_pdf_sa,
        }
    }

    /// [`pdf_sa`](Self::pdf_sa) of every lane, in the place of the BSDFs' densities.
    #[inline(never)]
    pub fn weigh(&self, world: &World, wi: &Lane3, pdf_sa: &mut Lane) {
        for i in lanes_of(self.lanes) {
            pdf_sa[i] = self.pdf_sa(world, i, get(wi, i), pdf_sa[i]);
        }
    }

    /// The numbers that are left to the BSDFs.
    #[inline(never)]
    pub fn rest(&self, u: &[Lane; 4]) -> [Lane; 4] {
        let mut rest = *u;
        for i in lanes_of(self.lanes) {
            if let Drawn::Bsdf(u) = directions::split(self.share[i], u[0][i]) {
                rest[0][i] = u;
            }
        }
        rest
    }

    /// After the BSDFs have drawn by [`rest`](Self::rest): draws the other directions and turns densities and weights
    /// into those of the mixture, for the lanes `keep` that continue. Returns the lanes whose directions are not the
    /// BSDFs'.
    #[inline(never)]
    pub fn redirect<'c, B: Bsdf<'c>>(
        &self,
        world: &World<'c>,
        (vertices, bsdfs): (&Vertices, &Lanes<'c, B>),
        u: &[Lane; 4],
        (rays, to, keep): (&mut RayLanes, &mut PathBlock, &mut Mask),
        guided: &mut [f32],
    ) -> u16 {
        let Some(directions) = world.directions else { return 0 };
        let mut drawn = 0u16;
        for i in lanes_of(self.lanes) {
            if directions::split(self.share[i], u[0][i]) == Drawn::Here {
                set(&mut rays.dir, i, directions.draw(self.cell[i], [u[1][i], u[2][i]]));
                drawn |= 1 << i;
            }
        }
        if drawn != 0 {
            let scattered = bsdfs.eval(vertices, &rays.dir);
            for i in lanes_of(drawn) {
                let pdf_sa = self.pdf_sa(world, i, get(&rays.dir, i), scattered.pdf_sa[i]);
                let f_cos = get(&scattered.f_cos, i);
                set(&mut to.beta, i, f_cos / pdf_sa);
                to.last_pdf_sa[i] = pdf_sa;
                advance(guided, to.slot[i], pdf_sa / scattered.pdf_sa[i]);
                keep[i] = u32::from(pdf_sa > 0.0 && f_cos.max_element() > 0.0);
            }
        }
        for i in lanes_of(self.lanes & !drawn & bits(keep)) {
            let bsdf_pdf_sa = to.last_pdf_sa[i];
            let pdf_sa = self.pdf_sa(world, i, get(&rays.dir, i), bsdf_pdf_sa);
            let left = if pdf_sa < f32::INFINITY { bsdf_pdf_sa / pdf_sa } else { 1.0 / (1.0 - self.share[i]) };
            advance(guided, to.slot[i], 1.0 / left);
            let beta = get(&to.beta, i) * left;
            set(&mut to.beta, i, beta);
            to.last_pdf_sa[i] = pdf_sa;
        }
        drawn
    }

    /// Writes the scatterings of the lanes `keep` down.
    #[inline(never)]
    pub fn note<'c, B: Bsdf<'c>>(
        &self,
        (vertices, bsdfs): (&Vertices, &Lanes<'c, B>),
        (rays, to): (&RayLanes, &PathBlock),
        keep: &Mask,
        log: &mut Log,
    ) {
        let scattered = bsdfs.eval(vertices, &rays.dir);
        for i in lanes_of(self.lanes & bits(keep)) {
            let (pdf_sa, bsdf_pdf_sa) = (to.last_pdf_sa[i], scattered.pdf_sa[i]);
            if pdf_sa < f32::INFINITY && bsdf_pdf_sa > 0.0 {
                let [p, n, wi] = [&vertices.p, &vertices.n_g, &rays.dir].map(|column| get(column, i));
                let record = Record { p, n, wi, bsdf_pdf_sa, pdf_sa, value: 0.0 };
                log.push(to.slot[i], get(&vertices.beta, i), record);
            }
        }
    }
}
