//! Emissive triangles: one-sided, sampled uniformly by area. Metres, W·sr⁻¹·m⁻², pdf_sa in sr⁻¹.
//!
//! Square to triangle: the map of least distortion that costs no root (Heitz 2019, "A Low-Distortion Map Between
//! Triangle and Square"). Limit: the spread of one sample grows near a large emitter (relative 0.01 to 0.13
//! over the floor and most of the walls of the Cornell box, 0.4 beside its lamp); MIS covers that, so spherical triangles
//! are not sampled by solid angle.

use std::f64::consts::FRAC_PI_2;

use glam::Vec3;

use super::grow::Emitter;
use super::{LightPoint, LightSample, TexturePoint, channel_mean, is_radiance};
use crate::scene::geometry::{Geometry, Triangle};
use crate::scene::material::Material;
use crate::scene::{ColorSpace, Texture};

/// What a material emits.
#[derive(Clone, Copy, Debug)]
pub struct Emission {
    /// Radiance of the front side; to be multiplied by the texture where there is one.
    radiance: Vec3,
    textured: bool,
    /// Mean over channels and over the texture: what the intensity of a triangle is computed from.
    mean: f64,
}

impl Emission {
    /// The emission of a material; black if it emits nothing. `None` where a channel is negative or not finite.
    pub fn new(material: &Material, textures: &[Texture]) -> Option<Emission> {
        if !is_radiance(material.emissive) {
            return None;
        }
        let texture = material.emissive_texture.and_then(|slot| textures.get(slot.texture.index()));
        let mean = match texture {
            _ if !material.is_emissive() => 0.0,
            Some(texture) => channel_mean(material.emissive * texture_mean(texture)),
            None => channel_mean(material.emissive),
        };
        Some(Emission { radiance: material.emissive, textured: texture.is_some(), mean })
    }
}

/// Mean of the linear texels. The triangles of a material share it, so a triangle on a dark part is drawn too often,
/// never too seldom for its estimate to be unbiased: the mean is 0 only where every texel is.
fn texture_mean(texture: &Texture) -> Vec3 {
    let linear: Vec<f64> = (0..256)
        .map(|byte| {
            // IEC 61966-2-1.
            let x = f64::from(byte) / 255.0;
            match texture.color_space {
                ColorSpace::Linear => x,
                ColorSpace::Srgb if x <= 0.04045 => x / 12.92,
                ColorSpace::Srgb => ((x + 0.055) / 1.055).powf(2.4),
            }
        })
        .collect();
    let mut counts = [[0u64; 256]; 3];
    for texel in texture.texels.iter() {
        for (channel, histogram) in counts.iter_mut().enumerate() {
            histogram[usize::from(texel[channel])] += 1;
        }
    }
    let texels = texture.texels.len().max(1) as f64;
    let means = counts.map(|histogram| {
        let sum: f64 = histogram.iter().zip(&linear).map(|(&count, &value)| count as f64 * value).sum();
        // One texel of the darkest step in 2^31 of them is still above 0 in f32.
        (sum / texels) as f32
    });
    Vec3::from_array(means)
}

/// An emissive triangle: a cache line of what drawing a point needs.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub struct TriangleLight {
    v0: [f32; 3],
    e1: [f32; 3],
    e2: [f32; 3],
    n_g: [f32; 3],
    pub(super) area_m2: f32,
    /// `Triangle::error`.
    error: f32,
    /// Index into [`Geometry::triangles`].
    pub(super) triangle: u32,
    /// Index into the materials, and into the emissions.
    pub(super) material: u32,
}

/// The emissive triangles of the world mesh, in its order.
pub fn find(geometry: &Geometry, emissions: &[Emission]) -> Vec<TriangleLight> {
    let Some(world) = geometry.meshes.first() else { return Vec::new() };
    let first = world.first_triangle as usize;
    (geometry.triangles.iter().enumerate().skip(first).take(world.indices.len()))
        .filter(|(_, triangle)| emissions.get(triangle.material as usize).is_some_and(|e| e.mean > 0.0))
        .map(|(index, triangle)| TriangleLight::new(index as u32, triangle))
        .collect()
}

impl TriangleLight {
    fn new(index: u32, triangle: &Triangle) -> Self {
        let &Triangle { v0, e1, e2, n_g, material, .. } = triangle;
        TriangleLight { v0, e1, e2, n_g, area_m2: triangle.area(), error: triangle.error, triangle: index, material }
    }

    /// What the choice of a light has to know. The intensity is 0 for a triangle without area.
    pub fn emitter(&self, light: u32, emissions: &[Emission]) -> Emitter {
        let (v0, e1, e2) = (Vec3::from(self.v0), Vec3::from(self.e1), Vec3::from(self.e2));
        Emitter {
            light,
            corners: [v0, v0 + e1, v0 + e2],
            axis: Vec3::from(self.n_g),
            spread: 0.0,
            reach: FRAC_PI_2,
            intensity: f64::from(self.area_m2) * emissions[self.material as usize].mean,
        }
    }

    /// A point for the receiver `p`; `None` if that is behind the triangle or in its plane.
    #[inline]
    pub fn sample(&self, emission: &Emission, p: Vec3, uv: [f32; 2]) -> Option<LightSample> {
        let barycentric = square_to_triangle(uv);
        let (v0, e1, e2) = (Vec3::from(self.v0), Vec3::from(self.e1), Vec3::from(self.e2));
        let n_g = Vec3::from(self.n_g);
        let position = v0 + (barycentric[0] * e1 + barycentric[1] * e2);

        let to_light = position - p;
        let distance2 = to_light.length_squared();
        let wi = to_light / distance2.sqrt();
        let cos_light = -wi.dot(n_g);
        // Also false for a receiver on the point itself, where the direction is NaN.
        let in_front = cos_light > 0.0;
        in_front.then(|| LightSample {
            wi,
            target: Some(LightPoint { position, normal: n_g, error: self.error }),
            radiance: emission.radiance,
            texture_point: emission.textured.then_some(TexturePoint { triangle: self.triangle, barycentric }),
            pdf_sa: pdf_sa(distance2, cos_light, self.area_m2),
            delta: false,
        })
    }
}

/// Radiance that an emissive triangle of radiance `radiance` sends towards a viewer under `cos_light` to `n_g`: its back
/// is black.
#[inline(always)]
pub fn emitted(radiance: Vec3, cos_light: f32) -> Vec3 {
    if cos_light > 0.0 { radiance } else { Vec3::ZERO }
}

/// Density per steradian of a point that is uniform over an area: pdf_area · d² / cos θ.
#[inline(always)]
pub fn pdf_sa(distance2: f32, cos_light: f32, area_m2: f32) -> f32 {
    distance2 / (cos_light * area_m2)
}

/// Weights of the second and third corner for a point of the unit square; uniform for uniform points. The square is cut
/// along its diagonal, and each half is sheared onto the half of the triangle on its side of the median.
#[inline(always)]
pub fn square_to_triangle([u, v]: [f32; 2]) -> [f32; 2] {
    if v > u {
        let half = 0.5 * u;
        [half, v - half]
    } else {
        let half = 0.5 * v;
        [u - half, half]
    }
}
