//! The built-in environment, `--env studio`: four soft boxes in a grey room, made by formula. A white diffuse surface
//! that faces the key light has a radiance of about 1. It is a map as any other: sampled by importance, turned, dimmed.
//!
//! Azimuths are to the right of +Z, the front of a glTF asset; elevations above the horizon.

use glam::Vec3;

use super::Environment;

/// Columns of the map; half as many rows.
const COLUMNS: usize = 1024;

/// A rectangle of light at unit distance that faces the middle.
struct SoftBox {
    azimuth_deg: f32,
    elevation_deg: f32,
    /// Half of its width and height.
    half: [f32; 2],
    radiance: Vec3,
}

/// Width of the edge over which a box fades, at unit distance.
const EDGE: f32 = 0.12;

const BOXES: [SoftBox; 4] = [
    // Key, from the left; a little warm.
    SoftBox { azimuth_deg: -38.0, elevation_deg: 42.0, half: [0.55, 0.55], radiance: Vec3::new(1.95, 1.85, 1.7) },
    // Fill, from the right; a little cold.
    SoftBox { azimuth_deg: 82.0, elevation_deg: 18.0, half: [0.35, 0.8], radiance: Vec3::new(0.62, 0.66, 0.72) },
    // Rim, from behind.
    SoftBox { azimuth_deg: 158.0, elevation_deg: 32.0, half: [0.28, 0.9], radiance: Vec3::new(2.4, 2.4, 2.4) },
    // Top.
    SoftBox { azimuth_deg: 0.0, elevation_deg: 88.0, half: [0.7, 0.5], radiance: Vec3::new(0.95, 0.95, 0.95) },
];

/// Radiance of the room at the nadir, the horizon and the zenith.
const ROOM: [f32; 3] = [0.20, 0.36, 0.24];

impl Environment {
    /// The built-in studio.
    pub fn studio() -> Environment {
        let (width, height) = (COLUMNS, COLUMNS / 2);
        let frames = BOXES.map(|light| (frame(&light), light));
        let texel = |i: usize| {
            let (u, v) = (((i % width) as f32 + 0.5) / width as f32, ((i / width) as f32 + 0.5) / height as f32);
            let (sin_phi, cos_phi) = (std::f32::consts::TAU * (u - 0.5)).sin_cos();
            let (sin, cos) = (std::f32::consts::PI * v).sin_cos();
            radiance(&frames, Vec3::new(sin * sin_phi, cos, -sin * cos_phi))
        };
        let texels: Vec<Vec3> = (0..width * height).map(texel).collect();
        Environment { width, height, texels: texels.into(), rotation_rad: 0.0, intensity: 1.0 }
    }
}

/// Right, up and outward of a box.
fn frame(light: &SoftBox) -> [Vec3; 3] {
    let (sin_az, cos_az) = light.azimuth_deg.to_radians().sin_cos();
    let (sin_el, cos_el) = light.elevation_deg.to_radians().sin_cos();
    let outward = Vec3::new(sin_az * cos_el, sin_el, cos_az * cos_el);
    let right = Vec3::new(cos_az, 0.0, -sin_az);
    [right, outward.cross(right), outward]
}

fn radiance(boxes: &[([Vec3; 3], SoftBox)], dir: Vec3) -> Vec3 {
    let smooth = |x: f32| x.clamp(0.0, 1.0).powi(2) * (3.0 - 2.0 * x.clamp(0.0, 1.0));
    let [nadir, horizon, zenith] = ROOM;
    let (pole, share) = if dir.y < 0.0 { (nadir, -dir.y) } else { (zenith, dir.y) };
    let room = Vec3::splat(horizon + (pole - horizon) * smooth(share));
    boxes.iter().fold(room, |sum, ([right, up, outward], light)| {
        let facing = dir.dot(*outward);
        if facing <= 0.0 {
            return sum;
        }
        let inside = |axis: Vec3, half: f32| smooth((half - (dir.dot(axis) / facing).abs()) / EDGE + 0.5);
        sum + light.radiance * (inside(*right, light.half[0]) * inside(*up, light.half[1]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: what the page says, by the sum over the texels; white towards the key is 1 within a quarter.
    #[test]
    fn white_that_faces_the_key_light_is_about_white() {
        let studio = Environment::studio();
        let normal = frame(&BOXES[0])[2];
        let mut irradiance = Vec3::ZERO;
        for (i, &texel) in studio.texels.iter().enumerate() {
            let (u, v) = ((i % studio.width) as f32 + 0.5, (i / studio.width) as f32 + 0.5);
            let (sin_phi, cos_phi) = (std::f32::consts::TAU * (u / studio.width as f32 - 0.5)).sin_cos();
            let (sin, cos) = (std::f32::consts::PI * v / studio.height as f32).sin_cos();
            let area = sin * std::f32::consts::TAU * std::f32::consts::PI / (studio.width * studio.height) as f32;
            irradiance += texel * normal.dot(Vec3::new(sin * sin_phi, cos, -sin * cos_phi)).max(0.0) * area;
        }
        let white = irradiance / std::f32::consts::PI;
        assert!((white - Vec3::ONE).abs().max_element() < 0.25, "{white}");
    }
}
