//! Ways to light that have hardly anything to go by: guides without mass, splats that overflow, light paths from lamps
//! that are none, environments of few texels (W01–W12). Oracles: densities that integrate to 1, sums by hand, furnaces.

use std::f64::consts::PI;

use glam::Vec3;
use pathspace::film::splats::Splats;
use pathspace::plan::options::{Crop, LightPaths};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Environment, Material, PunctualKind, Scene};
use pathspace::shading::directions::Directions;
use pathspace::shading::guide::{Guide, Record};
use pathspace::shading::light::environment::EnvironmentLight;
use pathspace_stat::Pcg32;

use super::Case;
use super::modes::Mode;
use crate::bsdf::direction;
use crate::common::{Estimate, options, render};

/// The largest number that samplers give.
const LAST: f32 = 1.0 - f32::EPSILON / 2.0;

/// Records on a floor, of light from `wi` worth `value`.
fn records(n: usize, of: impl Fn(usize) -> (Vec3, f32)) -> Vec<Record> {
    let mut rng = Pcg32::new(17, 1);
    let record = |i: usize| {
        let [x, z]: [f32; 2] = rng.array();
        let (wi, value) = of(i);
        Record { p: Vec3::new(x, 0.0, z), n: Vec3::Y, wi, bsdf_pdf_sa: 0.3, pdf_sa: 0.3, value }
    };
    (0..n).map(record).collect()
}

/// ∫ density over the sphere, by midpoints.
fn integral(pdf: impl Fn(Vec3) -> f32) -> f64 {
    const N: usize = 160;
    let mut sum = 0.0;
    for i in 0..N {
        for j in 0..2 * N {
            let mu = 2.0 * (i as f64 + 0.5) / N as f64 - 1.0;
            let d = direction(mu as f32, (PI * (j as f64 + 0.5) / N as f64) as f32);
            sum += f64::from(pdf(d));
        }
    }
    sum * 4.0 * PI / (2 * N * N) as f64
}

/// Everything that a guide has to be, whatever it has learnt from.
fn judge(case: &mut Case, on: &str, guide: &Guide) {
    let cell = guide.cell(Vec3::new(0.5, 0.0, 0.5), Vec3::Y);
    // Bins are steps, which midpoints resolve to 2 %.
    case.number(format!("{on}: ∫ density"), 1.0, integral(|d| guide.pdf_sa(cell, d)), 2e-2);
    let corners = [0.0, f32::MIN_POSITIVE, 0.25, 0.5, 0.75, LAST];
    let draws = corners.iter().flat_map(|&u| corners.iter().map(move |&v| guide.draw(cell, [u, v])));
    // A draw from the edge of a bin is rounded into it or its neighbour.
    let near = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(|axis| 1e-5 * axis);
    let has_density = |d: Vec3| near.iter().any(|by| [d + *by, d - *by].iter().any(|d| guide.pdf_sa(cell, *d) > 0.0));
    let bad = draws.filter(|d| !((d.length() - 1.0).abs() < 1e-5 && has_density(*d))).count();
    case.count(format!("{on}: draws that are none"), 0, bad as u64);
}

#[test]
fn w01_guide_without_mass() {
    let mut case = Case::open("W01", "guide of cells without mass", "division by a sum of 0");
    let black = records(3000, |i| (direction(1.0 - i as f32 / 3000.0, i as f32), 0.0));
    let mut guide = Guide::learn(&black);
    judge(&mut case, "black", &guide);
    guide.prove(&black);
    case.count("black: cells that guide", 0, guide.cells().1 as u64);
    judge(&mut case, "nothing", &Guide::learn(&[]));
    judge(&mut case, "one record", &Guide::learn(&black[..1]));
    case.close();
}

#[test]
fn w02_guide_of_one_direction() {
    let mut case = Case::open("W02", "guide of one direction", "all mass in a bin, at an edge and at a pole");
    for (name, wi) in [("pole", Vec3::Z), ("far pole", Vec3::NEG_Z), ("edge", Vec3::X), ("fold", Vec3::NEG_Y)] {
        judge(&mut case, name, &Guide::learn(&records(700, |_| (wi, 1.0))));
    }
    case.close();
}

