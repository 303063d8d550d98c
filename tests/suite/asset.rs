//! A production-style asset (FlightHelmet: 15 textures, normal maps, blended lenses) under a photographed environment
//! against a golden: the mean of every block of 8×8 pixels with its variance, from a render with many samples.
//!
//! Statistics. A block's variance is the sum of its pixels' own (64 differences of two halves), so a block's difference
//! to the golden over its standard error is Student's t of 64 degrees and more. The limit is that for 10⁻⁴ over all
//! blocks and channels (Bonferroni), plus 0.3 % of the block: what filtering textures otherwise, at this size, may
//! change. So the test survives other random numbers, and sees a material, light or texture that changes a block by
//! more than its noise (the rows say how much that is). Rare bright paths (the sun by way of a lens) make t wider than
//! Student's; 256 samples are enough here.
//!
//! `make golden` writes the golden anew; that is a commit of its own, which says why.

use std::path::PathBuf;

use glam::{Affine3A, Mat3A, Vec3};
use pathspace::Scene;
use pathspace::backend::BackendKind;
use pathspace::film::Film;
use pathspace::scene::{Camera, Projection};
use pathspace_stat::t_limit;
use serde::{Deserialize, Serialize};

use crate::common::{options, render, shared};

const GOLDEN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/flight-helmet.json");

const SIZE: (u32, u32) = (64, 80);
/// Side of a block, pixels.
pub const BLOCK: u32 = 8;
/// Samples per pixel of the test, and of the golden.
const SPP: (u64, u64) = (128, 4096);
const SEED: (u64, u64) = (11, 29);

/// Chance of a false alarm over all blocks and channels of one picture, if all random numbers were changed.
const FALSE_ALARMS: f64 = 1e-4;
/// Share of a block that is not put down to noise.
const TOLERANCE: f64 = 0.003;

/// A picture as its blocks.
#[derive(Serialize, Deserialize)]
pub struct Golden {
    /// What to do to get it.
    pub recipe: String,
    /// Row-major from the top left: mean by channel, W·sr⁻¹·m⁻².
    pub mean: Vec<[f64; 3]>,
    /// Variance of each mean.
    pub variance: Vec<[f64; 3]>,
}

impl Golden {
    /// Of a picture of this size, to six digits.
    pub fn of(film: &Film, size: (u32, u32), recipe: String) -> Self {
        let short = |values: Vec<[f64; 3]>| {
            let digits = |x: f64| format!("{x:.5e}").parse().expect("a number that was just written");
            values.into_iter().map(|value| value.map(digits)).collect()
        };
        let (mean, variance) = blocks(film, size);
        Golden { recipe, mean: short(mean), variance: short(variance) }
    }
}

/// What a picture is held against a golden for.
pub struct Judged {
    /// Largest t of a block.
    pub worst: f64,
    /// What is over the limit.
    pub faults: Vec<String>,
    /// Relative error that a block could have without being over it, in the mean.
    pub sees: f64,
}

/// Holds a picture of this size against its golden; `limit` is that of t.
pub fn judge(film: &Film, size: (u32, u32), golden: &Golden, limit: f64) -> Judged {
    let (means, variances) = blocks(film, size);
    assert_eq!(means.len(), golden.mean.len());
    let mut judged = Judged { worst: 0.0, faults: Vec::new(), sees: 0.0 };
    for (place, (mean, variance)) in means.iter().zip(&variances).enumerate() {
        for c in 0..3 {
            let (expected, noise) = (golden.mean[place][c], (variance[c] + golden.variance[place][c]).sqrt());
            // Blocks that show nothing but a constant have no noise.
            let rest = ((mean[c] - expected).abs() - TOLERANCE * expected).max(0.0);
            let t = if rest > 0.0 { rest / noise } else { 0.0 };
            judged.worst = judged.worst.max(t);
            judged.sees += limit * noise / expected / (3 * means.len()) as f64;
            if t > limit {
                let (x, y) = (place as u32 % (size.0 / BLOCK), place as u32 / (size.0 / BLOCK));
                judged.faults.push(format!("block {x},{y} channel {c}: {} expected {expected}, t = {t:.1}", mean[c]));
            }
        }
    }
    judged
}

