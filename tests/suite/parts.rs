//! Radiance in parts: by group of lights, and by what the first vertex does. Oracles: the beauty, which the parts sum
//! to, pixel by pixel; the scene with the lamps of one group alone; surfaces without a base; other strategies; one
//! render, which parts of its samples add up to. All renders have fixed seeds; comparisons of means are at 4.9 standard
//! errors of the pixels' differences (two-sided 10⁻⁶).

use glam::{Affine3A, Vec2, Vec3, Vec4};
use pathspace::film::Film;
use pathspace::plan::Aov;
use pathspace::plan::options::{Fog, SamplerKind, Strategy};
use pathspace::render::{LightGroup, RenderOptions, Renderer};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{
    ColorSpace, Environment, LoadOptions, Material, Mesh, Scene, Texture, TextureId, TextureSlot, Wrap,
};

use crate::common::{Estimate, options, probe_film, render};

/// Names of the lamps of [`studio`], with the groups that [`groups`] puts them into.
const LAMPS: [(&str, &str); 7] = [
    ("Key", "key"),
    ("Key.textured", "key"),
    ("Bulb", "bulb"),
    ("Swing", "swing"),
    ("Sign", "default"),
    ("Sheet", "default"),
    ("environment", "sky"),
];

fn groups() -> Vec<LightGroup> {
    vec![LightGroup::new("key", "Key*"), LightGroup::new("sky", "environment"), LightGroup::new("key", "B*x")]
}

fn glass() -> Material {
    Material { metallic: 0.0, roughness: 0.0, transmission: 1.0, thickness: 1.0, ..Material::default() }
}

