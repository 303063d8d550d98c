//! Fresnel reflectance: tables, the critical angle, interfaces that are hardly there, conductors, averages (HARDCASES
//! B07–B11). Oracles: integrals and complex arithmetic in 40 digits, the specification's; deterministic but for the
//! sampled average.

use glam::Vec3;
use pathspace::math::warp;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Environment, Scene};
use pathspace::shading::bsdf::dielectric::Body;
use pathspace::shading::bsdf::fresnel::{SCHLICK_AVERAGE, conductor, dielectric, dielectric_average, schlick_weight};
use pathspace_stat::{GaussLegendre, Moments, Pcg32};

use super::Case;
use super::modes::Mode;
use crate::bsdf::{direction, glass};
use crate::common::{Estimate, options, render};

/// Bound on an absolute difference, as one relative to `expected`.
fn absolute(expected: f64, got: f32, bound: f64) -> (f64, f64, f64) {
    (expected, f64::from(got), if expected == 0.0 { bound } else { bound / expected.abs() })
}

#[test]
fn b07_dielectric_table() {
    let mut case = Case::open("B07", "Dielectric Fresnel table", "reference values");
    let cosines = [1.0, 0.8, 0.5, 0.1, 0.01, 0.001];
    let table = [
        (1.5, [0.04, 0.043894736, 0.0891867128, 0.57159252, 0.943752543, 0.994205573]),
        (1.33, [0.0200593122, 0.022808414, 0.0591255992, 0.538989758, 0.938940902, 0.993706005]),
        (2.4, [0.169550173, 0.173269167, 0.209351261, 0.585988703, 0.940796621, 0.993831729]),
    ];
    for (eta, row) in table {
        let pairs = cosines.into_iter().zip(row).map(|(cos, f)| absolute(f, dielectric(cos, eta).reflectance, 1e-6));
        case.numbers(format!("η = {eta}"), pairs);
    }
    let brewster = absolute(0.073964497, dielectric(0.554_700_2, 1.5).reflectance, 1e-6);
    case.numbers("Brewster's angle of 1.5", [brewster]);
    case.close();
}

/// 1 − F inside a relative index of 1.5 by the textbook form, in f64 at the cosine as f32 holds it.
fn transmitted_from_inside(cos: f32) -> f64 {
    let (n, c) = (1.0 / 1.5_f64, f64::from(cos));
    let t = (1.0 - (1.0 - c * c) / (n * n)).sqrt();
    let (s, p) = ((c - n * t) / (c + n * t), (n * c - t) / (n * c + t));
    1.0 - 0.5 * (s * s + p * p)
}

/// The rounding of an f32 cosine, 2⁻²⁵, moves 1 − F by half of its share of d: at d = 1e-6 that is 1.5 %. So the
/// table is asked down to 1e-5, as the specification has it, and below that the exact value at the rounded cosine.
#[test]
fn b08_near_the_critical_angle() {
    let mut case = Case::open("B08", "Near the critical angle", "square-root singularity of the transmission");
    let critical = 0.745_355_992_499_93_f64;
    let got = |cos: f32| 1.0 - f64::from(dielectric(-cos, 1.5).reflectance);
    let table =
        [(1e-1, 0.935156191), (1e-2, 0.631894948), (1e-3, 0.280391173), (1e-4, 0.100270356), (1e-5, 0.0330294212)];
    let given = table.map(|(d, expected)| (expected, got((critical + d) as f32), 1e-3));
    case.numbers("1 − F, cosine d above critical, d ≥ 1e-5", given);
    let rounded = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7].map(|d| {
        let cos = (critical + d) as f32;
        (transmitted_from_inside(cos), got(cos), 1e-3)
    });
    case.numbers("the same at the f32 cosine, d ≥ 1e-7", rounded);
    // Every cosine below critical, in steps of 64 ulp, is reflected whole.
    let below = (1..(critical as f32).to_bits()).step_by(64).map(|bits| dielectric(-f32::from_bits(bits), 1.5));
    case.count(
        "below critical, not exactly 1",
        0,
        below.filter(|i| i.reflectance != 1.0 || i.cos_t != 0.0).count() as u64,
    );
    let first = (critical as f32).to_bits() - 1000;
    let f: Vec<f32> =
        (first..first + 1_000_000).map(|bits| dielectric(-f32::from_bits(bits), 1.5).reflectance).collect();
    case.count("rises of F over 10⁶ consecutive cosines", 0, f.windows(2).filter(|w| w[1] > w[0]).count() as u64);
    case.close();
}

