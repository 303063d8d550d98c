//! The guide: its density, agreement of guided and unguided pictures, the same bits however it is run, and what it is
//! worth in a room that is lit round a corner.

use glam::{DVec3, Vec3};
use pathspace::Strategy;
use pathspace::film::Film;
use pathspace::plan::options::{FilterKind, Guiding, LightPaths, RenderOptions};
use pathspace::render::Renderer;
use pathspace::render::checkpoint::{About, Checkpoint};
use pathspace::render::merge::{MergeOptions, merge};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Material, Scene};
use pathspace::shading::directions::Directions;
use pathspace::shading::guide::{Guide, Record};
use pathspace_stat::{Moments, Pcg32, SphereBins, chi2_test, welch};

use crate::common::render;

fn options(side: u32, spp: u64, guiding: Guiding) -> RenderOptions {
    RenderOptions::new(side, side).spp(spp).filter(FilterKind::Box).guiding(guiding).threads(2)
}

/// Two rooms of 2 m behind one another, a wall between them that leaves a gap of 0.4 m at one side, a lamp in the far
/// one. Nothing in the near one sees it.
fn round_a_corner() -> Scene {
    let mut b = SceneBuilder::new();
    let white = b.lambert(Vec3::splat(0.7));
    b.cuboid(Vec3::new(-1.0, 0.0, -2.0), Vec3::new(1.0, 2.0, 2.0), true, white);
    b.cuboid(Vec3::new(-1.1, -0.1, -0.05), Vec3::new(0.6, 2.1, 0.05), false, white);
    let grey =
        b.material(Material { base_color: Vec3::splat(0.5), metallic: 0.0, roughness: 0.5, ..Material::default() });
    b.cuboid(Vec3::new(-0.6, 0.001, 0.5), Vec3::new(-0.1, 0.7, 1.0), false, grey);
    let lamp = b.emitter(Vec3::ZERO, Vec3::new(40.0, 36.0, 30.0));
    let at = |x: f32, z: f32| Vec3::new(-0.6 + x, 1.9, -1.2 + z);
    b.quad([at(-0.15, -0.15), at(0.15, -0.15), at(0.15, 0.15), at(-0.15, 0.15)], lamp);
    b.camera(Vec3::new(0.5, 1.2, 1.9), Vec3::new(-0.4, 0.7, 0.0), Vec3::Y, 1.2);
    b.build()
}

/// A closed box with a lamp that is seen.
fn closed_box() -> Scene {
    let mut b = SceneBuilder::new();
    let (white, red) = (b.lambert(Vec3::splat(0.75)), b.lambert(Vec3::new(0.6, 0.1, 0.1)));
    b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, white);
    b.cuboid(Vec3::new(-0.6, -0.99, -0.5), Vec3::new(0.0, 0.2, 0.1), false, red);
    let coat = b.material(Material { metallic: 0.0, roughness: 0.2, ..Material::default() });
    b.cuboid(Vec3::new(0.2, -0.99, -0.3), Vec3::new(0.7, -0.3, 0.3), false, coat);
    let lamp = b.emitter(Vec3::ZERO, Vec3::new(8.0, 7.0, 5.0));
    let at = |x: f32, z: f32| Vec3::new(x, 0.99, z);
    b.quad([at(-0.3, -0.3), at(0.3, -0.3), at(0.3, 0.3), at(-0.3, 0.3)], lamp);
    b.camera(Vec3::new(0.0, 0.0, 0.95), Vec3::new(0.0, -0.2, 0.0), Vec3::Y, 1.2);
    b.build()
}

/// Records of light from a patch and a little from all around, as a BSDF that is uniform finds them.
fn records(n: usize) -> Vec<Record> {
    let mut rng = Pcg32::new(7, 1);
    let record = |_| {
        let [a, b, c, d, e] = rng.array();
        let wi = pathspace::math::warp::uniform_sphere([a, b]);
        let value = if wi.dot(Vec3::new(0.48, 0.6, 0.64)) > 0.9 { 5.0 } else { 0.1 };
        let pdf_sa = pathspace::math::warp::UNIFORM_SPHERE_PDF;
        Record { p: Vec3::new(c, d, e), n: Vec3::Y, wi, bsdf_pdf_sa: pdf_sa, pdf_sa, value }
    };
    (0..n).map(record).collect()
}

