//! Textures and numbers of the extensions' lobes. Files made here; the oracle is a material whose factors say by hand
//! what the textures say, to the bit of the film.

use glam::{Vec2, Vec3, Vec4};
use pathspace::Scene;
use pathspace::scene::{Environment, LoadOptions, Material, PunctualKind, PunctualLight, Slot};
use pathspace::texture::lookup;
use serde_json::{Value, json};

use super::as_filed;
use super::fixture::{Fixture, write};
use crate::common::{options, render};

/// Four texels in a row, the first two alike and the last two: what is not `channels` differs from texel to texel, so
/// that no image is constant.
fn strip(channels: &[usize]) -> Vec<u8> {
    let image = image::RgbaImage::from_fn(4, 1, |x, _| {
        let mut texel = [30 * x as u8 + 20; 4];
        for &channel in channels {
            texel[channel] = [153, 51][x as usize / 2] + 10 * channel as u8;
        }
        image::Rgba(texel)
    });
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).expect("a PNG in memory");
    bytes.into_inner()
}

/// A quad with two sets of coordinates: the first reads the left half of an image, the second the right one.
fn quad(material: Value, image: &[u8]) -> Scene {
    let mut fixture = Fixture::quad();
    let left = fixture.floats(&[0.05, 1.0, 0.45, 1.0, 0.45, 0.0, 0.05, 0.0], "VEC2");
    let right = fixture.floats(&[0.55, 1.0, 0.95, 1.0, 0.95, 0.0, 0.55, 0.0], "VEC2");
    let fixture = fixture
        .set("/meshes/0/primitives/0/attributes/TEXCOORD_0", left.into())
        .set("/meshes/0/primitives/0/attributes/TEXCOORD_1", right.into())
        .set("/materials/0", material)
        .set("/images", json!([{"uri": "strip.png"}]))
        .set("/samplers", json!([{"magFilter": 9728}]))
        .set("/textures", json!([{"source": 0, "sampler": 0}]));
    let directory = tempfile::tempdir().expect("a temporary directory");
    write(directory.path(), "strip.png", image);
    let mut scene = as_filed(fixture.write(directory.path())).expect("the fixture is valid");
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    scene.environment = Some(Environment::constant(Vec3::ONE));
    scene
}

fn hash(scene: &Scene) -> u64 {
    render(scene, options(16, 16, 4)).film.hash()
}

/// A texture of an extension and what it does.
struct Case {
    slot: Slot,
    /// The extension's object without the texture.
    object: Value,
    /// Other members of the material.
    beside: Value,
    channels: &'static [usize],
    fold: fn(&mut Material, Vec4),
}

