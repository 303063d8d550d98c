//! Lobes at the ends of their domains: sheen, thin films, grain, clearcoats, diffuse transmission, multiple scattering
//! (X01–X14). Oracles: closed forms, conservation of energy, reciprocity, the lobe without the effect.

use std::f32::consts::FRAC_PI_2;
use std::f64::consts::PI;

use glam::Vec3;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Environment, Material, Projection, Scene};
use pathspace::shading::bsdf::albedo::SpecularAlbedo;
use pathspace::shading::bsdf::clearcoat::Clearcoat;
use pathspace::shading::bsdf::film::Film;
use pathspace::shading::bsdf::lambert::Lambert;
use pathspace::shading::bsdf::microfacet::{Ggx, reflect};
use pathspace::shading::bsdf::model::Bsdf;
use pathspace::shading::bsdf::sheen::Sheen;
use pathspace::shading::bsdf::sheen_albedo::SheenAlbedo;
use pathspace::shading::surface::Surface;
use pathspace_stat::{Moments, Pcg32};

use super::Case;
use super::modes::Mode;
use crate::bsdf::{direction, glossy};
use crate::common::{Estimate, options, render};

/// The largest number that samplers give.
const LAST: f32 = 1.0 - f32::EPSILON / 2.0;

const WHITE: Surface = Surface::Lambert(Lambert { albedo: Vec3::ONE });

/// A ball that fills the picture, in a radiance of 1 all around.
pub fn furnace(material: Material) -> Scene {
    let mut b = SceneBuilder::new();
    let material = b.material(material);
    b.sphere(Vec3::ZERO, 1.0, 12, false, true, material);
    b.environment(Environment::constant(Vec3::ONE));
    b.any_camera(Vec3::Z * 3.0, Vec3::ZERO, Vec3::Y, Projection::Orthographic { xmag_m: 0.7, ymag_m: 0.7 });
    b.build()
}

/// An opaque dielectric without a coat: a diffuse base.
fn plain() -> Material {
    Material { metallic: 0.0, specular: 0.0, roughness: 0.5, ..Material::default() }
}

/// ∫ f cos over the upper hemisphere, by midpoints that are dense at the horizon.
fn albedo(f_cos: impl Fn(Vec3) -> Vec3) -> f64 {
    const N: usize = 96;
    let mut sum = 0.0;
    for i in 0..N {
        let t = (i as f64 + 0.5) / N as f64;
        for j in 0..2 * N {
            let phi = PI * (j as f64 + 0.5) / N as f64;
            // μ = t³: dμ = 3t² dt.
            let wi = direction((t * t * t) as f32, phi as f32);
            sum += f64::from(f_cos(wi).max_element()) * 3.0 * t * t;
        }
    }
    sum * PI / (N * N) as f64
}

#[test]
fn x01_sheen_at_grazing() {
    let mut case = Case::open("X01", "sheen at grazing angles", "a lobe that returns more than it gets");
    let table = SheenAlbedo::compute();
    for roughness in [0.1, 0.3, 1.0] {
        let sheen = Sheen::over(Surface::Black, Vec3::ONE, roughness, Some(&table));
        for mu in [1e-1, 1e-3, 1e-6, 1e-20] {
            let wo = direction(mu, 0.0);
            let returned = albedo(|wi| sheen.eval(wo, wi).f_cos);
            // Midpoints and the table's cells are good for 2 %.
            let ok = (0.0..=1.02).contains(&returned);
            case.row(format!("roughness {roughness}, μ {mu:e}"), "0 to 1", format!("{returned:.4}"), "2 %", ok);
        }
    }
    case.close();
}

#[test]
fn x02_sheen_reciprocity() {
    let mut case = Case::open("X02", "sheen is reciprocal at grazing angles", "albedo scaling by either direction");
    let table = SheenAlbedo::compute();
    for base in [Surface::Black, WHITE] {
        for roughness in [0.1, 0.5, 1.0] {
            let sheen = Sheen::over(base, Vec3::new(0.9, 0.5, 0.1), roughness, Some(&table));
            let cosines = [1e-4, 1e-2, 0.3, 1.0];
            let pairs = cosines.iter().flat_map(|&a| cosines.iter().map(move |&b| (a, b)));
            let values = pairs.map(|(a, b)| {
                let (wo, wi) = (direction(a, 0.3), direction(b, 2.0));
                let f = |wo: Vec3, wi: Vec3| f64::from(sheen.eval(wo, wi).f_cos.y) / f64::from(wi.z);
                (f(wo, wi), f(wi, wo), 1e-4)
            });
            let below = if matches!(base, Surface::Black) { "black" } else { "white" };
            case.numbers(format!("over {below}, roughness {roughness}"), values.filter(|v| v.0 != 0.0 || v.1 != 0.0));
        }
    }
    case.close();
}