/// Radiance that is quadratic in the direction, in 64 × 32 texels.
fn quadratic_environment() -> Environment {
    let (width, height) = (64, 32);
    let texels = (0..width * height).map(|i| {
        let phi = std::f32::consts::TAU * ((i % width) as f32 + 0.5) / width as f32;
        let theta = std::f32::consts::PI * ((i / width) as f32 + 0.5) / height as f32;
        let d = Vec3::new(theta.sin() * phi.sin(), theta.cos(), -theta.sin() * phi.cos());
        Vec3::new(0.2 + d.x * d.x, 0.3 + d.y * d.z + 0.5, 0.1 + (d.x + d.y).powi(2))
    });
    Environment { texels: texels.collect(), width, height, rotation_rad: 0.0, intensity: 1.0 }
}

/// An orthographic view past a sphere of `ior`, or of nothing.
fn sphere_before_environment(ior: Option<f32>) -> Scene {
    let mut b = SceneBuilder::new();
    if let Some(ior) = ior {
        let glass = b.glass(ior);
        b.sphere(Vec3::ZERO, 1.0, 24, false, true, glass);
    }
    b.environment(quadratic_environment());
    b.camera(Vec3::new(0.5, 0.8, 3.0), Vec3::ZERO, Vec3::Y, 0.8);
    b.build()
}

#[test]
fn b09_index_matched_interface() {
    let mut case = Case::open("B09", "Index-matched interface, η → 1", "an invisible interface must stay invisible");
    let cosines = [1.0, 0.1, 0.01, 1e-3, 1e-4, 1e-5];
    let matched = |cos: f32| {
        [1.0, -1.0].into_iter().filter(move |side| {
            let interface = dielectric(side * cos, 1.0);
            (interface.reflectance, interface.cos_t) != (0.0, cos)
        })
    };
    case.count("η = 1: F not 0 or bent", 0, cosines.into_iter().chain([1e-30]).flat_map(matched).count() as u64);
    let table = [
        (1.000001, [2.27373459e-13, 2.22828953e-9, 2.23063271e-5, 0.0679405179, 0.748728645, 0.971452543]),
        (1.0001, [2.50057966e-9, 2.40288714e-5, 0.0717898037, 0.753817148, 0.972112432, 0.997175592]),
        (1.01, [2.47518156e-5, 0.0697665121, 0.752206998, 0.971905092, 0.997154319, 0.999715067]),
    ];
    for (eta, row) in table {
        // The table is for the f32 neighbours of these indices.
        let pairs = cosines.into_iter().zip(row).map(|(cos, f)| absolute(f, dielectric(cos, eta).reflectance, 1e-5));
        case.numbers(format!("η = {eta}"), pairs);
    }
    // The scattering function: same direction, weight 1, whatever the roughness.
    let bent = [0.0, 0.3, 1.0].into_iter().flat_map(|alpha| {
        let surface = glass(Body::Solid, 1.0, alpha);
        [1.0, 0.3, 1e-3, 1e-5, -0.5, -1e-5].into_iter().filter(move |&mu| {
            let wo = direction(mu, 0.8);
            let s = surface.sample(wo, [0.0, 0.5, 0.5]).expect("nothing is lost");
            !surface.is_delta() || (s.wi + wo).length() > 1e-7 || s.weight != Vec3::ONE || s.eta != 1.0
        })
    });
    case.count("η = 1: samples changed by the surface", 0, bent.count() as u64);
    for mode in Mode::all() {
        let image = |ior| {
            let film = render(&sphere_before_environment(ior), mode.options(options(32, 32, 4))).film;
            film.pixels.iter().flat_map(|p| [0, 1, 2].map(|c| p.mean()[c])).collect::<Vec<_>>()
        };
        let (with, without) = (image(Some(1.0)), image(None));
        case.numbers(&mode.name, without.into_iter().zip(with).map(|(e, g)| (e, g, 1e-5)));
    }
    case.close();
}

