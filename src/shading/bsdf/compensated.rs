//! Any other surface with the light that its facets scatter more than once (`--multiscatter on`): the lobe of
//! [`multiscatter`](super::multiscatter) beside those of the body, under the layers. Shades what such light is lost of;
//! without the option nothing is.
//!
//! Directions in the shading frame, n = +z; `eval` includes the cosine; pdfs in sr⁻¹.

use glam::Vec3;

use super::clearcoat::Clearcoat;
use super::model::{Bsdf, BsdfEval, BsdfSample, Extended, Lobe, Tables, Textured};
use super::multiscatter::Multiscatter;
use crate::math::columns::array_column;
use crate::math::frame::Frame;
use crate::scene::Material;

/// The largest f32 below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// See the module.
#[derive(Clone, Copy, Debug)]
pub struct Compensated<'t> {
    layered: Clearcoat<'t>,
    more: Option<Multiscatter<'t>>,
}

/// The viewer's side: probabilities of the lobe of many facets, and of the layer among the rest.
#[derive(Clone, Copy, Debug)]
pub struct Shares {
    p_more: f32,
    p_layer: f32,
}

/// A direction and whether it is of the lobe of many facets.
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    sample: BsdfSample,
    more: bool,
}

impl<'t> Compensated<'t> {
    /// What `layered` lacks is added.
    #[inline(always)]
    pub fn new(layered: Clearcoat<'t>, tables: &Tables<'t>) -> Self {
        let more = Multiscatter::of(layered.body(), tables);
        Compensated { layered, more }
    }

    /// The lobe of many facets, below the layers; its density is that of the lobe alone.
    #[inline(always)]
    fn more(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        let reached = self.outward() || wo.z > 0.0 && wi.z > 0.0;
        let Some(more) = self.more.as_ref().filter(|_| reached) else { return BsdfEval::ZERO };
        let eval = more.eval(wo, wi);
        BsdfEval { f_cos: eval.f_cos * self.layered.left_to_body(wo, wi), ..eval }
    }
}

array_column!(Compensated<'_>, Shares);

impl<'t> Bsdf<'t> for Compensated<'t> {
    const COLUMNS: bool = false;
    const TEXTURED: bool = true;
    const TRANSMITS: bool = true;
    const DELTAS: bool = true;
    const LAYERED: bool = false;
    const EXTENDED: bool = true;

    type View = Shares;
    type Drawn = Drawn;

    #[inline(always)]
    fn new(material: &Material, textured: &Textured, tables: &Tables<'t>, u_material: f32) -> Self {
        Compensated::new(<Clearcoat as Bsdf>::new(material, textured, tables, u_material), tables)
    }

    #[inline(never)]
    fn extended(material: &Material, textured: &Textured, extended: &Extended, tables: &Tables<'t>, u: f32) -> Self {
        Compensated::new(Clearcoat::extended(material, textured, extended, tables, u), tables)
    }

    #[inline(never)]
    fn orient(&mut self, frame: &Frame) {
        self.layered.orient(frame);
        self.more = self.more.map(|more| more.oriented(self.layered.body()));
    }

    #[inline(always)]
    fn idle(tables: &Tables<'t>) -> Self {
        Compensated { layered: Clearcoat::idle(tables), more: None }
    }

    #[inline(always)]
    fn outward(&self) -> bool {
        self.layered.outward()
    }

    #[inline(always)]
    fn is_delta(&self) -> bool {
        self.more.is_none() && self.layered.is_delta()
    }

    #[inline(never)]
    fn view(&self, wo: Vec3, below_o: f32) -> Shares {
        // Half at most: what is lost is not worth more, and every other lobe keeps a share.
        let p_more = self.more.as_ref().map_or(0.0, |more| more.albedo(wo).min(0.5));
        Shares { p_more, p_layer: self.layered.view(wo, below_o) }
    }

    #[inline(never)]
    fn eval(&self, wo: Vec3, wi: Vec3, shares: &Shares, split: f32) -> BsdfEval {
        let rest = self.layered.eval(wo, wi, &shares.p_layer, split);
        let more = self.more(wo, wi);
        let pdf_sa = rest.pdf_sa * (1.0 - shares.p_more) + more.pdf_sa * shares.p_more;
        BsdfEval { f_cos: rest.f_cos + more.f_cos, pdf_sa }
    }

    fn diffuse(&self, wo: Vec3, wi: Vec3, shares: &Shares, split: f32) -> Vec3 {
        self.layered.diffuse(wo, wi, &shares.p_layer, split)
    }

    #[inline(never)]
    fn draw(&self, wo: Vec3, u: [f32; 3], shares: &Shares) -> Drawn {
        let Shares { p_more, p_layer } = *shares;
        if u[0] < p_more
            && let Some(more) = &self.more
        {
            let scattered = more.sample(wo, [(u[0] / p_more).min(BELOW_ONE), u[1], u[2]]);
            // Weighed with the other lobes; 1 stands for a direction that there is.
            let sample = BsdfSample { wi: scattered.wi, weight: Vec3::ZERO, pdf_sa: 1.0, eta: scattered.eta };
            return Drawn { sample, more: true };
        }
        // What lies above is uniform again.
        let u_rest = ((u[0] - p_more) / (1.0 - p_more)).min(BELOW_ONE);
        Drawn { sample: self.layered.draw(wo, [u_rest, u[1], u[2]], &p_layer), more: false }
    }

    #[inline(always)]
    fn wi(drawn: &Drawn) -> Vec3 {
        drawn.sample.wi
    }

    #[inline(never)]
    fn weigh(&self, wo: Vec3, drawn: &Drawn, shares: &Shares, split: f32) -> BsdfSample {
        let (p_more, wi) = (shares.p_more, drawn.sample.wi);
        if drawn.more {
            let BsdfEval { f_cos, pdf_sa } = self.eval(wo, wi, shares, split);
            let usable = pdf_sa > 0.0 && pdf_sa < f32::INFINITY;
            let (weight, pdf_sa) = if usable { (f_cos / pdf_sa, pdf_sa) } else { (Vec3::ZERO, 0.0) };
            return BsdfSample { weight, pdf_sa, ..drawn.sample };
        }
        let rest = self.layered.weigh(wo, &drawn.sample, &shares.p_layer, split);
        if p_more == 0.0 || rest.pdf_sa == 0.0 {
            return rest;
        }
        if rest.pdf_sa == f32::INFINITY {
            return BsdfSample { weight: rest.weight / (1.0 - p_more), ..rest };
        }
        let more = self.more(wo, wi);
        let pdf_sa = rest.pdf_sa * (1.0 - p_more) + more.pdf_sa * p_more;
        BsdfSample { weight: (rest.weight * rest.pdf_sa + more.f_cos) / pdf_sa, pdf_sa, ..rest }
    }

    fn name(&self) -> &'static str {
        self.layered.name()
    }

    fn lobe(&self, wo: Vec3, u: f32, shares: &Shares, reflected: bool) -> Lobe {
        let Shares { p_more, p_layer } = *shares;
        if u < p_more {
            return Lobe::wide("multiple scattering");
        }
        self.layered.lobe(wo, ((u - p_more) / (1.0 - p_more)).min(BELOW_ONE), &p_layer, reflected)
    }

    fn widest_alpha(&self) -> f32 {
        if self.more.is_some() { 1.0 } else { self.layered.widest_alpha() }
    }
}
