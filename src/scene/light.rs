//! Light sources that are not surfaces: `KHR_lights_punctual`, `EXT_lights_ies` and the environment. Emissive triangles
//! are found from the materials.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{Mat3, Vec3};

use super::ies::LightProfile;

/// Longest name of a light group, bytes: channels of OpenEXR have 255.
pub(crate) const LONGEST_GROUP_NAME: usize = 64;

/// Whether a light group may be called so: readers of OpenEXR take what comes before the last dot for the layer.
pub(crate) fn is_group_name(name: &str) -> bool {
    let shown = |c: char| !(c.is_control() || c == '.');
    !name.is_empty() && name.len() <= LONGEST_GROUP_NAME && name.trim() == name && name.chars().all(shown)
}

/// One punctual light placed in the world. 1 cd is taken as 1 W/sr, 1 lx as 1 W/m².
#[derive(Clone, Debug, PartialEq)]
pub struct PunctualLight {
    /// Name in the file, or `light N`.
    pub name: String,
    /// World position, relative to [`Scene::origin`](super::Scene::origin); unused by directional lights.
    pub position: Vec3,
    /// Unit world direction the light shines along (node-local −Z); unused by point lights.
    pub direction: Vec3,
    /// colour × intensity: W/sr for point and spot, W/m² for directional.
    pub intensity: Vec3,
    /// Which of the three kinds, with the kind's own parameters.
    pub kind: PunctualKind,
    /// Metres from a point or spot light at which it ends: its light is multiplied by 1 − (d/range)⁴ up to there.
    /// Infinite where the file has none.
    pub range_m: f32,
    /// Of a point light, how its intensity differs by direction; `intensity` is then the largest.
    pub profile: Option<Aimed>,
}

/// A profile in the world.
#[derive(Clone, Debug, PartialEq)]
pub struct Aimed {
    /// Shares of the largest intensity.
    pub profile: Arc<LightProfile>,
    /// World directions to those of the profile; a rotation.
    pub light_from_world: Mat3,
}

/// The kinds of `KHR_lights_punctual`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PunctualKind {
    /// Light from infinity along one direction.
    Directional,
    /// Light from a point in all directions.
    Point,
    /// Light from a point within a cone.
    Spot {
        /// Cosine of the angle where the fall-off begins.
        cos_inner: f32,
        /// Cosine of the angle where the light ends.
        cos_outer: f32,
    },
}

/// An equirectangular environment map, linear Rec.709 radiance. Row 0 is the top (+Y). For a unit direction d,
/// u = 0.5 + atan2(d.x, −d.z)/2π and v = acos(d.y)/π.
#[derive(Clone, Debug)]
pub struct Environment {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width × height` radiance texels, row-major, finite and ≥ 0.
    pub texels: Arc<[Vec3]>,
    /// Rotation about +Y in radians: the map is turned counter-clockwise seen from above.
    pub rotation_rad: f32,
    /// Factor on the radiance.
    pub intensity: f32,
}

/// An environment map that is still in its file: equirectangular, OpenEXR, Radiance `.hdr` or another image.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentFile {
    /// The image.
    pub path: PathBuf,
    /// As [`Environment::rotation_rad`].
    pub rotation_rad: f32,
    /// As [`Environment::intensity`].
    pub intensity: f32,
}

impl EnvironmentFile {
    /// The map as in the file.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        EnvironmentFile { path: path.into(), rotation_rad: 0.0, intensity: 1.0 }
    }
}

impl Environment {
    /// An environment that is the same in all directions.
    pub fn constant(radiance: Vec3) -> Environment {
        Environment { width: 1, height: 1, texels: Arc::new([radiance]), rotation_rad: 0.0, intensity: 1.0 }
    }
}