#[test]
fn w03_guide_of_bad_numbers() {
    let mut case = Case::open("W03", "guide of values that are no numbers", "one sample must not rule a guide");
    for (name, value) in [("infinite", f32::INFINITY), ("huge", f32::MAX), ("NaN", f32::NAN), ("tiny", 1e-45)] {
        let mixed = records(1500, |i| (direction(0.5, i as f32), if i == 7 { value } else { 1e-3 }));
        judge(&mut case, name, &Guide::learn(&mixed));
    }
    case.close();
}

#[test]
fn w04_guide_of_one_place() {
    let mut case = Case::open("W04", "guide of records at one point", "medians that part nothing");
    let mut at_one = records(5000, |i| (direction((i % 97) as f32 / 97.0, i as f32), 1.0));
    at_one.iter_mut().for_each(|record| record.p = Vec3::new(0.5, 0.0, 0.5));
    let guide = Guide::learn(&at_one);
    judge(&mut case, "one point", &guide);
    let far = guide.cell(Vec3::splat(f32::MAX), Vec3::Y);
    case.count("cells beyond the last", 0, u64::from(far as usize >= guide.cells().0));
    case.close();
}

const PIXEL: Crop = Crop { x: 0, y: 0, width: 1, height: 1 };

/// 2⁵⁰ units is the largest addition: 8192 of them leave 63 bits. What no longer fits is told.
#[test]
fn w05_splats_that_saturate() {
    let mut case = Case::open("W05", "splats that saturate", "sums beyond 63 bits");
    let largest = (1u64 << 50) as f64;
    let filled = |count: usize| {
        let splats = Splats::new((1, 1), PIXEL, 0);
        (0..count).for_each(|_| splats.add((0, 0), 0, [largest, 0.0, 0.0]));
        splats
    };
    let (some, full) = (filled(8191), filled(8193));
    case.count("8191 of the largest: lost", 0, some.lost());
    case.count("8193 of the largest: told as lost", 1, u64::from(full.lost() > 0));
    let mut joined = filled(5000);
    joined.merge(&filled(5000));
    case.count("two parts that fit alone: told as lost", 1, u64::from(joined.lost() > 0));
    let beyond = Splats::new((1, 1), PIXEL, 0);
    for value in [2.0 * largest, f64::INFINITY, f64::NAN, -2.0 * largest] {
        beyond.add((0, 0), 0, [1.0, value, 1.0]);
    }
    case.count("too large for one addition", 4, beyond.lost());
    case.close();
}

#[test]
fn w06_splats_that_cancel() {
    let mut case = Case::open("W06", "splats that cancel, in any order", "rounding in sums");
    let splats = [Splats::new((1, 1), PIXEL, -30), Splats::new((1, 1), PIXEL, -30)];
    let values: Vec<f64> = (1..2000).map(|i| f64::from(i).recip() * if i % 2 == 0 { 1e5 } else { -3.0 }).collect();
    for &value in &values {
        splats[0].add((0, 0), 1, [value, -value, value]);
        splats[0].add((0, 0), 1, [-value, value, -value]);
    }
    for &value in values.iter().rev() {
        splats[1].add((0, 0), 1, [value, -value, value]);
    }
    for &value in &values {
        splats[1].add((0, 0), 1, [-value, value, -value]);
    }
    case.bits("forwards and backwards", usize::from(splats[0].digest() != splats[1].digest()));
    let nothing = Splats::new((1, 1), PIXEL, -30).digest();
    case.bits("nothing is left", usize::from(splats[0].digest() != nothing));
    case.close();
}

/// A floor under a sky of radiance 1, a mirror beside it, both white: everything shows 1.
fn white(glass: bool) -> SceneBuilder {
    let mut b = SceneBuilder::new();
    let floor = b.lambert(Vec3::ONE);
    b.quad([(-5.0, 5.0), (5.0, 5.0), (5.0, -5.0), (-5.0, -5.0)].map(|(x, z)| Vec3::new(x, 0.0, z)), floor);
    let clear = b.glass(1.5);
    let mirror = b.metal(Vec3::ONE, 0.0);
    b.sphere(Vec3::new(0.3, 0.6, 0.0), 0.5, 12, false, true, if glass { clear } else { mirror });
    b.environment(Environment::constant(Vec3::ONE));
    b.camera(Vec3::new(0.0, 2.0, 3.0), Vec3::new(0.0, 0.3, 0.0), Vec3::Y, 0.5);
    b
}

