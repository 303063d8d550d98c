//! Whether a mesh is open, so that it may be seen from both sides.
//!
//! By the divergence theorem the vector areas A of a closed surface add up to nothing, and A·cᵀ, c the centroid of each
//! triangle, to its volume times the identity. One pass without tables, whatever vertices share. Limits: that is
//! necessary, not sufficient (two holes may cancel), and a body of several materials, each a mesh, counts as open.
//! From which side a closed one is seen is not asked.

use glam::{DMat3, DVec3};

use super::Mesh;

/// What sums of a closed mesh may be off by, of the sum of magnitudes: positions are rounded to 2⁻²⁴.
const ROUNDING: f64 = 1e-5;

impl Mesh {
    /// Whether its triangles close around no space.
    pub fn is_open(&self) -> bool {
        let Some(first) = self.triangles.first() else { return false };
        let origin = self.positions[first[0] as usize].as_dvec3();
        let (mut area, mut moment) = (DVec3::ZERO, DMat3::ZERO);
        let (mut areas, mut moments) = (0.0, 0.0);
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|i| self.positions[i as usize].as_dvec3() - origin);
            let (n, center) = (0.5 * (b - a).cross(c - a), (a + b + c) / 3.0);
            area += n;
            moment += DMat3::from_cols(n * center.x, n * center.y, n * center.z);
            areas += n.length();
            moments += n.length() * center.length();
        }
        let volume = (moment.x_axis.x + moment.y_axis.y + moment.z_axis.z) / 3.0;
        let rest = moment - DMat3::from_diagonal(DVec3::splat(volume));
        let off = rest.to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max);
        !(area.length() <= ROUNDING * areas && off <= ROUNDING * moments)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    /// A block with its corner at (2, 3, 4), without the faces of which `is_left_out` says so.
    fn block(is_left_out: impl Fn(usize) -> bool) -> Mesh {
        let corner = |i: u32| Vec3::new(2.0 + 0.3 * (i & 1) as f32, 3.0 + (i >> 1 & 1) as f32, 4.0 + (i >> 2) as f32);
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let sides = faces.iter().enumerate().filter(|(i, _)| !is_left_out(*i));
        let triangles = sides.flat_map(|(_, &[a, b, c, d])| [[a, b, c], [a, c, d]]).collect();
        Mesh { positions: (0..8).map(corner).collect(), triangles, ..Mesh::default() }
    }

    /// Oracle: by looking at it.
    #[test]
    fn blocks_with_holes_are_open() {
        assert!(!block(|_| false).is_open());
        assert!(block(|face| face == 3).is_open());
        // A tube, whose areas add up to nothing.
        assert!(block(|face| face < 2).is_open());
        let mut reversed = block(|_| false);
        reversed.triangles.iter_mut().for_each(|triangle| triangle.reverse());
        assert!(!reversed.is_open());
        assert!(!Mesh::default().is_open());
    }
}
