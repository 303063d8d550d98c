//! What denoisers are told, and the one that is called. Oracles: scenes in which the way of every path is known by
//! hand; the picture without. Deterministic but where it says otherwise.

use std::path::Path;
use std::process::{Command, Output};

use exr::prelude::{AnyChannel, FlatSamples, read_first_flat_layer_from_file};
use glam::{DVec3, Vec3};
use pathspace::film::Film;
use pathspace::film::exr::text_attribute;
use pathspace::film::oidn::{Oidn, VARIABLE};
use pathspace::plan::Aov;
use pathspace::plan::options::Strategy;
use pathspace::render::Renderer;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Environment, Material, Projection, Scene};

use crate::common::{options, render};

const GUIDES: [Aov; 2] = [Aov::DENOISE_ALBEDO, Aov::DENOISE_NORMAL];
const RED: Vec3 = Vec3::new(0.75, 0.25, 0.125);
const SHEEN: Vec3 = Vec3::new(0.5, 0.75, 1.0);

/// A square across the view of a camera with parallel rays along −z, turned by 45° so that a mirror sends them to +x; a
/// red wall there, before the upper half of the square.
fn before_a_wall(surface: Material) -> Scene {
    let mut b = SceneBuilder::new();
    let (red, surface) = (b.lambert(RED), b.material(surface));
    b.quad([[-2.0, -2.0, 2.0], [2.0, -2.0, -2.0], [2.0, 2.0, -2.0], [-2.0, 2.0, 2.0]].map(Vec3::from), surface);
    b.quad([(4.0, 0.0, 9.0), (4.0, 9.0, 9.0), (4.0, 9.0, -9.0), (4.0, 0.0, -9.0)].map(Vec3::from), red);
    let parallel = Projection::Orthographic { xmag_m: 1.0, ymag_m: 1.0 };
    b.any_camera(Vec3::new(0.0, 0.0, 9.0), Vec3::ZERO, Vec3::Y, parallel);
    b.environment(Environment::constant(Vec3::ONE));
    b.build()
}

fn mirror() -> Material {
    Material { base_color: SHEEN, metallic: 1.0, roughness: 0.0, ..Material::default() }
}

/// Pixels of the upper and of the lower half of a layer.
fn halves(film: &Film, aov: Aov) -> [Vec<DVec3>; 2] {
    let layer = film.layer(aov).expect("asked for");
    let (upper, lower) = layer.split_at(layer.len() / 2);
    [upper, lower].map(|pixels| pixels.iter().copied().map(DVec3::from).collect())
}

fn all_are(what: &str, pixels: &[DVec3], expected: Vec3) {
    for (p, found) in pixels.iter().enumerate() {
        assert!(found.distance(expected.as_dvec3()) < 1e-6, "{what}, pixel {p}: {found}, expected {expected}");
    }
}

/// In a mirror the wall is seen with its own normal; where the mirror shows the sky, its albedo is 1 and its normal
/// that of the mirror. The other layers keep to what is met first.
#[test]
fn mirrors_show_what_is_behind_them() {
    let aovs = [Aov::ALBEDO, Aov::NORMAL, GUIDES[0], GUIDES[1]];
    let film = render(&before_a_wall(mirror()), options(8, 8, 4).aovs(aovs)).film;
    let own = Vec3::new(1.0, 0.0, 1.0).normalize();
    let [wall, sky] = halves(&film, Aov::DENOISE_ALBEDO);
    all_are("the wall", &wall, RED);
    all_are("the sky", &sky, Vec3::ONE);
    let [wall, sky] = halves(&film, Aov::DENOISE_NORMAL);
    all_are("the wall's normal", &wall, Vec3::NEG_X);
    all_are("the mirror's normal", &sky, own);
    halves(&film, Aov::ALBEDO).iter().for_each(|half| all_are("the mirror's colour", half, SHEEN));
    halves(&film, Aov::NORMAL).iter().for_each(|half| all_are("the mirror", half, own));
}

