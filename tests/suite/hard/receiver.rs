//! The irradiance meter of the light cases: a small Lambert patch of albedo ½ under some lights, looked at from close
//! by; what it reflects times π/ρ is the irradiance. And many means that share a row of the table.

use std::f64::consts::PI;
use std::fmt::Display;

use glam::{DVec3, Vec3};
use pathspace::film::Pixel;
use pathspace::plan::options::{FilterKind, RenderOptions, SamplerKind, Strategy};
use pathspace::render::Render;
use pathspace::scene::Scene;
use pathspace::scene::builder::SceneBuilder;

use super::Case;
use super::modes::Mode;
use crate::common::{Estimate, probe, probe_film, render};

/// Albedo of the patch.
const RHO: f32 = 0.5;

/// The three estimators that have to agree.
pub const STRATEGIES: [Strategy; 3] = [Strategy::BSDF, Strategy::LIGHT, Strategy::MIS];

/// A receiver under what `lights` adds to the scene.
pub struct Receiver<'a> {
    pub at: Vec3,
    pub normal: Vec3,
    /// Half the side of the patch, m. The eye is twice as far above it.
    pub half_m: f32,
    pub lights: &'a dyn Fn(&mut SceneBuilder),
}

impl<'a> Receiver<'a> {
    /// A patch of 2 mm.
    pub fn new(at: Vec3, normal: Vec3, lights: &'a dyn Fn(&mut SceneBuilder)) -> Self {
        Receiver { at, normal, half_m: 1e-3, lights }
    }

    /// The lights, whatever else they bring, and the patch.
    pub fn scene(&self) -> Scene {
        let mut b = SceneBuilder::new();
        let patch = b.lambert(Vec3::splat(RHO));
        let (s, t) = self.normal.any_orthonormal_pair();
        let (s, t) = if s.cross(t).dot(self.normal) > 0.0 { (s, t) } else { (t, s) };
        let (p, s, t) = (self.at, s * self.half_m, t * self.half_m);
        b.quad([p - s - t, p + s - t, p + s + t, p - s + t], patch);
        (self.lights)(&mut b);
        b.build()
    }

    /// Where the eye is.
    pub fn eye(&self) -> Vec3 {
        self.at + self.normal * (2.0 * self.half_m)
    }

    /// The irradiance, W/m², from `n` samples of paths of two edges.
    pub fn irradiance(&self, n: u64, options: RenderOptions) -> Estimate {
        let (pixels, options) = spread(n, options.max_depth(2));
        probe(&self.scene(), self.eye(), -self.normal, pixels, options).scaled(PI / f64::from(RHO))
    }

    /// A render of paths of two edges with a pixel a sample.
    pub fn render(&self, n: u32, options: RenderOptions) -> Render {
        let options = options.max_depth(2).spp(1);
        probe_film(&self.scene(), self.eye(), -self.normal, n, options)
    }

    /// The irradiance from `n` pixels of one sample, so that the variance of a single sample can be judged.
    pub fn single_samples(&self, n: u32, options: RenderOptions) -> Estimate {
        Estimate::of_pixels(&self.render(n, options).film).scaled(PI / f64::from(RHO))
    }
}

/// Mean of a picture over `n` independent samples, from its pixels.
pub fn picture(scene: &Scene, n: u64, options: RenderOptions) -> Estimate {
    let side = (n / 4).min(1 << 14).isqrt();
    let options = options.spp(n / (side * side));
    let side = side as u32;
    let film = options.size(side, side).filter(FilterKind::Box).sampler(SamplerKind::Independent);
    // Pixels differ in their means: each is its own stratum, and its halves tell its variance.
    let film = render(scene, film).film;
    let count = film.pixels.len() as f64;
    let variance = film
        .pixels
        .iter()
        .filter_map(Pixel::variance)
        .fold([0.0; 3], |a, v| std::array::from_fn(|c| a[c] + v[c] / count));
    let [r, g, b, _] = film.mean();
    Estimate { n: count, mean: [r, g, b], variance }
}

/// `n` samples as pixels and samples a pixel: few pixels are cheaper, and their means as good.
pub fn spread(n: u64, options: RenderOptions) -> (u32, RenderOptions) {
    let pixels = n.min(1 << 14);
    (pixels as u32, options.spp(n / pixels))
}

/// Bias that a mean of `n` samples has to be able to see: 5e-3 at 2^20.
pub fn delta(n: u64) -> f64 {
    5e-3 * ((1u64 << 20) as f64 / n as f64).sqrt()
}

