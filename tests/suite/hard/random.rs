//! Random numbers (HARDCASES R01–R03, R06–R08): range, repetition, seeds, independence, nets. Seeds are fixed. Each
//! chi-square is accepted below its upper 1e-7 point and each mean within 5.4 standard errors (7e-8): over the 6000 or
//! so statistics of this file, a false alarm in 1600 changes of the code.

use glam::Vec3;
use pathspace::plan::options::{SamplerKind, Strategy};
use pathspace::sampler::{IndependentScheme, Scheme, SobolScheme, address, pixel_seed, unit_float};
use pathspace_stat::Pcg32;

use super::Case;
use super::modes::Mode;
use super::white_furnace::sphere;
use crate::common::{options, render};
use crate::sampling::{LIMIT, cell, chi_square_deviate};

/// Components 0..32 of a point: eight sets.
fn components<S: Scheme>(index: u32, seed: [u32; 2]) -> [f32; 32] {
    let mut out = [0.0; 32];
    for (set, four) in out.chunks_exact_mut(4).enumerate() {
        four.copy_from_slice(&S::sample_4d(index, seed, set as u32));
    }
    out
}

impl Case {
    /// The largest of many deviates against [`LIMIT`].
    fn deviate(&mut self, on: impl std::fmt::Display, deviates: impl IntoIterator<Item = f64>) {
        let (mut worst, mut n) = (f64::MIN, 0);
        for z in deviates {
            worst = if z <= worst { worst } else { z };
            n += 1;
        }
        self.row(format!("{on}, worst of {n}"), format!("< {LIMIT} σ"), format!("{worst:.2} σ"), "-", worst < LIMIT);
    }
}

#[test]
fn r01_integer_to_float() {
    let mut case = Case::open("R01", "Integer to float conversion", "u < 1");
    let last = 1.0 - 1.0 / f32::exp2(24.0);
    case.number("0", 0.0, f64::from(unit_float(0)), 0.0);
    case.number("2³² − 1", f64::from(last), f64::from(unit_float(u32::MAX)), 0.0);
    let outside = |u: f32| !(0.0..1.0).contains(&u);
    let high = (0xFFFF_FF00..=u32::MAX).filter(|&bits| unit_float(bits) != last).count();
    case.count("0xFFFFFF00 to 0xFFFFFFFF: not the last number below 1", 0, high as u64);
    let mut rng = Pcg32::new(1, 1);
    let random = (0..1_000_000).filter(|_| outside(unit_float(rng.next_u32()))).count();
    case.count("10⁶ random words outside [0,1)", 0, random as u64);
    fn of<S: Scheme>(outside: impl Fn(f32) -> bool) -> u64 {
        (0..250_000).map(|i| S::sample_4d(i, [i, 1], i % 4096).iter().filter(|&&u| outside(u)).count() as u64).sum()
    }
    case.count("sobol, 10⁶ numbers outside", 0, of::<SobolScheme>(outside));
    case.count("independent, 10⁶ numbers outside", 0, of::<IndependentScheme>(outside));
    case.close();
}

/// How many keys are equal to another one.
fn repeats<T: Ord>(mut keys: Vec<T>) -> u64 {
    keys.sort_unstable();
    keys.windows(2).filter(|w| w[0] == w[1]).count() as u64
}

fn bits_of(u: [f32; 4]) -> u128 {
    u.iter().fold(0, |key, x| key << 32 | u128::from(x.to_bits()))
}

