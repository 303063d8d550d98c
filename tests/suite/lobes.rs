//! Layers and lobes of extensions in the transport: every strategy finds the same light by them, and paths of one
//! wavelength see what all wavelengths see on average.

use glam::{Affine3A, Vec2, Vec3};
use pathspace::plan::options::{RenderOptions, Strategy};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{ColorSpace, Environment, Material, Mesh, Scene, Texture, TextureId, TextureSlot, Wrap};
use pathspace::shading::bsdf::fresnel;
use pathspace::shading::dispersion;

use crate::common::{options, probe};

/// Two-sided false-alarm rate 1e-6 per channel.
const Z: f64 = 4.9;

/// Materials with every layer and lobe that has a density.
fn materials() -> Vec<(&'static str, Material)> {
    let base =
        || Material { base_color: Vec3::new(0.7, 0.5, 0.3), metallic: 0.0, roughness: 0.5, ..Material::default() };
    let sheen = |m: Material| Material { sheen_color: Vec3::new(0.4, 0.6, 0.9), sheen_roughness: 0.5, ..m };
    let coat = |m: Material| Material { clearcoat: 0.8, clearcoat_roughness: 0.4, ..m };
    let film = |m: Material| Material { iridescence: 1.0, ..m };
    let passes = |m: Material| Material { diffuse_transmission: 0.5, ..m };
    let glass = || Material { transmission: 1.0, thickness: 0.0, ..base() };
    vec![
        ("sheen", sheen(base())),
        ("coat over sheen", coat(sheen(base()))),
        ("film", film(Material { metallic: 1.0, ..base() })),
        ("coat over film", coat(film(base()))),
        ("translucent", passes(base())),
        ("all over a translucent base", coat(sheen(film(passes(base()))))),
        ("film over a thin wall", film(glass())),
        ("sheen over a thin wall", sheen(glass())),
    ]
}

/// A square of `material` in the plane y = 0, seen from above or below, with a lamp on either side and a dim sky.
fn lit(material: Material) -> Scene {
    let mut b = SceneBuilder::new();
    let surface = b.material(material);
    let lamp = b.material(Material { emissive: Vec3::new(6.0, 5.0, 4.0), double_sided: true, ..Material::default() });
    b.quad([[-2., 0., 2.], [2., 0., 2.], [2., 0., -2.], [-2., 0., -2.]].map(Vec3::from), surface);
    for y in [1.0, -1.0] {
        b.quad([[0.1, y, -0.9], [1.1, y, -0.9], [1.1, y, 0.1], [0.1, y, 0.1]].map(Vec3::from), lamp);
    }
    b.environment(Environment::constant(Vec3::new(0.2, 0.3, 0.5)));
    b.camera(Vec3::new(0.0, 1.0, 3.0), Vec3::ZERO, Vec3::Y, 0.7);
    b.build()
}

/// MIS, light sampling and BSDF sampling agree to 4.9 standard errors, each below 3 % of the value.
#[test]
fn strategies_agree_on_every_lobe() {
    for (name, material) in materials() {
        let scene = lit(material);
        for side in [1.0, -1.0] {
            let radiance = |strategy: Strategy| {
                let options = options(1, 1, 16).strategy(strategy).max_depth(2);
                probe(&scene, Vec3::new(-1.0, 0.8 * side, 0.4), Vec3::new(1.0, -0.8 * side, -0.4), 2304, options)
            };
            let mis = radiance(Strategy::MIS);
            for strategy in [Strategy::LIGHT, Strategy::BSDF] {
                let other = radiance(strategy);
                for c in 0..3 {
                    let error = mis.standard_error(c).hypot(other.standard_error(c));
                    let (a, b) = (mis.mean[c], other.mean[c]);
                    assert!((a - b).abs() <= Z * error, "{name}, {side}, {strategy}: {a} {b} ± {error}");
                    assert!(error < 0.03 * a, "{name}, {side}, {strategy}: {a} ± {error}");
                }
            }
        }
    }
}

