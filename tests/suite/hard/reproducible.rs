//! Same input, same bits (HARDCASES R04, R05): over threads, tiles and windows, and when a render is cut into parts.

use glam::Vec3;
use pathspace::plan::options::{Crop, Lens};
use pathspace::render::Renderer;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Environment, Scene};

use super::Case;
use super::glass::ball;
use super::modes::Mode;
use crate::common::{options, render};
use crate::determinism::room;

/// A diffuse ball under a sun of 10⁶ : 1 in one texel of a map.
fn sunny() -> Scene {
    let mut b = SceneBuilder::new();
    let grey = b.lambert(Vec3::splat(0.6));
    b.sphere(Vec3::ZERO, 1.0, 12, false, true, grey);
    let mut texels = vec![Vec3::splat(0.1); 32 * 16];
    texels[4 * 32 + 20] = Vec3::splat(1e5);
    b.environment(Environment { width: 32, height: 16, texels: texels.into(), rotation_rad: 0.3, intensity: 1.0 });
    b.camera(Vec3::new(1.0, 0.5, 3.0), Vec3::ZERO, Vec3::Y, 0.7);
    b.build()
}

/// 128 × 128 with 4 samples a pixel in the main mode. Tiles are 16 pixels wide, counted from the window's corner:
/// windows at other corners cut the picture into other tiles.
#[test]
fn r04_threads_and_tiles() {
    let mut case = Case::open("R04", "Bit identity over threads and tiles", "determinism");
    let lens = Some(Lens { radius_m: 0.02, focus_m: 1.2 });
    let scenes = [
        ("room", room(), None),
        ("sun", sunny(), None),
        ("glass ball", ball(24, 0.0, 1.1), None),
        ("room, lens", room(), lens),
    ];
    for mode in Mode::all() {
        let (side, spp) = if mode.is_brute() { (21, 1) } else { mode.count((128, 4), (40, 2)) };
        let threads: &[usize] = mode.count(&[2, 3, 8, 64], &[3]);
        let (mut films, mut counts, mut windows) = (0, 0, 0);
        for (_, scene, lens) in &scenes {
            let run = |threads, crop| {
                let options = options(side, side, spp).threads(threads).crop(crop).lens(*lens);
                render(scene, mode.options(options))
            };
            let one = run(1, None);
            for &threads in threads {
                let other = run(threads, None);
                films += one.film.pixels.iter().zip(&other.film.pixels).filter(|(a, b)| a != b).count();
                films += usize::from(one.film.hash() != other.film.hash());
                counts += usize::from(one.counters != other.counters);
            }
            for (x, y) in [(1, 0), (5, 9), (8, 8)] {
                let crop = Crop { x, y, width: side - x - 3, height: side - y - 1 };
                let part = run(2, Some(crop)).film;
                let place = (0..crop.width * crop.height).map(|i| (i % crop.width, i / crop.width));
                windows += place.filter(|&(i, j)| part.pixel(i, j) != one.film.pixel(x + i, y + j)).count();
            }
        }
        case.bits(format!("{}, films, 1 and {threads:?} threads", mode.name), films);
        case.bits(format!("{}, counters", mode.name), counts);
        case.bits(format!("{}, other tiles", mode.name), windows);
    }
    case.close();
}

/// A resumed render goes on with the sums that there are. Parts are merged by adding sums of f32 samples in f64, which
/// loses no bit while they span less than 29 binary digits less those of the count; here and in most pictures they do.
#[test]
fn r05_resume_and_split_runs() {
    let mut case = Case::open("R05", "Resume and split runs", "64 spp = 32 + 32");
    let scene = room();
    for mode in Mode::all() {
        let side = if mode.is_brute() { 6 } else { mode.count(32, 16) };
        let run = |sample_start, spp| render(&scene, mode.options(options(side, side, spp).sample_start(sample_start)));
        let whole = run(0, 64);
        // From a checkpoint.
        let options = mode.options(options(side, side, 64));
        let resumed =
            Renderer::new(&scene, options).and_then(|r| r.resume(run(0, 32))).unwrap_or_else(|e| panic!("{e}"));
        let differing =
            |film: &pathspace::film::Film| film.pixels.iter().zip(&whole.film.pixels).filter(|(a, b)| a != b).count();
        case.bits(format!("{}, resumed, sums of both halves", mode.name), differing(&resumed.film));
        case.bits(format!("{}, resumed, counters", mode.name), usize::from(resumed.counters != whole.counters));
        // By two processes.
        let (mut first, second) = (run(0, 32), run(32, 32));
        first.film.merge(&second.film).expect("the same picture");
        first.counters.merge(&second.counters);
        case.bits(format!("{}, merged, sums of both halves", mode.name), differing(&first.film));
        case.bits(format!("{}, merged, counters", mode.name), usize::from(first.counters != whole.counters));
    }
    // What cannot be gone on with is refused.
    let earlier = render(&scene, options(8, 8, 2));
    let taken = Renderer::new(&scene, options(8, 9, 4)).expect("valid options").resume(earlier).is_ok();
    case.count("another size: resumed", 0, u64::from(taken));
    case.close();
}
