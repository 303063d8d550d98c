//! Scattering functions: chi-square of every sampler, energy, agreement of eval, pdf and sample, and the corners of
//! their domains. White furnaces, microfacets and reciprocity are hard cases (B01 to B15).

mod body;
mod chi2;
mod clearcoat;
mod energy;
mod identities;
mod materials;
mod multiscatter;
mod sheen;

use glam::Vec3;
use pathspace::shading::bsdf::albedo::SpecularAlbedo;
use pathspace::shading::bsdf::dielectric::{Body, Dielectric};
use pathspace::shading::bsdf::glossy::{Glossy, GlossyParams};
use pathspace::shading::bsdf::lambert::Lambert;
use pathspace::shading::surface::Surface;
use pathspace_stat::{Moments, Pcg32};

/// Unit direction of cosine `mu` at azimuth `phi`.
pub fn direction(mu: f32, phi: f32) -> Vec3 {
    let s = ((1.0 - mu) * (1.0 + mu)).max(0.0).sqrt();
    Vec3::new(s * phi.cos(), s * phi.sin(), mu)
}

pub fn glossy(tables: &SpecularAlbedo, base_color: Vec3, metallic: f32, alpha: f32, specular: f32) -> Surface<'_> {
    let f0 = Vec3::splat(0.04 * specular);
    Surface::Glossy(Glossy::of(&GlossyParams { base_color, metallic, alpha, f0, f90: specular }, tables))
}

pub fn glass(body: Body, eta: f32, alpha: f32) -> Surface<'static> {
    let (tint, specular_color) = (Vec3::ONE, Vec3::ONE);
    Surface::Dielectric(Dielectric { body, eta, alpha, tint, specular: 1.0, specular_color })
}

/// Every lobe that has a density, with its name: what the general tests run over.
pub fn rough_surfaces(tables: &SpecularAlbedo) -> Vec<(String, Surface<'_>)> {
    let grey = Vec3::new(0.8, 0.5, 0.2);
    let mut all = vec![("lambert".to_string(), Surface::Lambert(Lambert { albedo: grey }))];
    for alpha in [0.05, 0.1, 0.5, 1.0] {
        all.push((format!("metal {alpha}"), glossy(tables, grey, 1.0, alpha, 1.0)));
        all.push((format!("coated {alpha}"), glossy(tables, grey, 0.0, alpha, 1.0)));
        all.push((format!("half metal {alpha}"), glossy(tables, grey, 0.5, alpha, 0.0)));
        all.push((format!("solid 1.5 {alpha}"), glass(Body::Solid, 1.5, alpha)));
        all.push((format!("thin {alpha}"), glass(Body::Thin, 1.5, alpha)));
    }
    all.push(("solid 1.1 0.3".into(), glass(Body::Solid, 1.1, 0.3)));
    all.push(("solid 2.4 0.2".into(), glass(Body::Solid, 2.4, 0.2)));
    let tinted = Dielectric {
        body: Body::Solid,
        eta: 1.33,
        alpha: 0.25,
        tint: grey,
        specular: 0.6,
        specular_color: Vec3::new(1.0, 0.3, 2.0),
    };
    all.push(("tinted solid".into(), Surface::Dielectric(tinted)));
    all.push(("coat over mirror limit".into(), glossy(tables, grey, 0.3, 0.0, 1.0)));
    all
}

/// Viewers to test a surface from: inside too if it has one.
pub fn viewers(surface: &Surface) -> Vec<Vec3> {
    let mus = [1.0, 0.9, 0.5, 0.1, 0.01];
    let mut all: Vec<Vec3> = mus.iter().map(|&mu| direction(mu, 0.4)).collect();
    if surface.is_transmissive() {
        all.extend(mus.iter().map(|&mu| direction(-mu, 2.0)));
    }
    all
}

/// Moments of the energy that leaves a surface for one unit of light, by sampling from `wo`: weight × η² per
/// channel's largest, because a weight across an interface is a ratio of radiances.
pub fn furnace(surface: &Surface, wo: Vec3, n: u32, seed: u64) -> Moments {
    let mut rng = Pcg32::new(seed, 1);
    let mut energy = Moments::default();
    for _ in 0..n {
        let sample = surface.sample(wo, rng.array());
        energy.push(sample.map_or(0.0, |s| f64::from(s.weight.max_element() * s.eta * s.eta)));
    }
    energy
}