#[test]
fn x03_sheen_of_nothing() {
    let mut case = Case::open("X03", "sheen without colour or roughness", "an effect that is not there costs no bit");
    let table = SheenAlbedo::compute();
    for (name, color, roughness) in [("colour 0", Vec3::ZERO, 0.5), ("roughness 0", Vec3::ONE, 0.0)] {
        let sheen = Sheen::over(WHITE, color, roughness, Some(&table));
        let mut rng = Pcg32::new(3, 3);
        let changed = (0..1000).filter(|_| {
            let [a, b, c, d] = rng.array();
            let (wo, wi, u) = (direction(a.max(1e-6), b), direction(c.max(1e-6), d), rng.array());
            sheen.eval(wo, wi) != WHITE.eval(wo, wi) || sheen.sample(wo, u) != WHITE.sample(wo, u)
        });
        case.bits(name, changed.count());
    }
    case.close();
}

#[test]
fn x04_sheen_furnace() {
    let mut case = Case::open("X04", "white cloth in a furnace", "energy of fibres over a base, along paths");
    for roughness in [0.2, 1.0] {
        let scene = furnace(Material { sheen_color: Vec3::ONE, sheen_roughness: roughness, ..plain() });
        for mode in Mode::all() {
            let film = render(&scene, mode.options(options(6, 6, 6))).film;
            case.at_most(format!("{}, roughness {roughness}", mode.name), 1.0, &Estimate::of_pixels(&film));
        }
    }
    case.close();
}

/// Schlick's weights are 1 at the horizon: all of the light is reflected, by whatever film.
#[test]
fn x05_film_at_grazing() {
    let mut case = Case::open("X05", "thin film at grazing angles", "phases where nothing gets into the film");
    for ior in [1.0, 1.33, 2.4] {
        let films = [0.0, 1.0, 550.0, 1e5].map(|thickness_nm| Film { weight: 1.0, ior, thickness_nm });
        let of = |cos: f32, bound: f64| {
            films.into_iter().flat_map(move |film| {
                [0.0, 0.04, 0.9].map(|f0| (1.0, f64::from(film.reflectance(cos, Vec3::splat(f0)).y), bound))
            })
        };
        case.numbers(format!("index {ior}, μ 0"), of(0.0, 1e-6));
        case.numbers(format!("index {ior}, μ 1e-6"), of(1e-6, 1e-3));
    }
    case.close();
}

/// A film that is many wavelengths thick shows the sum of intensities: r + (1−r)² s/(1 − rs).
#[test]
fn x06_thick_films() {
    let mut case = Case::open("X06", "films of many wavelengths", "cosines of large phases in f32");
    let schlick = |eta: f64, cos: f64| {
        let f0 = ((eta - 1.0) / (eta + 1.0)).powi(2);
        f0 + (1.0 - f0) * (1.0 - cos).powi(5)
    };
    for thickness_nm in [2e4, 1e6, 1e9] {
        let mut values = Vec::new();
        for cos in [1.0f64, 0.5, 0.1] {
            for f0 in [0.04f64, 0.5] {
                let inside = (1.0 - (1.0 - cos * cos) / (1.4 * 1.4)).sqrt();
                let below = (1.0 + f0.sqrt()) / (1.0 - f0.sqrt()) / 1.4;
                let (r, s) = (schlick(1.4, cos), schlick(below, inside));
                let film = Film { weight: 1.0, ior: 1.4, thickness_nm };
                let got = film.reflectance(cos as f32, Vec3::splat(f0 as f32)).y;
                values.push((r + (1.0 - r) * (1.0 - r) * s / (1.0 - r * s), f64::from(got), 2e-3));
            }
        }
        case.numbers(format!("{thickness_nm:e} nm"), values);
    }
    case.close();
}

