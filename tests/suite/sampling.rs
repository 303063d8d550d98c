//! Samplers: range, repetition, seeds, independence, net property, convergence (HARDCASES R01, R02, R06, R07, R08), and the
//! measure of the warps (B19). Seeds are fixed. Each chi-square is accepted below its upper 1e-7 point and each mean within
//! 5.4 standard errors (7e-8): over the 6000 or so statistics of this file, a false alarm in 1600 changes of the code.

use pathspace::math::warp;
use pathspace::sampler::{IndependentScheme, SamplerKind, Scheme, SobolScheme, address, pixel_seed, unit_float};

/// Two-sided 7e-8 of the normal distribution, one-sided 3.3e-8.
const LIMIT: f64 = 5.4;

/// Chi-square of counts against equal expectations, as a normal deviate (Wilson and Hilferty).
fn chi_square_deviate(counts: &[u32]) -> f64 {
    let n: f64 = counts.iter().map(|&c| f64::from(c)).sum();
    let expected = n / counts.len() as f64;
    let chi2: f64 = counts.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum();
    let k = counts.len() as f64 - 1.0;
    ((chi2 / k).cbrt() - (1.0 - 2.0 / (9.0 * k))) / (2.0 / (9.0 * k)).sqrt()
}

/// Cell of (x, y) in a grid of 8 × 8.
fn cell(x: f32, y: f32) -> usize {
    (x * 8.0) as usize * 8 + (y * 8.0) as usize
}

/// Components 0..32 of a point: eight sets.
fn components<S: Scheme>(index: u32, seed: [u32; 2]) -> [f32; 32] {
    let mut out = [0.0; 32];
    for (set, four) in out.chunks_exact_mut(4).enumerate() {
        four.copy_from_slice(&S::sample_4d(index, seed, set as u32));
    }
    out
}

/// HARDCASES R01. Oracle: the interval, exhaustive at its upper end.
#[test]
fn numbers_stay_below_one() {
    let last = 1.0 - 1.0 / f32::exp2(24.0);
    assert_eq!((unit_float(0), unit_float(255), unit_float(u32::MAX)), (0.0, 0.0, last));
    for bits in 0xFFFF_FF00..=0xFFFF_FFFFu32 {
        assert!(unit_float(bits) == last);
    }
    fn check<S: Scheme>() {
        for i in 0..250_000 {
            assert!(S::sample_4d(i, [i, 1], i % 4096).iter().all(|u| (0.0..1.0).contains(u)));
        }
    }
    check::<SobolScheme>();
    check::<IndependentScheme>();
}

/// Whether any two keys are equal.
fn has_repeats<T: Ord>(mut keys: Vec<T>) -> bool {
    keys.sort_unstable();
    keys.windows(2).any(|w| w[0] == w[1])
}

fn bits_of(u: [f32; 4]) -> u128 {
    u.iter().fold(0, |key, x| key << 32 | u128::from(x.to_bits()))
}

/// HARDCASES R02. Oracle: distinctness of 96-bit points. Chance repeats among 10⁶: 6e-18.
#[test]
fn nothing_repeats_across_index_and_dimension_limits() {
    fn check<S: Scheme>() {
        // Indices of one half around 2²⁴, 2³¹ and 2³²; the last crosses into a fresh scramble.
        for middle in [1u64 << 24, 1 << 31, 1 << 32] {
            let points = (middle - 500_000..middle + 500_000).map(|index| {
                let a = address(index << 1 | 1);
                assert_eq!(a.half, 1);
                bits_of(S::sample_4d(a.index, pixel_seed(7, 12_345, a.half, a.high), 3))
            });
            assert!(!has_repeats(points.collect()), "around {middle}");
        }
        // Sets up to 4096 and pixels beyond 2³¹: one point each.
        let sets = (0..4096).map(|set| bits_of(S::sample_4d(9, [1, 2], set)));
        assert!(!has_repeats(sets.collect()));
        let pixels = ((1u64 << 31) - 50_000..(1 << 31) + 50_000).chain((1 << 40)..(1 << 40) + 50_000);
        assert!(!has_repeats(pixels.map(|p| bits_of(S::sample_4d(0, pixel_seed(0, p, 0, 0), 0))).collect()));
    }
    check::<SobolScheme>();
    check::<IndependentScheme>();
    // The address of a sample is a bijection with one place for each bit.
    for sample in [0, 1, 2, (1 << 33) - 1, 1 << 33, (1 << 33) + 1, u64::MAX] {
        let a = address(sample);
        assert_eq!(u64::from(a.high) << 33 | u64::from(a.index) << 1 | u64::from(a.half), sample);
    }
}

