//! Names by which layers of ids (cryptomatte) tell things apart: of the node that places a mesh, of its topmost parent,
//! and of the material. Equal names are one thing, as compositors expect.
//!
//! What has no name in the file has a stable one: `node 12`, `material 3`, by its place in the file. Scenes made in
//! code may leave nodes out: those are `instance 12`.

use std::borrow::Cow;

use super::{Node, Scene};

impl Scene {
    /// The node that places instance `instance`, if it is known.
    fn node_of(&self, instance: usize) -> Option<&Node> {
        self.nodes.get(self.instances.get(instance)?.node?.index())
    }

    /// Name of the node that places instance `instance`.
    pub fn object_name(&self, instance: usize) -> Cow<'_, str> {
        self.node_of(instance).map_or_else(|| format!("instance {instance}").into(), |node| node.name.as_str().into())
    }

    /// Name of the topmost node above instance `instance`.
    pub fn asset_name(&self, instance: usize) -> Cow<'_, str> {
        self.node_of(instance).map_or_else(|| self.object_name(instance), |node| node.asset.as_str().into())
    }

    /// Name of what instance `instance`, which there is, is made of.
    pub fn material_name(&self, instance: usize) -> Cow<'_, str> {
        let material = self.material_of(&self.instances[instance]).index();
        match self.materials.get(material) {
            Some(named) if !named.name.is_empty() => named.name.as_str().into(),
            _ => format!("material {material}").into(),
        }
    }
}