#[test]
fn x07_films_at_their_ends() {
    let mut case = Case::open("X07", "films of extreme index and thickness", "a reflectance stays from 0 to 1");
    for ior in [1.0, 1.0 + f32::EPSILON, 3.0, 1e3, 1e30] {
        let mut outside = 0;
        for thickness_nm in [0.0, 1e-30, 0.029, 100.0, 1e9, f32::MAX] {
            for cos in [0.0, 1e-30, 1e-3, 0.5, 1.0] {
                for f0 in [0.0, 1e-30, 0.5, 1.0] {
                    let found = Film { weight: 1.0, ior, thickness_nm }.reflectance(cos, Vec3::splat(f0));
                    outside += u64::from(!(found.min_element() >= 0.0 && found.max_element() <= 1.0));
                }
            }
        }
        case.count(format!("index {ior:e}: values outside"), 0, outside);
    }
    case.close();
}

/// In slopes scaled by the widths the distribution is 1/(π(1 + t²)²), whatever the widths.
#[test]
fn x08_grain_density() {
    let mut case = Case::open("X08", "microfacets of anisotropy 1", "widths that differ by 10⁴");
    let pairs = [(1.0, 1.0), (1.0, 1e-2), (1.0, 1e-4), (1e-4, 1.0), (1e-4, 1e-4)];
    let steps = [-100.0, -1.0, -0.01, 0.0, 0.01, 1.0, 100.0_f64];
    for (x, y) in pairs {
        let ggx = Ggx::anisotropic(x, y);
        let values = steps.iter().flat_map(|&s| steps.iter().map(move |&t| (s, t))).map(|(s, t)| {
            let m = glam::DVec3::new(-f64::from(x) * s, -f64::from(y) * t, 1.0).normalize();
            let d = f64::from(ggx.density(m.as_vec3()));
            let got = d * f64::from(x) * f64::from(y) * m.z.powi(4);
            (1.0 / (PI * (1.0 + s * s + t * t).powi(2)), got, 1e-4)
        });
        case.numbers(format!("widths {x}, {y}"), values);
    }
    case.close();
}

/// Smith's masking is 2/(1 + √(1 + (αx²x² + αy²y²)/z²)).
#[test]
fn x09_grain_masking() {
    let mut case = Case::open("X09", "masking along and across the grain", "division by a vanishing cosine");
    for (x, y) in [(1.0f32, 1e-4f32), (1e-4, 1.0), (0.3, 0.3)] {
        let ggx = Ggx::anisotropic(x, y);
        let cosines = [1.0, 0.1, 1e-4, 1e-10, 1e-30];
        let values = cosines.into_iter().flat_map(|mu| [0.0, 0.7, FRAC_PI_2].map(|phi| direction(mu, phi))).map(|w| {
            let [a, b, c] = [x * w.x, y * w.y, w.z].map(f64::from);
            let expected = 2.0 / (1.0 + (1.0 + (a * a + b * b) / (c * c)).sqrt());
            (expected, f64::from(ggx.masking(w)), 1e-5)
        });
        case.numbers(format!("widths {x}, {y}"), values);
    }
    case.close();
}

#[test]
fn x10_grain_samples() {
    let mut case = Case::open("X10", "visible normals of anisotropy 1", "corners of the domain, grazing viewers");
    for (x, y) in [(1.0, 1e-4), (1e-4, 1.0)] {
        let ggx = Ggx::anisotropic(x, y);
        let mut bad = 0;
        for mu in [1.0, 1e-2, 1e-5, 1e-20] {
            for phi in [0.0, 0.8, FRAC_PI_2] {
                let wo = direction(mu, phi);
                for u in [[0.0, 0.0], [0.0, LAST], [LAST, 0.0], [LAST, LAST], [0.5, 0.5], [0.25, LAST]] {
                    let m = ggx.sample_visible(wo, u);
                    let wi = reflect(wo, m);
                    let weight = if wi.z > 0.0 { ggx.masking(wi) } else { 0.0 };
                    let unit = (m.length() - 1.0).abs() < 1e-5 && m.z >= 0.0 && (wi.length() - 1.0).abs() < 1e-4;
                    bad += u64::from(!(unit && (0.0..=1.0).contains(&weight)));
                }
            }
        }
        case.count(format!("widths {x}, {y}: samples that are none"), 0, bad);
    }
    case.close();
}

