//! What a file or a caller may get wrong (HARDCASES I01–I06). Each fault is refused by name or left out and counted,
//! and what is left makes the picture that it makes alone, to the bit.

use std::path::Path;

use glam::{Affine3A, Mat3A, Vec3, Vec3A};
use pathspace::backend::Coherence;
use pathspace::camera::CameraRays;
use pathspace::film::Film;
use pathspace::film::exr::read_exr;
use pathspace::plan::options::{Lens, RenderOptions, SamplerKind, Strategy};
use pathspace::render::Renderer;
use pathspace::sampler::{Scheme, SobolScheme};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Camera, Environment, Material, Projection, Scene};
use pathspace::{Error, Result};
use serde_json::{Value, json};

use super::Case;
use super::room::lamp_room;
use crate::common::{Estimate, options, probe, render};
use crate::conformance::shapes::{Rng, mesh, soup, world};
use crate::conformance::{Row, TestRay, any, bits, closest, each_backend, variants};
use crate::loading::fixture::{Fixture, write};

fn on(row: &Row, options: RenderOptions) -> RenderOptions {
    options.backend(row.kind).rays(row.mode)
}

/// Pixels of which a bit differs.
fn differing(a: &Film, b: &Film) -> usize {
    a.pixels.iter().zip(&b.pixels).filter(|(a, b)| a != b).count()
}

fn load(fixture: &Fixture) -> Result<Scene> {
    let directory = tempfile::tempdir().expect("a temporary directory");
    Scene::load(fixture.write(directory.path()))
}

/// A row for something that must be refused as a broken scene, at `pointer`.
fn refused(case: &mut Case, what: &str, pointer: &str, result: Result<Scene>) {
    let (got, ok) = match result {
        Err(Error::InvalidScene { pointer: found, .. }) => (format!("refused at {found}"), found == pointer),
        Err(other) => (format!("another error: {other}"), false),
        Ok(_) => ("loaded".into(), false),
    };
    case.row(what, format!("refused at {pointer}"), got, "-", ok);
}

/// A row for something that is mended or left out with one warning that says `words`.
fn warned(case: &mut Case, what: &str, words: &str, result: Result<Scene>) -> Option<Scene> {
    let warnings = match &result {
        Ok(scene) => scene.warnings.iter().filter(|w| w.what.contains(words)).count(),
        Err(_) => 0,
    };
    let got = result.as_ref().map_or_else(|e| e.to_string(), |_| format!("{warnings} of them"));
    case.row(what, format!("1 warning: {words}"), got, "-", warnings == 1);
    result.ok()
}

/// A thousand triangles under a sky; `bad` replaces corner 1 of the middle one.
fn thousand(bad: Option<Vec3>, without: bool) -> Scene {
    let mut b = SceneBuilder::new();
    let grey = b.lambert(Vec3::splat(0.5));
    let mut triangles = soup(&mut Rng::new(41), 1000, 0.2);
    if let Some(bad) = bad {
        triangles[500][1] = bad;
    }
    if without {
        triangles.remove(500);
    }
    let indices = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    b.triangles(triangles.into_iter().flatten().collect(), indices, grey);
    b.environment(Environment::constant(Vec3::ONE));
    b.camera(Vec3::new(0.1, 0.2, 3.0), Vec3::ZERO, Vec3::Y, 0.8);
    b.build()
}

