//! What flattened geometry is made of: one 64-byte record a triangle (a cache line) with everything flat shading needs,
//! vertex attributes beside it, looked up only where the plan shades with them.

use glam::{Affine3A, Vec2, Vec3, Vec4};

use super::coincident::Coincident;
use super::deforming::Deforming;
use super::frames::Frames;
use super::owners::{Owners, Part};
use super::placement::{Moving, NO_MATERIAL, Placement};
use super::solids::Solids;
use crate::math::float;
use crate::math::hash::{digest_of, mix};

/// A ray thinner than an f32 direction can express cannot tell a triangle from a line once its height is below
/// 2⁻⁴⁰ of its longest edge: sheared coordinates carry 24 bits, so it would have to start within 2⁻¹⁶ of the
/// edge's length.
const LINE_HEIGHT: f64 = 1.0 / (1u64 << 40) as f64;

/// Largest coordinate, metres: beyond it the squares in ray–triangle tests overflow f32 (√f32::MAX ≈ 1.8e19;
/// Embree itself drops vertices beyond 1.8e18).
pub(crate) const LARGEST_COORDINATE_M: f32 = 1e18;

/// "No vertex attributes" in [`Triangle::attributes`].
pub const NO_ATTRIBUTES: u32 = u32::MAX;

/// One triangle as shading sees it, in the space of its mesh.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Triangle {
    /// First vertex.
    pub v0: [f32; 3],
    /// v1 − v0, rounded once.
    pub e1: [f32; 3],
    /// v2 − v0, rounded once.
    pub e2: [f32; 3],
    /// Unit geometric normal, along e1 × e2 (flipped where a baked placement mirrors), computed in f64.
    pub n_g: [f32; 3],
    /// Index into `Scene::materials`.
    pub material: u32,
    /// Index of this triangle's corners in [`Geometry::normals`] (and in `uvs`, `tangents` where below their length),
    /// or [`NO_ATTRIBUTES`].
    pub attributes: u32,
    /// Bound of the distance along `n_g` between any reported hit on this triangle and the true one, metres (world
    /// triangles; instanced ones need their transform): the largest of `math::float::hit_error` at the corners, where
    /// that convex function of the point is largest.
    pub error: f32,
    /// Index of the light this triangle is, or `u32::MAX`. Valid in the world mesh only: emissive meshes are always
    /// baked.
    pub light: u32,
}

impl Triangle {
    /// Area in m² of the mesh's space.
    pub fn area(&self) -> f32 {
        let (e1, e2) = (Vec3::from(self.e1).as_dvec3(), Vec3::from(self.e2).as_dvec3());
        (0.5 * e1.cross(e2).length()) as f32
    }
}

/// True for a triangle that is a point, a line (see [`LINE_HEIGHT`]), not finite or out of range. No such triangle is
/// traced.
pub(crate) fn is_degenerate(triangle: &[Vec3; 3]) -> bool {
    // Also true of NaN.
    if !triangle.iter().all(|v| v.abs().cmple(Vec3::splat(LARGEST_COORDINATE_M)).all()) {
        return true;
    }
    let [a, b, c] = triangle.map(|v| v.as_dvec3());
    let longest2 = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
    // Twice the area = height · longest edge. `<=` also catches three equal points.
    (b - a).cross(c - a).length() <= LINE_HEIGHT * longest2
}

/// The largest hit error over the corners.
pub(super) fn hit_error(v0: Vec3, e1: Vec3, e2: Vec3, corners: [Vec3; 3]) -> f32 {
    corners.into_iter().map(|p| float::hit_error(v0, e1, e2, p)).fold(0.0, f32::max)
}

/// Triangles of one mesh as a backend sees them.
#[derive(Clone, Debug, Default)]
pub struct TriangleMesh {
    /// Vertex positions; finite. One spare vertex follows the last used one, so that 16-byte reads stay inside.
    pub vertices: Vec<Vec3>,
    /// Vertex indices.
    pub indices: Vec<[u32; 3]>,
    /// Index of this mesh's first record in [`Geometry::triangles`].
    pub first_triangle: u32,
    /// The vertices at equal intervals until the shutter closes, after those above; none where the mesh keeps its
    /// shape. Only meshes that instances place have them.
    pub later: Vec<Vec<Vec3>>,
}

impl TriangleMesh {
    /// The triangles that can be traced, with their corners. Those without area and indices out of range are left out.
    pub(crate) fn traced(&self) -> impl Iterator<Item = (u32, [Vec3; 3])> {
        let corner = |i: u32| self.vertices.get(i as usize).copied().unwrap_or(Vec3::NAN);
        let all = (0u32..).zip(&self.indices).map(move |(prim, triangle)| (prim, triangle.map(corner)));
        all.filter(|(_, corners)| !is_degenerate(corners))
    }

    /// Digest of what a hierarchy over it follows from.
    pub(crate) fn digest(&self) -> u64 {
        let shapes = std::iter::once(&self.vertices).chain(&self.later).map(|shape| digest_of(shape));
        shapes.fold(digest_of(&self.indices), mix)
    }

