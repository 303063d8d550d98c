//! The scene as the file describes it: immutable, in file units, no decision taken. [`gltf`] fills it,
//! [`builder`] does so from code (tests, library users), [`geometry`] flattens it for tracing and shading.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{Affine3A, DVec3, Vec2, Vec3, Vec4};

use crate::error::{Error, Result};
use crate::setters::setters;
use crate::texture::stored::Tiles;

pub mod builder;
pub mod camera;
mod closed;
mod fold;
#[doc(hidden)]
pub mod geometry;
pub mod gltf;
pub mod ids;
pub mod ies;
pub mod image;
pub mod light;
pub mod material;
pub mod motion;
mod names;
pub mod orbit;
mod studio;
#[doc(hidden)]
pub mod validate;

pub use crate::texture::decode::Decoder;
pub use crate::texture::load::Budget;
pub use crate::texture::{ColorSpace, Texels, Texture, Wrap};
pub use camera::{Camera, Projection};
pub use ids::{MaterialId, MeshId, NodeId, TextureId};
pub use light::{Aimed, Environment, EnvironmentFile, PunctualKind, PunctualLight};
pub use material::alpha::AlphaMode;
pub use material::facts::{Fact, FactSet, Facts};
pub use material::parameters::{Material, TextureSlot};
pub use material::slot::Slot;
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
    /// Texture coordinates of channel 0: of the file's set that the material's first texture reads, transformed as it
    /// asks.
    pub uvs: Option<Vec<Vec2>>,
    /// Channels 1 and up, for materials whose textures read different sets or transform them differently.
    pub more_uvs: Vec<Vec<Vec2>>,
    /// `COLOR_0`: linear RGB and alpha in [0, 1]; read where the material says so ([`Material::vertex_colors`]).
    pub colors: Option<Vec<Vec4>>,
    /// Unit tangents with the bitangent's sign in w, in the channel that the normal map reads; present whenever it
    /// needs them.
    pub tangents: Option<Vec<Vec4>>,
    /// What the surface is made of.
    pub material: MaterialId,
    /// Its shapes at equal intervals until the shutter closes, after the one above, with straight lines between them;
    /// none where it keeps its shape. Every instance of a mesh that changes its shape has a track, if only of one
    /// place.
    pub later: Vec<Shape>,
}

/// The vertices of a mesh at another time; tables are as long as the mesh's, and there where those are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shape {
    /// Vertex positions, metres, all finite.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals.
    pub normals: Option<Vec<Vec3>>,
    /// Unit tangents.
    pub tangents: Option<Vec<Vec4>>,
}

impl Mesh {
    /// The mesh at rest in another shape.
    pub fn shaped(&self, shape: &Shape) -> Mesh {
        let Shape { positions, normals, tangents } = shape.clone();
        Mesh { positions, normals, tangents, later: Vec::new(), ..self.clone() }
    }
}

/// A mesh placed in the world.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Which mesh.
    pub mesh: MeshId,
    /// Object to world when the shutter opens, relative to [`Scene::origin`]; invertible and finite. A negative
    /// determinant mirrors: the front side of a triangle is then the other winding (glTF 2.0 §3.7.4).
    pub world_from_object: Affine3A,
    /// What it is made of in the place of the mesh's own material, if it shares the triangles with others. Both are
    /// plain surfaces that read the same attributes ([`Material::may_share`]).
    pub material: Option<MaterialId>,
    /// The node that places it, if there is one with a name.
    pub node: Option<NodeId>,
}

impl Instance {
    /// A mesh of its own material.
    pub fn new(mesh: MeshId, world_from_object: Affine3A) -> Instance {
        Instance { mesh, world_from_object, material: None, node: None }
    }
}

/// A node that places meshes or lights, as layers of ids and light groups name it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Node {
    /// Its name; not empty.
    pub name: String,
    /// Name of the root node above it, which may be itself; not empty.
    pub asset: String,
    /// `extras.lightgroup`: the group of the light that begins there.
    pub light_group: Option<String>,
}

