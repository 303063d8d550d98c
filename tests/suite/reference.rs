//! The six scenes against the pictures of an independent renderer (`../shared/reference`), on every backend that can
//! render them: is the mean right, and is any part of the picture wrong?
//!
//! Statistics. With the box filter a film pixel covers s×s pixels of the reference and is compared with their mean
//! rᵢ. Pixels are independent and E(mᵢ − rᵢ) = 0 if nothing is wrong, so a block of n film pixels (16×16 or
//! more) gives Student's t = √n·D̄/s_D from its differences alone: noise of the film and of the reference both show
//! in their scatter, and nothing is assumed of either. (The variances by the film's halves have one degree of freedom
//! each; where a few pixels at the rim of a light hold all the variance, two equal halves would make such a block look
//! certain.) The limit is that of n − 1 degrees at 1e-4 over all blocks and channels of a picture (Bonferroni). The
//! mean of the picture is tested in the same way over all pixels, and has to be known well enough to see the tolerance
//! of `expect.toml`.
//!
//! The film's own variance then has to explain the whole error: over pixels, ((mᵢ − rᵢ)² − vᵢ)/(rᵢ² + ε)
//! has the mean own_relMSE/s², v by the film's halves and own_relMSE the reference's remaining noise. Errors below the
//! noise of a block that are spread over the picture show here.
//!
//! What the models differ in. The reference's renderer interpolates an environment's rows at v·(H − 1) where glTF's
//! conventions (and ours) have texel centres, v·H − ½: up to half a row at the poles, 1e-3 of the sky near the
//! horizon. The test renders with a map resampled to those rows, see [`rows_from_edge_to_edge`].
//!
//! `PATHSPACE_FULL_REFERENCE=1 cargo test --release full_size -- --nocapture` does the same at the reference's own
//! size.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::Vec3;
use pathspace::backend::BackendKind;
use pathspace::film::Film;
use pathspace::film::estimate::RELMSE_EPSILON;
use pathspace::film::exr::{Picture, read_exr};
use pathspace::scene::{Environment, Scene};
use pathspace_stat::{Moments, t_limit, z_limit};

use crate::common::{options, render, shared};
use crate::conformance;

/// Chance that a picture without any defect fails in some block; that it fails in its mean; in its error.
const FALSE_ALARMS: f64 = 1e-4;

/// The reference's passes sum 128 to 512 samples in f32: the sum is off by about √(512/12)·2⁻²⁴ ≈ 2⁻²¹ of
/// itself. Four times that is taken off each difference. Where neither picture has noise it is all that remains.
const REFERENCE_ROUNDING: f64 = 1.0 / (1 << 19) as f64;

/// Film pixels along the side of a block. Its mean has to be near normal: the rare bright paths (sunlight by way of the
/// knot, 40 times the mean) have to come some fifty times, and in a block of 16 at 32 samples per pixel they come four.
fn block_side(name: &str) -> u32 {
    if name == "env-object" { 64 } else { 16 }
}

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
/// lies at v = 0 and its last at v = 1. Sixteen rows fill each gap; what remains are kinks rounded off over a
/// sixteenth of a row, which moves the mean of the rows beside a kink by 1/2048 of the change of slope.
fn rows_from_edge_to_edge(map: &Environment) -> Environment {
    const FILL: usize = 16;
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
    /// Differences of all pixels by channel, and the mean of the reference.
    whole: [Moments; 3],
    mean: [f64; 3],
    /// t per block and channel, row-major; the limit of its absolute value.
    t: Vec<[f64; 3]>,
    limit: f64,
    /// Squared errors less the film's own variance, relative as in relMSE.
    unexplained: Moments,
}

impl Comparison {
    /// mean(film)/mean(reference).
    fn ratio(&self, channel: usize) -> f64 {
        1.0 + self.whole[channel].mean / self.mean[channel]
    }

