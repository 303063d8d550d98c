//! The contract of every scattering model: what one lane of a kernel asks of it. `transport::kernel` drives any model;
//! scalar code and tests call the two provided functions.
//!
//! A model is plain numbers with a form in columns. Its functions are called in loops over sixteen lanes: where
//! [`COLUMNS`](Bsdf::COLUMNS) says so they have no branches and no look-ups, so that the loops become vector code.
//! Table look-ups are a separate stage ([`below`](Bsdf::below), [`split`](Bsdf::split)).
//!
//! Directions in the shading frame, n = +z; pdfs in sr⁻¹. Opaque surfaces answer for viewers above them only.

use glam::Vec3;

use super::albedo::{Complement, SpecularAlbedo};
use super::film::Film;
use super::glass_albedo::GlassAlbedo;
use super::sheen_albedo::SheenAlbedo;
use crate::math::columns::Column;
use crate::math::frame::Frame;
use crate::scene::Material;

/// Value and density of a BSDF for one pair of directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfEval {
    /// f(wo, wi)·|cos θ_i|, per channel, sr⁻¹.
    pub f_cos: Vec3,
    /// Density of `sample` choosing `wi`, sr⁻¹. 0 where `f_cos` is 0 by support.
    pub pdf_sa: f32,
}

impl BsdfEval {
    /// Nothing scattered, never sampled.
    pub const ZERO: BsdfEval = BsdfEval { f_cos: Vec3::ZERO, pdf_sa: 0.0 };
}

/// A direction drawn from a BSDF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Unit direction towards the light.
    pub wi: Vec3,
    /// f·|cos θ_i| / pdf, per channel: what the throughput is multiplied by. Finite, ≥ 0. Radiance convention:
    /// includes 1/η² on refraction into a medium of relative index η (so that L/n² is conserved).
    pub weight: Vec3,
    /// Density of the choice, sr⁻¹; +∞ for a delta lobe, which light sampling cannot hit.
    pub pdf_sa: f32,
    /// n(side of wi)/n(side of wo): 1 for reflection.
    pub eta: f32,
}

/// [`Textured::exterior`] of a boundary within a solid of a higher rank: light goes on as if it were not there.
pub const HIDDEN: f32 = 0.0;

/// Factors of a material after its textures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Textured {
    /// Linear base colour.
    pub base_color: Vec3,
    /// 0 dielectric … 1 metal.
    pub metallic: f32,
    /// glTF roughness; GGX alpha is its square.
    pub roughness: f32,
    /// Index of refraction outside of a solid: 1 unless it lies in another; [`HIDDEN`] where the boundary changes
    /// nothing.
    pub exterior: f32,
}

impl Textured {
    /// The factors of a material without textures.
    pub fn constant(material: &Material) -> Self {
        let Material { base_color, metallic, roughness, .. } = *material;
        Textured { base_color, metallic, roughness, exterior: 1.0 }
    }
}

/// What KHR_materials_ior, _specular and _transmission say of a dielectric's surface, after textures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Boundary {
    /// Index of refraction, ≥ 1, or 0.
    pub ior: f32,
    /// Strength of its reflection, from 0 to 1.
    pub specular: f32,
    /// Colour of its reflection at the normal, ≥ 0.
    pub specular_color: Vec3,
    /// Fraction of light that it lets through, from 0 to 1.
    pub transmission: f32,
    /// Whether what it lets through enters a solid; else it passes a thin wall.
    pub solid: bool,
}

impl Boundary {
    /// The numbers of a material without textures.
    #[inline(always)]
    pub fn of(material: &Material) -> Self {
        let Material { ior, specular, specular_color, transmission, thickness, .. } = *material;
        Boundary { ior, specular, specular_color, transmission, solid: thickness > 0.0 }
    }
}

/// What the extensions of a material say at a hit, after their textures: what models with layers are made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extended {
    /// The dielectric's surface.
    pub boundary: Boundary,
    /// What multiplies 1 − roughness.
    pub glossiness: f32,
    /// Weight of the clearcoat, from 0 to 1.
    pub clearcoat: f32,
    /// Its glTF roughness.
    pub clearcoat_roughness: f32,
    /// Its unit normal in the world, on the viewer's side.
    pub clearcoat_n: Vec3,
    /// Strength of the grain, from 0 to 1.
    pub anisotropy: f32,
    /// Where it runs, in the world.
    pub tangent: Vec3,
    /// What lies on the surface below the layers.
    pub film: Film,
    /// Fraction of the light below the coat that passes, from 0 to 1.
    pub diffuse_transmission: f32,
    /// Its colour.
    pub diffuse_transmission_color: Vec3,
    /// Colour of the sheen, from 0 to 1.
    pub sheen_color: Vec3,
    /// Its glTF roughness.
    pub sheen_roughness: f32,
}