#[test]
fn b10_conductor() {
    let mut case = Case::open("B10", "Conductor Fresnel", "complex index, limits");
    let cosines = [1.0, 0.5, 0.1, 0.001];
    let table = [
        (0.2, 3.9, [0.951951952, 0.945882382, 0.96289654, 0.999564974]),
        (1.5, 0.0, [0.04, 0.0891867128, 0.57159252, 0.994205573]),
        (2.0, 4.0, [0.68, 0.65653285, 0.726233007, 0.995735475]),
        (0.05, 100.0, [0.999980002, 0.999975007, 0.999899985, 0.999900985]),
    ];
    for (n, k, row) in table {
        let pairs = cosines.into_iter().zip(row).map(|(cos, f)| absolute(f, conductor(cos, n, k), 2e-6));
        case.numbers(format!("n = {n}, k = {k}"), pairs);
    }
    let grid = || (0..=1000).map(|i| i as f32 / 1000.0);
    let dielectrics =
        grid().map(|cos| absolute(f64::from(dielectric(cos, 1.5).reflectance), conductor(cos, 1.5, 0.0), 2e-6));
    case.numbers("k = 0 against the dielectric", dielectrics);
    let above = table.iter().flat_map(|&(n, k, _)| grid().filter(move |&cos| !(conductor(cos, n, k) <= 1.0)));
    case.count("values above 1", 0, above.count() as u64);
    case.number("index 1, exactly grazing", 0.0, f64::from(conductor(0.0, 1.0, 0.0)), 0.0);
    case.close();
}

/// T1 by 2²² directions of the cosine law: F itself is averaged, which varies less than the choice it stands for.
#[test]
fn b11_hemispherical_averages() {
    let mut case = Case::open("B11", "Hemispherical Fresnel averages", "diffuse transmission, coating models");
    let rule = GaussLegendre::new(128);
    for (eta, outside, inside) in
        [(1.33, 0.0659308493, 0.4719491488), (1.5, 0.09177795934, 0.5963457597), (2.4, 0.210181302, 0.8628786983)]
    {
        case.number(format!("closed form, η = {eta}, outside"), outside, dielectric_average(eta), 1e-9);
        case.number(format!("closed form, η = {eta}, inside"), inside, dielectric_average(1.0 / eta), 1e-9);
        let f = |side: f64, mu: f64| 2.0 * mu * f64::from(dielectric((side * mu) as f32, eta as f32).reflectance);
        let by_rule = rule.integrate([0.0, 1.0], |mu| f(1.0, mu));
        case.number(format!("quadrature, η = {eta}, outside"), outside, by_rule, 1e-5);
        // From the inside F is 1 up to the critical angle, and has a square root above it: x² takes that out.
        let critical = (1.0 - 1.0 / (eta * eta)).sqrt();
        let above = rule.integrate([0.0, 1.0], |x| {
            let mu = critical + (1.0 - critical) * x * x;
            f(-1.0, mu) * 2.0 * x * (1.0 - critical)
        });
        case.number(format!("quadrature, η = {eta}, inside"), inside, critical * critical + above, 1e-5);
        for (side, expected) in [(1.0, outside), (-1.0, inside)] {
            let mut rng = Pcg32::new(11, eta.to_bits());
            let mut values = Moments::default();
            values.extend((0..1 << 22).map(|_| {
                let wo = warp::cosine_hemisphere(rng.array());
                f64::from(dielectric(side * wo.z, eta as f32).reflectance)
            }));
            let name = format!("sampled, η = {eta}, {}", if side > 0.0 { "outside" } else { "inside" });
            case.mean(name, [expected; 3], 1e-5, 5e-3, &Estimate::of_moments(&values));
        }
    }
    case.number("no interface", 0.0, dielectric_average(1.0), 0.0);
    let schlick = rule.integrate([0.0, 1.0], |mu| 2.0 * mu * f64::from(schlick_weight(mu as f32)));
    case.number("Schlick's (1−μ)⁵", schlick, f64::from(SCHLICK_AVERAGE), 1e-5);
    case.close();
}