fn cases() -> Vec<Case> {
    // Under a layer, so that one kernel shades what is textured and what is not.
    let dielectric = json!({
        "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.4},
        "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 0.1}}});
    vec![
        Case {
            slot: Slot::Transmission,
            object: json!({"transmissionFactor": 0.8}),
            beside: dielectric.clone(),
            channels: &[0],
            fold: |material, texel| material.transmission *= texel.x,
        },
        Case {
            slot: Slot::Specular,
            object: json!({"specularFactor": 0.9}),
            beside: dielectric.clone(),
            channels: &[3],
            fold: |material, texel| material.specular *= texel.w,
        },
        Case {
            slot: Slot::SpecularColor,
            object: json!({"specularColorFactor": [0.9, 2, 0.5]}),
            beside: dielectric.clone(),
            channels: &[0, 1, 2],
            fold: |material, texel| material.specular_color *= texel.truncate(),
        },
        Case {
            slot: Slot::Clearcoat,
            object: json!({"clearcoatFactor": 0.9, "clearcoatRoughnessFactor": 0.2}),
            beside: dielectric.clone(),
            channels: &[0],
            fold: |material, texel| material.clearcoat *= texel.x,
        },
        Case {
            slot: Slot::ClearcoatRoughness,
            object: json!({"clearcoatFactor": 1, "clearcoatRoughnessFactor": 0.9}),
            beside: dielectric.clone(),
            channels: &[1],
            fold: |material, texel| material.clearcoat_roughness *= texel.y,
        },
        Case {
            slot: Slot::Glossiness,
            object: json!({"specularFactor": [0.2, 0.1, 0.1], "glossinessFactor": 0.9}),
            beside: json!({}),
            channels: &[0, 1, 2, 3],
            fold: |material, texel| {
                material.roughness = 1.0 - (1.0 - material.roughness) * texel.w;
            },
        },
        Case {
            slot: Slot::Anisotropy,
            object: json!({"anisotropyStrength": 0.8, "anisotropyRotation": 0.5}),
            beside: json!({"pbrMetallicRoughness": {"roughnessFactor": 0.3}}),
            channels: &[0, 1, 2],
            fold: |material, texel| {
                material.anisotropy_rotation_rad += (texel.y * 2.0 - 1.0).atan2(texel.x * 2.0 - 1.0);
                material.anisotropy *= texel.z;
            },
        },
        Case {
            slot: Slot::Iridescence,
            object: json!({"iridescenceFactor": 0.8}),
            beside: dielectric.clone(),
            channels: &[0],
            fold: |material, texel| material.iridescence *= texel.x,
        },
        Case {
            slot: Slot::IridescenceThickness,
            object: json!({"iridescenceFactor": 1, "iridescenceThicknessMinimum": 200}),
            beside: dielectric.clone(),
            channels: &[1],
            fold: |material, texel| {
                let [least, most] = material.iridescence_thickness_nm;
                material.iridescence_thickness_nm[1] = least + (most - least) * texel.y;
            },
        },
        Case {
            slot: Slot::DiffuseTransmission,
            object: json!({"diffuseTransmissionFactor": 0.8, "diffuseTransmissionColorFactor": [0.9, 0.5, 0.1]}),
            beside: dielectric.clone(),
            channels: &[3],
            fold: |material, texel| material.diffuse_transmission *= texel.w,
        },
        Case {
            slot: Slot::DiffuseTransmissionColor,
            object: json!({"diffuseTransmissionFactor": 0.8, "diffuseTransmissionColorFactor": [0.9, 0.5, 0.1]}),
            beside: dielectric.clone(),
            channels: &[0, 1, 2],
            fold: |material, texel| material.diffuse_transmission_color *= texel.truncate(),
        },
        Case {
            slot: Slot::SheenColor,
            object: json!({"sheenColorFactor": [0.9, 0.7, 1], "sheenRoughnessFactor": 0.5}),
            beside: dielectric.clone(),
            channels: &[0, 1, 2],
            fold: |material, texel| material.sheen_color *= texel.truncate(),
        },
        Case {
            slot: Slot::SheenRoughness,
            object: json!({"sheenColorFactor": [0.9, 0.7, 1], "sheenRoughnessFactor": 0.9}),
            beside: dielectric.clone(),
            channels: &[3],
            fold: |material, texel| material.sheen_roughness *= texel.w,
        },
    ]
}

/// Each slot multiplies its factor by its own channels, read by its own set of coordinates and transform. The texture
/// is listed as simulated.
#[test]
fn textures_of_extensions_multiply_their_factors() {
    for Case { slot, object, beside, channels, fold } in cases() {
        let [_, extension, texture] = slot.member().split('/').collect::<Vec<_>>()[..] else { panic!("{slot:?}") };
        let moved = json!({"index": 0, "extensions": {"KHR_texture_transform": {"offset": [0.5, 0]}}});
        let mut shown = Vec::new();
        for (info, u) in [(json!({"index": 0}), 0.1), (moved, 0.6), (json!({"index": 0, "texCoord": 1}), 0.6)] {
            let mut material = beside.clone();
            material["extensions"][extension] = object.clone();
            material["extensions"][extension][texture] = info.clone();
            let scene = quad(material, &strip(channels));
            let read = slot.of(&scene.materials[0]).unwrap_or_else(|| panic!("{slot:?} is read"));
            let mut by_hand = scene.clone();
            let material = &mut by_hand.materials[0];
            fold(material, lookup(&scene.textures[read.texture.index()], Vec2::new(u, 0.5)));
            *slot.of_mut(material).expect("the slot is there") = None;
            assert_eq!(hash(&scene), hash(&by_hand), "{slot:?} by {info}");
            shown.push(hash(&scene));
            let renderer = pathspace::render::Renderer::new(&scene, options(8, 8, 1)).expect("a sound scene");
            let simulated = &renderer.plan().effects.simulated;
            assert!(simulated.iter().any(|name| name.ends_with("-textures")), "{slot:?}: {simulated:?}");
        }
        assert!(shown[0] != shown[1] && shown[1] == shown[2], "{slot:?}: {shown:?}");
    }
}

/// KHR_materials_pbrSpecularGlossiness is metallic-roughness without metal, of index 0, with KHR_materials_specular:
/// both files say the same to the bit, whatever the fallback says.
#[test]
fn specular_glossiness_is_converted() {
    let old = json!({
        "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1], "metallicRoughnessTexture": {"index": 0}},
        "extensions": {"KHR_materials_pbrSpecularGlossiness": {
            "diffuseFactor": [0.5, 0.25, 0.75, 1], "diffuseTexture": {"index": 0},
            "specularFactor": [0.25, 0.5, 0.125], "glossinessFactor": 0.75}}});
    let new = json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 0.75, 1], "baseColorTexture": {"index": 0},
            "metallicFactor": 0, "roughnessFactor": 0.25},
        "extensions": {
            "KHR_materials_ior": {"ior": 0},
            "KHR_materials_specular": {"specularColorFactor": [0.25, 0.5, 0.125]}}});
    let [old, new] = [old, new].map(|material| quad(material, &strip(&[0, 1, 2])));
    assert_eq!(old.materials, new.materials);
    assert_eq!(hash(&old), hash(&new));
    // Defaults of the extension: white, of full gloss.
    let scene = quad(json!({"extensions": {"KHR_materials_pbrSpecularGlossiness": {}}}), &strip(&[0]));
    let Material { roughness, specular_color, ior, metallic, .. } = scene.materials[0];
    assert_eq!((roughness, specular_color, ior, metallic), (0.0, glam::Vec3::ONE, 0.0, 0.0));
}

