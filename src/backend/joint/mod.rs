//! A few large faces one after the other, then a hierarchy of what else there is, for the rays that come near it.
//!
//! Rooms are made of few walls and of things with many triangles. A hierarchy over both makes every ray pass the boxes
//! of the things on its way to the wall. Here sixteen rays first meet all walls as in [`flat`], without a branch; what
//! they meet ends them. Then they are tested against balls and boxes around the things (`cull.rs`); only those that
//! come near one are packed into blocks and traced by the other backend, in a hierarchy that has no walls.
//!
//! A hit is the nearer one of both; at equal distance the hierarchy's. Nothing depends on a ray's neighbours.

mod cull;
mod parts;
mod volumes;

use std::cell::RefCell;
use std::thread::LocalKey;

use self::cull::{Cull, Packed};
pub use self::parts::Limits;
use self::parts::Parts;
use self::volumes::Volumes;
use super::batch::{BLOCKED, Batch, INVALID_ID, LANES, RayBlock, RayHitBlock};
use super::bounds::{self, Bounds};
use super::flat::{self, Faces, Meets};
use super::obvhs::Obvhs;
use super::past::{Past, Without};
use super::triangle::RayByRay;
use super::{Backend, BackendInfo, BackendKind, BackendOptions, Coherence, Kept};
use crate::Result;
use crate::math::simd::{detect, dispatch};
use crate::scene::geometry::{Geometry, TriangleMesh};

/// Faces, and another backend for the rest.
pub struct Joint {
    info: BackendInfo,
    /// `None` where no faces are worth it: then everything is the other backend's.
    front: Option<Front>,
    rest: Obvhs,
}

struct Front {
    faces: Faces,
    volumes: Volumes,
    wide: bool,
}

/// A scene in two parts, before anything is built over the second: what there is to count.
pub(super) struct Halves {
    faces: Faces,
    volumes: Volumes,
    parts: Parts,
}

impl Halves {
    /// `None` where no faces are worth it, or nothing else is there.
    pub fn of(geometry: &Geometry, limits: &Limits) -> Option<Self> {
        let parts = Parts::of(geometry, limits).filter(|parts| !parts.bodies.is_empty())?;
        let (faces, volumes) = (Faces::new(&parts.faces), volumes(geometry, &parts, limits));
        Some(Halves { faces, volumes, parts })
    }

    /// Faces that every ray meets.
    pub fn faces(&self) -> usize {
        self.faces.count()
    }

    /// Volumes around the rest.
    pub fn volumes(&self) -> usize {
        self.volumes.count()
    }

    /// Whether a triangle of the world mesh belongs to a face.
    pub fn is_face(&self, prim: u32) -> bool {
        self.parts.is_face(prim)
    }

    /// The rays of `blocks`, by number, that still come near a volume, and where they end by then.
    pub fn left<B: Meets>(&self, blocks: &mut [B], len: usize) -> Vec<(usize, f32)> {
        let mut packed = Packed::new();
        let batch = Batch::new(blocks, len);
        // The same bits on every instruction set.
        let Halves { faces, volumes, .. } = self;
        dispatch::widest(false, Cull { faces, volumes, batch, packed: &mut packed, without: () });
        let end = |from: usize| packed.blocks[from / LANES].rays().tfar[from % LANES];
        packed.places().enumerate().map(|(from, to)| (to, end(from))).collect()
    }
}

/// What dividing a scene comes to, without counting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Division {
    /// Faces that every ray meets.
    pub faces: usize,
    /// Chance that a line through the scene comes near the rest: the ratio of the volumes' surfaces to its box's.
    pub near: f32,
}

/// Divides a scene to see what it comes to; `None` where no faces are worth it, or nothing else is there.
pub fn divide(geometry: &Geometry, limits: &Limits) -> Option<Division> {
    let scene = Bounds { lo: geometry.bounds.0, hi: geometry.bounds.1 };
    let parts = Parts::of(geometry, limits).filter(|parts| !parts.bodies.is_empty())?;
    let near = Volumes::new(&parts.bodies, limits.volumes, 1.0).half_area / scene.half_area();
    Some(Division { faces: flat::count(&parts.faces), near })
}

/// The volumes around the rest.
fn volumes(geometry: &Geometry, parts: &Parts, limits: &Limits) -> Volumes {
    let all = (0u32..).zip(&geometry.instances);
    let poses = all.flat_map(|(i, placement)| geometry.moving.steps(i).iter().chain([placement]));
    let stretch = poses.map(bounds::condition).fold(1.0, f64::max);
    Volumes::new(&parts.bodies, limits.volumes, stretch as f32)
}

