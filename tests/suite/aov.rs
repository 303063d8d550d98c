//! Extra outputs of a render. Oracles: the picture itself, and a scene whose first hits are known by hand.
//! Deterministic.

use glam::{Affine3A, DVec3, Vec3};
use pathspace::film::channel::Channel;
use pathspace::plan::Aov;
use pathspace::plan::options::{Fog, SamplerKind, Strategy};
use pathspace::render::{CameraChoice, FilterKind, Render, Renderer};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Environment, Material, Mesh, Projection, Scene};

use crate::common::{options, render};

/// A square of side 2 m at z = −1 that fills the left half of the view of a parallel camera at z = 2; nothing behind.
fn half_a_wall() -> Scene {
    let mut b = SceneBuilder::new();
    let wall = b.emitter(Vec3::new(0.25, 0.5, 0.75), Vec3::ONE);
    b.quad([(-2.0, -1.0), (0.0, -1.0), (0.0, 1.0), (-2.0, 1.0)].map(|(x, y)| Vec3::new(x, y, -1.0)), wall);
    let eye = Vec3::new(0.0, 0.0, 2.0);
    b.any_camera(eye, Vec3::ZERO, Vec3::Y, Projection::Orthographic { xmag_m: 1.0, ymag_m: 1.0 });
    b.build()
}

fn channels(render: &Render, aovs: &[Aov]) -> Vec<Channel> {
    render.film.channels(aovs, 64)
}

#[test]
fn first_hits_are_those_of_the_scene() {
    let aovs = vec![Aov::ALBEDO, Aov::NORMAL, Aov::DEPTH, Aov::POSITION];
    let render = render(&half_a_wall(), options(8, 8, 4).aovs(aovs.clone()));
    let channels = channels(&render, &aovs);
    let at = |name: &str, x: usize, y: usize| {
        channels.iter().find(|c| c.name == name).unwrap_or_else(|| panic!("no channel {name}")).values[y * 8 + x]
    };
    for (y, x) in (0..8).flat_map(|y| (0..4).map(move |x| (y, x))) {
        // Pixels are 0.25 m; row 0 is on top.
        let (px, py) = (-1.0 + 0.25 * (x as f32 + 0.5), 1.0 - 0.25 * (y as f32 + 0.5));
        let got = ["albedo.R", "albedo.B", "N.X", "N.Z", "Z", "P.X", "P.Y", "P.Z"].map(|name| at(name, x, y));
        for (got, expected) in got.into_iter().zip([0.25, 0.75, 0.0, 1.0, 3.0, px, py, -1.0]) {
            assert!((got - expected).abs() < 1e-6, "pixel {x},{y}: {got}, expected {expected}");
        }
        assert_eq!((at("albedo.G", x + 4, y), at("N.Z", x + 4, y), at("P.Z", x + 4, y)), (0.0, 0.0, 0.0));
        assert_eq!(at("Z", x + 4, y), f32::MAX);
    }
}

/// A wall seen from behind whose corners lean by 45°: the geometric normal is that of the plane, the shading normal
/// leans, both turned to the viewer.
#[test]
fn geometric_normals_do_not_lean_with_the_corners() {
    let mut b = SceneBuilder::new();
    let material = b.lambert(Vec3::ONE);
    let positions = [(-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0)].map(|(x, y)| Vec3::new(x, y, -1.0));
    let leaning = Vec3::new(1.0, 0.0, -1.0).normalize();
    let wall = b.full_mesh(Mesh {
        name: "wall".into(),
        positions: positions.to_vec(),
        triangles: vec![[0, 2, 1], [0, 3, 2]],
        normals: Some(vec![leaning; 4]),
        material,
        ..Mesh::default()
    });
    b.place(wall, Affine3A::IDENTITY);
    b.camera(Vec3::new(0.0, 0.0, -4.0), Vec3::ZERO, Vec3::Y, 0.5);
    b.camera(Vec3::new(0.0, 0.0, 2.0), Vec3::ZERO, Vec3::Y, 0.5);
    let scene = b.build();
    for (camera, side) in [(0, -1.0), (1, 1.0)] {
        let options =
            options(4, 4, 4).aovs(vec![Aov::NORMAL, Aov::GEOMETRIC_NORMAL]).camera(CameraChoice::Index(camera));
        let film = render(&scene, options.filter(FilterKind::Box)).film;
        let layer = |aov| film.layer(aov).expect("asked for");
        let close = |found: [f64; 3], expected: Vec3| DVec3::from(found).distance(expected.as_dvec3()) < 1e-6;
        assert!(layer(Aov::GEOMETRIC_NORMAL).iter().all(|&n| close(n, side * Vec3::Z)), "{side}");
        assert!(layer(Aov::NORMAL).iter().all(|&n| close(n, -side * leaning)), "{side}");
        // The wall has no texture coordinates.
        assert!(film.channels(&[Aov::UV], 1).is_empty());
    }
}

