//! What makes an area light, and what of it is left to others; its numbers are in `hard/area_lights.rs`. Seeds are
//! fixed and nothing here is statistical: no false alarms.

use glam::Vec3;
use pathspace::scene::{ColorSpace, Material, Scene, Texture, TextureId, TextureSlot, Wrap};
use pathspace::shading::light::Lights;

use crate::meter::{Random, geometry, material, square_light};

const ORIGIN: Vec3 = Vec3::ZERO;

/// Exact: which pairs of triangles are one light, and that its points are those of the two. Halves in any order of
/// their corners, placed and rounded; not halves of a kite, of a bent sheet, nor back to back, nor of two materials.
#[test]
fn parallelograms_are_found() {
    let mut random = Random(120);
    for i in 0..1000 {
        let origin = random.direction() * random.log_uniform(0.1, 1000.0) as f32;
        let (e1, e2) = (random.direction(), random.direction() * random.log_uniform(0.1, 10.0) as f32);
        let [a, b, c, d] = [origin, origin + e1, origin + e1 + e2, origin + e2];
        let turned = |[a, b, c]: [Vec3; 3], by: usize| [[a, b, c], [b, c, a], [c, a, b]][by % 3];
        let lights_of_two = |other: [Vec3; 3], material: u32| {
            let scene = Scene { materials: vec![self::material(1.0), self::material(1.0)], ..Scene::default() };
            let mut geometry = geometry(&[(turned([a, b, c], i), 0), (turned(other, i / 3), material)]);
            let lights = Lights::build(&scene, &geometry).expect("valid lights");
            lights.assign(&mut geometry);
            (lights, geometry)
        };
        let (whole, geometry) = lights_of_two([a, c, d], 0);
        assert_eq!(whole.counts().triangles, 1, "{a} {b} {c} {d}");
        let area: f32 = geometry.triangles.iter().map(|t| t.area()).sum();
        assert!((whole.area_m2(0) / area - 1.0).abs() < 1e-3 && geometry.triangles.iter().all(|t| t.light == 0));
        let n_g = Vec3::from(geometry.triangles[0].n_g);
        for _ in 0..8 {
            let p = a + n_g + random.direction() * 0.5;
            let u = [random.unit(), random.unit(), random.unit()];
            let point = whole.sample(p, Vec3::ZERO, u).and_then(|sample| sample.target).expect("in front");
            let expected = a + e1 * u[1] + e2 * u[2];
            // Corners of one piece, starting from either of two: the same parallelogram, other axes.
            let inside = [e1, e2].map(|e| (point.position - a).dot(e.cross(n_g)).abs());
            assert!(inside[0] <= e2.cross(e1).length() * 1.001 && inside[1] <= e1.cross(e2).length() * 1.001);
            assert!((point.position - expected).dot(n_g).abs() <= point.error, "{point:?}");
        }
        let bent = n_g * 0.01;
        for (other, material) in
            [([a, c, d + e1 * 0.01], 0), ([a, c, d + bent], 0), ([a, d, c], 0), ([a, c, d], 1), ([b, c, d + e1], 0)]
        {
            assert_eq!(lights_of_two(other, material).0.counts().triangles, 2, "{other:?}");
        }
    }
}

/// Emission by texture: black texels are drawn too, a wholly black texture is no light, and the point to look up is
/// the point that was drawn.
#[test]
fn textured_emission_leaves_the_lookup_to_the_caller() {
    let texture = |texels: &[[u8; 4]]| Texture {
        name: "glow".into(),
        width: texels.len(),
        height: 1,
        texels: texels.into(),
        color_space: ColorSpace::Srgb,
        wrap_u: Wrap::Repeat,
        wrap_v: Wrap::Repeat,
        bilinear: true,
    };
    let slot = Some(TextureSlot { texture: TextureId(0), uv_set: 0 });
    let scene = |texels: &[[u8; 4]]| Scene {
        materials: vec![Material { emissive_texture: slot, ..material(2.0) }],
        textures: vec![texture(texels)],
        ..Scene::default()
    };
    let square = geometry(&square_light());
    let dark = Lights::build(&scene(&[[0, 0, 0, 255]]), &square).expect("valid lights");
    assert!(dark.is_dark() && dark.counts().triangles == 0);

    let lights = Lights::build(&scene(&[[0, 0, 0, 255], [0, 0, 1, 255]]), &square).expect("valid lights");
    let sample = lights.sample(ORIGIN, Vec3::Z, [0.75, 0.3, 0.6]).expect("lit");
    let point = sample.texture_point.expect("textured");
    let triangle = &square.triangles[point.triangle as usize];
    let [u, v] = point.barycentric;
    let position = Vec3::from(triangle.v0) + (u * Vec3::from(triangle.e1) + v * Vec3::from(triangle.e2));
    assert_eq!((sample.radiance, point.triangle), (Vec3::splat(2.0), 1));
    assert_eq!(position, sample.target.expect("finite").position);
}