/// The asset and its light, looked at from the front left; `None` with a message where it is absent.
fn helmet() -> Option<Scene> {
    let folder = shared("the picture of FlightHelmet")?.join("assets");
    let (asset, sky) =
        (folder.join("FlightHelmet/FlightHelmet.gltf"), folder.join("environments/spiaggia_di_mondello_1k.hdr"));
    if let Some(absent) = [&asset, &sky].into_iter().find(|path| !path.exists()) {
        eprintln!("SKIPPED the picture of FlightHelmet: {} is absent", absent.display());
        return None;
    }
    let mut scene = Scene::load(asset).unwrap_or_else(|e| panic!("{e}"));
    scene.load_environment(sky, 0.0, 1.0).unwrap_or_else(|e| panic!("{e}"));
    let (eye, target) = (Vec3::new(-0.45, 0.62, 1.1), Vec3::new(-0.02, 0.38, 0.01));
    let back = (eye - target).normalize();
    let right = Vec3::Y.cross(back).normalize();
    scene.cameras = vec![Camera {
        name: "front left".into(),
        world_from_camera: Affine3A {
            matrix3: Mat3A::from_cols(right.into(), back.cross(right).into(), back.into()),
            translation: eye.into(),
        },
        projection: Projection::Perspective { yfov_rad: 0.6, aspect: None },
    }];
    Some(scene)
}

/// Means and variances of the blocks.
fn blocks(film: &Film, size: (u32, u32)) -> (Vec<[f64; 3]>, Vec<[f64; 3]>) {
    let n = f64::from(BLOCK * BLOCK);
    let (mut means, mut variances) = (Vec::new(), Vec::new());
    for by in (0..size.1).step_by(BLOCK as usize) {
        for bx in (0..size.0).step_by(BLOCK as usize) {
            let (mut mean, mut variance) = ([0.0; 3], [0.0; 3]);
            for (x, y) in (0..BLOCK * BLOCK).map(|i| (bx + i % BLOCK, by + i / BLOCK)) {
                let pixel = film.pixel(x, y);
                let own = pixel.variance().expect("both halves have samples");
                for c in 0..3 {
                    mean[c] += pixel.mean()[c] / n;
                    variance[c] += own[c] / (n * n);
                }
            }
            means.push(mean);
            variances.push(variance);
        }
    }
    (means, variances)
}

fn picture(scene: &Scene, backend: BackendKind, spp: u64, seed: u64) -> Film {
    render(scene, options(SIZE.0, SIZE.1, spp).backend(backend).seed(seed)).film
}

#[test]
fn flight_helmet_looks_as_it_did() {
    let Some(scene) = helmet() else { return };
    let golden: Golden =
        serde_json::from_slice(&std::fs::read(GOLDEN).expect("the golden is in the repository")).expect("valid JSON");
    let limit = t_limit(f64::from(BLOCK * BLOCK), FALSE_ALARMS / (3 * golden.mean.len()) as f64);
    for &backend in BackendKind::available().iter().filter(|kind| **kind != BackendKind::Brute) {
        let film = picture(&scene, backend, SPP.0, SEED.0);
        let Judged { worst, faults, sees } = judge(&film, SIZE, &golden, limit);
        println!(
            "{}: worst t {worst:.2} of {limit:.2}; blocks are known to {:.1} % in the mean",
            backend.name(),
            100.0 * sees
        );
        // A test that sees nothing proves nothing.
        assert!(sees < 0.25, "{}: too noisy to judge: {sees}", backend.name());
        if !faults.is_empty() {
            let path = std::env::temp_dir().join(format!("flight-helmet-{}.exr", backend.name()));
            film.write_exr(&path, &Default::default()).unwrap_or_else(|e| panic!("{e}"));
            panic!("{} (picture: {}):\n{}", backend.name(), path.display(), faults.join("\n"));
        }
    }
}

#[test]
#[ignore = "`make golden` runs it: it writes tests/golden"]
fn write() {
    let scene = helmet().expect("the golden is made from the asset");
    let film = picture(&scene, BackendKind::available()[0], SPP.1, SEED.1);
    let recipe = format!(
        "make golden; {}x{} pixels in blocks of {BLOCK}, {} samples per pixel, seed {}, box filter, {}",
        SIZE.0,
        SIZE.1,
        SPP.1,
        SEED.1,
        BackendKind::available()[0].name()
    );
    let golden = Golden::of(&film, SIZE, recipe);
    let path = PathBuf::from(GOLDEN);
    std::fs::create_dir_all(path.parent().expect("a folder")).expect("the checkout is writable");
    let text = serde_json::to_string(&golden).expect("plain numbers").replace("],[", "],\n[");
    std::fs::write(path, text + "\n").expect("the checkout is writable");
}
