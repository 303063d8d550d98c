//! Extra outputs of a render. Oracles: the picture itself, and a scene whose first hits are known by hand. Deterministic.

use glam::Vec3;
use pathspace::film::aov::{self, Aov, Channel, Sources};
use pathspace::plan::options::RenderOptions;
use pathspace::render::{Render, Renderer};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Projection, Scene};

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
    let first_hits = render.first_hits.as_deref();
    aov::channels(aovs, &Sources { film: &render.film, lengths: render.lengths.as_ref(), first_hits, max_depth: 64 })
}

#[test]
fn first_hits_are_those_of_the_scene() {
    let aovs = vec![Aov::Albedo, Aov::Normal, Aov::Depth, Aov::Position];
    let render = render(&half_a_wall(), RenderOptions { aovs: aovs.clone(), ..options(8, 8, 4) });
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

/// What is asked for besides changes no bit of the picture; what is not asked for has no stage.
#[test]
fn extra_outputs_leave_the_picture_alone() {
    let scene = half_a_wall();
    let plain = Renderer::new(&scene, options(8, 8, 4)).expect("a valid scene");
    let asked = RenderOptions { aovs: Aov::ALL.to_vec(), ..options(8, 8, 4) };
    let full = Renderer::new(&scene, asked).expect("a valid scene");
    for stage in ["per-length", "first-hit"] {
        assert!(!plain.plan().stages.contains(&stage) && full.plan().stages.contains(&stage), "{stage}");
    }
    let (plain, full) = (plain.render().expect("renders"), full.render().expect("renders"));
    assert_eq!(plain.film.hash(), full.film.hash());
    assert!(plain.lengths.is_none() && plain.first_hits.is_none());
    assert!(full.counters.rays_camera > plain.counters.rays_camera);
}

/// The parts by number of bounces sum to the beauty, pixel by pixel, up to the rounding of f32 sums of 64 terms.
#[test]
fn bounces_sum_to_the_picture() {
    let mut b = SceneBuilder::new();
    let material = b.emitter(Vec3::new(0.9, 0.5, 0.1), Vec3::ONE);
    b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, material);
    b.camera(Vec3::new(0.1, 0.2, 0.3), Vec3::new(1.0, 0.3, 0.1), Vec3::Y, 1.0);
    let render = render(&b.build(), RenderOptions { aovs: vec![Aov::Bounces], ..options(16, 16, 8) });
    let channels = channels(&render, &[Aov::Bounces]);
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
