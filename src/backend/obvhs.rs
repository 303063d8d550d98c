//! A BVH by the obvhs crate (filled in by its owner).

use super::batch::{RayBlock, RayHitBlock};
use super::{Backend, BackendInfo, Coherence};
use crate::scene::geometry::Geometry;

/// The backend.
pub struct Obvhs;

impl Obvhs {
    /// Copies what it needs of the geometry.
    pub fn build(_geometry: &Geometry, _options: &super::BackendOptions) -> crate::Result<Self> {
        Ok(Obvhs)
    }
}

impl Backend for Obvhs {
    fn info(&self) -> &BackendInfo {
        unimplemented!("filled in by its owner")
    }
    fn closest_hit(&self, _blocks: &mut [RayHitBlock], _len: usize, _hint: Coherence) -> u64 {
        unimplemented!("filled in by its owner")
    }
    fn any_hit(&self, _blocks: &mut [RayBlock], _len: usize, _hint: Coherence) -> u64 {
        unimplemented!("filled in by its owner")
    }
}
