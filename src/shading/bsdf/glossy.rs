//! Opaque glTF metallic-roughness: one GGX lobe over a diffuse base.
//!
//! Schlick's reflectance is linear in F0 and F90 and metal and coat share one distribution of normals, so the mix by
//! `metallic` of a metal (F0 = base colour, F90 = 1) and a dielectric coat is a single lobe with mixed F0 and F90. The
//! base is scaled by (1−E(μo))(1−E(μi))/(1−E_avg), E the albedo of the coat's lobe: reciprocal, and nothing is
//! gained or lost between coat and base (Kelemen and Szirmay-Kalos 2001; a coloured coat weighs by its largest channel,
//! as KHR_materials_specular asks). Single scattering: a metal loses what its facets shadow.
//!
//! Directions in the shading frame, n = +z; `eval` includes the cosine; pdfs in sr⁻¹. A viewer at or below the
//! horizon sees nothing. Below [`ALPHA_DELTA`] the specular lobe is a mirror, which `eval` cannot see.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::albedo::{Complement, SpecularAlbedo};
use super::fresnel::{SCHLICK_AVERAGE, normal_reflectance, schlick, schlick_weight};
use super::microfacet::{ALPHA_DELTA, Ggx, half_vector, reflect};
use super::model::{Boundary, Bsdf, BsdfEval, BsdfSample, Lobe, Tables, Textured};
use crate::math::columns::columns;
use crate::math::warp;
use crate::scene::Material;

columns! {
    /// What the surface is made of at a hit.
    #[derive(Debug, PartialEq)]
    pub struct GlossyParams as GlossyParamsLanes {
        /// Diffuse colour of the dielectric and F0 of the metal.
        base_color: Vec3,
        /// 0 dielectric … 1 metal.
        metallic: f32,
        /// GGX alpha.
        alpha: f32,
        /// Reflectance of the dielectric at the normal.
        f0: Vec3,
        /// Reflectance of the dielectric at grazing.
        f90: f32,
    }
}

impl Lobe {
    /// The specular lobe of an opaque surface.
    pub fn specular(alpha: f32) -> Self {
        match alpha < ALPHA_DELTA {
            true => Lobe { name: "mirror", alpha: 0.0 },
            false => Lobe { name: "rough specular", alpha },
        }
    }
}

impl GlossyParams {
    /// Of an opaque material with its textured factors.
    #[inline(always)]
    pub fn of(boundary: &Boundary, textured: &Textured) -> Self {
        let roughness = textured.roughness.clamp(0.0, 1.0);
        // F0 of the dielectric coat (KHR_materials_specular).
        let reflectance = normal_reflectance(boundary.ior);
        GlossyParams {
            base_color: textured.base_color.clamp(Vec3::ZERO, Vec3::ONE),
            metallic: textured.metallic.clamp(0.0, 1.0),
            alpha: roughness * roughness,
            f0: (boundary.specular_color * reflectance).min(Vec3::ONE) * boundary.specular,
            f90: boundary.specular,
        }
    }

    /// What the dielectric's coat leaves to its base.
    #[inline(always)]
    pub fn complement<'t>(&self, tables: &'t SpecularAlbedo) -> Complement<'t> {
        tables.complement(if self.alpha < ALPHA_DELTA { 0.0 } else { self.alpha }, self.f0.max_element(), self.f90)
    }
}

/// Mirror-like or GGX reflection over a diffuse base, mixed: everything but what the base gives up to the coat. Its
/// functions have no branches, for loops over lanes.
#[derive(Clone, Copy, Debug)]
pub struct Lobes {
    ggx: Ggx,
    mirror: bool,
    f0: Vec3,
    f90: f32,
    diffuse: Vec3,
}

/// A direction drawn from [`Lobes`], not yet weighed.
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    /// Unit direction; below the surface where the chosen facet reflects into it.
    pub wi: Vec3,
    /// Its facet.
    m: Vec3,
    /// Whether the mirror was chosen.
    mirrored: bool,
}

impl Lobes {
    /// Mixes the lobes.
    #[inline(always)]
    pub fn new(params: &GlossyParams) -> Self {
        let GlossyParams { base_color, metallic, alpha, f0, f90 } = *params;
        Lobes {
            ggx: Ggx::isotropic(alpha.max(ALPHA_DELTA)),
            mirror: alpha < ALPHA_DELTA,
            f0: f0 * (1.0 - metallic) + base_color * metallic,
            f90: f90 * (1.0 - metallic) + metallic,
            diffuse: base_color * (1.0 - metallic),
        }
    }

