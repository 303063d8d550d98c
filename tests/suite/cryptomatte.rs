//! Layers of ids: whose names and how much of each pixel. Oracles: scenes whose parts are known by hand, the numbers of
//! the specification, and the file read back by the `exr` crate. `scripts/cryptomatte.py` reads one by a program that
//! is not ours.

use std::collections::BTreeMap;

use exr::prelude::{AttributeValue, Text, read_first_flat_layer_from_file};
use glam::{Affine3A, Vec3};
use pathspace::film::Film;
use pathspace::film::cryptomatte::id_of;
use pathspace::film::ids::Ids;
use pathspace::plan::Aov;
use pathspace::render::{FilterKind, Renderer};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{AlphaMode, Material, MaterialId, Projection, Scene};
use serde_json::json;

use crate::common::{options, render};
use crate::determinism::room;
use crate::loading::fixture::Fixture;

const ALL: [Aov; 3] = [Aov::CRYPTO_OBJECT, Aov::CRYPTO_MATERIAL, Aov::CRYPTO_ASSET];

/// A wall up to a quarter of pixel column 4 of 8, a curtain of opacity 1/4 before columns 0 and 1, a net before all
/// that is wholly cut out, seen by parallel rays. Two of them belong to one asset.
fn stage() -> Scene {
    let mut b = SceneBuilder::new();
    let named = |name: &str, alpha_mode, base_alpha| Material {
        name: name.into(),
        metallic: 0.0,
        specular: 0.0,
        alpha_mode,
        base_alpha,
        ..Material::default()
    };
    let plaster = b.material(named("плитка", AlphaMode::Opaque, 1.0));
    let veil = b.material(named("veil \"thin\"", AlphaMode::Blend, 0.25));
    let net = b.material(named("net", AlphaMode::Mask { cutoff: 0.5 }, 0.25));
    let screen = |b: &mut SceneBuilder, (left, right): (f32, f32), z: f32, material: MaterialId| {
        b.quad([(left, -2.0), (right, -2.0), (right, 2.0), (left, 2.0)].map(|(x, y)| Vec3::new(x, y, z)), material);
    };
    screen(&mut b, (-2.0, 0.0625), -1.0, plaster);
    b.named("wall", "set");
    screen(&mut b, (-2.0, -0.5), 0.0, veil);
    b.named("curtain", "set");
    screen(&mut b, (-2.0, 2.0), 0.5, net);
    b.named("net", "net");
    b.point_light(Vec3::new(0.0, 0.0, 3.0), Vec3::ONE);
    b.any_camera(Vec3::Z * 2.0, Vec3::ZERO, Vec3::Y, Projection::Orthographic { xmag_m: 1.0, ymag_m: 1.0 });
    b.build()
}

