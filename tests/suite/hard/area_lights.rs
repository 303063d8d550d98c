//! Area lights: polygons, discs and spheres over a receiver, cut by its horizon, touching it, seen from behind. Each by
//! BSDF sampling, light sampling and both.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, FRAC_PI_8, PI};

use glam::{DVec3, Vec3};
use pathspace::plan::options::Strategy;
use pathspace::scene::Projection;
use pathspace::scene::builder::SceneBuilder;
use pathspace::shading::light::Lights;
use pathspace::shading::light::area::{emitted, square_to_triangle};
use pathspace::shading::light::{EmitterHit, LightSample};
use pathspace_stat::GaussLegendre;

use super::Case;
use super::modes::Mode;
use super::receiver::{
    Means, Receiver, STRATEGIES, delta, delta_of, mesh_irradiance, picture, polygon_irradiance, with,
};
use crate::common::Estimate;
use crate::meter::{Random, lights_of, rectangle, square_light};

const ORIGIN: Vec3 = Vec3::ZERO;
const UP: Vec3 = Vec3::Z;

/// The square [-1,1]² at z = 1, radiance 1, facing down.
pub fn square(b: &mut SceneBuilder) {
    let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
    b.quad([(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)].map(|(x, y)| Vec3::new(x, y, 1.0)), lamp);
}

/// The means of one receiver by every strategy; `wasted` is the factor on the number of light samples.
fn strategies(means: &mut Means, what: &str, receiver: &Receiver, expected: f64, mode: &Mode, n: u64, wasted: u64) {
    for (i, strategy) in STRATEGIES.into_iter().enumerate() {
        let more = if strategy == Strategy::BSDF { 1 } else { wasted };
        let estimate = receiver.irradiance(n * more, with(mode, strategy, 11 + i as u64));
        means.add(format!("{what}, {strategy}"), expected, 1e-5 * expected, delta_of(strategy, expected, n), estimate);
    }
}

fn samples(mode: &Mode) -> u64 {
    if mode.is_main() { 1 << 20 } else { 1 << 15 }
}

#[test]
fn l01_rectangle() {
    let mut case = Case::open("L01", "rectangle light", "light sampling, Lambert's formula, conversion of densities");
    let tilted = Vec3::new(1.0, 2.0, 2.0) / 3.0;
    let receivers = [
        ("below", ORIGIN, UP, 1.740839503),
        ("below an edge", Vec3::new(1.0, 0.0, 0.0), UP, 1.051648203),
        ("aside", Vec3::new(3.0, 0.0, 0.0), UP, 0.04960834601),
        ("far aside", Vec3::new(3.0, 4.0, 0.0), UP, 0.006554121792),
        ("tilted", ORIGIN, tilted, 1.165664387),
    ];
    let corners = [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)].map(|(x, y)| DVec3::new(x, y, 1.0));
    let formula = |p: Vec3, n: Vec3| polygon_irradiance(p.as_dvec3(), n.as_dvec3().normalize(), &corners);
    case.numbers("- (Lambert's formula)", receivers.map(|(_, p, n, expected)| (expected, formula(p, n), 1e-7)));
    for mode in Mode::all() {
        let mut means = Means::default();
        for (what, at, normal, expected) in receivers {
            let receiver = Receiver::new(at, normal, &square);
            strategies(&mut means, what, &receiver, expected, &mode, samples(&mode), 1);
        }
        means.judge(&mut case, &mode.name);
    }
    case.close();
}

