//! Rays in blocks of 16 lanes, laid out exactly as Embree's 16-wide packets, so that tracing copies nothing.
//!
//! A [`RayBlock`] is byte for byte an `RTCRay16`, a [`RayHitBlock`] at least an `RTCRayHit16` (both of 3.13 and 4.x;
//! the layout is asserted in `backend::embree::abi`). Directions are unit vectors; `tnear ≤ t ≤ tfar` in metres.
//! [`Batch`] is how every backend walks over a call's blocks: lanes past its length are never traced; invalid rays
//! (NaN, infinite, out of range) are masked and come back as misses, counted. A backend that hands rays on to another
//! says that they are valid, so each is validated once.

use glam::Vec3;

pub use crate::math::lanes::LANES;

/// `tfar` of a ray that any-hit found blocked.
pub const BLOCKED: f32 = f32::NEG_INFINITY;

/// "No geometry" in [`HitBlock::geom`], "no instance" in [`HitBlock::inst`].
pub const INVALID_ID: u32 = u32::MAX;

/// Largest magnitude of an origin's coordinate that is traced (Embree aborts beyond 1.8·10¹⁸).
pub const MAX_COORDINATE: f32 = 1.0e18;

/// Sixteen rays, one column per field, in the order of `RTCRay16`.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct RayBlock {
    /// Origin.
    pub org_x: [f32; LANES],
    /// Origin.
    pub org_y: [f32; LANES],
    /// Origin.
    pub org_z: [f32; LANES],
    /// Start of the segment, ≥ 0.
    pub tnear: [f32; LANES],
    /// Unit direction.
    pub dir_x: [f32; LANES],
    /// Unit direction.
    pub dir_y: [f32; LANES],
    /// Unit direction.
    pub dir_z: [f32; LANES],
    /// Shutter time in [0, 1]; 0 in scenes at rest, read only by those that move.
    pub time: [f32; LANES],
    /// End of the segment; the hit distance after `closest_hit`, [`BLOCKED`] after a positive `any_hit`.
    pub tfar: [f32; LANES],
    /// Embree's ray mask; all ones.
    pub mask: [u32; LANES],
    /// Embree's ray id; unused.
    pub id: [u32; LANES],
    /// Embree's ray flags; 0.
    pub flags: [u32; LANES],
}

/// Sixteen hits, one column per field, in the order of `RTCHit16`.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct HitBlock {
    /// Unnormalised geometric normal of the hit triangle in object space; backends other than Embree may leave it 0.
    pub ng_x: [f32; LANES],
    /// See `ng_x`.
    pub ng_y: [f32; LANES],
    /// See `ng_x`.
    pub ng_z: [f32; LANES],
    /// Barycentric weight of the second vertex.
    pub u: [f32; LANES],
    /// Barycentric weight of the third vertex.
    pub v: [f32; LANES],
    /// Triangle within its mesh.
    pub prim: [u32; LANES],
    /// Mesh (index into `Geometry::meshes`), or [`INVALID_ID`] for a miss.
    pub geom: [u32; LANES],
    /// Instance (index into `Geometry::instances`), or [`INVALID_ID`] when the mesh lies in the world directly.
    pub inst: [u32; LANES],
    /// Embree 4.4's instance-primitive column; written by nobody here.
    pub inst_prim: [u32; LANES],
}

/// Rays and their closest hits, `RTCRayHit16`.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct RayHitBlock {
    /// The rays.
    pub ray: RayBlock,
    /// The hits; only read after `closest_hit`.
    pub hit: HitBlock,
}

impl RayBlock {
    /// Sixteen rays that hit nothing (`tfar < tnear`).
    pub const EMPTY: RayBlock = RayBlock {
        org_x: [0.0; LANES],
        org_y: [0.0; LANES],
        org_z: [0.0; LANES],
        tnear: [0.0; LANES],
        dir_x: [0.0; LANES],
        dir_y: [0.0; LANES],
        dir_z: [1.0; LANES],
        time: [0.0; LANES],
        tfar: [-1.0; LANES],
        mask: [u32::MAX; LANES],
        id: [0; LANES],
        flags: [0; LANES],
    };

    /// Writes one lane. `dir` must be a unit vector; `tnear` is 0.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, org: Vec3, dir: Vec3, tfar: f32) {
        self.org_x[lane] = org.x;
        self.org_y[lane] = org.y;
        self.org_z[lane] = org.z;
        self.tnear[lane] = 0.0;
        self.dir_x[lane] = dir.x;
        self.dir_y[lane] = dir.y;
        self.dir_z[lane] = dir.z;
        self.tfar[lane] = tfar;
    }

    /// Origin of one lane.
    #[inline(always)]
    pub fn org(&self, lane: usize) -> Vec3 {
        Vec3::new(self.org_x[lane], self.org_y[lane], self.org_z[lane])
    }

    /// Direction of one lane.
    #[inline(always)]
    pub fn dir(&self, lane: usize) -> Vec3 {
        Vec3::new(self.dir_x[lane], self.dir_y[lane], self.dir_z[lane])
    }
}