#[test]
fn w07_light_paths_in_a_furnace() {
    let mut case = Case::open("W07", "light paths in a white furnace", "weights of light paths and the rest");
    for glass in [false, true] {
        let options = options(8, 8, 16).light_paths(LightPaths::Share(1.0));
        case.pictures(&white(glass).build(), &options, [1.0; 3], 1e-4, 0.4);
    }
    case.close();
}

/// Lamps that emit nothing, have no area, or stand nowhere in particular change nothing.
#[test]
fn w08_degenerate_lamps() {
    let mut case = Case::open("W08", "light paths from degenerate lamps", "lamps without area, light or cone");
    type Lamp = (&'static str, fn(&mut SceneBuilder));
    let lamps: [Lamp; 4] = [
        ("black", |b| {
            let black = b.emitter(Vec3::ONE, Vec3::ZERO);
            let corners = [(1.0, 3.0), (2.0, 3.0), (2.0, 4.0), (1.0, 4.0)];
            b.quad(corners.map(|(x, y)| Vec3::new(x, y, 9.0)), black);
        }),
        ("no area", |b| {
            let bright = b.emitter(Vec3::ZERO, Vec3::splat(1e30));
            let p = Vec3::new(0.0, 1.5, 0.5);
            b.triangles(vec![p, p, p + Vec3::X, p + 2.0 * Vec3::X], vec![[0, 1, 2], [0, 2, 3]], bright);
        }),
        ("point of 0", |b| {
            b.point_light(Vec3::new(0.0, 1.5, 0.5), Vec3::ZERO);
        }),
        ("away", |b| {
            // Lights the sky alone.
            let kind = PunctualKind::Spot { cos_inner: 1.0, cos_outer: 1.0 - f32::EPSILON };
            b.punctual(Vec3::new(0.0, 5.0, 0.0), Vec3::Y, Vec3::splat(1e6), kind);
        }),
    ];
    for (name, add) in lamps {
        let mut b = white(false);
        add(&mut b);
        let scene = b.build();
        for mode in Mode::all() {
            let options = mode.options(options(8, 8, 8).light_paths(LightPaths::Share(1.0)));
            let film = render(&scene, options).film;
            let estimate = Estimate::of_pixels(&film);
            case.mean(format!("{}, {name}", mode.name), [1.0; 3], 1e-3, 0.5, &estimate);
        }
    }
    case.close();
}

/// A lamp in contact with a mirror, whose light paths begin where they are aimed at.
#[test]
fn w09_lamp_in_contact() {
    let mut case = Case::open("W09", "light paths from a lamp on its mirror", "aims at a distance of 0");
    let mut b = SceneBuilder::new();
    // A closed room of albedo ½ that emits ½ everywhere, its floor a mirror of ½ that emits ½ as well.
    let wall = b.emitter(Vec3::splat(0.5), Vec3::splat(0.5));
    b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, wall);
    let mirror = b.material(Material {
        base_color: Vec3::splat(0.5),
        roughness: 0.0,
        emissive: Vec3::splat(0.5),
        double_sided: true,
        ..Material::default()
    });
    b.quad([(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)].map(|(x, z)| Vec3::new(x, -0.999, z)), mirror);
    b.camera(Vec3::new(0.1, 0.2, 0.9), Vec3::new(0.0, -0.3, 0.0), Vec3::Y, 1.0);
    let scene = b.build();
    for light_paths in [LightPaths::Off, LightPaths::Share(0.25)] {
        for mode in Mode::all() {
            let film = render(&scene, mode.options(options(12, 12, 12).light_paths(light_paths))).film;
            let nonfinite = film.pixels.iter().flat_map(|p| p.mean()).filter(|v| !v.is_finite()).count();
            case.count(format!("{}, {light_paths:?}: pixels that are none", mode.name), 0, nonfinite as u64);
        }
    }
    case.close();
}