    /// Standard error of [`ratio`](Self::ratio).
    fn ratio_error(&self, channel: usize) -> f64 {
        self.whole[channel].standard_error() / self.mean[channel]
    }

    /// Largest |t|, its sign kept, and its block.
    fn worst(&self) -> (f64, usize) {
        let all = self.t.iter().enumerate().flat_map(|(block, t)| t.iter().map(move |&t| (t, block)));
        all.max_by(|a, b| a.0.abs().total_cmp(&b.0.abs())).expect("at least one block")
    }
}

fn compare(film: &Film, expectation: &Expectation, scale: u32, side: u32) -> Comparison {
    let reference = expectation.reduced(scale);
    let (width, columns) = (film.resolution.0, film.resolution.0 / side);
    let n = film.pixels.len() as f64;
    let mut mean = [0.0; 3];
    for pixel in &reference {
        (0..3).for_each(|c| mean[c] += pixel[c] / n);
    }
    let epsilon = RELMSE_EPSILON * ((mean[0] + mean[1] + mean[2]) / 3.0).powi(2);

    let mut blocks = vec![[Moments::default(); 3]; (columns * (film.resolution.1 / side)) as usize];
    let (mut whole, mut unexplained) = ([Moments::default(); 3], Moments::default());
    for (i, (pixel, reference)) in film.pixels.iter().zip(&reference).enumerate() {
        let block = (i as u32 / width / side * columns + i as u32 % width / side) as usize;
        let (ours, variance) = (pixel.mean(), pixel.variance().expect("both halves have samples"));
        let mut relative = 0.0;
        for c in 0..3 {
            let difference = ours[c] - reference[c];
            whole[c].push(difference);
            relative += (difference * difference - variance[c]) / (reference[c] * reference[c] + epsilon) / 3.0;
            let rounding = REFERENCE_ROUNDING * reference[c];
            blocks[block][c].push((difference.abs() - rounding).max(0.0).copysign(difference));
        }
        unexplained.push(relative);
    }
    let t = |m: &Moments| if m.mean == 0.0 { 0.0 } else { m.mean / m.standard_error() };
    let t = blocks.iter().map(|block| block.each_ref().map(t)).collect();
    let limit = t_limit(f64::from(side * side - 1), FALSE_ALARMS / (3 * blocks.len()) as f64);
    Comparison { whole, mean, t, limit, unexplained }
}