impl RayHitBlock {
    /// Empty rays, no hits.
    pub const EMPTY: RayHitBlock = RayHitBlock {
        ray: RayBlock::EMPTY,
        hit: HitBlock {
            ng_x: [0.0; LANES],
            ng_y: [0.0; LANES],
            ng_z: [0.0; LANES],
            u: [0.0; LANES],
            v: [0.0; LANES],
            prim: [INVALID_ID; LANES],
            geom: [INVALID_ID; LANES],
            inst: [INVALID_ID; LANES],
            inst_prim: [INVALID_ID; LANES],
        },
    };

    /// The hit of one lane, if there is one.
    #[inline(always)]
    pub fn hit(&self, lane: usize) -> Option<Hit> {
        (self.hit.geom[lane] != INVALID_ID).then(|| self.hit_unchecked(lane))
    }

    /// Writes what the ray of a lane hits.
    #[inline(always)]
    pub(crate) fn set_hit(&mut self, lane: usize, hit: &Hit) {
        self.ray.tfar[lane] = hit.t;
        self.hit.u[lane] = hit.u;
        self.hit.v[lane] = hit.v;
        self.hit.prim[lane] = hit.prim;
        self.hit.geom[lane] = hit.geom;
        self.hit.inst[lane] = hit.inst;
    }

    /// The hit columns of one lane that is known to have hit.
    #[inline(always)]
    pub fn hit_unchecked(&self, lane: usize) -> Hit {
        Hit {
            t: self.ray.tfar[lane],
            u: self.hit.u[lane],
            v: self.hit.v[lane],
            prim: self.hit.prim[lane],
            geom: self.hit.geom[lane],
            inst: self.hit.inst[lane],
            time: self.ray.time[lane],
        }
    }
}

/// A block that is traced: [`RayHitBlock`] for closest hits, [`RayBlock`] for any hit.
pub trait Block: Copy {
    /// Rays that hit nothing.
    const EMPTY: Self;

    /// Its rays.
    fn rays(&self) -> &RayBlock;

    /// Its rays.
    fn rays_mut(&mut self) -> &mut RayBlock;

    /// Marks every lane as a miss.
    fn clear(&mut self);
}

impl Block for RayHitBlock {
    const EMPTY: Self = RayHitBlock::EMPTY;

    #[inline(always)]
    fn rays(&self) -> &RayBlock {
        &self.ray
    }

    #[inline(always)]
    fn rays_mut(&mut self) -> &mut RayBlock {
        &mut self.ray
    }

    #[inline(always)]
    fn clear(&mut self) {
        self.hit.geom = [INVALID_ID; LANES];
        self.hit.inst = [INVALID_ID; LANES];
    }
}

impl Block for RayBlock {
    const EMPTY: Self = RayBlock::EMPTY;

    #[inline(always)]
    fn rays(&self) -> &RayBlock {
        self
    }

    #[inline(always)]
    fn rays_mut(&mut self) -> &mut RayBlock {
        self
    }

    /// `tfar` says whether a ray is blocked.
    #[inline(always)]
    fn clear(&mut self) {}
}

/// The rays of one call to a backend. The only walk over blocks: validates rays, counts those that are not valid, marks
/// every lane as a miss.
pub struct Batch<'b, B> {
    /// The blocks that hold the rays.
    pub blocks: &'b mut [B],
    len: usize,
    next: usize,
    /// Largest magnitude of an origin's coordinate that is traced.
    max_coordinate: f32,
    /// Whether all rays are known to be valid.
    is_valid: bool,
    invalid: u64,
}

impl<'b, B: Block> Batch<'b, B> {
    /// The first `len` rays of `blocks`.
    ///
    /// # Panics
    /// If the blocks do not hold as many.
    #[inline(always)]
    pub fn new(blocks: &'b mut [B], len: usize) -> Self {
        let count = len.div_ceil(LANES);
        assert!(count <= blocks.len(), "{len} rays do not fit in {} blocks", blocks.len());
        let blocks = &mut blocks[..count];
        Batch { blocks, len, next: 0, max_coordinate: MAX_COORDINATE, is_valid: false, invalid: 0 }
    }

    /// The first `len` rays of `blocks`, which another batch found valid.
    #[inline(always)]
    pub fn of_valid(blocks: &'b mut [B], len: usize) -> Self {
        Batch { is_valid: true, ..Batch::new(blocks, len) }
    }

    /// Refuses origins with a coordinate beyond `max_coordinate`.
    pub fn within(self, max_coordinate: f32) -> Self {
        Batch { max_coordinate, ..self }
    }

