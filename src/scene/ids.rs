//! Typed indices into the scene's tables. Plain integers do not cross a module border.

macro_rules! id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub u32);

        impl $name {
            /// Position in the table that this id points into.
            #[inline(always)]
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }
    };
}

id!(
    /// Index into [`Scene::meshes`](super::Scene::meshes).
    MeshId
);
id!(
    /// Index into [`Scene::materials`](super::Scene::materials).
    MaterialId
);
id!(
    /// Index into [`Scene::textures`](super::Scene::textures).
    TextureId
);
id!(
    /// Index into [`Scene::nodes`](super::Scene::nodes).
    NodeId
);
