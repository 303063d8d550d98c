//! Rays in blocks of 16 lanes, laid out exactly as Embree's 16-wide packets, so that tracing copies nothing.
//!
//! A [`RayBlock`] is byte for byte an `RTCRay16`, a [`RayHitBlock`] at least an `RTCRayHit16` (both of 3.13 and 4.x; the
//! layout is asserted in `backend::embree::abi`). Directions are unit vectors; `tnear ≤ t ≤ tfar` in metres.
//! Lanes past the batch's length are never traced; invalid rays (NaN, infinite, out of range) are masked by
//! [`valid_lanes`] before any backend sees them and come back as misses, counted.

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

    /// Marks every lane as a miss; backends call it before they trace the block.
    #[inline(always)]
    pub fn clear_hits(&mut self) {
        self.hit.geom = [INVALID_ID; LANES];
        self.hit.inst = [INVALID_ID; LANES];
    }

    /// The hit of one lane, if there is one.
    #[inline(always)]
    pub fn hit(&self, lane: usize) -> Option<Hit> {
        (self.hit.geom[lane] != INVALID_ID).then(|| self.hit_unchecked(lane))
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
///
/// The comparisons are written so that NaN fails them; the loop is branch-free and vectorises.
#[inline(always)]
pub fn valid_lanes(ray: &RayBlock, lanes: usize) -> u16 {
    let mut ok = [0u32; LANES];
    for i in 0..LANES {
        let org = ray.org_x[i].abs().max(ray.org_y[i].abs()).max(ray.org_z[i].abs());
        // `max` drops NaN, a sum keeps it.
        let sum = ray.org_x[i] + ray.org_y[i] + ray.org_z[i] + ray.dir_x[i] + ray.dir_y[i] + ray.dir_z[i];
        let dir2 = ray.dir_x[i] * ray.dir_x[i] + ray.dir_y[i] * ray.dir_y[i] + ray.dir_z[i] * ray.dir_z[i];
        let good = (org <= MAX_COORDINATE)
            & (sum.abs() < f32::INFINITY)
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
    if lanes >= LANES { mask } else { mask & ((1u16 << lanes) - 1) }
}