/// What scatters otherwise as well is not followed: rough metal, and a smooth coat over a diffuse base, which paths are
/// reflected by as by a mirror.
#[test]
fn other_surfaces_are_not_followed() {
    let rough = Material { roughness: 0.5, ..mirror() };
    let coated = Material { base_color: SHEEN, metallic: 0.0, roughness: 0.0, ..Material::default() };
    for material in [rough, coated] {
        let film = render(&before_a_wall(material), options(8, 8, 16).aovs(GUIDES)).film;
        halves(&film, Aov::DENOISE_ALBEDO).iter().for_each(|half| all_are("the surface", half, SHEEN));
    }
}

/// A pane between the camera and a wall: what it reflects of the sky counts 1, what it shows of the wall the wall's
/// albedo, so that all channels tell one share. Oracle: that share, and that of a pane seen straight on, Fresnel's
/// 0.04 once at the front and less at the back: between 0.03 and 0.09 in the mean over 16 384 paths.
#[test]
fn glass_is_the_blend_of_what_it_reflects_and_shows() {
    let pane = Material { metallic: 0.0, roughness: 0.0, transmission: 1.0, ..Material::default() };
    let mut b = SceneBuilder::new();
    let (red, pane) = (b.lambert(RED), b.material(pane));
    let square = |z: f32| [(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)].map(|(x, y)| Vec3::new(x, y, z));
    b.quad(square(0.0), pane).quad(square(-1.0), red);
    b.any_camera(Vec3::Z, Vec3::ZERO, Vec3::Y, Projection::Orthographic { xmag_m: 1.0, ymag_m: 1.0 });
    b.environment(Environment::constant(Vec3::ONE));
    let film = render(&b.build(), options(8, 8, 256).aovs(GUIDES)).film;
    let mut mean = 0.0;
    for (albedo, normal) in film.layer(GUIDES[0]).iter().flatten().zip(film.layer(GUIDES[1]).iter().flatten()) {
        let share = |c: usize| (albedo[c] - f64::from(RED[c])) / (1.0 - f64::from(RED[c]));
        assert!((share(0) - share(1)).abs() < 1e-6 && (share(0) - share(2)).abs() < 1e-6, "{albedo:?}");
        assert!(DVec3::from(*normal).distance(DVec3::Z) < 1e-6, "{normal:?}");
        mean += share(0) / 64.0;
    }
    assert!((0.03..0.09).contains(&mean), "{mean}");
}

/// Layers that are kept by halves are the sums of these, add up over parts of the samples, and change no bit of the
/// picture; without them there is no stage.
#[test]
fn guides_are_kept_by_halves_and_merge() {
    let scene = before_a_wall(Material { roughness: 0.5, ..mirror() });
    let part = |start, spp| render(&scene, options(8, 8, spp).sample_start(start).aovs(GUIDES)).film;
    let (whole, mut first) = (part(0, 4), part(0, 2));
    let [a, b] = [0, 1].map(|half| whole.layer_of_half(GUIDES[0], half).expect("by halves"));
    for (p, mean) in whole.layer(GUIDES[0]).expect("asked for").iter().enumerate() {
        assert!((0..3).all(|c| (mean[c] - (a[p][c] + b[p][c]) / 2.0).abs() < 1e-12));
    }
    first.merge(&part(2, 2)).expect("the same picture");
    assert!(first == whole && first.digest() == whole.digest());
    let plain = Renderer::new(&scene, options(8, 8, 4)).expect("a valid scene");
    assert!(!plain.plan().stages.contains(&"denoiser-layers"));
    assert_eq!(plain.render().expect("renders").film.hash(), whole.hash());
}

/// The filter, or `None` with a message where it is not installed. One that is named must be there.
fn filter() -> Option<Oidn> {
    let found = Oidn::open(None, 1);
    assert!(found.is_ok() || std::env::var_os(VARIABLE).is_none(), "{}", found.expect_err("it is not there"));
    found.map_err(|error| eprintln!("SKIPPED denoising: {error}")).ok()
}

