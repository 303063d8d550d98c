//! Lights of files: image-based and photometric ones. Oracles: what the extensions' texts say, by hand; the punctual
//! light that an even profile is, to the bit; an integrating sphere in closed form, within 4.9 standard errors and its
//! facets. Broken files: the clause beside each. Seeds are fixed.

use std::f64::consts::PI;

use base64::Engine;
use glam::Vec3;
use pathspace::Scene;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::ies;
use pathspace::scene::{Aimed, EnvironmentFile, LoadOptions, PunctualKind, PunctualLight};
use serde_json::{Value, json};

use super::as_filed;
use super::fixture::{Fixture, write};
use crate::common::{options, render};
use crate::meter::environment_lights;

/// An image of 2×2 texels as a data URI.
fn image(texels: [[u8; 4]; 4]) -> Value {
    let image = image::RgbaImage::from_fn(2, 2, |x, y| image::Rgba(texels[(y * 2 + x) as usize]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).expect("a PNG in memory");
    let text = base64::engine::general_purpose::STANDARD.encode(bytes.into_inner());
    json!({"uri": format!("data:image/png;base64,{text}")})
}

/// The quad in a cube of six images.
fn in_cube(faces: [[[u8; 4]; 4]; 6], light: Value) -> Fixture {
    let mut light = light;
    light["specularImages"] = json!([[0, 1, 2, 3, 4, 5]]);
    light["specularImageSize"] = json!(2);
    Fixture::quad()
        .set("/images", faces.map(image).to_vec().into())
        .set("/extensionsRequired", json!(["EXT_lights_image_based"]))
        .set("/extensions/EXT_lights_image_based/lights", json!([light]))
        .set("/scenes/0/extensions/EXT_lights_image_based/light", json!(0))
}

/// Faces of one colour each.
const FACES: [[u8; 4]; 6] =
    [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 0, 255], [255, 0, 255, 255], [0, 255, 255, 255]];

const AXES: [Vec3; 6] = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];

fn color(texel: [u8; 4]) -> Vec3 {
    Vec3::from([0, 1, 2].map(|c| f32::from(texel[c]) / 255.0))
}

fn load(fixture: &Fixture) -> Scene {
    let directory = tempfile::tempdir().expect("a temporary directory");
    as_filed(fixture.write(directory.path())).unwrap_or_else(|error| panic!("{error}"))
}

/// Each face is seen where it is, turned with the light; in the picture as well.
#[test]
fn cubes_surround_the_scene() {
    let cube = in_cube(FACES.map(|face| [face; 4]), json!({"intensity": 2.5}));
    let scene = load(&cube);
    let environment = scene.environment.clone().expect("a light");
    let lights = environment_lights(environment);
    for (axis, face) in AXES.into_iter().zip(FACES) {
        assert!((lights.environment_radiance(axis) - color(face) * 2.5).length() < 1e-5, "{axis}");
    }
    let film = render(&scene, options(8, 8, 4)).film;
    let [r, g, b, _] = film.pixels[0].mean().map(|c| c as f32);
    assert!((Vec3::new(r, g, b) - color(FACES[5]) * 2.5).length() < 1e-5, "{r} {g} {b}");

    // A quarter turn about +Y takes what was at +Z to +X.
    let s = 0.5f64.sqrt();
    let turned = load(&cube.clone().set("/extensions/EXT_lights_image_based/lights/0/rotation", json!([0, s, 0, s])));
    let lights = environment_lights(turned.environment.expect("a light"));
    for (axis, face) in [(Vec3::X, 4), (Vec3::NEG_Z, 0), (Vec3::Y, 2), (Vec3::Z, 1)] {
        assert!((lights.environment_radiance(axis) - color(FACES[face]) * 2.5).length() < 1e-5, "{axis}");
    }
    // About +X, what was above comes forward (+Z), which no rotation of maps could do.
    let tilted = load(&cube.clone().set("/extensions/EXT_lights_image_based/lights/0/rotation", json!([s, 0, 0, s])));
    let lights = environment_lights(tilted.environment.expect("a light"));
    assert!((lights.environment_radiance(Vec3::Z) - color(FACES[2]) * 2.5).length() < 1e-5);

    // The command line's map takes its place; a scene without the light is not lit by it.
    let directory = tempfile::tempdir().expect("a temporary directory");
    let path = cube.write(directory.path());
    let map = image::RgbImage::from_pixel(2, 1, image::Rgb([255, 255, 255]));
    map.save(directory.path().join("map.png")).expect("a writable folder");
    let env = EnvironmentFile::new(directory.path().join("map.png"));
    let other = Scene::load_with(&path, &LoadOptions::default().environment(env)).expect("valid");
    assert_eq!(other.environment.expect("a map").texels[0], Vec3::ONE);
    let unlit = cube.set("/scenes/0", json!({"nodes": [0, 1]}));
    assert!(load(&unlit).environment.is_none());
}