/// What is asked for besides changes no bit of the picture; what is not asked for has no stage.
#[test]
fn extra_outputs_leave_the_picture_alone() {
    let scene = half_a_wall();
    let plain = Renderer::new(&scene, options(8, 8, 4)).expect("a valid scene");
    let asked = options(8, 8, 4).aovs(Aov::all().collect::<Vec<_>>());
    let full = Renderer::new(&scene, asked).expect("a valid scene");
    for stage in ["per-length", "first-hit"] {
        assert!(!plain.plan().stages.contains(&stage) && full.plan().stages.contains(&stage), "{stage}");
    }
    let (plain, full) = (plain.render().expect("renders"), full.render().expect("renders"));
    assert_eq!(plain.film.hash(), full.film.hash());
    assert_eq!((plain.film.planes().len(), full.film.planes().len()), (0, 23));
    assert!(full.counters.rays_camera > plain.counters.rays_camera);
}

/// The parts by number of bounces sum to the beauty, all of them or in three, pixel by pixel, up to the rounding of f32
/// sums of 64 terms.
#[test]
fn bounces_sum_to_the_picture() {
    let mut b = SceneBuilder::new();
    let material = b.emitter(Vec3::new(0.9, 0.5, 0.1), Vec3::ONE);
    b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, material);
    b.camera(Vec3::new(0.1, 0.2, 0.3), Vec3::new(1.0, 0.3, 0.1), Vec3::Y, 1.0);
    let scene = b.build();
    let bounces = render(&scene, options(16, 16, 8).aovs([Aov::BOUNCES]));
    let three = [Aov::EMISSION, Aov::DIRECT, Aov::INDIRECT];
    let by_edges = render(&scene, options(16, 16, 8).aovs(three));
    assert_eq!((bounces.film.planes().len(), by_edges.film.planes().len()), (1, 3));
    sum_to_the_picture(&bounces, &channels(&bounces, &[Aov::BOUNCES]), 48);
    sum_to_the_picture(&by_edges, &channels(&by_edges, &three), 9);
    let [emission, direct] = [Aov::EMISSION, Aov::DIRECT].map(|aov| by_edges.film.layer(aov).expect("asked for"));
    let seen = bounces.film.path_lengths().expect("asked for");
    for (layer, edges) in [(emission, 1), (direct, 2)] {
        let near = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).all(|c| (a[c] - b[c]).abs() <= 1e-12 * b[c]);
        assert!(layer.iter().zip(&seen.image(edges)).all(near), "paths of {edges} edges");
    }
}

fn sum_to_the_picture(render: &Render, channels: &[Channel], expected: usize) {
    assert_eq!(channels.len(), expected);
    for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
        for (p, pixel) in render.film.pixels.iter().enumerate() {
            let parts = channels.iter().filter(|channel| channel.name.ends_with(name));
            let sum: f64 = parts.map(|channel| f64::from(channel.values[p])).sum();
            let mean = pixel.mean()[c];
            assert!((sum - mean).abs() <= 64.0 * 2f64.powi(-24) * mean, "pixel {p} {name}: {sum} for {mean}");
        }
    }
}