/// Distinctness of 96-bit points; chance repeats among 10⁶: 6e-18.
#[test]
fn r02_index_and_dimension_limits() {
    let mut case = Case::open("R02", "Sample and dimension index limits", "overflow, reuse");
    fn check<S: Scheme>(case: &mut Case, name: &str) {
        // Indices of one half around 2²⁴, 2³¹ and 2³²; the last crosses into a fresh scramble.
        for (at, middle) in [("2²⁴", 1u64 << 24), ("2³¹", 1 << 31), ("2³²", 1 << 32)] {
            let points = (middle - 500_000..middle + 500_000).map(|index| {
                let a = address(index << 1 | 1);
                bits_of(S::sample_4d(a.index, pixel_seed(7, 12_345, a.half, a.high), 3))
            });
            case.count(format!("{name}, 10⁶ indices around {at}, repeats"), 0, repeats(points.collect()));
        }
        let sets = (0..4096).map(|set| bits_of(S::sample_4d(9, [1, 2], set)));
        case.count(format!("{name}, 4096 sets of 4 dimensions, repeats"), 0, repeats(sets.collect()));
        let pixels = ((1u64 << 31) - 50_000..(1 << 31) + 50_000).chain((1 << 40)..(1 << 40) + 50_000);
        let points = pixels.map(|p| bits_of(S::sample_4d(0, pixel_seed(0, p, 0, 0), 0)));
        case.count(format!("{name}, pixels around 2³¹ and 2⁴⁰, repeats"), 0, repeats(points.collect()));
    }
    check::<SobolScheme>(&mut case, "sobol");
    check::<IndependentScheme>(&mut case, "independent");
    // The address of a sample is a bijection with one place for each bit.
    let samples = [0, 1, 2, (1 << 33) - 1, 1 << 33, (1 << 33) + 1, u64::MAX];
    let lost = samples.into_iter().filter(|&sample| {
        let a = address(sample);
        u64::from(a.high) << 33 | u64::from(a.index) << 1 | u64::from(a.half) != sample
    });
    case.count("sample numbers that their address does not hold", 0, lost.count() as u64);
    case.close();
}

/// The generator of the tests themselves; the samplers have no state.
#[test]
fn r03_generator_test_vectors() {
    let mut case = Case::open("R03", "Generator test vectors", "portability");
    let mut rng = Pcg32::new(42, 54);
    let expected = [0xa15c02b7_u32, 0x7b47f409, 0xba1d3330, 0x83d2f293, 0xbfa4784b, 0xcbed606e];
    for (i, word) in expected.into_iter().enumerate() {
        let got = rng.next_u32();
        case.row(format!("word {i}"), format!("{word:08x}"), format!("{got:08x}"), "-", word == got);
    }
    case.close();
}

#[test]
fn r06_seed_collisions() {
    let mut case = Case::open("R06", "Seed collisions between pixels", "32-bit hashes");
    for (width, height) in [(1920u64, 1080), (3840, 2160)] {
        let seeds = (0..width * height).flat_map(|p| {
            [0, 1].map(|half| {
                let [a, b] = pixel_seed(42, p, half, 0);
                u64::from(a) << 32 | u64::from(b)
            })
        });
        case.count(format!("both halves of {width} × {height}"), 0, repeats(seeds.collect()));
    }
    // Seeds of the command line are not shifts of each other's pixels.
    let other = (0..1000).flat_map(|seed| (0..1000).map(move |p| pixel_seed(seed, p, 0, 0)));
    case.count("1000 seeds × 1000 pixels", 0, repeats(other.collect()));
    case.close();
}

/// Chi-square over an 8 × 8 grid of every pair of 32 components, over scattered indices of one pixel and over pixels
/// at one index. (Consecutive indices are stratified: counts of two sets are then sums of permutations, whose
/// chi-square has another law. R08 looks at those.)
fn pairs<S: Scheme>(case: &mut Case, name: &str) {
    const N: u32 = 4096;
    let over_indices: Vec<_> =
        (0..N).map(|i| components::<S>(i.wrapping_mul(0x9E37_79B1), pixel_seed(3, 99, 0, 0))).collect();
    let over_pixels: Vec<_> = (0..N).map(|p| components::<S>(6, pixel_seed(3, u64::from(p), 1, 0))).collect();
    for (what, points) in [("indices", over_indices), ("pixels", over_pixels)] {
        let all = (0..32).flat_map(|i| (0..i).map(move |j| (i, j)));
        let deviates = all.map(|(i, j)| {
            let mut counts = [0; 64];
            points.iter().for_each(|p| counts[cell(p[i], p[j])] += 1);
            chi_square_deviate(&counts)
        });
        case.deviate(format!("{name}, pairs of dimensions over {what}"), deviates);
    }
}