/// Oracles: files are refused at the bent place; of a scene made in code the triangle is left out and counted, and the
/// picture is that without it; a backend that is handed such a triangle hits the others as ever.
#[test]
fn i01_vertices_that_are_no_numbers() {
    let mut case = Case::open("I01", "NaN, Inf and out-of-range vertices", "input validation");
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut bent = Fixture::quad();
        bent.binary[12..16].copy_from_slice(&value.to_le_bytes());
        refused(&mut case, &format!("vertex {value}"), "/accessors/0", load(&bent));
    }
    for value in [2e18, f32::MAX] {
        let mut bent = Fixture::quad();
        bent.binary[12..16].copy_from_slice(&value.to_le_bytes());
        refused(&mut case, &format!("vertex {value:e}"), "/nodes/0", load(&bent));
    }
    let mut past = Fixture::quad();
    past.binary[48..50].copy_from_slice(&4u16.to_le_bytes());
    refused(&mut case, "index out of range", "/accessors/1", load(&past));
    let short = Fixture::quad().set("/accessors/0/count", json!(5));
    refused(&mut case, "buffer shorter than declared", "/accessors/0", load(&short));
    let far = Fixture::quad().set("/nodes/0/scale", json!([1e300, 1, 1]));
    refused(&mut case, "transform beyond f32", "/nodes/0", load(&far));
    let mut uv = Fixture::quad();
    uv.binary[60..64].copy_from_slice(&f32::NAN.to_le_bytes());
    warned(&mut case, "uv NaN", "1 texture coordinates are not finite", load(&uv));
    let mut normal = Fixture::quad();
    let normals = normal.floats(&[0.0, 0.0, 1.0, f32::NAN, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0], "VEC3");
    let normal = normal.set("/meshes/0/primitives/0/attributes/NORMAL", json!(normals));
    let mended = warned(&mut case, "normal NaN", "1 normals have no direction", load(&normal));
    let finite = mended.is_some_and(|s| s.meshes[0].normals.iter().flatten().all(|n| n.is_normalized()));
    case.count("normals not unit after that", 0, u64::from(!finite));

    let clean = thousand(None, true);
    let (bare, rays) = (soup(&mut Rng::new(41), 1000, 0.2), {
        let mut rng = Rng::new(42);
        (0..4000).map(|_| TestRay::new(rng.direction() * 4.0, rng.direction())).collect::<Vec<_>>()
    });
    for bad in [Vec3::NAN, Vec3::INFINITY, Vec3::new(2e18, 0.0, 0.0), Vec3::MAX] {
        let scene = thousand(Some(bad), false);
        let dropped = pathspace::scene::geometry::Geometry::build(&scene).dropped_degenerate;
        case.count(format!("{:e} in code, dropped", bad.x), 1, dropped as u64);
        for row in variants() {
            let of = |scene: &Scene| render(scene, on(&row, options(32, 32, 2))).film;
            case.bits(format!("{}, {:e} in code", row.name(), bad.x), differing(&of(&scene), &of(&clean)));
        }
        // Straight to the backends, the other triangles keeping their numbers.
        let mut triangles = bare.clone();
        triangles[500] = [Vec3::ZERO; 3];
        let mut expected = Vec::new();
        each_backend(&world(mesh(&triangles)), |_, b| expected.push(closest(b, &rays, Coherence::Incoherent)));
        triangles[500] = [bare[500][0], bad, bare[500][2]];
        let mut geometry = world(mesh(&triangles));
        // Bounds of what is finite, as `Geometry::build` makes them.
        geometry.bounds = world(mesh(&bare)).bounds;
        let mut expected = expected.into_iter();
        let mut rows = Vec::new();
        each_backend(&geometry, |row, backend| {
            let expected = expected.next().expect("the same rows");
            let got = closest(backend, &rays, Coherence::Incoherent);
            let blocked = any(backend, &rays, Coherence::Incoherent);
            // A triangle of finite corners, however far, may be hit itself.
            let wrong = got.iter().zip(&expected).zip(&blocked).filter(|((g, e), blocked)| {
                let own = g.is_some_and(|hit| hit.prim == 500) && bad.is_finite();
                !own && (bits(g) != bits(e) || **blocked != e.is_some())
            });
            rows.push((row.name(), wrong.count()));
        });
        for (name, wrong) in rows {
            case.bits(format!("{name}, {:e} to the backend", bad.x), wrong);
        }
    }
    case.close();
}

