//! The scene as the file describes it: immutable, in file units, no decision taken. [`gltf`] fills it,
//! [`builder`] does so from code (tests, library users), [`geometry`] flattens it for tracing and shading.

use std::path::PathBuf;

use glam::{Affine3A, DVec3, Vec2, Vec3, Vec4};

pub mod alpha;
pub mod builder;
pub mod camera;
mod fold;
pub mod geometry;
pub mod gltf;
pub mod ids;
pub mod image;
pub mod light;
pub mod material;
pub mod motion;
pub mod placement;
pub mod validate;

pub use crate::texture::load::Budget;
pub use crate::texture::{ColorSpace, Texels, Texture, Wrap};
pub use alpha::AlphaMode;
pub use camera::{Camera, Projection};
pub use ids::{MaterialId, MeshId, TextureId};
pub use light::{Environment, PunctualKind, PunctualLight};
pub use material::{Material, TextureSlot};
pub use motion::{Motion, Shutter};

/// Triangles of one glTF primitive, in object space.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// `mesh name/primitive N`.
    pub name: String,
    /// Vertex positions, metres, all finite.
    pub positions: Vec<Vec3>,
    /// Triangles as vertex indices, all in range; strips and fans are already unrolled.
    pub triangles: Vec<[u32; 3]>,
    /// Unit vertex normals, or `None` for flat shading.
    pub normals: Option<Vec<Vec3>>,
    /// Texture coordinates of channel 0: of the file's set that the material's first texture reads, transformed as it asks.
    pub uvs: Option<Vec<Vec2>>,
    /// Channels 1 and up, for materials whose textures read different sets or transform them differently.
    pub more_uvs: Vec<Vec<Vec2>>,
    /// `COLOR_0`: linear RGB and alpha in [0, 1]; read where the material says so ([`Material::vertex_colors`]).
    pub colors: Option<Vec<Vec4>>,
    /// Unit tangents with the bitangent's sign in w, in the channel that the normal map reads; present whenever it needs
    /// them.
    pub tangents: Option<Vec<Vec4>>,
    /// What the surface is made of.
    pub material: MaterialId,
}

/// A mesh placed in the world.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Which mesh.
    pub mesh: MeshId,
    /// Object to world when the shutter opens, relative to [`Scene::origin`]; invertible and finite. A negative determinant mirrors: the
    /// front side of a triangle is then the other winding (glTF 2.0 §3.7.4).
    pub world_from_object: Affine3A,
}

/// Something the user should know that does not stop the work.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Where: JSON pointer, material name, or file.
    pub place: String,
    /// What, in one clause.
    pub what: String,
}

/// Things the loader left out, counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Triangles of zero area, with repeated indices, or not finite.
    pub degenerate_triangles: usize,
    /// Points and lines, which a path tracer of surfaces cannot show.
    pub points_and_lines: usize,
}

/// A loaded scene.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// The file it came from; empty for scenes made in code.
    pub file: PathBuf,
    /// One entry a glTF primitive.
    pub meshes: Vec<Mesh>,
    /// Placements, flattened to one level.
    pub instances: Vec<Instance>,
    /// Never empty once loaded: the glTF default material is appended when a primitive has none.
    pub materials: Vec<Material>,
    /// Decoded textures.
    pub textures: Vec<Texture>,
    /// Punctual lights.
    pub punctual: Vec<PunctualLight>,
    /// Cameras of the scene in node order; never empty once loaded (framed automatically, with a warning, if the file has none).
    pub cameras: Vec<Camera>,
    /// What moves while the shutter is open; nothing in a scene that is shown at rest.
    pub motion: Motion,
    /// The environment, if one was given.
    pub environment: Option<Environment>,
    /// World position of the coordinates' origin: subtracted from everything in f64 at load when the scene lies far away.
    pub origin: DVec3,
    /// Size that `scenes[n].extras.render` suggests, if any.
    pub suggested_size: Option<(u32, u32)>,
    /// What was left out.
    pub dropped: Dropped,
    /// What the user should know.
    pub warnings: Vec<Warning>,
}

/// What a load can be told.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoadOptions {
    /// Memory of textures, and who decodes them.
    pub texture_budget: Budget,
    /// What an image that cannot be used does.
    pub missing_texture: MissingTexture,
    /// When the shutter is open, in the time of the file's animations; `None` shows the scene as its nodes say.
    pub shutter: Option<Shutter>,
}

/// What becomes of an image that is missing, broken, empty, or not finite.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MissingTexture {
    /// It ends the load.
    #[default]
    Error,
    /// A warning; colours are magenta, data change nothing.
    Magenta,
}

impl Scene {
    /// Triangles over all placements.
    pub fn triangle_count(&self) -> u64 {
        self.instances.iter().map(|i| self.meshes[i.mesh.index()].triangles.len() as u64).sum()
    }
}
