//! Which meshes change their shape while the shutter is open, and where the records of their later shapes lie in
//! [`Geometry::later`](super::Geometry::later).

/// The shapes after the first of the meshes that have any.
#[derive(Clone, Debug, Default)]
pub struct Deforming {
    /// By mesh; shorter than the meshes, and empty where none changes its shape.
    of_mesh: Vec<Option<Keys>>,
    /// Number of the next record.
    records: usize,
}

/// Where the records of a mesh lie.
#[derive(Clone, Copy, Debug)]
pub(super) struct Keys {
    first: usize,
    triangles: usize,
    /// Parts that the shutter is cut into: as many as there are later shapes.
    pub(super) parts: usize,
}

impl Keys {
    /// The record of a triangle in a shape; 0 is the first later one.
    pub(super) fn record(&self, later: usize, prim: u32) -> usize {
        self.first + later * self.triangles + prim as usize
    }
}

impl Deforming {
    /// Whether every mesh keeps its shape.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.of_mesh.is_empty()
    }

    /// Those of mesh `mesh`, if it changes its shape.
    #[inline(always)]
    pub(super) fn of(&self, mesh: u32) -> Option<&Keys> {
        self.of_mesh.get(mesh as usize)?.as_ref()
    }

    /// Adds mesh `mesh`, above those before, with `parts` later shapes of so many records each.
    pub(super) fn push(&mut self, mesh: usize, parts: usize, triangles: usize) {
        if parts > 0 {
            self.of_mesh.resize(mesh, None);
            self.of_mesh.push(Some(Keys { first: self.records, triangles, parts }));
            self.records += parts * triangles;
        }
    }
}
