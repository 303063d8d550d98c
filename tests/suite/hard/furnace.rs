//! Closed rooms with a known answer: everything emits 1 and reflects ρ, whatever the shape; a sphere with a lamp;
//! plates between mirrors.

use glam::Vec3;
use pathspace::plan::options::{CameraChoice, RenderOptions, Roulette, SamplerKind, Strategy};
use pathspace::render::Renderer;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Material, MaterialId, Projection, Scene};

use super::Case;
use super::modes::Mode;
use super::receiver::{Means, Receiver, delta, picture, spread, with};
use crate::common::{Estimate, options, probe, probe_film, render};

/// Shapes of a furnace, each with a point inside.
#[derive(Clone, Copy, Debug)]
pub enum Shape {
    Cube,
    Sphere,
    /// An L-shaped room, which hides parts of itself.
    Corner,
    /// A cube around a ring, which hides parts of itself and of the walls. Emission is one-sided, so every visible side
    /// has to be a front: a Klein bottle could not be.
    Ring,
}

impl Shape {
    /// Adds the room's surfaces.
    pub fn build(self, b: &mut SceneBuilder, material: MaterialId) {
        match self {
            Shape::Cube => drop(b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, material).clone()),
            Shape::Sphere => drop(b.sphere(Vec3::ZERO, 1.0, 12, true, false, material).clone()),
            Shape::Corner => corner(b, material),
            Shape::Ring => {
                Shape::Cube.build(b, material);
                ring(b, material);
            }
        }
    }
}

/// The square [-1,3]² without its quarter x, y > 1, from z = -1 to 1.
fn corner(b: &mut SceneBuilder, material: MaterialId) {
    let outline = [(-1.0, -1.0), (3.0, -1.0), (3.0, 1.0), (1.0, 1.0), (1.0, 3.0), (-1.0, 3.0)];
    let at = |i: usize, z: f32| Vec3::new(outline[i % 6].0, outline[i % 6].1, z);
    for i in 0..6 {
        b.quad([at(i + 1, -1.0), at(i, -1.0), at(i, 1.0), at(i + 1, 1.0)], material);
    }
    let inner = Vec3::new(1.0, 1.0, 0.0);
    for z in [-1.0, 1.0] {
        let mut positions: Vec<Vec3> = (0..6).map(|i| at(i, z)).collect();
        positions[3] = inner + Vec3::Z * z;
        let fan = [[3, 4, 5], [3, 5, 0], [3, 0, 1], [3, 1, 2]];
        b.triangles(positions, fan.map(|[a, b, c]| if z < 0.0 { [a, b, c] } else { [a, c, b] }).to_vec(), material);
    }
}