impl Joint {
    /// Divides the geometry and prepares both parts.
    ///
    /// # Errors
    /// Those of [`Obvhs::build`].
    pub fn build(geometry: &Geometry, limits: &Limits, options: &BackendOptions) -> Result<Self> {
        Joint::build_after(geometry, limits, options, Kept::NOTHING)
    }

    /// [`build`](Self::build), taking over what [`Obvhs::build_after`] can.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    pub fn build_after(geometry: &Geometry, limits: &Limits, options: &BackendOptions, kept: Kept) -> Result<Self> {
        let kind = BackendKind::FlatObvhs;
        let Some(parts) = Parts::of(geometry, limits) else {
            let none = TriangleMesh::default();
            let rest = Obvhs::build_after(geometry, geometry.meshes.first().unwrap_or(&none), options, kept)?;
            return Ok(Joint { info: BackendInfo { kind, ..rest.info().clone() }, front: None, rest });
        };
        let rest = Obvhs::build_after(geometry, &parts.rest(&geometry.meshes[0]), options, kept)?;
        let faces = Faces::new(&parts.faces);
        let volumes = volumes(geometry, &parts, limits);
        let rest_info = rest.info().clone();
        let info = BackendInfo {
            kind,
            bvh_bytes: faces.bytes() + rest_info.bvh_bytes,
            triangles: faces.triangles() + rest_info.triangles,
            ..rest_info
        };
        let wide = detect::is_wide(options.isa.as_deref());
        Ok(Joint { info, front: Some(Front { faces, volumes, wide }), rest })
    }
}

impl Joint {
    fn trace<B: Divided>(&self, blocks: &mut [B], len: usize, without: impl Without) -> u64 {
        let Some(Front { faces, volumes, wide }) = &self.front else {
            return self.rest.trace(Batch::new(blocks, len), without);
        };
        B::packed().with_borrow_mut(|packed| {
            let batch = Batch::new(blocks, len);
            let invalid = dispatch::widest(*wide, Cull { faces, volumes, batch, packed, without });
            let mut passed = std::mem::take(&mut packed.passed);
            let rest_without = without.reordered(packed.places(), &mut passed);
            self.rest.trace(Batch::of_valid(&mut packed.blocks, packed.len), rest_without);
            packed.passed = passed;
            for (from, to) in packed.places().enumerate() {
                let (block, lane) = (&mut blocks[to / LANES], to % LANES);
                block.take(lane, &packed.blocks[from / LANES], from % LANES);
            }
            invalid
        })
    }
}

impl Backend for Joint {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn keep(self: Box<Self>) -> Kept {
        Kept::of(Box::new(self.rest))
    }

    fn closest_hit(&self, blocks: &mut [RayHitBlock], len: usize, _hint: Coherence) -> u64 {
        self.trace(blocks, len, ())
    }

    fn closest_hit_past(&self, blocks: &mut [RayHitBlock], len: usize, past: &Past) -> u64 {
        self.trace(blocks, len, past.lanes())
    }

    fn any_hit(&self, blocks: &mut [RayBlock], len: usize, _hint: Coherence) -> u64 {
        self.trace(blocks, len, ())
    }
}

/// A block whose rays are traced in two parts.
trait Divided: Meets + RayByRay + 'static {
    /// A thread's rays on their way to the hierarchy.
    fn packed() -> &'static LocalKey<RefCell<Packed<Self>>>;

    /// Puts what the hierarchy found for lane `from` of `found`, if anything, into lane `to`.
    fn take(&mut self, to: usize, found: &Self, from: usize);
}

impl Divided for RayHitBlock {
    fn packed() -> &'static LocalKey<RefCell<Packed<Self>>> {
        thread_local! {
            static PACKED: RefCell<Packed<RayHitBlock>> = const { RefCell::new(Packed::new()) };
        }
        &PACKED
    }

    #[inline(always)]
    fn take(&mut self, to: usize, found: &Self, from: usize) {
        if found.hit.geom[from] != INVALID_ID {
            self.ray.tfar[to] = found.ray.tfar[from];
            self.hit.u[to] = found.hit.u[from];
            self.hit.v[to] = found.hit.v[from];
            self.hit.prim[to] = found.hit.prim[from];
            self.hit.geom[to] = found.hit.geom[from];
            self.hit.inst[to] = found.hit.inst[from];
        }
    }
}

impl Divided for RayBlock {
    fn packed() -> &'static LocalKey<RefCell<Packed<Self>>> {
        thread_local! {
            static PACKED: RefCell<Packed<RayBlock>> = const { RefCell::new(Packed::new()) };
        }
        &PACKED
    }

    #[inline(always)]
    fn take(&mut self, to: usize, found: &Self, from: usize) {
        if found.tfar[from] == BLOCKED {
            self.tfar[to] = BLOCKED;
        }
    }
}

#[cfg(test)]
mod tests;