#[test]
fn l02_triangle() {
    let mut case = Case::open("L02", "triangle light", "points of a triangle, sampled by area: the only way there is");
    let triangle = |b: &mut SceneBuilder| {
        let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
        b.triangles(vec![Vec3::Z, Vec3::new(0.0, 1.0, 1.0), Vec3::new(1.0, 0.0, 1.0)], vec![[0, 1, 2]], lamp);
    };
    for mode in Mode::all() {
        let mut means = Means::default();
        let receiver = Receiver::new(ORIGIN, UP, &triangle);
        strategies(&mut means, "below", &receiver, 0.302299894, &mode, samples(&mode), 1);
        means.judge(&mut case, &mode.name);
    }

    // The map from the square keeps areas: 256² midpoints against a 16² grid. Sheared lattice lines shift a cell's
    // count by at most its boundary, 32 of 512. No point outside, corners of the lattice included.
    let mut counts = [[0u32; 16]; 16];
    let mut outside = 0;
    let one = 1.0 - f32::EPSILON / 2.0;
    let midpoints = (0..256 * 256).map(|i| [((i % 256) as f32 + 0.5) / 256.0, ((i / 256) as f32 + 0.5) / 256.0]);
    for uv in midpoints.chain([[0.6, 0.5], [0.0, 0.0], [one, one], [0.0, one], [one, 0.0]]) {
        let [b1, b2] = square_to_triangle(uv);
        outside += u64::from(!(b1 >= 0.0 && b2 >= 0.0 && b1 + b2 <= 1.0));
        counts[((b1 * 16.0) as usize).min(15)][((b2 * 16.0) as usize).min(15)] += 1;
    }
    case.count("- (points outside the triangle)", 0, outside);
    let cells = counts.iter().enumerate().flat_map(|(i, row)| row.iter().enumerate().map(move |(j, n)| (i, j, *n)));
    let wrong = |i: usize, j: usize, n: u32| n.abs_diff([512, 256, 0][(i + j).saturating_sub(14).min(2)]) > 37;
    case.count("- (cells of a wrong area)", 0, cells.filter(|&(i, j, n)| wrong(i, j, n)).count() as u64);
    case.close();
}

#[test]
fn l03_cut_by_the_horizon() {
    let mut case = Case::open("L03", "light cut by the horizon", "negative cosines, clipping");
    let vertical = |b: &mut SceneBuilder| {
        let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
        b.quad([(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)].map(|(y, z)| Vec3::new(2.0, y, z)), lamp);
    };
    let expected = 0.08751026477;
    for mode in Mode::all() {
        let receiver = Receiver::new(ORIGIN, UP, &vertical);
        let mut means = Means::default();
        // Half of the light samples are below the horizon: the power needs twice their number.
        strategies(&mut means, "aside", &receiver, expected, &mode, samples(&mode), 2);
        means.judge(&mut case, &mode.name);
        let film = receiver.render(1 << 12, with(&mode, Strategy::LIGHT, 3)).film;
        let negative = film.pixels.iter().filter(|pixel| pixel.mean().iter().any(|value| *value < 0.0));
        case.count(format!("{} (negative samples)", mode.name), 0, negative.count() as u64);
    }
    case.close();
}

/// Centre first, then the ring, seen counter-clockwise from below.
fn disc(sides: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let ring = |i: u32| {
        let angle = 2.0 * PI * f64::from(i) / f64::from(sides);
        DVec3::new(angle.cos(), angle.sin(), 1.0).as_vec3()
    };
    let positions = std::iter::once(UP).chain((0..sides).map(ring)).collect();
    (positions, (0..sides).map(|i| [0, 1 + (i + 1) % sides, 1 + i]).collect())
}

/// The disc of radius 1 at z = 1 facing down, as a fan of 1024 triangles.
pub fn fan(b: &mut SceneBuilder) {
    let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
    let (positions, triangles) = disc(1024);
    b.triangles(positions, triangles, lamp);
}

/// What a fan of 1024 lacks of a disc's area: (2π/1024)²/6.
pub const FAN_DEFICIT: f64 = 6.3e-6;

#[test]
fn l04_disc() {
    let mut case =
        Case::open("L04", "disc light (fan of 1024 triangles)", "off-axis closed form, choice among triangles");
    let offsets =
        [(0.0, FRAC_PI_2), (0.5, 1.375963021), (1.0, 0.8683148537), (2.0, 0.1658333806), (5.0, 0.005002548777)];
    for mode in Mode::all() {
        let mut means = Means::default();
        for (offset, expected) in offsets {
            let receiver = Receiver::new(Vec3::X * offset, UP, &fan);
            let full = if offset == 0.0 || offset == 5.0 { 1 << 20 } else { 1 << 18 };
            let n = if mode.is_main() { full } else { 1 << 12 };
            let estimate = receiver.irradiance(n, with(&mode, Strategy::MIS, 4));
            let tau = (1e-5 + FAN_DEFICIT) * expected;
            means.add(format!("offset {offset}"), expected, tau, delta(n), estimate);
        }
        means.judge(&mut case, &mode.name);
    }
    case.close();
}