/// HARDCASES R06. Oracle: counting. Both halves of all pixels of 3840 × 2160 (1920 × 1080 uses a part of them).
#[test]
fn no_two_pixels_share_a_seed() {
    let seeds = (0..3840u64 * 2160).flat_map(|p| {
        [0, 1].map(|half| {
            let [a, b] = pixel_seed(42, p, half, 0);
            u64::from(a) << 32 | u64::from(b)
        })
    });
    assert!(!has_repeats(seeds.collect()));
    // Seeds of the command line are not shifts of each other's pixels.
    let other = (0..1000).flat_map(|seed| (0..1000).map(move |p| pixel_seed(seed, p, 0, 0)));
    assert!(!has_repeats(other.collect()));
}

/// HARDCASES R07. Oracle: independence. Chi-square over an 8 × 8 grid of every pair of 32 components, once over scattered indices
/// of one pixel and once over pixels at one index. (Consecutive indices are stratified: counts of two sets are then sums of
/// permutations, whose chi-square has another law. Nets and slopes below look at those.)
#[test]
fn pairs_of_dimensions_fill_the_square() {
    fn check<S: Scheme>(name: &str) {
        const N: u32 = 4096;
        let over_indices: Vec<_> =
            (0..N).map(|i| components::<S>(i.wrapping_mul(0x9E37_79B1), pixel_seed(3, 99, 0, 0))).collect();
        let over_pixels: Vec<_> = (0..N).map(|p| components::<S>(6, pixel_seed(3, u64::from(p), 1, 0))).collect();
        for (what, points) in [("indices", over_indices), ("pixels", over_pixels)] {
            let mut worst = f64::MIN;
            for i in 0..32 {
                for j in 0..i {
                    let mut counts = [0; 64];
                    points.iter().for_each(|p| counts[cell(p[i], p[j])] += 1);
                    let z = chi_square_deviate(&counts);
                    assert!(z < LIMIT, "{name}: components {i} and {j} over {what}: {z}");
                    worst = worst.max(z);
                }
            }
            println!("{name} over {what}: worst of 496 pairs z = {worst:.2}");
        }
    }
    check::<SobolScheme>("sobol");
    check::<IndependentScheme>("independent");
}

/// HARDCASES R07. Oracle: independence of neighbours: the same component of the same index in pixels at distance 1, in the two
/// halves, under consecutive seeds, and in consecutive sets.
#[test]
fn neighbours_are_independent() {
    fn check<S: Scheme>(name: &str) {
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
            for index in [0, 1, 2, 1023] {
                let mut counts = [[0; 64]; 4];
                for p in 0..N {
                    let [a, b] = pair(p).map(|(seed, set)| S::sample_4d(index, seed, set));
                    for d in 0..4 {
                        counts[d][cell(a[d], b[d])] += 1;
                    }
                }
                for (d, counts) in counts.iter().enumerate() {
                    let z = chi_square_deviate(counts);
                    assert!(z < LIMIT, "{name}: {what}, index {index}, dimension {d}: {z}");
                }
            }
        }
    }
    check::<SobolScheme>("sobol");
    check::<IndependentScheme>("independent");
}

/// HARDCASES R07. Oracle: A − μ and B − μ of the two halves are uncorrelated over pixels, and (A − B)²/4 has the mean of the true
/// squared error of (A + B)/2: the z of the paired difference.
#[test]
fn halves_give_an_unbiased_error() {
    fn check<S: Scheme>(name: &str) {
        const PIXELS: u64 = 20_000;
        // Mean of an oblique edge, 1 below x + 2y = 1.3: area by hand, 0.4 (edge from (0,.65) to (1,.15)).
        let mu = 0.4;
        let (mut cross, mut aa, mut bb, mut diff, mut diff2) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for pixel in 0..PIXELS {
            let half = |h| {
                let seed = pixel_seed(11, pixel, h, 0);
                let hits = (0..16).filter(|&i| {
                    let u = S::sample_4d(i, seed, 2);
                    u[0] + 2.0 * u[1] < 1.3
                });
                hits.count() as f64 / 16.0 - mu
            };
            let (a, b) = (half(0), half(1));
            cross += a * b;
            aa += a * a;
            bb += b * b;
            let d = (a - b).powi(2) / 4.0 - ((a + b) / 2.0).powi(2);
            diff += d;
            diff2 += d * d;
        }
        let n = PIXELS as f64;
        let correlation = cross / (aa * bb).sqrt();
        assert!(correlation.abs() * n.sqrt() < LIMIT, "{name}: correlation {correlation}");
        assert!(diff.abs() / diff2.sqrt() < LIMIT, "{name}: the estimate is off by {}", diff / n);
    }
    check::<SobolScheme>("sobol");
    check::<IndependentScheme>("independent");
}