/// The same component of the same index in pixels at distance 1, in the two halves, under consecutive seeds, and in
/// consecutive sets.
fn neighbours<S: Scheme>(case: &mut Case, name: &str) {
    const N: u64 = 16_384;
    type Pair = fn(u64) -> [([u32; 2], u32); 2];
    let pairs: [(&str, Pair); 5] = [
        ("pixels", |p| [(pixel_seed(1, p, 0, 0), 0), (pixel_seed(1, p + 1, 0, 0), 0)]),
        ("halves", |p| [(pixel_seed(1, p, 0, 0), 0), (pixel_seed(1, p, 1, 0), 0)]),
        ("seeds", |p| [(pixel_seed(p, 5, 0, 0), 0), (pixel_seed(p + 1, 5, 0, 0), 0)]),
        ("blocks", |p| [(pixel_seed(1, p, 0, 0), 0), (pixel_seed(1, p, 0, 1), 0)]),
        ("sets", |p| [(pixel_seed(1, p, 0, 0), 8), (pixel_seed(1, p, 0, 0), 9)]),
    ];
    for (what, pair) in pairs {
        let deviates = [0, 1, 2, 1023].into_iter().flat_map(|index| {
            let mut counts = [[0; 64]; 4];
            for p in 0..N {
                let [a, b] = pair(p).map(|(seed, set)| S::sample_4d(index, seed, set));
                for d in 0..4 {
                    counts[d][cell(a[d], b[d])] += 1;
                }
            }
            counts.map(|counts| chi_square_deviate(&counts))
        });
        case.deviate(format!("{name}, neighbouring {what}"), deviates);
    }
}

/// Of A − μ and B − μ, means of the halves: their correlation over pixels, and the paired difference between (A
/// − B)²/4 and the squared error of (A + B)/2, both as deviates.
fn halves(means: impl Iterator<Item = (f64, f64)>) -> [f64; 2] {
    let (mut n, mut cross, mut aa, mut bb, mut diff, mut diff2) = (0.0f64, 0.0, 0.0, 0.0, 0.0, 0.0f64);
    for (a, b) in means {
        let d = (a - b).powi(2) / 4.0 - ((a + b) / 2.0).powi(2);
        (n, cross, aa, bb) = (n + 1.0, cross + a * b, aa + a * a, bb + b * b);
        (diff, diff2) = (diff + d, diff2 + d * d);
    }
    let correlation: f64 = cross / (aa * bb).sqrt();
    [correlation.abs() * n.sqrt(), diff.abs() / diff2.sqrt()]
}

/// Means of an oblique edge, 1 below x + 2y = 1.3: 0.4 by hand (edge from (0, 0.65) to (1, 0.15)).
fn edge_halves<S: Scheme>() -> [f64; 2] {
    let mean = |pixel, h| {
        let seed = pixel_seed(11, pixel, h, 0);
        let below = (0..16).filter(|&i| {
            let u = S::sample_4d(i, seed, 2);
            u[0] + 2.0 * u[1] < 1.3
        });
        below.count() as f64 / 16.0 - 0.4
    };
    halves((0..20_000).map(|pixel| (mean(pixel, 0), mean(pixel, 1))))
}

#[test]
fn r07_independence_of_buffers_and_dimensions() {
    let mut case = Case::open("R07", "Independence of buffers and dimensions", "dual-buffer error estimate validity");
    pairs::<SobolScheme>(&mut case, "sobol");
    pairs::<IndependentScheme>(&mut case, "independent");
    neighbours::<SobolScheme>(&mut case, "sobol");
    neighbours::<IndependentScheme>(&mut case, "independent");
    case.deviate("sobol, halves of an edge", edge_halves::<SobolScheme>());
    case.deviate("independent, halves of an edge", edge_halves::<IndependentScheme>());
    // Films of a sphere in a furnace, whose pixels are known: 0.5.
    let scene = sphere(12, false, 0.6, |b| b.lambert(Vec3::splat(0.5)));
    for mode in Mode::all() {
        for sampler in SamplerKind::ALL {
            let side = mode.count(128, 48);
            let options = options(side, side, 16).strategy(Strategy::LIGHT).sampler(sampler);
            let film = render(&scene, mode.options(options)).film;
            let mean = |p: &pathspace::film::Pixel, h: usize| p.sum[h][1] / p.n[h] as f64 - 0.5;
            case.deviate(
                format!("{}, {sampler}, halves of a film", mode.name),
                halves(film.pixels.iter().map(|p| (mean(p, 0), mean(p, 1)))),
            );
        }
    }
    case.close();
}

/// Cells of the elementary intervals of area 2^-m that do not hold exactly one of the points.
fn uneven(points: &[[f32; 4]], m: u32) -> u64 {
    let mut wrong = 0;
    for a in 0..=m {
        let mut seen = vec![false; points.len()];
        for p in points {
            let x = (p[0] * f32::exp2(a as f32)) as usize;
            let y = (p[1] * f32::exp2((m - a) as f32)) as usize;
            wrong += u64::from(std::mem::replace(&mut seen[x << (m - a) | y], true));
        }
    }
    // Dimensions 2 and 3 are stratified each by itself.
    for d in [2, 3] {
        let mut seen = vec![false; points.len()];
        for p in points {
            wrong += u64::from(std::mem::replace(&mut seen[(p[d] * f32::exp2(m as f32)) as usize], true));
        }
    }
    wrong
}