/// Renders the scene on each backend at 1/`scale` of the reference's size with about `paths` paths and holds it against
/// the reference. `power` is the largest error of the mean that may stay unseen, in tolerances of the scene.
fn hold(name: &str, scale: u32, paths: u64, power: f64) {
    let Some(expectation) = Expectation::read(name) else { return };
    let scene = expectation.load();
    let (width, height) = (expectation.size.0 / scale, expectation.size.1 / scale);
    let spp = (paths / u64::from(width * height)).next_multiple_of(2);
    let side = block_side(name);
    let mut wrong = Vec::new();
    // The loop over all triangles has no business with pictures.
    let others = |kind: &&BackendKind| **kind != BackendKind::Brute && !conformance::is_skipped(**kind);
    for (seed, &backend) in BackendKind::available().iter().filter(others).enumerate() {
        let start = std::time::Instant::now();
        // The reference loses what normal maps send below the surface.
        let base = options(width, height, spp).seed(2000 + seed as u64).backend(backend).fold_normals(false);
        let done = render(&scene, base);
        let c = compare(&done.film, &expectation, scale, side);
        let ((t, block), limit) = (c.worst(), c.limit);
        let corner = (block as u32 * side % width * scale, block as u32 * side / width * side * scale);
        let own = expectation.own_relmse / f64::from(scale * scale);
        let [ratio, error] = [Comparison::ratio, Comparison::ratio_error].map(|f| [0, 1, 2].map(|i| f(&c, i)));
        eprintln!(
            "{name:14} {:6} {width}x{height} {spp:4} spp  mean ratio {ratio:.5?} ± {error:.5?}  worst block \
             t {t:6.2} of {limit:.2} at {corner:?}  \
             unexplained relMSE {:.5} ± {:.5}, reference's own {own:.5}  {:.1} s",
            backend.name(),
            c.unexplained.mean,
            c.unexplained.standard_error(),
            start.elapsed().as_secs_f64(),
        );

        let mut faults = Vec::new();
        let normal = z_limit(3, FALSE_ALARMS);
        for channel in 0..3 {
            let (off, seen) = ((ratio[channel] - 1.0).abs(), normal * error[channel]);
            if off > seen {
                faults.push(format!("mean of channel {channel} off by {off:.5}, limit {seen:.5}"));
            }
            if seen > power * expectation.mean_tolerance {
                faults.push(format!("too noisy: errors of the mean below {seen:.5} stay unseen"));
            }
        }
        if t.abs() > limit {
            faults.push(format!("block at {corner:?}: t = {t:.2}, limit {limit:.2}"));
        }
        let z = (c.unexplained.mean - own) / c.unexplained.standard_error();
        if z.abs() > z_limit(1, FALSE_ALARMS) {
            faults.push(format!("film's and reference's noise do not explain the error: z = {z:.2}"));
        }
        if done.counters.nonfinite > 0 {
            faults.push(format!("{} samples are not finite", done.counters.nonfinite));
        }
        if !faults.is_empty() || std::env::var_os("PATHSPACE_KEEP_PICTURES").is_some() {
            keep(&format!("{name}-{}", backend.name()), &done.film, &c, side);
        }
        wrong.extend(faults.iter().map(|fault| format!("{}: {fault}", backend.name())));
    }
    assert!(wrong.is_empty(), "{name}: {}", wrong.join("; "));
}

/// Writes the picture and the map of t over its limit: grey is 0, black and white the limit.
fn keep(stem: &str, film: &Film, comparison: &Comparison, side: u32) {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR"));
    film.write_exr(directory.join(format!("{stem}.exr")), &Default::default()).unwrap_or_else(|e| panic!("{e}"));
    film.write_png(directory.join(format!("{stem}.png")), 0.0).unwrap_or_else(|e| panic!("{e}"));
    let bytes = comparison.t.iter().flatten().map(|t| (127.5 * (1.0 + t / comparison.limit)).clamp(0.0, 255.0) as u8);
    let (columns, rows) = (film.resolution.0 / side, film.resolution.1 / side);
    let map = image::RgbImage::from_raw(columns, rows, bytes.collect()).expect("three bytes per block");
    let path = directory.join(format!("{stem}-t.png"));
    map.save(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    eprintln!("see {}", directory.join(format!("{stem}*")).display());
}

/// Paths per picture in the suite, rendered at half the reference's size.
const PATHS: u64 = 2 << 20;

#[test]
fn cornell_box() {
    hold("cornell-box", 2, PATHS, 3.0);
}

#[test]
fn veach_mis() {
    hold("veach-mis", 2, PATHS, 3.0);
}

#[test]
fn env_object() {
    hold("env-object", 2, PATHS, 3.0);
}

#[test]
fn glass_caustics() {
    hold("glass-caustics", 2, PATHS, 3.0);
}

#[test]
fn many_lights() {
    hold("many-lights", 2, PATHS, 3.0);
}

#[test]
fn interior() {
    hold("interior", 2, PATHS, 3.0);
}

/// All six at the reference's own size with enough samples to see the tolerance of the mean.
#[test]
fn full_size() {
    if std::env::var_os("PATHSPACE_FULL_REFERENCE").is_none() {
        eprintln!("SKIPPED full_size: takes 10 minutes; set PATHSPACE_FULL_REFERENCE=1 to run it");
        return;
    }
    for name in ["cornell-box", "veach-mis", "env-object", "glass-caustics", "many-lights", "interior"] {
        hold(name, 1, 16 << 20, 1.0);
    }
}