/// A quadrilateral with texture coordinates and tangents.
fn textured(b: &mut SceneBuilder, corners: [Vec3; 4], material: Material) {
    let material = b.material(material);
    let uvs = Some([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(Vec2::from).to_vec());
    let (positions, triangles) = (corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
    let tangents = Some(vec![Vec4::new(1.0, 0.0, 0.0, 1.0); 4]);
    let normals = Some(vec![(corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize(); 4]);
    let name = "textured".into();
    let mesh = Mesh { name, positions, triangles, normals, uvs, tangents, material, ..Mesh::default() };
    let mesh = b.full_mesh(mesh);
    b.place(mesh, Affine3A::IDENTITY);
}

/// A corner of a room under the sky with everything that takes part: lamps of every kind (a plain rectangle, one with a
/// texture, a point light, a triangle that moves, an unlit sign, a sheet that shines to both sides), and surfaces of
/// every kind (diffuse, coated, lacquered, of metal, of glass, translucent, in instances). Lamps that are not `lit` are
/// there and black.
fn studio(lit: impl Fn(&str) -> bool) -> Scene {
    let mut b = SceneBuilder::new();
    let light = |name: &str, radiance: Vec3| if lit(name) { radiance } else { Vec3::ZERO };
    let grey = b.lambert(Vec3::new(0.7, 0.6, 0.5));
    let coated = Material {
        base_color: Vec3::new(0.2, 0.5, 0.7),
        metallic: 0.0,
        roughness: 0.4,
        normal_texture: Some(TextureSlot { texture: TextureId(1), uv_set: 0 }),
        ..Material::default()
    };
    let lacquered = b.material(Material {
        base_color: Vec3::new(0.7, 0.1, 0.1),
        metallic: 0.3,
        roughness: 0.6,
        clearcoat: 1.0,
        clearcoat_roughness: 0.4,
        sheen_color: Vec3::splat(0.3),
        sheen_roughness: 0.5,
        ..Material::default()
    });
    let leaf = b.material(Material {
        base_color: Vec3::new(0.3, 0.6, 0.2),
        metallic: 0.0,
        roughness: 0.5,
        diffuse_transmission: 0.5,
        diffuse_transmission_color: Vec3::new(0.5, 0.7, 0.1),
        ..Material::default()
    });
    let metal = b.metal(Vec3::new(0.9, 0.7, 0.4), 0.4);
    let frosted = b.material(Material { roughness: 0.5, ..glass() });
    let clear = b.material(glass());
    let quad =
        |z: f32, [x0, x1, y0, y1]: [f32; 4]| [(x0, y0), (x1, y0), (x1, y1), (x0, y1)].map(|(x, y)| Vec3::new(x, y, z));
    let flat =
        |y: f32, [x0, x1, z0, z1]: [f32; 4]| [(x0, z1), (x1, z1), (x1, z0), (x0, z0)].map(|(x, z)| Vec3::new(x, y, z));
    b.quad(flat(0.0, [-2.0, 2.0, -2.0, 2.0]), grey);
    textured(&mut b, quad(-2.0, [-2.0, 2.0, 0.0, 3.0]), coated);
    b.sphere(Vec3::new(-1.2, 0.5, -0.6), 0.5, 12, false, true, lacquered);
    b.sphere(Vec3::new(0.0, 0.45, 0.4), 0.4, 12, false, true, clear);
    b.sphere(Vec3::new(1.2, 0.5, -0.6), 0.5, 12, false, true, metal);
    b.sphere(Vec3::new(0.0, 1.6, -0.8), 0.35, 12, false, true, frosted);
    b.quad(quad(1.2, [0.5, 1.4, 0.1, 1.0]), leaf);

    let key = b.emitter(Vec3::ZERO, light("Key", Vec3::new(9.0, 8.0, 7.0)));
    b.node("Key", None).quad(flat(2.8, [-1.5, -0.9, -0.5, 0.3]).map(|p| Vec3::new(p.x, p.y, -p.z)), key);
    let emissive = light("Key.textured", Vec3::new(4.0, 6.0, 8.0));
    let slot = Some(TextureSlot { texture: TextureId(0), uv_set: 0 });
    let panel = Material { base_color: Vec3::ZERO, emissive, emissive_texture: slot, ..Material::default() };
    b.node("Key.textured", None);
    textured(&mut b, quad(-1.9, [-1.9, -1.2, 1.5, 2.5]), panel);
    b.node("Bulb", Some("bulb")).point_light(Vec3::new(1.5, 2.5, 1.0), light("Bulb", Vec3::new(2.0, 3.0, 1.0)));
    let swing = b.emitter(Vec3::ZERO, light("Swing", Vec3::new(1.0, 9.0, 4.0)));
    let triangle = [Vec3::new(-0.4, 2.9, -1.2), Vec3::new(1.6, 2.4, -0.8), Vec3::new(0.7, 1.2, -0.3)];
    let swing = b.mesh(triangle.to_vec(), vec![[0, 1, 2], [0, 2, 1]], swing);
    b.node("Swing", Some("swing"));
    b.place_moving(swing, vec![Affine3A::IDENTITY, Affine3A::from_translation(Vec3::new(0.2, 0.0, 0.1))]);
    let sign = Material { base_color: light("Sign", Vec3::new(0.3, 0.9, 0.1)), unlit: true, ..Material::default() };
    let sign = b.material(sign);
    b.node("Sign", None).quad(quad(-1.9, [1.2, 1.9, 1.4, 1.8]), sign);
    let sheet = b.material(Material {
        base_color: Vec3::ZERO,
        metallic: 0.0,
        specular: 0.0,
        emissive: light("Sheet", Vec3::new(8.0, 5.0, 3.0)),
        double_sided: true,
        ..Material::default()
    });
    b.node("Sheet", None).quad(quad(-0.2, [-1.9, -1.7, 0.4, 1.6]), sheet);
    if lit("environment") {
        let texels: Vec<Vec3> = (0..32).map(|i| Vec3::new(0.2, 0.3, 0.1 + 0.03 * i as f32)).collect();
        let map = Environment { width: 8, height: 4, texels: texels.into(), rotation_rad: 0.3, intensity: 1.0 };
        b.environment(map);
    }
    b.camera(Vec3::new(0.3, 1.4, 4.2), Vec3::new(0.0, 1.0, -1.0), Vec3::Y, 0.9);
    let mut scene = b.build();
    let texture = |texels: [[u8; 4]; 16]| Texture {
        name: "4 × 4".into(),
        width: 4,
        height: 4,
        texels: texels.into_iter().collect(),
        color_space: ColorSpace::Linear,
        wrap_u: Wrap::Repeat,
        wrap_v: Wrap::Repeat,
        bilinear: true,
    };
    let panel = std::array::from_fn(|i| [255 - 15 * i as u8, 40 + 10 * (i as u8 % 4), 17 * i as u8, 255]);
    let tilts = std::array::from_fn(|i| [if i % 2 == 0 { 215 } else { 40 }, 128 + 5 * i as u8, 190, 255]);
    scene.textures = vec![texture(panel), texture(tilts)];
    scene
}

/// Every channel of `layers` together is the beauty, pixel by pixel, up to the rounding of f32 sums: of a path of at
/// most 12 edges there are up to 24 terms, and 48 roundings of 2⁻²⁴ in the two sums.
fn sum_to_the_beauty(what: &str, film: &Film, layers: &[Vec<[f64; 3]>]) {
    for (p, pixel) in film.pixels.iter().enumerate() {
        for c in 0..3 {
            let (sum, mean) = (layers.iter().map(|layer| layer[p][c]).sum::<f64>(), pixel.mean()[c]);
            let bound = 48.0 * 2f64.powi(-24) * mean;
            assert!((sum - mean).abs() <= bound, "{what}, pixel {p}, channel {c}: {sum} for {mean}");
        }
    }
}

/// Scenes and settings under which parts are held to the whole.
fn settings() -> impl Iterator<Item = (String, RenderOptions)> {
    let fog = Some(Fog { sigma_t: 0.15, albedo: 0.8, g: 0.4 });
    let strategies = [Strategy::MIS, Strategy::BSDF, Strategy::LIGHT];
    strategies.into_iter().flat_map(move |strategy| {
        [None, fog].map(|fog| {
            let options = options(24, 18, 4).strategy(strategy).fog(fog).max_depth(12);
            (format!("{strategy}, {}", if fog.is_some() { "fog" } else { "clear" }), options)
        })
    })
}

#[test]
fn light_groups_sum_to_the_beauty() {
    let scene = studio(|_| true);
    for (what, options) in settings() {
        let film = render(&scene, options.aovs([Aov::LIGHT_GROUPS]).light_groups(groups())).film;
        assert_eq!(film.light_groups(), ["default", "bulb", "key", "sky", "swing"]);
        let layers: Vec<_> = film.light_groups().iter().filter_map(|name| film.light_group(name)).collect();
        sum_to_the_beauty(&what, &film, &layers);
        // BSDF sampling alone finds no punctual light.
        for (name, layer) in film.light_groups().iter().zip(&layers) {
            let dark = name == "bulb" && what.starts_with("bsdf");
            assert_eq!(layer.iter().all(|values| values == &[0.0; 3]), dark, "{what}: {name}");
        }
    }
}

/// What the layers of lobes are, and with them the beauty.
const BY_LOBES: [Aov; 5] = [Aov::EMISSION, Aov::DIFFUSE, Aov::GLOSSY, Aov::TRANSMISSION, Aov::VOLUME];

#[test]
fn lobes_sum_to_the_beauty() {
    let scene = studio(|_| true);
    for (what, options) in settings() {
        let foggy = options.fog.is_some();
        let film = render(&scene, options.aovs(BY_LOBES)).film;
        let layers = BY_LOBES.map(|aov| film.layer(aov).expect("asked for"));
        sum_to_the_beauty(&what, &film, &layers);
        for (aov, layer) in BY_LOBES.into_iter().zip(&layers) {
            let dark = aov == Aov::VOLUME && !foggy;
            assert_eq!(layer.iter().all(|values| values == &[0.0; 3]), dark, "{what}: {aov}");
        }
    }
}

/// Layers do not depend on who finds the light. Oracle: light sampling and BSDF sampling alone, by other random
/// numbers, under the sky, which both find well enough.
#[test]
fn lobes_are_those_of_every_strategy() {
    let scene = studio(|lamp| lamp == "environment");
    let aovs = [Aov::DIFFUSE, Aov::GLOSSY, Aov::TRANSMISSION];
    let layers = |strategy, seed| {
        let options = options(24, 18, 256).strategy(strategy).max_depth(2).aovs(aovs).seed(seed);
        let film = render(&scene, options).film;
        aovs.map(|aov| film.layer(aov).expect("asked for"))
    };
    let mis = layers(Strategy::MIS, 0);
    for (strategy, seed) in [(Strategy::BSDF, 1), (Strategy::LIGHT, 2)] {
        for ((aov, a), b) in aovs.iter().zip(&mis).zip(&layers(strategy, seed)) {
            agree(&format!("{aov} by {strategy}"), a, b);
        }
    }
}

/// What a dielectric's coat, lacquer and fibres reflect is what they reflect over a black base, what comes through a
/// leaf is what comes through one that reflects nothing else; the rest is diffuse. Under a sky of radiance 1, seen from
/// 45°. Oracle: those surfaces.
#[test]
fn lobes_are_those_of_surfaces_without_a_base() {
    let coat = Material { metallic: 0.0, roughness: 0.5, base_color: Vec3::new(0.9, 0.5, 0.2), ..Material::default() };
    let lacquer = Material { clearcoat: 1.0, clearcoat_roughness: 0.3, ..coat.clone() };
    let velvet = Material { sheen_color: Vec3::new(0.2, 0.5, 0.8), sheen_roughness: 0.5, ..coat.clone() };
    let color = Vec3::new(0.3, 0.6, 0.1);
    let leaf = Material { diffuse_transmission: 0.4, diffuse_transmission_color: color, ..coat.clone() };
    for (what, material) in [("coat", &coat), ("lacquer", &lacquer), ("velvet", &velvet), ("leaf", &leaf)] {
        let see = |material: Material, seed| {
            let mut b = SceneBuilder::new();
            let material = b.material(material);
            b.quad([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 0.0)), material);
            b.environment(Environment::constant(Vec3::ONE));
            let options = options(1, 1, 16).aovs(BY_LOBES).max_depth(2).seed(seed);
            let film = probe_film(&b.build(), Vec3::new(-1.0, 0.0, 1.0), Vec3::new(1.0, 0.0, -1.0), 1024, options).film;
            BY_LOBES.map(|aov| film.layer(aov).expect("asked for"))
        };
        let [_, _, glossy, transmission, _] = see(material.clone(), 0);
        let [emission, diffuse, other_glossy, other_transmission, volume] =
            see(Material { base_color: Vec3::ZERO, ..material.clone() }, 1);
        for dark in [emission, diffuse, volume] {
            assert!(dark.iter().all(|values| values == &[0.0; 3]), "{what}");
        }
        agree(what, &glossy, &other_glossy);
        if material.diffuse_transmission > 0.0 {
            agree("through a leaf", &transmission, &other_transmission);
        }
    }
}

/// In fog that scatters everything, under a sky of radiance 1, what is scattered has that radiance: the layer is the
/// share of rays that collide. Oracle: the layer of coverage, exactly up to rounding and roulette.
#[test]
fn a_volume_shows_what_collides() {
    let mut b = SceneBuilder::new();
    let speck = b.lambert(Vec3::ONE);
    for x in [-1.0, 1.0] {
        b.triangles([0.0, 1.0, 2.0].map(|y| Vec3::new(x, 0.1 * y, 0.1 * y * y)).to_vec(), vec![[0, 1, 2]], speck);
    }
    b.environment(Environment::constant(Vec3::ONE));
    b.camera(Vec3::new(0.0, 0.1, 0.2), Vec3::new(0.0, 0.1, -9.0), Vec3::Y, 1e-3);
    let options = options(8, 8, 16).aovs([Aov::VOLUME, Aov::EMISSION, Aov::COVERAGE]).max_depth(4096);
    let options = options.fog(Fog { sigma_t: 0.7, albedo: 1.0, g: 0.3 }).sampler(SamplerKind::Independent);
    let film = render(&b.build(), options.strategy(Strategy::BSDF)).film;
    let [volume, emission, coverage] =
        [Aov::VOLUME, Aov::EMISSION, Aov::COVERAGE].map(|aov| film.layer(aov).expect("asked for"));
    for p in 0..film.pixels.len() {
        let covered = coverage[p][0];
        assert!((volume[p][1] - covered).abs() < 1e-4, "pixel {p}: {} for {covered}", volume[p][1]);
        assert!((emission[p][1] - (1.0 - covered)).abs() < 1e-4, "pixel {p}: {} for {covered}", emission[p][1]);
    }
}

/// Mean over the pixels of what two independent renders differ by, of `a`'s mean.
fn agree(what: &str, a: &[[f64; 3]], b: &[[f64; 3]]) {
    let differences = a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| a[c] - b[c]));
    let (found, mean) = (Estimate::of(differences), Estimate::of(a.iter().copied()).mean);
    for c in 0..3 {
        let error = found.standard_error(c);
        assert!(found.mean[c].abs() <= 4.9 * error, "{what}, channel {c}: {} ± {error}", found.mean[c]);
        assert!(4.9 * error <= 0.3 * mean[c], "{what}, channel {c}: too noisy, {error} at {}", mean[c]);
    }
}

