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
        // And below the normal range its length has too few bits left to divide by.
        if length2 > noise2.max(f32::MIN_POSITIVE) && length2 < f32::INFINITY {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{IndependentScheme, Scheme};

    /// Largest deviation of the frame's Gram matrix from the identity, in f64.
    fn gram_error(f: &Frame) -> f64 {
        let axes = [f.t.as_dvec3(), f.b.as_dvec3(), f.n.as_dvec3()];
        let mut worst = 0.0f64;
        for (i, p) in axes.iter().enumerate() {
            for (j, q) in axes.iter().enumerate() {
                let deviation = (p.dot(*q) - f64::from(u8::from(i == j))).abs();
                // `max` would drop a NaN.
                worst = if deviation <= worst { worst } else { deviation };
            }
        }
        worst
    }

    /// HARDCASES B18. Oracle: the identity; deterministic, so no false alarms.
    #[test]
    fn basis_is_orthonormal_everywhere() {
        for i in 0..1_000_000u32 {
            let u = IndependentScheme::sample_4d(i, [18, 0], 0);
            let z = 1.0 - 2.0 * f64::from(u[0]);
            let phi = std::f64::consts::TAU * f64::from(u[1]);
            let around = |sin: f64, cos: f64| Vec3::new((sin * phi.cos()) as f32, (sin * phi.sin()) as f32, cos as f32);
            let tiny = 10f64.powf(-8.0 + 6.0 * f64::from(u[2]));
            let equator = 10f64.powf(-40.0 + 38.0 * f64::from(u[2])).copysign(f64::from(u[3]) - 0.5);
            for n in [
                around((1.0 - z * z).sqrt(), z),
                around(tiny.sin(), -tiny.cos()),
                around(tiny.sin(), tiny.cos()),
                around((1.0 - equator * equator).sqrt(), equator),
            ] {
                let error = gram_error(&Frame::from_normal(n));
                assert!(error <= 2.5e-7, "{n:?}: {error}");
            }
        }
        for n in [Vec3::Z, -Vec3::Z, Vec3::new(0.0, 1.0, -0.0), Vec3::new(-0.0, -1.0, 0.0), Vec3::X] {
            assert_eq!(gram_error(&Frame::from_normal(n)), 0.0, "{n:?}");
        }
    }

    /// Oracle: local coordinates of the axes themselves, and the round trip to 4 roundoffs per product.
    #[test]
    fn local_and_world_are_inverse() {
        for i in 0..10_000u32 {
            let u = IndependentScheme::sample_4d(i, [19, 0], 0);
            let n = crate::math::warp::uniform_sphere([u[0], u[1]]);
            let w = crate::math::warp::uniform_sphere([u[2], u[3]]);
            let f = Frame::from_normal(n);
            assert!((f.to_world(f.to_local(w)) - w).length() <= 1e-6);
            assert!((f.to_local(n) - Vec3::Z).length() <= 5e-7);
            assert!((f.t.cross(f.b) - n).length() <= 5e-7, "right-handed");
            let g = Frame::from_normal_tangent(n, w * 3.0);
            assert!(gram_error(&g) <= 1e-5 && g.t.dot(w) >= 0.0);
            assert!(gram_error(&Frame::from_normal_tangent(n, n * 2.0)) <= 2.5e-7);
            assert!(gram_error(&Frame::from_normal_tangent(n, Vec3::ZERO)) <= 2.5e-7);
        }
    }
}