    /// The triangles of a mesh that changes its shape, with their corners in each. One without area as the shutter
    /// opens may have one later.
    pub(crate) fn traced_moving(&self) -> impl Iterator<Item = (u32, Vec<[Vec3; 3]>)> {
        let shapes = move || std::iter::once(&self.vertices).chain(&self.later);
        (0u32..).zip(&self.indices).filter_map(move |(prim, triangle)| {
            let corner = |shape: &Vec<Vec3>| {
                let at =
                    |i: u32| shape.get(i as usize).copied().filter(|p| p.abs().max_element() <= LARGEST_COORDINATE_M);
                let [a, b, c] = triangle.map(at);
                Some([a?, b?, c?])
            };
            let corners: Vec<[Vec3; 3]> = shapes().map(corner).collect::<Option<_>>()?;
            Some((prim, corners))
        })
    }
}

/// The flattened geometry.
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// Mesh 0 is the baked world mesh (possibly empty); the others are reached through `instances`.
    pub meshes: Vec<TriangleMesh>,
    /// Instanced placements, those that move last.
    pub instances: Vec<Placement>,
    /// Where the last of them are over the shutter; empty in a scene at rest.
    pub moving: Moving,
    /// Which meshes change their shape over the shutter; empty where none does.
    pub deforming: Deforming,
    /// One record per triangle of their later shapes.
    pub later: Vec<Triangle>,
    /// One record per triangle of every mesh.
    pub triangles: Vec<Triangle>,
    /// Unit normals at the corners of the triangles that have attributes. Triangles with tangents come first, then
    /// those with texture coordinates, then those with normals alone, so that the shorter arrays below are prefixes.
    /// (Those with extras come before all, in the same order, and have every array filled.)
    pub normals: Vec<[Vec3; 3]>,
    /// Texture coordinates at the corners; only triangles whose material reads a texture have them.
    pub uvs: Vec<[Vec2; 3]>,
    /// Channels 1 and up of the texture coordinates, each as long as `colors` or empty.
    pub more_uvs: Vec<Vec<[Vec2; 3]>>,
    /// Vertex colours at the corners. Triangles with colours or more than one channel come before all others; among
    /// them, those without have white here.
    pub colors: Vec<[Vec4; 3]>,
    /// Tangents and the bitangent's sign at the corners; only triangles whose material has a normal map have them.
    pub tangents: Vec<[Vec4; 3]>,
    /// World-space bounds over all placements: min and max; min > max when there is nothing.
    pub bounds: (Vec3, Vec3),
    /// Triangles without area that were left out while baking.
    pub dropped_degenerate: usize,
    /// Bodies of materials that have an inside.
    pub solids: Solids,
    /// Which placements the triangles belong to.
    pub owners: Owners,
    /// Which of the world mesh other frames have elsewhere.
    pub frames: Frames,
    /// Triangles that lie on one another.
    pub coincident: Coincident,
    /// Emissive triangles that were left out because another one has the same corners and faces the same way.
    pub dropped_lamps: usize,
}

impl Geometry {
    /// Object to world of instance `instance` at `time`, a fraction of the shutter.
    #[inline]
    pub fn world_from_object(&self, instance: u32, time: f32) -> Affine3A {
        let moved = self.moving.at(instance, time);
        moved.map_or_else(|| self.instances[instance as usize].world_from_object, |moved| moved.world_from_object)
    }

    /// Record of triangle `prim` of mesh `geom`.
    #[inline(always)]
    pub fn triangle(&self, geom: u32, prim: u32) -> &Triangle {
        &self.triangles[(self.meshes[geom as usize].first_triangle + prim) as usize]
    }

    /// What `triangle` is made of on instance `instance`, which may be none: an index into `Scene::materials`.
    #[inline(always)]
    pub fn material(&self, instance: u32, triangle: &Triangle) -> u32 {
        match self.instances.get(instance as usize) {
            Some(placement) if placement.material != NO_MATERIAL => placement.material,
            _ => triangle.material,
        }
    }

    /// Texture coordinates of channel `channel` on a triangle of these [`Triangle::attributes`], by the weights of its
    /// second and third corner; `None` where it has none.
    #[inline(always)]
    pub fn uv(&self, attributes: u32, channel: u32, [u, v]: [f32; 2]) -> Option<Vec2> {
        let uvs = if channel == 0 { &self.uvs } else { self.more_uvs.get(channel as usize - 1)? };
        let [a, b, c] = uvs.get(attributes as usize)?;
        Some(*a * (1.0 - u - v) + *b * u + *c * v)
    }

    /// Vertex colour, as [`uv`](Self::uv); white where the triangle has none.
    #[inline(always)]
    pub fn color(&self, attributes: u32, [u, v]: [f32; 2]) -> Vec4 {
        let Some([a, b, c]) = self.colors.get(attributes as usize) else { return Vec4::ONE };
        *a + (*b - *a) * u + (*c - *a) * v
    }

    /// Radius of the sphere around the bounds' centre that holds everything, metres; 1 when there is nothing.
    pub fn bounding_radius(&self) -> f32 {
        let (lo, hi) = self.bounds;
        if lo.x > hi.x { 1.0 } else { (0.5 * (hi - lo).length()).max(f32::MIN_POSITIVE) }
    }
}

/// A mesh under construction and its records.
#[derive(Default)]
pub(super) struct MeshRecords {
    pub(super) mesh: TriangleMesh,
    /// One a triangle of `mesh`.
    pub(super) records: Vec<Triangle>,
    /// The same in each later shape.
    pub(super) later: Vec<Vec<Triangle>>,
    /// Whether triangles without area stay: in another shape they have one.
    pub(super) keeps_all: bool,
    /// Whose they are, in the world mesh.
    pub(super) parts: Vec<Part>,
}