/// Irradiance of a sphere of radiance 1 under the angle θ to the normal, s = R/d (Snyder 1969).
fn sphere_irradiance(s: f64, theta: f64) -> f64 {
    let h = 1.0 / s;
    let (sin, cos) = theta.sin_cos();
    if cos >= s {
        return PI * s * s * cos;
    }
    if cos <= -s {
        return 0.0;
    }
    let (root, cut) = ((h * h - 1.0).sqrt(), (1.0 - h * h * cos * cos).sqrt());
    PI / 2.0 - (root / (h * sin)).asin() + s * s * (cos * (-root * cos / sin).acos() - root * cut)
}

#[test]
fn l05_sphere() {
    let mut case = Case::open("L05", "sphere light (mesh of 3968 triangles)", "horizon cut, large and small spheres");
    let positions = [
        (0.5, 0.0, FRAC_PI_4),
        (0.5, 60.0, FRAC_PI_8),
        (0.5, 75.0, 0.22120088),
        (0.5, 90.0, 0.0905860737),
        (0.5, 105.0, 0.0179248774),
        (0.01, 0.0, 0.000314159265),
        (0.01, 89.0, 5.48283519e-06),
        (0.99, 80.0, 1.56118122),
        (0.99, 120.0, 0.557232721),
    ];
    // What the mesh sends is known exactly: all of it is in view, and its outline lies between those of the sphere
    // through its corners and of the one that its faces touch. That bounds what the mesh lacks of the sphere.
    let rows = 32;
    let least = (PI / f64::from(2 * rows)).cos().powi(2);
    let lights = positions.map(|(s, degrees, expected)| {
        let (sin, cos) = f64::to_radians(degrees).sin_cos();
        let centre = DVec3::new(sin, 0.0, cos).as_vec3();
        let light = move |b: &mut SceneBuilder| {
            let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
            b.sphere(centre, s as f32, rows, false, false, lamp);
        };
        let mut b = SceneBuilder::new();
        light(&mut b);
        let mesh = b.build().meshes.swap_remove(0);
        let exact = mesh_irradiance(DVec3::ZERO, DVec3::Z, &mesh.positions, &mesh.triangles);
        (s, degrees, expected, exact, light)
    });
    let bound = |s: f64, degrees: f64| {
        let (outer, inner) =
            (sphere_irradiance(s, degrees.to_radians()), sphere_irradiance(s * least, degrees.to_radians()));
        (outer - inner) / outer + 1e-6
    };
    case.numbers(
        "- (closed form)",
        positions.map(|(s, degrees, expected)| (expected, sphere_irradiance(s, degrees.to_radians()), 1e-8)),
    );
    case.numbers("- (exact value of the mesh)", lights.iter().map(|l| (l.2, l.3, bound(l.0, l.1))));
    for mode in Mode::all() {
        let mut means = Means::default();
        for &(s, degrees, _, exact, ref light) in &lights {
            // The nearest mesh is 0.01 away.
            let receiver = Receiver { half_m: 1e-4, ..Receiver::new(ORIGIN, UP, light) };
            // The full number where the horizon cuts; a quarter elsewhere. Most of the nearest sphere that counts is
            // cut off: there the same number sees a bias twice as large.
            let (n, band) = match (mode.is_main(), mode.is_brute()) {
                (true, _) if degrees >= 89.0 => (1 << 20, if s == 0.99 { delta(1 << 18) } else { delta(1 << 20) }),
                (true, _) => (1 << 18, delta(1 << 18)),
                (_, true) => (1 << 9, 2.0 * delta(1 << 9)),
                _ => (1 << 12, 2.0 * delta(1 << 12)),
            };
            let estimate = receiver.irradiance(n, with(&mode, Strategy::MIS, 5));
            means.add(format!("s = {s}, {degrees}°"), exact, 1e-4 * exact, band, estimate);
        }
        means.judge(&mut case, &mode.name);
    }
    case.close();
}

