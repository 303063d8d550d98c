//! Models of the Khronos sample set, each a matter of one extension, as they looked when they were last looked at
//! beside their screenshots (`make gallery`): means and variances of blocks against goldens, with the statistics of
//! [`asset`](crate::asset). In the light and from the camera that a file without either gets.
//!
//! `make golden` writes the goldens anew; that is a commit of its own, which says why.

use std::collections::BTreeMap;
use std::path::PathBuf;

use pathspace::Scene;
use pathspace::backend::BackendKind;
use pathspace::film::Film;
use pathspace_stat::t_limit;

use crate::asset::{BLOCK, Golden, Judged, judge};
use crate::common::{options, render, shared};

const GOLDEN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/models.json");

/// Files in the folder of the set.
const MODELS: [&str; 6] = [
    "AnisotropyStrengthTest/glTF-Binary/AnisotropyStrengthTest.glb",
    "AttenuationTest/glTF-Binary/AttenuationTest.glb",
    "MorphPrimitivesTest/glTF-Binary/MorphPrimitivesTest.glb",
    "SheenChair/glTF/SheenChair.gltf",
    "SpecularTest/glTF-Binary/SpecularTest.glb",
    "VertexColorTest/glTF-Binary/VertexColorTest.glb",
];

const SIZE: (u32, u32) = (32, 32);
/// Samples per pixel of the test, and of the golden.
const SPP: (u64, u64) = (64, 2048);
const SEED: (u64, u64) = (11, 29);

/// Chance of a false alarm over all pictures, if all random numbers were changed.
const FALSE_ALARMS: f64 = 1e-4;

fn folder() -> Option<PathBuf> {
    let folder = shared("pictures of models")?.join("assets/khronos");
    if !folder.is_dir() {
        eprintln!("SKIPPED pictures of models: {} is absent", folder.display());
        return None;
    }
    Some(folder)
}

fn picture(file: PathBuf, spp: u64, seed: u64) -> Film {
    let scene = Scene::load(file).unwrap_or_else(|e| panic!("{e}"));
    render(&scene, options(SIZE.0, SIZE.1, spp).backend(BackendKind::Obvhs).seed(seed)).film
}

#[test]
fn models_look_as_they_did() {
    let Some(folder) = folder() else { return };
    let goldens: BTreeMap<String, Golden> =
        serde_json::from_slice(&std::fs::read(GOLDEN).expect("the goldens are in the repository")).expect("valid JSON");
    assert!(goldens.keys().eq(MODELS), "{:?}", goldens.keys());
    let blocks: usize = goldens.values().map(|golden| golden.mean.len()).sum();
    let limit = t_limit(f64::from(BLOCK * BLOCK), FALSE_ALARMS / (3 * blocks) as f64);
    for (file, golden) in &goldens {
        let Judged { worst, faults, sees } = judge(&picture(folder.join(file), SPP.0, SEED.0), SIZE, golden, limit);
        println!("{file}: worst t {worst:.2} of {limit:.2}; blocks are known to {:.1} % in the mean", 100.0 * sees);
        assert!(sees < 0.25, "{file}: too noisy to judge: {sees}");
        assert!(faults.is_empty(), "{file}:\n{}", faults.join("\n"));
    }
}

#[test]
#[ignore = "`make golden` runs it: it writes tests/golden"]
fn write() {
    let folder = folder().expect("the goldens are made from the models");
    let recipe = format!(
        "make golden; {}x{} pixels in blocks of {BLOCK}, {} samples per pixel, seed {}, box filter, obvhs",
        SIZE.0, SIZE.1, SPP.1, SEED.1
    );
    let golden = |file: &str| Golden::of(&picture(folder.join(file), SPP.1, SEED.1), SIZE, recipe.clone());
    let goldens: BTreeMap<&str, Golden> = MODELS.iter().map(|file| (*file, golden(file))).collect();
    let text = serde_json::to_string(&goldens).expect("plain numbers").replace("],[", "],\n[");
    std::fs::write(GOLDEN, text + "\n").expect("the checkout is writable");
}
