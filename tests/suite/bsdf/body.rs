//! Surfaces with a grain, under a film, and with a base that lets light pass: χ² of their sampling, energy,
//! reciprocity, and what is left of them without any of it.

use glam::Vec3;
use pathspace::math::frame::Frame;
use pathspace::scene::Material;
use pathspace::shading::bsdf::albedo::SpecularAlbedo;
use pathspace::shading::bsdf::body::Body;
use pathspace::shading::bsdf::clearcoat::Clearcoat;
use pathspace::shading::bsdf::film::Film;
use pathspace::shading::bsdf::finish::Fine;
use pathspace::shading::bsdf::glossy::{Glossy, GlossyParams};
use pathspace::shading::bsdf::model::{Bsdf, Extended, Tables, Textured};
use pathspace::shading::bsdf::sheen::Sheen;
use pathspace::shading::bsdf::sheen_albedo::SheenAlbedo;
use pathspace::shading::bsdf::translucent::{Through, Translucent};
use pathspace_stat::{Moments, Pcg32, SphereBins};

use super::chi2::check;
use super::direction;

/// Two-sided false-alarm rate 1e-6 per value.
const Z: f64 = 4.9;

fn body<'t>(material: &Material, tables: &'t SpecularAlbedo) -> Body<'t> {
    let extended = Extended { tangent: Vec3::new(0.6, 0.8, 0.0), ..Extended::constant(material, Vec3::Z) };
    let mut body = Body::resolve(&extended, Textured::constant(material), &Tables::new(tables, true), 0.5);
    body.orient(&Frame::from_normal(Vec3::Z), extended.tangent);
    body
}

/// White surfaces of every kind, by name.
fn bodies(tables: &SpecularAlbedo) -> Vec<(&'static str, Body<'_>)> {
    let white = Material { metallic: 0.0, roughness: 0.5, ..Material::default() };
    let metal = Material { metallic: 1.0, ..white.clone() };
    let glass = Material { transmission: 1.0, thickness: 1.0, ..white.clone() };
    let lambert = Material { specular: 0.0, ..white.clone() };
    let film = |material: Material| Material { iridescence: 1.0, iridescence_thickness_nm: [400.0; 2], ..material };
    let grain = |material: Material| Material { anisotropy: 0.8, ..material };
    let passes = |material: Material| Material {
        diffuse_transmission: 0.6,
        diffuse_transmission_color: Vec3::new(1.0, 0.5, 0.2),
        ..material
    };
    vec![
        ("metal with a grain", grain(metal.clone())),
        ("metal under a film", film(Material { base_color: Vec3::new(0.9, 0.6, 0.3), ..metal.clone() })),
        ("coat with a grain", grain(white.clone())),
        ("coat under a film", film(white.clone())),
        ("half a metal with both", grain(film(Material { metallic: 0.5, ..white.clone() }))),
        ("mirror under a film", film(Material { roughness: 0.0, ..metal })),
        ("translucent", passes(lambert)),
        ("translucent coat", passes(white.clone())),
        ("translucent with all", passes(grain(film(Material { metallic: 0.2, ..white })))),
        ("solid with a grain", grain(glass.clone())),
        ("solid under a film", film(glass.clone())),
        ("thin wall with both", grain(film(Material { thickness: 0.0, ..glass }))),
    ]
    .into_iter()
    .map(|(name, material)| (name, body(&material, tables)))
    .collect()
}

fn viewers(body: &Body) -> Vec<Vec3> {
    let mut all: Vec<Vec3> = [0.95, 0.4, 0.05].map(|mu| direction(mu, 0.4)).to_vec();
    if body.is_transmissive() {
        all.extend([0.9, 0.3].map(|mu| direction(-mu, 2.0)));
    }
    all
}

/// 2¹⁶ draws from every viewer. p > 1e-6 over the whole file.
#[test]
fn directions_follow_their_density() {
    let tables = SpecularAlbedo::compute();
    let bins = SphereBins::sphere();
    for (k, (name, body)) in bodies(&tables).into_iter().enumerate() {
        if body.is_delta() {
            continue;
        }
        for (j, wo) in viewers(&body).into_iter().enumerate() {
            let mut rng = Pcg32::new(5000 + k as u64, j as u64);
            let draw = || body.sample(wo, rng.array()).map(|s| s.wi);
            check(&format!("{name} from {wo}"), &bins, 1 << 16, |wi| body.eval(wo, wi).pdf_sa, draw);
        }
    }
}

fn furnace(sample: impl Fn([f32; 3]) -> Option<pathspace::shading::bsdf::model::BsdfSample>, seed: u64) -> Moments {
    let mut rng = Pcg32::new(seed, 11);
    let mut energy = Moments::default();
    for _ in 0..1 << 15 {
        energy.push(sample(rng.array()).map_or(0.0, |s| f64::from(s.weight.max_element() * s.eta * s.eta)));
    }
    energy
}

