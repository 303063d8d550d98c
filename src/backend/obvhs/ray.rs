//! What the traversal reads of a ray, a cache line each: the slab test's numbers and the triangle test's, made for
//! sixteen rays at a time.

use glam::Vec3;

use crate::backend::batch::{LANES, RayBlock};
use crate::backend::triangle::Ray;

/// A direction component below this fraction of the largest one counts as the fraction: its inverse stays finite in
/// every product, and over any distance the ray is beside itself by 2⁻⁶⁰ of it, less than boxes are grown up to
/// 4·10¹¹ diagonals of the scene. Limit: from farther away rays along an axis may be lost.
const STEEPEST: f32 = 1.0 / (1u64 << 60) as f32;

/// One ray, prepared. The fields of the triangle test are those of `triangle::RayShear`, with the same bits.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Record {
    /// Origin.
    pub org: [f32; 3],
    /// Start of the segment.
    pub tnear: f32,
    /// Inverse direction, finite and not 0.
    pub inverse: [f32; 3],
    /// End of the segment.
    pub tfar: f32,
    /// Origin along the axes `kx`, `ky`, `kz` of the triangle test.
    pub sheared_org: [f32; 3],
    /// `dir[kx]/dir[kz]`.
    pub sx: f32,
    /// `dir[ky]/dir[kz]`.
    pub sy: f32,
    /// `dir[kz]`.
    pub dz: f32,
    /// Axes: `kx | ky << 2 | kz << 4`.
    axes: u32,
    /// Bit a: the direction is negative along axis a.
    pub octant: u32,
}

impl Record {
    pub const EMPTY: Record = Record {
        org: [0.0; 3],
        tnear: 0.0,
        inverse: [1.0; 3],
        tfar: 0.0,
        sheared_org: [0.0; 3],
        sx: 0.0,
        sy: 0.0,
        dz: 1.0,
        axes: 0,
        octant: 0,
    };

    /// Prepares one ray.
    pub fn of(ray: &Ray) -> Self {
        let column = |v: Vec3| v.to_array().map(|x| [x]);
        let mut record = [Record::EMPTY];
        prepare(&column(ray.org), &column(ray.dir), &[ray.tnear], &[ray.tfar], &mut record);
        record[0]
    }

    /// Prepares the rays of a block; lanes without a valid ray have any value.
    #[inline(always)]
    pub fn of_block(rays: &RayBlock, records: &mut [Record; LANES]) {
        let org = [rays.org_x, rays.org_y, rays.org_z];
        // Without the sign of zero components: ±0.0 must choose the same planes and axes.
        let mut dir = [rays.dir_x, rays.dir_y, rays.dir_z];
        for i in 0..LANES {
            for a in 0..3 {
                dir[a][i] += 0.0;
            }
        }
        prepare(&org, &dir, &rays.tnear, &rays.tfar, records);
    }

    /// The axes `kx`, `ky`, `kz` of the triangle test.
    #[inline(always)]
    pub fn axes(&self) -> [usize; 3] {
        // Below 3 by construction; the mask saves the compiler's question.
        [self.axes & 3, self.axes >> 2 & 3, self.axes >> 4 & 3].map(|axis| axis as usize)
    }
}

/// Loops over lanes without branches.
#[inline(always)]
fn prepare<const N: usize>(
    org: &[[f32; N]; 3],
    dir: &[[f32; N]; 3],
    tnear: &[f32; N],
    tfar: &[f32; N],
    records: &mut [Record; N],
) {
    let (mut inverse, mut sheared) = ([[0.0; N]; 3], [[0.0; N]; 3]);
    let (mut sx, mut sy, mut dz) = ([0.0; N], [0.0; N], [0.0; N]);
    let (mut axes, mut octant) = ([0u32; N], [0u32; N]);
    for i in 0..N {
        let [x, y, z] = [dir[0][i], dir[1][i], dir[2][i]];
        let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
        let least = ax.max(ay).max(az) * STEEPEST;
        for a in 0..3 {
            let d = dir[a][i];
            let steep = if d.abs() >= least { d } else { least.copysign(d) };
            inverse[a][i] = 1.0 / steep;
            octant[i] |= u32::from(steep < 0.0) << a;
        }
        // Equal components: the first axis wins.
        let along_x = (ax >= ay) & (ax >= az);
        let along_y = !along_x & (ay >= az);
        let pick = |v: [f32; 3]| {
            if along_x {
                v[0]
            } else if along_y {
                v[1]
            } else {
                v[2]
            }
        };
        let (d, o) = ([x, y, z], [org[0][i], org[1][i], org[2][i]]);
        let next = |v: [f32; 3]| [v[1], v[2], v[0]];
        let (z_dir, z_org) = (pick(d), pick(o));
        let (x_dir, x_org) = (pick(next(d)), pick(next(o)));
        let (y_dir, y_org) = (pick(next(next(d))), pick(next(next(o))));
        // The winding is kept.
        let back = z_dir < 0.0;
        let swap = |a: f32, b: f32| if back { b } else { a };
        sx[i] = swap(x_dir, y_dir) / z_dir;
        sy[i] = swap(y_dir, x_dir) / z_dir;
        dz[i] = z_dir;
        sheared[0][i] = swap(x_org, y_org);
        sheared[1][i] = swap(y_org, x_org);
        sheared[2][i] = z_org;
        let forward = if along_x {
            AXES[0]
        } else if along_y {
            AXES[1]
        } else {
            AXES[2]
        };
        let backward = if along_x {
            AXES[3]
        } else if along_y {
            AXES[4]
        } else {
            AXES[5]
        };
        axes[i] = if back { backward } else { forward };
    }
    for i in 0..N {
        records[i] = Record {
            org: [org[0][i], org[1][i], org[2][i]],
            tnear: tnear[i],
            inverse: [inverse[0][i], inverse[1][i], inverse[2][i]],
            tfar: tfar[i],
            sheared_org: [sheared[0][i], sheared[1][i], sheared[2][i]],
            sx: sx[i],
            sy: sy[i],
            dz: dz[i],
            axes: axes[i],
            octant: octant[i],
        };
    }
}

/// `kx | ky << 2 | kz << 4` for kz = x, y, z, then with kx and ky exchanged.
const AXES: [u32; 6] = {
    const fn packed(kx: u32, ky: u32, kz: u32) -> u32 {
        kx | ky << 2 | kz << 4
    }
    [packed(1, 2, 0), packed(2, 0, 1), packed(0, 1, 2), packed(2, 1, 0), packed(0, 2, 1), packed(1, 0, 2)]
};