/// Oracle: the sky's radiance or 0, exactly; the command's exit code and a file that reads back.
#[test]
fn i02_empty_and_trivial_scenes() {
    let mut case = Case::open("I02", "empty and trivial scenes", "no geometry, nothing in view, no light");
    let sky = Vec3::new(0.25, 0.5, 2.0);
    let scene = |fill: &dyn Fn(&mut SceneBuilder), environment: bool| {
        let mut b = SceneBuilder::new();
        fill(&mut b);
        if environment {
            b.environment(Environment::constant(sky));
        }
        b.camera(Vec3::new(0.0, 0.0, 1.0), Vec3::ZERO, Vec3::Y, 0.8);
        b.build()
    };
    let behind = |b: &mut SceneBuilder| {
        let grey = b.emitter(Vec3::splat(0.5), Vec3::ONE);
        b.cuboid(Vec3::new(-1.0, -1.0, 3.0), Vec3::new(1.0, 1.0, 4.0), false, grey);
    };
    let black_box = |b: &mut SceneBuilder| {
        let black = b.lambert(Vec3::ZERO);
        b.cuboid(Vec3::splat(-2.0), Vec3::splat(2.0), true, black);
    };
    let degenerate = |b: &mut SceneBuilder| {
        let grey = b.lambert(Vec3::splat(0.5));
        b.triangles(vec![Vec3::ZERO, Vec3::X, Vec3::X * 2.0], vec![[0, 1, 2]], grey);
    };
    let cases: [(&str, Scene, Vec3); 7] = [
        ("no triangles", scene(&|_| {}, false), Vec3::ZERO),
        ("no triangles, sky", scene(&|_| {}, true), sky),
        ("one without area, sky", scene(&degenerate, true), sky),
        ("all behind the camera", scene(&behind, false), Vec3::ZERO),
        ("all behind the camera, sky", scene(&behind, true), sky),
        ("closed black box", scene(&black_box, false), Vec3::ZERO),
        ("closed black box, sky", scene(&black_box, true), Vec3::ZERO),
    ];
    for row in variants() {
        for (name, scene, expected) in &cases {
            let mut wrong = 0;
            for (width, height, spp) in [(1, 1, 1), (33, 17, 1), (8, 8, 4)] {
                let render = render(scene, on(&row, options(width, height, spp)));
                let off = |p: &&pathspace::film::Pixel| p.mean()[..3] != expected.as_dvec3().to_array();
                wrong += render.film.pixels.iter().filter(off).count();
                wrong += (render.counters.nonfinite + render.counters.invalid_rays) as usize;
            }
            case.bits(format!("{}, {name}", row.name()), wrong);
        }
    }
    let error = Renderer::new(&cases[0].1, options(8, 8, 0)).err();
    case.row(
        "0 samples",
        "refused, exit code 2",
        error.as_ref().map_or("rendered".into(), ToString::to_string),
        "-",
        error.is_some_and(|e| e.exit_code() == 2),
    );

    // By the command: the quad behind the camera, one pixel, one sample.
    let directory = tempfile::tempdir().expect("a temporary directory");
    let away = Fixture::quad().set("/nodes/1/rotation", json!([0, 1, 0, 0])).write(directory.path());
    let picture = directory.path().join("one.exr");
    let output = assert_cmd::Command::cargo_bin("pathspace")
        .expect("the package has this binary")
        .args(["render", "--width", "1", "--height", "1", "--spp", "1", "--quiet", "-o"])
        .args([picture.as_path(), Path::new(&away)])
        .output()
        .expect("the binary starts");
    let image = read_exr(&picture).ok();
    let black = image.is_some();
    case.row(
        "command, 1 × 1 pixel, 1 spp",
        "exit code 0, a file",
        format!("exit code {:?}, {}", output.status.code(), if black { "a file" } else { "no file" }),
        "-",
        output.status.code() == Some(0) && black,
    );
    case.close();
}

fn camera(projection: Projection) -> Camera {
    Camera { name: "test".into(), world_from_camera: Affine3A::IDENTITY, projection }
}

fn perspective(yfov_rad: f32) -> Camera {
    camera(Projection::Perspective { yfov_rad, aspect: None })
}

