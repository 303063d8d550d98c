//! Same input, same bits: instruction sets, query modes, the way samples are cut into passes. Threads and tiles: hard
//! case R04.

use std::ops::ControlFlow;
use std::time::Duration;

use glam::Vec3;
use pathspace::backend::{BackendKind, QueryMode};
use pathspace::plan::Aov;
use pathspace::plan::options::{Lens, RenderOptions};
use pathspace::render::{Render, Renderer, StopReason};
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

/// Our own code compiled for AVX-512 and for AVX2, over the same hits. (On a processor without AVX-512 they are the
/// same.)
#[test]
fn both_instruction_sets_of_the_wavefront_give_the_same_bits() {
    let lens = Some(Lens { radius_m: 0.02, focus_m: 1.2 });
    for (scene, lens) in [(room(), None), (room(), lens), (furnished(true), None)] {
        let hash = |isa: Option<&str>| {
            let options = options(67, 41, 9).isa(isa).backend(BackendKind::Obvhs).lens(lens);
            render(&scene, options).film.hash()
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
            let options = options(40, 40, 8).backend(kind).rays(mode);
            let film = render(&scene, options).film;
            film.pixels.iter().map(|p| p.mean()[1]).sum::<f64>()
        };
        let single = mean(QueryMode::Single);
        for mode in QueryMode::ALL.into_iter().filter(|mode| kind.only_mode().is_none_or(|only| only == *mode)) {
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

/// Time ends a render inside a pass: whole tiles have had their samples, the others have not, and every pixel has the
/// bits of its first samples. Saved, restored and gone on with, it has those of a render without the stop. Oracles: the
/// samples one by one, and that render. Where time runs out depends on the machine: a million camera paths take longer
/// than the first of the limits everywhere, and a tile is begun before the last.
#[test]
fn time_ends_a_render_within_a_pass_and_it_goes_on_to_the_same_bits() {
    let scene = room();
    let aovs = [Aov::BOUNCES, Aov::ALBEDO, Aov::POSITION, Aov::SPP];
    let side = 1024;
    let base = || options(side, side, 2).aovs(aovs.to_vec()).max_depth(3).backend(BackendKind::Obvhs).threads(2);
    let within = |ms| {
        let timed = Renderer::new(&scene, base().time(Duration::from_millis(ms))).expect("valid options");
        timed.render().expect("renders")
    };
    let stopped = [5, 20, 80].into_iter().map(within).find(|render| render.film.spp().max > 0).expect("a tile");
    assert_eq!(stopped.stop, StopReason::Time);
    assert!(stopped.render_time < Duration::from_millis(1500), "{:?}", stopped.render_time);
    let spp = stopped.film.spp();
    assert_eq!((spp.min, spp.max), (0, 1), "{spp:?}");

    let renderer = Renderer::new(&scene, base()).expect("valid options");
    let whole = renderer.render().expect("renders");
    let first = Renderer::new(&scene, base().spp(1)).expect("valid options").render().expect("renders");
    let sampled = |p: &usize| stopped.film.pixels[*p].samples() == 1;
    let pixels: Vec<usize> = (0..stopped.film.pixels.len()).filter(sampled).collect();
    assert!(pixels.len().is_multiple_of(256) && !pixels.is_empty(), "{} pixels", pixels.len());
    assert!(pixels.iter().all(|&p| stopped.film.pixels[p] == first.film.pixels[p]));
    for (some, all) in stopped.film.planes().iter().zip(first.film.planes()) {
        assert!(pixels.iter().all(|&p| some.pixel(p) == all.pixel(p)), "{}", some.layer.aov);
    }
    let counts = stopped.film.layer(Aov::SPP).expect("made of the beauty");
    assert!(counts.iter().zip(&stopped.film.pixels).all(|(count, pixel)| count[0] == pixel.samples() as f64));
    assert_eq!(stopped.counters.paths, pixels.len() as u64);

    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("stopped");
    stopped.save(&path).expect("a writable folder");
    let resumed = renderer.resume(Render::restore(&path).expect("just saved")).expect("goes on");
    assert_eq!((resumed.film.digest(), &resumed.counters), (whole.film.digest(), &whole.counters));
    assert!(resumed.film == whole.film);
}

/// Layers of a render that begins at a later sample are those of these samples: with the part before they add up to the
/// whole. Oracle: the whole. (Sums of f32 samples in f64 lose no bit here, as in hard case R05.)
#[test]
fn parts_by_samples_add_up_in_every_layer() {
    let scene = room();
    let aovs: Vec<Aov> = Aov::all().collect();
    let part = |start, spp| render(&scene, options(33, 17, spp).sample_start(start).aovs(aovs.clone())).film;
    let (whole, mut first, second) = (part(0, 8), part(0, 4), part(4, 4));
    assert_eq!(second.first_sample, 4);
    assert_ne!(first.layer(Aov::NORMAL), second.layer(Aov::NORMAL));
    assert_eq!(first.layer(Aov::DEPTH), second.layer(Aov::DEPTH));
    first.merge(&second).expect("the same picture");
    assert!(first == whole);
    assert_eq!(first.digest(), whole.digest());
}

/// What cannot be gone on with is refused by name.
#[test]
fn renders_that_differ_are_not_gone_on_with() {
    let scene = room();
    let renderer = |options: RenderOptions| Renderer::new(&scene, options).expect("valid options");
    let earlier = || renderer(options(32, 16, 2)).render().expect("renders");
    let refusal = |options, earlier| renderer(options).resume(earlier).expect_err("it differs").to_string();
    assert!(refusal(options(32, 17, 4), earlier()).contains("size"));
    assert!(refusal(options(32, 16, 4).sample_start(2), earlier()).contains("another sample"));
    assert!(refusal(options(32, 16, 4).aovs(vec![Aov::ALBEDO]), earlier()).contains("other layers"));
    let mut uneven = earlier();
    uneven.film.pixels[3].add(0, [0.0; 3], 1.0, 1.0);
    assert!(refusal(options(32, 16, 4), uneven).contains("within a tile"));
}

#[test]
fn samples_add_up_alike_however_they_are_cut_into_passes() {
    // The same 12 samples in one render that may cut them 1, 1, 2, 4, 4 and in one with a time limit nearby.
    let scene = room();
    let plain = render(&scene, options(33, 17, 12)).film.hash();
    let timed = options(33, 17, 12).time(std::time::Duration::from_secs(600));
    assert_eq!(plain, render(&scene, timed).film.hash());
}

/// Embree's packets on quads side by side in one plane: however the samples are divided into passes, and whoever shares
/// a packet, the film has the same bits. Oracle: the render in one go, on one thread.
#[cfg(feature = "embree")]
#[test]
fn packets_on_adjacent_quads_do_not_depend_on_passes() {
    let mut b = SceneBuilder::new();
    let white = b.lambert(Vec3::splat(0.7));
    let lamp = b.emitter(Vec3::ZERO, Vec3::splat(3.0));
    for (x, z) in (0..12).flat_map(|x| (0..12).map(move |z| (x as f32 - 6.0, z as f32 - 6.0))) {
        b.quad([[x, 0.0, z], [x, 0.0, z + 1.0], [x + 1.0, 0.0, z + 1.0], [x + 1.0, 0.0, z]].map(Vec3::from), white);
    }
    b.quad([[-1.0, 4.0, -1.0], [1.0, 4.0, -1.0], [1.0, 4.0, 1.0], [-1.0, 4.0, 1.0]].map(Vec3::from), lamp);
    b.camera(Vec3::new(0.0, 3.0, 0.01), Vec3::ZERO, Vec3::Z, 1.2);
    let scene = b.build();
    for mode in [QueryMode::Packet4, QueryMode::Packet8, QueryMode::Packet16] {
        let of = |spp| {
            let options = options(48, 48, spp).backend(BackendKind::Embree).rays(mode).threads(1);
            Renderer::new(&scene, options).expect("valid options")
        };
        let whole = of(24).render().expect("renders").film.digest();
        for stops in [&[5, 11, 24][..], &[1, 2, 3, 13, 24], &[7, 23, 24], &[20, 24]] {
            let mut render = of(stops[0]).render().expect("renders");
            for &spp in &stops[1..] {
                render = of(spp).resume(render).expect("goes on");
            }
            assert_eq!(render.film.digest(), whole, "{mode}, stopped at {stops:?}");
        }
    }
}
