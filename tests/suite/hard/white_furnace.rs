//! What a surface returns of light that comes from everywhere (HARDCASES B01–B03): Lambert, single-scatter GGX, and
//! GGX over the base that makes up for what it loses.
//!
//! The product's masking is the separable Smith form. It agrees with the height-correlated one at normal incidence,
//! where the specification's table is used as it stands; elsewhere the oracle is the quadrature below, which is held
//! against every value that the specification gives for the separable form.

use std::f64::consts::PI;

use glam::Vec3;
use pathspace::plan::options::{FilterKind, RenderOptions, Roulette, SamplerKind, Strategy};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Environment, Material, MaterialId, Projection, Scene};
use pathspace::shading::bsdf::albedo::SpecularAlbedo;
use pathspace::shading::bsdf::glossy::{Glossy, GlossyParams};
use pathspace::shading::surface::Surface;
use pathspace_stat::{Moments, Pcg32};

use super::Case;
use super::modes::Mode;
use crate::bsdf::{direction, furnace, glossy};
use crate::common::{Estimate, options, probe, render};

/// Cosines of the specification's table.
const COSINES: [f64; 7] = [1.0, 0.9, 0.5, 0.2, 0.1, 0.05, 0.01];

/// The unit sphere in a furnace of radiance 1, seen along −Z; the view is 2·`half_width` wide.
pub fn sphere(rows: u32, smooth: bool, half_width: f32, material: impl Fn(&mut SceneBuilder) -> MaterialId) -> Scene {
    let mut b = SceneBuilder::new();
    let material = material(&mut b);
    b.sphere(Vec3::ZERO, 1.0, rows, false, smooth, material);
    b.environment(Environment::constant(Vec3::ONE));
    let view = Projection::Orthographic { xmag_m: half_width, ymag_m: half_width };
    b.any_camera(Vec3::new(0.0, 0.0, 3.0), Vec3::ZERO, Vec3::Y, view);
    b.build()
}

/// Every sample of cosine sampling is ρ (2⁻²⁰). By light sampling and MIS every pixel has the same expectation
/// and the same variance, so that the pixels' own halves tell it: to 2.2 % (1024 pixels: 4.4 %).
#[test]
fn b01_lambert() {
    let mut case = Case::open("B01", "White furnace, Lambert", "energy bookkeeping at one bounce");
    for mode in Mode::all() {
        let rows = mode.count(48, 12);
        let scene = |albedo: f32| sphere(rows, false, 0.6, move |b| b.lambert(Vec3::splat(albedo)));
        let cosine = options(32, 32, 16).strategy(Strategy::BSDF).roulette(Roulette::Off);
        for albedo in [1.0, 0.5, 0.18f32] {
            let film = render(&scene(albedo), mode.options(cosine.clone())).film;
            let means = film.pixels.iter().flat_map(|p| [0, 1, 2].map(|c| p.mean()[c]));
            let bound = 0.5_f64.powi(20) / f64::from(albedo);
            case.numbers(format!("{}, cosine, ρ = {albedo}", mode.name), means.map(|m| (f64::from(albedo), m, bound)));
        }
        for strategy in [Strategy::LIGHT, Strategy::MIS] {
            let side = mode.count(64, 16);
            let options = options(side, side, 256).strategy(strategy).sampler(SamplerKind::Independent);
            let film = render(&scene(0.5), mode.options(options)).film;
            let variance = film.pixels.iter().map(|p| p.variance().expect("two halves")[1]).sum::<f64>();
            let error = (variance / film.pixels.len() as f64).sqrt();
            let pixels = film.pixels.iter().map(|p| (p.mean()[1], 0.5, error));
            case.picture(format!("{}, {strategy}, ρ = 0.5", mode.name), pixels);
        }
    }
    case.close();
}

/// E(μ) of white GGX with separable masking, and the mean of the squared weight G1(i) that sampling visible normals
/// gives. By midpoints over the distribution of normals, graded towards the horizon: an integral over facets, D(m)
/// cos(m) dm.
#[derive(Clone, Copy)]
pub struct White {
    pub albedo: f64,
    square: f64,
}