#[test]
fn l08_touching_the_receiver() {
    let mut case = Case::open("L08", "light touching the receiver", "1/r² of the geometry term");
    // The light stands on a floor, at x = 0.
    let standing = |b: &mut SceneBuilder| {
        let floor = b.lambert(Vec3::splat(0.5));
        b.quad([(-1.0, -1.0), (2.0, -1.0), (2.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, -1e-3)), floor);
        let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
        b.quad([(-0.5, 0.0), (0.5, 0.0), (0.5, 1.0), (-0.5, 1.0)].map(|(y, z)| Vec3::new(0.0, y, z)), lamp);
    };
    let distances =
        [(1.0, 0.2233466258), (0.1, 1.327463829), (0.01, 1.546162949), (1e-4, 1.570549962), (1e-6, 1.570793863)];
    for mode in Mode::all() {
        let mut means = Means::default();
        for (c, expected) in distances {
            let receiver = Receiver::new(Vec3::X * c, UP, &standing);
            for strategy in [Strategy::MIS, Strategy::BSDF] {
                let n = samples(&mode);
                let estimate = receiver.irradiance(n, with(&mode, strategy, 8));
                let delta = delta_of(strategy, expected, n);
                means.add(format!("at {c:e} m, {strategy}"), expected, 1e-4 * expected, delta, estimate);
            }
        }
        means.judge(&mut case, &mode.name);
    }
    // Per-sample variance: known for area and cosine sampling; MIS must not inherit the fireflies.
    let receiver = Receiver::new(Vec3::X * 0.01, UP, &standing);
    for mode in Mode::all() {
        let n = if mode.is_main() { 1 << 20 } else { 1 << 14 };
        let variance = |strategy| receiver.single_samples(n, with(&mode, strategy, 9)).variance[0];
        let cosine = if mode.is_main() { 0.02 } else { 0.02 * 8.0 };
        let on = |what: &str| format!("{} (variance at 0.01 m, {what})", mode.name);
        case.number(on("cosine"), 2.46679, variance(Strategy::BSDF), cosine);
        let mis = variance(Strategy::MIS);
        case.row(on("MIS"), "2.437, below 5", format!("{mis:.4}"), format!("{:.1e}", mis / 2.437 - 1.0), mis < 5.0);
    }
    // Area sampling by the lights alone. A tail so heavy is not for counting: the second moment is integrated over the
    // numbers that the light is sampled by (height first), graded towards the receiver.
    let lights = lights_of(&rectangle(Vec3::new(0.0, -0.5, 0.0), Vec3::Y, Vec3::Z, 0));
    let wall = [(-0.5, 0.0), (0.5, 0.0), (0.5, 1.0), (-0.5, 1.0)].map(|(y, z)| DVec3::new(0.0, y, z));
    for (c, expected) in [(0.1f64, 11.3188642), (0.01, 1306.60622), (0.001, 130897.234)] {
        let irradiance = polygon_irradiance(DVec3::X * c, DVec3::Z, &wall);
        let value2 = |y: f64, z: f64| {
            let sample = lights.sample(Vec3::X * c as f32, UP, [0.0, z as f32, (y + 0.5) as f32]);
            sample.map_or(0.0, |sample| (f64::from(sample.wi.z) / f64::from(sample.pdf_sa)).powi(2))
        };
        let rule = GaussLegendre::new(128);
        let (wide, high) = ((0.5 / c).asinh(), (1.0 / c).asinh());
        let graded = |s: f64, t: f64| value2(c * s.sinh(), c * t.sinh()) * c * s.cosh() * c * t.cosh();
        let second = rule.integrate_2d([-wide, wide], [0.0, high], &graded);
        case.number(format!("- (variance at {c} m, area)"), expected, second - irradiance * irradiance, 1e-4);
    }
    case.close();
}