/// HARDCASES R08. Oracle: a scrambled (0,2)-sequence has exactly one of each aligned run of 2^m points in each elementary interval
/// of area 2^-m; and over scrambles each point is uniform.
#[test]
fn sobol_is_a_scrambled_net() {
    for scramble in 0..64u32 {
        let seed = pixel_seed(u64::from(scramble), 17, scramble & 1, 0);
        for m in 1..=12u32 {
            let first = (scramble * 37) << m;
            let points: Vec<_> = (0..1 << m).map(|i| SobolScheme::sample_4d(first + i, seed, scramble)).collect();
            for a in 0..=m {
                let mut seen = vec![false; 1 << m];
                for p in &points {
                    let x = (p[0] * f32::exp2(a as f32)) as usize;
                    let y = (p[1] * f32::exp2((m - a) as f32)) as usize;
                    assert!(!std::mem::replace(&mut seen[x << (m - a) | y], true), "m = {m}, a = {a}");
                }
            }
            // Dimensions 2 and 3 are stratified each by itself.
            for d in [2, 3] {
                let mut seen = vec![false; 1 << m];
                for p in &points {
                    let x = (p[d] * f32::exp2(m as f32)) as usize;
                    assert!(!std::mem::replace(&mut seen[x], true), "m = {m}, dimension {d}");
                }
            }
        }
    }
    for index in [0, 1, 5, 4095, 1 << 20] {
        let mut counts = [[0; 64]; 4];
        for s in 0..65_536u64 {
            let u = SobolScheme::sample_4d(index, pixel_seed(0, s, 0, 0), 1);
            for d in 0..4 {
                counts[d][(u[d] * 64.0) as usize] += 1;
            }
        }
        for (d, counts) in counts.iter().enumerate() {
            let z = chi_square_deviate(counts);
            assert!(z < LIMIT, "index {index}, dimension {d}: {z}");
        }
    }
}

/// Slope of log MSE over log N for N = 16..4096, and the MSE at 4096.
fn slope<S: Scheme>(set: u32, dims: [usize; 2], f: impl Fn(f64, f64) -> f64, mean: f64) -> (f64, f64) {
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
    let line = mse.iter().enumerate().map(|(k, e)| (k as f64 - 4.0) * e.log2()).sum::<f64>() / 60.0;
    (line, mse[8])
}

/// HARDCASES R08. Oracle: the known orders of convergence. With 512 replicates a slope's standard deviation is 0.012 (Gaussian
/// errors), so the ranges below are 4 of them and more from the values that were measured.
#[test]
fn integration_converges_at_the_known_orders() {
    let smooth = |x: f64, y: f64| (x * x + x.sin()) * (1.0 + y).ln();
    let smooth_mean = (1.0 / 3.0 + 1.0 - 1f64.cos()) * (2.0 * 2f64.ln() - 1.0);
    let edge = |x: f64, y: f64| f64::from(u8::from(x + 2.0 * y < 1.3));
    for dims in [[0, 1], [1, 2], [2, 3]] {
        let (s, mse) = slope::<SobolScheme>(4, dims, smooth, smooth_mean);
        println!("sobol {dims:?} smooth: slope {s:.3}, MSE at 4096 {mse:.3e}");
        assert!(s <= -2.4, "{dims:?}: smooth slope {s}");
        let (s, mse) = slope::<SobolScheme>(4, dims, edge, 0.4);
        println!("sobol {dims:?} edge: slope {s:.3}, MSE at 4096 {mse:.3e}");
        assert!((-1.65..=-1.35).contains(&s), "{dims:?}: edge slope {s}");
    }
    for (name, f, mean) in [("smooth", &smooth as &dyn Fn(f64, f64) -> f64, smooth_mean), ("edge", &edge, 0.4)] {
        let (s, mse) = slope::<IndependentScheme>(4, [0, 1], f, mean);
        println!("independent {name}: slope {s:.3}, MSE at 4096 {mse:.3e}");
        assert!((s + 1.0).abs() <= 0.05, "independent {name}: slope {s}");
    }
}

