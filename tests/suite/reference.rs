//! The six scenes against the pictures of an independent renderer (`../shared/reference`), on every backend that can
//! render them: is the mean right, and is any part of the picture wrong?
//!
//! Statistics. The film is cut into blocks of 16×16 pixels of the reference. A block of n film pixels with means mᵢ and
//! variances vᵢ (by the film's halves; one degree of freedom each, unbiased also for Sobol points, whose halves are
//! scrambled independently) gives t = Σ(mᵢ − rᵢ)/√((1 + κ)Σvᵢ), rᵢ the mean of the pixels of the reference that film pixel
//! i covers: with the box filter, exactly its footprint. Degrees of freedom by Satterthwaite: ν = (Σσᵢ²)²/Σσᵢ⁴, and as
//! E v² = 3σ⁴ for one degree, ν = 3(Σvᵢ)²/Σvᵢ². Few bright outliers make ν small and the limit wide. The limit is that of
//! Student's t at 1e-4 over all blocks and channels of a picture (Bonferroni). The mean of the picture has its own t.
//!
//! κ is the reference's variance as a share of ours. Both renderers sum the same kind of samples, so the reference's
//! variance is taken to lie where ours lies, and is scaled to what its .json states: own_relMSE is the mean of v/(R² + ε)
//! over its pixels and channels, so κ = own_relMSE/s² ÷ mean of vᵢ/(rᵢ² + ε) for film pixels that cover s² of its pixels.
//! At half the reference's size κ is a few percent or less, so that its shape hardly matters.
//!
//! What the models differ in. The reference's renderer interpolates an environment's rows at v·(H − 1) where glTF's
//! conventions (and ours) have texel centres, v·H − ½: up to half a row at the poles, 1e-3 of the sky near the horizon.
//! The test renders with a map resampled to those rows; see [`rows_from_edge_to_edge`].
//!
//! `PATHSPACE_FULL_REFERENCE=1 cargo test --release full_size -- --nocapture` does the same at the reference's own size.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::Vec3;
use pathspace::backend::BackendKind;
use pathspace::film::Film;
use pathspace::film::estimate::RELMSE_EPSILON;
use pathspace::film::exr::{Picture, read_exr};
use pathspace::plan::options::RenderOptions;
use pathspace::scene::{Environment, Scene};
use pathspace_stat::{t_limit, z_limit};

use crate::common::{options, render, shared};

/// Pixels of the reference along the side of a block.
const BLOCK: u32 = 16;

/// Chance that a picture without any defect fails in some block, and that it fails in its mean.
const FALSE_ALARMS: f64 = 1e-4;

/// A sum of 512 samples in f32, as the reference's passes are made, is off by about √(512/12)·2⁻²⁴ ≈ 2⁻²¹·³ of itself;
/// four times that is taken off every difference. Where neither picture has noise it is all that remains.
const REFERENCE_ROUNDING: f64 = 1.0 / (1 << 19) as f64;

/// What `expect.toml` says.
struct Expectation {
    scene: PathBuf,
    environment: Option<PathBuf>,
    size: (u32, u32),
    mean_tolerance: f64,
    own_relmse: f64,
    reference: Picture,
}

impl Expectation {
    /// Of one scene; `None` with a message where its files are not at hand.
    fn read(name: &str) -> Option<Self> {
        let shared = shared(name)?;
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let directory = root.join("scenes").join(name);
        let text = std::fs::read_to_string(directory.join("expect.toml")).expect("each scene has an expect.toml");
        let table: toml::Table = text.parse().unwrap_or_else(|e| panic!("{name}: {e}"));
        let [width, height] = [0, 1].map(|i| table["size"][i].as_integer().expect("a size") as u32);
        let own_relmse = table["reference"]["own_relmse"].as_float().expect("a number");
        // The interior is generated; the shared copy is the same.
        let mut scene = directory.join(table["scene"].as_str().expect("a path"));
        if !scene.exists() {
            scene = shared.join("scenes").join(format!("{name}.gltf"));
        }
        let reference = root.join(table["reference"]["file"].as_str().expect("a path"));
        for path in [&scene, &reference] {
            if !path.exists() {
                eprintln!("SKIPPED {name}: {} is absent", path.display());
                return None;
            }
        }
        let reference = read_exr(&reference).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((reference.width, reference.height), (width as usize, height as usize), "{name}");
        Some(Expectation {
            scene,
            environment: table.get("env").map(|env| directory.join(env.as_str().expect("a path"))),
            size: (width, height),
            mean_tolerance: table["mean_tolerance"].as_float().expect("a number"),
            own_relmse,
            reference,
        })
    }

    /// The scene, lit as the reference is.
    fn load(&self) -> Scene {
        let mut scene = Scene::load(&self.scene).unwrap_or_else(|e| panic!("{e}"));
        if let Some(path) = &self.environment {
            scene.load_environment(path, 0.0, 1.0).unwrap_or_else(|e| panic!("{e}"));
            scene.environment = scene.environment.as_ref().map(rows_from_edge_to_edge);
        }
        scene
    }