impl Extended {
    /// The numbers of a material without textures, with layers along `n`.
    pub fn constant(material: &Material, n: Vec3) -> Self {
        let Material { clearcoat, clearcoat_roughness, sheen_color, sheen_roughness, .. } = *material;
        let Material { anisotropy, diffuse_transmission, diffuse_transmission_color, .. } = *material;
        let Material { iridescence, iridescence_ior, iridescence_thickness_nm: [_, thickness_nm], .. } = *material;
        Extended {
            boundary: Boundary::of(material),
            glossiness: 1.0,
            clearcoat,
            clearcoat_roughness,
            clearcoat_n: n,
            anisotropy,
            tangent: Vec3::ZERO,
            film: Film { weight: iridescence, ior: iridescence_ior, thickness_nm },
            diffuse_transmission,
            diffuse_transmission_color,
            sheen_color,
            sheen_roughness,
        }
    }
}

/// Tables that models are made with.
#[derive(Clone, Copy)]
pub struct Tables<'t> {
    /// Directional albedo of dielectric coats.
    pub albedo: &'t SpecularAlbedo,
    /// Whether there is a coat at all: without one, no table is read.
    pub coated: bool,
    /// What lies below nothing.
    pub none: Complement<'t>,
    /// Directional albedo of sheen; without it there is no sheen.
    pub sheen: Option<&'t SheenAlbedo>,
    /// What rough solids return; without it their loss stays.
    pub glass: Option<&'t GlassAlbedo>,
}

impl<'t> Tables<'t> {
    /// With or without coats.
    pub fn new(albedo: &'t SpecularAlbedo, coated: bool) -> Self {
        Tables { albedo, coated, none: albedo.complement(0.0, 0.0, 0.0), sheen: None, glass: None }
    }

    /// The same with sheen.
    pub fn with_sheen(self, sheen: &'t SheenAlbedo) -> Self {
        Tables { sheen: Some(sheen), ..self }
    }

    /// The same with what rough solids return.
    pub fn with_glass(self, glass: &'t GlassAlbedo) -> Self {
        Tables { glass: Some(glass), ..self }
    }
}

/// What a sample came from, for reports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lobe {
    /// What it is called.
    pub name: &'static str,
    /// Its GGX alpha: 0 without a density, 1 where it is no microfacet lobe.
    pub alpha: f32,
}

impl Lobe {
    /// One that is not of microfacets.
    pub const fn wide(name: &'static str) -> Self {
        Lobe { name, alpha: 1.0 }
    }
}

