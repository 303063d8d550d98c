//! Media at the ends of their range: optical depths of 10⁴ and 10⁻⁸, many solids in one another, faces that touch
//! (V01–V11). Oracles: Beer and Lambert, Chandrasekhar's H functions, a furnace, distributions by hand.

use std::f64::consts::PI;

use glam::Vec3;
use pathspace::render::Fog;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Material, Projection, Scene};
use pathspace::shading::scattering::{Coefficients, MAX_ANISOTROPY, Travel, phase, sample_phase, single_scattering};

use super::Case;
use super::lobes::furnace;
use super::modes::Mode;
use crate::common::{options, render};
use crate::scattering::{h_at_one, lit_slab, murky};

/// The largest number that samplers give.
const LAST: f32 = 1.0 - f32::EPSILON / 2.0;

/// A solid of index 1 that leaves `left` of each channel after a metre, and scatters nothing.
fn absorbing(left: Vec3) -> Material {
    Material {
        metallic: 0.0,
        roughness: 0.0,
        transmission: 1.0,
        thickness: 1.0,
        ior: 1.0,
        attenuation_distance_m: 1.0,
        attenuation_color: left,
        ..Material::default()
    }
}

/// A lamp of radiance 1 seen through boxes: material, from, to along the view, metres behind z = 0.
fn behind(boxes: &[(Material, f32, f32)]) -> Scene {
    let mut b = SceneBuilder::new();
    let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
    b.quad([(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)].map(|(x, y)| Vec3::new(x, y, -8.0)), lamp);
    for (i, (material, from, to)) in boxes.iter().enumerate() {
        let (material, half) = (b.material(material.clone()), 3.0 - 0.03 * i as f32);
        b.cuboid(Vec3::new(-half, -half, -to), Vec3::new(half, half, -from), false, material);
    }
    let projection = Projection::Orthographic { xmag_m: 0.3, ymag_m: 0.3 };
    b.any_camera(Vec3::new(0.1, 0.2, 2.0), Vec3::new(0.1, 0.2, -1.0), Vec3::Y, projection);
    b.build()
}

/// Every pixel of a picture without noise, in every mode.
fn exact(case: &mut Case, what: &str, scene: &Scene, fog: Option<Fog>, expected: [f64; 3], bound: f64) {
    for mode in Mode::all() {
        let film = render(scene, mode.options(options(4, 4, 2).fog(fog))).film;
        let pixels = film.pixels.iter().flat_map(|pixel| (0..3).map(|c| (expected[c], pixel.mean()[c], bound)));
        case.numbers(format!("{}{what}", mode.name), pixels);
    }
}

#[test]
fn v01_opaque_absorption() {
    let mut case = Case::open("V01", "absorbing solid of optical depth 10⁴", "exponentials that underflow");
    let mut black = absorbing(Vec3::splat((-1.0f32).exp()));
    black.attenuation_distance_m = 1e-4;
    exact(&mut case, "", &behind(&[(black, 1.0, 2.0)]), None, [0.0; 3], 0.0);
    case.close();
}

#[test]
fn v02_next_to_nothing() {
    let mut case = Case::open("V02", "scattering solid of optical depth 10⁻⁸", "a medium that is hardly there");
    let thin = murky(1.0, 1e-8, [0.9; 3], 0.5);
    exact(&mut case, "", &behind(&[(thin, 1.0, 2.0)]), None, [1.0; 3], 1e-6);
    case.close();
}

/// Reflectance of a half space at the normal: ϖ/8π·H(1)² for an irradiance of 1.
#[test]
fn v03_deep_scattering() {
    let mut case = Case::open("V03", "scattering slab of optical depth 10⁴", "distances far below the slab's size");
    let scene = lit_slab(murky(1.0, 1e3, [0.5; 3], 0.0), 10.0);
    let expected = 0.5 / (8.0 * PI) * h_at_one(0.5).powi(2);
    case.pictures(&scene, &options(12, 12, 24).max_depth(1 << 14), [expected; 3], 2e-4 * expected, 0.15);
    case.close();
}

#[test]
fn v04_distances() {
    let mut case = Case::open("V04", "distances at the ends of numbers", "logarithms of 1 and of 2⁻²⁴");
    for sigma in [1e-30f32, 1e-8, 1.0, 1e4, 1e30] {
        let medium = Coefficients::new(Vec3::splat(sigma), Vec3::splat(0.5), 0.0);
        let mut values = Vec::new();
        for u in [0.0, 1e-7, 0.5, LAST] {
            let Travel::Collides { distance_m, weight } = medium.travel(Vec3::ONE, f32::INFINITY, [0.3, u]) else {
                panic!("a way without end has a collision");
            };
            values.push((-f64::from(1.0 - u).ln() / f64::from(sigma), f64::from(distance_m), 1e-6));
            values.push((0.5, f64::from(weight.x), 1e-6));
        }
        // 0 is the only number that is compared as it is.
        case.numbers(format!("σ {sigma:e}"), values);
    }
    let through = Coefficients::new(Vec3::splat(1e-8), Vec3::splat(0.5), 0.0).travel(Vec3::ONE, 1.0, [0.3, 0.5]);
    case.count("depth 1e-8: a weight other than 1", 0, u64::from(through != Travel::Through(Vec3::ONE)));
    case.close();
}

