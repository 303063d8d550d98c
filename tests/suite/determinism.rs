//! Same input, same bits: instruction sets, query modes, the way samples are cut into passes. Threads and tiles: hard case R04.

use std::ops::ControlFlow;

use glam::Vec3;
use pathspace::backend::{BackendKind, QueryMode};
use pathspace::plan::options::{Lens, RenderOptions};
use pathspace::render::{Renderer, StopReason};
use pathspace::scene::Scene;
use pathspace::scene::builder::SceneBuilder;

use crate::common::{options, render};

/// A room with a lamp, a metal ball and a glass one.
pub fn room() -> Scene {
    furnished(false)
}

/// The [`room`], with a ball of small lamps in it if asked for: lights have to be chosen then.
fn furnished(ball_of_lamps: bool) -> Scene {
    let mut b = SceneBuilder::new();
    let white = b.lambert(Vec3::splat(0.7));
    let light = b.emitter(Vec3::ZERO, Vec3::splat(4.0));
    let metal = b.metal(Vec3::new(0.9, 0.6, 0.4), 0.2);
    let glass = b.glass(1.5);
    b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, white);
    b.quad([[-0.3, 0.99, -0.3], [0.3, 0.99, -0.3], [0.3, 0.99, 0.3], [-0.3, 0.99, 0.3]].map(Vec3::from), light);
    b.sphere(Vec3::new(-0.4, -0.6, -0.3), 0.4, 12, false, true, metal);
    b.sphere(Vec3::new(0.4, -0.65, 0.1), 0.35, 12, false, true, glass);
    if ball_of_lamps {
        b.sphere(Vec3::new(0.5, 0.4, -0.6), 0.2, 8, false, true, light);
    }
    b.camera(Vec3::new(0.0, 0.0, 0.95), Vec3::ZERO, Vec3::Y, 1.4);
    b.build()
}

/// Our own code compiled for AVX-512 and for AVX2, over the same hits. (On a processor without AVX-512 they are the same.)
#[test]
fn both_instruction_sets_of_the_wavefront_give_the_same_bits() {
    let lens = Some(Lens { radius_m: 0.02, focus_m: 1.2 });
    for (scene, lens) in [(room(), None), (room(), lens), (furnished(true), None)] {
        let hash = |isa: Option<&str>| {
            let isa = isa.map(String::from);
            let backend = Some(BackendKind::Obvhs);
            render(&scene, RenderOptions { isa, backend, lens, ..options(67, 41, 9) }).film.hash()
        };
        assert_eq!(hash(None), hash(Some("avx2")));
    }
}

#[test]
fn every_query_mode_of_a_backend_shows_the_same_picture_within_rounding() {
    // Packets and single rays of one backend find the same hits up to rounding; a path that rounds to another triangle
    // may differ, so the means are compared: 0.5 % of the mean covers the noise of a few diverging paths of 40·40·8.
    let scene = room();
    for &kind in BackendKind::available() {
        let mean = |mode| {
            let options = RenderOptions { backend: Some(kind), rays: Some(mode), ..options(40, 40, 8) };
            let film = render(&scene, options).film;
            film.pixels.iter().map(|p| p.mean()[1]).sum::<f64>()
        };
        let single = mean(QueryMode::Single);
        for mode in QueryMode::ALL {
            let ratio = mean(mode) / single;
            assert!((ratio - 1.0).abs() < 5e-3, "{} {mode}: ratio {ratio}", kind.name());
        }
    }
}

#[test]
fn breaking_off_keeps_what_was_rendered() {
    let scene = room();
    let renderer = Renderer::new(&scene, options(64, 64, 100_000)).expect("valid options");
    let render = renderer
        .render_with(|p| if p.spp >= 4 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
        .expect("stopping is a result");
    assert_eq!(render.stop, StopReason::Callback);
    assert!(render.film.pixels.iter().all(|p| p.n[0] + p.n[1] >= 4), "every pixel kept its samples");
}

#[test]
fn samples_add_up_alike_however_they_are_cut_into_passes() {
    // The same 12 samples in one render that may cut them 1, 1, 2, 4, 4 and in one with a time limit nearby.
    let scene = room();
    let plain = render(&scene, options(33, 17, 12)).film.hash();
    let timed = RenderOptions { time: Some(std::time::Duration::from_secs(600)), ..options(33, 17, 12) };
    assert_eq!(plain, render(&scene, timed).film.hash());
}
