//! Where the noise comes from: classes of paths add up to the picture and to its variance, and mean the same to every
//! technique.
//!
//! Oracles: the films of the same seeds (exact to rounding); scenes that have one class alone; strategies against each
//! other (two ways to one number). Seeds are fixed.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use glam::Vec3;
use pathspace::plan::options::{Fog, RenderOptions, Strategy};
use pathspace::render::Renderer;
use pathspace::scene::Scene;
use pathspace::scene::builder::SceneBuilder;
use pathspace::study::class::{self, Class};
use pathspace::study::classes::{Classes, Part};
use pathspace::study::measure::{self, Request};
use pathspace::study::reference::{Reference, values};
use pathspace::study::report::{Report, Setup};
use pathspace::study::{html, table};

use crate::common::{options, render};

/// A room with a lamp, a mirror ball and a glass ball: every class but the volume's. Lobes are diffuse or smooth, so
/// that a path has one class whoever finds it.
fn room() -> Scene {
    let mut b = SceneBuilder::new();
    let white = b.lambert(Vec3::new(0.7, 0.6, 0.5));
    let lamp = b.emitter(Vec3::splat(0.2), Vec3::splat(4.0));
    let (mirror, glass) = (b.metal(Vec3::splat(0.95), 0.0), b.glass(1.5));
    b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, white);
    b.quad([[-0.8, 0.99, -0.8], [0.8, 0.99, -0.8], [0.8, 0.99, 0.8], [-0.8, 0.99, 0.8]].map(Vec3::from), lamp);
    b.sphere(Vec3::new(-0.45, -0.5, -0.4), 0.45, 12, false, true, mirror);
    b.sphere(Vec3::new(0.45, -0.5, -0.4), 0.45, 12, false, true, glass);
    b.camera(Vec3::new(0.0, 0.0, 0.95), Vec3::new(0.0, 0.1, 0.0), Vec3::Y, 1.1);
    b.build()
}

/// The classes of all pixels of a picture, measured against a render of its own; with the report.
fn classes_of(scene: &Scene, base: RenderOptions) -> (Classes, Report, String) {
    let film = render(scene, base.clone().spp(256).seed(77)).film;
    let truth = values(&film).into_iter().map(f64::from).collect();
    let request = Request {
        // All of the study's own runs are beyond the budget.
        budget: Duration::from_nanos(1),
        full: false,
        reference: Some(Reference::of_values(truth, None)),
        effects: false,
        classes: Some(1 << 24),
        load_s: 0.0,
        base,
    };
    let study = measure::run(scene, &request, Instant::now(), &mut |_| ControlFlow::Continue(()))
        .unwrap_or_else(|error| panic!("{error}"));
    let report = Report::new(&study, Setup { resolution: [8, 8], ..Setup::default() }, None);
    let page = html::page(&report, &study);
    (study.classes.expect("there is a reference"), report, page)
}

fn part(classes: &Classes, class: Class) -> &Part {
    &classes.classes[class as usize]
}

/// Exact: each pixel's classes add up to the film's pixel and shares to 1; the variance over seeds is that of films.
#[test]
fn classes_add_up_to_the_picture_and_to_its_variance() {
    let (classes, report, page) = classes_of(&room(), options(8, 8, 1));
    assert_eq!((classes.pixels, classes.paths), (64, 64 * 256));
    assert!(classes.rounding < 1e-6, "{}", classes.rounding);
    assert!((classes.relmse.value / classes.relmse_of_all - 1.0).abs() < 1e-5, "{classes:?}");
    for parts in [&classes.classes, &classes.edges] {
        let sum = |of: &dyn Fn(&Part) -> f64| parts.iter().map(of).sum::<f64>();
        assert!((sum(&|part| part.noise.value) - 1.0).abs() < 1e-9, "{parts:?}");
        assert!((sum(&|part| part.mean) - 1.0).abs() < 1e-9, "{parts:?}");
        assert!(parts.iter().all(|part| (0.0..=1.0).contains(&part.worst) && part.alone >= 0.0), "{parts:?}");
    }
    // All but media, and each is told.
    for class in Class::ALL {
        let found = part(&classes, class);
        assert_eq!(found.mean > 0.0, class != Class::Volume, "{found:?}");
        assert!(page.contains(class.told().0));
        assert_eq!(table::text(&report).contains(class.told().1), found.mean > 5e-5, "{found:?}");
    }
    let json = serde_json::to_value(&report).expect("a record");
    assert_eq!(json["classes"]["classes"].as_array().map(Vec::len), Some(Class::ALL.len()));
}

