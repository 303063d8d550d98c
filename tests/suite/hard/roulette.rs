//! Ending paths: the variance that constant survival must have, thousands of bounces, albedo 1, throughput that leaves
//! f32, and the same picture with and without roulette.

use glam::Vec3;
use pathspace::plan::options::{RenderOptions, Roulette, SamplerKind, Strategy};
use pathspace::render::{Render, Renderer};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Material, Projection, Scene};
use pathspace_stat::{Moments, ks_uniform, welch};

use super::Case;
use super::furnace::{Shape, furnace};
use super::mis::mirror_beside;
use super::modes::Mode;
use super::receiver::Means;
use super::room::lamp_room;
use crate::common::{Estimate, options, render};

/// BSDF sampling in a furnace, a pixel a sample.
fn paths(mode: &Mode, side: u32, roulette: Roulette, seed: u64) -> RenderOptions {
    mode.options(
        options(side, side, 1)
            .strategy(Strategy::BSDF)
            .sampler(SamplerKind::Independent)
            .max_depth(1 << 16)
            .roulette(roulette)
            .seed(seed),
    )
}

#[test]
fn p08_mean_and_variance() {
    let mut case =
        Case::open("P08", "Russian roulette: mean and variance", "unbiased ends with the predicted variance");
    // Films of 2^18 paths, one to four of them; the specification's sixteen would take a minute.
    let known = [
        (0.5f32, 0.5f32, 2.0, 4, true),
        (0.5, 0.75, 0.5, 4, true),
        (0.9, 0.9, 90.0, 2, true),
        (0.9, 0.95, 28.92857143, 1, true),
        (0.9, 0.85, 303.75, 1, false),
        (0.9, 0.82, 1458.0, 1, false),
        (0.99, 0.99, 9900.0, 0, true),
    ];
    for mode in Mode::all() {
        let (mut means, mut lengths) = (Means::default(), Means::default());
        let mut variances = Vec::new();
        for (rho, q, variance, films, fourth) in known {
            let side = match (mode.is_main(), films) {
                (true, 0) => 128,
                (true, _) => 512,
                _ if rho > 0.9 => continue,
                _ => 64,
            };
            let scene = furnace(Shape::Cube, Vec3::splat(rho));
            let mut moments = Moments::default();
            let (mut rays, mut begun) = (0, 0);
            for film in 0..if mode.is_main() { films.max(1) } else { 1 } {
                let Render { film, counters, .. } =
                    render(&scene, paths(&mode, side, Roulette::Constant(q), 80 + film));
                film.pixels.iter().for_each(|pixel| moments.push(pixel.mean()[0]));
                rays += counters.rays_camera + counters.rays_bounce;
                begun += counters.paths;
            }
            let what = format!("ρ = {rho}, q = {q}");
            let (rho, q, n) = (f64::from(rho), f64::from(q), moments.n as f64);
            let expected = 1.0 / (1.0 - rho);
            // The band of the known variance; where the fourth moment is infinite its estimate is not to be relied on.
            let band = 4.9 * (variance / n).sqrt() / expected * if fourth { 1.1 } else { 2.0 };
            means.add(&what, expected, 1e-5 * expected, band, Estimate::of_moments(&moments));
            if fourth {
                let spread = 4.9 * ((moments.excess_kurtosis() + 2.0) / n).sqrt();
                variances.push((variance, moments.variance(), spread));
            }
            // Vertices of a path are geometric: mean 1/(1-q), variance q/(1-q)².
            let vertices = Estimate {
                n: begun as f64,
                mean: [rays as f64 / begun as f64; 3],
                variance: [q / (1.0 - q).powi(2); 3],
            };
            lengths.add(what, 1.0 / (1.0 - q), 1e-5, f64::INFINITY, vertices);
        }
        means.judge(&mut case, format!("{} (mean)", mode.name));
        case.numbers(format!("{} (variance)", mode.name), variances);
        lengths.judge(&mut case, format!("{} (vertices)", mode.name));
    }
    case.close();
}