/// Slope of log MSE over log N for N = 16..4096. With 512 replicates its standard deviation is 0.012 (Gaussian errors),
/// so that the ranges are 4 of them and more from the values that were measured.
fn slope<S: Scheme>(set: u32, dims: [usize; 2], f: impl Fn(f64, f64) -> f64, mean: f64) -> f64 {
    const REPLICATES: u64 = 512;
    let mut mse = [0.0; 9];
    for r in 0..REPLICATES {
        let seed = pixel_seed(1234, r, 0, 0);
        let mut sum = 0.0;
        for i in 0..4096u32 {
            let u = S::sample_4d(i, seed, set);
            sum += f(f64::from(u[dims[0]]), f64::from(u[dims[1]]));
            let n = i + 1;
            if n >= 16 && n.is_power_of_two() {
                mse[n.ilog2() as usize - 4] += (sum / f64::from(n) - mean).powi(2) / REPLICATES as f64;
            }
        }
    }
    // Least squares over x = -4..4 doublings.
    mse.iter().enumerate().map(|(k, e)| (k as f64 - 4.0) * e.log2()).sum::<f64>() / 60.0
}

#[test]
fn r08_nets_and_scrambling() {
    let mut case = Case::open("R08", "Net property and scrambling", "low-discrepancy quality");
    for m in 1..=12u32 {
        let wrong = (0..64u32).map(|scramble| {
            let seed = pixel_seed(u64::from(scramble), 17, scramble & 1, 0);
            let first = (scramble * 37) << m;
            let points: Vec<_> = (0..1 << m).map(|i| SobolScheme::sample_4d(first + i, seed, scramble)).collect();
            uneven(&points, m)
        });
        case.count(format!("2^{m} points, 64 scrambles: cells without exactly one"), 0, wrong.sum());
    }
    // Long runs, and runs that begin late.
    for (m, first) in [(16u32, 0u32), (16, 1 << 16), (18, 0), (18, 3 << 18), (12, 1 << 24), (12, u32::MAX - 4095)] {
        let points: Vec<_> =
            (0..1 << m).map(|i| SobolScheme::sample_4d(first + i, pixel_seed(8, 1, 0, 0), 5)).collect();
        case.count(format!("2^{m} points from {first}: cells without exactly one"), 0, uneven(&points, m));
    }
    let deviates = [0, 1, 5, 4095, 1 << 16, 1 << 20, 1 << 31].into_iter().flat_map(|index| {
        let mut counts = [[0; 64]; 4];
        for s in 0..65_536u64 {
            let u = SobolScheme::sample_4d(index, pixel_seed(0, s, 0, 0), 1);
            for d in 0..4 {
                counts[d][(u[d] * 64.0) as usize] += 1;
            }
        }
        counts.map(|counts| chi_square_deviate(&counts))
    });
    case.deviate("a point is uniform over scrambles", deviates);

    let smooth = |x: f64, y: f64| (x * x + x.sin()) * (1.0 + y).ln();
    let smooth_mean = (1.0 / 3.0 + 1.0 - 1f64.cos()) * (2.0 * 2f64.ln() - 1.0);
    let edge = |x: f64, y: f64| f64::from(u8::from(x + 2.0 * y < 1.3));
    for dims in [[0, 1], [1, 2], [2, 3]] {
        let s = slope::<SobolScheme>(4, dims, smooth, smooth_mean);
        case.row(format!("sobol {dims:?}, smooth: slope"), "≤ −2.4", format!("{s:.3}"), "-", s <= -2.4);
        let s = slope::<SobolScheme>(4, dims, edge, 0.4);
        let good = (-1.65..=-1.35).contains(&s);
        case.row(format!("sobol {dims:?}, oblique edge: slope"), "−1.65 to −1.35", format!("{s:.3}"), "-", good);
    }
    for (name, f, mean) in [("smooth", &smooth as &dyn Fn(f64, f64) -> f64, smooth_mean), ("edge", &edge, 0.4)] {
        let s = slope::<IndependentScheme>(4, [0, 1], f, mean);
        let steep = (s + 1.0).abs() <= 0.05;
        case.row(format!("independent, {name}: slope"), "−1 ± 0.05", format!("{s:.3}"), "-", steep);
    }
    case.close();
}