#[test]
fn l09_coplanar() {
    let mut case = Case::open("L09", "coplanar light", "cosines of 0 at receiver and light");
    for height in [0.0, f32::MIN_POSITIVE] {
        let corner = Vec3::new(1.0, -0.5, height);
        let lights = lights_of(&rectangle(corner, Vec3::X, Vec3::Y, 0));
        let mut random = Random(109);
        let given = (0..1 << 16)
            .filter(|_| lights.sample(ORIGIN, UP, [random.unit(), random.unit(), random.unit()]).is_some())
            .count();
        let at_itself = lights.sample(corner, UP, [0.0; 3]).is_some();
        case.count(format!("- (samples given, light at {height:e} m)"), 0, given as u64 + u64::from(at_itself));
        let lamp = |b: &mut SceneBuilder| {
            let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
            b.quad([corner, corner + Vec3::X, corner + Vec3::X + Vec3::Y, corner + Vec3::Y], lamp);
        };
        for mode in Mode::all() {
            let mut lit = 0;
            for strategy in STRATEGIES {
                let scene = Receiver::new(ORIGIN, UP, &lamp);
                let render = scene.render(1 << 12, with(&mode, strategy, 9));
                let lit_pixel = |pixel: &&pathspace::film::Pixel| pixel.mean()[..3] != [0.0; 3];
                lit += render.film.pixels.iter().filter(lit_pixel).count() as u64 + render.counters.nonfinite;
            }
            case.count(format!("{} (samples not 0, light at {height:e} m)", mode.name), 0, lit);
        }
    }
    case.close();
}

#[test]
fn l10_triangles_without_area() {
    let mut case = Case::open("L10", "1000 triangles without area in an emissive mesh", "probabilities of the choice");
    let mut triangles = square_light();
    triangles.extend((0..1000).map(|i| ([Vec3::splat(i as f32), Vec3::splat(i as f32), Vec3::ONE], 0)));
    let lights = lights_of(&triangles);
    // The halves of the square are one light.
    let p_select: Vec<f32> = (0..1001).map(|light| lights.p_select(light, ORIGIN, UP)).collect();
    case.count("- (empty triangles that can be chosen)", 0, p_select[1..].iter().filter(|&&p| p != 0.0).count() as u64);
    case.number("- (sum of the probabilities)", 1.0, p_select.iter().map(|&p| f64::from(p)).sum(), 1e-6);
    let mesh = |b: &mut SceneBuilder| {
        let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
        let corners: Vec<Vec3> = triangles.iter().flat_map(|(corners, _)| *corners).collect();
        b.triangles(corners, (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(), lamp);
    };
    for mode in Mode::all() {
        let n = if mode.is_brute() { 1 << 12 } else { samples(&mode) };
        let mut means = Means::default();
        strategies(&mut means, "below", &Receiver::new(ORIGIN, UP, &mesh), 1.740839503, &mode, n, 1);
        means.judge(&mut case, &mode.name);
    }
    case.close();
}

#[test]
fn l20_one_sided_and_two_sided() {
    let mut case = Case::open("L20", "one-sided and two-sided emission", "orientation of lights");
    // Emission is one-sided. A second square back to back, 2^-13 m above, stands for the other side.
    const GAP: f32 = 1.0 / 8192.0;
    let both = |b: &mut SceneBuilder| {
        square(b);
        let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
        b.quad([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 1.0 + GAP)), lamp);
    };
    for mode in Mode::all() {
        let mut means = Means::default();
        let n = samples(&mode);
        let expected = 1.740839503;
        let above = Vec3::new(0.0, 0.0, 2.0);
        // The choice cannot rule out the side that faces away: half of the light samples go there.
        let fewer = if mode.is_main() { n / 4 } else { n };
        strategies(&mut means, "one-sided, below", &Receiver::new(ORIGIN, UP, &square), expected, &mode, n, 1);
        strategies(&mut means, "two-sided, below", &Receiver::new(ORIGIN, UP, &both), expected, &mode, fewer, 2);
        let other = Receiver::new(above + UP * GAP, -UP, &both);
        strategies(&mut means, "two-sided, above", &other, expected, &mode, fewer, 2);
        means.judge(&mut case, &mode.name);
        let mut lit = 0;
        for strategy in STRATEGIES {
            let film = Receiver::new(above, -UP, &square).render(1 << 12, with(&mode, strategy, 20)).film;
            lit += film.pixels.iter().filter(|pixel| pixel.mean()[..3] != [0.0; 3]).count() as u64;
        }
        case.count(format!("{} (samples not 0 above, one-sided)", mode.name), 0, lit);
    }

    // The choice: two sides are two lights of one power. What is drawn has the density that emission MIS asks for.
    let upper = rectangle(Vec3::new(-1.0, -1.0, 1.0 + GAP), Vec3::X * 2.0, Vec3::Y * 2.0, 0);
    let two = lights_of(&[square_light(), upper].concat());
    let sideways = [0, 1].map(|light| f64::from(two.p_select(light, Vec3::new(1e4, 0.0, 1.0 + 0.5 * GAP), Vec3::ZERO)));
    case.numbers("- (share of each side, from aside)", sideways.map(|p| (0.5, p, 1e-3)));
    case.count("- (backs that emit)", 0, u64::from(emitted(Vec3::ONE, -0.5) != Vec3::ZERO));
    let (lights, mut differing) = (lights_of(&square_light()), 0);
    let mut random = Random(121);
    for _ in 0..1 << 16 {
        let p = Vec3::new(random.unit() * 4.0, random.unit() * 4.0, -random.unit());
        let u = [random.unit(), random.unit(), random.unit()];
        differing += u64::from(!lights.sample(p, UP, u).is_some_and(|sample| consistent(&lights, p, &sample)));
    }
    case.count("- (samples that differ from the hit)", 0, differing);
    case.close();
}

