//! Every ray against every triangle: the oracle (filled in by its owner).

use super::batch::{RayBlock, RayHitBlock};
use super::{Backend, BackendInfo, Coherence};
use crate::scene::geometry::Geometry;

/// The oracle.
pub struct Brute;

impl Brute {
    /// Copies what it needs of the geometry.
    pub fn build(_geometry: &Geometry) -> Self {
        Brute
    }
}

impl Backend for Brute {
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
