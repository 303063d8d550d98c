//! Form factor from a point to a triangle: the share of the cosine-weighted hemisphere of (x, n) that the triangle
//! covers, in closed form, without visibility.
//!
//! F = 1/2π·Σ θ_e·(n · ê) over the edges of the part above the horizon, θ_e the angle under which an edge is
//! seen and ê the unit normal of the plane through x and the edge (Lambert 1760; Goral et al. 1984). f64 throughout.

use std::f64::consts::TAU;

use glam::DVec3;

/// Share of the hemisphere around `n` (unit) at `x` that the triangle covers, in [0, 1]; 0 below the horizon or
/// edge-on.
pub fn point_to_triangle(x: DVec3, n: DVec3, corners: [DVec3; 3]) -> f64 {
    let v = corners.map(|p| p - x);
    let height = v.map(|p| p.dot(n));
    if height.iter().all(|&h| h <= 0.0) {
        return 0.0;
    }
    if height.iter().all(|&h| h >= 0.0) {
        return boundary(&v, n);
    }
    // Cut at the horizon: a triangle leaves a triangle or a quadrilateral.
    let mut cut = [DVec3::ZERO; 4];
    let mut len = 0;
    for i in 0..3 {
        let j = (i + 1) % 3;
        if height[i] >= 0.0 {
            cut[len] = v[i];
            len += 1;
        }
        if (height[i] > 0.0 && height[j] < 0.0) || (height[i] < 0.0 && height[j] > 0.0) {
            cut[len] = v[i] + (v[j] - v[i]) * (height[i] / (height[i] - height[j]));
            len += 1;
        }
    }
    boundary(&cut[..len], n)
}

/// The sum over the edges of a polygon given relative to the point, whatever its winding.
fn boundary(polygon: &[DVec3], n: DVec3) -> f64 {
    let mut sum = 0.0;
    for (i, a) in polygon.iter().enumerate() {
        let b = &polygon[(i + 1) % polygon.len()];
        let cross = a.cross(*b);
        let length = cross.length();
        // An edge seen end-on, or one that the cut has left without length, spans no angle.
        if length > 0.0 {
            sum += length.atan2(a.dot(*b)) * n.dot(cross) / length;
        }
    }
    sum.abs() / TAU
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(corners: [DVec3; 4], x: DVec3, n: DVec3) -> f64 {
        let [a, b, c, d] = corners;
        point_to_triangle(x, n, [a, b, c]) + point_to_triangle(x, n, [a, c, d])
    }

    /// HARDCASES L01: irradiance π·F of a square of side 2 at height 1, by table.
    #[test]
    fn squares_follow_the_table() {
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| DVec3::new(x, y, 1.0));
        for (x, y, expected) in
            [(0.0, 0.0, 1.740839503), (1.0, 0.0, 1.051648203), (3.0, 0.0, 0.04960834601), (3.0, 4.0, 0.006554121792)]
        {
            let f = square(corners, DVec3::new(x, y, 0.0), DVec3::Z);
            assert!((f * std::f64::consts::PI / expected - 1.0).abs() < 1e-9, "{x} {y}: {f}");
        }
        let tilted = square(corners, DVec3::ZERO, DVec3::new(1.0, 2.0, 2.0) / 3.0);
        assert!((tilted * std::f64::consts::PI / 1.165664387 - 1.0).abs() < 1e-9, "{tilted}");
    }

    /// The factors of closed surroundings sum to 1, whatever the point and its normal: a cube, cut by the horizon.
    #[test]
    fn closed_surroundings_fill_the_hemisphere() {
        let corner = |i: usize| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64);
        let faces = [[0, 2, 6, 4], [1, 3, 7, 5], [0, 1, 5, 4], [2, 3, 7, 6], [0, 1, 3, 2], [4, 5, 7, 6]];
        for (x, n) in [
            (DVec3::new(0.3, 0.4, 0.5), DVec3::new(0.6, 0.0, 0.8)),
            (DVec3::new(0.25, 0.5, 0.0), DVec3::Z),
            (DVec3::new(0.9, 0.01, 0.5), DVec3::new(1.0, 1.0, 1.0).normalize()),
        ] {
            let sum: f64 = faces.iter().map(|face| square(face.map(corner), x, n)).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{x}: {sum}");
        }
    }
}
