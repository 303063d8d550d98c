//! Does a render know its error? The film's variance against the variance over seeds, the coverage of the intervals,
//! and how often `--error` keeps its promise, on the six scenes at thumbnail size.
//!
//! The truth is the mean over the seeds themselves: against it the squared deviation of one of S pictures is (1 −
//! 1/S) of what it is against the converged picture, which is taken into account. Verdicts are those of fixed seeds;
//! what a redraw of all random numbers would do is said at each test.
//!
//! `PATHSPACE_ESTIMATE_TABLE=1 cargo test --test suite estimate:: -- --nocapture` prints the tables.

use std::path::Path;

use pathspace::accuracy::predict;
use pathspace::film::Film;
use pathspace::film::estimate::{ErrorEstimate, RELMSE_EPSILON};
use pathspace::render::{Render, RenderOptions, Renderer, SamplerKind, StopReason};
use pathspace::sampler::{IndependentScheme, Scheme, SobolScheme, pixel_seed};
use pathspace::scene::Scene;

use crate::common::shared;

/// The six shared scenes.
const SCENES: [&str; 6] = ["cornell-box", "veach-mis", "glass-caustics", "many-lights", "env-object", "interior"];

/// One of [`SCENES`]; `None` with a message where its file is not at hand.
fn scene(name: &str) -> Option<Scene> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    let mut path = folder.join("scene.gltf");
    if !path.exists() {
        path = shared(name)?.join("scenes").join(format!("{name}.gltf"));
    }
    let mut scene = Scene::load(&path).unwrap_or_else(|e| panic!("{e}"));
    let environment = folder.join("env.exr");
    if environment.exists() {
        scene.load_environment(&environment, 0.0, 1.0).unwrap_or_else(|e| panic!("{e}"));
    }
    Some(scene)
}

fn film_of(renderer: &mut Renderer, seed: u64) -> Film {
    renderer.set_seed(seed);
    renderer.render().unwrap_or_else(|e| panic!("{e}")).film
}

fn rgb(film: &Film) -> Vec<[f64; 3]> {
    film.pixels.iter().map(|p| p.mean()).map(|[r, g, b, _]| [r, g, b]).collect()
}

/// relMSE of `image` against `reference`.
fn relmse(image: &[[f64; 3]], reference: &[[f64; 3]]) -> f64 {
    let count = 3.0 * reference.len() as f64;
    let epsilon = RELMSE_EPSILON * (reference.iter().flatten().sum::<f64>() / count).powi(2);
    let one = |(i, r): (&f64, &f64)| (i - r).powi(2) / (r * r + epsilon);
    image.iter().flatten().zip(reference.iter().flatten()).map(one).sum::<f64>() / count
}

/// Pixelwise mean.
fn mean_of(images: &[Vec<[f64; 3]>]) -> Vec<[f64; 3]> {
    let mut mean = vec![[0.0; 3]; images[0].len()];
    for image in images {
        for (sum, value) in mean.iter_mut().zip(image) {
            for c in 0..3 {
                sum[c] += value[c] / images.len() as f64;
            }
        }
    }
    mean
}

fn table(line: impl std::fmt::Display) {
    if std::env::var_os("PATHSPACE_ESTIMATE_TABLE").is_some() {
        eprintln!("{line}");
    }
}

/// Oracle: ∫∫ 4xy = 1. The mean of 64 points of a smooth integrand, 4096 times: the film's rule on two scrambles,
/// and the formula for independent samples. Both estimate the variance over the repetitions of independent samples; of
/// Sobol' points the first does, the second is off by more than a factor of ten. Relative standard errors of the two
/// sides are √(2/4096) = 2.2 % each (more for Sobol', whose sums are not normal); within 20 %: no false alarm to
/// speak of.
#[test]
fn independent_formula_fails_for_sobol_points_and_halves_do_not() {
    fn ratios<S: Scheme>() -> [f64; 2] {
        let (pixels, n) = (4096u64, 32u32);
        let (mut truth, mut halves, mut formula) = (0.0, 0.0, 0.0);
        for pixel in 0..pixels {
            let mut sums = [0.0f64; 2];
            let mut squares = 0.0;
            for (half, sum) in sums.iter_mut().enumerate() {
                let seed = pixel_seed(5, pixel, half as u32, 0);
                for index in 0..n {
                    let u = S::sample_4d(index, seed, 0);
                    let value = 4.0 * f64::from(u[0]) * f64::from(u[1]);
                    *sum += value;
                    squares += value * value;
                }
            }
            let count = f64::from(2 * n);
            let mean = (sums[0] + sums[1]) / count;
            truth += (mean - 1.0).powi(2);
            halves += ((sums[0] - sums[1]) / f64::from(n)).powi(2) / 4.0;
            formula += (squares - count * mean * mean) / (count - 1.0) / count;
        }
        [halves / truth, formula / truth]
    }
    let [halves, formula] = ratios::<IndependentScheme>();
    assert!((halves - 1.0).abs() < 0.2 && (formula - 1.0).abs() < 0.2, "{halves} {formula}");
    let [halves, formula] = ratios::<SobolScheme>();
    assert!((halves - 1.0).abs() < 0.2, "{halves}");
    assert!(formula > 10.0, "{formula}");
}