/// Oracle: the contract. Extreme but valid cameras give unit rays that a furnace answers with 1; the others an error of
/// the right kind.
#[test]
fn i03_degenerate_cameras() {
    let mut case = Case::open("I03", "degenerate cameras", "look-at along up, extreme fields of view, odd focus");
    let mut furnace = SceneBuilder::new();
    let glow = furnace.emitter(Vec3::ZERO, Vec3::ONE);
    furnace.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, glow);
    let furnace = furnace.build();
    let blur = Some(Lens { radius_m: 0.01, focus_m: f32::INFINITY });
    for (name, yfov) in [("0.001°", 1e-3f32.to_radians()), ("0.001 rad", 1e-3), ("179°", 179f32.to_radians())] {
        for (size, lens) in [((1, 10_000), None), ((1, 10_000), blur), ((10_000, 1), blur), ((1, 1), None)] {
            let rays = CameraRays::new(&perspective(yfov), size, lens).expect("a valid camera");
            let bad = (0..1000).filter(|&i| {
                let u = SobolScheme::sample_4d(i, [3, 4], 0);
                let (origin, dir) = rays.ray(u[0] * size.0 as f32, u[1] * size.1 as f32, [u[2], u[3]]);
                !(origin.is_finite() && dir.is_normalized())
            });
            case.count(format!("{name}, {} × {}, lens {}", size.0, size.1, lens.is_some()), 0, bad.count() as u64);
        }
        for row in variants() {
            let mut scene = furnace.clone();
            scene.cameras.push(perspective(yfov));
            let render = render(&scene, on(&row, options(1, 1000, 1)).lens(blur));
            let dark = render.film.pixels.iter().filter(|p| p.mean()[..3] != [1.0; 3]).count() as u64;
            case.count(format!("{}, {name}: dark or invalid", row.name()), 0, dark + render.counters.invalid_rays);
        }
    }

    let mut refusal = |what: String, code: u8, camera: &Camera, size, lens| {
        let got = CameraRays::new(camera, size, lens).map_or_else(|e| e.exit_code(), |_| 0);
        case.row(what, format!("exit code {code}"), format!("exit code {got}"), "-", got == code);
    };
    let size = (64, 64);
    for yfov in [0.0, -1.0, std::f32::consts::PI, 4.0, f32::NAN, f32::INFINITY] {
        refusal(format!("yfov {yfov}"), 4, &perspective(yfov), size, None);
    }
    for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let stretched = camera(Projection::Perspective { yfov_rad: 1.0, aspect: Some(bad) });
        refusal(format!("aspect {bad}"), 4, &stretched, size, None);
        for (xmag_m, ymag_m) in [(bad, 1.0), (1.0, bad)] {
            let parallel = camera(Projection::Orthographic { xmag_m, ymag_m });
            refusal(format!("xmag {xmag_m}, ymag {ymag_m}"), 4, &parallel, size, None);
        }
        let lens = Some(Lens { radius_m: bad, focus_m: 1.0 });
        refusal(format!("aperture {bad}"), 2, &perspective(1.0), size, lens);
        if bad != f32::INFINITY {
            let lens = Some(Lens { radius_m: 0.1, focus_m: bad });
            refusal(format!("focus {bad}"), 2, &perspective(1.0), size, lens);
        }
    }
    let lens = Some(Lens { radius_m: 0.1, focus_m: 1.0 });
    refusal("lens, parallel".into(), 2, &camera(Projection::Orthographic { xmag_m: 1.0, ymag_m: 1.0 }), size, lens);
    refusal("no columns".into(), 2, &perspective(1.0), (0, 64), None);
    refusal("no rows".into(), 2, &perspective(1.0), (64, 0), None);
    let skewed = Mat3A::from_diagonal(Vec3::new(1.0, 2.0, 1.0));
    for (name, matrix3) in
        [("zero", Mat3A::ZERO), ("NaN", Mat3A::NAN), ("stretched", skewed), ("mirrored", -Mat3A::IDENTITY)]
    {
        let mut camera = perspective(1.0);
        camera.world_from_camera = Affine3A { matrix3, translation: Vec3A::ZERO };
        refusal(format!("{name} placement"), 4, &camera, size, None);
    }
    let mut far = perspective(1.0);
    far.world_from_camera.translation = Vec3A::new(0.0, f32::INFINITY, 0.0);
    refusal("placed at infinity".into(), 4, &far, size, None);
    for (name, target) in
        [("looks along up", Vec3::Y), ("looks against up", Vec3::NEG_Y), ("looks at itself", Vec3::ZERO)]
    {
        let mut b = SceneBuilder::new();
        b.camera(Vec3::ZERO, target, Vec3::Y, 1.0);
        let scene = Scene { cameras: b.build().cameras, ..furnace.clone() };
        refusal(name.into(), 4, &scene.cameras[0], size, None);
    }
    case.close();
}