/// Packed radiance above 1, the same everywhere: (188/255 by the sRGB curve) over 51/255.
#[test]
fn packed_radiance_lights_a_furnace() {
    let scene = load(&in_cube([[[188, 255, 0, 51]; 4]; 6], json!({})));
    let environment = scene.environment.expect("a light");
    let linear = ((188.0f64 / 255.0 + 0.055) / 1.055).powf(2.4);
    let expected = Vec3::new(linear as f32 * 5.0, 5.0, 0.0);
    assert!(environment.texels.iter().all(|texel| (*texel - expected).length() < 1e-4), "{:?}", environment.texels[0]);
}

/// Nine coefficients of irradiance. Oracle: those of radiance 1 + 0.5·z, whose irradiance is π + π/3·z.
#[test]
fn coefficients_alone_are_smooth_light() {
    let mut coefficients = vec![[0.0; 3]; 9];
    coefficients[0] = [(4.0 * PI).sqrt() * PI; 3];
    coefficients[2] = [(4.0 * PI / 3.0).sqrt() * PI / 3.0; 3];
    let fixture = Fixture::quad()
        .set("/extensions/EXT_lights_image_based/lights", json!([{"irradianceCoefficients": coefficients}]))
        .set("/scenes/0/extensions/EXT_lights_image_based/light", json!(0));
    let scene = load(&fixture);
    assert!(scene.warnings.iter().any(|warning| warning.what.contains("coefficients alone")), "{:?}", scene.warnings);
    let lights = environment_lights(scene.environment.expect("a light"));
    for (axis, radiance) in [(Vec3::X, 1.0), (Vec3::Z, 1.5), (Vec3::NEG_Z, 0.5)] {
        let found = lights.environment_radiance(axis);
        assert!((found - Vec3::splat(radiance)).length() < 2e-3, "{axis}: {found}");
    }
}

#[test]
fn broken_image_based_lights_are_refused() {
    let cube = || in_cube(FACES.map(|face| [face; 4]), json!({}));
    let light = "/extensions/EXT_lights_image_based/lights/0";
    for (pointer, value, words) in [
        ("/scenes/0/extensions/EXT_lights_image_based/light".to_owned(), json!(1), "lights"),
        (format!("{light}/specularImages"), json!([[0, 1, 2]]), "six images, found 3"),
        (format!("{light}/specularImages/0/3"), json!(9), "images"),
        (format!("{light}/specularImages"), json!([]), "nine coefficients"),
        (format!("{light}/rotation"), json!([0, 0, 0, 0]), "unit quaternion"),
        (format!("{light}/intensity"), json!("bright"), "expected a number"),
        ("/images/2".to_owned(), json!({"uri": "data:image/png;base64,AAAA"}), "image-based light"),
    ] {
        let directory = tempfile::tempdir().expect("a temporary directory");
        let path = cube().set(&pointer, value).write(directory.path());
        let error = as_filed(path).expect_err(words);
        assert!(error.to_string().contains(words) && error.exit_code() == 4, "{pointer}: {error}");
    }
}

/// A lamp of 40 cd in all directions.
const EVEN: &str = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 2 2 1 1 2 0 0 0\n1 1 9\n0 180\n0\n20 20\n";

/// The quad below a node that carries a light of an extension.
fn lit(extension: &str, light: Value, instance: Value) -> Fixture {
    let mut fixture = Fixture::quad()
        .set(&format!("/extensions/{extension}/lights"), json!([light]))
        .set("/scenes/0/nodes", json!([0, 1, 2]));
    let node = json!({"translation": [0.3, 0.6, 1.0], "scale": [3, 3, 3], "extensions": {extension: instance}});
    fixture.json["nodes"].as_array_mut().expect("nodes").push(node);
    fixture
}

fn load_with_lamp(fixture: &Fixture, lamp: &str) -> pathspace::Result<Scene> {
    let directory = tempfile::tempdir().expect("a temporary directory");
    write(directory.path(), "lamp.ies", lamp.as_bytes());
    as_filed(fixture.write(directory.path()))
}

