//! A few large faces one after the other, then a hierarchy of what else there is, for the rays that come near it.
//!
//! Rooms are made of few walls and of things with many triangles. A hierarchy over both makes every ray pass the boxes of the
//! things on its way to the wall. Here sixteen rays first meet all walls as in [`flat`], without a branch; what they
//! meet ends them. Then they are held against balls and boxes around the things; only those that come near one are packed
//! into blocks of their own and traced by the other backend, in a hierarchy that has no walls.
//!
//! A hit is the nearer one of both; at equal distance the hierarchy's. Nothing depends on a ray's neighbours.

mod parts;
mod sieve;
mod volumes;

use std::cell::RefCell;
use std::ops::RangeInclusive;

use self::parts::{FACE, Parts};
use self::sieve::{Packed, Sieve};
use self::volumes::Volumes;
use super::batch::{BLOCKED, INVALID_ID, LANES, RayBlock, RayHitBlock};
use super::bounds::{self, Bounds};
use super::flat::{self, Flat};
use super::obvhs::Obvhs;
use super::{Backend, BackendInfo, BackendKind, BackendOptions, Coherence};
use crate::Result;
use crate::math::isa;
use crate::scene::geometry::{Geometry, TriangleMesh};

/// Largest cost of a ray, over that in a hierarchy of all, with which this is faster: what the faces take, and the chance that a line
/// through the scene comes near a volume (the ratio of their surfaces).
const MOST: f32 = 0.6;

/// Triangles of all meshes together with which this is taken where there is Embree. With fewer, Embree is as fast (veach-mis, 1292
/// triangles: 0.97); with more, building takes seconds longer (2 µs a triangle, against 0.5).
pub const TRIANGLES: RangeInclusive<usize> = 1 << 14..=1 << 20;

/// Faces, and another backend for the rest.
pub struct Joint {
    info: BackendInfo,
    /// `None` where no faces are worth it: then everything is the other backend's.
    front: Option<Front>,
    rest: Obvhs,
}

struct Front {
    flat: Flat,
    volumes: Volumes,
    wide: bool,
}

thread_local! {
    /// Rays on their way to the hierarchy.
    static CLOSEST: RefCell<Packed<RayHitBlock>> = const { RefCell::new(Packed::new()) };
    static ANY: RefCell<Packed<RayBlock>> = const { RefCell::new(Packed::new()) };
}

/// Whether this is faster than a hierarchy of all.
pub fn suits(geometry: &Geometry) -> bool {
    let scene = Bounds { lo: geometry.bounds.0, hi: geometry.bounds.1 };
    let cost = |parts: Parts| {
        let near = Volumes::new(&parts.bodies, 1.0).half_area / scene.half_area();
        FACE * flat::count(&parts.faces) as f32 + near
    };
    Parts::of(geometry).is_some_and(|parts| !parts.bodies.is_empty() && cost(parts) <= MOST)
}

impl Joint {
    /// Divides the geometry and prepares both parts.
    ///
    /// # Errors
    /// Those of [`Obvhs::build`].
    pub fn build(geometry: &Geometry, options: &BackendOptions) -> Result<Self> {
        let kind = BackendKind::FlatObvhs;
        let Some(parts) = Parts::of(geometry) else {
            let none = TriangleMesh::default();
            let rest = Obvhs::build(geometry, geometry.meshes.first().unwrap_or(&none), options)?;
            return Ok(Joint { info: BackendInfo { kind, ..rest.info().clone() }, front: None, rest });
        };
        let rest = Obvhs::build(geometry, &parts.rest(&geometry.meshes[0]), options)?;
        let flat = Flat::over(&parts.faces, options);
        let all = (0u32..).zip(&geometry.instances);
        let poses = all.flat_map(|(i, placement)| geometry.moving.steps(i).iter().chain([placement]));
        let stretch = poses.map(bounds::condition).fold(1.0, f64::max);
        let volumes = Volumes::new(&parts.bodies, stretch as f32);
        let (few, many) = (flat.info(), rest.info().clone());
        let info = BackendInfo {
            kind,
            bvh_bytes: few.bvh_bytes + many.bvh_bytes,
            triangles: few.triangles + many.triangles,
            ..many
        };
        let wide = isa::has_avx512() && options.isa.as_deref().is_none_or(|isa| isa == "avx512");
        Ok(Joint { info, front: Some(Front { flat, volumes, wide }), rest })
    }
}

impl Backend for Joint {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn closest_hit(&self, blocks: &mut [RayHitBlock], len: usize, hint: Coherence) -> u64 {
        let Some(Front { flat, volumes, wide }) = &self.front else {
            return self.rest.closest_hit(blocks, len, hint);
        };
        let invalid = flat.closest_hit(blocks, len, hint);
        CLOSEST.with_borrow_mut(|packed| {
            let blocks = &mut blocks[..len.div_ceil(LANES)];
            isa::widest(*wide, Sieve { volumes, blocks, len, packed });
            let refused = self.rest.closest_hit(&mut packed.blocks, packed.len, hint);
            for (from, to) in packed.places().enumerate() {
                let (found, from) = (&packed.blocks[from / LANES], from % LANES);
                if found.hit.geom[from] != INVALID_ID {
                    take(found, from, &mut blocks[to / LANES], to % LANES);
                }
            }
            invalid + refused
        })
    }

    fn any_hit(&self, blocks: &mut [RayBlock], len: usize, hint: Coherence) -> u64 {
        let Some(Front { flat, volumes, wide }) = &self.front else {
            return self.rest.any_hit(blocks, len, hint);
        };
        let invalid = flat.any_hit(blocks, len, hint);
        ANY.with_borrow_mut(|packed| {
            let blocks = &mut blocks[..len.div_ceil(LANES)];
            isa::widest(*wide, Sieve { volumes, blocks, len, packed });
            let refused = self.rest.any_hit(&mut packed.blocks, packed.len, hint);
            for (from, to) in packed.places().enumerate() {
                if packed.blocks[from / LANES].tfar[from % LANES] == BLOCKED {
                    blocks[to / LANES].tfar[to % LANES] = BLOCKED;
                }
            }
            invalid + refused
        })
    }
}

/// Puts the hit of one lane into another.
#[inline(always)]
fn take(found: &RayHitBlock, from: usize, block: &mut RayHitBlock, to: usize) {
    block.ray.tfar[to] = found.ray.tfar[from];
    block.hit.u[to] = found.hit.u[from];
    block.hit.v[to] = found.hit.v[from];
    block.hit.prim[to] = found.hit.prim[from];
    block.hit.geom[to] = found.hit.geom[from];
    block.hit.inst[to] = found.hit.inst[from];
}

#[cfg(test)]
mod tests;
