//! The layer of motion on the film. Oracles: closed forms of what a camera and a surface do that move. Deterministic
//! but for rounding: a thousandth of a pixel.

use glam::{Affine3A, Quat, Vec2, Vec3};
use pathspace::film::Film;
use pathspace::plan::Aov;
use pathspace::render::Renderer;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::motion::Track;
use pathspace::scene::{Environment, Projection, Scene, Shutter};

use crate::common::{options, render};

/// Pixels to a side.
const SIDE: u32 = 16;

/// Distance of the wall from the camera, metres.
const DEPTH: f32 = 3.0;

/// A wall across the left half of the view of a camera at z = 2 whose field is 90° wide, and the sky. The wall and the
/// camera move over the shutter, the one in steps from where it is.
fn scene(wall: &[Affine3A], camera: Option<Affine3A>, projection: Projection) -> Scene {
    let mut b = SceneBuilder::new();
    let white = b.lambert(Vec3::ONE);
    let corners = [(-9.0, -9.0), (0.0, -9.0), (0.0, 9.0), (-9.0, 9.0)].map(|(x, y)| Vec3::new(x, y, 2.0 - DEPTH));
    let mesh = b.mesh(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]], white);
    match wall {
        [] => b.place(mesh, Affine3A::IDENTITY),
        steps => b.place_moving(mesh, steps.to_vec()),
    };
    b.any_camera(Vec3::new(0.0, 0.0, 2.0), Vec3::ZERO, Vec3::Y, projection)
        .environment(Environment::constant(Vec3::ONE));
    let mut scene = b.build();
    if let Some(moved) = camera {
        let from = scene.cameras[0].world_from_camera;
        scene.motion.cameras = vec![Track { index: 0, steps: vec![from, from * moved] }];
        scene.motion.shutter = Some(Shutter::new(0.0, 1.0).expect("a second"));
    }
    scene
}

const PERSPECTIVE: Projection = Projection::Perspective { yfov_rad: std::f32::consts::FRAC_PI_2, aspect: None };

/// Holds every pixel against a closed form of its place on the film, from the middle, in pixels to the right and up.
fn expect(what: &str, film: &Film, expected: impl Fn(Vec2) -> Vec2) {
    let layer = film.layer(Aov::MOTION).expect("asked for");
    for (p, found) in (0..).zip(&layer) {
        let half = SIDE as f32 / 2.0;
        let at = Vec2::new((p % SIDE) as f32 + 0.5 - half, half - (p / SIDE) as f32 - 0.5);
        let (found, expected) = (Vec2::new(found[0] as f32, found[1] as f32), expected(at));
        assert!(found.distance(expected) < 1e-3, "{what}, {at} from the middle: {found}, expected {expected}");
    }
}

fn motion(scene: &Scene) -> Film {
    render(scene, options(SIDE, SIDE, 1).aovs([Aov::MOTION])).film
}

/// A wall `depth` away is moved by 8 pixels/depth for a metre; the sky stands still where the camera does not turn.
#[test]
fn shifts_are_shifts_over_the_distance() {
    let shift = |x, y, z| Affine3A::from_translation(Vec3::new(x, y, z));
    let on_wall = |at: Vec2, expected: Vec2| if at.x < 0.0 { expected } else { Vec2::ZERO };
    let wall = scene(&[Affine3A::IDENTITY, shift(0.6, -0.3, 0.0)], None, PERSPECTIVE);
    expect("a wall that is shifted", &motion(&wall), |at| on_wall(at, Vec2::new(1.6, -0.8)));
    let near = scene(&[Affine3A::IDENTITY, shift(0.1, 0.1, 0.2), shift(0.0, 0.0, 1.5)], None, PERSPECTIVE);
    expect("a wall that comes twice as near", &motion(&near), |at| on_wall(at, at));
    let pan = scene(&[], Some(shift(0.3, 0.2, 0.0)), PERSPECTIVE);
    expect("a camera that is shifted", &motion(&pan), |at| on_wall(at, Vec2::new(-0.8, -1.6 / 3.0)));
    let both = scene(&[Affine3A::IDENTITY, shift(0.3, 0.2, 0.0)], Some(shift(0.3, 0.2, 0.0)), PERSPECTIVE);
    expect("both alike", &motion(&both), |_| Vec2::ZERO);
    let parallel = Projection::Orthographic { xmag_m: 2.0, ymag_m: 2.0 };
    let pan = scene(&[], Some(shift(0.5, 0.0, 0.0)), parallel);
    expect("parallel rays", &motion(&pan), |at| on_wall(at, Vec2::new(-2.0, 0.0)));
    // What is behind the camera in the end has no place on the film.
    let past = scene(&[Affine3A::IDENTITY, shift(0.0, 0.0, 4.0)], None, PERSPECTIVE);
    expect("a wall that passes the camera", &motion(&past), |_| Vec2::ZERO);
}

/// A camera that turns moves wall and sky alike, as directions.
#[test]
fn turns_move_the_sky_as_well() {
    let turn = Quat::from_euler(glam::EulerRot::YXZ, 0.2, -0.1, 0.3);
    let film = motion(&scene(&[], Some(Affine3A::from_quat(turn)), PERSPECTIVE));
    let half = SIDE as f32 / 2.0;
    expect("a camera that turns", &film, |at| {
        let dir = turn.inverse() * Vec3::new(at.x / half, at.y / half, -1.0);
        Vec2::new(dir.x, dir.y) / -dir.z * half - at
    });
}

/// Parts of the samples have the layer of the whole. What is at rest does not move at all, and costs no stage.
#[test]
fn parts_keep_the_motion_and_rest_is_zero() {
    let moving = scene(&[Affine3A::IDENTITY, Affine3A::from_translation(Vec3::X)], None, PERSPECTIVE);
    let part = |start, spp| render(&moving, options(SIDE, SIDE, spp).sample_start(start).aovs([Aov::MOTION])).film;
    let mut first = part(0, 2);
    first.merge(&part(2, 2)).expect("the same picture");
    assert!(first == part(0, 4));
    let still = scene(&[], None, PERSPECTIVE);
    assert!(motion(&still).layer(Aov::MOTION).expect("asked for").iter().all(|motion| *motion == [0.0; 3]));
    let plain = Renderer::new(&moving, options(SIDE, SIDE, 1)).expect("a valid scene");
    assert!(!plain.plan().stages.contains(&"first-hit"));
}