/// The same through the whole renderer, on the Cornell box. Oracle: the variance of a pixel over 120 seeds, summed over
/// 144 pixels. What the formula for independent samples says is known from films of 2 samples, whose halves are one
/// sample each. The ratio to the film's variance is known to some 5 % from the spread over seeds.
#[test]
fn the_film_s_variance_is_that_over_seeds() {
    let scene = scene("cornell-box").expect("it is in the repository");
    let total = |spp: u64, sampler: SamplerKind| {
        let options = RenderOptions::new(12, 12).spp(spp).sampler(sampler);
        let mut renderer = Renderer::new(&scene, options).unwrap_or_else(|e| panic!("{e}"));
        let films: Vec<Film> = (0..120).map(|seed| film_of(&mut renderer, seed)).collect();
        let images: Vec<_> = films.iter().map(rgb).collect();
        let mean = mean_of(&images);
        let seeds = films.len() as f64;
        let squares = images.iter().flat_map(|image| image.iter().zip(&mean)).map(|(i, m)| (i[1] - m[1]).powi(2));
        let own = |film: &Film| film.pixels.iter().map(|p| p.variance().expect("two halves")[1]).sum::<f64>();
        (squares.sum::<f64>() / (seeds - 1.0), films.iter().map(own).sum::<f64>() / seeds)
    };
    let (_, of_two) = total(2, SamplerKind::Sobol);
    let formula = of_two * 2.0 / 256.0;
    let (truth, film) = total(256, SamplerKind::Sobol);
    table(format_args!("variance: film {:.3}, formula {:.3} of that over seeds", film / truth, formula / truth));
    assert!((film / truth - 1.0).abs() < 0.2, "{film} {truth}");
    assert!(formula / truth > 1.4, "{formula} {truth}");
}

/// What one scene says of its intervals.
struct Coverage {
    relmse: f64,
    mean: f64,
}

fn coverage(name: &str, spp: u64, seeds: u64) -> Option<Coverage> {
    let scene = scene(name)?;
    let mut renderer = Renderer::new(&scene, RenderOptions::new(24, 24).spp(spp)).unwrap_or_else(|e| panic!("{e}"));
    let films: Vec<Film> = (0..seeds).map(|seed| film_of(&mut renderer, 7000 + seed)).collect();
    let images: Vec<_> = films.iter().map(rgb).collect();
    let reference = mean_of(&images);
    let count = seeds as f64;
    let expected = images.iter().map(|image| relmse(image, &reference)).sum::<f64>() / (count - 1.0);
    let pixels = reference.len() as f64;
    let truth: [f64; 3] = std::array::from_fn(|c| reference.iter().map(|p| p[c]).sum::<f64>() / pixels);
    let estimates: Vec<ErrorEstimate> = films.iter().map(|f| f.error_estimate().expect("two halves")).collect();
    let within = |[low, high]: [f64; 2], x: f64| low <= x && x <= high;
    let share = |holds: &dyn Fn(&ErrorEstimate) -> bool| estimates.iter().filter(|e| holds(e)).count() as f64 / count;
    let result = Coverage {
        relmse: share(&|e| within(e.interval, expected)),
        mean: (0..3).map(|c| share(&|e| within(e.mean_interval[c], truth[c]))).sum::<f64>() / 3.0,
    };
    let ratio = estimates.iter().map(|e| e.relmse).sum::<f64>() / count / expected;
    table(format_args!(
        "{name:15} {spp:4} spp: relMSE {expected:.4}, estimate/true {ratio:.2}, reliable {:.0} %; \
         covered: relMSE {:.1} %, mean {:.1} %",
        100.0 * share(&|e| e.reliable),
        100.0 * result.relmse,
        100.0 * result.mean
    ));
    Some(result)
}