/// Oracles: P07 by another solver; 1 by construction; n² of the basic law of radiance.
#[test]
fn i04_cameras_in_unusual_places() {
    let mut case = Case::open("I04", "camera in unusual places", "on a surface, inside an emitter, inside glass");
    /// Reflected radiance of P07's ceiling at (0.1, 0.1).
    const CEILING: f64 = 0.016_967_786_229_074_404;
    let v = Vec3::new;
    let room = lamp_room();
    let mut upwards = room.clone();
    let mut b = SceneBuilder::new();
    b.camera(v(0.5, 0.375, 0.0), v(0.5, 0.375, 1.0), Vec3::Y, 2.0);
    upwards.cameras = b.build().cameras;
    let mut lifted = upwards.clone();
    lifted.cameras[0].world_from_camera.translation.z = 2f32.powi(-20);

    let sphere = |inside: &dyn Fn(&mut SceneBuilder)| {
        let mut b = SceneBuilder::new();
        inside(&mut b);
        b.build()
    };
    let emitter = sphere(&|b| {
        let glow = b.emitter(Vec3::ZERO, Vec3::ONE);
        b.sphere(Vec3::ZERO, 1.0, 24, true, false, glow);
    });
    let glass = sphere(&|b| {
        let glass = b.glass(1.5);
        b.sphere(Vec3::ZERO, 1.0, 24, false, true, glass);
        b.environment(Environment::constant(Vec3::ONE));
    });
    let mut tinted = glass.clone();
    tinted.materials[0].attenuation_color = Vec3::splat(0.5);
    tinted.materials[0].attenuation_distance_m = 1.0;

    for row in variants() {
        // On the floor: no black pixel, and the mean of what is seen from 2⁻²⁰ above it.
        let view = |scene: &Scene| render(scene, on(&row, options(48, 48, 64))).film;
        let (film, above) = (view(&upwards), view(&lifted));
        let black = film.pixels.iter().filter(|p| p.mean()[0] <= 0.0).count() as u64;
        case.count(format!("{}, on the floor, black", row.name()), 0, black);
        let of = |film: &Film| Estimate::of(film.pixels.iter().map(|p| p.mean()).map(|m| [m[0], m[1], m[2]]));
        let (here, there) = (of(&film), of(&above));
        case.number(format!("{}, on the floor, mean", row.name()), there.mean[0], here.mean[0], 2e-2);
        let paths = 1 << 16;
        let at = |scene: &Scene, from: Vec3, dir: Vec3| {
            probe(scene, from, dir, paths, on(&row, RenderOptions::default().seed(4)))
        };
        let from_floor = at(&room, v(0.1, 0.1, 0.0), Vec3::Z);
        case.mean(format!("{}, from the floor", row.name()), [CEILING; 3], 2e-6 * CEILING, 2.5e-2, &from_floor);
        // From a corner of the room itself: the probe's film would reach out of it.
        let mut corner = room.clone();
        let mut b = SceneBuilder::new();
        b.camera(Vec3::ZERO, v(0.1, 0.1, 1.0), Vec3::Y, 1e-3);
        corner.cameras = b.build().cameras;
        let options = on(&row, options(256, 256, 1)).sampler(SamplerKind::Independent);
        let from_corner = of(&render(&corner, options).film);
        case.mean(format!("{}, from a vertex", row.name()), [CEILING; 3], 2e-6 * CEILING, 2.5e-2, &from_corner);

        let inside = at(&emitter, v(0.1, 0.2, 0.3), v(0.3, -0.5, 0.8));
        case.bits(format!("{}, inside an emitter", row.name()), usize::from(inside.mean != [1.0; 3]));
        let in_glass = at(&glass, Vec3::ZERO, v(0.3, -0.5, 0.8));
        case.mean(format!("{}, inside glass", row.name()), [2.25; 3], 1e-4 * 2.25, 1e-2, &in_glass);
    }
    case.close();
}