#[test]
fn p09_long_paths() {
    let mut case = Case::open("P09", "very long paths", "thousands of bounces, and their end");
    let white = {
        let mut b = SceneBuilder::new();
        let white = b.lambert(Vec3::ONE);
        b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, white);
        b.camera(Vec3::new(0.1, 0.2, 0.3), Vec3::new(1.0, 0.3, 0.1), Vec3::Y, 1.0);
        b.build()
    };
    // Two mirrors (metals of roughness 0 that reflect everything) with a parallel camera between them.
    let mirrors = {
        let mut b = SceneBuilder::new();
        let mirror =
            b.material(Material { metallic: 1.0, roughness: 0.0, base_color: Vec3::ONE, ..Material::default() });
        let square = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        b.quad(square.map(|(x, y)| Vec3::new(x, y, -1.0)), mirror);
        b.quad(square.map(|(x, y)| Vec3::new(y, x, 1.0)), mirror);
        b.any_camera(Vec3::ZERO, Vec3::Z, Vec3::Y, Projection::Orthographic { xmag_m: 0.5, ymag_m: 0.5 });
        b.build()
    };
    for mode in Mode::all() {
        // (a) With survival ρ the mean number of vertices is 1000, its variance 999,000.
        let scene = furnace(Shape::Cube, Vec3::splat(0.999));
        let side = if mode.is_main() { 128 } else { 16 };
        let film = render(&scene, paths(&mode, side, Roulette::Constant(0.999), 9)).film;
        let n = f64::from(side * side);
        let mut means = Means::default();
        let band = 1.1 * 4.9 * (999_000.0 / n).sqrt() / 1000.0;
        means.add("ρ = q = 0.999", 1000.0, 0.1, band.max(0.014), Estimate::of_pixels(&film));
        means.judge(&mut case, &mode.name);
        let limited = paths(&mode, 8, Roulette::Off, 9).max_depth(1025);
        let bound = 2f64.powi(-20) + 1025.0 * 2f64.powi(-24);
        let rho = f64::from(0.999f32);
        let expected = (1.0 - rho.powi(1025)) / (1.0 - rho);
        let on = format!("{} (1024 scatterings; 641.387493 for 0.999 itself)", mode.name);
        case.number(on, expected, render(&scene, limited).film.mean()[0], bound);
        // (b), (c): nothing is absorbed, nothing emits.
        for (what, scene) in [("albedo 1", &white), ("mirrors", &mirrors)] {
            for roulette in [Roulette::Off, Roulette::On] {
                let options = paths(&mode, 16, roulette, 9).strategy(Strategy::MIS).max_depth(1000);
                let Render { film, counters, .. } = render(scene, options);
                let on = |counted: &str| format!("{} ({what}, roulette {roulette:?}: {counted})", mode.name);
                case.count(on("capped paths"), 256, counters.capped_paths);
                let lit = film.pixels.iter().filter(|pixel| pixel.mean()[..3] != [0.0; 3]).count() as u64;
                case.count(on("samples not 0"), 0, lit + counters.nonfinite + counters.invalid_rays);
                case.count(on("rays"), 256 * 1000, counters.rays_camera + counters.rays_bounce);
            }
        }
    }
    case.close();
}

#[test]
fn p10_throughput_underflow() {
    let mut case = Case::open("P10", "throughput underflow", "range of products in f32");
    let scene = furnace(Shape::Cube, Vec3::splat(0.01));
    for mode in Mode::all() {
        let options = paths(&mode, 16, Roulette::Off, 10).max_depth(64);
        let Render { film, counters, .. } = render(&scene, options.clone());
        case.number(format!("{} (no roulette)", mode.name), 1.01010101, film.mean()[0], 2f64.powi(-20));
        // 0.01²³ is 0 in f32: the last vertex that a path reaches is the one before.
        let vertices = (counters.rays_camera + counters.rays_bounce) / counters.paths;
        case.count(format!("{} (vertices of a path)", mode.name), 23, vertices);
        case.count(
            format!("{} (samples not finite, capped paths)", mode.name),
            0,
            counters.nonfinite + counters.capped_paths,
        );
        // Nothing that lies below the normal range counts: without it, as where it is flushed to 0, every bit is the
        // same.
        let short = render(&scene, options.clone().max_depth(19)).film;
        case.bits(format!("{} (without subnormal throughput)", mode.name), usize::from(short.hash() != film.hash()));
        let rules = options.clone().roulette(Roulette::On);
        let estimate = render(&scene, rules.size(128, 128));
        let mut means = Means::default();
        means.add("roulette", 1.01010101, 1e-6, 5e-3, Estimate::of_pixels(&estimate.film));
        case.count(format!("{} (samples not finite, roulette)", mode.name), 0, estimate.counters.nonfinite);
        means.judge(&mut case, &mode.name);
    }
    case.close();
}

