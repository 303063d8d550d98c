//! Shading normals that contradict the geometry, and normal maps that hold no normal (HARDCASES B16, B17).

use glam::{DVec3, Vec2, Vec3, Vec4};
use pathspace::math::frame::Frame;
use pathspace::plan::options::{FilterKind, Roulette, Strategy};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{
    ColorSpace, Environment, MaterialId, Mesh, Projection, PunctualKind, Texture, TextureId, TextureSlot, Wrap,
};
use pathspace::shading::interaction::tilt;

use super::Case;
use super::modes::Mode;
use crate::common::{options, render};

/// A square of side 2 m facing +Z, of two triangles: the first mesh of its scene.
fn sheet(b: &mut SceneBuilder, material: MaterialId) {
    b.quad([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 0.0)), material);
}

/// The view of a sheet from `eye`, which it fills.
fn look(b: &mut SceneBuilder, eye: Vec3) {
    let view = Projection::Orthographic { xmag_m: 0.15, ymag_m: 0.15 };
    b.any_camera(eye, Vec3::ZERO, Vec3::Y, view);
}

/// Unit normal tilted from +Z by `degrees` towards `azimuth`.
fn tilted(degrees: f32, azimuth: f32) -> Vec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    Vec3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos)
}

/// (a) Black in front, whatever the normals; (b) nothing gained in a furnace; (c) nothing where the facet faces away.
#[test]
fn b16_shading_normals_below_the_horizon() {
    let mut case = Case::open("B16", "Shading normals below the horizon", "interpolated normals, leaks, energy");
    let eyes = [Vec3::new(0.0, 0.0, 3.0), Vec3::new(2.0, 0.0, 1.0), Vec3::new(-2.5, 0.5, 0.5)];
    let azimuths = [0.0, 1.6, 3.2, 4.7];
    for mode in Mode::all() {
        for tilt_degrees in [60.0, 85.0, 89.9] {
            let (mut lit, mut most, mut mean, mut pixels) = (0, 0.0f64, 0.0, 0.0);
            for (eye, azimuth) in eyes.into_iter().flat_map(|eye| azimuths.map(|azimuth| (eye, azimuth))) {
                for metal in [false, true] {
                    let scene = |furnace: bool| {
                        let mut b = SceneBuilder::new();
                        let material = if metal { b.metal(Vec3::ONE, 0.3) } else { b.lambert(Vec3::ONE) };
                        sheet(&mut b, material);
                        if furnace {
                            b.environment(Environment::constant(Vec3::ONE));
                        } else {
                            // A lamp, a point light and a sun, all behind.
                            let lamp = b.emitter(Vec3::ZERO, Vec3::splat(10.0));
                            let behind = [(-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0)];
                            b.quad(behind.map(|(x, y)| Vec3::new(x, y, -1.0)), lamp);
                            b.point_light(Vec3::new(0.5, 0.2, -0.3), Vec3::splat(10.0));
                            b.punctual(Vec3::ZERO, Vec3::new(0.3, 0.0, 1.0), Vec3::ONE, PunctualKind::Directional);
                        }
                        look(&mut b, eye);
                        let mut scene = b.build();
                        scene.meshes[0].normals = Some(vec![tilted(tilt_degrees, azimuth); 4]);
                        scene
                    };
                    let dark = render(&scene(false), mode.options(options(8, 8, 16))).film;
                    lit += dark.pixels.iter().filter(|p| p.mean()[..3] != [0.0; 3]).count();
                    let (strategy, roulette) = (Strategy::BSDF, Roulette::Off);
                    let options = options(8, 8, 16).strategy(strategy).roulette(roulette);
                    let white = render(&scene(true), mode.options(options)).film;
                    for p in &white.pixels {
                        let value = p.mean()[1];
                        most = if value <= most { most } else { value };
                        mean += value;
                        pixels += 1.0;
                    }
                }
            }
            case.count(format!("{}, {tilt_degrees}°, lit from behind", mode.name), 0, lit as u64);
            let got = format!("{most:.7}; mean over azimuths {:.4}", mean / pixels);
            let on = format!("{}, {tilt_degrees}°, furnace, ρ = 1", mode.name);
            case.row(on, "≤ 1 + 1e-5", got, format!("{:.1e}", most - 1.0), most <= 1.0 + 1e-5);
        }

        // (c) The sphere of G01 with n = 6. There is no treatment of the terminator: facets turned away from the sun
        // are black.
        let sun = Vec3::new(1.0, 0.4, 0.3).normalize();
        let mut b = SceneBuilder::new();
        let white = b.lambert(Vec3::ONE);
        b.sphere(Vec3::ZERO, 1.0, 6, false, true, white);
        b.punctual(Vec3::ZERO, -sun, Vec3::ONE, PunctualKind::Directional);
        let view = Projection::Orthographic { xmag_m: 1.0, ymag_m: 1.0 };
        b.any_camera(Vec3::new(0.0, 0.0, 3.0), Vec3::ZERO, Vec3::Y, view);
        let scene = b.build();
        let options = options(64, 64, 1).filter(FilterKind::Point).max_depth(2);
        let film = render(&scene, mode.options(options)).film;
        let (mut away, mut wrong) = (0, 0);
        for (i, pixel) in film.pixels.iter().enumerate() {
            let place = |k: usize| 2.0 * (k as f64 + 0.5) / 64.0 - 1.0;
            let Some(n_g) = facet(&scene.meshes[0], place(i % 64), -place(i / 64)) else { continue };
            if n_g.dot(sun.as_dvec3()) <= -1e-6 {
                away += 1;
                wrong += u64::from(pixel.mean()[..3] != [0.0; 3]);
            }
        }
        case.count(format!("{}, n = 6, lit of {away} pixels that face away", mode.name), 0, wrong);
    }
    case.close();
}