#[test]
fn even_profiles_are_point_lights_to_the_bit() {
    let color = json!([1, 0.5, 0.25]);
    let point = load(&lit(
        "KHR_lights_punctual",
        json!({"type": "point", "intensity": 80.0, "color": color.clone()}),
        json!({"light": 0}),
    ));
    let lamp = json!({"light": 0, "multiplier": 2.0, "color": color});
    let mut fixture = lit("EXT_lights_ies", json!({"uri": "lamp.ies"}), lamp.clone());
    let hash = |scene: &Scene| render(scene, options(16, 16, 4)).film.hash();
    let expected = hash(&point);
    assert_eq!(hash(&load_with_lamp(&fixture, EVEN).expect("valid")), expected);
    // The same from a buffer.
    let view = fixture.view(EVEN.as_bytes());
    let held = json!([{"bufferView": view, "mimeType": "application/x-ies-lm-63"}]);
    let held = fixture.clone().set("/extensions/EXT_lights_ies/lights", held);
    assert_eq!(hash(&load(&held)), expected);
    // A spot along −Z: dark behind the quad's plane, and as the node turns.
    let spot = EVEN.replace("0 180", "0 90");
    let scene = load_with_lamp(&fixture, &spot).expect("valid");
    let aimed = scene.punctual[0].profile.clone().expect("a profile");
    let share = |dir: Vec3| aimed.profile.at(aimed.light_from_world * dir);
    assert_eq!([share(Vec3::NEG_Z), share(Vec3::X), share(Vec3::Z)], [1.0, 1.0, 0.0]);
    let s = 0.5f64.sqrt();
    let turned = fixture.set("/nodes/2/rotation", json!([0, s, 0, s]));
    let aimed = load_with_lamp(&turned, &spot).expect("valid").punctual[0].profile.clone().expect("a profile");
    // −Z turned by 90° about +Y is −X.
    assert_eq!(aimed.profile.at(aimed.light_from_world * Vec3::NEG_X), 1.0);
    assert_eq!(aimed.profile.at(aimed.light_from_world * Vec3::X), 0.0);
}

#[test]
fn broken_lamps_are_told_with_file_and_line() {
    let fixture = || lit("EXT_lights_ies", json!({"uri": "lamp.ies"}), json!({"light": 0}));
    for (lamp, words) in [
        (EVEN.replace("20 20", "20"), "lamp.ies, line 7: expected candela, found the end of the file"),
        (EVEN.replace("2 2 1 1 2", "2 2 1 2 2"), "lamp.ies, line 3: expected type C"),
        (EVEN.replace("2 2 1 1 2", "2 16777216 2 1 2"), "lamp.ies, line 3"),
        (String::from("\u{0}\u{1b}[2J"), "TILT="),
    ] {
        let error = load_with_lamp(&fixture(), &lamp).expect_err(words);
        let text = error.to_string();
        assert!(text.contains(words) && error.exit_code() == 4 && !text.contains('\u{1b}'), "{text}");
    }
    for (pointer, value, words) in [
        ("/nodes/2/extensions/EXT_lights_ies/light", json!(3), "lights"),
        ("/nodes/2/extensions/EXT_lights_ies/multiplier", json!("much"), "expected a number"),
        ("/extensions/EXT_lights_ies/lights/0/uri", json!("none.ies"), "none.ies"),
        ("/extensions/EXT_lights_ies/lights/0", json!({}), "expected a uri or a bufferView"),
        ("/extensions/EXT_lights_ies/lights/0", json!({"bufferView": 0}), "application/x-ies-lm-63"),
    ] {
        let error = load_with_lamp(&fixture().set(pointer, value), EVEN).expect_err(words);
        assert!(error.to_string().contains(words), "{pointer}: {error}");
    }
}

/// A lamp in the middle of a diffuse sphere: what comes back after the first reflection is the same everywhere, so it
/// says what the lamp sends in all: L = ρ·I/(π·R²) + ρ²·Φ/((1 − ρ)·π·4π·R²). The sphere's facets are within 1 %.
#[test]
fn an_integrating_sphere_measures_the_flux() {
    let file = "TILT=NONE\n1 1 1 3 3 1 2 0 0 0\n1 1 9\n0 60 120\n0 90 180\n8 6 0\n8 3 1\n8 1 2\n";
    let photometry = ies::parse(file.as_bytes()).expect("sound");
    let flux = f64::from(photometry.most_cd) * photometry.profile.integral_sr();
    let mut b = SceneBuilder::new();
    let albedo = 0.7f64;
    let wall = b.lambert(Vec3::splat(albedo as f32));
    b.sphere(Vec3::ZERO, 1.0, 48, true, false, wall);
    b.camera(Vec3::new(0.0, 0.0, 0.3), Vec3::new(0.0, 0.0, -1.0), Vec3::Y, 0.1);
    let mut scene = b.build();
    scene.punctual.push(PunctualLight {
        name: "lamp".into(),
        position: Vec3::ZERO,
        direction: Vec3::NEG_Z,
        intensity: Vec3::splat(photometry.most_cd),
        kind: PunctualKind::Point,
        range_m: f32::INFINITY,
        profile: Some(Aimed { profile: photometry.profile.into(), light_from_world: glam::Mat3::IDENTITY }),
    });
    let expected = albedo * 8.0 / PI + albedo * albedo * flux / ((1.0 - albedo) * PI * 4.0 * PI);
    let film = render(&scene, options(8, 8, 256).max_depth(64)).film;
    let values: Vec<f64> = film.pixels.iter().map(|pixel| pixel.mean()[1]).collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64;
    let error = (variance / values.len() as f64).sqrt();
    assert!((mean - expected).abs() < 4.9 * error + 0.01 * expected, "{mean} ± {error}, expected {expected}");
    assert!(error < 0.01 * expected, "too noisy to see much: {error}");
}
