//! Where a ray meets a surface: the point with its error bound, the normals, the texture coordinates.
//!
//! The point is rebuilt from barycentrics (HARDCASES G09), never from o + t·d. Normals point to the authored front
//! side; the shading code decides on which side the viewer is.

use glam::{Vec2, Vec3, Vec4};

use crate::backend::batch::{Hit, INVALID_ID};
use crate::math::float;
use crate::scene::geometry::{Between, Geometry, NO_ATTRIBUTES, Placement, Triangle};

/// A surface point as numbers.
#[derive(Clone, Copy, Debug)]
pub struct Interaction {
    /// World position.
    pub p: Vec3,
    /// Bound of the distance between `p` and the true hit, metres.
    pub error: f32,
    /// Unit geometric normal of the front side.
    pub n_g: Vec3,
    /// Unit interpolated normal of the front side; equals `n_g` on flat surfaces.
    pub n_s: Vec3,
    /// Index into `Scene::materials`.
    pub material: u32,
    /// Light that the triangle is, or `u32::MAX`.
    pub light: u32,
    /// Corner attributes of the triangle, or [`NO_ATTRIBUTES`].
    attributes: u32,
    /// Barycentric weights of the second and third corner.
    barycentric: [f32; 2],
}

impl Interaction {
    /// Looks the hit up. `smooth` is false when no mesh of the scene has normals.
    #[inline(always)]
    pub fn at(geometry: &Geometry, hit: &Hit, smooth: bool) -> Self {
        let triangle = geometry.triangle(hit.geom, hit.prim);
        let (v0, e1, e2) = (Vec3::from(triangle.v0), Vec3::from(triangle.e1), Vec3::from(triangle.e2));
        let mut n_g = Vec3::from(triangle.n_g);
        let mut p = float::hit_point(v0, e1, e2, hit.u, hit.v);
        let mut error = triangle.error;
        let moved = geometry.moving.at(hit.inst, hit.time);
        let placement = moved.as_ref().or_else(|| geometry.instances.get(hit.inst as usize));
        if let Some(placement) = placement {
            // Meshes that change their shape are all placed by instances.
            if !geometry.deforming.is_empty()
                && let Some(shape) = geometry.deformed(hit.geom, hit.prim, hit.time)
            {
                return Interaction::between_shapes(geometry, hit, smooth, placement, &shape);
            }
            let Placement { world_from_object, object_from_world, .. } = placement;
            error = match geometry.moving.reach(hit.inst, hit.time) {
                None => float::hit_error_instanced((v0, e1, e2), p, world_from_object, object_from_world),
                Some(reach) => float::hit_error_moving((v0, e1, e2), p, &reach, object_from_world),
            };
            p = placement.world_from_object.transform_point3(p);
            n_g = (placement.world_from_normal * n_g).normalize();
        }
        let mut n_s = n_g;
        if smooth && triangle.attributes != NO_ATTRIBUTES {
            // A flat triangle with texture coordinates repeats its own normal; rounding it anew would move bits.
            let corners = geometry.normals[triangle.attributes as usize];
            if corners != [Vec3::from(triangle.n_g); 3] {
                let [a, b, c] = corners;
                let n = interpolate(a, b, c, hit.u, hit.v);
                n_s = unit_or(placement.map_or(n, |placement| placement.world_from_normal * n), n_g);
            }
        }
        Interaction {
            p,
            error,
            n_g,
            n_s,
            material: geometry.material(hit.inst, triangle),
            light: triangle.light,
            attributes: triangle.attributes,
            barycentric: [hit.u, hit.v],
        }
    }

