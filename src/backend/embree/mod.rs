//! Debian's Embree behind the [`Backend`] trait: 3.13 (Debian 12) and 4.x (Debian 13) from one source.
//!
//! Scenes are ROBUST unless asked otherwise; the default mode lost 0.5 % of random rays far from the origin. Rays are
//! validated before every call, because Debian's 3.13.5 aborts the process on a NaN. Source: the Embree API manual;
//! what was measured stands in ARCHITECTURE.md. Limit: for one instruction set and one query mode results repeat bit by
//! bit; another of either may round `t`, `u` and `v` differently.

mod abi;
mod device;
mod packet;
mod scene;
mod stream;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use self::abi::Query;
use self::device::Device;
use self::scene::World;
use super::batch::{LANES, RayBlock, RayHitBlock};
use super::{Backend, BackendInfo, BackendKind, BackendOptions, Coherence, QueryMode};
use crate::Result;
use crate::scene::geometry::Geometry;

/// Embree over one geometry.
pub struct Embree {
    world: World,
    incoherent: QueryMode,
    coherent: QueryMode,
    shadow: QueryMode,
    info: BackendInfo,
}

/// Triangles up to which a hierarchy of four children a node is faster than one of eight: there is little to skip in a tree of few
/// leaves. Embree 3.13.5, AVX-512: 36 triangles 5 to 8 % of the render; above 100 000 it is slower by 15 to 30 %.
const NARROW_TRIANGLES: usize = 256;

impl Embree {
    /// Opens a device and builds the hierarchy; copies what it needs of the geometry.
    ///
    /// # Errors
    /// [`Error::Backend`](crate::Error::Backend) when the instruction set is not there, memory runs out, or the
    /// geometry holds an index or transform that cannot be traced.
    pub fn build(geometry: &Geometry, options: &BackendOptions) -> Result<Self> {
        let device = Arc::new(Device::open(
            options.isa.as_deref(),
            options.build_threads,
            geometry.triangles.len() <= NARROW_TRIANGLES,
        )?);
        let world = World::build(&device, geometry, options.robust)?;
        let info = BackendInfo {
            kind: BackendKind::Embree,
            version: device.version(),
            isa: device.isa(options.isa.as_deref()),
            rays_incoherent: effective(options.incoherent),
            rays_coherent: effective(options.coherent),
            rays_shadow: effective(options.shadow),
            bvh_bytes: world.bvh_bytes,
            triangles: world.triangles,
        };
        let BackendOptions { incoherent, coherent, shadow, .. } = *options;
        Ok(Embree { world, incoherent, coherent, shadow, info })
    }
}

/// Name of what really runs when `mode` is asked for.
fn effective(mode: QueryMode) -> &'static str {
    if mode == QueryMode::Stream { stream::EFFECTIVE } else { mode.name() }
}

/// The blocks that hold the first `len` rays.
fn used<T>(blocks: &mut [T], len: usize) -> &mut [T] {
    let count = len.div_ceil(LANES);
    assert!(count <= blocks.len(), "{len} rays do not fit in {} blocks", blocks.len());
    &mut blocks[..count]
}

impl Backend for Embree {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn closest_hit(&self, blocks: &mut [RayHitBlock], len: usize, hint: Coherence) -> u64 {
        let (world, blocks) = (&self.world, used(blocks, len));
        let mode = match hint {
            Coherence::Coherent => self.coherent,
            Coherence::Incoherent => self.incoherent,
        };
        let query = &mut Query::new(hint);
        match mode {
            QueryMode::Single => packet::closest1(world, blocks, len, query),
            // SAFETY (both): the world's scene is committed and lives as long as `world`; active lanes are valid.
            QueryMode::Packet4 => packet::closest_narrow::<4>(world, blocks, len, |lanes, rays| unsafe {
                abi::intersect4(world.raw(), lanes, rays, query)
            }),
            QueryMode::Packet8 => packet::closest_narrow::<8>(world, blocks, len, |lanes, rays| unsafe {
                abi::intersect8(world.raw(), lanes, rays, query)
            }),
            QueryMode::Packet16 => packet::closest16(world, blocks, len, query),
            QueryMode::Stream => stream::closest(world, blocks, len, query),
        }
    }

    /// The hint is not passed on: packets of shadow rays ran at 0.7 of their rate with Embree's coherent flag, also
    /// those of camera hits towards one light.
    fn any_hit(&self, blocks: &mut [RayBlock], len: usize, _hint: Coherence) -> u64 {
        let (world, blocks) = (&self.world, used(blocks, len));
        let query = &mut Query::new(Coherence::Incoherent);
        match self.shadow {
            QueryMode::Single => packet::any1(world, blocks, len, query),
            // SAFETY (both): the world's scene is committed and lives as long as `world`; active lanes are valid.
            QueryMode::Packet4 => packet::any_narrow::<4>(world, blocks, len, |lanes, rays| unsafe {
                abi::occluded4(world.raw(), lanes, rays, query)
            }),
            QueryMode::Packet8 => packet::any_narrow::<8>(world, blocks, len, |lanes, rays| unsafe {
                abi::occluded8(world.raw(), lanes, rays, query)
            }),
            QueryMode::Packet16 => packet::any16(world, blocks, len, query),
            QueryMode::Stream => stream::any(world, blocks, len, query),
        }
    }
}
