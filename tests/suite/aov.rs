//! Extra outputs of a render. Oracles: the picture itself, and a scene whose first hits are known by hand.
//! Deterministic.

use glam::{Affine3A, DVec3, Vec3};
use pathspace::film::channel::Channel;
use pathspace::plan::Aov;
use pathspace::render::{CameraChoice, FilterKind, Render, Renderer};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Mesh, Projection, Scene};

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
    assert_eq!((plain.film.planes().len(), full.film.planes().len()), (0, 9));
    assert!(full.counters.rays_camera > plain.counters.rays_camera);
}

/// The parts by number of bounces sum to the beauty, pixel by pixel, up to the rounding of f32 sums of 64 terms.
#[test]
fn bounces_sum_to_the_picture() {
    let mut b = SceneBuilder::new();
    let material = b.emitter(Vec3::new(0.9, 0.5, 0.1), Vec3::ONE);
    b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, material);
    b.camera(Vec3::new(0.1, 0.2, 0.3), Vec3::new(1.0, 0.3, 0.1), Vec3::Y, 1.0);
    let render = render(&b.build(), options(16, 16, 8).aovs(vec![Aov::BOUNCES]));
    let channels = channels(&render, &[Aov::BOUNCES]);
    assert_eq!(channels.len(), 48);
    for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
        for (p, pixel) in render.film.pixels.iter().enumerate() {
            let parts = channels.iter().filter(|channel| channel.name.ends_with(name));
            let sum: f64 = parts.map(|channel| f64::from(channel.values[p])).sum();
            let mean = pixel.mean()[c];
            assert!((sum - mean).abs() <= 64.0 * 2f64.powi(-24) * mean, "pixel {p} {name}: {sum} for {mean}");
        }
    }
}
