//! From glTF factors to a surface: exact reductions, mixtures, and the classification that plans stand on.

use glam::Vec3;
use pathspace::scene::{Fact, FactSet, Facts, Material};
use pathspace::shading::bsdf::albedo::SpecularAlbedo;
use pathspace::shading::bsdf::dielectric::Body;
use pathspace::shading::bsdf::lambert::Lambert;
use pathspace::shading::bsdf::model::{Tables, Textured};
use pathspace::shading::surface::Surface;
use pathspace_stat::Pcg32;

use super::direction;

fn resolve<'t>(material: &Material, tables: &'t SpecularAlbedo, u_material: f32) -> Surface<'t> {
    Surface::from_material(material, Textured::constant(material), &Tables::new(tables, true), u_material)
}

fn random_pair(rng: &mut Pcg32) -> (Vec3, Vec3) {
    let [a, b, c, d] = rng.array();
    let tau = std::f32::consts::TAU;
    (direction(a.max(1e-3), tau * b), direction(c.max(1e-3), tau * d))
}

/// The shared scenes' conventions. Oracle: bit equality with Lambert at metallic 0, specular 0; with the F0 = base
/// colour metal at metallic 1 whatever the specular; and the linear mix of both in between to 1e-6.
#[test]
fn metallic_roughness_reduces_exactly() {
    let tables = SpecularAlbedo::compute();
    let base_color = Vec3::new(0.9, 0.5, 0.1);
    let material = |metallic: f32, specular: f32| Material {
        base_color,
        metallic,
        specular,
        roughness: 0.6,
        ..Material::default()
    };
    let lambert = Surface::Lambert(Lambert { albedo: base_color });
    let metal = resolve(&material(1.0, 0.0), &tables, 0.0);
    let mut rng = Pcg32::new(0, 20);
    for _ in 0..2000 {
        let (wo, wi) = random_pair(&mut rng);
        let diffuse = resolve(&material(0.0, 0.0), &tables, 0.5);
        assert_eq!(diffuse.eval(wo, wi), lambert.eval(wo, wi));
        let u = rng.array();
        assert_eq!(diffuse.sample(wo, u), lambert.sample(wo, u));
        assert_eq!(resolve(&material(1.0, 1.0), &tables, 0.5).eval(wo, wi), metal.eval(wo, wi));
        for metallic in [0.25, 0.5, 0.9] {
            let got = resolve(&material(metallic, 0.0), &tables, 0.5).eval(wo, wi).f_cos;
            let expected = lambert.eval(wo, wi).f_cos.lerp(metal.eval(wo, wi).f_cos, metallic);
            assert!((got - expected).abs().max_element() <= 1e-6 * expected.max_element(), "{got} {expected}");
        }
    }
    // A coat without reflectance inside the glossy model itself is Lambert to the bit as well.
    let bare = super::glossy(&tables, base_color, 0.0, 0.36, 0.0);
    for _ in 0..2000 {
        let (wo, wi) = random_pair(&mut rng);
        assert_eq!(bare.eval(wo, wi), lambert.eval(wo, wi));
    }
}

/// A partly transmissive material is a mixture. Oracle: shares over 10⁵ equidistant numbers, to 1e-5 + one step, and
/// the kinds that the classification announced.
#[test]
fn partly_transmissive_is_a_mixture() {
    let tables = SpecularAlbedo::compute();
    let material = Material {
        metallic: 0.25,
        transmission: 0.4,
        specular: 0.0,
        thickness: 0.0,
        roughness: 0.5,
        ..Material::default()
    };
    let n = 100_000;
    let (mut clear, mut metal, mut diffuse) = (0, 0, 0);
    for k in 0..n {
        match resolve(&material, &tables, (k as f32 + 0.5) / n as f32) {
            Surface::Dielectric(d) => clear += u32::from(d.body == Body::Thin),
            Surface::Glossy(_) => metal += 1,
            Surface::Lambert(_) => diffuse += 1,
            Surface::Black => unreachable!("base colour is white"),
        }
    }
    let share = |count: u32| f64::from(count) / f64::from(n);
    assert!(
        (share(metal) - 0.25).abs() < 2e-5 && (share(clear) - 0.3).abs() < 2e-5 && (share(diffuse) - 0.45).abs() < 2e-5
    );
    assert_eq!(Facts::of(&material).set.models(), FactSet::of(&[Fact::Lambert, Fact::Glossy, Fact::Thin]));
}

/// Classification. Oracle: the definitions of the shared scenes and of the KHR extensions.
#[test]
fn kinds_follow_factors() {
    use Fact::{Black, Glossy, Lambert, Solid, Thin, Unlit};
    let plain = Material { metallic: 0.0, specular: 0.0, ..Material::default() };
    let glass = Material { transmission: 1.0, thickness: 1.0, roughness: 0.0, metallic: 0.0, ..Material::default() };
    let cases: [(Material, &[Fact]); 9] = [
        (Material::default(), &[Glossy]),
        (plain.clone(), &[Lambert]),
        (Material { base_color: Vec3::ZERO, emissive: Vec3::ONE, ..plain.clone() }, &[Black]),
        (Material { specular: 1.0, ..plain.clone() }, &[Glossy]),
        (Material { metallic: 0.5, ..plain.clone() }, &[Glossy]),
        (glass.clone(), &[Solid]),
        (Material { thickness: 0.0, ..glass.clone() }, &[Thin]),
        (Material { transmission: 0.5, ..glass.clone() }, &[Glossy, Solid]),
        (Material { unlit: true, ..glass.clone() }, &[Unlit]),
    ];
    for (material, expected) in cases {
        assert_eq!(Facts::of(&material).set.models(), FactSet::of(expected), "{material:?}");
    }
}

/// The table is made only when a scene can read it. Oracle: equality with the empty one.
#[test]
fn tables_are_filled_on_demand() {
    let metal = Material::default();
    let lambert = Material { metallic: 0.0, specular: 0.0, ..Material::default() };
    let glass = Material { metallic: 0.0, transmission: 1.0, ..Material::default() };
    let coat = Material { metallic: 0.0, ..Material::default() };
    let quiet = [metal, lambert, glass];
    assert_eq!(SpecularAlbedo::for_materials(&quiet, false), SpecularAlbedo::empty());
    assert_eq!(SpecularAlbedo::for_materials(&[coat], false), SpecularAlbedo::compute());
}