/// A ball of strongly dispersive, fully absorbing glass reflects what each channel's band reflects on average: an
/// integral over wavelengths of Fresnel's closed form (facets are within 2° of the sphere: 5e-3). Without absorption,
/// in a white furnace, every channel sees 1.
#[test]
fn wavelengths_average_to_channels() {
    let (ior, strength) = (1.8, 8.0);
    let ball = |attenuation_color: Vec3| {
        let mut b = SceneBuilder::new();
        let glass = b.material(Material {
            metallic: 0.0,
            roughness: 0.0,
            transmission: 1.0,
            thickness: 1.0,
            ior,
            dispersion: strength,
            attenuation_color,
            attenuation_distance_m: 1e-3,
            ..Material::default()
        });
        b.sphere(Vec3::ZERO, 1.0, 48, false, false, glass);
        b.environment(Environment::constant(Vec3::ONE));
        b.camera(Vec3::new(0.0, 0.0, 3.0), Vec3::ZERO, Vec3::Y, 0.7);
        b.build()
    };
    let options = || -> RenderOptions { options(1, 1, 64) };
    let (origin, direction) = (Vec3::new(0.31, 0.17, 3.0), Vec3::NEG_Z);
    let black = ball(Vec3::ZERO);
    let seen = probe(&black, origin, direction, 4096, options().max_depth(2));
    let cos = (1.0 - 0.31f32 * 0.31 - 0.17 * 0.17).sqrt();
    let n = 30_000;
    let mut expected = [0.0; 3];
    for i in 0..n {
        let wavelength_nm = dispersion::wavelength_nm((i as f32 + 0.5) / n as f32);
        let reflectance = fresnel::dielectric(cos, dispersion::index(ior, strength, wavelength_nm)).reflectance;
        let weight = dispersion::weight(wavelength_nm);
        (0..3).for_each(|c| expected[c] += f64::from(weight[c] * reflectance) / f64::from(n));
    }
    assert!(expected[2] > 1.5 * expected[0], "blue is bent more: {expected:?}");
    for c in 0..3 {
        let limit = Z * seen.standard_error(c) + 5e-3 * expected[c];
        assert!((seen.mean[c] - expected[c]).abs() <= limit, "{c}: {} {}", seen.mean[c], expected[c]);
    }
    let clear = probe(&ball(Vec3::ONE), origin, direction, 4096, options().max_depth(256));
    for c in 0..3 {
        let limit = Z * clear.standard_error(c) + 2e-3;
        assert!((clear.mean[c] - 1.0).abs() <= limit, "{c}: {} ± {}", clear.mean[c], clear.standard_error(c));
    }
}

/// A smooth clearcoat over what light passes, seen along the normal in a furnace of radiance 1. C = 0.04 is what it
/// reflects there. A slab of glass of reflectance R = 0.04 a face has the radiance 1 − C inside, and shows C + (1 −
/// C)(R + (1 − R)(1 − C)). A white leaf shows 1 in front; from behind what the layer on the far side leaves of an even
/// light, 1 − (C + (1 − C)/21) (Schlick's average).
#[test]
fn light_leaves_through_a_clearcoat() {
    let coat = 0.04;
    let leaves = 1.0 - coat;
    let furnace = |material: Material, thick: bool| {
        let mut b = SceneBuilder::new();
        let material = b.material(Material { metallic: 0.0, clearcoat: 1.0, ..material });
        if thick {
            b.cuboid(Vec3::new(-99.0, -99.0, -1.0), Vec3::new(99.0, 99.0, 0.0), false, material);
        } else {
            b.quad([[-9., -9., 0.], [9., -9., 0.], [9., 9., 0.], [-9., 9., 0.]].map(Vec3::from), material);
        }
        b.environment(Environment::constant(Vec3::ONE));
        b.build()
    };
    let glass = furnace(Material { roughness: 0.0, transmission: 1.0, thickness: 1.0, ..Material::default() }, true);
    let leaf = furnace(Material { specular: 0.0, diffuse_transmission: 1.0, ..Material::default() }, false);
    let through_glass = coat + leaves * (coat + (1.0 - coat) * leaves);
    for (what, scene, z, expected) in [
        ("glass", &glass, 1.0, through_glass),
        ("leaf", &leaf, 1.0, 1.0),
        ("leaf from behind", &leaf, -1.0, 1.0 - (coat + leaves / 21.0)),
    ] {
        let options: RenderOptions = options(1, 1, 16);
        let seen = probe(scene, Vec3::new(0.1, 0.2, z), Vec3::new(0.0, 0.0, -z), 2304, options);
        seen.expect(what, expected, 2e-3, 2e-2);
    }
}

/// A float texture brighter than 1 makes no leaf that passes on more than it gets: a white one shows 1 in a furnace of
/// radiance 1.
#[test]
fn bright_textures_make_no_light() {
    let mut b = SceneBuilder::new();
    let leaf = b.material(Material {
        metallic: 0.0,
        specular: 0.0,
        diffuse_transmission: 1.0,
        diffuse_transmission_color_texture: Some(TextureSlot { texture: TextureId(0), uv_set: 0 }),
        ..Material::default()
    });
    let mesh = b.full_mesh(Mesh {
        positions: [[-9., -9., 0.], [9., -9., 0.], [9., 9., 0.], [-9., 9., 0.]].map(Vec3::from).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        uvs: Some(vec![Vec2::splat(0.5); 4]),
        material: leaf,
        ..Mesh::default()
    });
    b.place(mesh, Affine3A::IDENTITY);
    b.environment(Environment::constant(Vec3::ONE));
    let mut scene = b.build();
    scene.textures.push(Texture {
        name: "bright".into(),
        width: 1,
        height: 1,
        texels: vec![[4.0, 4.0, 4.0, 1.0f32]].into(),
        color_space: ColorSpace::Linear,
        wrap_u: Wrap::Repeat,
        wrap_v: Wrap::Repeat,
        bilinear: true,
    });
    let seen = probe(&scene, Vec3::new(0.1, 0.2, 1.0), Vec3::NEG_Z, 1024, options(1, 1, 4));
    seen.expect("leaf", 1.0, 1e-3, 2e-2);
}