/// A room without anything sharp in it but its edges, lit from behind the camera, without light samples: noise alone.
/// Its measured error is less than a fifth of the noise's, beyond doubt; here it is a fiftieth.
#[test]
fn noise_without_detail_is_filtered_away() {
    let Some(filter) = filter() else { return };
    let mut b = SceneBuilder::new();
    let (grey, lamp) = (b.lambert(Vec3::splat(0.5)), b.emitter(Vec3::ZERO, Vec3::ONE));
    b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, grey);
    b.quad([(-0.9, -0.9), (-0.9, 0.9), (0.9, 0.9), (0.9, -0.9)].map(|(x, y)| Vec3::new(x, y, 0.99)), lamp);
    b.camera(Vec3::new(0.0, 0.0, 0.9), Vec3::ZERO, Vec3::Y, 1.0);
    let film = render(&b.build(), options(48, 48, 8).aovs(GUIDES).strategy(Strategy::BSDF)).film;
    let error = film.denoise(&filter).expect("it runs").error.expect("both halves have samples");
    assert!(error.relmse + 4.9 * error.relmse_stderr < 0.2 * error.unfiltered_relmse, "{error:?}");
    assert!(error.mse + 4.9 * error.mse_stderr < 0.2 * error.unfiltered_mse, "{error:?}");
}

fn pathspace(folder: &Path, line: &str) -> Output {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("pathspace"));
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.gltf");
    let words = line.split(' ').map(|word| if word == "SCENE" { scene } else { word });
    command.args(words).current_dir(folder).env_remove("SLURM_CPUS_PER_TASK").output().expect("the binary starts")
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A library that is not there is said to be before anything is rendered, in one line with what to do; nothing is
/// written.
#[test]
fn a_missing_library_is_one_line() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = pathspace(folder.path(), "render SCENE -o a.exr --spp 1 --denoise --oidn /nowhere");
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(said(&output).lines().count() == 1 && said(&output).contains("pip install pyoidn"), "{}", said(&output));
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
    let output = pathspace(folder.path(), "render SCENE -o a.png --spp 1 --denoiser-layers");
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
}

/// The filtered picture is a layer beside an untouched beauty; its error is measured and told; previews show it.
/// Oracle: the same render without.
#[test]
fn the_denoised_picture_stands_beside_the_beauty() {
    if filter().is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let line = "render SCENE --width 32 --height 32 --spp 8 --reproducible -o";
    let output = pathspace(folder.path(), &format!("{line} a.exr --png a.png"));
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let output = pathspace(folder.path(), &format!("{line} b.exr --png b.png --denoise --stats b.json"));
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(said(&output).contains("; denoised "), "{}", said(&output));
    let read = |name: &str| {
        let image = read_first_flat_layer_from_file(folder.path().join(name)).expect("just written");
        image.layer_data.channel_data.list
    };
    let (plain, denoised) = (read("a.exr"), read("b.exr"));
    let channel = |list: &[AnyChannel<FlatSamples>], name: &str| -> Vec<f32> {
        let found = list.iter().find(|channel| channel.name.eq(name)).unwrap_or_else(|| panic!("no channel {name}"));
        found.sample_data.values_as_f32().collect()
    };
    for name in ["R", "G", "B", "A"] {
        assert_eq!(channel(&plain, name), channel(&denoised, name), "{name}");
    }
    for name in ["denoised.R", "denoised.G", "denoised.B", "denoise_albedo.R", "denoise_normal.Z"] {
        assert!(channel(&denoised, name).iter().all(|value| value.is_finite()), "{name}");
    }
    assert_ne!(channel(&denoised, "denoised.R"), channel(&denoised, "R"));
    let file = |name: &str| std::fs::read(folder.path().join(name)).expect("just written");
    assert_ne!(file("a.png"), file("b.png"));
    let stats: serde_json::Value = serde_json::from_slice(&file("b.json")).expect("JSON");
    let measured = &stats["denoised"]["measured"];
    let number = |name: &str| measured[name].as_f64().unwrap_or_else(|| panic!("no number {name}: {measured}"));
    assert_eq!(number("spp"), 4.0);
    assert!(number("mse_stderr") > 0.0 && number("unfiltered_mse") > 0.0, "{measured}");
    let told = stats["bias"]
        .as_array()
        .expect("a list")
        .iter()
        .any(|bias| bias["what"].as_str().is_some_and(|what| what.starts_with("denoise, layer 'denoised' alone")));
    assert!(told, "{}", stats["bias"]);
    let attribute = text_attribute(&folder.path().join("b.exr"), "pathspace/denoised").expect("written");
    assert!(attribute.contains("unfiltered_relmse"), "{attribute}");
}