/// The same of a sample that is 0 or 1/p, in pixels as [`spread`] has them: its deviation is known, and 4.9 standard
/// errors of what the pixels make of it come on top.
pub fn bernoulli_delta(p: f64, n: u64) -> f64 {
    let odds = 1.0 / p - 1.0;
    let pixels = spread(n, RenderOptions::default()).0 as f64;
    let excess_kurtosis = (1.0 / (p * (1.0 - p)) - 6.0) * pixels / n as f64;
    4.9 * (odds / n as f64).sqrt() * (1.0 + 4.9 * ((2.0 + excess_kurtosis) / (4.0 * pixels)).sqrt())
}

/// [`delta`] for a strategy: BSDF sampling of a light of radiance 1 is a draw of E/π.
pub fn delta_of(strategy: Strategy, irradiance: f64, n: u64) -> f64 {
    if strategy == Strategy::BSDF { bernoulli_delta(irradiance / PI, n) } else { delta(n) }
}

/// Default options of a strategy in a mode.
pub fn with(mode: &Mode, strategy: Strategy, seed: u64) -> RenderOptions {
    mode.options(RenderOptions::default().strategy(strategy).seed(seed))
}

/// Means that are judged alike; the worst of them makes the row.
#[derive(Default)]
pub struct Means(Vec<Mean>);

struct Mean {
    what: String,
    expected: [f64; 3],
    tau: f64,
    delta: f64,
    estimate: Estimate,
}

impl Means {
    /// One grey mean.
    pub fn add(&mut self, what: impl Display, expected: f64, tau: f64, delta: f64, estimate: Estimate) {
        self.add_color(what, [expected; 3], tau, delta, estimate);
    }

    /// One mean of three channels.
    pub fn add_color(&mut self, what: impl Display, expected: [f64; 3], tau: f64, delta: f64, estimate: Estimate) {
        self.0.push(Mean { what: what.to_string(), expected, tau, delta, estimate });
    }

    /// Adds the row of the mean that is nearest to failing.
    pub fn judge(self, case: &mut Case, on: impl Display) {
        let count = self.0.len();
        let worst = self.0.into_iter().max_by(|a, b| a.badness().total_cmp(&b.badness())).expect("at least one mean");
        let on =
            if count > 1 { format!("{on}, worst of {count}: {}", worst.what) } else { format!("{on}, {}", worst.what) };
        case.mean(on, worst.expected, worst.tau, worst.delta, &worst.estimate);
    }
}

impl Mean {
    /// Above 1 where the mean fails.
    fn badness(&self) -> f64 {
        let of = |c: usize| {
            let band = 4.9 * self.estimate.standard_error(c);
            let off = ((self.estimate.mean[c] - self.expected[c]).abs() - self.tau).max(0.0);
            let off = if off > 0.0 { off / band } else { 0.0 };
            off.max(band / (self.delta * self.expected[c].abs()))
        };
        let badness = (0..3).map(of).fold(0.0, |a: f64, b| if b <= a { a } else { b });
        if badness.is_nan() { f64::INFINITY } else { badness }
    }
}

/// Irradiance at `p` of a flat polygon of radiance 1 (Lambert 1760), above 0 where its front faces `p`. The part below
/// the horizon of `n` is cut off.
pub fn polygon_irradiance(p: DVec3, n: DVec3, corners: &[DVec3]) -> f64 {
    let mut cut = Vec::with_capacity(corners.len() + 2);
    for (i, a) in corners.iter().enumerate() {
        let (a, b) = (*a - p, corners[(i + 1) % corners.len()] - p);
        let (h_a, h_b) = (a.dot(n), b.dot(n));
        if h_a >= 0.0 {
            cut.push(a);
        }
        if h_a * h_b < 0.0 {
            cut.push(a + (b - a) * (h_a / (h_a - h_b)));
        }
    }
    let edge = |i: usize| {
        let (a, b) = (cut[i], cut[(i + 1) % cut.len()]);
        let cross = a.cross(b);
        let sin = cross.length();
        if sin > 0.0 { sin.atan2(a.dot(b)) * n.dot(cross) / sin } else { 0.0 }
    };
    -0.5 * (0..cut.len()).map(edge).sum::<f64>()
}

/// Irradiance of a closed mesh of radiance 1 that is convex and faces outward, or inward around the receiver.
pub fn mesh_irradiance(p: DVec3, n: DVec3, positions: &[Vec3], triangles: &[[u32; 3]]) -> f64 {
    let corner = |i: u32| positions[i as usize].as_dvec3();
    let of = |t: &[u32; 3]| polygon_irradiance(p, n, &t.map(corner)).max(0.0);
    triangles.iter().map(of).sum()
}