/// Nothing is gained, but the 1 % that the table's use for a grain costs; alone and under all layers. A translucent
/// base without a coat gives all of it back; under a coat, a grain loses at most 3 %, a film 12 %.
#[test]
fn nothing_is_gained() {
    let (tables, sheen) = (SpecularAlbedo::compute(), SheenAlbedo::compute());
    for (k, (name, body)) in bodies(&tables).into_iter().enumerate() {
        for wo in viewers(&body) {
            let energy = furnace(|u| body.sample(wo, u), k as u64);
            assert!(energy.mean <= 1.01 + Z * energy.standard_error(), "{name} from {wo}: {}", energy.mean);
            let layers = Clearcoat::over(Sheen::over(body, Vec3::splat(0.5), 0.4, Some(&sheen)), 0.6, 0.1, &tables);
            let below = furnace(|u| layers.sampled(wo, u), k as u64);
            assert!(below.mean <= 1.02 + Z * below.standard_error(), "{name} under all from {wo}: {}", below.mean);
            let least = match name {
                "translucent" => 1.0,
                "coat with a grain" | "translucent coat" => 0.97,
                "coat under a film" => 0.88,
                _ => 0.0,
            };
            assert!(energy.mean >= least - 1e-4 - Z * energy.standard_error(), "{name} from {wo}: {}", energy.mean);
        }
    }
}

/// f(wo, wi) = f(wi, wo) of what is not clear, to 1e-4 of the value.
#[test]
fn values_are_reciprocal() {
    let tables = SpecularAlbedo::compute();
    let mut rng = Pcg32::new(81, 1);
    for (name, body) in bodies(&tables).into_iter().filter(|(_, body)| !matches!(body, Body::Clear(..))) {
        for _ in 0..400 {
            let [a, b, c, d]: [f32; 4] = rng.array();
            let side = |x: f32| if body.is_transmissive() && x > 0.5 { -1.0 } else { 1.0 };
            let wo = direction((0.02 + 0.98 * a) * side(b), 6.2 * b);
            let wi = direction((0.02 + 0.98 * c) * side(d), 6.2 * d);
            let there = body.eval(wo, wi).f_cos / wi.z.abs();
            let back = body.eval(wi, wo).f_cos / wo.z.abs();
            let bound = 1e-4 * there.max_element() + 1e-30;
            assert!((there - back).abs().max_element() <= bound, "{name}: {there} {back}");
        }
    }
}

/// Without a grain, a film and light that passes, the value is that of the plain model, to 1e-5.
#[test]
fn nothing_added_is_the_plain_model() {
    let tables = SpecularAlbedo::compute();
    let mut rng = Pcg32::new(82, 1);
    for (metallic, alpha) in [(0.0, 0.3), (0.4, 0.1), (1.0, 0.5)] {
        let (base_color, f0) = (Vec3::new(0.8, 0.5, 0.2), Vec3::splat(0.04));
        let params = GlossyParams { base_color, metallic, alpha, f0, f90: 1.0 };
        let plain = Glossy::of(&params, &tables);
        let fine = Fine::new(alpha, 0.0, Film::NONE);
        let other = Translucent::new(params, fine, Through::NOTHING, &tables);
        for _ in 0..300 {
            let [a, b, c, d]: [f32; 4] = rng.array();
            let (wo, wi) = (direction(0.02 + 0.98 * a, 6.2 * b), direction(0.02 + 0.98 * c, 6.2 * d));
            let (expected, got) = (plain.value(wo, wi), other.eval(wo, wi));
            let off = (got.f_cos - expected.f_cos).abs().max_element();
            assert!(off <= 1e-4 * expected.f_cos.max_element(), "{metallic} {alpha}: {got:?} {expected:?}");
            assert!((got.pdf_sa - expected.pdf_sa).abs() <= 1e-4 * expected.pdf_sa, "{got:?} {expected:?}");
        }
    }
}

/// A grain along x makes highlights wide along it: the lobe about the mirrored direction falls off more slowly that
/// way. Oracle: αt = α + (1 − α)·strength², by D's widths along both axes, closed form.
#[test]
fn a_grain_widens_along_itself() {
    let tables = SpecularAlbedo::compute();
    let material = Material { metallic: 1.0, roughness: 0.3, anisotropy: 0.7, ..Material::default() };
    let extended = Extended { tangent: Vec3::X, ..Extended::constant(&material, Vec3::Z) };
    let mut body = Body::resolve(&extended, Textured::constant(&material), &Tables::new(&tables, true), 0.5);
    body.orient(&Frame::from_normal(Vec3::Z), Vec3::X);
    let (along, across) = (0.09 + 0.91 * 0.49, 0.09);
    let wo = Vec3::Z;
    for (axis, alpha) in [(Vec3::X, along), (Vec3::Y, across)] {
        let wi = (axis * 0.2 + Vec3::Z).normalize();
        let m = (wo + wi).normalize();
        let slope = (1.0 - m.z * m.z) / (alpha * alpha) + m.z * m.z;
        let d = 1.0 / (std::f32::consts::PI * along * across * slope * slope);
        let stretched = |w: Vec3| ((along * w.x).powi(2) + (across * w.y).powi(2) + w.z * w.z).sqrt();
        let g1 = 2.0 * wi.z / (wi.z + stretched(wi));
        let expected = d * g1 / (4.0 * wo.z);
        let got = body.eval(wo, wi).f_cos.x;
        assert!((got - expected).abs() < 1e-3 * expected, "{axis}: {got} {expected}");
    }
}
