//! Orthonormal frames around a normal: the shading frame, n = +z.
//!
//! The basis is the branch-free form of Duff et al. 2017 (JCGT 6:1): one `copysign`, no square root, continuous except
//! across n_z = 0. Limit: `n` must be a unit vector; the frame is then orthonormal to 2.5e-7 for every n, signed zeros
//! and denormals included (HARDCASES B18).

use glam::Vec3;

/// Right-handed orthonormal frame; maps between world and local coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Local +x.
    pub t: Vec3,
    /// Local +y.
    pub b: Vec3,
    /// Local +z, the normal.
    pub n: Vec3,
}

impl Frame {
    /// A frame whose +z is the unit vector `n`.
    #[inline(always)]
    pub fn from_normal(n: Vec3) -> Self {
        let sign = 1.0f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Frame {
            t: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            b: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// A frame with +z along the unit vector `n` and +x as near to `tangent` as orthogonality allows; any frame around
    /// `n` when the tangent is parallel to it, zero, or not finite.
    #[inline(always)]
    pub fn from_normal_tangent(n: Vec3, tangent: Vec3) -> Self {
        let t = tangent - n * n.dot(tangent);
        // Below this the projection is rounding noise of the subtraction: 16 roundoffs of the tangent's own length.
        let noise2 = tangent.length_squared() * (super::float::UNIT_ROUNDOFF * 16.0).powi(2);
        let length2 = t.length_squared();
        if length2 > noise2 && length2 < f32::INFINITY {
            let t = t / length2.sqrt();
            Frame { t, b: n.cross(t), n }
        } else {
            Frame::from_normal(n)
        }
    }

    /// World to local.
    #[inline(always)]
    pub fn to_local(&self, w: Vec3) -> Vec3 {
        Vec3::new(self.t.dot(w), self.b.dot(w), self.n.dot(w))
    }

    /// Local to world.
    #[inline(always)]
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.t * v.x + self.b * v.y + self.n * v.z
    }
}