pub fn white(mu: f64, alpha: f64) -> White {
    /// Slopes, whose integrand has a kink at the horizon, and azimuths, in which it is smooth.
    const SLOPES: usize = 2048;
    const TURNS: usize = 96;
    let g1 = |z: f64| 2.0 * z / (z + (alpha * alpha * (1.0 - z * z).max(0.0) + z * z).sqrt());
    let (o_x, g_o) = ((1.0 - mu * mu).sqrt(), g1(mu));
    let cosines: Vec<f64> = (0..TURNS).map(|j| (PI * (j as f64 + 0.5) / TURNS as f64).cos()).collect();
    let (mut albedo, mut square) = (0.0, 0.0);
    for i in 0..SLOPES {
        // A share q of the facets is flatter than this slope; 1 − q is the fourth power of the place.
        let place = (i as f64 + 0.5) / SLOPES as f64;
        let (rest, weight) = (place.powi(4), 4.0 * place.powi(3));
        let slope = alpha * ((1.0 - rest) / rest).sqrt();
        let m_z = 1.0 / (1.0 + slope * slope).sqrt();
        for cos in &cosines {
            let o_m = o_x * slope * m_z * cos + mu * m_z;
            let i_z = 2.0 * o_m * m_z - mu;
            if o_m > 0.0 && i_z > 0.0 {
                let visible = weight * g_o * o_m / (mu * m_z);
                albedo += visible * g1(i_z);
                square += visible * g1(i_z).powi(2);
            }
        }
    }
    let n = (SLOPES * TURNS) as f64;
    White { albedo: albedo / n, square: square / n }
}

/// A wall of one material facing +Z in the furnace.
fn plate(material: impl Fn(&mut SceneBuilder) -> MaterialId) -> Scene {
    let mut b = SceneBuilder::new();
    let material = material(&mut b);
    b.quad([(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)].map(|(x, y)| Vec3::new(x, y, 0.0)), material);
    b.environment(Environment::constant(Vec3::ONE));
    b.build()
}

/// Radiance of the plate seen at cosine `mu`, from 10 m away.
fn plate_at(scene: &Scene, mu: f32, n: u32, options: RenderOptions) -> Estimate {
    let wo = direction(mu, 0.6);
    probe(scene, wo * 10.0 + Vec3::new(0.1, 0.2, 0.0), -wo, n, options)
}