/// Shares of a pixel by name, of names that it can have.
fn shares(ids: &Ids, names: &[&'static str]) -> BTreeMap<&'static str, f64> {
    let name = |id: u32| *names.iter().find(|name| id_of(name) == id).unwrap_or_else(|| panic!("no name of {id:08x}"));
    ids.ranked().into_iter().map(|(id, share)| (name(id), share)).collect()
}

/// Oracle: by hand. 64 samples of a pixel are 32 points of each half that are stratified in x, so an edge at a quarter
/// is met exactly; what is blended within 4.9 standard errors of 16 × 64 independent choices (10⁻⁶).
#[test]
fn shares_are_those_of_the_scene() {
    let film = render(&stage(), options(8, 8, 64).aovs(ALL)).film;
    let names = [["wall", "curtain", "net"], ["плитка", "veil \"thin\"", "net"]];
    let [objects, materials, assets] = ALL.map(|aov| film.ids(aov).expect("asked for"));
    let mut curtain = 0.0;
    for p in 0..64 {
        let object = shares(&objects[p], &names[0]);
        match p % 8 {
            column @ 0..=3 => {
                assert_eq!(object.values().sum::<f64>(), 1.0, "{p}: {object:?}");
                assert!(column < 2 || object["wall"] == 1.0, "{p}: {object:?}");
                assert_eq!(shares(&assets[p], &["set"])["set"], 1.0, "both are parts of it");
                if column < 2 {
                    curtain += object["curtain"] / 16.0;
                    assert_eq!(shares(&materials[p], &names[1])["veil \"thin\""], object["curtain"]);
                }
            }
            4 => assert_eq!(object, BTreeMap::from([("wall", 0.25)]), "{p}"),
            _ => assert!(object.is_empty(), "{p}: {object:?}"),
        }
        let pixel = &film.pixels[p];
        let covered: f64 = object.values().sum();
        assert!((covered - pixel.mean()[3]).abs() < 1e-12, "{p}: alpha {}", pixel.mean()[3]);
    }
    let error = (0.25f64 * 0.75 / (16.0 * 64.0)).sqrt();
    assert!((curtain - 0.25).abs() < 4.9 * error, "{curtain}");
}

/// Where nothing leaves the scene, the shares of a pixel sum to 1, under filters with negative lobes too; there it is
/// the share of the signed weights. Oracle: the sum, up to the rounding of six f32.
#[test]
fn shares_sum_to_one_inside_a_room() {
    for filter in FilterKind::ALL {
        let film = render(&room(), options(17, 13, 9).filter(filter).aovs(ALL)).film;
        for aov in ALL {
            let channels = film.channels(&[aov], 64);
            assert_eq!(channels.len(), 12);
            for p in 0..film.pixels.len() {
                let sum: f64 = (0..6).map(|rank| f64::from(channels[2 * rank + 1].values[p])).sum();
                assert!((sum - 1.0).abs() < 6.0 * f64::from(f32::EPSILON), "{filter} {aov} {p}: {sum}");
            }
        }
    }
}

/// What is asked for besides changes neither picture nor bits of another layer; ids are the same whatever the passes,
/// the threads and the order in which parts are added.
#[test]
fn lists_do_not_depend_on_the_split() {
    let scene = room();
    let part = |start, spp, threads| {
        let options = options(33, 17, spp).sample_start(start).threads(threads);
        render(&scene, options.filter(FilterKind::Mitchell).aovs(ALL)).film
    };
    let whole = part(0, 12, 1);
    let parts: Vec<Film> = [(8, 4), (4, 4), (0, 4)].map(|(start, spp)| part(start, spp, 2)).into();
    let mut sum = parts[0].clone();
    parts[1..].iter().for_each(|part| sum.merge(part).expect("the same picture"));
    for aov in ALL {
        assert_eq!(sum.ids(aov), whole.ids(aov), "{aov}");
    }
    let plain = render(&scene, options(33, 17, 12).filter(FilterKind::Mitchell)).film;
    assert_eq!(plain.hash(), whole.hash());
    assert_eq!((plain.ids(Aov::CRYPTO_ASSET), whole.layer(Aov::CRYPTO_ASSET)), (None, None));
    assert_ne!(whole.digest(), plain.digest());
}

/// Ids and names come back from the file. Oracle: the specification, by the `exr` crate.
#[test]
fn files_are_those_of_the_specification() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.exr");
    let scene = stage();
    let renderer = Renderer::new(&scene, options(8, 8, 16).aovs(ALL)).expect("a valid scene");
    let render = renderer.render().expect("renders");
    render.film.write_exr(&path, &renderer.exr_options(&render).half(true)).expect("a writable folder");
    let image = read_first_flat_layer_from_file(&path).expect("just written");
    let channel = |name: &str| -> Vec<f32> {
        let found = image.layer_data.channel_data.list.iter().find(|c| c.name.eq(name)).expect("a channel");
        assert!(matches!(found.sample_data, exr::prelude::FlatSamples::F32(_)), "{name} keeps its bits");
        found.sample_data.values_as_f32().collect()
    };
    let text = |name: &str| match image.layer_data.attributes.other.get(&Text::from(name)) {
        Some(AttributeValue::Text(text)) => String::from_utf8(text.as_slice().to_vec()).expect("UTF-8"),
        other => panic!("{name}: {other:?}"),
    };
    // Hashes of the layers' names, by the reference code.
    let layers = [("crypto_object", "f834d0a"), ("crypto_material", "bda530a"), ("crypto_asset", "28322e9")];
    let names = [&["wall", "curtain", "net"][..], &["плитка", "veil \"thin\"", "net"], &["set", "net"]];
    for ((layer, key), names) in layers.into_iter().zip(names) {
        assert_eq!(text(&format!("cryptomatte/{key}/name")), layer);
        assert_eq!(text(&format!("cryptomatte/{key}/hash")), "MurmurHash3_32");
        assert_eq!(text(&format!("cryptomatte/{key}/conversion")), "uint32_to_float32");
        let manifest: BTreeMap<String, String> =
            serde_json::from_str(&text(&format!("cryptomatte/{key}/manifest"))).expect("JSON");
        let expected = names.iter().map(|name| (name.to_string(), format!("{:08x}", id_of(name))));
        assert_eq!(manifest, expected.collect(), "{layer}");
        // The wall alone in column 3, a part of it in column 4, nothing right of it.
        let [id, coverage] = ["R", "G"].map(|c| channel(&format!("{layer}00.{c}")));
        assert_eq!((id[3].to_bits(), coverage[3]), (id_of(names[0]), 1.0), "{layer}");
        assert_eq!((id[4].to_bits(), coverage[4]), (id_of(names[0]), 0.25), "{layer}");
        assert_eq!([id[5], coverage[5], channel(&format!("{layer}02.A"))[3]], [0.0; 3]);
    }
}

/// Names of nodes, their topmost parents and materials, and stable ones where there are none; baked and instanced
/// meshes alike.
#[test]
fn names_are_those_of_the_file() {
    let mut f = Fixture::quad();
    f.json["scenes"][0]["nodes"] = json!([0, 1, 2]);
    f.json["nodes"] = json!([
        {"mesh": 0, "name": "quad"},
        {"camera": 0, "translation": [0.5, 0.5, 3.0]},
        {"name": "", "children": [3, 4]},
        {"name": "shelf", "children": [5]},
        {"mesh": 0},
        {"mesh": 1, "name": "book"},
    ]);
    f.json["materials"] = json!([{"name": "plain"}, {}]);
    f.json["meshes"].as_array_mut().expect("meshes").push(json!({"primitives": [
        {"attributes": {"POSITION": 0}, "indices": 1, "material": 1},
        {"attributes": {"POSITION": 0}, "indices": 1},
    ]}));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = Scene::load(f.write(folder.path())).expect("a valid scene");
    let names = |of: fn(&Scene, usize) -> std::borrow::Cow<'_, str>| -> Vec<String> {
        (0..scene.instances.len()).map(|i| of(&scene, i).into_owned()).collect()
    };
    assert_eq!(names(Scene::object_name), ["quad", "book", "book", "node 4"]);
    assert_eq!(names(Scene::asset_name), ["quad", "node 2", "node 2", "node 2"]);
    assert_eq!(names(Scene::material_name), ["plain", "material 1", "default", "plain"]);

    // Made in code, of two placements of a mesh that stays instanced.
    let mut b = SceneBuilder::new();
    let white = b.lambert(Vec3::ONE);
    b.sphere(Vec3::ZERO, 0.4, 24, false, false, white).named("left", "balls");
    let sphere = b.clone().build().instances[0].mesh;
    b.place(sphere, Affine3A::from_translation(Vec3::X));
    b.any_camera(
        Vec3::new(0.5, 0.0, 2.0),
        Vec3::X * 0.5,
        Vec3::Y,
        Projection::Orthographic { xmag_m: 1.0, ymag_m: 1.0 },
    );
    let film = render(&b.build(), options(8, 8, 4).aovs(ALL)).film;
    let objects = film.ids(Aov::CRYPTO_OBJECT).expect("asked for");
    let first = |p: usize| objects[p].ranked().first().map(|(id, _)| *id);
    assert_eq!([first(4 * 8 + 2), first(4 * 8 + 6)], ["left", "instance 1"].map(|name| Some(id_of(name))));
}
