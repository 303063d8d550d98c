//! Emissive triangles and parallelograms: one-sided, sampled uniformly by area. Metres, W·sr⁻¹·m⁻², pdf_sa in
//! sr⁻¹. What emits from both sides is two lights, back to back: the choice of a light then knows which of them a
//! receiver can see.
//!
//! Square to triangle: the map of least distortion that costs no root (Heitz 2019, "A Low-Distortion Map Between
//! Triangle and Square"). Two triangles that are the halves of a parallelogram are one light, which the square maps to
//! as it is. Limit: the spread of one sample grows near a large emitter (relative 0.01 to 0.13 over the floor and most
//! of the walls of the Cornell box, 0.4 beside its lamp); MIS covers that. All light sampling at the first surface
//! together makes about 1/30 of the squared error of the Cornell box at 16 samples per pixel, so sampling by solid
//! angle has little to win: a density bilinear between the corners' cos/d⁴ took 4 % off the error there (its time was
//! not resolved).

use std::f64::consts::FRAC_PI_2;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::grow::Emitter;
use super::sample::{LightPoint, LightSample, TexturePoint, channel_mean, is_radiance};
use crate::math::float::UNIT_ROUNDOFF;
use crate::math::quad::Quad;
use crate::scene::geometry::{Geometry, Triangle};
use crate::scene::{AlphaMode, Material, Texture};

/// What a material emits.
#[derive(Clone, Copy, Debug)]
pub struct Emission {
    /// Radiance of the front side; to be multiplied by the texture where there is one.
    radiance: Vec3,
    /// Whether the radiance depends on the place: it has a texture, or the emitter is not there everywhere.
    textured: bool,
    /// Mean over channels and over the texture: what the intensity of a triangle is computed from.
    mean: f64,
    /// Whether the back emits as the front does.
    double_sided: bool,
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
            // The triangles of a material share the mean, so one on a dark part is drawn too often, never too seldom
            // for its estimate to be unbiased: the mean is 0 only where every texel is.
            Some(texture) => channel_mean(material.emissive * texture.mean()),
            None => channel_mean(material.emissive),
        };
        let textured = texture.is_some() || material.effective_alpha(textures) != AlphaMode::Opaque;
        Some(Emission { radiance: material.emissive, textured, mean, double_sided: material.double_sided })
    }

    /// Radiance of the front side, before a texture.
    #[inline(always)]
    pub fn radiance(&self) -> Vec3 {
        self.radiance
    }

    /// Whether a texture or a coverage has to be multiplied in.
    pub fn is_textured(&self) -> bool {
        self.textured
    }
}

/// An emissive triangle, or two of them that make up a parallelogram: a cache line of what drawing a point needs.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct AreaLight {
    v0: [f32; 3],
    e1: [f32; 3],
    e2: [f32; 3],
    n_g: [f32; 3],
    pub(super) area_m2: f32,
    /// Error bound of a point along `n_g`, m.
    error: f32,
    /// Index into [`Geometry::triangles`], or [`PARALLELOGRAM`].
    triangle: u32,
    /// Index into the materials, and into the emissions.
    pub(super) material: u32,
}

/// In the place of a triangle's number: no texture is looked up on it.
const PARALLELOGRAM: u32 = u32::MAX;

/// The triangles that one light is made of.
#[derive(Clone, Copy, Debug)]
pub struct Members {
    /// Index into [`Geometry::triangles`].
    pub first: u32,
    /// The same, of the other half of a parallelogram.
    pub second: Option<u32>,
    /// Whether it is their back: the light of that number less one is their front.
    pub back: bool,
}