/// The directions that numbers 0 and 1 mean are those along and against the light, by the phase function's density; its
/// distribution is (1−g²)/(2g)·(1/(1+g²−2gμ)^½ − 1/(1+g)).
#[test]
fn v05_phase_functions() {
    let mut case = Case::open("V05", "phase functions of |g| up to 0.999", "peaks that f32 hardly resolves");
    for g in [-MAX_ANISOTROPY, -0.5, 0.0, 1e-3, 0.5, MAX_ANISOTROPY] {
        let mut values = Vec::new();
        for u in [0.0, 0.25, 0.5, 0.75, LAST] {
            let (wi, pdf) = sample_phase(g, Vec3::Z, [u, 0.3]);
            values.push((1.0, f64::from(wi.length()), 1e-5));
            let (g, mu) = (f64::from(g), f64::from(wi.z));
            let below = if g == 0.0 {
                0.5 * (1.0 - mu)
            } else {
                // From the far side, as the sampler counts.
                1.0 - (1.0 - g * g) / (2.0 * g) * ((1.0 + g * g - 2.0 * g * mu).sqrt().recip() - 1.0 / (1.0 + g))
            };
            // f32 resolves the peak of 0.999 to an eighth.
            values.push((1.0, 1.0 + f64::from(u) - below, if g.abs() > 0.99 { 0.1 } else { 1e-3 }));
            values.push((f64::from(phase(g as f32, mu as f32)), f64::from(pdf), 0.3));
        }
        case.numbers(format!("g {g}"), values);
    }
    case.close();
}

#[test]
fn v06_albedo_of_one_scattering() {
    let mut case = Case::open("V06", "albedos from those of many scatterings", "0, 1 and next to them");
    case.number("of 0", 0.0, f64::from(single_scattering(0.0)), 0.0);
    case.number("of 1", 1.0, f64::from(single_scattering(1.0)), 1e-5);
    let outside = [f32::MIN_POSITIVE, 1e-7, LAST, 2.0, -1.0].map(single_scattering);
    case.count("outside of [0, 1]", 0, outside.iter().filter(|a| !(0.0..=1.0).contains(*a)).count() as u64);
    let all: Vec<f32> = (0..=10_000).map(|i| single_scattering(i as f32 / 10_000.0)).collect();
    case.count("falls", 0, all.windows(2).filter(|w| w[1] < w[0]).count() as u64);
    case.close();
}

/// Shells of the same stuff in one another absorb what one solid would.
#[test]
fn v07_nested_solids() {
    let mut case = Case::open("V07", "64 solids in one another", "the stack of media");
    let stuff = absorbing(Vec3::new(0.5, 0.8, 0.9));
    for count in [6, 64] {
        let shells: Vec<_> =
            (0..count).map(|i| (stuff.clone(), 1.0 + 0.01 * i as f32, 3.0 - 0.01 * i as f32)).collect();
        exact(&mut case, &format!(", {count}"), &behind(&shells), None, [0.25, 0.64, 0.81], 1e-4);
    }
    case.close();
}

#[test]
fn v08_touching_solids() {
    let mut case = Case::open("V08", "solids that share a face", "coincident boundaries of two media");
    let stuff = |left: f32| absorbing(Vec3::splat(left));
    let boxes = [(stuff(0.5), 1.0, 2.0), (stuff(0.8), 2.0, 3.0), (stuff(0.25), 3.0, 3.5)];
    exact(&mut case, "", &behind(&boxes), None, [0.5 * 0.8 * 0.5; 3], 1e-4);
    case.close();
}

#[test]
fn v09_fog() {
    let mut case = Case::open("V09", "fog of optical depth 10⁵ and 10⁻⁷", "a medium without boundary");
    let fog = |sigma_t: f32, albedo: f32| Some(Fog { sigma_t, albedo, g: 0.0 });
    exact(&mut case, ", 10⁵", &behind(&[]), fog(1e4, 0.0), [0.0; 3], 0.0);
    exact(&mut case, ", 10⁻⁷", &behind(&[]), fog(1e-8, 0.9), [1.0; 3], 1e-5);
    case.close();
}

#[test]
fn v10_channels_at_their_ends() {
    let mut case = Case::open("V10", "media black in one channel, clear in one", "logarithms of 0 and of 1");
    let stuff = absorbing(Vec3::new(0.0, 0.5, 1.0));
    exact(&mut case, "", &behind(&[(stuff, 1.0, 3.0)]), None, [0.0, 0.25, 1.0], 1e-5);
    case.close();
}

/// What scatters everything, nearly all of it forwards, shows the radiance around it.
#[test]
fn v11_forward_scattering() {
    let mut case = Case::open("V11", "white medium of g = ±0.99 in a furnace", "peaks along whole paths");
    for g in [0.99, -0.99] {
        let milk = Material { multiscatter_color: Vec3::ONE, ..murky(1.0, 1.0, [0.5; 3], g) };
        case.pictures(&furnace(milk), &options(6, 6, 4).max_depth(1 << 12), [1.0; 3], 1e-3, 0.2);
    }
    case.close();
}