/// Oracle: the density over the sphere integrates to 1, and χ² of draws against it; p > 10⁻⁶ for each of three cells.
#[test]
fn draws_have_the_density() {
    let guide = Guide::learn(&records(8000));
    let grid = SphereBins::sphere();
    for (stream, p) in [Vec3::splat(0.1), Vec3::new(0.9, 0.2, 0.5), Vec3::splat(3.0)].into_iter().enumerate() {
        let cell = guide.cell(p, Vec3::Y);
        let mut rng = Pcg32::new(11, stream as u64);
        let n = 1 << 17;
        let observed = grid.observe(n, || Some(guide.draw(cell, rng.array()).as_dvec3().to_array()));
        let density = |d: [f64; 3]| f64::from(guide.pdf_sa(cell, DVec3::from(d).as_vec3()));
        let expected = grid.expect(n, &density);
        let whole = expected[..expected.len() - 1].iter().sum::<f64>() / n as f64;
        assert!((whole - 1.0).abs() < 2e-3, "cell {cell}: the density integrates to {whole}");
        let test = chi2_test(&observed, &expected);
        assert!(test.p_value > 1e-6, "cell {cell}: {test:?}");
        let towards = guide.pdf_sa(cell, Vec3::new(0.48, 0.6, 0.64));
        assert!(towards > 0.5, "{towards} /sr towards the light");
    }
}

/// A share is taken where it lowers the second moment of other records, and not where the BSDF does as well. Oracle:
/// by hand.
#[test]
fn shares_are_proven() {
    let learnt = Guide::learn(&records(4000));
    let mut proven = learnt.clone();
    proven.prove(&records(3000));
    assert_eq!(proven.cells().1, proven.cells().0 - 5, "all cells that have records");
    let even: Vec<Record> = records(3000).into_iter().map(|record| Record { value: 1.0, ..record }).collect();
    let mut proven = learnt;
    proven.prove(&even);
    assert_eq!(proven.cells().1, 0);
}

/// Means of R, G and B over the whole picture.
fn means(film: &Film) -> [f64; 3] {
    let [r, g, b, _] = film.mean();
    [r, g, b]
}

/// Two ways to one number. Oracle: the picture without, by Welch's t over 16 seeds and three channels (10⁻⁵ for all);
/// the test says how small a bias it could have seen.
#[track_caller]
fn agree(name: &str, scene: &Scene, base: RenderOptions) {
    let of = |guiding| -> [Moments; 3] {
        let mut moments = [Moments::default(); 3];
        let mut renderer = Renderer::new(scene, base.clone().guiding(guiding)).expect("valid options");
        assert_eq!(renderer.plan().features.guide, guiding == Guiding::On, "{}", renderer.plan().guide_reason);
        for seed in 0..16 {
            renderer.set_seed(seed);
            let found = means(&renderer.render().expect("a render").film);
            moments.iter_mut().zip(found).for_each(|(moments, mean)| moments.push(mean));
        }
        moments
    };
    let (without, with) = (of(Guiding::Off), of(Guiding::On));
    for (a, b) in without.iter().zip(&with) {
        let test = welch(a, b);
        assert!(test.p_value > 3e-6, "{name}: {} without, {} with a guide, {test:?}", a.mean, b.mean);
        println!("{name}: {} ± {:.1e}, {} ± {:.1e}", a.mean, a.standard_error(), b.mean, b.standard_error());
    }
}

#[test]
fn a_closed_box_keeps_its_light() {
    agree("box", &closed_box(), options(8, 64, Guiding::Off));
}

/// A closed box with a mirror ball.
fn lit_by_a_mirror() -> Scene {
    let mut b = SceneBuilder::new();
    let white = b.lambert(Vec3::splat(0.7));
    b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, white);
    let mirror = b.metal(Vec3::splat(0.9), 0.0);
    b.sphere(Vec3::new(-0.3, -0.4, 0.0), 0.4, 16, false, true, mirror);
    let lamp = b.emitter(Vec3::ZERO, Vec3::splat(20.0));
    let at = |x: f32, z: f32| Vec3::new(x, 0.99, z);
    b.quad([at(0.3, -0.3), at(0.7, -0.3), at(0.7, 0.3), at(0.3, 0.3)], lamp);
    b.camera(Vec3::new(0.0, 0.0, 0.95), Vec3::new(0.0, -0.4, 0.0), Vec3::Y, 1.2);
    b.build()
}

/// What light paths find as well is weighed by the density of both.
#[test]
fn light_paths_know_the_guide() {
    let options = options(8, 64, Guiding::Off).light_paths(LightPaths::Share(1.0));
    agree("light paths", &lit_by_a_mirror(), options);
}

