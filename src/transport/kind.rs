//! Which kernel shades a hit: a kind per scattering model. Queues of lanes, one a kind, are filled by `classify` and
//! drained by `shade`. A kind that no material has costs nothing but the test of an empty queue.

use crate::scene::{Fact, Facts, Material, Scene};
use crate::shading::bsdf::models;

macro_rules! kinds {
    ($($(#[$doc:meta])* $Kind:ident: $Model:ty, $condition:expr;)*) => {
        /// Kinds of kernel.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(usize)]
        pub enum Kind {
            $($(#[$doc])* $Kind,)*
        }

        impl Kind {
            /// Every kind, in the order of the queues.
            pub const ALL: [Kind; KINDS] = [$(Kind::$Kind),*];
        }

        /// Number of kinds.
        pub const KINDS: usize = [$(Kind::$Kind),*].len();

        /// Kind of a material, resolved once per render.
        pub fn kind_of(material: &Material) -> Kind {
            let facts = Facts::of(material);
            $(
                let condition: fn(&Facts, &Material) -> bool = $condition;
                if condition(&facts, material) {
                    return Kind::$Kind;
                }
            )*
            unreachable!("the last model takes every material")
        }
    };
}

models!(kinds);

/// The kind of every material that is placed, if it is one for all.
pub fn only_kind(scene: &Scene, kinds: &[Kind]) -> Option<Kind> {
    let mut placed = scene.instances.iter().map(|instance| kinds[scene.material_of(instance).index()]);
    let first = placed.next()?;
    placed.all(|kind| kind == first).then_some(first)
}