/// Out of range is clamped with one message each, or refused; what a caller makes in code ends as an error or a finite
/// picture.
#[test]
fn i05_material_parameters_out_of_range() {
    let mut case = Case::open("I05", "material parameters out of range", "albedo, roughness, index, emission");
    let pbr = "/materials/0/pbrMetallicRoughness";
    let with = |pointer: &str, value: Value| load(&Fixture::quad().set(pointer, value));
    let color = format!("{pbr}/baseColorFactor");
    warned(&mut case, "albedo 1.2", "baseColorFactor 1.2", with(&color, json!([1.2, 0.5, 0.5, 1.0])));
    warned(&mut case, "albedo -0.1", "baseColorFactor -0.1", with(&color, json!([0.5, -0.1, 0.5, 1.0])));
    let rough = format!("{pbr}/roughnessFactor");
    warned(&mut case, "roughness 2", "roughnessFactor 2", with(&rough, json!(2.0)));
    let ior = |value: Value| with("/materials/0/extensions/KHR_materials_ior", json!({"ior": value}));
    warned(&mut case, "ior -1", "ior -1", ior(json!(-1.0)));
    warned(&mut case, "ior 0.5", "ior 0.5", ior(json!(0.5)));
    // glTF: 0 stands for infinity, everything is reflected.
    let unbounded = ior(json!(0.0)).expect("a valid scene");
    let warnings = unbounded.warnings.iter().filter(|warning| warning.what.contains("ior")).count();
    case.count("ior 0, warnings", 0, warnings as u64);
    let ior_pointer = "/materials/0/extensions/KHR_materials_ior/ior";
    refused(&mut case, "ior 1e39", ior_pointer, ior(json!(1e39)));
    refused(&mut case, "roughness 1e39", &rough, with(&rough, json!(1e39)));

    for (name, emissive) in [("NaN", f32::NAN), ("-1", -1.0), ("infinite", f32::INFINITY)] {
        let mut b = SceneBuilder::new();
        let lamp = b.emitter(Vec3::ZERO, Vec3::splat(emissive));
        b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, lamp);
        b.camera(Vec3::ZERO, Vec3::Z, Vec3::Y, 1.0);
        let scene = b.build();
        let got = Renderer::new(&scene, options(4, 4, 1)).map_or_else(|e| e.exit_code(), |_| 0);
        case.row(format!("emission {name} in code"), "exit code 4", format!("exit code {got}"), "-", got == 4);
    }
    for row in variants() {
        // Emission at the end of f32: finite or counted, and the process lives.
        let mut b = SceneBuilder::new();
        let lamp = b.emitter(Vec3::splat(0.5), Vec3::splat(1e38));
        b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, lamp);
        b.camera(Vec3::ZERO, Vec3::Z, Vec3::Y, 1.0);
        let scene = b.build();
        let bright = Renderer::new(&scene, on(&row, options(16, 16, 4))).and_then(|r| r.render());
        let (got, ok) = match &bright {
            Ok(render) => {
                let finite = render.film.pixels.iter().all(|p| p.mean().iter().all(|x| x.is_finite()));
                (format!("finite: {finite}, {} samples counted", render.counters.nonfinite), finite)
            }
            Err(error) => (error.to_string(), error.exit_code() == 4),
        };
        case.row(format!("{}, emission 1e38", row.name()), "finite or refused", got, "-", ok);

        // A mirror by definition: alpha 0 and below the delta limit are one picture.
        let mirror = |roughness: f32| {
            let mut b = SceneBuilder::new();
            let metal = b.material(Material {
                base_color: Vec3::new(0.9, 0.6, 0.4),
                metallic: 1.0,
                roughness,
                ..Material::default()
            });
            let lamp = b.emitter(Vec3::splat(0.3), Vec3::ONE);
            b.sphere(Vec3::ZERO, 0.75, 12, false, true, metal);
            b.quad([[-1.0, 1.0, -1.0], [1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]].map(Vec3::from), lamp);
            b.environment(Environment::constant(Vec3::new(0.2, 0.3, 0.4)));
            b.camera(Vec3::new(0.0, 0.25, 3.0), Vec3::ZERO, Vec3::Y, 0.7);
            render(&b.build(), on(&row, options(32, 32, 4))).film
        };
        // Roughness is √alpha: 10⁻³ for alpha 10⁻⁶.
        case.bits(format!("{}, alpha 0 and 1e-6", row.name()), differing(&mirror(0.0), &mirror(1e-3)));
    }
    case.close();
}