/// The lights among the triangles of the world mesh, in its order, and what each is made of. Neighbours in that order
/// that are the halves of an untextured parallelogram (rectangles come as such pairs) are one light: nothing to choose
/// between them, and strata of the square stay strata.
pub fn find(geometry: &Geometry, emissions: &[Emission]) -> Vec<(AreaLight, Members)> {
    let Some(world) = geometry.meshes.first() else { return Vec::new() };
    let first = world.first_triangle as usize;
    let emission = |triangle: &Triangle| emissions.get(triangle.material as usize).filter(|e| e.mean > 0.0);
    let corners = |index: usize| world.indices[index - first].map(|vertex| world.vertices[vertex as usize]);
    let mut found = Vec::new();
    let mut index = first;
    while index < first + world.indices.len() {
        let triangle = &geometry.triangles[index];
        if let Some(emission) = emission(triangle) {
            let next = (index + 1 < first + world.indices.len()).then_some(index + 1);
            let pair =
                next.filter(|&next| geometry.triangles[next].material == triangle.material && !emission.textured);
            let joined = pair.and_then(|next| {
                AreaLight::join([triangle, &geometry.triangles[next]], [corners(index), corners(next)])
            });
            let (light, second) = match joined {
                Some(light) => (light, pair.map(|next| next as u32)),
                None => (AreaLight::new(index as u32, triangle), None),
            };
            let members = Members { first: index as u32, second, back: false };
            found.push((light, members));
            if emission.double_sided {
                found.push((light.back(), Members { back: true, ..members }));
            }
            index += usize::from(second.is_some());
        }
        index += 1;
    }
    found
}

impl AreaLight {
    fn new(index: u32, triangle: &Triangle) -> Self {
        let &Triangle { v0, e1, e2, n_g, material, .. } = triangle;
        AreaLight { v0, e1, e2, n_g, area_m2: triangle.area(), error: triangle.error, triangle: index, material }
    }

    /// The same area, emitting to the other side.
    fn back(self) -> Self {
        AreaLight { n_g: self.n_g.map(|c| -c), ..self }
    }

    /// The parallelogram of two triangles with a common edge and one normal; `None` if they are not its halves to
    /// within the rounding of their corners.
    fn join(triangles: [&Triangle; 2], corners: [[Vec3; 3]; 2]) -> Option<Self> {
        let quad = Quad::of(&corners[0], &corners[1])?;
        let [origin, right, _, left] = quad.corners;
        let (e1, e2) = (right.as_dvec3() - origin.as_dvec3(), left.as_dvec3() - origin.as_dvec3());
        let rounding = CORNER_ROUNDINGS * quad.reach() * UNIT_ROUNDOFF;
        let gap = quad.gap().length() as f32;
        let normal = e1.cross(e2);
        let n_g = normal.normalize_or_zero().as_vec3();
        // Mirrored placements turn both normals against the order of the corners.
        let facing = triangles.map(|triangle| n_g.dot(Vec3::from(triangle.n_g)));
        let flat = facing[0].abs() > FLAT_COS && facing[1].abs() > FLAT_COS && facing[0] * facing[1] > 0.0;
        (gap <= rounding && flat).then(|| AreaLight {
            v0: origin.into(),
            e1: e1.as_vec3().into(),
            e2: e2.as_vec3().into(),
            n_g: triangles[0].n_g,
            area_m2: normal.length() as f32,
            error: triangles[0].error.max(triangles[1].error) + rounding,
            triangle: PARALLELOGRAM,
            material: triangles[0].material,
        })
    }

    /// The light whose record stands in column `i`: one number a row, in the order of the fields.
    #[inline(always)]
    pub fn of_column<const N: usize>(rows: &[[f32; N]; 16], i: usize) -> Self {
        let vector = |first: usize| [rows[first][i], rows[first + 1][i], rows[first + 2][i]];
        AreaLight {
            v0: vector(0),
            e1: vector(3),
            e2: vector(6),
            n_g: vector(9),
            area_m2: rows[12][i],
            error: rows[13][i],
            triangle: rows[14][i].to_bits(),
            material: rows[15][i].to_bits(),
        }
    }

    /// Index into the materials.
    #[inline(always)]
    pub fn material(&self) -> u32 {
        self.material
    }

    /// Where the emission of a textured triangle has to be looked up, by the weights of its second and third corner.
    #[inline(always)]
    pub fn texture_point(&self, barycentric: [f32; 2]) -> TexturePoint {
        TexturePoint { triangle: self.triangle, barycentric }
    }