/// Independent runs of a picture, as means of its blocks of 8×8 pixels.
fn blocks(scene: &Scene, options: &RenderOptions) -> Vec<Moments> {
    let side = options.width;
    let mut blocks = vec![Moments::default(); (side / 8).pow(2) as usize];
    let mut renderer = Renderer::new(scene, options.clone()).expect("valid options");
    for run in 0..RUNS {
        renderer.set_seed(options.seed + run);
        let film = renderer.render().expect("renders").film;
        for (block, moments) in (0..).zip(&mut blocks) {
            let (x, y) = (block % (side / 8) * 8, block / (side / 8) * 8);
            moments.push((0..64).map(|i| film.pixel(x + i % 8, y + i / 8).mean()[0]).sum::<f64>() / 64.0);
        }
    }
    blocks
}

/// Runs of each picture that is compared.
const RUNS: u64 = 8;

#[test]
fn p11_roulette_on_or_off() {
    let mut case = Case::open("P11", "roulette on or off", "one expectation for all rules");
    // There are two rules, the renderer's (twice the largest channel) and a constant; there is no splitting.
    let caustic = {
        let mut b = SceneBuilder::new();
        let floor = b.lambert(Vec3::splat(0.5));
        b.quad([(-1.0, -1.0), (2.0, -1.0), (2.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 0.0)), floor);
        mirror_beside(&mut b);
        b.any_camera(Vec3::Z * 0.5, Vec3::ZERO, Vec3::Y, Projection::Orthographic { xmag_m: 0.9, ymag_m: 0.9 });
        b.build()
    };
    let rules = [
        ("from the first vertex", Roulette::On, 1),
        ("from the fourth", Roulette::On, 4),
        ("constant 0.5", Roulette::Constant(0.5), 1),
    ];
    for mode in Mode::all() {
        let mut p_values = Vec::new();
        for scene in [&lamp_room(), &caustic] {
            let at = |roulette, start, seed| {
                let spp = if mode.is_main() { 4 } else { 1 };
                mode.options(
                    options(64, 64, spp)
                        .roulette(roulette)
                        .roulette_start(start)
                        .max_depth(24)
                        .seed(seed)
                        .sampler(SamplerKind::Independent),
                )
            };
            let reference = blocks(scene, &at(Roulette::Off, 1, 1000));
            for (i, &(what, roulette, start)) in rules.iter().enumerate() {
                let found = blocks(scene, &at(roulette, start, 2000 + 100 * i as u64));
                p_values.extend(found.iter().zip(&reference).map(|(a, b)| (welch(a, b).p_value, what)));
            }
        }
        let least = p_values.iter().copied().min_by(|a, b| a.0.total_cmp(&b.0)).expect("blocks");
        let level = 1e-4 / p_values.len() as f64;
        let uniform = ks_uniform(&p_values.iter().map(|p| p.0).collect::<Vec<_>>());
        case.row(
            format!("{}, {} blocks", mode.name, p_values.len()),
            format!("p > {level:.1e}, uniform: p > 1e-6"),
            format!("{:.1e} ({}), {uniform:.1e}", least.0, least.1),
            "-",
            least.0 > level && uniform > 1e-6,
        );
    }
    case.close();
}
