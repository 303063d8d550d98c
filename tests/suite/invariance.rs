//! The same scene elsewhere, or at another size: the picture may not know. The shared scenes under a root node that
//! scales or moves everything, lights and camera with it; punctual lights in W/sr grow with the square of the scale.
//!
//! Oracles: powers of two scale every f32 operation exactly, so the film has to be the same bit for bit (HARDCASES
//! G10); so it has to be wherever the moved scene, once its new origin is subtracted, has the same placements (G11).
//! Everywhere else rounding may send single paths elsewhere: the same seeds are rendered, and the differences of block
//! means are judged by Student's t over the seeds, with 10⁻⁴ of the mean for rounding itself. Limit: family-wise
//! 10⁻⁴ a comparison (16 blocks of 8×8 pixels, 7 degrees of freedom), at most.

use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3, DVec4};
use pathspace::backend::BackendKind;
use pathspace::film::Film;
use pathspace::plan::Aov;
use pathspace::render::Renderer;
use pathspace::scene::{LoadOptions, Scene};
use serde_json::{Value, json};

use crate::common::{options, render, shared};

const NAMES: [&str; 6] = ["cornell-box", "veach-mis", "glass-caustics", "many-lights", "env-object", "interior"];
const SIDE: u32 = 32;
const BLOCK: u32 = 8;
const SEEDS: u64 = 8;

/// Two-sided point of Student's t, 7 degrees of freedom, at 1e-4/16: 12.2.
const T_LIMIT: f64 = 12.2;

/// Radiance above which a pixel counts as this: at least the mean of every scene.
const CAP: f64 = 1.0;

/// Relative difference that is rounding: roundings of f32 along a path add up to less.
const ROUNDING: f64 = 1e-4;

/// How a scene is changed as a whole.
#[derive(Clone, Copy, Debug)]
enum Change {
    Scale(f64),
    Move([f64; 3]),
}

/// The shared folder with copies of its scenes that are changed; the copies live as long as this.
struct Variants {
    shared: PathBuf,
    folder: tempfile::TempDir,
}

impl Variants {
    fn open(what: &str) -> Option<Self> {
        let shared = shared(what)?;
        let folder = tempfile::tempdir().expect("a temporary folder");
        // Buffers and images are found where they are.
        for entry in std::fs::read_dir(shared.join("scenes")).expect("the shared scenes") {
            let path = entry.expect("an entry").path();
            if path.extension().is_none_or(|extension| extension != "gltf") {
                let link = folder.path().join(path.file_name().expect("a name"));
                std::os::unix::fs::symlink(&path, link).expect("a link in a fresh folder");
            }
        }
        Some(Variants { shared, folder })
    }

    /// The scene `name`, as it is or changed.
    fn load(&self, name: &str, change: Option<Change>) -> Scene {
        let original = self.shared.join(format!("scenes/{name}.gltf"));
        let text = std::fs::read_to_string(&original).expect("a shared scene");
        let mut json: Value = serde_json::from_str(&text).expect("JSON");
        if let Some(change) = change {
            under_one_root(&mut json, change);
        }
        let file = self.folder.path().join(format!("{name}.gltf"));
        std::fs::write(&file, json.to_string()).expect("a writable folder");
        let options = LoadOptions::default().allow_outside(true);
        let mut scene = Scene::load_with(&file, &options).unwrap_or_else(|e| panic!("{name}, {change:?}: {e}"));
        let environment = self.shared.join(format!("scenes/{name}.env.exr"));
        if environment.is_file() {
            scene.load_environment(&environment, 0.0, 1.0).expect("a shared environment");
        }
        scene
    }
}

/// Hangs every root under a new one that carries the change, and lets absolute quantities follow.
fn under_one_root(json: &mut Value, change: Change) {
    let number = json["scene"].as_u64().unwrap_or(0) as usize;
    let roots = json["scenes"][number]["nodes"].take();
    let root = match change {
        Change::Scale(scale) => json!({"children": roots, "scale": [scale, scale, scale]}),
        Change::Move(by) => json!({"children": roots, "translation": by}),
    };
    let nodes = json["nodes"].as_array_mut().expect("nodes");
    nodes.push(root);
    let root = nodes.len() - 1;
    json["scenes"][number]["nodes"] = json!([root]);
    let Change::Scale(scale) = change else { return };
    let scaled = |value: &mut Value, factor: f64| {
        if let Some(number) = value.as_f64() {
            *value = json!(number * factor);
        }
    };
    let lights = json.pointer_mut("/extensions/KHR_lights_punctual/lights").and_then(Value::as_array_mut);
    for light in lights.into_iter().flatten().filter(|light| light["type"] != "directional") {
        scaled(&mut light["intensity"], scale * scale);
    }
    for material in json["materials"].as_array_mut().into_iter().flatten() {
        if let Some(distance) = material.pointer_mut("/extensions/KHR_materials_volume/attenuationDistance") {
            scaled(distance, scale);
        }
    }
}

