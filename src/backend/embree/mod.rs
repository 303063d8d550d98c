//! Debian's Embree behind the [`Backend`] trait: 3.13 (Debian 12) and 4.x (Debian 13) from one source.
//!
//! Scenes are ROBUST unless asked otherwise; the default mode lost 0.5 % of random rays far from the origin. Rays are
//! validated before every call, because Debian's 3.13.5 aborts the process on a NaN. Source: the Embree API manual;
//! what was measured stands in benches/RESULTS.md. A lane's hit depends on its ray alone (`edges`). Limit: for one
//! instruction set and one query mode results repeat bit
//! by bit; another of either may round `t`, `u` and `v` differently.

mod abi;
mod device;
mod edges;
mod grazing;
mod packet;
mod scene;
mod stream;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use self::abi::{HAS_STREAMS, Query};
use self::device::Device;
use self::scene::World;
use super::batch::{Batch, LANES, RayBlock, RayHitBlock};
use super::past::Past;
use super::{Backend, BackendInfo, BackendKind, BackendOptions, Coherence, Kept, QueryMode};
use crate::Result;
use crate::scene::geometry::Geometry;

/// Embree over one geometry.
pub struct Embree {
    world: World,
    incoherent: QueryMode,
    coherent: QueryMode,
    shadow: QueryMode,
    /// Whether the scenes ask the filters of queries.
    passes: bool,
    info: BackendInfo,
    device: Opened,
}

/// What a device and its scenes were made with.
#[derive(PartialEq)]
struct Opened {
    isa: Option<String>,
    threads: usize,
    narrow: bool,
    robust: bool,
    passes: bool,
}

/// Triangles up to which a hierarchy of four children a node is faster than one of eight: there is little to skip in a
/// tree of few leaves. Embree 3.13.5, AVX-512: 36 triangles 5 to 8 % of the render; above 100 000 it is slower by 15 to
/// 30 %.
const NARROW_TRIANGLES: usize = 256;

impl Embree {
    /// Opens a device and builds the hierarchy; copies what it needs of the geometry.
    ///
    /// # Errors
    /// [`Error::Backend`](crate::Error::Backend) when the instruction set is not there, memory runs out, or the
    /// geometry holds an index or transform that cannot be traced.
    pub fn build(geometry: &Geometry, options: &BackendOptions) -> Result<Self> {
        Embree::build_after(geometry, options, None)
    }

    /// [`build`](Self::build), taking over from that of another frame what is the same: it has the bits of one that is
    /// built alone.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    pub fn build_after(geometry: &Geometry, options: &BackendOptions, kept: Option<Self>) -> Result<Self> {
        let BackendOptions { isa, build_threads: threads, robust, passes, .. } = options.clone();
        let opened = Opened { isa, threads, narrow: geometry.triangles.len() <= NARROW_TRIANGLES, robust, passes };
        let kept = kept.filter(|kept| kept.device == opened).map(|kept| kept.world);
        let device = match &kept {
            Some(world) => world.device().clone(),
            None => Arc::new(Device::open(opened.isa.as_deref(), threads, opened.narrow)?),
        };
        let world = World::build(&device, geometry, abi::scene_flags(robust, passes), kept)?;
        let info = BackendInfo {
            kind: BackendKind::Embree,
            version: device.version(),
            isa: device.isa(options.isa.as_deref()),
            rays_incoherent: effective(options.incoherent),
            rays_coherent: effective(options.coherent),
            rays_shadow: effective(options.shadow),
            bvh_bytes: world.bvh_bytes(),
            triangles: world.triangles,
        };
        let BackendOptions { incoherent, coherent, shadow, .. } = *options;
        Ok(Embree { world, incoherent, coherent, shadow, passes, info, device: opened })
    }
}

/// Name of the mode that really runs for `mode`.
fn effective(mode: QueryMode) -> &'static str {
    if mode == QueryMode::Stream { stream::EFFECTIVE } else { mode.name() }
}

/// Closest hits of the rays of a batch, block by block; the number of invalid rays.
#[inline(always)]
fn closest(world: &World, batch: Batch<RayHitBlock>, mut trace: impl FnMut(&mut RayHitBlock, u16)) -> u64 {
    batch.for_each(|block, valid| {
        World::settle(&mut block.ray);
        trace(block, valid);
        world.name_hits(block);
    })
}

/// Any hits of the rays of a batch, block by block; the number of invalid rays.
#[inline(always)]
fn any(batch: Batch<RayBlock>, mut trace: impl FnMut(&mut RayBlock, u16)) -> u64 {
    batch.for_each(|block, valid| {
        World::settle(block);
        trace(block, valid);
    })
}

impl Backend for Embree {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn keep(self: Box<Self>) -> Kept {
        Kept::of(self)
    }

    fn closest_hit(&self, blocks: &mut [RayHitBlock], len: usize, hint: Coherence) -> u64 {
        let world = &self.world;
        let mode = match hint {
            Coherence::Coherent => self.coherent,
            Coherence::Incoherent => self.incoherent,
        };
        let query = &mut Query::new(hint);
        let batch = world.batch(blocks, len);
        let ends = grazing::Ends::of(batch.blocks);
        let invalid = match mode {
            QueryMode::Single => closest(world, batch, |block, valid| packet::closest1(world, block, valid, query)),
            QueryMode::Packet4 => closest(world, batch, |block, valid| packet::closest4(world, block, valid, query)),
            QueryMode::Packet8 => closest(world, batch, |block, valid| packet::closest8(world, block, valid, query)),
            QueryMode::Stream if HAS_STREAMS => stream::closest(world, batch, query),
            QueryMode::Packet16 | QueryMode::Stream => {
                closest(world, batch, |block, valid| packet::closest16(world, block, valid, query))
            }
        };
        let traced = &mut blocks[..len.div_ceil(LANES)];
        if mode != QueryMode::Single {
            edges::mend(world, traced, &ends, query);
        }
        grazing::mend(world, traced, &ends, query);
        invalid
    }

    fn closest_hit_past(&self, blocks: &mut [RayHitBlock], len: usize, past: &Past) -> u64 {
        // Embree aborts the process over a filter that the scene was not told of.
        assert!(self.passes, "the backend was built for rays that end at what they hit");
        packet::closest_past(&self.world, self.world.batch(blocks, len), past.lanes())
    }

    /// The hint is not passed on: packets of shadow rays ran at 0.7 of their rate with Embree's coherent flag, also
    /// those of camera hits towards one light.
    fn any_hit(&self, blocks: &mut [RayBlock], len: usize, _hint: Coherence) -> u64 {
        let world = &self.world;
        let query = &mut Query::new(Coherence::Incoherent);
        let batch = world.batch(blocks, len);
        match self.shadow {
            QueryMode::Single => any(batch, |block, valid| packet::any1(world, block, valid, query)),
            QueryMode::Packet4 => any(batch, |block, valid| packet::any4(world, block, valid, query)),
            QueryMode::Packet8 => any(batch, |block, valid| packet::any8(world, block, valid, query)),
            QueryMode::Stream if HAS_STREAMS => stream::any(world, batch, query),
            QueryMode::Packet16 | QueryMode::Stream => {
                any(batch, |block, valid| packet::any16(world, block, valid, query))
            }
        }
    }
}
