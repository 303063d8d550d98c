//! Solids: closed bodies of materials that have an inside. What ray transport asks when a ray enters or leaves one, and
//! which of two that overlap is meant.
//!
//! A body is a connected part of the triangles of one mesh and one material, welded at equal corners; a cavity (a part
//! whose normals point into itself, as the inner sphere of a hollow ball) belongs to the body around it. Every
//! placement of a body is a solid. Open bodies of one material are one solid: two faces of a pane that are meshes of
//! their own bound it together. Solids are numbered by rank: of two that overlap, the one with the smaller bounding
//! box is the inner one and has the higher number. glTF has no priorities (Schmidt and Budge 2002); a total order makes
//! the answer the same from both sides.
//!
//! Limits: cavities are looked for within a mesh; boxes decide, not volumes, because a glass is thinner than its wine.

use glam::Vec3;

/// Not a solid.
pub const NO_SOLID: u32 = u32::MAX;

/// One placed body, or all open ones of a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solid {
    /// Index into `Scene::materials`.
    pub material: u32,
    /// World-space box: min and max, metres. Of a body that moves, where it is when the shutter opens.
    pub bounds: (Vec3, Vec3),
    /// Whether every edge joins two triangles that face the same way: only then it has an inside that is known.
    pub closed: bool,
    /// Mesh of the flattened geometry, body within it, and placement ([`u32::MAX`]: the world's); of open ones, the
    /// first's.
    pub(super) of: [u32; 3],
}

/// The solids of a scene.
#[derive(Clone, Debug, Default)]
pub struct Solids {
    /// By rank: the inner one of two has the higher number.
    pub(super) list: Vec<Solid>,
    /// Body of each triangle of the geometry within its mesh; empty where there is no solid.
    pub(super) bodies: Vec<u32>,
    /// Where the numbers of a placement begin: the world's first, then one an instance.
    pub(super) first: Vec<u32>,
    /// Number of each body of each placement in `list`.
    pub(super) numbers: Vec<u32>,
}

impl Solids {
    /// All of them, by rank.
    pub fn list(&self) -> &[Solid] {
        &self.list
    }

    /// Number of the solid that the triangle of record `record` bounds; `inst` is its placement, [`u32::MAX`] in the
    /// world. [`NO_SOLID`] where it bounds none.
    #[inline(always)]
    pub fn of(&self, record: usize, inst: u32) -> u32 {
        match self.bodies.get(record) {
            None | Some(&NO_SOLID) => NO_SOLID,
            Some(body) => self.numbers[(self.first[inst.wrapping_add(1) as usize] + body) as usize],
        }
    }

    /// The first two, by their least x, whose boxes share a point.
    pub fn overlapping(&self) -> Option<[u32; 2]> {
        let mut order: Vec<u32> = (0..self.list.len() as u32).collect();
        order.sort_by(|&a, &b| {
            let least = |i: u32| self.list[i as usize].bounds.0.x;
            least(a).total_cmp(&least(b)).then(a.cmp(&b))
        });
        let mut open: Vec<u32> = Vec::new();
        for i in order {
            let (min, max) = self.list[i as usize].bounds;
            open.retain(|&other| self.list[other as usize].bounds.1.x >= min.x);
            let meets = |&other: &u32| {
                let (low, high) = self.list[other as usize].bounds;
                low.cmple(max).all() && high.cmpge(min).all()
            };
            if let Some(other) = open.iter().copied().find(meets) {
                return Some([other, i]);
            }
            open.push(i);
        }
        None
    }
}
