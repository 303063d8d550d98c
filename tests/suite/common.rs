//! What the transport tests share: rendering a scene made in code, probing one ray, the shared folder.

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command};

use glam::{Affine3A, Vec3};
use pathspace::film::Film;
use pathspace::plan::options::{CameraChoice, FilterKind, RenderOptions, SamplerKind};
use pathspace::render::{Render, Renderer};
use pathspace::scene::{Camera, Projection, Scene};
use pathspace_stat::Moments;

/// `../shared`, or `None` with a message when the checkout stands alone.
pub fn shared(what: &str) -> Option<PathBuf> {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared"));
    if path.is_dir() {
        Some(path)
    } else {
        eprintln!("SKIPPED {what}: {} is absent", path.display());
        None
    }
}

/// Options for tests: box filter, so that pixels are independent.
pub fn options(width: u32, height: u32, spp: u64) -> RenderOptions {
    RenderOptions::new(width, height).spp(spp).filter(FilterKind::Box)
}

/// Renders, panicking with the error's text.
pub fn render(scene: &Scene, options: RenderOptions) -> Render {
    let renderer = Renderer::new(scene, options).unwrap_or_else(|e| panic!("{e}"));
    renderer.render().unwrap_or_else(|e| panic!("{e}"))
}

/// Waits until a child with `--progress ndjson` and a pipe for stdout says that every pixel has a sample. What it says
/// from then on is read by a thread, so that it never waits for room in the pipe.
pub fn wait_for_samples(child: &mut Child) {
    let mut lines = BufReader::new(child.stdout.take().expect("piped")).lines().map_while(Result::ok);
    let has_samples = |line: String| {
        let line: serde_json::Value = serde_json::from_str(&line).expect("an object a line");
        line["type"] == "progress" && line["spp"].as_u64() > Some(0)
    };
    assert!(lines.any(has_samples), "it ended before every pixel had a sample");
    std::thread::spawn(move || lines.for_each(drop));
}

/// Sends the signal of that name: "INT".
pub fn signal(child: &Child, name: &str) {
    // The shell's own `kill`: a bare Debian has no program of that name.
    let sent = Command::new("sh").args(["-c", &format!("kill -{name} {}", child.id())]).status();
    assert!(sent.is_ok_and(|status| status.success()), "kill -{name}");
}

/// Means of independent estimates: count, mean and the variance of one estimate, per channel.
#[derive(Clone, Copy, Debug, Default)]
pub struct Estimate {
    /// Number of independent estimates.
    pub n: f64,
    /// Mean.
    pub mean: [f64; 3],
    /// Sample variance of one estimate.
    pub variance: [f64; 3],
}

impl Estimate {
    /// From values that are independent and alike.
    pub fn of(values: impl Iterator<Item = [f64; 3]> + Clone) -> Self {
        let n = values.clone().count() as f64;
        let mean = values.clone().fold([0.0; 3], |a, v| std::array::from_fn(|c| a[c] + v[c] / n));
        let variance =
            values.fold([0.0; 3], |a, v| std::array::from_fn(|c| a[c] + (v[c] - mean[c]).powi(2) / (n - 1.0)));
        Estimate { n, mean, variance }
    }

    /// From the pixels of a film whose filter is a box.
    pub fn of_pixels(film: &Film) -> Self {
        Estimate::of(film.pixels.iter().map(|pixel| {
            let [r, g, b, _] = pixel.mean();
            [r, g, b]
        }))
    }

    /// From the moments of one number.
    pub fn of_moments(moments: &Moments) -> Self {
        Estimate { n: moments.n as f64, mean: [moments.mean; 3], variance: [moments.variance(); 3] }
    }

    /// The same estimates times `factor`.
    pub fn scaled(self, factor: f64) -> Self {
        let Estimate { n, mean, variance } = self;
        Estimate { n, mean: mean.map(|m| m * factor), variance: variance.map(|v| v * factor * factor) }
    }

    /// Standard error of the mean.
    pub fn standard_error(&self, channel: usize) -> f64 {
        (self.variance[channel] / self.n).sqrt()
    }

    /// T1 of HARDCASES §1.3: within 4.9 standard errors (two-sided 1e-6) plus `tau`, and able to see a relative bias
    /// of `delta`.
    pub fn expect(&self, what: &str, expected: f64, tau: f64, delta: f64) {
        for c in 0..3 {
            let limit = 4.9 * self.standard_error(c);
            let difference = (self.mean[c] - expected).abs();
            assert!(
                difference <= limit + tau,
                "{what}, channel {c}: {} ± {} expected {expected}, off by {:.2} standard errors",
                self.mean[c],
                self.standard_error(c),
                difference / self.standard_error(c)
            );
            assert!(
                limit <= delta * expected.abs(),
                "{what}, channel {c}: too noisy to see a bias of {delta}: {limit} > {}",
                delta * expected.abs()
            );
        }
    }
}

/// The radiance probe: `n` independent samples of the radiance that arrives at `origin` from `direction`. Each pixel of
/// an image whose rays are all the same is one sample with a seed of its own.
pub fn probe(scene: &Scene, origin: Vec3, direction: Vec3, n: u32, options: RenderOptions) -> Estimate {
    Estimate::of_pixels(&probe_film(scene, origin, direction, n, options).film)
}

/// The render behind [`probe`].
pub fn probe_film(scene: &Scene, origin: Vec3, direction: Vec3, n: u32, options: RenderOptions) -> Render {
    let mut scene = scene.clone();
    scene.cameras.push(single_ray(origin, direction));
    let side = (n as f64).sqrt().ceil() as u32;
    let spp = options.spp.unwrap_or(1);
    render(
        &scene,
        options
            .size(side, side)
            .spp(spp)
            .camera(CameraChoice::Index(scene.cameras.len() - 1))
            .filter(FilterKind::Box)
            .sampler(SamplerKind::Independent),
    )
}

/// A camera whose rays are all the same: parallel, with a film too small to move an origin.
pub fn single_ray(origin: Vec3, direction: Vec3) -> Camera {
    let back = -direction.as_dvec3().normalize();
    let right = back.any_orthonormal_vector();
    Camera {
        name: "probe".into(),
        world_from_camera: Affine3A {
            matrix3: glam::Mat3A::from_cols(right.as_vec3a(), back.cross(right).as_vec3a(), back.as_vec3a()),
            translation: origin.into(),
        },
        projection: Projection::Orthographic { xmag_m: 1e-30, ymag_m: 1e-30 },
    }
}