/// A closed box of five white walls and a black one that emits 1: the radiance is 1 everywhere, whatever the guide does
/// (which here turns paths away from the lamp that light samples find). Oracle: by hand, within 4.9 standard errors of
/// the mean of 16 seeds; and it could have seen 5 %.
#[test]
fn a_white_furnace_is_white() {
    let mut b = SceneBuilder::new();
    let (white, lamp) = (b.lambert(Vec3::ONE), b.emitter(Vec3::ZERO, Vec3::ONE));
    b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, white);
    let at = |y: f32, z: f32| Vec3::new(0.99, y, z);
    b.quad([at(-1.0, -1.0), at(-1.0, 1.0), at(1.0, 1.0), at(1.0, -1.0)], lamp);
    b.camera(Vec3::new(0.0, 0.1, 0.9), Vec3::new(-0.5, -0.2, 0.0), Vec3::Y, 1.2);
    let scene = b.build();
    let mut renderer = Renderer::new(&scene, options(8, 16, Guiding::On)).expect("valid options");
    println!("{:?}: {}", renderer.plan().guide, renderer.plan().guide_reason);
    let mut moments = Moments::default();
    for seed in 0..16 {
        renderer.set_seed(seed);
        moments.push(means(&renderer.render().expect("a render").film)[0]);
    }
    let (mean, error) = (moments.mean, moments.standard_error());
    assert!((mean - 1.0).abs() < 4.9 * error + 1e-5 && error < 1e-2, "{mean} ± {error}");
}

/// The guide and the picture are the same for one, two and three threads, for a render that is stopped and resumed, and
/// for parts that are merged; a part with another guide is refused. Deterministic.
#[test]
fn bits_are_those_of_one_render() {
    let scene = round_a_corner();
    let options = options(8, 8, Guiding::On).seed(3);
    let made = |options: RenderOptions| Renderer::new(&scene, options).expect("valid options");
    let renderer = made(options.clone());
    let guide = renderer.plan().guide.expect("it pays");
    assert!(guide.guiding > 0 && guide.cells >= guide.guiding);
    let whole = renderer.render().expect("a render").film;
    assert_ne!(whole.hash(), render(&scene, options.clone().guiding(Guiding::Off)).film.hash());
    for threads in [1, 3] {
        let renderer = made(options.clone().threads(threads));
        assert_eq!(renderer.plan().guide, Some(guide));
        assert_eq!(whole.hash(), renderer.render().expect("a render").film.hash());
    }
    assert_eq!(made(options.clone().seed(4).spp(2)).plan().guide, Some(guide));

    let folder = tempfile::tempdir().expect("a temporary folder");
    let save = |(number, (first, spp, guiding)): (usize, (u64, u64, Guiding))| {
        let renderer = made(options.clone().sample_start(first).spp(spp).guiding(guiding));
        let checkpoint = Checkpoint::new(renderer.render().expect("a render"), About::of(&renderer).expect("a scene"));
        let path = folder.path().join(number.to_string());
        checkpoint.save(&path).expect("a writable folder");
        path
    };
    let parts = [(0, 4, Guiding::On), (4, 4, Guiding::On), (4, 4, Guiding::Off)];
    let paths: Vec<_> = parts.into_iter().enumerate().map(save).collect();
    let merged = merge(&paths[..2], &MergeOptions::default()).expect("parts of one picture");
    assert_eq!(whole.hash(), merged.render.film.hash());
    let refused =
        merge(&[paths[0].clone(), paths[2].clone()], &MergeOptions::default()).map(|_| ()).map_err(|e| e.to_string());
    assert!(matches!(&refused, Err(why) if why.contains("guide")), "{refused:?}");
}

/// A guide that a survey's file keeps is the one that is learnt without it, for other seeds as well; one of other
/// settings is refused by name. Oracle: the guide that is not kept; by hand.
#[test]
fn guides_are_kept_in_files() {
    let scene = round_a_corner();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("rooms.survey");
    let options = options(8, 2, Guiding::On);
    let made = |options: RenderOptions| Renderer::new(&scene, options).map_err(|error| error.to_string());
    let fresh = made(options.clone()).expect("valid options");
    let guide = fresh.plan().guide;
    assert!(guide.is_some(), "{}", fresh.plan().guide_reason);
    for _ in 0..2 {
        let kept = made(options.clone().survey(file.clone())).expect("made, then read");
        assert_eq!((kept.plan().guide, &kept.plan().guide_reason), (guide, &fresh.plan().guide_reason));
        assert_eq!(kept.plan().survey.as_deref(), Some("rooms.survey"));
        assert_eq!(kept.render().expect("a render").film.hash(), fresh.render().expect("a render").film.hash());
    }
    let bytes = std::fs::read(&file).expect("a survey");
    assert_eq!(made(options.clone().seed(5).survey(file.clone())).expect("read").plan().guide, guide);
    assert_eq!(std::fs::read(&file).expect("a survey"), bytes, "nothing is new");
    let refused = made(options.clone().max_depth(5).survey(file.clone())).map(|_| ()).expect_err("other paths");
    assert!(refused.contains("--survey") && refused.contains("max-depth"), "{refused}");
    let large = RenderOptions::new(256, 256).filter(FilterKind::Box).survey(file.clone());
    assert!(made(large).is_err_and(|why| why.contains("its size is 8x8")));
}

