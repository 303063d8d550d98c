//! What an extension is to the loader.

use super::super::part::Part;
use crate::error::Result;
use crate::scene::Material;

/// An extension that files may use and require.
pub(crate) struct Extension {
    /// Its registered name.
    pub(crate) name: &'static str,
    /// Where its objects stand, and who reads them.
    pub(crate) place: Place,
}

/// Where an extension's objects stand in a file.
#[derive(Clone, Copy)]
pub(crate) enum Place {
    /// In materials: reads the object's members (not its textures: `scene::material::slot` lists those).
    Material(fn(&Part, &mut Material) -> Result<()>),
    /// In texture information (`baseColorTexture` and the like).
    TextureInfo,
    /// In `/textures`.
    Texture,
    /// At the root and in nodes or scenes.
    Node,
    /// Nowhere: it widens what other members may be.
    None,
}
