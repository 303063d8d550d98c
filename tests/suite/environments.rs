//! Environments: the conventions of the shared scenes, and that light sampling and looking up agree. What they give is
//! in `hard/environment.rs`. Seeds are fixed.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use pathspace::scene::Environment;

use crate::meter::{Random, environment, environment_lights, map_direction};

const ORIGIN: Vec3 = Vec3::ZERO;

/// Exact up to rounding: a bright texel is found in the direction that the convention says, turned counter-clockwise
/// seen from above; both axes of the lookup are between texel centres and wrap around.
#[test]
fn environment_convention() {
    let (width, height) = (64, 32);
    let mut texels = vec![Vec3::ZERO; width * height];
    texels[10 * width] = Vec3::new(4.0, 8.0, 12.0);
    let texels: Arc<[Vec3]> = texels.into();
    for turn in [0.0, 0.25, -0.4, 7.125] {
        let rotation_rad = (2.0 * PI * turn) as f32;
        let map = Environment { width, height, texels: Arc::clone(&texels), rotation_rad, intensity: 0.5 };
        let lights = environment_lights(map);
        // Counter-clockwise from above: from −Z towards −X. The map's u runs the other way.
        let look = |column: f64, row: f64| {
            let d = map_direction(column / width as f64, row / height as f64);
            let (sin, cos) = (2.0 * PI * turn).sin_cos();
            let d = DVec3::new(d.x * cos + d.z * sin, d.y, -d.x * sin + d.z * cos);
            lights.environment_radiance(d.as_vec3()).x
        };
        let near = |found: f32, expected: f32| assert!((found - expected).abs() < 1e-4, "{found}, expected {expected}");
        near(look(0.5, 10.5), 2.0);
        near(look(0.0, 10.5), 1.0);
        near(look(63.75, 10.5), 0.5);
        near(look(1.0, 11.0), 0.5);
        near(look(2.0, 10.5), 0.0);
        near(look(0.5, 9.4), 0.0);
    }
}

/// What light sampling draws from the environment is what an escaping ray finds there: the same radiance, and the same
/// density except where rounding moves a direction across a texel's edge (it may in 2 of 10^4).
#[test]
fn environment_sample_agrees_with_lookup() {
    let mut map = environment(256, 128, |w| (1.0 + w.x) as f32 * if w.y > 0.99 { 1e4 } else { 1.0 });
    map.rotation_rad = 2.0;
    let lights = environment_lights(map);
    let mut random = Random(114);
    let (mut drawn, mut moved) = (0, 0);
    for _ in 0..1 << 18 {
        let sample = lights.sample(ORIGIN, Vec3::Y, [random.unit(), random.unit(), random.unit()]).expect("lit");
        let (found, pdf) = (lights.environment_radiance(sample.wi), lights.pdf_environment(sample.wi, ORIGIN, Vec3::Y));
        assert!((found - sample.radiance).abs().max_element() <= 2e-3 * found.x + 0.2, "{sample:?}, found {found}");
        assert!(pdf > 0.0);
        drawn += 1;
        moved += u32::from(pdf != sample.pdf_sa);
    }
    assert!(moved * 5000 < drawn, "{moved} of {drawn}");
}
