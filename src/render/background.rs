//! The environment out of focus, as previews show it behind a scene (`film/look.rs`). Nothing here enters a film.

use glam::Vec3;
use rayon::prelude::*;

use super::renderer::Renderer;
use crate::scene::Environment;
use crate::shading::light::environment::EnvironmentLight;

/// Most columns of the map that is blurred, and columns of what comes of it.
const COLUMNS: usize = 128;
const BLURRED_COLUMNS: usize = 64;

impl Renderer<'_> {
    /// What each pixel of the window shows of the environment, blurred to a standard deviation of `sigma_rad`, through
    /// its centre, W·sr⁻¹·m⁻²; black without an environment.
    pub fn blurred_background(&self, sigma_rad: f32) -> Vec<[f32; 3]> {
        let window = self.plan.window;
        let rows = window.y..window.y + window.height;
        let pixels = rows.flat_map(|y| (window.x..window.x + window.width).map(move |x| (x, y)));
        let environment = self.scene().environment.as_ref().map(|environment| blurred(environment, sigma_rad));
        // A map that was made of a valid one is valid; a black one is none.
        let Some(light) = environment.and_then(|map| EnvironmentLight::new(&map).ok().flatten()) else {
            return pixels.map(|_| [0.0; 3]).collect();
        };
        let seen =
            |(x, y): (u32, u32)| light.radiance(self.camera().pinhole_ray(x as f32 + 0.5, y as f32 + 0.5).1).to_array();
        pixels.map(seen).collect()
    }
}

/// `environment` under the kernel exp((cos θ − 1)/σ²), a Gaussian of σ on the sphere.
fn blurred(environment: &Environment, sigma_rad: f32) -> Environment {
    let small = reduced(environment);
    let sources: Vec<(Vec3, Vec3)> = (0..small.texels.len()).map(|i| (direction(&small, i), small.texels[i])).collect();
    let rows = BLURRED_COLUMNS / 2;
    let empty = Environment { width: BLURRED_COLUMNS, height: rows, texels: [].into(), ..small.clone() };
    let sharpness = 1.0 / (sigma_rad * sigma_rad);
    let texel = |i: usize| {
        let middle = direction(&empty, i);
        let (mut sum, mut weights) = (Vec3::ZERO, 0.0f32);
        for (row, sources) in sources.chunks_exact(small.width).enumerate() {
            let area = (std::f32::consts::PI * (row as f32 + 0.5) / small.height as f32).sin();
            for &(dir, radiance) in sources {
                let weight = area * ((middle.dot(dir) - 1.0) * sharpness).exp();
                (sum, weights) = (sum + radiance * weight, weights + weight);
            }
        }
        sum / weights.max(f32::MIN_POSITIVE)
    };
    let texels: Vec<Vec3> = (0..BLURRED_COLUMNS * rows).into_par_iter().map(texel).collect();
    Environment { texels: texels.into(), ..empty }
}

/// The map with at most [`COLUMNS`] columns; means over blocks of a row.
fn reduced(environment: &Environment) -> Environment {
    let (width, height) = (environment.width.min(COLUMNS), environment.height.min(COLUMNS / 2));
    let mut texels = vec![(Vec3::ZERO, 0.0f32); width * height];
    for (i, &texel) in environment.texels.iter().enumerate() {
        let (x, y) = (i % environment.width, i / environment.width);
        let (sum, n) = &mut texels[y * height / environment.height * width + x * width / environment.width];
        (*sum, *n) = (*sum + texel, *n + 1.0);
    }
    let texels: Vec<Vec3> = texels.into_iter().map(|(sum, n)| sum / n).collect();
    Environment { width, height, texels: texels.into(), ..environment.clone() }
}

/// Direction of a texel's middle in the map's own frame: u = 0.5 + atan2(x, −z)/2π, v = acos(y)/π.
fn direction(map: &Environment, i: usize) -> Vec3 {
    let (u, v) = ((i % map.width) as f32 + 0.5, (i / map.width) as f32 + 0.5);
    let phi = std::f32::consts::TAU * (u / map.width as f32 - 0.5);
    let (sin, cos) = (std::f32::consts::PI * v / map.height as f32).sin_cos();
    Vec3::new(sin * phi.sin(), cos, -sin * phi.cos())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: a constant map stays what it is; a point spreads by the kernel and keeps its place.
    #[test]
    fn a_blur_keeps_constants_and_spreads_points() {
        let map = |texels: Vec<Vec3>| Environment {
            width: 256,
            height: 128,
            texels: texels.into(),
            rotation_rad: 0.3,
            intensity: 2.0,
        };
        let constant = blurred(&map(vec![Vec3::splat(0.5); 256 * 128]), 0.2);
        assert!(constant.texels.iter().all(|t| t.abs_diff_eq(Vec3::splat(0.5), 1e-4)));
        assert_eq!((constant.rotation_rad, constant.intensity), (0.3, 2.0));
        let mut texels = vec![Vec3::ZERO; 256 * 128];
        texels[64 * 256 + 128] = Vec3::X;
        let point = blurred(&map(texels), 0.2);
        let at = |x: usize| point.texels[16 * 64 + x].x;
        // Two columns of 2π/64 are 0.196 from the middle of the point's, about a standard deviation.
        let ratio = at(34) / at(32);
        assert!((0.5..0.75).contains(&ratio) && at(32) > at(50), "{ratio}");
    }
}