/// What camera rays pass on their way to the sky takes its share of the background and covers the rest, by the mean
/// over channels: a tinted volume of the index of air, and fog, which a ray passes or collides in. Oracles: Beer and
/// Lambert by hand; in fog, exactly, that a ray sees all of the sky or none of it, and that fog that scatters
/// everything in a sky of radiance 1 has that radiance; the share that passes within 4.9 standard errors (10⁻⁶).
#[test]
fn the_background_is_what_passes() {
    let aovs = [Aov::BACKGROUND, Aov::COVERAGE];
    let sky = Environment::constant(Vec3::ONE);
    let mut b = SceneBuilder::new();
    let tint = b.material(Material {
        metallic: 0.0,
        roughness: 0.0,
        transmission: 1.0,
        thickness: 1.0,
        ior: 1.0,
        attenuation_distance_m: 2.0,
        attenuation_color: Vec3::new(1.0, 0.5, 0.25),
        ..Material::default()
    });
    b.cuboid(Vec3::new(-9.0, -9.0, -4.0), Vec3::new(9.0, 9.0, 0.0), false, tint);
    b.environment(sky.clone());
    let view = Projection::Orthographic { xmag_m: 1.0, ymag_m: 1.0 };
    b.any_camera(Vec3::new(0.0, 0.0, 2.0), Vec3::ZERO, Vec3::Y, view);
    let film = render(&b.build(), options(4, 4, 2).aovs(aovs)).film;
    let left = [1.0, 0.25, 0.0625];
    let [background, coverage] = aovs.map(|aov| film.layer(aov).expect("asked for"));
    for (p, pixel) in film.pixels.iter().enumerate() {
        let mean = pixel.mean();
        assert!((0..3).all(|c| (background[p][c] - left[c]).abs() < 1e-5 && (mean[c] - left[c]).abs() < 1e-5));
        let covered = 1.0 - left.iter().sum::<f64>() / 3.0;
        assert!((coverage[p][0] - covered).abs() < 1e-5, "{:?}", coverage[p]);
    }

    let mut b = SceneBuilder::new();
    let speck = b.lambert(Vec3::ONE);
    for x in [-1.0, 1.0] {
        b.triangles([0.0, 1.0, 2.0].map(|y| Vec3::new(x, 0.1 * y, 0.1 * y * y)).to_vec(), vec![[0, 1, 2]], speck);
    }
    b.environment(sky);
    b.camera(Vec3::new(0.0, 0.1, 0.2), Vec3::new(0.0, 0.1, -9.0), Vec3::Y, 1e-3);
    let scene = b.build();
    let fog = Fog { sigma_t: 0.7, albedo: 1.0, g: 0.3 };
    let options = options(16, 16, 16).aovs(aovs).fog(fog).max_depth(4096);
    let options = options.sampler(SamplerKind::Independent).strategy(Strategy::BSDF);
    let renderer = Renderer::new(&scene, options).expect("a valid scene");
    let fog = renderer.plan().fog.expect("fog");
    let passes = (-0.7 * f64::from(fog.met_by(scene.cameras[0].position(), Vec3::NEG_Z)[1])).exp();
    assert!((0.3..0.7).contains(&passes), "{passes}");
    let film = renderer.render().expect("renders").film;
    let [background, coverage] = aovs.map(|aov| film.layer(aov).expect("asked for"));
    let (mut seen, n) = (0.0, 16.0 * 16.0 * 16.0);
    for p in 0..film.pixels.len() {
        assert!((0..3).all(|c| (background[p][c] + coverage[p][0] - 1.0).abs() < 1e-6), "{:?}", background[p]);
        assert!((film.pixels[p].mean()[1] - 1.0).abs() < 1e-4, "{:?}", film.pixels[p].mean());
        seen += background[p][0] / film.pixels.len() as f64;
    }
    let error = (passes * (1.0 - passes) / n).sqrt();
    assert!((seen - passes).abs() < 4.9 * error, "{seen} for {passes} ± {error}");
}