/// glTF's grain widens the lobe along it to 1 at strength 1: of a lobe that is that wide already nothing is left of it.
#[test]
fn x11_grain_of_rough_metal() {
    let mut case = Case::open("X11", "grain of the roughest metal", "anisotropy 1 that changes nothing");
    let metal = |anisotropy: f32| furnace(Material { roughness: 1.0, anisotropy, ..Material::default() });
    let (with, without) = (metal(1.0), metal(0.0));
    for mode in Mode::all() {
        let mean = |scene: &Scene| Estimate::of_pixels(&render(scene, mode.options(options(12, 12, 8))).film);
        let (a, b) = (mean(&with), mean(&without));
        let error = a.standard_error(0).hypot(b.standard_error(0));
        let z = (a.mean[0] - b.mean[0]).abs() / error;
        case.row(&mode.name, format!("{:.5}", b.mean[0]), format!("{:.5}", a.mean[0]), format!("{z:.2} σ"), z < 4.9);
    }
    case.close();
}

#[test]
fn x12_clearcoat_at_grazing() {
    let mut case = Case::open("X12", "clearcoats at grazing angles", "layers give no more than they get");
    let tables = SpecularAlbedo::compute();
    let bases = [("white", WHITE), ("mirror", glossy(&tables, Vec3::ONE, 1.0, 0.0, 1.0))];
    for (name, base) in bases {
        for alpha in [0.0, 0.04, 1.0] {
            let coat = Clearcoat::over(base, 1.0, alpha, &tables);
            for mu in [1e-2, 1e-5, 1e-20] {
                let (wo, mut rng, mut energy) = (direction(mu, 0.4), Pcg32::new(12, 1), Moments::default());
                for _ in 0..1 << 11 {
                    energy.push(coat.sampled(wo, rng.array()).map_or(0.0, |s| f64::from(s.weight.max_element())));
                }
                // Tables are good for 1 %.
                case.at_most(format!("over {name}, α {alpha}, μ {mu:e}"), 1.01, &Estimate::of_moments(&energy));
            }
        }
    }
    case.close();
}

/// A white sheet that sends half through and half back shows what is around it.
#[test]
fn x13_translucent_sheet() {
    let mut case = Case::open("X13", "white sheet of diffuse transmission", "what passes and what returns add up");
    let mut b = SceneBuilder::new();
    let sheet = b.material(Material { diffuse_transmission: 0.5, ..plain() });
    b.quad([(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)].map(|(x, y)| Vec3::new(x, y, 0.0)), sheet);
    b.environment(Environment::constant(Vec3::ONE));
    b.camera(Vec3::Z, Vec3::ZERO, Vec3::Y, 0.5);
    case.pictures(&b.build(), &options(8, 8, 8), [1.0; 3], 1e-4, 0.05);
    case.close();
}

/// Every layer at its end, over a mirror and over the roughest metal.
#[test]
fn x14_all_layers_at_once() {
    let mut case = Case::open("X14", "all layers at once", "products of layers, each at its end");
    for roughness in [0.0, 1.0] {
        let scene = furnace(Material {
            roughness,
            clearcoat: 1.0,
            clearcoat_roughness: 1.0 - roughness,
            sheen_color: Vec3::ONE,
            sheen_roughness: 0.1,
            anisotropy: 1.0,
            iridescence: 1.0,
            iridescence_ior: 2.4,
            iridescence_thickness_nm: [0.0, 550.0],
            ..Material::default()
        });
        for mode in Mode::all() {
            let film = render(&scene, mode.options(options(6, 6, 6))).film;
            case.at_most(format!("{}, roughness {roughness}", mode.name), 1.0, &Estimate::of_pixels(&film));
        }
    }
    case.close();
}

/// White metal of the largest roughness returns what it gets if its facets' light is given back.
#[test]
fn x15_multiple_scattering() {
    let mut case = Case::open("X15", "roughest white metal, all scatterings", "more than half is lost to one");
    let scene = furnace(Material { roughness: 1.0, ..Material::default() });
    case.pictures(&scene, &options(12, 12, 16).multiscatter(true), [1.0; 3], 0.01, 0.05);
    case.close();
}
