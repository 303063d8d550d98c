//! Surface points of sixteen lanes.

use glam::Vec3;

use crate::backend::batch::{INVALID_ID, LANES, RayHitBlock};
use crate::math::columns::{Lane, Lane3, ZERO3, get, set};
use crate::math::simd::isa::Isa;
use crate::scene::geometry::{Geometry, NO_ATTRIBUTES};
use crate::shading::interaction::{self, Interaction};

/// [`Interaction`] in columns.
#[repr(C, align(64))]
pub struct Points {
    /// World position.
    pub p: Lane3,
    /// Bound of the distance between `p` and the true hit, metres.
    pub error: Lane,
    /// Unit geometric normal of the front side.
    pub n_g: Lane3,
    /// Unit interpolated normal of the front side.
    pub n_s: Lane3,
    /// Index into `Scene::materials`.
    pub material: [u32; LANES],
    /// Light that the triangle is, or `u32::MAX`.
    pub light: [u32; LANES],
}

impl Points {
    /// Looks the hits of the lanes in `lanes` (not empty) up; the other lanes repeat one of them. Triangles of the
    /// world mesh are computed in columns, with the numbers of [`Interaction::at`]. `smooth` and `instanced` say what
    /// may be among them; instanced lanes are replaced one by one.
    #[inline(always)]
    pub fn gather<I: Isa>(geometry: &Geometry, rays: &RayHitBlock, lanes: u16, smooth: bool, instanced: bool) -> Self {
        let lead = lanes.trailing_zeros() as usize % LANES;
        let rows = std::array::from_fn(|i| {
            let lane = if lanes >> i & 1 == 1 { i } else { lead };
            let triangle = geometry.triangle(rays.hit.geom[lane], rays.hit.prim[lane]);
            bytemuck::cast_ref(triangle)
        });
        // In the order of the fields of `Triangle`.
        let [x0, y0, z0, x1, y1, z1, x2, y2, z2, nx, ny, nz, material, attributes, error, light] = I::transpose(rows);
        let (v0, e1, e2) = ([x0, y0, z0], [x1, y1, z1], [x2, y2, z2]);
        let mut p = ZERO3;
        for axis in 0..3 {
            for i in 0..LANES {
                // `float::hit_point`.
                p[axis][i] = v0[axis][i] + (e1[axis][i] * rays.hit.u[i] + e2[axis][i] * rays.hit.v[i]);
            }
        }
        let n_g = [nx, ny, nz];
        let (material, light) = (bytemuck::cast(material), bytemuck::cast(light));
        let mut points = Points { p, error, n_g, n_s: n_g, material, light };
        if smooth {
            points.interpolate_normals(geometry, rays, &bytemuck::cast(attributes));
        }
        if instanced {
            for i in 0..LANES {
                if rays.hit.inst[i] != INVALID_ID && lanes >> i & 1 == 1 {
                    points.replace(i, &Interaction::at(geometry, &rays.hit_unchecked(i), smooth));
                }
            }
        }
        points
    }

    /// As [`Interaction::at`] does: a triangle whose corners repeat its own normal keeps it to the bit.
    #[inline(always)]
    fn interpolate_normals(&mut self, geometry: &Geometry, rays: &RayHitBlock, attributes: &[u32; LANES]) {
        let mut corners = [self.n_g; 3];
        for i in 0..LANES {
            if attributes[i] != NO_ATTRIBUTES {
                for (corner, normal) in corners.iter_mut().zip(geometry.normals[attributes[i] as usize]) {
                    set(corner, i, normal);
                }
            }
        }
        for i in 0..LANES {
            let [a, b, c] = [get(&corners[0], i), get(&corners[1], i), get(&corners[2], i)];
            let n_g = get(&self.n_g, i);
            let n = interaction::interpolate(a, b, c, rays.hit.u[i], rays.hit.v[i]);
            let length2 = n.length_squared();
            let same = |v: Vec3| (v.x == n_g.x) & (v.y == n_g.y) & (v.z == n_g.z);
            let keep = (same(a) & same(b) & same(c)) | !((length2 > f32::MIN_POSITIVE) & (length2 < f32::INFINITY));
            let unit = n * (1.0 / length2.sqrt());
            self.n_s[0][i] = if keep { n_g.x } else { unit.x };
            self.n_s[1][i] = if keep { n_g.y } else { unit.y };
            self.n_s[2][i] = if keep { n_g.z } else { unit.z };
        }
    }

    #[inline(always)]
    fn replace(&mut self, i: usize, at: &Interaction) {
        set(&mut self.p, i, at.p);
        set(&mut self.n_g, i, at.n_g);
        set(&mut self.n_s, i, at.n_s);
        self.error[i] = at.error;
        self.material[i] = at.material;
    }
}