    /// The next block, its number and which of its lanes are to be traced.
    #[inline(always)]
    pub fn next_block(&mut self) -> Option<(usize, &mut B, u16)> {
        let (index, first) = (self.next, self.next * LANES);
        if first >= self.len {
            return None;
        }
        self.next += 1;
        let block = &mut self.blocks[index];
        let lanes = first_lanes(self.len - first);
        let valid = if self.is_valid { lanes } else { lanes & valid_within(block.rays(), self.max_coordinate) };
        self.invalid += u64::from((lanes ^ valid).count_ones());
        block.clear();
        Some((index, block, valid))
    }

    /// Calls `kernel` with every block and its lanes that are to be traced; returns the number of invalid rays.
    #[inline(always)]
    pub fn for_each(mut self, mut kernel: impl FnMut(&mut B, u16)) -> u64 {
        while let Some((_, block, valid)) = self.next_block() {
            kernel(block, valid);
        }
        self.invalid
    }

    /// Rays so far that are not valid.
    #[inline(always)]
    pub fn invalid(&self) -> u64 {
        self.invalid
    }
}

/// The mask of the first `lanes` lanes, all of them if there are more.
#[inline(always)]
fn first_lanes(lanes: usize) -> u16 {
    if lanes >= LANES { u16::MAX } else { (1 << lanes) - 1 }
}

/// One hit as numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray, metres.
    pub t: f32,
    /// Barycentric weight of the second vertex.
    pub u: f32,
    /// Barycentric weight of the third vertex.
    pub v: f32,
    /// Triangle within its mesh.
    pub prim: u32,
    /// Mesh.
    pub geom: u32,
    /// Instance or [`INVALID_ID`].
    pub inst: u32,
    /// Shutter time of the ray, in [0, 1]: where instances that move were then.
    pub time: f32,
}

/// Which of the first `lanes` lanes hold a ray that may be traced, as a bit mask: every component finite and within
/// [`MAX_COORDINATE`], a direction that is not zero, `0 ≤ tnear ≤ tfar` (tfar may be +∞).
#[inline(always)]
pub fn valid_lanes(ray: &RayBlock, lanes: usize) -> u16 {
    first_lanes(lanes) & valid_within(ray, MAX_COORDINATE)
}

/// The lanes with a valid ray that starts within `max_coordinate`. The comparisons are written so that NaN fails them;
/// the loop is branch-free and vectorises.
#[inline(always)]
fn valid_within(ray: &RayBlock, max_coordinate: f32) -> u16 {
    let mut ok = [0u32; LANES];
    for i in 0..LANES {
        let org = ray.org_x[i].abs().max(ray.org_y[i].abs()).max(ray.org_z[i].abs());
        // `max` drops NaN, a sum keeps it. Against the largest number, not against ∞: that becomes "ordered and not
        // equal" (NEQ_OQ), which valgrind 3.19 takes for true of NaN.
        let sum = ray.org_x[i] + ray.org_y[i] + ray.org_z[i] + ray.dir_x[i] + ray.dir_y[i] + ray.dir_z[i];
        let dir2 = ray.dir_x[i] * ray.dir_x[i] + ray.dir_y[i] * ray.dir_y[i] + ray.dir_z[i] * ray.dir_z[i];
        let good = (org <= max_coordinate)
            & (sum.abs() <= f32::MAX)
            & (dir2 > 0.25)
            & (dir2 < 4.0)
            & (ray.tnear[i] >= 0.0)
            & (ray.tnear[i] <= ray.tfar[i]);
        ok[i] = good as u32;
    }
    let mut mask = 0u16;
    for (i, &bit) in ok.iter().enumerate() {
        mask |= (bit as u16) << i;
    }
    mask
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: the contract. 20 rays in three blocks, of which one is NaN and one starts too far away; lanes behind the
    /// twentieth are no rays, the third block is not touched.
    #[test]
    fn batches_mask_and_count_what_is_not_valid() {
        let mut blocks = [RayHitBlock::EMPTY; 3];
        for block in &mut blocks {
            for lane in 0..LANES {
                block.ray.set(lane, Vec3::ONE, Vec3::Y, 1.0);
            }
            block.hit.geom = [7; LANES];
        }
        blocks[0].ray.dir_x[3] = f32::NAN;
        blocks[1].ray.org_z[1] = 1e9;
        let masks = |batch: Batch<RayHitBlock>| {
            let mut masks = Vec::new();
            let invalid = batch.for_each(|block, valid| {
                assert_eq!(block.hit.geom, [INVALID_ID; LANES]);
                masks.push(valid);
            });
            (masks, invalid)
        };
        assert_eq!(masks(Batch::new(&mut blocks, 20)), (vec![!(1 << 3), 0b1111], 1));
        assert_eq!(masks(Batch::new(&mut blocks, 20).within(1e6)), (vec![!(1 << 3), 0b1101], 2));
        assert_eq!(masks(Batch::of_valid(&mut blocks, 32)), (vec![u16::MAX; 2], 0));
        assert_eq!(masks(Batch::new(&mut blocks, 0)), (vec![], 0));
        assert_eq!(blocks[2].hit.geom, [7; LANES]);
    }
}
