//! Pixel filters: that they are normalised, and how far they ring (HARDCASES M01, M02). The product samples them by
//! importance with signed weights; of the specification's filters it has box, tent, Gaussian, Blackman–Harris and
//! Mitchell.

use glam::Vec3;
use pathspace::film::exr::{ExrOptions, read_exr};
use pathspace::film::filter::{FilterKind, FilterTable};
use pathspace::plan::options::{Crop, SamplerKind};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Projection, Scene};
use pathspace_stat::{Moments, Pcg32};

use super::Case;
use super::modes::Mode;
use crate::common::{Estimate, options, render};

/// Inside of a closed black sphere of radiance 1.
fn lantern() -> Scene {
    let mut b = SceneBuilder::new();
    let light = b.emitter(Vec3::ZERO, Vec3::ONE);
    b.sphere(Vec3::ZERO, 1.0, 8, true, false, light);
    b.camera(Vec3::new(0.1, 0.2, -0.1), Vec3::new(0.3, -0.5, 0.8), Vec3::Y, 1.2);
    b.build()
}

#[test]
fn m01_uniform_radiance_through_any_filter() {
    let mut case =
        Case::open("M01", "Uniform radiance through any pixel filter", "normalisation, image borders, crop windows");
    let scene = lantern();
    let crop = Some(Crop { x: 7, y: 5, width: 3, height: 9 });
    for mode in Mode::all() {
        for filter in FilterKind::ALL.into_iter().filter(|&f| f != FilterKind::Mitchell) {
            let sizes = [(17, 15, None), (17, 15, crop), (1, 1, None)];
            let values = sizes.into_iter().flat_map(|(width, height, crop)| {
                let film = render(&scene, mode.options(options(width, height, 7).filter(filter).crop(crop))).film;
                film.pixels.into_iter().map(|p| (1.0, p.mean()[1], 0.5_f64.powi(20)))
            });
            case.numbers(format!("{}, {filter}: pixels, crop, 1 × 1", mode.name), values);
        }
        // Signed weights: one sample a pixel, so that the pixels are samples.
        let (filter, sampler) = (FilterKind::Mitchell, SamplerKind::Independent);
        let film = render(&scene, mode.options(options(512, 512, 1).filter(filter).sampler(sampler))).film;
        let estimate = Estimate::of(film.pixels.iter().map(|p| [p.mean()[0], p.mean()[1], p.mean()[2]]));
        case.mean(format!("{}, mitchell: mean", mode.name), [1.0; 3], 0.0, 6e-3, &estimate);
        case.number(format!("{}, mitchell: variance of a sample", mode.name), 0.3106532, estimate.variance[1], 2e-2);
    }
    case.close();
}

/// ∫h over x > e of Mitchell's filter (1/3, 1/3), e ≥ 0: its antiderivative, piece by piece.
fn mitchell_beyond(e: f64) -> f64 {
    let inner = |x: f64| (7.0 / 4.0 * x.powi(4) - 4.0 * x.powi(3) + 16.0 / 3.0 * x) / 6.0;
    let outer = |x: f64| (-7.0 / 12.0 * x.powi(4) + 4.0 * x.powi(3) - 10.0 * x * x + 32.0 / 3.0 * x) / 6.0;
    let tail = |x: f64| outer(2.0) - outer(x);
    if e < 1.0 { inner(1.0) - inner(e) + tail(1.0) } else { tail(e.min(2.0)) }
}

/// What a pixel shows of an edge at distance `e` beyond which radiance is 1.
fn response(e: f64) -> f64 {
    if e < 0.0 { 1.0 - mitchell_beyond(-e) } else { mitchell_beyond(e) }
}

/// A wall of radiance 1 to the right of x = `edge`, in a view of 8 pixels of 1 m.
fn edge_at(edge: f32) -> Scene {
    let mut b = SceneBuilder::new();
    let light = b.emitter(Vec3::ZERO, Vec3::ONE);
    b.quad([(edge, -50.0), (50.0, -50.0), (50.0, 50.0), (edge, 50.0)].map(|(x, y)| Vec3::new(x, y, 0.0)), light);
    let view = Projection::Orthographic { xmag_m: 4.0, ymag_m: 4.0 };
    b.any_camera(Vec3::new(0.0, 0.0, 1.0), Vec3::ZERO, Vec3::Y, view);
    b.build()
}