/// What the layer of a group shows is the scene with its lamps alone. Oracle: that scene, by other random numbers.
#[test]
fn a_group_alone_is_its_layer() {
    let fog = Fog { sigma_t: 0.1, albedo: 0.8, g: 0.4 };
    let options = || options(24, 18, 128).fog(fog).max_depth(12);
    let all = options().aovs([Aov::LIGHT_GROUPS]).light_groups(groups());
    let film = render(&studio(|_| true), all).film;
    for name in film.light_groups() {
        let alone = studio(|lamp| LAMPS.iter().any(|(of, group)| *of == lamp && group == name));
        let alone = render(&alone, options().seed(1)).film;
        let picture: Vec<[f64; 3]> =
            alone.pixels.iter().map(|pixel| std::array::from_fn(|c| pixel.mean()[c])).collect();
        agree(name, &film.light_group(name).expect("kept"), &picture);
    }
}

/// Parts of the samples, saved and read back, have the bits of one render in every part. Oracle: that render.
#[test]
fn parts_by_samples_add_up() {
    let scene = studio(|_| true);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let part = |start, spp| {
        let options = options(24, 18, spp).sample_start(start).max_depth(6);
        let aovs = [Aov::LIGHT_GROUPS].into_iter().chain(BY_LOBES).collect::<Vec<_>>();
        let film = render(&scene, options.aovs(aovs).light_groups(groups())).film;
        let path = folder.path().join("film");
        film.save(&path).expect("a writable folder");
        Film::restore(&path).expect("just saved")
    };
    let (whole, mut first) = (part(0, 4), part(0, 2));
    first.merge(&part(2, 2)).expect("the same picture");
    assert_eq!(first.digest(), whole.digest());
    assert!(first == whole);
    // Other groups are other layers.
    let other = render(&scene, options(24, 18, 2).sample_start(2).aovs([Aov::LIGHT_GROUPS])).film;
    assert!(part(0, 2).merge(&other).is_err());
}