/// Whether a point drawn on L01's square lies on it and has the density that the same point has when it is hit; from
/// behind none.
fn consistent(lights: &Lights, p: Vec3, sample: &LightSample) -> bool {
    let point = sample.target.expect("finite");
    let on_it = (point.position.z - 1.0).abs() <= point.error && point.normal == -UP;
    let inside = point.position.x.abs() <= 1.0 && point.position.y.abs() <= 1.0;
    let hit = EmitterHit {
        light: 0,
        distance_m: (point.position - p).length(),
        cos_light: sample.wi.z,
        area_m2: lights.area_m2(0),
    };
    let behind = lights.pdf_triangle(p, UP, &EmitterHit { cos_light: -sample.wi.z, ..hit });
    let same = (lights.pdf_triangle(p, UP, &hit) / sample.pdf_sa - 1.0).abs() < 1e-6;
    on_it && inside && same && behind == 0.0 && lights.area_m2(0) == 4.0
}

#[test]
fn l22_inside_and_on_a_sphere() {
    let mut case = Case::open("L22", "receiver inside or on a spherical emitter (mesh)", "a light all around");
    // Emission is one-sided: a sphere that faces inward for receivers inside, one that faces outward for those outside.
    // The receiver stays at the origin, where its patch is not rounded away, and the sphere moves.
    let rows = 32;
    let sphere = |receiver: Vec3, inward: bool| {
        move |b: &mut SceneBuilder| {
            let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
            b.sphere(-receiver, 1.0, rows, inward, false, lamp);
        }
    };
    let mesh_at = |receiver: Vec3| {
        let mut b = SceneBuilder::new();
        sphere(receiver, false)(&mut b);
        b.build().meshes.swap_remove(0)
    };
    // Along a corner the mesh reaches to the sphere. Outside, the middle of a face is the like of a sphere's tangent
    // plane.
    let mesh = mesh_at(ORIGIN);
    let corner = mesh.positions[(rows / 2 * 2 * rows) as usize];
    let [a, b, c] = mesh.triangles[mesh.triangles.len() / 2].map(|i| mesh.positions[i as usize]);
    let normal = (b - a).cross(c - a).normalize();
    let (near, tangent) = ((a + b + c) / 3.0 + normal * 2f32.powi(-20), normal.any_orthonormal_vector());
    let mesh = mesh_at(near);
    let exact = |n: Vec3| mesh_irradiance(DVec3::ZERO, n.as_dvec3(), &mesh.positions, &mesh.triangles);
    case.number("- (exact value of the mesh, facing it)", 3.141586662, exact(-normal), 1e-4);
    case.number("- (exact value of the mesh, perpendicular)", PI / 2.0, exact(tangent), 2e-3);
    for mode in Mode::all() {
        let n = if mode.is_main() {
            1 << 18
        } else if mode.is_brute() {
            1 << 9
        } else {
            1 << 12
        };
        let mut means = Means::default();
        for (i, share) in [0.0, 0.5, 0.999999].into_iter().enumerate() {
            let lamp = sphere(corner * share, true);
            for (j, normal) in [UP, -corner, corner.any_orthonormal_vector()].into_iter().enumerate() {
                let receiver = Receiver { half_m: 1e-7, ..Receiver::new(ORIGIN, normal, &lamp) };
                let estimate = receiver.irradiance(n, with(&mode, Strategy::MIS, (22 + 3 * i + j) as u64));
                means.add(format!("inside at {share}, normal {j}"), PI, 1e-4 * PI, delta(n), estimate);
            }
        }
        let lamp = sphere(near, false);
        for (what, normal, tau) in [("facing", -normal, 1e-4), ("perpendicular", tangent, 2e-3)] {
            let receiver = Receiver { half_m: 1e-7, ..Receiver::new(ORIGIN, normal, &lamp) };
            let estimate = receiver.irradiance(n, with(&mode, Strategy::MIS, 31));
            means.add(format!("outside, {what}"), exact(normal), tau * exact(normal), delta(n), estimate);
        }
        means.judge(&mut case, &mode.name);
    }
    case.close();
}