/// Something the user should know that does not stop the work.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Warning {
    /// Where: JSON pointer, material name, or file.
    pub place: String,
    /// What, in one clause.
    pub what: String,
}

/// Things the loader left out, counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Dropped {
    /// Triangles of zero area, with repeated indices, or not finite.
    pub degenerate_triangles: usize,
    /// Points and lines, which a path tracer of surfaces cannot show.
    pub points_and_lines: usize,
}

/// An effect that was taken out of a scene on demand, though the file calls for it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// Its name: "normal-maps".
    pub name: String,
    /// With what calls for it: "normal-maps (material 'brick')".
    pub found: String,
}

impl LeftOut {
    /// What names of techniques begin with, before a colon.
    pub const TECHNIQUE: &'static str = "technique";

    /// Whether it is a technique, which no expectation depends on: others find the same light.
    pub fn is_technique(&self) -> bool {
        self.name.strip_prefix(LeftOut::TECHNIQUE).is_some_and(|rest| rest.starts_with(':'))
    }

    /// Its entry in the ledger of biases; a technique has none of its own.
    pub fn bias(&self) -> Option<String> {
        (!self.is_technique()).then(|| format!("left out: {} (--without)", self.name))
    }
}

/// A loaded scene.
///
/// ```
/// use pathspace::Scene;
///
/// let scene = Scene::load("scenes/cornell-box/scene.gltf")?;
/// assert_eq!((scene.cameras.len(), scene.triangle_count()), (1, 38));
/// assert!(scene.warnings.is_empty());
/// # Ok::<(), pathspace::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// The file it came from; empty for scenes made in code.
    pub file: PathBuf,
    /// Every file that was read, by its canonical path.
    pub inputs: Vec<PathBuf>,
    /// One entry a glTF primitive.
    pub meshes: Vec<Mesh>,
    /// Placements, flattened to one level.
    pub instances: Vec<Instance>,
    /// The nodes that place them.
    pub nodes: Vec<Node>,
    /// Never empty once loaded: the glTF default material is appended when a primitive has none.
    pub materials: Vec<Material>,
    /// Decoded textures.
    pub textures: Vec<Texture>,
    /// Punctual lights.
    pub punctual: Vec<PunctualLight>,
    /// The node of each of them, if there is one with a name; may be shorter.
    pub light_nodes: Vec<Option<NodeId>>,
    /// Cameras of the scene in node order; never empty once loaded (framed automatically, with a warning, if the file
    /// has none).
    pub cameras: Vec<Camera>,
    /// What moves while the shutter is open; nothing in a scene that is shown at rest.
    pub motion: Motion,
    /// The environment, if one was given.
    pub environment: Option<Environment>,
    /// World position of the coordinates' origin: subtracted from everything in f64 at load when the scene lies far
    /// away.
    pub origin: DVec3,
    /// Names of the scenes of the file, one of which this is; empty where one has none.
    pub scenes: Vec<String>,
    /// Names of the variants of materials that the file offers ([`LoadOptions::variant`]).
    pub variants: Vec<String>,
    /// Size that `scenes[n].extras.render` suggests, if any.
    pub suggested_size: Option<(u32, u32)>,
    /// What the loader left out.
    pub dropped: Dropped,
    /// Effects that were taken out on demand; none by default. See [`leave_out`](crate::render::leave_out).
    pub left_out: Vec<LeftOut>,
    /// What the user should know.
    pub warnings: Vec<Warning>,
}

