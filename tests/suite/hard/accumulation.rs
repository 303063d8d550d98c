//! What becomes of samples in the film and in files (HARDCASES M08–M11): sums, variances, values that are not finite,
//! output precision.

use glam::Vec3;
use pathspace::film::exr::{ExrOptions, read_exr};
use pathspace::film::{Film, Pixel};
use pathspace::plan::options::Crop;
use pathspace::scene::Scene;
use pathspace::scene::builder::SceneBuilder;
use pathspace::transport::accumulate;
use pathspace::transport::counters::Counters;
use pathspace::transport::parts::Wanted;
use pathspace::transport::raygen::Chunk;
use pathspace::transport::wave::{Gathered, Wave};
use pathspace_stat::{Moments, Pcg32};

use super::Case;
use super::modes::Mode;
use crate::common::{options, render};

/// One pixel that gets these samples, in turn to its halves.
fn gathered(samples: impl Iterator<Item = f32>) -> Pixel {
    let mut pixel = Pixel::default();
    for (i, x) in samples.enumerate() {
        pixel.add(i & 1, [x; 3], 1.0, 1.0);
    }
    pixel
}

/// The inside of a closed black sphere of this radiance.
fn lantern(radiance: f32) -> Scene {
    let mut b = SceneBuilder::new();
    let light = b.emitter(Vec3::ZERO, Vec3::splat(radiance));
    b.sphere(Vec3::ZERO, 1.0, 8, true, false, light);
    b.camera(Vec3::ZERO, Vec3::new(0.3, -0.5, 0.8), Vec3::Y, 1.0);
    b.build()
}

#[test]
fn m08_accumulation_over_millions_of_samples() {
    let mut case = Case::open("M08", "Film accumulation at 10⁶ samples and beyond", "f32 summation");
    let bound = 0.5_f64.powi(23);
    let mut film_value = |name: &str, exact: f64, pixel: &Pixel| {
        case.number(name, exact, f64::from(pixel.mean()[1] as f32), bound);
    };
    let tenth = f64::from(0.1f32);
    film_value("1 × 2²⁵", 1.0, &gathered((0..1 << 25).map(|_| 1.0)));
    film_value("0.1 × 10⁶", tenth, &gathered((0..1_000_000).map(|_| 0.1)));
    film_value("0.1 × 2²⁴", tenth, &gathered((0..1 << 24).map(|_| 0.1)));
    for n in [65_536u64, 1_000_000, 1 << 24] {
        // Multiples of 2⁻²⁴: their sum is an integer.
        let mut rng = Pcg32::new(42, 54);
        let mut sum = 0u64;
        let pixel = gathered((0..n).map(|_| {
            let x = rng.next_f32();
            sum += (x * 16_777_216.0) as u64;
            x
        }));
        film_value(&format!("uniform numbers × {n}"), sum as f64 / 16_777_216.0 / n as f64, &pixel);
    }
    let firefly = gathered(std::iter::once(1e6).chain((0..1_000_000).map(|_| 0.01)));
    film_value("10⁶, then 0.01 × 10⁶", (1e6 + 1e6 * f64::from(0.01f32)) / 1_000_001.0, &firefly);
    // Films of parts add up.
    let mut parts = Pixel::default();
    (0..64).for_each(|_| parts.merge(&gathered((0..1 << 15).map(|_| 0.1))));
    film_value("0.1 × 2²¹ in 64 parts", tenth, &parts);
    for mode in Mode::all() {
        let spp = mode.count(1_000_000, 1 << 17);
        let film = render(&lantern(0.1), mode.options(options(1, 1, spp))).film;
        case.number(format!("{}, a lantern of 0.1 × {spp}", mode.name), tenth, film.pixels[0].mean()[1], bound);
        case.count(format!("{}, samples", mode.name), spp, film.pixels[0].samples());
    }
    case.close();
}

/// The film keeps no sum of squares: the variance of a pixel is (A − B)²·n₀n₁/n², a square by construction.
/// Pixels of two samples each give (a − b)²/4; over the sequence their mean is half of the variance of a sample.
#[test]
fn m09_variance_accumulation() {
    let mut case = Case::open("M09", "Variance accumulation", "E[x²] − E[x]² cancellation");
    let mut rng = Pcg32::new(7, 54);
    let samples: Vec<f32> = (0..100_000)
        .map(|_| {
            let sum: f64 = (0..12).map(|_| f64::from(rng.next_u32()) * 0.5_f64.powi(32)).sum();
            (1000.0 + 0.01 * (sum - 6.0)) as f32
        })
        .collect();
    let mut moments = Moments::default();
    moments.extend(samples.iter().map(|&x| f64::from(x)));
    case.number("moments of the sequence", 9.957833e-5, moments.variance(), 1e-2);
    let pairs = samples.chunks_exact(2).map(|pair| {
        let exact = (f64::from(pair[0]) - f64::from(pair[1])).powi(2) / 4.0;
        (exact, gathered(pair.iter().copied()).variance().expect("two halves")[1], 1e-6)
    });
    case.numbers("variance of pixels of two", pairs);
    let mut pixels = Moments::default();
    pixels.extend(
        samples.chunks_exact(2).map(|pair| 2.0 * gathered(pair.iter().copied()).variance().expect("two halves")[1]),
    );
    let z = pixels.z(moments.variance(), 0.0);
    let got = format!("{:.4e} ± {:.1e}", pixels.mean, pixels.standard_error());
    case.row("their mean", format!("{:.4e}", moments.variance()), got, format!("{z:.2} σ"), z <= 4.9);
    let all = gathered(samples.iter().copied()).variance().expect("two halves")[1];
    let half = |h: usize| samples.iter().skip(h).step_by(2).map(|&x| f64::from(x)).sum::<f64>() / 5e4;
    case.number("one pixel of 10⁵", (half(0) - half(1)).powi(2) / 4.0, all, 1e-6);
    case.close();
}