/// What a file lacks is added to it, and what it has is kept: light paths first, then a guide that knows of them, which
/// a render with other light paths does not get. Oracle: by hand.
#[test]
fn surveys_grow() {
    let scene = lit_by_a_mirror();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("survey");
    let plain = |guiding| options(8, 1, guiding);
    let options = |guiding| plain(guiding).survey(file.clone());
    let made = |options: RenderOptions| Renderer::new(&scene, options).map_err(|error| error.to_string());
    let first = made(options(Guiding::Off)).expect("valid options").plan().light_paths;
    let small = std::fs::metadata(&file).expect("a survey").len();
    let both = made(options(Guiding::On)).expect("valid options");
    let fresh = made(plain(Guiding::On)).expect("valid options");
    assert_eq!((both.plan().light_paths, both.plan().guide), (first, fresh.plan().guide));
    assert!(std::fs::metadata(&file).expect("a survey").len() > small);
    let other = made(options(Guiding::On).light_paths(LightPaths::Share(1.0 / 32.0))).map(|_| ()).expect_err("others");
    assert!(other.contains("its light-paths is") && other.contains("here it is 0.03125"), "{other}");
    assert!(made(options(Guiding::Off)).is_ok());
}

/// A guided path is replayed with the bits of the film, and says what drew its directions.
#[test]
fn replays_tell_of_the_guide() {
    let scene = round_a_corner();
    let renderer = Renderer::new(&scene, options(8, 1, Guiding::On)).expect("valid options");
    let film = renderer.render().expect("a render").film;
    let mut told = 0;
    for (x, y) in (0..64).map(|i| (i % 8, i / 8)) {
        let replay = renderer.replay((x, y), 0).expect("a pixel");
        assert_eq!(replay.film[..3], film.pixel(x, y).sum[0][..3]);
        assert_eq!(replay.told(), replay.radiance.map(|c| c.0));
        let lobes = replay.vertices.iter().filter_map(|vertex| vertex.scattering.as_ref());
        told += lobes.filter(|scattering| scattering.lobe == "guide").count();
    }
    assert!(told > 20, "{told} directions of the guide");
}

/// Relative variance over 8 seeds, of the mean of all of them, times rays.
fn cost(scene: &Scene, guiding: Guiding) -> f64 {
    let mut renderer = Renderer::new(scene, options(16, 16, guiding)).expect("valid options");
    let plan = renderer.plan();
    println!("{} light paths; {:?}: {}", plan.light_paths, plan.guide, plan.guide_reason);
    let (mut rays, mut pixels) = (0, vec![Moments::default(); 256]);
    for seed in 0..8 {
        renderer.set_seed(seed);
        let render = renderer.render().expect("a render");
        rays += render.counters.rays();
        for (moments, pixel) in pixels.iter_mut().zip(&render.film.pixels) {
            moments.push(pixel.mean()[..3].iter().sum::<f64>() / 3.0);
        }
    }
    let mean = pixels.iter().map(|pixel| pixel.mean).sum::<f64>() / 256.0;
    let of = |pixel: &Moments| pixel.variance() / (pixel.mean * pixel.mean + 0.01 * mean * mean);
    let variance = pixels.iter().map(of).sum::<f64>();
    println!("relative variance {:.4}, rays {rays}", variance / 256.0);
    variance * rays as f64
}

/// A room lit round a corner is cheaper. Measured is the relative variance over 8 seeds times rays; the oracle is what
/// was measured when the guide was made.
#[test]
fn a_room_round_a_corner_is_cheaper() {
    let scene = round_a_corner();
    let (without, with) = (cost(&scene, Guiding::Off), cost(&scene, Guiding::On));
    println!("a guide leaves {:.2}", with / without);
    assert!(with < 0.8 * without, "it leaves {:.2}", with / without);
}

/// Oracle: by hand.
#[test]
fn plans_say_why_there_is_a_guide_or_none() {
    let scene = closed_box();
    let said = |options: RenderOptions| {
        let renderer = Renderer::new(&scene, options).expect("valid options");
        assert!(!renderer.plan().features.guide && renderer.plan().guide.is_none());
        renderer.plan().guide_reason.clone()
    };
    assert_eq!(said(options(8, 1, Guiding::Off)), "not asked for");
    assert_eq!(said(options(8, 1, Guiding::Auto)), "the picture is too small for a survey");
    assert_eq!(said(options(256, 1, Guiding::Auto).strategy(Strategy::BSDF)), "the strategy leaves it out");
    assert_eq!(said(options(8, 1, Guiding::On).max_depth(2)), "paths have two edges at most");
}