    /// What the choice of a light has to know. The intensity is 0 for a triangle without area.
    pub fn emitter(&self, light: u32, emissions: &[Emission]) -> Emitter {
        let (v0, e1, e2) = (Vec3::from(self.v0), Vec3::from(self.e1), Vec3::from(self.e2));
        let far = if self.triangle == PARALLELOGRAM { v0 + e1 + e2 } else { v0 };
        Emitter {
            light,
            corners: [v0, v0 + e1, v0 + e2, far],
            axis: Vec3::from(self.n_g),
            spread: 0.0,
            reach: FRAC_PI_2,
            intensity: f64::from(self.area_m2) * emissions[self.material as usize].mean,
        }
    }

    /// Unit normal of the side that emits.
    #[inline(always)]
    pub fn normal(&self) -> Vec3 {
        Vec3::from(self.n_g)
    }

    /// A point, uniform by area, for nobody: its direction is none and its density 0.
    pub fn uniform(&self, uv: [f32; 2]) -> AreaPoint {
        AreaPoint { pdf_sa: 0.0, ..self.point(Vec3::NAN, uv) }
    }

    /// A point for the receiver `p`, in plain numbers: the columns of a kernel call it lane by lane.
    #[inline(always)]
    pub fn point(&self, p: Vec3, uv: [f32; 2]) -> AreaPoint {
        let folded = square_to_triangle(uv);
        let barycentric = if self.triangle == PARALLELOGRAM { uv } else { folded };
        let (v0, e1, e2) = (Vec3::from(self.v0), Vec3::from(self.e1), Vec3::from(self.e2));
        let n_g = Vec3::from(self.n_g);
        let position = v0 + (barycentric[0] * e1 + barycentric[1] * e2);

        let to_light = position - p;
        let distance2 = to_light.length_squared();
        let wi = to_light / distance2.sqrt();
        let cos_light = -wi.dot(n_g);
        // Also false for a receiver on the point itself, where the direction is NaN.
        let in_front = cos_light > 0.0;
        let pdf_sa = if in_front { pdf_sa(distance2, cos_light, self.area_m2) } else { 0.0 };
        AreaPoint { wi, position, normal: n_g, error: self.error, pdf_sa, barycentric }
    }

    /// The same as a light sample; `None` if the receiver is behind the light or in its plane.
    #[inline]
    pub fn sample(&self, emission: &Emission, p: Vec3, uv: [f32; 2]) -> Option<LightSample> {
        let AreaPoint { wi, position, normal, error, pdf_sa, barycentric } = self.point(p, uv);
        (pdf_sa > 0.0).then(|| LightSample {
            light: 0,
            wi,
            target: Some(LightPoint { position, normal, error }),
            radiance: emission.radiance,
            texture_point: emission.textured.then_some(self.texture_point(barycentric)),
            pdf_sa,
            delta: false,
        })
    }
}

/// A point on an area light as a receiver sees it.
#[derive(Clone, Copy, Debug)]
pub struct AreaPoint {
    /// Unit direction to it; NaN where the receiver is on it.
    pub wi: Vec3,
    /// World position.
    pub position: Vec3,
    /// Unit normal of the side that emits.
    pub normal: Vec3,
    /// Error bound of `position` along the normal, m.
    pub error: f32,
    /// Density of the direction, sr⁻¹; 0 for a receiver behind the light or in its plane.
    pub pdf_sa: f32,
    /// Weights of the second and third corner; on a parallelogram the coordinates along both edges.
    pub barycentric: [f32; 2],
}

/// Corners of a placed rectangle are rounded in each coordinate.
const CORNER_ROUNDINGS: f32 = 4.0;
/// Cosine between normals that are one up to rounding.
const FLAT_COS: f32 = 0.999_999;

/// Radiance that an emissive triangle of radiance `radiance` sends towards a viewer under `cos_light` to `n_g`: its
/// back is black.
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
