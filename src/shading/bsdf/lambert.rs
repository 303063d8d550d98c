//! Perfectly diffuse reflection: f = albedo/π on the viewer's side, nothing through the surface.
//! Directions in the shading frame, n = +z; `eval` includes the cosine; pdfs in sr⁻¹.
//! Limit: a viewer or light at or below the horizon sees nothing; the caller orients the frame towards the viewer.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::model::{Bsdf, BsdfEval, BsdfSample, Lobe, Tables, Textured};
use crate::math::columns::columns;
use crate::math::warp;
use crate::scene::Material;

columns! {
    /// A perfectly diffuse surface.
    #[derive(Debug, PartialEq)]
    pub struct Lambert as LambertLanes {
        /// Reflected fraction.
        albedo: Vec3,
    }
}

impl Bsdf<'_> for Lambert {
    const COLUMNS: bool = true;
    const TEXTURED: bool = false;
    const TRANSMITS: bool = false;
    const DELTAS: bool = false;
    const LAYERED: bool = false;
    const COSINES: bool = true;
    const DIFFUSE: bool = true;

    type View = ();
    type Drawn = Vec3;

    #[inline(always)]
    fn new(_: &Material, textured: &Textured, _: &Tables, _: f32) -> Self {
        Lambert { albedo: textured.base_color }
    }

    #[inline(always)]
    fn idle(_: &Tables) -> Self {
        Lambert { albedo: Vec3::ZERO }
    }

    /// Surfaces without any albedo end all paths.
    #[inline(always)]
    fn scatters(&self) -> bool {
        self.albedo.x.max(self.albedo.y).max(self.albedo.z) > 0.0
    }

    #[inline(always)]
    fn is_delta(&self) -> bool {
        false
    }

    #[inline(always)]
    fn view(&self, _: Vec3, _: f32) {}

    #[inline(always)]
    fn eval(&self, _: Vec3, wi: Vec3, _: &(), _: f32) -> BsdfEval {
        let pdf_sa = wi.z * FRAC_1_PI;
        BsdfEval { f_cos: self.albedo * pdf_sa, pdf_sa }
    }

    fn diffuse(&self, _: Vec3, wi: Vec3, _: &(), _: f32) -> Vec3 {
        self.albedo * (wi.z * FRAC_1_PI)
    }

    /// Cosine-distributed: the weight is the albedo itself, with no division.
    #[inline(always)]
    fn draw(&self, _: Vec3, u: [f32; 3], _: &()) -> Vec3 {
        warp::cosine_hemisphere([u[1], u[2]])
    }

    #[inline(always)]
    fn wi(drawn: &Vec3) -> Vec3 {
        *drawn
    }

    #[inline(always)]
    fn weigh(&self, _: Vec3, drawn: &Vec3, _: &(), _: f32) -> BsdfSample {
        BsdfSample { wi: *drawn, weight: self.albedo, pdf_sa: warp::cosine_hemisphere_pdf(drawn.z), eta: 1.0 }
    }

    fn name(&self) -> &'static str {
        if self.albedo == Vec3::ZERO { "black" } else { "lambert" }
    }

    fn lobe(&self, _: Vec3, _: f32, _: &(), _: bool) -> Lobe {
        Lobe::wide("diffuse")
    }

    fn widest_alpha(&self) -> f32 {
        1.0
    }
}
