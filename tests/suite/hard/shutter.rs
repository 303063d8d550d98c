//! Motion while the shutter is open (HARDCASES M06): what a pixel shows of a strip that moves past it, and that a
//! shutter of no length is none. Oracle: the time for which a point of the film is covered.

use glam::{Affine3A, Vec3};
use pathspace::film::Film;
use pathspace::plan::Gate;
use pathspace::plan::options::SamplerKind;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Environment, LoadOptions, Projection, Scene, Shutter};
use serde_json::json;

use super::Case;
use super::modes::Mode;
use crate::common::{Estimate, options, render};
use crate::loading::fixture::Fixture;

/// Pixels of the film; a pixel is a metre.
const WIDTH: u32 = 32;
const HEIGHT: u32 = 8;
/// Left edge of the strip when the shutter opens, its width, and how far it moves, pixels.
const LEFT: f64 = 6.0;
const STRIP: f64 = 4.0;
const WAY: f64 = 16.0;

/// A strip of radiance 1, 4 pixels wide, before a camera with parallel rays; `moving` by 16 pixels to the right.
fn strip(moving: bool) -> Scene {
    let mut b = SceneBuilder::new();
    let light = b.emitter(Vec3::ZERO, Vec3::ONE);
    let corners = [(0.0, -9.0), (STRIP as f32, -9.0), (STRIP as f32, 9.0), (0.0, 9.0)];
    let mesh = b.mesh(corners.map(|(x, y)| Vec3::new(x, y, 0.0)).to_vec(), vec![[0, 1, 2], [0, 2, 3]], light);
    let at = |x: f64| Affine3A::from_translation(Vec3::new(x as f32 - 0.5 * WIDTH as f32, 0.0, 0.0));
    if moving {
        b.place_moving(mesh, vec![at(LEFT), at(LEFT + WAY)]);
    } else {
        b.place(mesh, at(LEFT));
    }
    let projection = Projection::Orthographic { xmag_m: 0.5 * WIDTH as f32, ymag_m: 0.5 * HEIGHT as f32 };
    b.any_camera(Vec3::new(0.0, 0.0, 1.0), Vec3::ZERO, Vec3::Y, projection);
    b.build()
}

/// Share of the time for which film position `x` is covered by the strip.
fn covered(x: f64) -> f64 {
    // The left edge is at LEFT + WAY·t, and the strip covers x while that is in (x − STRIP, x).
    let (first, last) = ((x - STRIP - LEFT) / WAY, (x - LEFT) / WAY);
    last.clamp(0.0, 1.0) - first.clamp(0.0, 1.0)
}

#[test]
fn m06_shutter_and_linear_motion() {
    let mut case = Case::open("M06", "Shutter and linear motion", "time sampling");
    let scene = strip(true);
    for mode in Mode::all() {
        let samples = mode.count(1 << 16, 1 << 13) / u64::from(HEIGHT);
        let sampler = SamplerKind::Independent;
        let film = render(&scene, mode.options(options(WIDTH, HEIGHT, samples).sampler(sampler))).film;
        // Rows are repetitions: a column has all samples of the specification. Its pixels are 0 or 1 at a time and a
        // place, so the variance follows from the mean.
        let column = |x: u32| (0..HEIGHT).map(|y| film.pixel(x, y).mean()[1]).sum::<f64>() / f64::from(HEIGHT);
        // Over a pixel the share is linear: no knee lies within one.
        let expected = |x: u32| covered(f64::from(x) + 0.5);
        let n = (samples * u64::from(HEIGHT)) as f64;
        let known = (0..WIDTH)
            .filter(|&x| expected(x) > 0.0)
            .map(|x| (column(x), expected(x), (expected(x) * (1.0 - expected(x)) / n).sqrt()));
        case.picture(format!("{}, columns", mode.name), known);
        let stray = (0..WIDTH).filter(|&x| expected(x) == 0.0 && column(x) != 0.0).count();
        case.count(format!("{}, columns beside the way that see it", mode.name), 0, stray as u64);
        for (name, x) in [("plateau", 16), ("ramp", 7)] {
            let p = expected(x);
            let estimate = Estimate { n, mean: [column(x); 3], variance: [p * (1.0 - p); 3] };
            case.mean(format!("{}, {name}", mode.name), [p; 3], 0.0, mode.count(0.06, 0.2), &estimate);
        }
        let total: f64 = (0..WIDTH).map(column).sum();
        // Columns of a trapezoid: the variance of the sum is that of its columns.
        let variance: f64 = (0..WIDTH).map(|x| expected(x) * (1.0 - expected(x))).sum();
        let estimate = Estimate { n, mean: [total; 3], variance: [variance; 3] };
        case.mean(format!("{}, integral, pixels", mode.name), [STRIP; 3], 0.0, mode.count(0.02, 0.05), &estimate);
    }
    // A shutter of no length is none: through a file, by the pose at that time.
    let file = |translation: &[f32], keys: &[f32]| {
        let mut fixture = Fixture::quad().set("/nodes/0/translation", json!([0.25, 0.0, 0.0]));
        let (input, output) = (fixture.floats(keys, "SCALAR"), fixture.floats(translation, "VEC3"));
        fixture.set(
            "/animations",
            json!([{"samplers": [{"input": input, "output": output}],
            "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}]),
        )
    };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let moving = file(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], &[0.0, 1.0]).write(folder.path());
    let load = |shutter: Option<(f64, f64)>| {
        let shutter = shutter.map(|(open, close)| Shutter::new(open, close).expect("a shutter"));
        let mut scene = Scene::load_with(&moving, &LoadOptions::default().shutter(shutter)).expect("loads");
        scene.environment = Some(Environment::constant(Vec3::ONE));
        scene
    };
    // At rest the node stands where the animation takes it after a quarter of a second.
    let (still, moment, equal) = (load(None), load(Some((0.25, 0.25))), load(Some((1.0, 7.0))));
    for mode in Mode::all() {
        let film = |scene: &Scene, forced: &[Gate]| {
            let options = options(24, 24, 16).forced(forced.to_vec());
            render(scene, mode.options(options)).film
        };
        let differing = |a: &Film, b: &Film| a.pixels.iter().zip(&b.pixels).filter(|(a, b)| a != b).count();
        let plain = film(&still, &[]);
        case.bits(format!("{}, shutter 0.25,0.25", mode.name), differing(&plain, &film(&moment, &[])));
        let forced = differing(&plain, &film(&moment, &Gate::ALL));
        case.bits(format!("{}, every gate forced", mode.name), forced);
        // Behind the last key nothing moves, however long the shutter is open.
        let end = film(&load(Some((1.0, 1.0))), &[]);
        case.bits(format!("{}, equal poses", mode.name), differing(&end, &film(&equal, &[])));
    }
    case.close();
}