/// T1 at every offset with 2¹⁸ points of the filter; the extremes through renders. A response near 0 has no relative
/// power, so that the absolute one is asked: 4.9 s.e. below 1 % of the edge.
#[test]
fn m02_step_edge_through_negative_lobes() {
    let mut case = Case::open("M02", "Step edge through negative lobes", "ringing is expected, its size is known");
    let offsets: Vec<f64> = (-128..=128).map(|i| f64::from(i) / 64.0).collect();
    let (low, high) = offsets.iter().fold((1.0f64, 0.0f64), |(l, h), &e| (l.min(response(e)), h.max(response(e))));
    case.number("closed form, lowest of 257 offsets", -0.01749271, low, 2e-3);
    case.number("closed form, highest", 1.017493, high, 1e-4);

    let table = FilterTable::new(FilterKind::Mitchell);
    let mut rng = Pcg32::new(2, 2);
    let mut moments = vec![Moments::default(); offsets.len()];
    for _ in 0..1 << 18 {
        let sample = table.sample(rng.next_f32(), rng.next_f32());
        for (m, &e) in moments.iter_mut().zip(&offsets) {
            m.push(if f64::from(sample.dx) > e { f64::from(sample.weight) } else { 0.0 });
        }
    }
    let z = |(m, &e): (&Moments, &f64)| m.z(response(e), 1e-4);
    let worst = moments.iter().zip(&offsets).map(z).fold(0.0, f64::max);
    let band = moments.iter().map(|m| 4.9 * m.standard_error()).fold(0.0, f64::max);
    let got = format!("{worst:.2} σ; band {band:.1e}");
    let within = worst <= 4.9 && band <= 1e-2;
    case.row("257 offsets, 2¹⁸ points", "≤ 4.9 σ + 1e-4", got, format!("{worst:.2} σ"), within);

    let folder = tempfile::tempdir().expect("a temporary folder");
    // The extremes lie at the zero crossing of the filter, beside and behind the edge.
    let far = offsets.iter().copied().fold(0.0, |a, e| if response(e) < response(a) { e } else { a });
    for mode in Mode::all() {
        let crop = Some(Crop { x: 3, y: 3, width: 1, height: 2 });
        let samples = mode.count(1 << 17, 1 << 14);
        for (name, offset) in [("lowest", far), ("highest", -far)] {
            // The pixel's centre is at x = −0.5.
            let scene = edge_at((offset - 0.5) as f32);
            let (filter, sampler) = (FilterKind::Mitchell, SamplerKind::Independent);
            let film =
                render(&scene, mode.options(options(8, 8, samples).filter(filter).sampler(sampler).crop(crop))).film;
            // Weights of the samples are known: their squares are m⁴ on the lit side.
            let square = 1.3106532 * lit_share(&moments, &offsets, offset);
            let error = ((square - response(offset).powi(2)) / (2.0 * samples as f64)).sqrt();
            let got = 0.5 * (film.pixels[0].mean()[1] + film.pixels[1].mean()[1]);
            let z = ((got - response(offset)).abs() - 1e-4).max(0.0) / error;
            let expected = format!("{:.6}", response(offset));
            case.row(format!("{}, {name}", mode.name), expected, format!("{got:.6}"), format!("{z:.2} σ"), z <= 4.9);
            if name == "lowest" && mode.is_main() {
                let path = folder.path().join("edge.exr");
                film.write_exr(&path, &ExrOptions::default()).expect("a writable folder");
                let stored = f64::from(read_exr(&path).expect("just written").rgb[0][1]);
                let mean = film.pixels[0].mean()[1];
                case.row(
                    "film and file",
                    "negative",
                    format!("{mean:.5}, {stored:.5}"),
                    "-",
                    mean < 0.0 && stored < 0.0,
                );
            }
        }
    }
    case.close();
}

/// Share of the filter's points beyond the offset, whatever the sign of their weight.
fn lit_share(moments: &[Moments], offsets: &[f64], offset: f64) -> f64 {
    let k = offsets.iter().position(|&e| e == offset).expect("one of the offsets");
    let m = &moments[k];
    // Weights are ±m², so that their mean square is the share times m⁴.
    (m.m2 / m.n as f64 + m.mean * m.mean) / 1.3106532
}
