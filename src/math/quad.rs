//! Parallelograms: pairs of triangles that are the halves of one. Rectangles come as such pairs; a light is sampled and
//! a face is traced as one. How much rounding is let pass is the caller's choice.

use glam::{DVec3, Vec3};

/// Two triangles with a common edge that are turned to the same side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quad {
    /// Around the two, c, a, d, b: the first triangle is (c, a, b), the second (d, b, a).
    pub corners: [Vec3; 4],
    /// The vertex that the other has not: c of the first, d of the second.
    pub apex: [usize; 2],
}

impl Quad {
    /// Of two triangles; `None` if they have no common edge.
    pub fn of(first: &[Vec3; 3], second: &[Vec3; 3]) -> Option<Self> {
        (0..3).flat_map(|i| (0..3).map(move |j| [i, j])).find_map(|[i, j]| {
            let (c, a, b) = (first[i], first[(i + 1) % 3], first[(i + 2) % 3]);
            let (d, b2, a2) = (second[j], second[(j + 1) % 3], second[(j + 2) % 3]);
            (a == a2 && b == b2).then_some(Quad { corners: [c, a, d, b], apex: [i, j] })
        })
    }

    /// Largest magnitude of a coordinate, of which corners are rounded.
    pub fn reach(&self) -> f32 {
        self.corners.iter().fold(0.0f32, |reach, corner| reach.max(corner.abs().max_element()))
    }

    /// How far d lies from where a parallelogram has it.
    pub fn gap(&self) -> DVec3 {
        let [c, a, d, b] = self.corners.map(|corner| corner.as_dvec3());
        d - (a + b - c)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: the halves of a square in every order of their corners; turned over they have no common edge.
    #[test]
    fn halves_are_found_in_every_order() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y];
        for i in 0..3 {
            for j in 0..3 {
                let (mut first, mut second) =
                    ([corners[0], corners[1], corners[3]], [corners[2], corners[3], corners[1]]);
                first.rotate_left(i);
                second.rotate_left(j);
                let quad = Quad::of(&first, &second).expect("a common edge");
                assert_eq!((quad.corners, quad.apex), (corners, [(3 - i) % 3, (3 - j) % 3]));
                assert_eq!((quad.gap(), quad.reach()), (DVec3::ZERO, 1.0));
                second.swap(0, 1);
                assert_eq!(Quad::of(&first, &second), None);
            }
        }
    }
}