    /// Whether light sampling can find nothing: a mirror without a base.
    #[inline(always)]
    pub fn is_delta(&self) -> bool {
        self.mirror & (self.diffuse.x == 0.0) & (self.diffuse.y == 0.0) & (self.diffuse.z == 0.0)
    }

    /// Probability of the specular lobe for a viewer under `cos_o`, by estimated albedo. Never 0 where the lobe
    /// reflects at all. `below_o` is the coat's complement for the viewer.
    #[inline(always)]
    pub fn p_specular(&self, cos_o: f32, below_o: f32) -> f32 {
        let w = schlick_weight(cos_o).max(SCHLICK_AVERAGE);
        let specular = max_channel(self.f0 + (Vec3::splat(self.f90) - self.f0) * w);
        let diffuse = max_channel(self.diffuse) * below_o;
        let total = specular + diffuse;
        let p = specular / total;
        if total > 0.0 { p } else { 1.0 }
    }

    /// Value and density for directions above the surface with half vector `m`; the mirror is not part of it. `split`
    /// is what the coat leaves to the base.
    #[inline(always)]
    pub fn eval(&self, wo: Vec3, wi: Vec3, m: Vec3, split: f32, p_specular: f32) -> BsdfEval {
        let cosine = wi.z * FRAC_1_PI;
        let diffuse = self.diffuse * (cosine * split);
        let diffuse_pdf = (1.0 - p_specular) * cosine;
        let lobe = self.ggx.reflection(wo, wi, m);
        let specular = schlick(self.f0, self.f90, wo.dot(m)) * lobe.f_cos;
        let both = specular + diffuse;
        BsdfEval {
            f_cos: choose(self.mirror, diffuse, both),
            pdf_sa: if self.mirror { diffuse_pdf } else { p_specular * lobe.pdf_sa + diffuse_pdf },
        }
    }

    /// Draws a direction for a viewer above the surface; `u` = lobe, u, v.
    #[inline(always)]
    pub fn draw(&self, wo: Vec3, u: [f32; 3], p_specular: f32) -> Drawn {
        let specular = u[0] < p_specular;
        let m = self.ggx.sample_visible(wo, [u[1], u[2]]);
        let around = warp::cosine_hemisphere([u[1], u[2]]);
        let mirrored = specular & self.mirror;
        let wi = choose(specular, reflect(wo, m), around);
        let wi = choose(mirrored, Vec3::new(-wo.x, -wo.y, wo.z), wi);
        Drawn { wi, m: choose(specular, m, half_vector(wo, around)), mirrored }
    }

    /// Weight and density of a drawn direction. A density of 0: nothing can be scattered there.
    #[inline(always)]
    pub fn weigh(&self, wo: Vec3, drawn: &Drawn, split: f32, p_specular: f32) -> (Vec3, f32) {
        let eval = self.eval(wo, drawn.wi, drawn.m, split, p_specular);
        let mirrored = schlick(self.f0, self.f90, wo.z) / p_specular;
        let weight = choose(drawn.mirrored, mirrored, eval.f_cos / eval.pdf_sa);
        let above = drawn.wi.z > 0.0;
        let pdf_sa = if drawn.mirrored { f32::INFINITY } else { eval.pdf_sa };
        (weight, if above { pdf_sa } else { 0.0 })
    }
}

/// One of two vectors, component by component.
#[inline(always)]
fn choose(first: bool, a: Vec3, b: Vec3) -> Vec3 {
    let one = |a: f32, b: f32| if first { a } else { b };
    Vec3::new(one(a.x, b.x), one(a.y, b.y), one(a.z, b.z))
}

#[inline(always)]
fn max_channel(color: Vec3) -> f32 {
    color.x.max(color.y).max(color.z)
}

columns! {
    /// The lobes with what the coat leaves to the base.
    #[derive(Debug)]
    pub struct Glossy<'t> as GlossyLanes {
        /// Parameters of the lobes.
        params: GlossyParams,
        /// Neither metal nor coat: the weight of a sample is then the base colour itself.
        lambert: bool,
        /// What the coat leaves to the base.
        complement: Complement<'t>,
    }
}

columns! {
    /// The viewer's side of it.
    #[derive(Debug)]
    pub struct GlossyView as GlossyViewLanes {
        /// What the coat leaves to the base of light to the viewer.
        below_o: f32,
        /// Probability of the specular lobe.
        p_specular: f32,
    }
}