/// What a load can be told.
///
/// ```
/// use pathspace::scene::{LoadOptions, MissingTexture, Shutter};
/// let options = LoadOptions::default().missing_texture(MissingTexture::Magenta).shutter(Shutter::new(0.0, 0.5)?);
/// # Ok::<(), pathspace::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LoadOptions {
    /// Memory of textures, and which images are decoded by what; the environment's too.
    pub texture_budget: Budget,
    /// What an image that cannot be used does.
    pub missing_texture: MissingTexture,
    /// When the shutter is open, in the time of the file's animations; `None` shows the scene as its nodes say.
    pub shutter: Option<Shutter>,
    /// The file's scene to load, by name or by index from 0; `None` takes the one that the file says.
    pub scene: Option<String>,
    /// Which of the file's variants of materials is shown, by name or by index from 0; `None` shows the materials that
    /// the meshes name.
    pub variant: Option<String>,
    /// The animation that runs under a shutter, by name or by index from 0; `None` runs all of them.
    pub animation: Option<String>,
    /// Light from all directions; glTF files have none.
    pub environment: Option<EnvironmentFile>,
    /// Whether a scene without any light gets [`Scene::ensure_light`]'s; on by default.
    pub fallback_light: bool,
    /// Whether URIs may lead out of the scene's folder: by `..`, absolute paths or symbolic links; off by default.
    pub allow_outside: bool,
    /// Whether files load that require extensions of materials which are not supported, with a warning each; off by
    /// default.
    pub allow_missing_extensions: bool,
}

impl Default for LoadOptions {
    fn default() -> Self {
        LoadOptions {
            texture_budget: Budget::default(),
            missing_texture: MissingTexture::default(),
            shutter: None,
            scene: None,
            variant: None,
            animation: None,
            environment: None,
            fallback_light: true,
            allow_outside: false,
            allow_missing_extensions: false,
        }
    }
}

impl LoadOptions {
    setters! {
        texture_budget: = Budget,
        missing_texture: = MissingTexture,
        shutter: into Option<Shutter>,
        scene: into Option<String>,
        variant: into Option<String>,
        animation: into Option<String>,
        environment: into Option<EnvironmentFile>,
        fallback_light: = bool,
        allow_outside: = bool,
        allow_missing_extensions: = bool,
    }
}

/// What to do with an image that is missing, broken, empty, or not finite.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum MissingTexture {
    /// It ends the load.
    #[default]
    Error,
    /// A warning; colours are magenta, data change nothing.
    Magenta,
}

impl Scene {
    /// What a placed mesh is made of; both are in range once the scene is valid.
    pub fn material_of(&self, instance: &Instance) -> MaterialId {
        instance.material.unwrap_or_else(|| self.meshes[instance.mesh.index()].material)
    }

    /// Gives placements a mesh of their own whose material may share one no more, after materials have changed.
    pub fn part_materials(&mut self) {
        let mut parted: Vec<(MeshId, MaterialId, MeshId)> = Vec::new();
        for instance in &mut self.instances {
            let mesh = &self.meshes[instance.mesh.index()];
            let shares =
                |other: MaterialId| self.materials[mesh.material.index()].may_share(&self.materials[other.index()]);
            let Some(other) = instance.material.filter(|other| !shares(*other)) else { continue };
            let known = parted.iter().find(|(mesh, material, _)| (*mesh, *material) == (instance.mesh, other));
            let own = match known {
                Some((.., own)) => *own,
                None => {
                    let own = MeshId(self.meshes.len() as u32);
                    parted.push((instance.mesh, other, own));
                    self.meshes.push(Mesh { material: other, ..mesh.clone() });
                    own
                }
            };
            (instance.mesh, instance.material) = (own, None);
        }
    }

    /// The tiles of textures that are not in memory, if there are any.
    pub fn texture_tiles(&self) -> Option<&Arc<Tiles>> {
        self.textures.iter().find_map(|texture| texture.texels.tiles())
    }

    /// Whether every texture look-up so far could be answered: those into files may fail later than at load. Where
    /// missing textures are shown in magenta, failing is no error.
    ///
    /// # Errors
    /// [`Error::Image`] with the file, the material, and what is wrong by now.
    pub fn check_textures(&self) -> Result<()> {
        match self.texture_tiles().filter(|tiles| tiles.must_stop()).and_then(|tiles| tiles.faults().into_iter().next())
        {
            Some(fault) => Err(Error::Image { path: fault.image.into(), problem: fault.problem }),
            None => Ok(()),
        }
    }

    /// Triangles over all placements.
    pub fn triangle_count(&self) -> u64 {
        self.instances.iter().map(|i| self.meshes[i.mesh.index()].triangles.len() as u64).sum()
    }
}