/// Whether both scenes are placed alike, bit for bit.
fn same_placements(a: &Scene, b: &Scene) -> bool {
    let instances = |scene: &Scene| scene.instances.iter().map(|i| i.world_from_object).collect::<Vec<_>>();
    let cameras = |scene: &Scene| scene.cameras.iter().map(|c| c.world_from_camera).collect::<Vec<_>>();
    let lights = |scene: &Scene| scene.punctual.iter().map(|l| l.position).collect::<Vec<_>>();
    instances(a) == instances(b) && cameras(a) == cameras(b) && lights(a) == lights(b)
}

fn film_hash(scene: &Scene, backend: BackendKind) -> u64 {
    render(scene, options(SIDE, SIDE, 4).backend(backend)).film.hash()
}

/// The backends that a scene of this size is worth.
fn backends(scene: &Scene) -> impl Iterator<Item = BackendKind> {
    let triangles = scene.triangle_count();
    BackendKind::available().iter().copied().filter(move |kind| *kind != BackendKind::Brute || triangles < 1000)
}

#[test]
fn scenes_scaled_by_powers_of_two_give_the_same_bits() {
    let Some(variants) = Variants::open("scale by powers of two") else { return };
    for name in NAMES {
        let base = variants.load(name, None);
        for backend in backends(&base) {
            let expected = film_hash(&base, backend);
            for power in [-20, 20] {
                let scaled = variants.load(name, Some(Change::Scale(f64::exp2(power.into()))));
                assert_eq!(film_hash(&scaled, backend), expected, "{name} at 2^{power} on {}", backend.name());
            }
        }
    }
}

#[test]
fn scenes_moved_far_away_give_the_same_bits_or_the_same_picture() {
    let Some(variants) = Variants::open("moved scenes") else { return };
    let mut exact = 0;
    for name in NAMES {
        let base = variants.load(name, None);
        let far = 1_048_576.0;
        let moves =
            [[far, 0.0, 0.0], [0.0, far, 0.0], [0.0, 0.0, far], [1e5, 0.0, 0.0], [0.0, 1e5, 0.0], [0.0, 0.0, 1e5]];
        for by in moves {
            let moved = variants.load(name, Some(Change::Move(by)));
            // The lattice of origins holds 2^20 m for any of these scenes, and 10^5 m for those of up to 32 m.
            if by.contains(&far) {
                assert_eq!(moved.origin, base.origin + DVec3::from(by), "{name} moved by {by:?}");
            }
            if same_placements(&base, &moved) {
                exact += 1;
                // The largest scene takes long to build: once is enough where everything that is built upon is the
                // same.
                if base.triangle_count() < 500_000 || by == moves[0] {
                    let backend = BackendKind::available()[0];
                    assert_eq!(film_hash(&moved, backend), film_hash(&base, backend), "{name} moved by {by:?}");
                }
            } else {
                same_picture(&format!("{name} moved by {by:?}"), &base, &moved);
            }
        }
        // A distance that no lattice holds: every coordinate rounds anew.
        let moved = variants.load(name, Some(Change::Move([77_777.7, -1e5 / 3.0, 0.1])));
        same_picture(&format!("{name} moved off the lattice"), &base, &moved);
    }
    assert!(exact >= 24, "only {exact} of 36 moved scenes have the placements of the original");
}

#[test]
fn scenes_scaled_by_other_factors_give_the_same_picture() {
    let Some(variants) = Variants::open("scale by other factors") else { return };
    for name in NAMES {
        let base = variants.load(name, None);
        for scale in [1e-3, 1e6] {
            let scaled = variants.load(name, Some(Change::Scale(scale)));
            same_picture(&format!("{name} scaled by {scale:e}"), &base, &scaled);
        }
    }
}

