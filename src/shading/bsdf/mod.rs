//! Scattering functions. Directions in the shading frame, n = +z; `eval` includes |cos θ_i|; pdfs in sr⁻¹.
//!
//! [`model`] is the contract of them all. This page is their list.

pub mod albedo;
pub mod body;
pub mod clearcoat;
pub mod compensated;
pub mod dielectric;
pub mod film;
pub mod finish;
pub mod fresnel;
pub mod glass_albedo;
pub mod glossy;
pub mod lambert;
pub mod microfacet;
pub mod model;
pub mod multiscatter;
pub mod sheen;
pub mod sheen_albedo;
pub mod translucent;

/// The scattering models: hands them to the macro `$apply`, which makes kinds of materials, queues and the dispatch of
/// kernels of them. The first whose condition a material (with its facts) meets shades it. To add one: implement
/// [`Bsdf`](model::Bsdf) in a file of this folder and add a line here.
macro_rules! models {
    ($apply:ident) => {
        $apply! {
            /// Layers over any other surface, and textures of extensions.
            Layers: $crate::shading::bsdf::clearcoat::Clearcoat<'_>, |facts, _| facts.has(Fact::Layers);
            /// What loses light between facets, where that is given back: plans say so, not materials.
            Compensated: $crate::shading::bsdf::compensated::Compensated<'_>, |_, _| false;
            /// Exact Lambert without textures and vertex colours: the lean kernel.
            Lambert: $crate::shading::bsdf::lambert::Lambert, |facts, _| facts.is_diffuse() && facts.is_plain();
            /// Opaque and lit: coats, metals, textures.
            Opaque: $crate::shading::bsdf::glossy::Glossy<'_>, |facts, _| !facts.transmits() && !facts.has(Fact::Unlit);
            /// Everything else: what transmits or is unlit.
            General: $crate::shading::surface::Surface<'_>, |_, _| true;
        }
    };
}

pub(crate) use models;
