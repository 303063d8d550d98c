//! Files for other programs: names of channels and primaries of colours, by the built binary and by the library.
//! Oracles: the same picture under its own names and primaries, and the matrix that `film/primaries.rs` checks against
//! the definition. Deterministic.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use exr::prelude::{AttributeValue, FlatSamples, Text, Vec2, read_first_flat_layer_from_file};
use pathspace::film::exr::{ExrOptions, read_exr, text_attribute};
use pathspace::film::pass_names::PassNames;
use pathspace::film::primaries::Primaries;
use pathspace::plan::Aov;

use crate::common::{options, render};
use crate::determinism::room;

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.gltf");

/// Runs the binary in `folder`; what it said.
fn run(code: i32, folder: &Path, args: &str) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pathspace"));
    command.current_dir(folder).env_remove("SLURM_CPUS_PER_TASK");
    let output = command.args(args.split(' ').map(|arg| if arg == "SCENE" { SCENE } else { arg })).output();
    let output = output.expect("the binary starts");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{args}\n{said}");
    said
}

/// Channels by name, and white point.
fn channels(path: &Path) -> (BTreeMap<String, Vec<f32>>, Vec2<f32>) {
    let image = read_first_flat_layer_from_file(path).expect("just written");
    let list = image.layer_data.channel_data.list.iter();
    let values = |samples: &FlatSamples| samples.values_as_f32().collect();
    let named = list.map(|channel| (channel.name.to_string(), values(&channel.sample_data)));
    (named.collect(), image.attributes.chromaticities.expect("written").white)
}

/// Colours are converted pixel by pixel, everything else keeps its bits. Converted values are rounded once from the
/// f32 of the layer, beauty once from f64.
#[test]
fn colours_have_the_primaries_that_are_asked_for() {
    let kinds = ["diffuse", "glossy", "transmission", "volume", "lightgroup_default", "denoise_albedo"];
    let colours = [&["albedo", "emission", "direct", "indirect", "background", "bounce_02"][..], &kinds].concat();
    let aovs: Vec<Aov> = Aov::all().collect();
    let film = render(&room(), options(9, 7, 4).aovs(aovs.clone())).film;
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [plain, aces] = Primaries::ALL.map(|primaries| {
        let path = folder.path().join(primaries.name());
        let exr = ExrOptions::default().channels(film.channels(&aovs, 64)).primaries(primaries);
        film.write_exr(&path, &exr).expect("a writable folder");
        assert_eq!(text_attribute(&path, "colorInteropID").as_deref(), Some(primaries.interop_id()));
        channels(&path)
    });
    assert_eq!((plain.1, aces.1), (Vec2(0.3127, 0.3290), Vec2(0.32168, 0.33766)));
    let mut changed = 0;
    for (name, values) in &aces.0 {
        let (layer, component) = name.rsplit_once('.').unwrap_or(("", name));
        let c = ["R", "G", "B"].iter().position(|rgb| rgb == &component);
        let is_color = (layer.is_empty() || layer.starts_with("bounce") || colours.contains(&layer)) && c.is_some();
        let Some(c) = c.filter(|_| is_color) else {
            let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(values), bits(&plain.0[name]), "{name}");
            continue;
        };
        for (p, &value) in values.iter().enumerate() {
            let rgb = ["R", "G", "B"].map(|c| {
                let own = if layer.is_empty() { c.to_string() } else { format!("{layer}.{c}") };
                f64::from(plain.0[&own][p])
            });
            let expected = Primaries::AcesCg.of_rec709(rgb)[c];
            let most = 2.0 * f64::from(f32::EPSILON) * rgb.iter().sum::<f64>();
            assert!((f64::from(value) - expected).abs() <= most, "{name} {p}: {value}, expected {expected}");
            changed += usize::from(value != plain.0[name][p]);
        }
    }
    assert!(changed > 9 * 7 * 3, "the room has colours");
}

/// Names change and nothing else; Blender's beauty is read as a picture; ids are found under the layer's new name.
#[test]
fn channels_have_the_names_that_are_asked_for() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = |name: &str| folder.path().join(name);
    let settings = "render SCENE -q --width 8 --height 6 --spp 2 --reproducible --aov Z,N,albedo,crypto_object";
    run(0, folder.path(), &format!("{settings} -o own.exr --png own.png --checkpoint own.part"));
    run(0, folder.path(), &format!("{settings} -o nuke.exr --pass-names nuke"));
    let aces = "--pass-names blender --colorspace acescg";
    run(0, folder.path(), &format!("{settings} -o blender.exr --pass-names Blender"));
    run(0, folder.path(), &format!("{settings} -o aces.exr --png aces.png {aces}"));
    run(0, folder.path(), &format!("merge -q own.part -o merged.exr --reproducible {aces}"));

    let own = channels(&path("own.exr")).0;
    for (names, file, some) in [
        (PassNames::Nuke, "nuke.exr", ["R", "depth.Z", "N.red", "albedo.blue", "crypto_object00.alpha"]),
        (
            PassNames::Blender,
            "blender.exr",
            [
                "ViewLayer.Combined.R",
                "ViewLayer.Depth.Z",
                "ViewLayer.Normal.X",
                "ViewLayer.Denoising Albedo.B",
                "ViewLayer.CryptoObject00.a",
            ],
        ),
    ] {
        let named = channels(&path(file)).0;
        let ours = ["R", "Z", "N.X", "albedo.B", "crypto_object00.A"];
        assert_eq!(named.len(), own.len());
        for (theirs, ours) in some.into_iter().zip(ours) {
            assert_eq!(named[theirs], own[ours], "{theirs}");
        }
        let layer = names.layer("crypto_object");
        let key = if names == PassNames::Blender { "542cafa" } else { "f834d0a" };
        assert_eq!(text_attribute(&path(file), &format!("cryptomatte/{key}/name")), Some(layer));
        let pictures = ["own.exr", file].map(|name| read_exr(&path(name)).expect("a picture"));
        assert_eq!(pictures[0], pictures[1], "{file}");
    }
    let read = |name: &str| std::fs::read(path(name)).expect("just written");
    assert!(read("merged.exr") == read("aces.exr"), "of a state as of a render");
    assert!(read("own.png") == read("aces.png"), "previews have nothing to do with it");
    let attributes = read_first_flat_layer_from_file(path("aces.exr")).expect("just written").layer_data.attributes;
    let id = attributes.other.get(&Text::from("colorInteropID"));
    assert_eq!(id, Some(&AttributeValue::Text(Text::from("lin_ap1_scene"))));

    for option in ["--pass-names nuke", "--colorspace acescg"] {
        let said = run(2, folder.path(), &format!("render SCENE -q -o a.png {option}"));
        assert!(said.contains(&option[..8]), "{said}");
        run(2, folder.path(), &format!("merge -q own.part -o a.png {option}"));
    }
    let said = run(2, folder.path(), "render SCENE -q -o a.exr --colorspace srgb");
    assert!(said.contains("rec709"), "{said}");
}