#[test]
fn b02_single_scatter_ggx() {
    let mut case = Case::open("B02", "White furnace, single-scatter GGX", "known energy loss of the model");
    // The oracle against the specification.
    let alphas = [0.001, 0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 1.0];
    let normal = [0.999999, 0.99989856, 0.99729587, 0.98830406, 0.91581243, 0.68784852, 0.46391651, 0.30685282];
    let oblique = [(0.5, 0.5, 0.68600725), (0.5, 0.1, 0.77227606), (1.0, 0.5, 0.40913709), (1.0, 0.1, 0.55791422)];
    let given = alphas.into_iter().zip(normal).map(|(a, e)| (a, 1.0, e)).chain(oblique);
    case.numbers("quadrature", given.map(|(alpha, mu, e)| (e, white(mu, alpha).albedo, 2e-6)));

    // The tabulated albedo of coats, between its nodes.
    let table = SpecularAlbedo::compute();
    let tabulated = alphas.into_iter().flat_map(|alpha| COSINES.map(|mu| (alpha, mu))).map(|(alpha, mu)| {
        let bound = if mu >= 0.1 { 1.5e-3 } else { 2.5e-3 };
        let expected = white(mu, alpha).albedo;
        (expected, f64::from(1.0 - table.complement(alpha as f32, 1.0, 1.0).at(mu as f32)), bound / expected)
    });
    case.numbers("table of coats", tabulated);

    // By the sampling routine, 2²⁰; and by uniform directions where the lobe is wide enough for them.
    let none = SpecularAlbedo::empty();
    for (a, alpha) in alphas.into_iter().enumerate() {
        let surface = glossy(&none, Vec3::ONE, 1.0, alpha as f32, 1.0);
        for (k, mu) in COSINES.into_iter().enumerate() {
            let wo = direction(mu as f32, 1.0);
            let expected = [white(mu, alpha).albedo; 3];
            let energy = furnace(&surface, wo, if alpha < 0.75 { 1 << 20 } else { 1 << 21 }, (10 * a + k) as u64);
            case.mean(format!("α = {alpha}, μ = {mu}"), expected, 1e-5, 5e-3, &Estimate::of_moments(&energy));
            if alpha >= 0.1 && [1.0, 0.5, 0.1].contains(&mu) {
                let mut rng = Pcg32::new((10 * a + k) as u64, 2);
                let mut uniform = Moments::default();
                uniform.extend((0..1 << 21).map(|_| {
                    let wi = direction(rng.next_f32(), std::f32::consts::TAU * rng.next_f32());
                    std::f64::consts::TAU * f64::from(surface.eval(wo, wi).f_cos.x)
                }));
                // The narrower the lobe, the rarer it is met: 5e-3 would take 2²⁵ directions at alpha 0.1.
                let delta = [(0.1, 4e-2), (0.25, 1.2e-2)].iter().find(|(a, _)| *a == alpha).map_or(5e-3, |(_, d)| *d);
                let name = format!("α = {alpha}, μ = {mu}, uniform");
                case.mean(name, expected, 1e-5, delta, &Estimate::of_moments(&uniform));
            }
        }
    }

    // By paths: a plate, and a sphere pixel by pixel with the variance that the quadrature knows.
    let metal = |b: &mut SceneBuilder| b.metal(Vec3::ONE, 0.5);
    let (wall, ball) = (plate(metal), sphere(96, true, 0.66, metal));
    let known: Vec<White> = (0..=128).map(|k| white(0.35 + 0.65 * f64::from(k) / 128.0, 0.5)).collect();
    let at = |mu: f64| {
        let x = (mu - 0.35) / 0.65 * 128.0;
        let (k, t) = ((x as usize).min(127), x - (x as usize).min(127) as f64);
        let mix = |of: fn(&White) -> f64| of(&known[k]) * (1.0 - t) + of(&known[k + 1]) * t;
        White { albedo: mix(|w| w.albedo), square: mix(|w| w.square) }
    };
    for mode in Mode::all() {
        let (n, delta) = mode.count((1 << 19, 5e-3), (1 << 17, 1e-2));
        for strategy in [Strategy::BSDF, Strategy::MIS] {
            let options = mode.options(RenderOptions::default().strategy(strategy));
            let name = format!("{}, plate α = 0.5, μ = 0.5, {strategy}", mode.name);
            case.mean(name, [white(0.5, 0.5).albedo; 3], 1e-5, delta, &plate_at(&wall, 0.5, n, options));
        }
        if mode.is_brute() {
            continue;
        }
        let side = mode.count(64, 16);
        let (strategy, sampler, filter) = (Strategy::BSDF, SamplerKind::Independent, FilterKind::Point);
        let options = options(side, side, 256).strategy(strategy).sampler(sampler).filter(filter);
        let film = render(&ball, mode.options(options)).film;
        let place = |i: u32| 0.66 * (2.0 * (f64::from(i) + 0.5) / f64::from(side) - 1.0);
        let pixels = film.pixels.iter().enumerate().map(|(i, pixel)| {
            let (x, y) = (place(i as u32 % side), place(i as u32 / side));
            let White { albedo, square } = at((1.0 - x * x - y * y).sqrt());
            (pixel.mean()[1], albedo, ((square - albedo * albedo) / 256.0).sqrt())
        });
        case.picture(format!("{}, sphere α = 0.5", mode.name), pixels);
    }
    case.close();
}