/// A scattering model with its parameters at one hit.
pub trait Bsdf<'t>: Column {
    /// Whether its functions have no branches. Else lanes that scatter nothing are skipped.
    const COLUMNS: bool;
    /// Whether it reads metallic and roughness, and textures and vertex colours may change its factors. Else it gets
    /// the base colour alone.
    const TEXTURED: bool;
    /// Whether light may cross the surface, for some parameters.
    const TRANSMITS: bool;
    /// Whether it may have lobes without a density.
    const DELTAS: bool;
    /// Whether layers share light by tables: [`below`](Self::below) and [`split`](Self::split) are then asked.
    const LAYERED: bool;

    /// Whether unlit surfaces, which show a colour and scatter nothing, may be among its lanes.
    const UNLIT: bool = false;

    /// Whether it asks nothing of directions but their cosines with the normal: `wo` and the `wi` of
    /// [`eval`](Self::eval) then have no x and y.
    const COSINES: bool = false;

    /// Whether it has layers and lobes of extensions: it is then made by [`extended`](Self::extended), and told the
    /// shading frame.
    const EXTENDED: bool = false;

    /// Whether it is a diffuse base and nothing else.
    const DIFFUSE: bool = false;

    /// What depends on the viewer alone.
    type View: Column;

    /// A direction that was drawn, not yet weighed.
    type Drawn: Copy;

    /// The model of `material` with its textured factors. `u_material` chooses among the parts of a mixture.
    fn new(material: &Material, textured: &Textured, tables: &Tables<'t>, u_material: f32) -> Self;

    /// As [`new`](Self::new), with what extensions say there.
    #[inline(always)]
    fn extended(material: &Material, textured: &Textured, _: &Extended, tables: &Tables<'t>, u_material: f32) -> Self {
        Self::new(material, textured, tables, u_material)
    }

    /// Turns directions that it was given in the world into the shading frame.
    #[inline(always)]
    fn orient(&mut self, _frame: &Frame) {}

    /// What lanes that are not in use hold.
    fn idle(tables: &Tables<'t>) -> Self;

    /// Looks up what its layers share by tables; asked where [`Tables::coated`].
    #[inline(always)]
    fn look_up(&mut self, _tables: &Tables<'t>) {}

    /// Whether it scatters anything.
    #[inline(always)]
    fn scatters(&self) -> bool {
        true
    }

    /// Whether light arrives from both sides: the frame is then the authored outward one, wo.z < 0 is inside.
    #[inline(always)]
    fn outward(&self) -> bool {
        false
    }

    /// Whether `eval` is zero for every pair, so that sampling a light is wasted.
    fn is_delta(&self) -> bool;

    /// What the upper layers leave to those below for light under this cosine.
    #[inline(always)]
    fn below(&self, _cos: f32) -> f32 {
        1.0
    }

    /// Works the viewer's side out; `below_o` is [`below`](Self::below) for it.
    fn view(&self, wo: Vec3, below_o: f32) -> Self::View;

    /// What the upper layers leave to those below for light that leaves to the viewer and arrives under `cos_i`.
    #[inline(always)]
    fn split(&self, _view: &Self::View, _cos_i: f32) -> f32 {
        1.0
    }

    /// f·|cos θ_i| and the density of sampling; zero for delta lobes. Opaque: for directions above the surface.
    fn eval(&self, wo: Vec3, wi: Vec3, view: &Self::View, split: f32) -> BsdfEval;

    /// The part of [`eval`](Self::eval)'s f·|cos θ_i| that the diffuse base reflects, for layers that tell it apart.
    fn diffuse(&self, wo: Vec3, wi: Vec3, view: &Self::View, split: f32) -> Vec3;

    /// Draws a direction; `u` = lobe, u, v.
    fn draw(&self, wo: Vec3, u: [f32; 3], view: &Self::View) -> Self::Drawn;

    /// The direction that was drawn.
    fn wi(drawn: &Self::Drawn) -> Vec3;

    /// Weighs a drawn direction. A density of 0: nothing can be scattered there.
    fn weigh(&self, wo: Vec3, drawn: &Self::Drawn, view: &Self::View, split: f32) -> BsdfSample;

    /// What the surface is here, for reports.
    fn name(&self) -> &'static str;

    /// The lobe that a sample came from: `u` is the number that chose it, `reflected` says on which side it went.
    fn lobe(&self, wo: Vec3, u: f32, view: &Self::View, reflected: bool) -> Lobe;

    /// [`Lobe::alpha`] of its widest lobe, for reports: what light samples, which reach all of them, see.
    fn widest_alpha(&self) -> f32;

    /// [`eval`](Self::eval) with everything it needs; zero where an opaque surface is seen or lit from below.
    #[inline(always)]
    fn value(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if !(self.outward() || wo.z > 0.0 && wi.z > 0.0) {
            return BsdfEval::ZERO;
        }
        let view = self.view(wo, self.below(wo.z));
        self.eval(wo, wi, &view, self.split(&view, wi.z))
    }

    /// [`diffuse`](Self::diffuse) with everything it needs, as [`value`](Self::value).
    fn diffuse_value(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if !(self.outward() || wo.z > 0.0 && wi.z > 0.0) {
            return Vec3::ZERO;
        }
        let view = self.view(wo, self.below(wo.z));
        self.diffuse(wo, wi, &view, self.split(&view, wi.z))
    }

    /// Draws and weighs a direction. `None` ends the path: absorbed, or masked by the surface itself.
    #[inline(always)]
    fn sampled(&self, wo: Vec3, u: [f32; 3]) -> Option<BsdfSample> {
        if !self.outward() && !(wo.z > 0.0) {
            return None;
        }
        let view = self.view(wo, self.below(wo.z));
        let drawn = self.draw(wo, u, &view);
        let sample = self.weigh(wo, &drawn, &view, self.split(&view, Self::wi(&drawn).z));
        (sample.pdf_sa > 0.0).then_some(sample)
    }
}
