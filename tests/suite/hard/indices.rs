//! Indices of refraction where they are hardest: almost 1, and those of dispersion at the critical angle (X20–X25).
//! Oracles: Fresnel's formulas in f64, a picture without the solid, a furnace.

use glam::Vec3;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Environment, Material, Scene};
use pathspace::shading::bsdf::fresnel::dielectric;
use pathspace::shading::dispersion::{VISIBLE_NM, index, wavelength_nm, weight};

use super::Case;
use super::lobes::furnace;
use super::modes::Mode;
use crate::common::{options, render};

/// 2⁻²⁰, exact in f32 beside 1.
const TINY: f32 = 1.0 / 1_048_576.0;

fn clear(ior: f32) -> Material {
    Material { metallic: 0.0, roughness: 0.0, transmission: 1.0, thickness: 1.0, ior, ..Material::default() }
}

/// Unpolarised reflectance at a relative index.
fn reflectance(cos: f64, eta: f64) -> f64 {
    let sin2 = (1.0 - cos * cos) / (eta * eta);
    if sin2 >= 1.0 {
        return 1.0;
    }
    let inside = (1.0 - sin2).sqrt();
    let s = (cos - eta * inside) / (cos + eta * inside);
    let p = (eta * cos - inside) / (eta * cos + inside);
    0.5 * (s * s + p * p)
}

#[test]
fn x20_index_next_to_one() {
    let mut case = Case::open("X20", "Fresnel of 1 ± 2⁻²⁰", "differences of numbers that are almost equal");
    for eta in [1.0 + TINY, 1.0 - TINY, 1.0 + f32::EPSILON, 1.0 - f32::EPSILON] {
        let value =
            |cos: f32| (reflectance(f64::from(cos), f64::from(eta)), f64::from(dielectric(cos, eta).reflectance));
        let absolute = |(expected, got): (f64, f64)| (expected, got, 1e-7 / expected);
        case.numbers(format!("η − 1 = {:e}, above", eta - 1.0), [1.0, 0.3, 0.05].map(value).map(absolute));
        // Where sin² is 1 up to f32's rounding, the oracle is asked at the cosine that f32 holds.
        let grazing = [1e-2, 3e-3, 3e-4, 1e-5].map(value).map(|(expected, got)| (expected, got, 2e-3 / expected));
        case.numbers(format!("η − 1 = {:e}, grazing", eta - 1.0), grazing);
    }
    case.close();
}

/// Radiance that varies slowly with the direction.
fn before(solid: Option<Material>) -> Scene {
    let mut b = SceneBuilder::new();
    if let Some(material) = solid {
        let material = b.material(material);
        b.cuboid(Vec3::splat(-0.6), Vec3::splat(0.6), false, material);
    }
    let (width, height) = (16, 8);
    let texels: Vec<Vec3> = (0..width * height).map(|i| Vec3::splat(1.0 + 0.3 * (i % width) as f32 / 16.0)).collect();
    b.environment(Environment { texels: texels.into(), width, height, rotation_rad: 0.1, intensity: 1.0 });
    b.camera(Vec3::new(1.1, 0.9, 3.0), Vec3::ZERO, Vec3::Y, 0.5);
    b.build()
}

#[test]
fn x21_solid_of_almost_no_index() {
    let mut case = Case::open("X21", "a solid of index 1 + 2⁻²⁰", "boundaries that bend by less than f32 sees");
    for mode in Mode::all() {
        let picture = |scene: &Scene| {
            let film = render(scene, mode.options(options(12, 12, 4))).film;
            film.pixels.iter().map(|pixel| pixel.mean()[1]).collect::<Vec<f64>>()
        };
        let (with, without) = (picture(&before(Some(clear(1.0 + TINY)))), picture(&before(None)));
        case.numbers(&mode.name, without.into_iter().zip(with).map(|(e, g)| (e, g, 1e-3)));
    }
    case.close();
}

/// Between the critical angles of two wavelengths one is reflected whole and the other is not.
#[test]
fn x22_dispersion_at_the_critical_angle() {
    let mut case = Case::open("X22", "dispersion at the critical angle", "total for one wavelength alone");
    for (ior, dispersion) in [(1.5f32, 1.0f32), (2.4, 0.5), (1.1, 20.0)] {
        let [blue, red] = VISIBLE_NM.map(|nm| index(ior, dispersion, nm));
        let critical = |n: f32| (1.0 - 1.0 / (f64::from(n) * f64::from(n))).sqrt();
        let [first, last] = [critical(red), critical(blue)];
        let between = (0.5 * (first + last)) as f32;
        let whole = |n: f32| u64::from(dielectric(-between, n).reflectance == 1.0);
        case.count(format!("index {ior}: blue is reflected whole"), 1, whole(blue));
        case.count(format!("index {ior}: red is reflected whole"), 0, whole(red));
        let near = [1e-3, 1e-4, 1e-5].map(|d| (first + d) as f32);
        let values = near.map(|cos| {
            let expected = 1.0 - reflectance(f64::from(cos), 1.0 / f64::from(red));
            (expected, 1.0 - f64::from(dielectric(-cos, red).reflectance), 1e-2)
        });
        case.numbers(format!("index {ior}: what red passes next to it"), values);
    }
    case.close();
}

#[test]
fn x23_wavelengths_at_their_ends() {
    let mut case = Case::open("X23", "wavelengths at the ends of the range", "weights of channels, Cauchy's formula");
    let last = 1.0 - f32::EPSILON / 2.0;
    let inside = [0.0, last].map(wavelength_nm).map(|nm| (VISIBLE_NM[0]..=VISIBLE_NM[1]).contains(&nm));
    case.count("wavelengths outside", 0, inside.iter().filter(|ok| !**ok).count() as u64);
    let n = 1 << 16;
    let mean = (0..n).map(|i| weight(wavelength_nm((i as f32 + 0.5) / n as f32)).as_dvec3()).sum::<glam::DVec3>();
    case.numbers("means of the channels' weights", mean.to_array().map(|sum| (1.0, sum / f64::from(n), 1e-4)));
    let at = |ior, dispersion| VISIBLE_NM.map(|nm| index(ior, dispersion, nm));
    let still = [1.0, 1.33, 4.0].into_iter().flat_map(|ior| at(ior, 0.0).map(|n| (f64::from(ior), f64::from(n), 0.0)));
    case.numbers("no dispersion", still);
    let matched = at(1.0, 20.0).map(|n| (1.0, f64::from(n), 0.0));
    case.numbers("index 1 does not disperse", matched);
    case.count("indices below 1", 0, at(1.05, 1e3).iter().filter(|n| !(**n >= 1.0)).count() as u64);
    case.close();
}

/// Whatever the wavelengths of its paths, clear glass in a radiance of 1 shows 1 in every channel.
#[test]
fn x24_dispersion_furnace() {
    let mut case = Case::open("X24", "glass of much dispersion in a furnace", "weights of wavelengths along paths");
    let scene = furnace(Material { dispersion: 5.0, ..clear(1.5) });
    case.pictures(&scene, &options(16, 16, 16), [1.0; 3], 1e-4, 0.15);
    case.close();
}