/// A torus about the y axis, of radii 0.6 and 0.25, facing outward.
fn ring(b: &mut SceneBuilder, material: MaterialId) {
    const SIDES: u32 = 16;
    let at = |i: u32, j: u32| {
        let [(sin_i, cos_i), (sin_j, cos_j)] =
            [i, j].map(|k| (std::f32::consts::TAU * k as f32 / SIDES as f32).sin_cos());
        let radius = 0.6 + 0.25 * cos_j;
        Vec3::new(radius * sin_i, 0.25 * sin_j, radius * cos_i)
    };
    let positions = (0..SIDES * SIDES).map(|k| at(k / SIDES, k % SIDES)).collect();
    let index = |i: u32, j: u32| i % SIDES * SIDES + j % SIDES;
    let faces = (0..SIDES * SIDES).flat_map(|k| {
        let (i, j) = (k / SIDES, k % SIDES);
        let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    b.triangles(positions, faces.collect(), material);
}

/// A furnace of this shape that emits 1 and reflects `albedo`, with a pinhole inside and a parallel camera.
pub fn furnace(shape: Shape, albedo: Vec3) -> Scene {
    let mut b = SceneBuilder::new();
    let material = b.emitter(albedo, Vec3::ONE);
    shape.build(&mut b, material);
    let (eye, target) = (Vec3::new(0.1, 0.2, -0.1), Vec3::new(0.4, -0.3, 0.7));
    b.camera(eye, target, Vec3::Y, 1.2);
    b.any_camera(eye, target, Vec3::Y, Projection::Orthographic { xmag_m: 0.05, ymag_m: 0.05 });
    b.build()
}

/// Which of [`furnace`]'s cameras.
const PARALLEL: CameraChoice = CameraChoice::Index(1);

/// Survival q = ρ at every bounce: a path carries 1 until it ends, and counts its vertices.
fn geometric(mode: &Mode, rho: f32, spp: u64) -> RenderOptions {
    mode.options(
        options(64, 64, spp)
            .strategy(Strategy::BSDF)
            .roulette(Roulette::Constant(rho))
            .sampler(SamplerKind::Independent)
            .max_depth(1 << 16)
            .seed(1),
    )
}

#[test]
fn p01_closed_furnace() {
    let mut case = Case::open("P01", "closed furnace of any shape", "the whole rendering equation");
    // The number of vertices has the variance ρ/(1-ρ)², so every pixel's z is known.
    let rooms = [
        (0.5f32, Shape::Corner, CameraChoice::First, 1024),
        (0.5, Shape::Corner, PARALLEL, 256),
        (0.8, Shape::Sphere, CameraChoice::First, 128),
        (0.9, Shape::Cube, PARALLEL, 128),
        (0.99, Shape::Ring, CameraChoice::First, 8),
        (0.999, Shape::Cube, CameraChoice::First, 1),
    ];
    for mode in Mode::all() {
        for (rho, shape, camera, spp) in rooms.clone() {
            if !mode.is_main() && rho > 0.9 {
                continue;
            }
            let spp = if mode.is_main() { spp } else { spp / 64 };
            let on = format!("{}, ρ = {rho}, {shape:?}", mode.name);
            let options = geometric(&mode, rho, spp).camera(camera);
            let film = render(&furnace(shape, Vec3::splat(rho)), options).film;
            // f32 sums of up to 2^24 ones are exact; ρ itself is rounded.
            let (rho, n) = (f64::from(rho), 4096.0 * spp as f64);
            let (expected, variance) = (1.0 / (1.0 - rho), rho / (1.0 - rho).powi(2));
            // The known deviation, and a tenth for its estimate from 4096 pixels.
            let band = 1.1 * 4.9 * (variance / n).sqrt() / expected;
            case.mean(&on, [expected; 3], 1e-6 * expected * expected, band, &Estimate::of_pixels(&film));
            if spp >= 1024 {
                let error = (variance / spp as f64).sqrt();
                case.picture(on, film.pixels.iter().map(|pixel| (pixel.mean()[0], expected, error)));
            }
        }
    }
    case.close();
}

#[test]
fn p02_terms_of_the_furnace() {
    let mut case = Case::open("P02", "Neumann terms of the furnace", "each path length by itself");
    let point = (Vec3::new(0.1, 0.2, -0.1), Vec3::new(0.3, -0.5, 0.8));
    let terms = |scene: &Scene, n: u32, options: RenderOptions| {
        let film = probe_film(scene, point.0, point.1, n, options.per_length(true)).film;
        let lengths = film.path_lengths().expect("asked for");
        let of = |edge: usize| Estimate::of(lengths.image(edge).into_iter());
        let total: f64 = (1..=16).map(|edge| lengths.image(edge).iter().map(|v| v[0]).sum::<f64>()).sum();
        let picture: f64 = film.pixels.iter().map(|pixel| pixel.mean()[0]).sum();
        ((1..=9).map(of).collect::<Vec<_>>(), total, picture)
    };
    for mode in Mode::all() {
        let (mut exact, mut sums) = (Vec::new(), Vec::new());
        for (rho, shape) in [(0.5f32, Shape::Sphere), (0.9, Shape::Corner)] {
            // Without roulette every sample of term k is ρᵏ.
            let scene = furnace(shape, Vec3::splat(rho));
            let options = with(&mode, Strategy::BSDF, 2).roulette(Roulette::Off).max_depth(12);
            let (found, total, picture) = terms(&scene, 1 << 10, options);
            exact.extend((0..9).map(|k| (f64::from(rho).powi(k as i32), found[k].mean[0], 2f64.powi(-20))));
            sums.push((rho, total, picture));
            // By light sampling and roulette terms have noise.
            let n = if mode.is_main() { 1 << 18 } else { 1 << 12 };
            let options = with(&mode, Strategy::MIS, 2).max_depth(16);
            let (found, ..) = terms(&scene, n, options);
            let mut means = Means::default();
            for (k, estimate) in found.into_iter().enumerate().skip(1) {
                let expected = f64::from(rho).powi(k as i32);
                // Roulette thins out the long paths: their deviation grows as ρ^(-k/2).
                let delta = 1e-2 * ((1u64 << 18) as f64 / f64::from(n) / expected).sqrt();
                means.add(format!("term {k}"), expected, 1e-6, delta, estimate);
            }
            means.judge(&mut case, format!("{}, ρ = {rho}, MIS and roulette", mode.name));
        }
        case.numbers(format!("{} (no roulette)", mode.name), exact);
        // Powers of ½ add up exactly in f32, others to its rounding.
        case.bits(format!("{} (sum of the terms, ρ = 0.5)", mode.name), usize::from(sums[0].1 != sums[0].2));
        case.number(format!("{} (sum of the terms, ρ = 0.9)", mode.name), sums[1].1, sums[1].2, 2f64.powi(-20));
    }
    case.close();
}

#[test]
fn p03_depth_limit() {
    let mut case = Case::open("P03", "truncation bias of a depth limit", "the limit as a bias, and what is said of it");
    for mode in Mode::all() {
        let (mut sums, mut told) = (Vec::new(), Vec::new());
        for rho in [0.5f32, 0.8, 0.9, 0.99, 0.999] {
            let scene = furnace(Shape::Cube, Vec3::splat(rho));
            let at = |scatterings: u32| {
                options(8, 8, 1).strategy(Strategy::BSDF).roulette(Roulette::Off).max_depth(scatterings + 1)
            };
            let mut renderer = Renderer::new(&scene, mode.options(at(0))).expect("valid options");
            for scatterings in [0, 1, 2, 4, 8, 16, 64, 256, 1024] {
                renderer.retarget(&mode.options(at(scatterings))).expect("valid options");
                let film = renderer.render().expect("renders").film;
                let rounding = 2f64.powi(-20) + f64::from(scatterings + 1) * 2f64.powi(-24);
                let left = f64::from(rho).powi(scatterings as i32 + 1);
                sums.push(((1.0 - left) / (1.0 - f64::from(rho)), film.mean()[0], rounding));
                let said = renderer.plan().bias[0].radiance_removed_at_most.expect("bounded");
                told.push((left / (1.0 - f64::from(rho)), said, 1e-6));
            }
        }
        case.numbers(&mode.name, sums);
        case.numbers(format!("{} (bias that the plan states)", mode.name), told);
    }
    case.close();
}

/// HARDCASES P05: a square tube 1×1×2 of perfect mirrors, ends of albedo `a` (which emits 1) and `b`.
fn tube(a: f32, b_albedo: f32) -> Scene {
    let mut b = SceneBuilder::new();
    let mirror = b.material(Material { metallic: 1.0, roughness: 0.0, base_color: Vec3::ONE, ..Material::default() });
    let lamp = b.emitter(Vec3::splat(a), Vec3::ONE);
    let end = b.lambert(Vec3::splat(b_albedo));
    let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
    b.quad(square.map(|(x, y)| Vec3::new(x, y, 0.0)), lamp);
    b.quad(square.map(|(x, y)| Vec3::new(y, x, 2.0)), end);
    for i in 0..4 {
        let ((x0, y0), (x1, y1)) = (square[i], square[(i + 1) % 4]);
        b.quad(
            [Vec3::new(x1, y1, 0.0), Vec3::new(x0, y0, 0.0), Vec3::new(x0, y0, 2.0), Vec3::new(x1, y1, 2.0)],
            mirror,
        );
    }
    b.build()
}

#[test]
fn p05_infinite_plates() {
    let mut case = Case::open("P05", "infinite plates by a mirror tube", "chains of mirrors and diffuse scatterings");
    let pairs = [(0.5f32, 0.5f32), (0.8, 0.3), (0.9, 0.9)];
    let points = [("centre", 0.5, 0.5), ("edge", 0.001, 0.5), ("corner", 0.999, 0.002)];
    for mode in Mode::all() {
        let mut means = Means::default();
        for (a, b) in pairs {
            let scene = tube(a, b);
            let loops = 1.0 - f64::from(a) * f64::from(b);
            let pairs = [(Vec3::NEG_Z, 1.0 / loops), (Vec3::Z, f64::from(b) / loops)];
            for (what, x, y) in points {
                for (towards, expected) in pairs {
                    let n = match (mode.is_main(), what) {
                        (true, "centre") => 1 << 15,
                        (true, _) => 1 << 13,
                        _ => 1 << 9,
                    };
                    let options = with(&mode, Strategy::MIS, 5).max_depth(4096);
                    let (pixels, options) = spread(n, options);
                    let estimate = probe(&scene, Vec3::new(x, y, 1.0), towards, pixels, options);
                    let plate = if towards.z < 0.0 { 'A' } else { 'B' };
                    let what = format!("L_{plate}, {what}, a = {a}, b = {b}");
                    // One sample deviates by 1.03 of its mean: a tenth on top for estimating that from few.
                    means.add(what, expected, 1e-5 * expected, 1.1 * delta(n), estimate);
                }
            }
        }
        means.judge(&mut case, &mode.name);
    }
    case.close();
}

#[test]
fn p06_finite_plates() {
    let mut case = Case::open("P06", "finite parallel plates", "form factors by rendering");
    let plate = |b: &mut SceneBuilder| {
        let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
        b.quad([(-0.5, 0.5), (0.5, 0.5), (0.5, -0.5), (-0.5, -0.5)].map(|(x, y)| Vec3::new(x, y, 1.0)), lamp);
    };
    let whole = {
        let mut b = SceneBuilder::new();
        plate(&mut b);
        let other = b.lambert(Vec3::splat(0.5));
        b.quad([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(|(x, y)| Vec3::new(x, y, 0.0)), other);
        let projection = Projection::Orthographic { xmag_m: 0.5, ymag_m: 0.5 };
        b.any_camera(Vec3::Z * 0.5, Vec3::ZERO, Vec3::Y, projection);
        b.build()
    };
    for mode in Mode::all() {
        let n = if mode.is_main() { 1 << 20 } else { 1 << 14 };
        let mut means = Means::default();
        for (what, x, expected) in [("centre", 0.0, 0.7522746885), ("corner", 0.5, 0.4352098757)] {
            let receiver = Receiver::new(Vec3::new(x, x, 0.0), Vec3::Z, &plate);
            for strategy in [Strategy::LIGHT, Strategy::MIS] {
                let estimate = receiver.irradiance(n, with(&mode, strategy, 6));
                means.add(format!("{what}, {strategy}"), expected, 1e-5 * expected, delta(n), estimate);
            }
        }
        let options = with(&mode, Strategy::MIS, 7).max_depth(2);
        let mean = picture(&whole, n, options).scaled(std::f64::consts::PI / 0.5);
        means.add("mean", 0.6277684243, 1e-5 * 0.63, delta(n), mean);
        means.judge(&mut case, &mode.name);
    }
    case.close();
}

#[test]
fn p13_coloured_albedo() {
    let mut case = Case::open("P13", "coloured albedo with scalar roulette", "weights of the channels");
    // The rule goes by the largest channel; there is none by luminance.
    for mode in Mode::all() {
        let n: u64 = if mode.is_main() { 1 << 20 } else { 1 << 13 };
        let options = with(&mode, Strategy::BSDF, 13).max_depth(1 << 12);
        let estimate = picture(&furnace(Shape::Cube, Vec3::new(0.9, 0.5, 0.1)), n, options);
        let expected = [10.0, 2.0, 1.111111111];
        let delta = 2.5e-3 * ((1u64 << 22) as f64 / n as f64).sqrt();
        case.mean(&mode.name, expected, 1e-5, delta, &estimate);
    }
    case.close();
}