impl<'t> Glossy<'t> {
    /// Of parameters that no material gave.
    pub fn of(params: &GlossyParams, tables: &'t SpecularAlbedo) -> Self {
        let lambert = params.metallic == 0.0 && params.f90 == 0.0;
        Glossy { params: *params, lambert, complement: params.complement(tables) }
    }

    /// With what a dielectric's surface is like; look-ups are still to be done.
    #[inline(always)]
    pub fn with(boundary: &Boundary, textured: &Textured, tables: &Tables<'t>) -> Self {
        let params = GlossyParams::of(boundary, textured);
        let lambert = (params.metallic == 0.0) & (params.f90 == 0.0);
        Glossy { params, lambert, complement: tables.none }
    }

    #[inline(always)]
    fn lobes(&self) -> Lobes {
        Lobes::new(&self.params)
    }
}

impl<'t> Bsdf<'t> for Glossy<'t> {
    const COLUMNS: bool = true;
    const TEXTURED: bool = true;
    const TRANSMITS: bool = false;
    const DELTAS: bool = true;
    const LAYERED: bool = true;

    type View = GlossyView;
    type Drawn = Drawn;

    #[inline(always)]
    fn new(material: &Material, textured: &Textured, tables: &Tables<'t>, _: f32) -> Self {
        Glossy::with(&Boundary::of(material), textured, tables)
    }

    #[inline(always)]
    fn idle(tables: &Tables<'t>) -> Self {
        let params = GlossyParams { base_color: Vec3::ZERO, metallic: 0.0, alpha: 0.0, f0: Vec3::ZERO, f90: 0.0 };
        Glossy { params, lambert: true, complement: tables.none }
    }

    #[inline(always)]
    fn look_up(&mut self, tables: &Tables<'t>) {
        if !self.lambert {
            self.complement = self.params.complement(tables.albedo);
        }
    }

    #[inline(always)]
    fn is_delta(&self) -> bool {
        self.lobes().is_delta()
    }

    #[inline(always)]
    fn below(&self, cos: f32) -> f32 {
        if self.lambert { 1.0 } else { self.complement.at(cos) }
    }

    #[inline(always)]
    fn view(&self, wo: Vec3, below_o: f32) -> GlossyView {
        GlossyView { below_o, p_specular: self.lobes().p_specular(wo.z, below_o) }
    }

    #[inline(always)]
    fn split(&self, view: &GlossyView, cos_i: f32) -> f32 {
        if self.lambert { 1.0 } else { self.complement.split(view.below_o, self.complement.at(cos_i)) }
    }

    #[inline(always)]
    fn eval(&self, wo: Vec3, wi: Vec3, view: &GlossyView, split: f32) -> BsdfEval {
        self.lobes().eval(wo, wi, half_vector(wo, wi), split, view.p_specular)
    }

    fn diffuse(&self, _: Vec3, wi: Vec3, _: &GlossyView, split: f32) -> Vec3 {
        self.lobes().diffuse * (wi.z * FRAC_1_PI * split)
    }

    #[inline(always)]
    fn draw(&self, wo: Vec3, u: [f32; 3], view: &GlossyView) -> Drawn {
        self.lobes().draw(wo, u, view.p_specular)
    }

    #[inline(always)]
    fn wi(drawn: &Drawn) -> Vec3 {
        drawn.wi
    }

    #[inline(always)]
    fn weigh(&self, wo: Vec3, drawn: &Drawn, view: &GlossyView, split: f32) -> BsdfSample {
        let (weight, pdf_sa) = self.lobes().weigh(wo, drawn, split, view.p_specular);
        let weight = choose(self.lambert, self.params.base_color, weight);
        BsdfSample { wi: drawn.wi, weight, pdf_sa, eta: 1.0 }
    }

    fn name(&self) -> &'static str {
        match (self.lambert, self.params.base_color == Vec3::ZERO) {
            (true, true) => "black",
            (true, false) => "lambert",
            (false, _) => "glossy",
        }
    }

    fn lobe(&self, _: Vec3, u: f32, view: &GlossyView, _: bool) -> Lobe {
        match (self.lambert, u < view.p_specular) {
            (true, _) => Lobe::wide("diffuse"),
            (false, false) => Lobe::wide("diffuse base"),
            (false, true) => Lobe::specular(self.params.alpha),
        }
    }

    fn widest_alpha(&self) -> f32 {
        let diffuse = self.lambert || self.lobes().diffuse != Vec3::ZERO;
        if diffuse { 1.0 } else { Lobe::specular(self.params.alpha).alpha }
    }
}
