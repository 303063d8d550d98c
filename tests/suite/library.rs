//! What the command does, by calls of the library: light for dark scenes, picture size, memory, metadata of an EXR.

use std::path::{Path, PathBuf};

use exr::prelude::{AttributeValue, Text};
use glam::Vec3;
use pathspace::scene::{Environment, EnvironmentFile, LoadOptions};
use pathspace::{Error, RenderOptions, Renderer, Scene};

use crate::common::{options, render};

fn scene_file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name)
}

/// The file has no light. Oracle: the same file with a white environment set by hand; and an environment from a file
/// takes the fallback's place, warning included.
#[test]
fn a_dark_file_is_lit_by_a_white_environment_and_says_so() {
    let (file, map) = (scene_file("env-object/scene.gltf"), scene_file("env-object/env.exr"));
    let mut scene = Scene::load(&file).expect("a scene of the repository");
    assert_eq!(scene.warnings.iter().filter(|w| w.what.starts_with("no light of any kind")).count(), 1);
    let mut dark = Scene::load_with(&file, &LoadOptions::default().fallback_light(false)).expect("loads");
    assert!(!dark.has_light());
    let picture = |scene: &Scene| render(scene, options(8, 8, 2)).film;
    assert!(picture(&dark).pixels.iter().all(|pixel| pixel.mean()[..3] == [0.0; 3]));
    dark.environment = Some(Environment::constant(Vec3::ONE));
    assert_eq!(picture(&scene).hash(), picture(&dark).hash());

    scene.load_environment(&map, 0.5, 2.0).expect("a map of the repository");
    assert!(scene.warnings.iter().all(|warning| !warning.what.starts_with("no light")), "{:?}", scene.warnings);
    let environment = EnvironmentFile { rotation_rad: 0.5, intensity: 2.0, ..EnvironmentFile::new(&map) };
    let at_once = Scene::load_with(&file, &LoadOptions::default().environment(environment)).expect("loads");
    assert_eq!(at_once.warnings, scene.warnings);
    assert_eq!(picture(&at_once).hash(), picture(&scene).hash());
}

/// Oracle: samples 5, 6 and 7 were rendered.
#[test]
fn the_sample_range_of_an_exr_begins_where_the_render_did() {
    let scene = Scene::load(scene_file("cornell-box/scene.gltf")).expect("a scene of the repository");
    let renderer = Renderer::new(&scene, options(8, 8, 3).sample_start(5)).expect("valid options");
    let render = renderer.render().expect("renders");
    let exr = renderer.exr_options(&render);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("range.exr");
    render.film.write_exr(&path, &exr).expect("a writable folder");
    let image = exr::prelude::read_first_flat_layer_from_file(&path).expect("just written");
    let range = image.layer_data.attributes.other.get(&Text::from("pathspace/sampleRange")).cloned();
    assert_eq!(range, Some(AttributeValue::Text(Text::from("5..8"))));
    assert!(exr.view.is_some() && exr.render_seconds.is_some() && exr.plan.is_some_and(|plan| plan.contains("stages")));
}

#[test]
fn a_picture_has_the_size_of_the_scene_and_must_fit() {
    let scene = Scene::load(scene_file("cornell-box/scene.gltf")).expect("a scene of the repository");
    let options = RenderOptions::for_scene(&scene);
    assert_eq!(Some((options.width, options.height)), scene.suggested_size);
    let huge = options.size(65536, 65536);
    assert!(matches!(huge.check_memory(), Err(Error::Option { .. })));
    // Made ready it can be, as for a replay; rendered it cannot.
    let renderer = Renderer::new(&scene, huge).expect("valid options");
    assert!(matches!(renderer.render(), Err(Error::Option { .. })));
}