fn sky(width: usize, height: usize, of: impl Fn(usize) -> f32) -> Environment {
    let texels: Vec<Vec3> = (0..width * height).map(|i| Vec3::splat(of(i))).collect();
    Environment { width, height, texels: texels.into(), rotation_rad: 0.4, intensity: 1.0 }
}

/// One texel is a radiance all around, drawn evenly over the sphere.
#[test]
fn w10_environment_of_one_texel() {
    let mut case = Case::open("W10", "environment of one texel", "maps without neighbours");
    let light = EnvironmentLight::new(&sky(1, 1, |_| 2.0)).expect("finite").expect("it shines");
    let directions = [Vec3::X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z, direction(0.3, 2.0)];
    let even = directions.iter().map(|&d| (0.25 / PI, f64::from(light.pdf_sa(d)), 1e-5));
    case.numbers("density", even);
    case.numbers("radiance", directions.iter().map(|&d| (2.0, f64::from(light.radiance(d).x), 1e-6)));
    let corners = [0.0, LAST].map(|u| [0.0, LAST].map(|v| light.sample([u, v])));
    case.numbers("draws", corners.iter().flatten().map(|s| (1.0, f64::from(s.wi.length()), 1e-5)));
    let mut b = SceneBuilder::new();
    let floor = b.lambert(Vec3::splat(0.5));
    b.quad([(-50.0, 50.0), (50.0, 50.0), (50.0, -50.0), (-50.0, -50.0)].map(|(x, z)| Vec3::new(x, 0.0, z)), floor);
    b.environment(sky(1, 1, |_| 2.0));
    b.camera(Vec3::Y * 2.0, Vec3::ZERO, Vec3::Z, 0.5);
    case.pictures(&b.build(), &options(8, 8, 16), [1.0; 3], 1e-3, 0.1);
    case.close();
}

/// Densities of odd maps integrate to 1, whatever their range.
#[test]
fn w11_environments_of_few_texels() {
    let mut case = Case::open("W11", "environments of few texels and wide range", "rows of one texel, 60 decades");
    let maps: [(&str, Environment); 4] = [
        ("1 × 4", sky(1, 4, |i| i as f32)),
        ("4 × 1", sky(4, 1, |i| 1.0 + i as f32)),
        ("2 × 2 of 10⁻³⁰ and 10³⁰", sky(2, 2, |i| if i == 3 { 1e30 } else { 1e-30 })),
        ("64 × 2", sky(64, 2, |i| (i % 3) as f32)),
    ];
    for (name, map) in maps {
        let light = EnvironmentLight::new(&map).expect("finite").expect("it shines");
        case.number(format!("{name}: ∫ density"), 1.0, integral(|d| light.pdf_sa(d)), 2e-2);
    }
    let dark = EnvironmentLight::new(&sky(3, 2, |_| 0.0)).expect("finite").is_none();
    case.count("black ones that shine", 0, u64::from(!dark));
    case.close();
}

/// Faces of two lamps in one place: whoever traces, the same one is seen, wherever they are.
#[test]
fn w12_coincident_lamps() {
    let mut case = Case::open("W12", "coincident faces of different materials", "who is met is a rule, not luck");
    let scene = |shift: Vec3| -> Scene {
        let mut b = SceneBuilder::new();
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 0.0) + shift);
        for color in [Vec3::X, Vec3::Y, Vec3::Z] {
            let lamp = b.emitter(Vec3::ZERO, color);
            b.quad(corners, lamp);
        }
        b.camera(shift + Vec3::new(0.2, 0.1, 3.0), shift, Vec3::Y, 0.4);
        b.build()
    };
    for shift in [Vec3::ZERO, Vec3::new(1000.0, -333.3, 0.7)] {
        let scene = scene(shift);
        let mut first: Option<[f64; 4]> = None;
        for mode in Mode::all() {
            let film = render(&scene, mode.options(options(8, 8, 2))).film;
            let one = *first.get_or_insert_with(|| film.pixels[0].mean());
            let differing = film.pixels.iter().filter(|pixel| pixel.mean() != one).count();
            case.bits(format!("{}, shifted by {}", mode.name, shift.x), differing);
        }
    }
    case.close();
}
