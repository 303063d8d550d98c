//! Geometry flattened for tracing and shading: what the backends are built from and what a hit is looked up in.
//!
//! Meshes that are placed once, and small repeated ones, are baked into one world mesh in f64 (index 0); the rest stay
//! instanced at one level. Each triangle has one 64-byte record (a cache line) with everything flat shading needs;
//! vertex attributes are looked up only where the plan shades with them.

use glam::{Affine3A, DAffine3, DVec3, Mat3A, Vec2, Vec3, Vec4};

use super::ids::MaterialId;
use super::{MeshId, Scene};

/// A repeated mesh is baked as long as all baked copies together stay below this many triangles (64 B of record, about
/// 100 B of hierarchy each: 330 MB at the limit). Measured reason: a ray through an instance costs a transform and a
/// second root; see ARCHITECTURE.md.
pub const BAKE_TRIANGLE_BUDGET: u64 = 2_000_000;

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
    /// Index of this triangle's corners in [`Geometry::attributes`], or [`NO_ATTRIBUTES`].
    pub attributes: u32,
    /// Area in m² (of the mesh's space).
    pub area: f32,
    /// Index of the light this triangle is, or `u32::MAX`. Valid in the world mesh only: emissive meshes are always baked.
    pub light: u32,
}

/// Vertex attributes of one triangle's three corners. Missing ones are zero and not read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corners {
    /// Unit normals in the mesh's space.
    pub normal: [Vec3; 3],
    /// Texture coordinates.
    pub uv: [Vec2; 3],
    /// Tangent and the bitangent's sign.
    pub tangent: [Vec4; 3],
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
}

/// A mesh placed with a transform of its own.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// Index into [`Geometry::meshes`].
    pub mesh: u32,
    /// Object to world.
    pub world_from_object: Affine3A,
    /// Its inverse, computed in f64.
    pub object_from_world: Affine3A,
    /// Inverse transpose of the linear part: takes normals to the world (to be normalised).
    pub world_from_normal: Mat3A,
}

/// The flattened geometry.
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// Mesh 0 is the baked world mesh (possibly empty); the others are reached through `instances`.
    pub meshes: Vec<TriangleMesh>,
    /// Instanced placements.
    pub instances: Vec<Placement>,
    /// One record per triangle of every mesh.
    pub triangles: Vec<Triangle>,
    /// Corner attributes; empty if no mesh has normals or texture coordinates.
    pub attributes: Vec<Corners>,
    /// World-space bounds over all placements: min and max; min > max when there is nothing.
    pub bounds: (Vec3, Vec3),
    /// Triangles without area that were left out while baking.
    pub dropped_degenerate: usize,
}
