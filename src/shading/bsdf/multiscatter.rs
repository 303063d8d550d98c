//! Light that leaves a rough surface after more than one facet (`--multiscatter on`), which the lobes of single
//! scattering lose: one more lobe, of metals and of clear dielectrics. (What a dielectric's coat loses goes to the base
//! below it already.)
//!
//! With E(w) what single scattering returns of light to or from w and Ē its mean over the hemisphere, the lobe is
//! C·(1 − E(wo))(1 − E(wi))/(π(1 − Ē)) (Kulla and Conty 2017, "Revisiting Physically Based Shading at Imageworks",
//! after Kelemen and Szirmay-Kalos 2001): reciprocal, and for C = 1 exactly what is lost, to the error of the tables.
//! Scaling the lobe by 1/E(wo) instead (Turquin 2019) costs less and is not reciprocal. C of a metal is what is left
//! after bounces between facets of mean reflectance F̄: F̄²Ē/(1 − F̄(1 − Ē)).
//!
//! Clear dielectrics: the lobe has a part on each side. From side s, the share τ_s passes, by the colour of the glass,
//! and 1 − τ_s is reflected. Light is to go there as it comes back, so τ_s·n_s²·(1 − Ē_s) is the same from both sides:
//! τ_s is T_s·min(1 − Ē)/(1 − Ē_s) with T_s the mean transmittance of a smooth boundary, T_s·n_s² being alike already.
//! Thin walls have two sides alike.
//!
//! Limits: with a grain each direction uses the alpha that its azimuth shows, as in `translucent`; bounces are not
//! coloured one by one in glass.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::albedo::{Complement, SpecularAlbedo, Spread};
use super::body::Body;
use super::dielectric::{Body as Wall, Dielectric};
use super::film::Film;
use super::finish::{Fine, Finish, Grain};
use super::fresnel::{self, SCHLICK_AVERAGE, schlick};
use super::glossy::GlossyParams;
use super::microfacet::ALPHA_DELTA;
use super::model::{BsdfEval, Tables};
use crate::math::angle::sin_cos_turns;
use crate::shading::surface::Surface;

/// What single scattering loses on one side of a surface.
#[derive(Clone, Copy, Debug)]
struct Loss<'t> {
    table: &'t SpecularAlbedo,
    /// Of light from everywhere.
    mean: Complement<'t>,
    /// Weights of the two columns of the table.
    weights: [f32; 2],
    /// By cosine.
    spread: Spread<'t>,
}

/// The lobe.
#[derive(Clone, Copy, Debug)]
pub struct Multiscatter<'t> {
    finish: Fine,
    grain: Grain,
    /// Above and below.
    losses: [Loss<'t>; 2],
    /// Colours of what is reflected and of what passes, for viewers above and below.
    colors: [[Vec3; 2]; 2],
    /// n(below)/n(above).
    eta: f32,
}

/// A direction of the lobe.
#[derive(Clone, Copy, Debug)]
pub struct Scattered {
    /// Unit direction.
    pub wi: Vec3,
    /// n(side of wi)/n(side of wo).
    pub eta: f32,
}

impl<'t> Loss<'t> {
    fn new(table: &'t SpecularAlbedo, alpha: f32, weights: [f32; 2]) -> Self {
        let mean = table.complement(alpha, weights[0], weights[1]);
        Loss { table, mean, weights, spread: table.spread(alpha) }
    }

    /// Of light under a cosine, where the surface looks as rough as `alpha`.
    #[inline(always)]
    fn of(&self, cos: f32, alpha: Option<f32>) -> f32 {
        let [a, b] = self.weights;
        alpha.map_or(self.mean, |alpha| self.table.complement(alpha, a, b)).at(cos)
    }
}

impl<'t> Multiscatter<'t> {
    /// The lobe that `body` lacks; `None` where it loses nothing.
    pub fn of(body: &Body<'t>, tables: &Tables<'t>) -> Option<Self> {
        let plain = |alpha: f32| Fine::new(alpha, 0.0, Film::NONE);
        match body {
            Body::Plain(Surface::Glossy(glossy)) => {
                Self::of_metal(&glossy.params, plain(glossy.params.alpha), Grain::X, tables)
            }
            Body::Translucent(surface, grain) => {
                let (params, finish) = surface.lobe_of_facets();
                Self::of_metal(params, finish, *grain, tables)
            }
            Body::Plain(Surface::Dielectric(glass)) => {
                Self::of_glass(&glass.finished(plain(glass.alpha)), Grain::X, tables)
            }
            Body::Clear(glass, grain) => Self::of_glass(glass, *grain, tables),
            Body::Plain(Surface::Black | Surface::Lambert(_)) => None,
        }
    }