/// A quad that shows a texture of `width` × `height` by emission, with texture coordinates from `uv` to `uv + span`.
fn textured(width: u32, height: u32, uv: f32, span: [f32; 2]) -> (Scene, [f64; 3]) {
    let mut rng = Rng::new(u64::from(width * height));
    let image =
        image::RgbImage::from_fn(width, height, |_, _| image::Rgb(std::array::from_fn(|_| rng.below(256) as u8)));
    let linear = |byte: u8| {
        let x = f64::from(byte) / 255.0;
        if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
    };
    let mean = std::array::from_fn(|c| image.pixels().map(|p| linear(p.0[c])).sum::<f64>() / f64::from(width * height));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).expect("a PNG in memory");
    let directory = tempfile::tempdir().expect("a temporary directory");
    write(directory.path(), "texture.png", &bytes.into_inner());
    let mut fixture = Fixture::quad();
    let [u, w] = [uv + span[0], uv + span[1]];
    let uvs = fixture.floats(&[uv, w, u, w, u, uv, uv, uv], "VEC2");
    let fixture = fixture
        .set("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(uvs))
        .set("/images", json!([{"uri": "texture.png"}]))
        .set("/textures", json!([{"source": 0}]))
        .set(
            "/materials/0",
            json!({
                "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0},
                "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0},
                "extensions": {"KHR_materials_specular": {"specularFactor": 0}}
            }),
        )
        .set(
            "/cameras/0",
            json!({"type": "orthographic", "orthographic": {"xmag": 0.5, "ymag": 0.5, "znear": 0.1, "zfar": 10}}),
        );
    (Scene::load(fixture.write(directory.path())).expect("a valid fixture"), mean)
}

/// Oracle: the mean of the texels in linear light. Coordinates of 10⁶ have four bits of fraction: textures of 8 × 8
/// are met evenly by them, others in a smaller range.
#[test]
fn i06_texture_coordinates() {
    let mut case = Case::open("I06", "texture coordinates", "huge, negative, NaN; 1 × 1 and odd sizes");
    for (name, size, uv, span) in [
        ("8 × 8 over ±1e6", (8, 8), -1e6, [2e6, 2e6]),
        ("8 × 8 at -1e6", (8, 8), -1e6, [1024.0, 512.0]),
        ("8 × 8 over -3..5", (8, 8), -3.0, [8.0, 8.0]),
        ("1 × 1 over ±1e6", (1, 1), -1e6, [2e6, 2e6]),
        ("4097 × 3 over -2..2", (4097, 3), -2.0, [4.0, 4.0]),
        ("3 × 4097 over -7..9", (3, 4097), -7.0, [16.0, 16.0]),
    ] {
        let (scene, mean) = textured(size.0, size.1, uv, span);
        for row in variants() {
            let options = on(&row, options(128, 128, 16)).sampler(SamplerKind::Independent).strategy(Strategy::BSDF);
            let film = render(&scene, options).film;
            let estimate = Estimate::of(film.pixels.iter().map(|p| p.mean()).map(|m| [m[0], m[1], m[2]]));
            case.mean(format!("{}, {name}", row.name()), mean, 1e-4, 3e-2, &estimate);
        }
    }
    // Coordinates of 1 are those of 0 under `repeat`, up to the rounding of interpolation: 2⁻²⁴ of five texels.
    let film = |uv: f32| render(&textured(5, 3, uv, [0.0, 0.0]).0, options(8, 8, 1)).film;
    let (one, zero) = (film(1.0), film(0.0));
    let pairs = one.pixels.iter().zip(&zero.pixels).flat_map(|(a, b)| (0..3).map(|c| (b.mean()[c], a.mean()[c], 1e-5)));
    case.numbers("uv 1 and uv 0", pairs.collect::<Vec<_>>());
    case.close();
}
