//! Debian Embree (filled in by its owner).

use crate::backend::batch::{RayBlock, RayHitBlock};
use crate::backend::{Backend, BackendInfo, Coherence};
use crate::scene::geometry::Geometry;

/// The backend.
pub struct Embree;

impl Embree {
    /// Copies what it needs of the geometry.
    pub fn build(_geometry: &Geometry, _options: &crate::backend::BackendOptions) -> crate::Result<Self> {
        Ok(Embree)
    }
}

impl Backend for Embree {
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