    /// On a mesh that changes its shape; all of those move.
    #[cold]
    #[inline(never)]
    fn between_shapes(geometry: &Geometry, hit: &Hit, smooth: bool, placement: &Placement, shape: &Between) -> Self {
        let Between { triangle, ends, fraction } = shape;
        let point = |t: &Triangle| float::hit_point(t.v0.into(), t.e1.into(), t.e2.into(), hit.u, hit.v);
        let p = point(triangle);
        let reach = geometry.moving.reach(hit.inst, hit.time).unwrap_or(placement.world_from_object);
        let corners = (triangle.v0.into(), triangle.e1.into(), triangle.e2.into());
        let corner = |t: &Triangle| {
            let (v0, e1, e2) = (Vec3::from(t.v0), Vec3::from(t.e1), Vec3::from(t.e2));
            v0.abs().max((v0 + e1).abs()).max((v0 + e2).abs())
        };
        let most = corner(&ends[0]).max(corner(&ends[1]));
        let error = float::hit_error_deforming(corners, p, most, &reach, &placement.object_from_world);
        let n_g = (placement.world_from_normal * Vec3::from(triangle.n_g)).normalize();
        let mut n_s = n_g;
        if smooth && triangle.attributes != NO_ATTRIBUTES {
            let [from, to] = ends.map(|end| geometry.normals[end.attributes as usize]);
            // Where a mesh has no normals, its corners repeat those of the triangles.
            let flat = [(from, &ends[0]), (to, &ends[1])].iter().all(|(of, end)| *of == [Vec3::from(end.n_g); 3]);
            if !flat {
                let [a, b, c] = [0, 1, 2].map(|i| unit_or(from[i].lerp(to[i], *fraction), from[i]));
                n_s = unit_or(placement.world_from_normal * interpolate(a, b, c, hit.u, hit.v), n_g);
            }
        }
        Interaction {
            p: placement.world_from_object.transform_point3(p),
            error,
            n_g,
            n_s,
            material: geometry.material(hit.inst, triangle),
            light: triangle.light,
            attributes: triangle.attributes,
            barycentric: [hit.u, hit.v],
        }
    }

    /// Texture coordinates of channel 0; `None` where the triangle has none.
    #[inline(always)]
    pub fn uv(&self, geometry: &Geometry) -> Option<Vec2> {
        geometry.uv(self.attributes, 0, self.barycentric)
    }

    /// Vertex colour, linear RGB and alpha; white where the triangle has none.
    #[inline(always)]
    pub fn color(&self, geometry: &Geometry) -> Vec4 {
        geometry.color(self.attributes, self.barycentric)
    }

    /// Where corner attributes of the triangle are found, and the weights of its second and third corner.
    #[inline(always)]
    pub fn corner(&self) -> (u32, [f32; 2]) {
        (self.attributes, self.barycentric)
    }
}

/// World tangent at a hit, across the shading normal `n_s` of the front side, and the bitangent's sign; `None` where
/// the triangle has none or it is degenerate.
#[inline(always)]
pub fn tangent(geometry: &Geometry, hit: &Hit, n_s: Vec3) -> Option<Vec4> {
    let attributes = geometry.triangle(hit.geom, hit.prim).attributes;
    let [a, b, c] = geometry.tangents.get(attributes as usize)?;
    let mut t = interpolate(a.truncate(), b.truncate(), c.truncate(), hit.u, hit.v);
    let mut sign = a.w;
    if hit.inst != INVALID_ID {
        if !geometry.deforming.is_empty()
            && let Some(Between { ends, fraction, .. }) = geometry.deformed(hit.geom, hit.prim, hit.time)
        {
            let [from, to] = ends.map(|end| geometry.tangents[end.attributes as usize]);
            let [a, b, c] = [0, 1, 2].map(|i| {
                let (from, to) = (from[i].truncate(), to[i].truncate());
                unit_or(from.lerp(to, fraction), from)
            });
            t = interpolate(a, b, c, hit.u, hit.v);
        }
        let m = &geometry.world_from_object(hit.inst, hit.time).matrix3;
        t = *m * t;
        sign *= m.determinant().signum();
    }
    let t = (t - n_s * n_s.dot(t)).try_normalize()?;
    Some(t.extend(sign))
}

/// Tilts `n_s` by a decoded normal-map value (x, y, z in [−1,1], already scaled). Falls back to `n_s` where the map
/// is degenerate (HARDCASES B17).
#[inline(always)]
pub fn tilt(n_s: Vec3, tangent: Vec4, map: Vec3) -> Vec3 {
    let t = tangent.truncate();
    let b = n_s.cross(t) * tangent.w;
    let n = t * map.x + b * map.y + n_s * map.z;
    unit_or(n, n_s)
}

/// Written on differences, so that three equal corners give that value exactly: a flat triangle stays flat.
#[inline(always)]
pub fn interpolate(a: Vec3, b: Vec3, c: Vec3, u: f32, v: f32) -> Vec3 {
    a + (b - a) * u + (c - a) * v
}

/// `v` at unit length; `fallback` where it has no direction.
#[inline(always)]
pub fn unit_or(v: Vec3, fallback: Vec3) -> Vec3 {
    let length2 = v.length_squared();
    if length2 > f32::MIN_POSITIVE && length2 < f32::INFINITY { v * (1.0 / length2.sqrt()) } else { fallback }
}