    fn of_metal(params: &GlossyParams, finish: Fine, grain: Grain, tables: &Tables<'t>) -> Option<Self> {
        let GlossyParams { base_color, metallic, .. } = *params;
        if metallic == 0.0 || finish.alpha() < ALPHA_DELTA {
            return None;
        }
        let loss = Loss::new(tables.albedo, finish.mean_alpha(), [1.0, 1.0]);
        let reflectance = match finish.film.weight > 0.0 {
            false => base_color + (Vec3::ONE - base_color) * SCHLICK_AVERAGE,
            true => {
                let at = |cos: f32| finish.reflectance(schlick(base_color, 1.0, cos), cos, base_color);
                EVEN_COSINES.into_iter().map(at).sum::<Vec3>() / EVEN_COSINES.len() as f32
            }
        };
        let lost = loss.mean.average();
        let color = reflectance * reflectance * (1.0 - lost) / (Vec3::ONE - reflectance * lost);
        let colors = [[color * metallic, Vec3::ZERO], [Vec3::ZERO; 2]];
        Some(Multiscatter { finish, grain, losses: [loss; 2], colors, eta: 1.0 })
    }

    fn of_glass(glass: &Dielectric<Fine>, grain: Grain, tables: &Tables<'t>) -> Option<Self> {
        if glass.is_delta() {
            return None;
        }
        let Dielectric { body, eta, alpha: finish, tint, specular, .. } = *glass;
        let passed = 1.0 - specular * fresnel::dielectric_average(f64::from(eta)) as f32;
        let colors = |share: f32| [Vec3::splat(1.0 - share), tint * share];
        let alpha = finish.mean_alpha();
        match body {
            Wall::Thin => {
                let loss = Loss::new(tables.albedo, alpha, [1.0, 1.0]);
                Some(Multiscatter { finish, grain, losses: [loss; 2], colors: [colors(passed); 2], eta: 1.0 })
            }
            Wall::Solid => {
                let losses = tables.glass?.at(eta)?.map(|table| Loss::new(table, alpha, [1.0, 0.0]));
                let lost = losses.map(|loss| loss.mean.average());
                let least = lost[0].min(lost[1]);
                // Of both sides, n² times it is the same, and neither is above 1.
                let passed = passed.min(eta * eta);
                let share = |t: f32, lost: f32| if lost > 0.0 { t * least / lost } else { 0.0 };
                let shares = [share(passed, lost[0]), share(passed / (eta * eta), lost[1])];
                Some(Multiscatter { finish, grain, losses, colors: shares.map(colors), eta })
            }
        }
    }

    /// The same with the grain of `body`.
    #[must_use]
    pub fn oriented(self, body: &Body<'t>) -> Self {
        Multiscatter { grain: body.grain(), ..self }
    }

    /// What single scattering loses of light to or from `w`.
    #[inline(always)]
    fn lost(&self, w: Vec3) -> f32 {
        let grained = self.finish.alpha.x != self.finish.alpha.y;
        let alpha = grained.then(|| self.finish.alpha_towards(self.grain.to_local(w)));
        self.losses[side(w)].of(w.z.abs(), alpha)
    }

    /// Largest channel of what the lobe returns of light from `wo`.
    #[inline(always)]
    pub fn albedo(&self, wo: Vec3) -> f32 {
        let [reflected, passed] = self.colors[side(wo)];
        self.lost(wo) * (reflected + passed).max_element()
    }

    /// Probability of reflection.
    #[inline(always)]
    fn p_reflect(&self, wo: Vec3) -> f32 {
        let [reflected, passed] = self.colors[side(wo)].map(|color| color.max_element());
        if passed > 0.0 { reflected / (reflected + passed) } else { 1.0 }
    }

    /// f·|cos θ_i| and the density of [`sample`](Self::sample).
    #[inline(always)]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        let (from, to) = (side(wo), side(wi));
        let [reflected, passed] = self.colors[from];
        let cos = wi.z.abs();
        let p_reflect = self.p_reflect(wo);
        let (color, p_side) = if from == to { (reflected, p_reflect) } else { (passed, 1.0 - p_reflect) };
        let eta = self.eta_between(from, to);
        let shared = self.losses[to].mean.split(self.lost(wo), self.lost(wi)) / (eta * eta);
        BsdfEval { f_cos: color * (cos * FRAC_1_PI * shared), pdf_sa: p_side * self.losses[to].spread.pdf_sa(cos) }
    }

    /// Draws a direction; `u` = side, u, v.
    #[inline(always)]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> Scattered {
        let from = side(wo);
        let to = if u[0] < self.p_reflect(wo) { from } else { 1 - from };
        let (cos, cos2) = self.losses[to].spread.sample(u[1]);
        let (s, c) = sin_cos_turns(u[2]);
        let r = (1.0 - cos2).max(0.0).sqrt();
        let wi = Vec3::new(r * c, r * s, if to == 0 { cos } else { -cos });
        Scattered { wi, eta: self.eta_between(from, to) }
    }

    /// n(side `to`)/n(side `from`).
    #[inline(always)]
    fn eta_between(&self, from: usize, to: usize) -> f32 {
        match (from, to) {
            (0, 1) => self.eta,
            (1, 0) => 1.0 / self.eta,
            _ => 1.0,
        }
    }
}

/// Cosines that divide the hemisphere, weighed by them, into equal parts: the middles of four.
const EVEN_COSINES: [f32; 4] = [0.353_553_4, 0.612_372_4, 0.790_569_4, 0.935_414_3];

/// 0 above the surface, 1 below.
#[inline(always)]
fn side(w: Vec3) -> usize {
    usize::from(w.z < 0.0)
}
