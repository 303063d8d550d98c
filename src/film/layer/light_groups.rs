//! `lightgroup_NAME.R/G/B`: radiance by the group of the light that it is of, whatever happened to it on its way: one
//! image a group, `default` for what no group claims. They sum to the beauty, so that a compositor can change lamps
//! after the render. Groups are resolved by the plan (`plan/light_groups.rs`).

use super::kind::{Layer, Values, rgb};
use crate::plan::aov::{Aov, Gathers};

impl Aov {
    /// One image per group of lights.
    pub const LIGHT_GROUPS: Aov = Aov::new("lightgroups", Gathers::LightGroups);
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::LIGHT_GROUPS,
    about: "one image per group of lights, see --light-group",
    values: Values::Groups,
    channels: |shape| {
        let of = |(number, name): (usize, &String)| {
            rgb(&format!("lightgroup_{name}")).into_iter().map(move |(channel, c)| (channel, 3 * number + c))
        };
        shape.groups.iter().enumerate().flat_map(of).collect()
    },
};