#[test]
fn l24_reciprocity_of_two_rectangles() {
    let mut case =
        Case::open("L24", "flux reciprocity of two rectangles", "symmetry of the geometry term and of visibility");
    // A unit square below, 2×2 above, 1 m apart. One emits, the other (albedo ½) is seen by a parallel camera that
    // covers it.
    let sides = [0.5f32, 1.0];
    let scene = |emitter: usize| {
        let mut b = SceneBuilder::new();
        for (i, half) in sides.into_iter().enumerate() {
            let of = if i == emitter { b.emitter(Vec3::ZERO, Vec3::ONE) } else { b.lambert(Vec3::splat(0.5)) };
            let corners = [(-half, -half), (half, -half), (half, half), (-half, half)];
            let corners = corners.map(|(x, y)| if i == 0 { Vec3::new(x, y, 0.0) } else { Vec3::new(y, x, 1.0) });
            b.quad(corners, of);
        }
        let (half, towards) = (sides[1 - emitter], if emitter == 0 { UP } else { -UP });
        let projection = Projection::Orthographic { xmag_m: half, ymag_m: half };
        b.any_camera(UP * 0.5, UP * 0.5 + towards, Vec3::Y, projection);
        b.build()
    };
    let expected = [0.5176530795, 0.1294132699];
    for mode in Mode::all() {
        let n = samples(&mode);
        let mut means = Means::default();
        let mut flux = [Estimate::default(); 2];
        for (emitter, strategy) in [(0, Strategy::LIGHT), (1, Strategy::LIGHT), (0, Strategy::MIS), (1, Strategy::MIS)]
        {
            let options = with(&mode, strategy, 24 + emitter as u64);
            // Mean irradiance of the receiver is π F(receiver → emitter), and A F is symmetric: F(1→2) is seen
            // with 2 emitting.
            let estimate = picture(&scene(emitter), n, options.max_depth(2)).scaled(2.0);
            let factor = expected[1 - emitter];
            means.add(
                format!("F({}→{}), {strategy}", 2 - emitter, 1 + emitter),
                factor,
                1e-5 * factor,
                delta(n),
                estimate,
            );
            flux[emitter] = estimate.scaled(f64::from(4.0 * sides[1 - emitter] * sides[1 - emitter]));
        }
        means.judge(&mut case, &mode.name);
        let difference = flux[0].mean[0] - flux[1].mean[0];
        let error = flux[0].standard_error(0).hypot(flux[1].standard_error(0));
        case.row(
            format!("{} (A F both ways)", mode.name),
            format!("{:.6}", flux[0].mean[0]),
            format!("{:.6} ± {error:.1e}", flux[1].mean[0]),
            format!("{:.2} σ", difference / error),
            difference.abs() <= 4.9 * error,
        );
    }
    case.close();
}