/// The 95 % intervals over the scenes × 200 seeds, of relMSE (against its mean over the seeds) and of the picture's
/// mean: 93 % hold, and of the mean's 97 at most; those of relMSE are wide where the tail is not tame, as it is in most
/// pictures of this size. A binomial of 1200 has a standard deviation of 0.6 %, so of 95 % a redraw leaves the range in
/// one case of 600; single scenes scatter by 1.5 % around values of their own, which are held above 85 %.
#[test]
fn intervals_hold_in_93_percent_and_more() {
    let spp = [32, 128, 64, 32, 32, 64];
    let all: Vec<Coverage> = SCENES.iter().zip(spp).filter_map(|(name, spp)| coverage(name, spp, 200)).collect();
    let pooled = |of: &dyn Fn(&Coverage) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
    let relmse = &(|c: &Coverage| c.relmse) as &dyn Fn(&Coverage) -> f64;
    for (what, of, most) in [("relMSE", relmse, 1.0), ("mean", &|c| c.mean, 0.97)] {
        table(format_args!("{what}: {:.1} % of all", 100.0 * pooled(of)));
        assert!((0.93..=most).contains(&pooled(of)), "{what}: {}", pooled(of));
        assert!(all.iter().all(|c| of(c) > 0.85), "{what}");
    }
}

/// `--error` on the six scenes × 40 seeds: the true error is below the target in at least 95 % of the pictures of
/// every scene. The truth for each is the sum of all the others and a long run, some 40 times the samples of the
/// picture. The promise is of 99 % before looking several times; at 98 % a redraw leaves a scene with a chance of 1 in
/// 20.
#[test]
fn error_targets_are_kept() {
    let (seeds, side) = (40u64, 16);
    for (name, target) in SCENES.into_iter().zip([0.08, 0.25, 0.15, 0.2, 0.15, 0.4]) {
        let Some(scene) = scene(name) else { continue };
        let build = |options| Renderer::new(&scene, options).unwrap_or_else(|e| panic!("{e}"));
        let mut all = film_of(&mut build(RenderOptions::new(side, side).spp(4096)), 1);
        let mut renderer = build(RenderOptions::new(side, side).error(target));
        let renders: Vec<_> = (100..100 + seeds)
            .map(|seed| {
                renderer.set_seed(seed);
                renderer.render().unwrap_or_else(|e| panic!("{e}"))
            })
            .collect();
        for render in &renders {
            assert_eq!(render.stop, StopReason::Error);
            all.merge(&render.film).expect("the same picture");
        }
        let error = |render: &Render| {
            let image = rgb(&render.film);
            let (n, own) = (all.spp().mean, render.film.spp().mean);
            let others = |(a, i): (&[f64; 3], &[f64; 3])| std::array::from_fn(|c| (a[c] * n - i[c] * own) / (n - own));
            let reference: Vec<[f64; 3]> = rgb(&all).iter().zip(&image).map(others).collect();
            relmse(&image, &reference).sqrt()
        };
        let mut errors: Vec<f64> = renders.iter().map(error).collect();
        errors.sort_by(f64::total_cmp);
        let kept = errors.iter().filter(|e| **e <= target).count();
        let mut spp: Vec<u64> = renders.iter().map(|r| r.film.spp().min).collect();
        spp.sort_unstable();
        let middle = seeds as usize / 2;
        table(format_args!(
            "{name:15} target {target}: kept {kept} of {seeds}, error median {:.4} largest {:.4}, \
             spp median {} largest {}",
            errors[middle],
            errors[errors.len() - 1],
            spp[middle],
            spp[spp.len() - 1]
        ));
        assert!(kept as f64 >= 0.95 * seeds as f64, "{name}: {kept} of {seeds}");
    }
}

/// Equal seeds stop at equal samples on any number of threads, with equal bits; and the prediction is there.
#[test]
fn stopping_depends_on_nothing_but_the_film() {
    let scene = scene("cornell-box").expect("it is in the repository");
    let run = |threads: usize| {
        let options = RenderOptions::new(16, 16).error(0.05).threads(threads);
        let renderer = Renderer::new(&scene, options).unwrap_or_else(|e| panic!("{e}"));
        renderer.render().unwrap_or_else(|e| panic!("{e}"))
    };
    let (one, three) = (run(1), run(3));
    assert_eq!((one.film.spp(), one.film.hash()), (three.film.spp(), three.film.hash()));
    assert_eq!(one.film.error_estimate(), three.film.error_estimate());
    let forecast = one.forecast.expect("the pilot ends before 256 samples");
    assert!(forecast.predicted.spp > 0.0 && forecast.after_spp <= 256, "{forecast:?}");
    assert_eq!(predict::fit(&[], 0.0), None);
}
