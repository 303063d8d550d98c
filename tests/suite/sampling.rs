//! The measure and the corners of the warps, and the names of the samplers; the samplers themselves are hard cases (R01
//! to R08). Each chi-square is accepted below its upper 3e-8 point.

use pathspace::math::warp;
use pathspace::sampler::{IndependentScheme, SamplerKind, Scheme};

/// Two-sided 7e-8 of the normal distribution, one-sided 3.3e-8.
pub const LIMIT: f64 = 5.4;

/// Chi-square of counts against equal expectations, as a normal deviate (Wilson and Hilferty).
pub fn chi_square_deviate(counts: &[u32]) -> f64 {
    let n: f64 = counts.iter().map(|&c| f64::from(c)).sum();
    let expected = n / counts.len() as f64;
    let chi2: f64 = counts.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum();
    let k = counts.len() as f64 - 1.0;
    ((chi2 / k).cbrt() - (1.0 - 2.0 / (9.0 * k))) / (2.0 / (9.0 * k)).sqrt()
}

/// Cell of (x, y) in a grid of 8 × 8.
pub fn cell(x: f32, y: f32) -> usize {
    (x * 8.0) as usize * 8 + (y * 8.0) as usize
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

/// Oracle: triangles and spheres, at the corners and edges of the square and 10⁶ points.
#[test]
fn warps_stay_on_their_targets() {
    let last = 1.0 - 2f32.powi(-24);
    let ends = [0.0, 2f32.powi(-32), 2f32.powi(-24), 0.5, 0.5 - 2f32.powi(-25), 1.0 - 2f32.powi(-23), last, 1.0];
    let corners = ends.into_iter().flat_map(|x| ends.map(|y| [x, y]));
    let edges = (0..1 << 16).flat_map(|i| {
        let x = i as f32 / 65_536.0;
        [[x, 0.0], [x, last], [0.0, x], [last, x]]
    });
    let inside = (0..1_000_000).map(|i| {
        let u = IndependentScheme::sample_4d(i, [4, 4], 0);
        [u[0], u[1]]
    });
    for u in corners.chain(edges).chain(inside) {
        let [b1, b2] = warp::triangle_barycentric(u);
        assert!(b1 >= 0.0 && b2 >= 0.0 && b1 + b2 <= 1.0, "{u:?}: {b1} {b2}");
        for w in [warp::uniform_sphere(u), warp::uniform_hemisphere(u), warp::spherical_cap(u, 0.999_999)] {
            assert!((w.as_dvec3().length() - 1.0).abs() < 5e-7, "{u:?}: {w}");
        }
    }
}

/// Oracle: the contract's spelling.
#[test]
fn sampler_names_round_trip() {
    for kind in SamplerKind::ALL {
        assert_eq!(kind.name().parse(), Ok(kind));
    }
    assert!("Sobol".parse::<SamplerKind>().is_err());
}