/// Oracle: the measure. Equal-area cells of each warp's target, counted over independent points; and exact bounds.
#[test]
fn warps_preserve_measure() {
    const N: u32 = 1 << 18;
    use std::f64::consts::TAU;
    // Angle around z as a fraction of a turn.
    let turn = |x: f32, y: f32| f64::from(y).atan2(f64::from(x)).rem_euclid(TAU) / TAU;
    type Cell<'a> = Box<dyn Fn([f32; 2]) -> (f64, f64) + 'a>;
    let cap = 0.999_f32;
    let maps: Vec<(&str, Cell)> = vec![
        (
            "disk",
            Box::new(|u| {
                let d = warp::concentric_disk(u).as_dvec2();
                (d.length_squared(), turn(d.x as f32, d.y as f32))
            }),
        ),
        (
            "cosine",
            Box::new(|u| {
                let w = warp::cosine_hemisphere(u);
                (1.0 - f64::from(w.z).powi(2), turn(w.x, w.y))
            }),
        ),
        (
            "hemisphere",
            Box::new(|u| {
                let w = warp::uniform_hemisphere(u);
                (1.0 - f64::from(w.z), turn(w.x, w.y))
            }),
        ),
        (
            "sphere",
            Box::new(|u| {
                let w = warp::uniform_sphere(u);
                (0.5 - 0.5 * f64::from(w.z), turn(w.x, w.y))
            }),
        ),
        (
            "cap",
            Box::new(|u| {
                let w = warp::spherical_cap(u, cap).as_dvec3();
                ((w.x * w.x + w.y * w.y) / (1.0 + w.z) / f64::from(1.0 - cap), turn(w.x as f32, w.y as f32))
            }),
        ),
        (
            "triangle",
            Box::new(|u| {
                // Area below weight b1 is 1 − (1 − b1)²; b2 is uniform in [0, 1 − b1].
                let [b1, b2] = warp::triangle_barycentric(u).map(f64::from);
                (1.0 - (1.0 - b1).powi(2), b2 / (1.0 - b1))
            }),
        ),
    ];
    for (name, map) in maps {
        let mut counts = [0; 64];
        for i in 0..N {
            let u = IndependentScheme::sample_4d(i, [8, 8], 0);
            let (x, y) = map([u[0], u[1]]);
            let inside = -1e-6..1.000_001;
            assert!(inside.contains(&x) && inside.contains(&y), "{name}: ({x}, {y}) from {u:?}");
            counts[cell(x.clamp(0.0, 0.999_999) as f32, y.clamp(0.0, 0.999_999) as f32)] += 1;
        }
        let z = chi_square_deviate(&counts);
        assert!(z < LIMIT, "{name}: {z}");
    }
}

/// HARDCASES B19. Oracle: the bound z ≥ 2⁻¹², unit length to 4 roundoffs, at the corners and edges of the square and 10⁶ points.
#[test]
fn cosine_samples_never_lie_in_the_horizon() {
    let ends = [
        0.0,
        2f32.powi(-32),
        2f32.powi(-24),
        0.5,
        0.5 - 2f32.powi(-25),
        1.0 - 2f32.powi(-23),
        1.0 - 2f32.powi(-24),
        1.0,
    ];
    let corners = ends.into_iter().flat_map(|x| ends.map(|y| [x, y]));
    let edges = (0..1 << 16).flat_map(|i| {
        let x = i as f32 / 65_536.0;
        [[x, 0.0], [x, 1.0 - 2f32.powi(-24)], [0.0, x], [1.0 - 2f32.powi(-24), x]]
    });
    let inside = (0..1_000_000).map(|i| {
        let u = IndependentScheme::sample_4d(i, [4, 4], 0);
        [u[0], u[1]]
    });
    let mut lowest = 1.0f32;
    for u in corners.chain(edges).chain(inside) {
        let w = warp::cosine_hemisphere(u);
        assert!(w.z >= warp::MIN_COS, "{u:?}: {w}");
        // A clamped rim point is 2⁻²⁵ too long at most; rounding of the disk adds its own.
        assert!((w.as_dvec3().length() - 1.0).abs() < 2.5e-7, "{u:?}: {w} {}", w.as_dvec3().length() - 1.0);
        assert!(warp::cosine_hemisphere_pdf(w.z) > 0.0);
        lowest = lowest.min(w.z);
        let [b1, b2] = warp::triangle_barycentric(u);
        assert!(b1 >= 0.0 && b2 >= 0.0 && b1 + b2 <= 1.0, "{u:?}: {b1} {b2}");
        for w in [warp::uniform_sphere(u), warp::uniform_hemisphere(u), warp::spherical_cap(u, 0.999_999)] {
            assert!((w.as_dvec3().length() - 1.0).abs() < 5e-7, "{u:?}: {w}");
        }
    }
    println!("lowest z = {lowest:e}");
}

/// Oracle: the contract's spelling.
#[test]
fn sampler_names_round_trip() {
    for kind in SamplerKind::ALL {
        assert_eq!(kind.name().parse(), Ok(kind));
    }
    assert!("Sobol".parse::<SamplerKind>().is_err());
}
