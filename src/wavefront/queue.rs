//! Which kernel shades a hit: filled by `classify`, drained by `shade`. A kind that the
//! plan does not list has an empty queue and its kernel is never called.

use crate::scene::{Material, Scene};

/// Number of kinds.
pub const KINDS: usize = 3;

/// Kinds of kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum Kind {
    /// Exact Lambert without textures and vertex colours: the lean kernel.
    Lambert = 0,
    /// Opaque and lit: coats, metals, textures.
    Opaque = 1,
    /// Everything else: what transmits or is unlit.
    General = 2,
}

impl Kind {
    /// Every kind, in the order of the queues.
    pub const ALL: [Kind; KINDS] = [Kind::Lambert, Kind::Opaque, Kind::General];
}

/// Kind of a material, resolved once per render.
pub fn kind_of(material: &Material) -> Kind {
    if material.transmission > 0.0 || material.unlit {
        return Kind::General;
    }
    let plain = !material.reads_textures() && !material.vertex_colors;
    if material.metallic == 0.0 && material.specular == 0.0 && plain { Kind::Lambert } else { Kind::Opaque }
}

/// The kind of every material that is placed, if it is one for all.
pub fn only_kind(scene: &Scene, kinds: &[Kind]) -> Option<Kind> {
    let mut placed = scene.instances.iter().map(|instance| kinds[scene.meshes[instance.mesh.index()].material.index()]);
    let first = placed.next()?;
    placed.all(|kind| kind == first).then_some(first)
}