/// The fault is put where the wavefront hands finished samples to the film. Negative samples are kept; only the
/// filter's weights make them, and they are not counted. No mean of finite f32 samples is beyond f32 but by the
/// filter's weights; the file then holds ±f32::MAX.
#[test]
fn m10_samples_that_are_not_finite() {
    let mut case = Case::open("M10", "NaN, Inf and huge samples", "containment and honest reporting");
    let (pixels, samples, radiance) = ([(3u32, 4u32), (5, 4)], 10_000usize, 0.5f32);
    for (name, fault, kept) in [
        ("NaN", f32::NAN, 0.0),
        ("∞", f32::INFINITY, 0.0),
        ("−∞", f32::NEG_INFINITY, 0.0),
        ("−1", -1.0, -1.0),
        ("1e38", 1e38, f64::from(1e38f32)),
    ] {
        let mut wave = Wave::new(pixels.len() * samples, &Wanted::default());
        for (slot, gathered) in wave.sums.gathered.iter_mut().enumerate().take(pixels.len() * samples) {
            let value = if slot % 1000 == 999 { fault } else { radiance };
            *gathered = Gathered { radiance: [radiance, value, radiance], coverage: 1.0, weight: 1.0 };
        }
        let chunk = Chunk { pixels: &pixels, first_sample: 0, samples };
        let (mut film, mut counters) = ([Pixel::default(); 2], Counters::default());
        accumulate::samples(&chunk, &wave, &mut film, &mut counters);
        let expected = 0.999 * f64::from(radiance) + 0.001 * kept;
        case.number(format!("{name}, mean"), expected, film[0].mean()[1], 1e-12);
        let lost = if fault.is_finite() { 0 } else { 20 };
        case.count(format!("{name}, counted"), lost, counters.nonfinite);
        // The whole sample goes, in all channels, and is listed by place.
        let others = if fault.is_finite() { f64::from(radiance) } else { expected };
        case.number(format!("{name}, mean of the other channels"), others, film[1].mean()[0], 1e-12);
        let first = counters.nonfinite_first.first().map_or((0, 0, 0), |n| (n.pixel.0, n.pixel.1, n.sample));
        let place = if fault.is_finite() { (0, 0, 0) } else { (3, 4, 999) };
        case.row(format!("{name}, listed"), format!("{place:?}"), format!("{first:?}"), "-", place == first);
        let finite = film.iter().all(|p| p.mean().iter().all(|m| m.is_finite()));
        case.row(format!("{name}, pixels"), "finite", if finite { "finite" } else { "not finite" }, "-", finite);
    }
    case.close();
}

/// 16-bit values saturate at ±65504, as `--half` says; a mean beyond f32 is written as the largest f32. Below half of
/// the smallest subnormal is 0.
#[test]
fn m11_output_precision() {
    let mut case = Case::open("M11", "Output precision", "f16 and 8-bit range");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let values = [0.1f32, 65504.0, 65520.0, 1e6, 1e-8, -0.01, 1e-45];
    let mut film = Film::new((8, 1), Crop { x: 0, y: 0, width: 8, height: 1 });
    for (pixel, value) in film.pixels.iter_mut().zip(values) {
        pixel.add(0, [value; 3], 1.0, 1.0);
    }
    film.pixels[7] = Pixel { sum: [[1e300, -1e300, 0.0, 1.0], [0.0; 4]], n: [1, 0] };
    let read = |name: &str, half: bool| {
        let path = folder.path().join(name);
        film.write_exr(&path, &ExrOptions::default().half(half)).expect("a writable folder");
        read_exr(&path).expect("just written").rgb
    };
    let rgb = read("single.exr", false);
    let same = rgb.iter().zip(values).filter(|(p, v)| **p == [*v; 3]).count();
    case.count("f32, exact values", 7, same as u64);
    case.row(
        "f32, means of ±1e300",
        "±f32::MAX",
        format!("{:e}, {:e}", rgb[7][0], rgb[7][1]),
        "-",
        rgb[7] == [f32::MAX, -f32::MAX, 0.0],
    );
    let halves = [0.0999755859375, 65504.0, 65504.0, 65504.0, 0.0, -0.01000213623046875, 0.0];
    for ((p, value), expected) in read("half.exr", true).iter().zip(values).zip(halves) {
        case.number(format!("f16 of {value:e}"), expected, f64::from(p[1]), 0.0);
    }
    let path = folder.path().join("preview.png");
    film.write_png(&path, 0.0).expect("a writable folder");
    let bytes = image::open(&path).expect("just written").to_rgb8().into_raw();
    for ((p, value), expected) in bytes.chunks_exact(3).zip(values).zip([89, 255, 255, 255, 0, 0, 0]) {
        case.count(format!("PNG of {value:e}"), expected, u64::from(p[1]));
    }
    case.close();
}