/// A file says which group its lamps are in; a name that no layer can have is warned of. Oracle: the file.
#[test]
fn files_name_groups_by_nodes() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.gltf");
    let with = |name: serde_json::Value| {
        let mut json: serde_json::Value =
            serde_json::from_slice(&std::fs::read(file).expect("it is there")).expect("JSON");
        for node in json["nodes"].as_array_mut().expect("nodes") {
            node["extras"] = serde_json::json!({ "lightgroup": name, "other": [1] });
        }
        Scene::from_bytes(json.to_string().into_bytes(), file, &LoadOptions::default()).expect("a valid scene")
    };
    let groups = |scene: &Scene| {
        let renderer = Renderer::new(scene, options(8, 8, 1).aovs([Aov::LIGHT_GROUPS])).expect("valid options");
        let film = renderer.render().expect("renders").film;
        (film.light_groups().to_vec(), film.light_group("default").expect("always there"))
    };
    let (names, rest) = groups(&with("room lights".into()));
    assert_eq!(names, ["default", "room lights"]);
    assert!(rest.iter().all(|values| values == &[0.0; 3]));
    for bad in ["a.b".into(), 7.into(), "".into()] {
        let scene = with(bad);
        assert!(scene.warnings.iter().any(|warning| warning.place.contains("lightgroup")), "{:?}", scene.warnings);
        assert_eq!(groups(&scene).0, ["default"]);
    }
}