/// A factor of 0 needs no texture, and thickness is what the geometry is: neither image is decoded; the latter is in
/// the plan with its reason.
#[test]
fn textures_that_change_nothing_are_not_decoded() {
    let off = json!({"extensions": {
        "KHR_materials_clearcoat": {"clearcoatTexture": {"index": 0}, "clearcoatNormalTexture": {"index": 0}},
        "KHR_materials_transmission": {"transmissionTexture": {"index": 0}},
        "KHR_materials_volume": {"thicknessFactor": 1, "thicknessTexture": {"index": 0}}}});
    let scene = quad(off, &strip(&[0]));
    assert!(scene.textures.is_empty() && !scene.materials[0].reads_textures());
    let renderer = pathspace::render::Renderer::new(&scene, options(8, 8, 1)).expect("a sound scene");
    let ignored = &renderer.plan().effects.ignored;
    assert!(ignored.iter().any(|ignored| ignored.what.starts_with("thickness-textures")), "{ignored:?}");
}

/// An image whose every texel is `[r, g, b]` but for its alpha.
fn uniform(rgb: [u8; 3]) -> Vec<u8> {
    let image = image::RgbaImage::from_fn(4, 1, |x, _| image::Rgba([rgb[0], rgb[1], rgb[2], 200 + x as u8]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).expect("a PNG in memory");
    bytes.into_inner()
}

/// A clearcoat has its own normals: those of its map, or of the mesh, whatever the map of the surface below. Oracles: a
/// black surface under a layer shows what it shows without its own normal map (to 1e-3 of the mean: frames round
/// otherwise); a layer with that map shows something else.
#[test]
fn clearcoats_have_their_own_normals() {
    let mean = |maps: &[&str]| {
        let mut material = json!({
            "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0},
            "extensions": {
                "KHR_materials_specular": {"specularFactor": 0},
                "KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatRoughnessFactor": 0.3}
            }
        });
        for map in maps {
            match *map {
                "clearcoatNormalTexture" => {
                    material["extensions"]["KHR_materials_clearcoat"][map] = json!({"index": 0});
                }
                _ => material[map] = json!({"index": 0}),
            }
        }
        // Tilted by 31° to +x, so that it shows the viewer what comes from 62°.
        let mut scene = quad(material, &uniform([190, 128, 237]));
        scene.environment = None;
        scene.punctual.push(PunctualLight {
            name: "from the side".into(),
            position: Vec3::ZERO,
            direction: -Vec3::new(0.88, 0.0, 0.47).normalize(),
            intensity: Vec3::ONE,
            kind: PunctualKind::Directional,
            range_m: f32::INFINITY,
            profile: None,
        });
        let film = render(&scene, options(16, 16, 64)).film;
        (6..10).map(|x| (6..10).map(|y| film.pixel(x, y).mean()[1]).sum::<f64>()).sum::<f64>() / 16.0
    };
    let plain = mean(&[]);
    let below = mean(&["normalTexture"]);
    assert!((below - plain).abs() < 1e-3 * plain, "{below} {plain}");
    let own = mean(&["clearcoatNormalTexture"]);
    assert!(own > 1.5 * plain, "{own} {plain}");
}

/// A required extension that is not supported ends the load; one of materials is a warning if that is allowed.
#[test]
fn missing_extensions_of_materials_can_be_allowed() {
    let load = |extension: &str, allowed: bool| {
        let fixture = Fixture::quad()
            .set("/extensionsRequired", json!([extension]))
            .set("/extensionsUsed", json!([extension]))
            .set("/materials/0/extensions", json!({extension: {}}));
        let directory = tempfile::tempdir().expect("a temporary directory");
        let options = LoadOptions::default().allow_missing_extensions(allowed);
        Scene::load_with(fixture.write(directory.path()), &options)
    };
    for (extension, allowed) in [("KHR_materials_nonesuch", false), ("KHR_geometry_nonesuch", true)] {
        assert!(matches!(load(extension, allowed), Err(pathspace::Error::UnsupportedExtension { .. })), "{extension}");
    }
    let scene = load("KHR_materials_nonesuch", true).expect("allowed");
    let required = scene.warnings.iter().filter(|warning| warning.what.contains("required and not supported"));
    assert_eq!(required.count(), 1, "{:?}", scene.warnings);
}