/// Block means of the same seeds differ by rounding and by single paths alone, on every backend (of the largest scene,
/// which takes long to build, on the first).
fn same_picture(what: &str, a: &Scene, b: &Scene) {
    let enough = if a.triangle_count() > 500_000 { 1 } else { usize::MAX };
    for backend in backends(a).filter(|kind| *kind != BackendKind::Brute).take(enough) {
        let what = format!("{what}, {}", backend.name());
        let blocks = |scene: &Scene| -> Vec<Vec<f64>> {
            let options = options(SIDE, SIDE, 4).backend(backend);
            let mut renderer = Renderer::new(scene, options).unwrap_or_else(|e| panic!("{what}: {e}"));
            let mut film_of = |seed| {
                renderer.set_seed(seed);
                renderer.render().unwrap_or_else(|e| panic!("{what}: {e}")).film
            };
            (0..SEEDS).map(|seed| block_means(&film_of(seed))).collect()
        };
        let (a, b) = (blocks(a), blocks(b));
        let brightness = a.iter().flatten().sum::<f64>() / (a.len() * a[0].len()) as f64;
        let (blocks, mut total) = (a[0].len() as f64, (0.0, 0.0));
        for block in 0..a[0].len() {
            let differences: Vec<f64> = (0..a.len()).map(|seed| b[seed][block] - a[seed][block]).collect();
            let n = differences.len() as f64;
            let mean = differences.iter().sum::<f64>() / n;
            let error = (differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
            let level = a.iter().map(|blocks| blocks[block]).sum::<f64>() / n;
            assert!(
                mean.abs() <= T_LIMIT * error + ROUNDING * level,
                "{what}: block {block}: {mean} ± {error} at {level}"
            );
            total = (total.0 + mean, total.1 + error * error);
        }
        // Able to see a twentieth of the picture's brightness.
        let (difference, error) = (total.0 / blocks, total.1.sqrt() / blocks);
        assert!(error * 4.9 <= 0.05 * brightness, "{what}: too noisy, {error} at {brightness}");
        assert!(difference.abs() <= 4.9 * error + ROUNDING * brightness, "{what}: {difference} ± {error}");
    }
}

/// Means of blocks over pixels that count at most [`CAP`]: equal pictures stay equal, and one path that met the rim of
/// a small bright light by a rounding does not hide the rest.
fn block_means(film: &pathspace::film::Film) -> Vec<f64> {
    let across = SIDE / BLOCK;
    let mut sums = vec![0.0; (across * across) as usize];
    for (number, pixel) in (0..).zip(&film.pixels) {
        let (x, y) = (number % SIDE, number / SIDE);
        let mean = pixel.mean();
        sums[(y / BLOCK * across + x / BLOCK) as usize] += ((mean[0] + mean[1] + mean[2]) / 3.0).min(CAP);
    }
    sums.iter().map(|sum| sum / f64::from(BLOCK * BLOCK)).collect()
}

/// What a moved scene reports is where the file has it: the position channel, the camera's matrices, the replay.
#[test]
fn a_moved_scene_reports_the_coordinates_of_its_file() {
    let Some(variants) = Variants::open("coordinates of a moved scene") else { return };
    let by = DVec3::new(0.0, 1_048_576.0, -1e5);
    let options = || options(16, 16, 1).aovs(vec![Aov::POSITION, Aov::DEPTH]);
    let (base, moved) = (variants.load("veach-mis", None), variants.load("veach-mis", Some(Change::Move(by.into()))));
    let first_hits = |film: &Film| {
        let layer = |aov| film.layer(aov).expect("asked for");
        let hits = layer(Aov::DEPTH).into_iter().zip(layer(Aov::POSITION));
        hits.map(|(depth, position)| (depth[0], DVec3::from(position))).collect::<Vec<_>>()
    };
    let at_home = first_hits(&render(&base, options()).film);
    let renderer = Renderer::new(&moved, options()).expect("a valid scene");
    let away = first_hits(&renderer.render().expect("a render").film);
    let values = renderer.camera().world_to_camera(moved.origin).map(f64::from);
    // Row vectors, row-major: columns of the matrix for column vectors.
    let camera_from_world = DMat4::from_cols_array(&values);
    let mut hits = 0;
    let met = |depth: f64| depth < f64::from(f32::MAX);
    for (number, (home, away)) in (0..).zip(at_home.iter().zip(&away)).filter(|(_, (home, _))| met(home.0)) {
        hits += 1;
        assert_eq!(home.0, away.0);
        let (expected, found) = (home.1 + by, away.1);
        // Half an ulp at 2^20 m.
        assert!((found - expected).abs().max_element() <= 0.0626, "{found}, expected {expected}");
        // The matrix is in f32 as well: a metre at most for products of 2^20 m, ten operations of half an ulp each.
        let depth = (camera_from_world * DVec4::from((found, 1.0))).z;
        assert!((depth - away.0).abs() <= 1.0, "{depth} along the axis, expected {}", away.0);
        let told = renderer.replay((number % 16, number / 16), 0).expect("a pixel of the picture");
        assert!(DVec3::from(told.vertices[0].origin_m).distance(by) < 100.0, "{told:?}");
    }
    assert!(hits > 100, "{hits} pixels see something");
}

/// Links to folders and files elsewhere are followed; this test keeps the helper honest.
#[test]
fn an_unchanged_copy_is_the_scene() {
    let Some(variants) = Variants::open("copies of scenes") else { return };
    let original: &Path = &variants.shared.join("scenes/interior.gltf");
    let (copy, original) = (variants.load("interior", None), Scene::load(original).expect("a shared scene"));
    assert!(same_placements(&copy, &original) && copy.textures.len() == original.textures.len());
    assert_eq!(copy.origin, DVec3::ZERO);
}