    /// Means of the reference over squares of `scale` pixels.
    fn reduced(&self, scale: u32) -> Vec<[f64; 3]> {
        let (width, height, scale) = (self.size.0 / scale, self.size.1 / scale, scale as usize);
        let mut means = vec![[0.0; 3]; (width * height) as usize];
        for (i, pixel) in self.reference.rgb.iter().enumerate() {
            let (x, y) = (i % self.reference.width / scale, i / self.reference.width / scale);
            for (mean, value) in means[y * width as usize + x].iter_mut().zip(pixel) {
                *mean += f64::from(*value) / (scale * scale) as f64;
            }
        }
        means
    }
}

/// A map that a lookup at texel centres reads as the reference's renderer reads the given one: its first row of texels
/// lies at v = 0 and its last at v = 1. Each gap between rows is filled with four; what remains are kinks rounded off
/// over a quarter of a row.
fn rows_from_edge_to_edge(map: &Environment) -> Environment {
    const FILL: usize = 4;
    let height = FILL * (map.height - 1);
    let mut texels = Vec::with_capacity(map.width * height);
    for row in 0..height {
        let (above, part) = (row / FILL, (row % FILL) as f32 / FILL as f32 + 0.5 / FILL as f32);
        let texel = |column: usize, row: usize| map.texels[row * map.width + column];
        texels.extend((0..map.width).map(|column| texel(column, above).lerp(texel(column, above + 1), part)));
    }
    let texels: Arc<[Vec3]> = texels.into();
    Environment { height, texels, ..map.clone() }
}

/// How a film compares with its reference.
struct Comparison {
    /// mean(film)/mean(reference) per channel, and its standard error.
    ratio: [f64; 3],
    ratio_error: [f64; 3],
    /// t as a fraction of its limit, per block and channel; row-major.
    excess: Vec<[f64; 3]>,
    /// The largest of them, its t and its limit, and the first pixel of the reference in its block.
    worst: (f64, f64, f64, (u32, u32)),
    /// √ mean t² over blocks with noise; about 1.
    rms: f64,
    /// The reference's variance as a share of the film's.
    kappa: f64,
}

/// Sums over the pixels of a block, one channel.
#[derive(Clone, Copy, Default)]
struct Sums {
    difference: f64,
    variance: f64,
    variance_squared: f64,
    rounding: f64,
}

fn compare(film: &Film, expectation: &Expectation, scale: u32) -> Comparison {
    let reference = expectation.reduced(scale);
    let (width, side) = (film.resolution.0, BLOCK / scale);
    let columns = width / side;
    let n = film.pixels.len() as f64;

    let mut mean = [0.0; 3];
    for pixel in &reference {
        (0..3).for_each(|c| mean[c] += pixel[c] / n);
    }
    let epsilon = RELMSE_EPSILON * ((mean[0] + mean[1] + mean[2]) / 3.0).powi(2);

    let mut blocks = vec![[Sums::default(); 3]; (columns * (film.resolution.1 / side)) as usize];
    let (mut whole, mut relative) = ([Sums::default(); 3], 0.0);
    for (i, (pixel, reference)) in film.pixels.iter().zip(&reference).enumerate() {
        let (x, y) = (i as u32 % width, i as u32 / width);
        let (ours, variance) = (pixel.mean(), pixel.variance().expect("both halves have samples"));
        for c in 0..3 {
            relative += variance[c] / (reference[c] * reference[c] + epsilon) / (3.0 * n);
            for sums in [&mut blocks[(y / side * columns + x / side) as usize][c], &mut whole[c]] {
                sums.difference += ours[c] - reference[c];
                sums.variance += variance[c];
                sums.variance_squared += variance[c] * variance[c];
                sums.rounding += REFERENCE_ROUNDING * reference[c];
            }
        }
    }
    let kappa = expectation.own_relmse / f64::from(scale * scale) / relative;
    let level = FALSE_ALARMS / (3 * blocks.len()) as f64;
    let (mut worst, mut square, mut noisy) = ((0.0, 0.0, 0.0, (0, 0)), 0.0, 0.0);
    let mut excess = vec![[0.0; 3]; blocks.len()];
    for (b, block) in blocks.iter().enumerate() {
        for (c, sums) in block.iter().enumerate() {
            let difference = (sums.difference.abs() - sums.rounding).max(0.0).copysign(sums.difference);
            if difference == 0.0 {
                continue;
            }
            let t = difference / ((1.0 + kappa) * sums.variance).sqrt();
            let dof = if sums.variance > 0.0 { 3.0 * sums.variance.powi(2) / sums.variance_squared } else { 1.0 };
            let limit = t_limit(dof, level);
            (square, noisy) = (square + t * t, noisy + 1.0);
            excess[b][c] = t / limit;
            if (t / limit).abs() > worst.0 {
                let corner = (b as u32 % columns * BLOCK, b as u32 / columns * BLOCK);
                worst = ((t / limit).abs(), t, limit, corner);
            }
        }
    }
    let ratio = [0, 1, 2].map(|c| 1.0 + whole[c].difference / (n * mean[c]));
    let ratio_error = [0, 1, 2].map(|c| ((1.0 + kappa) * whole[c].variance).sqrt() / (n * mean[c]));
    Comparison { ratio, ratio_error, excess, worst, rms: (square / f64::max(noisy, 1.0)).sqrt(), kappa }
}