/// Normal of the front triangle that the ray along −Z through (x, y) meets, well inside its edges.
fn facet(mesh: &Mesh, x: f64, y: f64) -> Option<DVec3> {
    mesh.triangles.iter().find_map(|triangle| {
        let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].as_dvec3());
        let n = (b - a).cross(c - a);
        let side = |p: DVec3, q: DVec3| (q.x - p.x) * (y - p.y) - (q.y - p.y) * (x - p.x);
        let inside = side(a, b) > 1e-6 && side(b, c) > 1e-6 && side(c, a) > 1e-6;
        (n.z > 0.0 && inside).then(|| n.normalize())
    })
}

/// One texel of a normal map.
fn normal_map(texel: [u8; 3]) -> Texture {
    let [r, g, b] = texel;
    Texture {
        name: "normals".into(),
        width: 1,
        height: 1,
        texels: vec![[r, g, b, 255]].into(),
        color_space: ColorSpace::Linear,
        wrap_u: Wrap::Repeat,
        wrap_v: Wrap::Repeat,
        bilinear: false,
    }
}

/// Images have 8 bits, so that a zero vector and NaN cannot come out of a file: they are put to the function itself.
#[test]
fn b17_degenerate_normal_maps() {
    let mut case = Case::open("B17", "Degenerate normal maps and frames", "zero, inverted and NaN normals");
    let n = Vec3::new(0.6, 0.0, 0.8);
    let tangent = Vec4::new(0.8, 0.0, -0.6, 1.0);
    let fallbacks =
        [Vec3::ZERO, Vec3::NAN, Vec3::new(0.0, f32::NAN, 1.0), Vec3::splat(f32::INFINITY), Vec3::splat(1e-30)];
    let kept = fallbacks.into_iter().filter(|&map| tilt(n, tangent, map) == n).count();
    case.count("zero, NaN, infinite, tiny: geometric frame", fallbacks.len() as u64, kept as u64);
    let inverted = tilt(n, tangent, -Vec3::Z);
    case.number("inverted: −n", 0.0, f64::from((inverted + n).length()), 1e-6);
    let frame = Frame::from_normal(tilt(n, tangent, Vec3::splat(-1.0)));
    case.number("(−1,−1,−1): a unit normal", 1.0, f64::from(frame.n.length()), 1e-6);

    let texels = [[0, 0, 0], [128, 128, 128], [127, 128, 128], [128, 128, 0], [255, 0, 128]];
    type Uv = fn(usize) -> Vec2;
    let uvs: [(&str, Uv); 3] = [
        ("uv", |i| [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y][i]),
        ("uv mirrored", |i| [Vec2::X, Vec2::ZERO, Vec2::Y, Vec2::ONE][i]),
        ("uv all equal", |_| Vec2::splat(0.5)),
    ];
    for mode in Mode::all() {
        let (mut most, mut lost, mut changed) = (0.0f64, 0, 0);
        for (texel, (name, uv)) in texels.into_iter().flat_map(|texel| uvs.map(|uv| (texel, uv))) {
            let scene = |map: Option<[u8; 3]>| {
                let mut b = SceneBuilder::new();
                let material = b.lambert(Vec3::ONE);
                sheet(&mut b, material);
                b.environment(Environment::constant(Vec3::ONE));
                look(&mut b, Vec3::new(1.0, 0.5, 3.0));
                let mut scene = b.build();
                scene.meshes[0].uvs = Some((0..4).map(uv).collect());
                // What the loader makes of uv without area is no tangent at all; of mirrored uv a negative sign.
                let tangent = match name {
                    "uv" => Vec4::new(1.0, 0.0, 0.0, 1.0),
                    "uv mirrored" => Vec4::new(-1.0, 0.0, 0.0, -1.0),
                    _ => Vec4::ZERO,
                };
                scene.meshes[0].tangents = Some(vec![tangent; 4]);
                if let Some(map) = map {
                    scene.textures.push(normal_map(map));
                    scene.materials[0].normal_texture = Some(TextureSlot { texture: TextureId(0), uv_set: 0 });
                }
                scene
            };
            let done = |map| {
                let (strategy, roulette) = (Strategy::BSDF, Roulette::Off);
                render(&scene(map), mode.options(options(8, 8, 16).strategy(strategy).roulette(roulette)))
            };
            let (plain, mapped) = (done(None), done(Some(texel)));
            lost += mapped.counters.nonfinite + mapped.counters.invalid_rays;
            for (p, q) in mapped.film.pixels.iter().zip(&plain.film.pixels) {
                let value = p.mean()[1];
                most = if value <= most { most } else { value };
                // Without a tangent there is no frame for the map: the picture is that of the plain sheet.
                changed += u64::from(name == "uv all equal" && p != q);
            }
        }
        case.count(format!("{}, samples not finite", mode.name), 0, lost);
        case.count(format!("{}, uv all equal: pixels unlike the geometric frame's", mode.name), 0, changed);
        let on = format!("{}, furnace, brightest pixel", mode.name);
        case.row(on, "≤ 1", format!("{most:.7}"), format!("{:.1e}", most - 1.0), most <= 1.0 + 0.5_f64.powi(20));
    }
    case.close();
}