/// The compensation of the product is its diffuse base: (1−E(o))(1−E(i))/(π(1−E_avg)) under a coat. With a white
/// base and F = 1 in the coat that is the case's f_ms, and everything comes back. A metal has no base and keeps the
/// loss of B02.
#[test]
fn b03_compensated_ggx() {
    let mut case = Case::open(
        "B03",
        "White furnace, GGX with its base as compensation",
        "energy and reciprocity of the compensation",
    );
    let tables = SpecularAlbedo::compute();
    let coated = |alpha: f32, f0: Vec3, base_color: Vec3| {
        let params = GlossyParams { base_color, metallic: 0.0, alpha, f0, f90: 1.0 };
        Surface::Glossy(Glossy::of(&params, &tables))
    };
    for (a, alpha) in [0.01, 0.1, 0.25, 0.5, 0.75, 1.0].into_iter().enumerate() {
        for f0 in [1.0, 0.04] {
            let surface = coated(alpha, Vec3::splat(f0), Vec3::ONE);
            let energies = [1.0, 0.9, 0.7, 0.5, 0.2, 0.1, 0.05, 0.01].into_iter().enumerate().map(|(k, mu)| {
                let energy = furnace(
                    &surface,
                    direction(mu, 0.0),
                    if mu < 0.05 { 1 << 21 } else { 1 << 18 },
                    (a * 10 + k) as u64,
                );
                (energy.z(1.0, 2e-3), energy.mean, 4.9 * energy.standard_error(), mu)
            });
            let worst = energies.max_by(|x, y| x.0.total_cmp(&y.0)).expect("eight cosines");
            let (z, mean, band, mu) = worst;
            let on = format!("α = {alpha}, F0 = {f0}, worst of 8 cosines: {mu}");
            case.row(
                on,
                "1",
                format!("{mean:.6} ± {:.1e}", band / 4.9),
                format!("{z:.2} σ beyond 2e-3"),
                z <= 4.9 && band <= 5e-3,
            );
        }
    }
    // f(i,o) = f(o,i), and colours below 1 return less than 1.
    let tau = std::f32::consts::TAU;
    let colors = [Vec3::new(0.9, 0.5, 0.1), Vec3::new(1.0, 0.8, 0.3)];
    for (k, color) in colors.into_iter().enumerate() {
        let surface = coated([0.3, 0.8][k], color, color);
        let mut rng = Pcg32::new(k as u64, 33);
        let pairs = (0..100_000).flat_map(|_| {
            let [a, b, c, d]: [f32; 4] = rng.array();
            let (o, i) = (direction(0.02 + 0.98 * a, tau * b), direction(0.02 + 0.98 * c, tau * d));
            let (there, back) = (surface.eval(o, i).f_cos / i.z, surface.eval(i, o).f_cos / o.z);
            [0, 1, 2].map(|c| (f64::from(there[c]), f64::from(back[c]), 1e-5))
        });
        case.numbers(format!("reciprocity, colour {k}"), pairs);
        for mu in COSINES {
            let mut rng = Pcg32::new(k as u64, 34);
            let mut red = Moments::default();
            red.extend((0..1 << 16).map(|_| {
                surface.sample(direction(mu as f32, 0.3), rng.array()).map_or(0.0, |s| f64::from(s.weight.y))
            }));
            let most = red.mean - 4.9 * red.standard_error();
            case.row(format!("colour {k}, μ = {mu}, green"), "< 1", format!("{:.5}", red.mean), "-", most < 1.0);
        }
    }
    // As pictures. F0 = 1 by way of KHR_materials_specular's colour.
    let white = |b: &mut SceneBuilder| {
        b.material(Material {
            metallic: 0.0,
            roughness: 0.5_f32.sqrt(),
            specular_color: Vec3::splat(25.0),
            ..Material::default()
        })
    };
    let wall = plate(white);
    let ball = sphere(48, true, 0.66, white);
    for mode in Mode::all() {
        let (n, delta) = mode.count((1 << 18, 5e-3), (1 << 16, 1e-2));
        let estimate = plate_at(&wall, 0.3, n, mode.options(RenderOptions::default()));
        case.mean(format!("{}, plate α = 0.5, μ = 0.3", mode.name), [1.0; 3], 2e-3, delta, &estimate);
        if mode.is_main() {
            let (strategy, sampler) = (Strategy::BSDF, SamplerKind::Independent);
            let film = render(&ball, mode.options(options(64, 64, 256).strategy(strategy).sampler(sampler))).film;
            let beyond = |mean: f64| 1.0 + (mean - 1.0).signum() * ((mean - 1.0).abs() - 2e-3).max(0.0);
            // Its noise varies over the sphere: known from blocks of 8 × 8 pixels, which it hardly does within.
            let blocks = (0..64).map(|block| {
                let (x, y) = (block % 8 * 8, block / 8 * 8);
                let inside = (0..64).map(|i| film.pixel(x + i % 8, y + i / 8));
                let (sum, variance) =
                    inside.fold((0.0, 0.0), |(s, v), p| (s + p.mean()[1], v + p.variance().expect("two halves")[1]));
                (beyond(sum / 64.0), 1.0, variance.sqrt() / 64.0)
            });
            let worst = blocks.map(|(got, expected, error)| (got - expected).abs() / error).fold(0.0, f64::max);
            let limit = pathspace_stat::t_limit(64.0, 1e-4 / 64.0);
            let on = format!("{}, sphere α = 0.5, 64 blocks", mode.name);
            case.row(
                on,
                "1 within 2e-3",
                format!("|t| < {limit:.2}"),
                format!("{worst:.2} σ beyond 2e-3"),
                worst < limit,
            );
        }
    }
    case.close();
}