/// Renders the scene on each backend at 1/`scale` of the reference's size with about `paths` paths and holds it against the
/// reference. `power` is the largest error of the mean that may stay unseen, in tolerances of the scene.
fn hold(name: &str, scale: u32, paths: u64, power: f64) {
    let Some(expectation) = Expectation::read(name) else { return };
    let scene = expectation.load();
    let (width, height) = (expectation.size.0 / scale, expectation.size.1 / scale);
    let spp = (paths / u64::from(width * height)).next_multiple_of(2);
    let mut wrong = Vec::new();
    // The loop over all triangles has no business with pictures.
    for (seed, &backend) in BackendKind::available().iter().filter(|b| **b != BackendKind::Brute).enumerate() {
        let start = std::time::Instant::now();
        let base = RenderOptions { seed: 2000 + seed as u64, backend: Some(backend), ..options(width, height, spp) };
        let done = render(&scene, base);
        let c = compare(&done.film, &expectation, scale);
        let (excess, t, limit, corner) = c.worst;
        eprintln!(
            "{name:14} {:6} {width}x{height} {spp:4} spp  ratio {:.5} {:.5} {:.5} ± {:.5} {:.5} {:.5}  worst block {t:6.2} of \
             {limit:5.2} at {corner:?}  rms t {:.3}  kappa {:.4}  {:.1} s",
            backend.name(),
            c.ratio[0],
            c.ratio[1],
            c.ratio[2],
            c.ratio_error[0],
            c.ratio_error[1],
            c.ratio_error[2],
            c.rms,
            c.kappa,
            start.elapsed().as_secs_f64(),
        );

        let limit = z_limit(3, FALSE_ALARMS);
        let before = wrong.len();
        for channel in 0..3 {
            let (off, error) = ((c.ratio[channel] - 1.0).abs(), limit * c.ratio_error[channel]);
            if off > error {
                wrong.push(format!("{}: mean of channel {channel} off by {off:.5}, limit {error:.5}", backend.name()));
            }
            if error > power * expectation.mean_tolerance {
                wrong.push(format!("{}: too noisy: sees errors of the mean from {error:.5} on", backend.name()));
            }
        }
        if excess > 1.0 {
            wrong.push(format!("{}: block at {corner:?}: t = {t:.2}", backend.name()));
        }
        if wrong.len() > before || std::env::var_os("PATHSPACE_KEEP_PICTURES").is_some() {
            keep(&format!("{name}-{}", backend.name()), &done.film, &c);
        }
    }
    assert!(wrong.is_empty(), "{name}: {}", wrong.join("; "));
}

/// Writes the picture and the map of t over its limit: grey is 0, black and white the limit.
fn keep(stem: &str, film: &Film, comparison: &Comparison) {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR"));
    film.write_exr(directory.join(format!("{stem}.exr")), &Default::default()).unwrap_or_else(|e| panic!("{e}"));
    film.write_png(directory.join(format!("{stem}.png")), 0.0).unwrap_or_else(|e| panic!("{e}"));
    let columns = (comparison.excess.len() as f64 * f64::from(film.resolution.0) / f64::from(film.resolution.1)).sqrt();
    let bytes = comparison.excess.iter().flatten().map(|e| (127.5 * (1.0 + e)).clamp(0.0, 255.0) as u8).collect();
    let (columns, rows) = (columns as u32, comparison.excess.len() as u32 / columns as u32);
    let map = image::RgbImage::from_raw(columns, rows, bytes).expect("three bytes per block");
    let path = directory.join(format!("{stem}-t.png"));
    map.save(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    eprintln!("see {}", directory.join(format!("{stem}*")).display());
}

/// Paths per picture in the suite, rendered at half the reference's size.
const PATHS: u64 = 2 << 20;

#[test]
fn cornell_box() {
    hold("cornell-box", 2, PATHS, 1.0);
}

#[test]
fn veach_mis() {
    hold("veach-mis", 2, PATHS, 1.0);
}

#[test]
fn env_object() {
    hold("env-object", 2, PATHS, 1.0);
}

#[test]
fn glass_caustics() {
    hold("glass-caustics", 2, PATHS, 1.0);
}

#[test]
fn many_lights() {
    hold("many-lights", 2, PATHS, 1.0);
}

#[test]
fn interior() {
    hold("interior", 2, PATHS, 1.0);
}

/// All six at the reference's own size with enough samples to see the tolerance of the mean.
#[test]
fn full_size() {
    if std::env::var_os("PATHSPACE_FULL_REFERENCE").is_none() {
        eprintln!("SKIPPED full_size: takes 10 minutes; set PATHSPACE_FULL_REFERENCE=1 to run it");
        return;
    }
    for name in ["cornell-box", "veach-mis", "env-object", "glass-caustics", "many-lights", "interior"] {
        hold(name, 1, 32 << 20, 1.0);
    }
}
