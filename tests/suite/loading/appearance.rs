//! What textures and vertices say of a surface: transforms, second sets of coordinates, vertex colours, alpha, WebP,
//! occlusion. Files made here; oracles are the specifications' formulas on numbers that f32 holds exactly.

use glam::{Vec2, Vec3, Vec4};
use pathspace::Scene;
use pathspace::plan::Effects;
use pathspace::render::Renderer;
use pathspace::scene::{AlphaMode, Environment, Mesh};
use serde_json::json;

use super::fixture::{Fixture, write};
use super::{as_filed, load, png, warns};
use crate::common::{options, render};

/// A lossless WebP whose every texel is `color`.
fn webp(width: u32, height: u32, color: [u8; 3]) -> Vec<u8> {
    let image = image::RgbImage::from_pixel(width, height, image::Rgb(color));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::WebP).expect("a WebP in memory");
    bytes.into_inner()
}

/// The quad with an image for textures 0 and 1 to show.
fn textured(material: serde_json::Value) -> Fixture {
    Fixture::quad()
        .set("/materials/0", material)
        .set("/images", json!([{"uri": "a%20b.png"}]))
        .set("/textures", json!([{"source": 0}, {"source": 0}]))
}

fn plan_of(scene: &Scene) -> (Vec<&'static str>, Effects) {
    let renderer = Renderer::new(scene, options(8, 8, 1)).unwrap_or_else(|e| panic!("{e}"));
    (renderer.plan().stages.clone(), renderer.plan().effects.clone())
}

fn hash(scene: &Scene) -> u64 {
    render(scene, options(24, 24, 4)).film.hash()
}

fn lit(mut scene: Scene) -> Scene {
    scene.environment = Some(Environment::constant(Vec3::ONE));
    scene
}

/// The quad's texture coordinates, transformed by hand.
const QUAD_UVS: [[f32; 2]; 4] = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];

fn uvs(mesh: &Mesh, channel: usize) -> &[Vec2] {
    if channel == 0 { mesh.uvs.as_deref().expect("coordinates") } else { &mesh.more_uvs[channel - 1] }
}

