//! Frames around a normal and directions in them (HARDCASES B18, B19). Oracle: the identity, and that nothing divides
//! by zero.

use glam::Vec3;
use pathspace::math::frame::Frame;
use pathspace::math::warp;
use pathspace::shading::bsdf::lambert::Lambert;
use pathspace::shading::bsdf::model::Bsdf;
use pathspace_stat::Pcg32;

use super::Case;

/// Largest deviation of the frame's Gram matrix from the identity, in f64; NaN counts as infinite.
fn gram_error(f: &Frame) -> f64 {
    let axes = [f.t.as_dvec3(), f.b.as_dvec3(), f.n.as_dvec3()];
    let mut worst = 0.0f64;
    for (i, p) in axes.iter().enumerate() {
        for (j, q) in axes.iter().enumerate() {
            let deviation = (p.dot(*q) - f64::from(u8::from(i == j))).abs();
            worst = if deviation <= worst { worst } else { deviation };
        }
    }
    if worst.is_nan() { f64::INFINITY } else { worst }
}

#[test]
fn b18_orthonormal_basis() {
    let mut case = Case::open("B18", "Orthonormal basis", "n near −z, signed zeros, denormals");
    let mut rng = Pcg32::new(18, 0);
    let mut worst = [0.0f64; 4];
    for _ in 0..1_000_000 {
        let [a, b, c, d] = rng.array().map(f64::from);
        let phi = std::f64::consts::TAU * b;
        let around = |sin: f64, cos: f64| Vec3::new((sin * phi.cos()) as f32, (sin * phi.sin()) as f32, cos as f32);
        let z = 1.0 - 2.0 * a;
        let tiny = 10f64.powf(-8.0 + 6.0 * c);
        let equator = 10f64.powf(-40.0 + 38.0 * c).copysign(d - 0.5);
        let normals = [
            around((1.0 - z * z).sqrt(), z),
            around(tiny.sin(), -tiny.cos()),
            around(tiny.sin(), tiny.cos()),
            around((1.0 - equator * equator).sqrt(), equator),
        ];
        for (worst, n) in worst.iter_mut().zip(normals) {
            *worst = worst.max(gram_error(&Frame::from_normal(n)));
        }
    }
    let names = ["uniform", "1e-8 to 1e-2 from −z", "1e-8 to 1e-2 from +z", "|n_z| down to 1e-40"];
    for (name, worst) in names.into_iter().zip(worst) {
        case.number(format!("{name}, 10⁶"), 0.0, worst, 2.5e-7);
    }
    let axes = [Vec3::Z, -Vec3::Z, Vec3::new(0.0, 1.0, -0.0), Vec3::new(-0.0, -1.0, 0.0), Vec3::X];
    case.number(
        "axes, signed zeros",
        0.0,
        axes.map(|n| gram_error(&Frame::from_normal(n))).into_iter().fold(0.0, f64::max),
        0.0,
    );
    // There and back, handedness, and frames along a tangent, also one that is parallel to n or zero.
    let (mut round_trip, mut hand, mut along, mut none) = (0.0f32, 0.0f32, 0.0f64, 0.0f64);
    for _ in 0..10_000 {
        let (n, w) = (warp::uniform_sphere(rng.array()), warp::uniform_sphere(rng.array()));
        let f = Frame::from_normal(n);
        round_trip = round_trip.max((f.to_world(f.to_local(w)) - w).length()).max((f.to_local(n) - Vec3::Z).length());
        hand = hand.max((f.t.cross(f.b) - n).length());
        let g = Frame::from_normal_tangent(n, w * 3.0);
        along = along.max(if g.t.dot(w) >= 0.0 { gram_error(&g) } else { f64::INFINITY });
        for tangent in [n * 2.0, Vec3::ZERO, Vec3::NAN, Vec3::splat(f32::INFINITY)] {
            none = none.max(gram_error(&Frame::from_normal_tangent(n, tangent)));
        }
    }
    case.number("there and back, 10⁴", 0.0, f64::from(round_trip), 1e-6);
    case.number("t × b − n", 0.0, f64::from(hand), 5e-7);
    case.number("along a tangent", 0.0, along, 1e-5);
    case.number("tangent parallel, 0, NaN, ∞", 0.0, none, 2.5e-7);
    case.close();
}

/// The product has the concentric map alone.
#[test]
fn b19_cosine_rim() {
    let mut case = Case::open("B19", "Cosine-hemisphere sampling at the rim", "pdf → 0");
    let albedo = Vec3::new(0.9, 0.3, 0.1);
    let (mut lowest, mut longest, mut wrong) = (1.0f32, 0.0f64, 0u64);
    let mut check = |u: [f32; 2]| {
        let w = warp::cosine_hemisphere(u);
        lowest = if w.z >= lowest { lowest } else { w.z };
        longest = longest.max((w.as_dvec3().length() - 1.0).abs());
        let sample = Lambert { albedo }.sampled(Vec3::Z, [0.0, u[0], u[1]]);
        wrong += u64::from(!sample.is_some_and(|s| {
            s.pdf_sa > 0.0
                && s.weight == albedo
                && s.pdf_sa == Lambert { albedo }.value(Vec3::Z, s.wi).pdf_sa
                && s.pdf_sa == warp::cosine_hemisphere_pdf(w.z)
        }));
    };
    let ulp = 0.5_f32.powi(24);
    let ends = [0.0, 0.5_f32.powi(32), ulp, 0.5, 0.5 - 0.5 * ulp, 1.0 - 2.0 * ulp, 1.0 - ulp, 1.0];
    ends.into_iter().flat_map(|a| ends.map(|b| [a, b])).for_each(&mut check);
    for x in (0..1 << 16).map(|i| i as f32 / 65_536.0) {
        [[x, 0.0], [x, 1.0 - ulp], [0.0, x], [1.0 - ulp, x]].into_iter().for_each(&mut check);
    }
    let mut rng = Pcg32::new(19, 0);
    (0..10_000_000).for_each(|_| check(rng.array()));
    case.row(
        "lowest cosine",
        "≥ 2⁻¹²",
        format!("{lowest:e}"),
        format!("{:.3} of it", lowest / warp::MIN_COS),
        lowest >= warp::MIN_COS,
    );
    // A clamped rim point is 2⁻²⁵ too long at most; rounding of the disk adds its own.
    case.number("| |w| − 1 |", 0.0, longest, 2.5e-7);
    case.count("density 0, or weight not ρ exactly", 0, wrong);
    case.close();
}