/// Oracle: what there is to see. Exact.
#[test]
fn scenes_of_one_class_have_no_other() {
    let shares = |scene: &Scene, base: RenderOptions| {
        let (classes, ..) = classes_of(scene, base);
        Class::ALL.map(|class| part(&classes, class).mean)
    };
    // A floor under a lamp that is not in the picture, seen directly and in a mirror.
    let floor = |mirrored: bool| {
        let mut b = SceneBuilder::new();
        let (white, lamp) = (b.lambert(Vec3::splat(0.5)), b.emitter(Vec3::ZERO, Vec3::ONE));
        let mirror = b.metal(Vec3::splat(0.9), 0.0);
        let square = |y: f32, r: f32| [[-r, y, r], [r, y, r], [r, y, -r], [-r, y, -r]].map(Vec3::from);
        let mut down = square(3.0, 0.5);
        down.reverse();
        b.quad(square(0.0, 9.0), white);
        b.quad(down, lamp);
        if mirrored {
            b.quad(
                [[-9.0, -9.0, -2.0], [9.0, -9.0, -2.0], [9.0, 0.5, -2.0], [-9.0, 0.5, -2.0]].map(Vec3::from),
                mirror,
            );
        }
        let eye = Vec3::new(0.0, 0.5, 2.0);
        b.camera(eye, if mirrored { Vec3::new(0.0, 0.2, -2.0) } else { Vec3::ZERO }, Vec3::Y, 0.05);
        b.build()
    };
    let direct = shares(&floor(false), options(4, 4, 1));
    assert_eq!((direct[Class::Direct as usize], direct.iter().sum::<f64>()), (1.0, 1.0), "{direct:?}");
    let through = shares(&floor(true), options(4, 4, 1).max_depth(3));
    assert_eq!(through[Class::DirectThrough as usize], 1.0, "{through:?}");
    // Nothing but fog and a lamp behind it.
    let fog = Some(Fog { sigma_t: 0.5, albedo: 0.9, g: 0.2 });
    let fogged = shares(&floor(false), options(4, 4, 1).fog(fog));
    assert!(fogged[Class::Volume as usize] > 0.1 && fogged[Class::Direct as usize] > 0.1, "{fogged:?}");
    assert!((fogged.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{fogged:?}");
}

/// Means of R, G and B by class over all samples of a picture, and their standard errors.
fn means(scene: &Scene, options: RenderOptions, spp: u64) -> [(f64, f64); Class::ALL.len()] {
    let (width, height) = (options.width, options.height);
    let renderer = Renderer::new(scene, options).expect("valid options");
    let (mut sums, mut squares) = ([0.0; Class::ALL.len()], [0.0; Class::ALL.len()]);
    for place in 0..width * height {
        for sample in 0..spp {
            let replay = renderer.replay((place % width, place / width), sample).expect("a pixel of the picture");
            let mut of_sample = [0.0; Class::ALL.len()];
            class::contributions(&replay, |found| {
                of_sample[found.class as usize] += found.radiance.iter().map(|&c| f64::from(c)).sum::<f64>() / 3.0;
            });
            for (class, value) in of_sample.into_iter().enumerate() {
                sums[class] += value;
                squares[class] += value * value;
            }
        }
    }
    let n = f64::from(width * height) * spp as f64;
    std::array::from_fn(|class| {
        let mean = sums[class] / n;
        (mean, ((squares[class] / n - mean * mean) / n).sqrt())
    })
}

/// What a class carries does not depend on how its paths are found. Oracle: MIS against each technique alone; 4.9
/// standard errors (10⁻⁶ each; smaller than that with Sobol' points), 16 comparisons. Whether indirect light counts as
/// blocked depends on light samples by definition: there the sum is compared.
#[test]
fn classes_mean_the_same_to_every_technique() {
    let scene = room();
    let found = |strategy| {
        let mut means = means(&scene, options(10, 10, 1).strategy(strategy).max_depth(6), 256);
        let (open, blocked) = (means[Class::Indirect as usize], means[Class::IndirectBlocked as usize]);
        means[Class::Indirect as usize] = (open.0 + blocked.0, open.1.hypot(blocked.1));
        means
    };
    let mis = found(Strategy::MIS);
    for strategy in [Strategy::BSDF, Strategy::LIGHT] {
        let alone = found(strategy);
        for class in Class::ALL {
            if class == Class::IndirectBlocked {
                continue;
            }
            let ((a, error_a), (b, error_b)) = (mis[class as usize], alone[class as usize]);
            let allowed = 4.9 * error_a.hypot(error_b);
            assert!((a - b).abs() <= allowed, "{class:?} by {}: {b} for {a}, ± {allowed}", strategy.name());
            // A class that were missing would be missed.
            assert!(class == Class::Volume || allowed < a, "{class:?}: {a} ± {allowed}");
        }
    }
}

/// Oracle: the sample, bit for bit.
#[test]
fn contributions_are_those_of_the_sample() {
    let scene = room();
    let renderer = Renderer::new(&scene, options(8, 8, 1)).expect("valid options");
    for place in 0..64 {
        let replay = renderer.replay((place % 8, place / 8), 3).expect("a pixel of the picture");
        let mut sum = [0.0f32; 3];
        class::contributions(&replay, |found| (0..3).for_each(|c| sum[c] += found.radiance[c]));
        assert_eq!(sum.map(f32::to_bits), replay.radiance.map(|c| c.0.to_bits()), "{replay:#?}");
    }
}