/// KHR_texture_transform: a file with a transform and one whose coordinates are already transformed show the same bits.
#[test]
fn transforms_are_applied_to_the_coordinates() {
    let transform = json!({"offset": [0.25, -0.5], "scale": [2, 0.5]});
    let with = textured(json!({"pbrMetallicRoughness": {"baseColorTexture":
        {"index": 0, "extensions": {"KHR_texture_transform": transform}}}}))
    .set("/extensionsRequired", json!(["KHR_texture_transform"]));
    let with = lit(load(&with));
    let moved = QUAD_UVS.map(|[u, v]| Vec2::new(0.25 + 2.0 * u, -0.5 + 0.5 * v));
    assert_eq!(uvs(&with.meshes[0], 0), moved);
    assert!(with.warnings.is_empty(), "{:?}", with.warnings);

    let mut by_hand = textured(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    let accessor = by_hand.floats(&moved.map(|uv| uv.to_array()).concat(), "VEC2");
    let by_hand = by_hand.set("/meshes/0/primitives/0/attributes/TEXCOORD_0", accessor.into());
    assert_eq!(hash(&with), hash(&lit(load(&by_hand))));
}

/// Each slot has its own set and transform; equal ones share a channel.
#[test]
fn slots_read_channels_of_their_own() {
    let mut fixture = textured(json!({
        "pbrMetallicRoughness": {
            "baseColorTexture": {"index": 0, "texCoord": 1}, "metallicRoughnessTexture": {"index": 1}
        },
        "emissiveTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"texCoord": 1}}},
        "emissiveFactor": [1, 1, 1],
        "normalTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [3, 3]}}}}));
    let second = fixture.floats(&[0.5, 0.5, 0.75, 0.5, 0.75, 0.25, 0.5, 0.25], "VEC2");
    let scene = load(&fixture.set("/meshes/0/primitives/0/attributes/TEXCOORD_1", second.into()));
    let material = &scene.materials[0];
    let slots: Vec<u32> = material.textures().map(|(_, texture)| texture.uv_set).collect();
    // Base colour, metal and roughness, emission, normals.
    assert_eq!(slots, [0, 1, 0, 2]);
    let mesh = &scene.meshes[0];
    assert_eq!(
        (uvs(mesh, 0)[1], uvs(mesh, 1)[1], uvs(mesh, 2)[1]),
        (Vec2::new(0.75, 0.5), Vec2::ONE, Vec2::splat(3.0))
    );
    let (_, effects) = plan_of(&scene);
    assert!(effects.simulated.iter().any(|name| name == "more-texture-coordinates"), "{effects:?}");
}

/// A texture that reads the second set shows what the same texture shows through the first.
#[test]
fn the_second_set_is_looked_up() {
    let show = |set: u32, slot: &str| {
        let mut fixture = textured(json!({"emissiveFactor": [1, 1, 1]}));
        let other = fixture.floats(&[0.9, 0.1, 0.8, 0.1, 0.9, 0.4, 0.7, 0.4], "VEC2");
        let info = json!({"index": 0, "texCoord": set});
        let mut fixture = fixture.set(&format!("/materials/0/{slot}"), info);
        if set == 1 {
            // Another slot keeps set 0 in use, so that the slot reads channel 1 (and changes nothing: a metal stays
            // one).
            let info = json!({"index": 0});
            fixture = fixture.set("/materials/0/pbrMetallicRoughness/metallicRoughnessTexture", info);
            fixture = fixture.set("/meshes/0/primitives/0/attributes/TEXCOORD_1", 2.into());
            fixture = fixture.set("/meshes/0/primitives/0/attributes/TEXCOORD_0", other.into());
        } else {
            let info = json!({"index": 0, "texCoord": 1});
            fixture = fixture.set("/materials/0/pbrMetallicRoughness/metallicRoughnessTexture", info);
            fixture = fixture.set("/meshes/0/primitives/0/attributes/TEXCOORD_1", other.into());
        }
        hash(&lit(load(&fixture)))
    };
    for slot in ["emissiveTexture", "pbrMetallicRoughness/baseColorTexture"] {
        assert_eq!(show(0, slot), show(1, slot), "{slot}");
    }
}

/// The tangent frame is that of the coordinates which the normal map reads. Oracle: the quad's own axes, by hand.
#[test]
fn tangents_turn_with_the_normal_map() {
    let quarter = std::f64::consts::FRAC_PI_2;
    let tangents = |transform: serde_json::Value, given: bool| {
        let mut fixture =
            textured(json!({"normalTexture": {"index": 0, "extensions": {"KHR_texture_transform": transform}}}));
        if given {
            // Tilted by hand, to be told from computed ones.
            let tangent = fixture.floats(&[0.6, 0.8, 0.0, 1.0].repeat(4), "VEC4");
            let normal = fixture.floats(&[0.0, 0.0, 1.0].repeat(4), "VEC3");
            fixture = fixture.set("/meshes/0/primitives/0/attributes/TANGENT", tangent.into());
            fixture = fixture.set("/meshes/0/primitives/0/attributes/NORMAL", normal.into());
        }
        load(&fixture).meshes[0].tangents.clone().expect("a normal map")
    };
    let along = |tangents: Vec<Vec4>, expected: Vec4| {
        assert!(tangents.iter().all(|t| (*t - expected).length() < 1e-6), "{tangents:?}, expected {expected}");
    };
    along(tangents(json!({}), false), Vec4::new(1.0, 0.0, 0.0, 1.0));
    along(tangents(json!({"scale": [3, 2], "offset": [1, 1]}), true), Vec4::new(0.6, 0.8, 0.0, 1.0));
    // u' = v runs down the quad, and up the image is to the right.
    along(tangents(json!({"rotation": quarter}), false), Vec4::new(0.0, -1.0, 0.0, 1.0));
    along(tangents(json!({"rotation": quarter}), true), Vec4::new(0.0, -1.0, 0.0, 1.0));
    along(tangents(json!({"scale": [-1, 1]}), true), Vec4::new(-1.0, 0.0, 0.0, -1.0));
}

/// COLOR_0 in each of its forms. Oracle: the stored numbers; an unlit surface shows them as they are.
#[test]
fn vertex_colors_are_read_in_every_form() {
    let with = |bytes: &[u8], kind: u32, vector: &str| {
        let mut fixture = Fixture::quad().set(
            "/materials/0",
            json!({"extensions": {"KHR_materials_unlit": {}},
            "pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 1, 1]}}),
        );
        let accessor = fixture.accessor(bytes, kind, vector, 4);
        let fixture = fixture.set(&format!("/accessors/{accessor}/normalized"), (kind != 5126).into());
        load(&fixture.set("/meshes/0/primitives/0/attributes/COLOR_0", accessor.into()))
    };
    let bytes = with(&[51, 102, 255, 0].repeat(4), 5121, "VEC4");
    let words: Vec<u8> = [13107u16, 26214, 65535, 0].repeat(4).iter().flat_map(|word| word.to_le_bytes()).collect();
    let words = with(&words, 5123, "VEC4");
    let floats: Vec<u8> = [0.2f32, 0.4, 1.0].repeat(4).iter().flat_map(|number| number.to_le_bytes()).collect();
    let floats = with(&floats, 5126, "VEC3");
    for (scene, alpha) in [(&bytes, 0.0), (&words, 0.0), (&floats, 1.0)] {
        let mesh = &scene.meshes[0];
        assert_eq!(mesh.colors.as_deref(), Some(&[Vec4::new(0.2, 0.4, 1.0, alpha); 4][..]));
        assert!(scene.materials[mesh.material.index()].vertex_colors && scene.warnings.is_empty());
        let film = render(scene, options(16, 16, 1)).film;
        let seen = film.pixels.iter().map(|p| p.mean()).find(|p| p[3] > 0.0).expect("the quad is in view");
        for (channel, expected) in [0.1, 0.4, 1.0].into_iter().enumerate() {
            assert!((seen[channel] - expected).abs() < 1e-6, "{seen:?}");
        }
        let (stages, effects) = plan_of(scene);
        assert!(stages.contains(&"vertex-colours") && effects.simulated.contains(&"vertex-colours".to_string()));
    }
    // White calls for nothing; what is out of range is named.
    let white = with(&[255; 16], 5121, "VEC4");
    assert!(white.meshes[0].colors.is_none() && white.materials.len() == 1);
    let hot: Vec<u8> = [2.0f32, -1.0, f32::NAN].repeat(4).iter().flat_map(|number| number.to_le_bytes()).collect();
    let hot = with(&hot, 5126, "VEC3");
    assert_eq!(hot.meshes[0].colors.as_deref().map(|colors| colors[0]), Some(Vec4::new(1.0, 0.0, 0.0, 1.0)));
    assert!(warns(&hot, "outside [0, 1]"));
}

/// Colours between vertices are linear in the barycentric weights, on baked and on instanced meshes, beside meshes
/// without.
#[test]
fn vertex_colors_are_interpolated() {
    let mut fixture = Fixture::quad().set("/materials/0", json!({"extensions": {"KHR_materials_unlit": {}}}));
    // Red grows with x, green with y, as positions do.
    let colors = fixture.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0], "VEC3");
    let scene = load(&fixture.set("/meshes/0/primitives/0/attributes/COLOR_0", colors.into()));
    let options = options(20, 20, 1).aovs(vec![pathspace::plan::Aov::ALBEDO, pathspace::plan::Aov::POSITION]);
    let render = render(&scene, options.filter(pathspace::render::FilterKind::Box));
    let layer = |aov| render.film.layer(aov).expect("asked for");
    let (albedos, positions) = (layer(pathspace::plan::Aov::ALBEDO), layer(pathspace::plan::Aov::POSITION));
    let mut seen = 0;
    for (albedo, position) in albedos.iter().zip(&positions).filter(|(albedo, _)| **albedo != [0.0; 3]) {
        seen += 1;
        // The sample lies somewhere in the pixel, the position at its centre: half a pixel is 0.06 m here.
        for c in 0..2 {
            assert!((albedo[c] - position[c]).abs() < 0.07, "{albedo:?} at {position:?}");
        }
    }
    assert!(seen > 50, "only {seen} pixels show the quad");
}

/// The layer of texture coordinates, at the pixel's centre as the position is. Oracle: the quad's file, u = x and
/// v = 1 − y.
#[test]
fn texture_coordinates_are_a_layer() {
    use pathspace::plan::Aov;
    let textured = textured(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    for (fixture, has) in [(textured, true), (Fixture::quad(), false)] {
        let film = render(&load(&fixture), options(20, 20, 1).aovs(vec![Aov::UV, Aov::POSITION, Aov::DEPTH])).film;
        let layer = |aov| film.layer(aov).expect("asked for");
        let (uvs, positions, depths) = (layer(Aov::UV), layer(Aov::POSITION), layer(Aov::DEPTH));
        let mut seen = 0;
        for ((uv, p), depth) in uvs.iter().zip(&positions).zip(&depths) {
            let hit = depth[0] < f64::from(f32::MAX);
            let expected = if hit && has { [p[0], 1.0 - p[1]] } else { [0.0; 2] };
            assert!((0..2).all(|c| (uv[c] - expected[c]).abs() < 1e-6), "{uv:?} at {p:?}");
            seen += u32::from(hit);
        }
        assert!(seen > 50, "only {seen} pixels show the quad");
    }
}

/// Alpha of factor, texture and vertices multiply; modes and cutoffs are read; what cannot let light pass is opaque.
#[test]
fn alpha_modes_are_read() {
    let mode = |material: serde_json::Value| load(&textured(material)).materials[0].alpha_mode;
    assert_eq!(mode(json!({"alphaMode": "BLEND"})), AlphaMode::Blend);
    assert_eq!(mode(json!({"alphaMode": "MASK"})), AlphaMode::Mask { cutoff: 0.5 });
    assert_eq!(mode(json!({"alphaMode": "MASK", "alphaCutoff": 1.5})), AlphaMode::Mask { cutoff: 1.5 });
    assert_eq!(mode(json!({"alphaCutoff": 0.1})), AlphaMode::Opaque);

    // The PNG has no alpha: blending it by 1 is opaque, and costs what opaque costs.
    let opaque =
        load(&textured(json!({"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})));
    let (stages, effects) = plan_of(&opaque);
    assert!(
        !stages.contains(&"alpha") && !effects.simulated.iter().any(|name| name.starts_with("alpha")),
        "{effects:?}"
    );

    // 0.5 of the factor times 0.5 of the vertices, over white: a quarter of the surface's red is missing.
    let mut fixture = Fixture::quad().set(
        "/materials/0",
        json!({"alphaMode": "BLEND", "extensions": {"KHR_materials_unlit": {}},
        "pbrMetallicRoughness": {"baseColorFactor": [0, 1, 1, 0.5]}}),
    );
    let colors = fixture.floats(&[1.0, 1.0, 1.0, 0.5].repeat(4), "VEC4");
    let scene = lit(load(&fixture.set("/meshes/0/primitives/0/attributes/COLOR_0", colors.into())));
    let (stages, effects) = plan_of(&scene);
    assert!(stages.contains(&"alpha") && effects.simulated.contains(&"alpha-blending".to_string()));
    let estimate = crate::common::probe(&scene, Vec3::new(0.4, 0.45, 2.0), Vec3::NEG_Z, 1 << 16, options(1, 1, 1));
    let [red, green, _] = estimate.mean;
    assert!((red - 0.75).abs() < 4.9 * estimate.standard_error(0) && (green - 1.0).abs() < 1e-6, "{estimate:?}");
}

/// EXT_texture_webp: its image is taken, with or without a fallback, required or not; a broken one is an error that
/// names it.
#[test]
fn webp_images_are_read() {
    let load = |texture: serde_json::Value, bytes: &[u8]| {
        let directory = tempfile::tempdir().expect("a temporary directory");
        write(directory.path(), "a b.png", &png(3, 2));
        write(directory.path(), "best.webp", bytes);
        let fixture = textured(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}))
            .set("/images", json!([{"uri": "a%20b.png"}, {"uri": "best.webp", "mimeType": "image/webp"}]))
            .set("/textures", json!([texture]))
            .set("/extensionsRequired", json!(["EXT_texture_webp"]))
            .set("/extensionsUsed", json!(["EXT_texture_webp"]));
        as_filed(fixture.write(directory.path()))
    };
    let image = webp(5, 4, [10, 200, 30]);
    for texture in [
        json!({"extensions": {"EXT_texture_webp": {"source": 1}}}),
        json!({"source": 0, "extensions": {"EXT_texture_webp": {"source": 1}}}),
    ] {
        let scene = load(texture, &image).expect("a valid WebP");
        let texture = &scene.textures[0];
        assert_eq!((texture.width, texture.height), (5, 4));
        assert_eq!(texture.texels.constant(), Some([10, 200, 30, 255].map(|byte: u8| f32::from(byte) / 255.0)));
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    }
    // A large image of one colour is a small file.
    let large = webp(1500, 1200, [1, 2, 3]);
    assert_eq!(
        load(json!({"extensions": {"EXT_texture_webp": {"source": 1}}}), &large).expect("valid").textures[0].width,
        1500
    );
    for (texture, bytes, words) in [
        (json!({"extensions": {"EXT_texture_webp": {"source": 1}}}), &image[..20], "best.webp"),
        (json!({"extensions": {"EXT_texture_webp": {"source": 7}}}), &image[..], "EXT_texture_webp/source"),
        (json!({"extensions": {"EXT_texture_webp": {"source": "x"}}}), &image[..], "EXT_texture_webp/source"),
    ] {
        let error = load(texture, bytes).expect_err("broken").to_string();
        assert!(error.contains(words) && !error.contains('\n'), "{error}");
    }
}

/// Broken transforms are errors that say where. Missing sets are named. Occlusion is in the plan, with its reason.
#[test]
fn what_cannot_be_read_or_is_not_simulated_is_named() {
    let slot = |transform: serde_json::Value| {
        let texture = json!({"index": 0, "extensions": {"KHR_texture_transform": transform}});
        textured(json!({"pbrMetallicRoughness": {"baseColorTexture": texture}}))
    };
    for broken in
        [json!({"offset": [0, "x"]}), json!({"rotation": 1e300}), json!({"texCoord": -1}), json!({"scale": [[], 1]})]
    {
        let directory = tempfile::tempdir().expect("a temporary directory");
        write(directory.path(), "a b.png", &png(3, 2));
        let error = Scene::load(slot(broken.clone()).write(directory.path())).expect_err("broken").to_string();
        assert!(error.contains("/KHR_texture_transform/"), "{broken}: {error}");
    }
    let scene = load(&slot(json!({"texCoord": 3})));
    assert!(warns(&scene, "TEXCOORD_3") && scene.meshes[0].uvs.is_none());

    let scene = load(&textured(json!({"occlusionTexture": {"index": 0}})));
    let (_, effects) = plan_of(&scene);
    let ignored = effects.ignored.iter().find(|ignored| ignored.what.starts_with("occlusion-textures"));
    assert!(ignored.is_some_and(|ignored| ignored.why.contains("computes occlusion")), "{effects:?}");
    assert!(scene.warnings.is_empty() && scene.textures.is_empty(), "the image is not even decoded");
}
