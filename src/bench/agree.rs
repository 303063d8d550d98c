//! Agreement: whether two ways to trace the same rays met the same things.
//!
//! A ray differs *in hit* when one way finds a hit (or a blocker) and the other finds none. It differs *in distance*
//! when both hit, at distances further apart than [`DISTANCE_TOLERANCE`] of the larger of the distance and the largest
//! coordinate of the ray's origin. Another triangle at the same distance (a common edge, a copy) is counted apart.

use serde::Serialize;

use super::record::Batch;
use super::replay::Outcome;
use crate::backend::batch::LANES;

/// 2⁻¹³, about 1.2·10⁻⁴: distances carry 24 bits; a hit at a grazing angle of 1/1000 loses ten of them.
pub const DISTANCE_TOLERANCE: f32 = 1.0 / 8192.0;

/// Counts over rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Agreement {
    /// Rays compared.
    pub rays: u64,
    /// Rays that hit in one and not in the other.
    pub hit_differs: u64,
    /// Rays that hit in both, at different distances.
    pub distance_differs: u64,
    /// Rays that hit different triangles at the same distance.
    pub triangle_differs: u64,
}

impl Agreement {
    /// Compares what the rays of `waves` met by two ways.
    pub fn of(waves: &[&[Batch]], ours: &[Outcome], reference: &[Outcome]) -> Self {
        let mut counts = Agreement::default();
        let reaches = waves.iter().flat_map(|wave| wave.iter()).flat_map(reaches);
        for ((ours, reference), reach) in ours.iter().zip(reference).zip(reaches) {
            counts.rays += 1;
            match (*ours, *reference) {
                (Outcome::Hit { t, triangle }, Outcome::Hit { t: t_reference, triangle: triangle_reference }) => {
                    if !((t - t_reference).abs() <= DISTANCE_TOLERANCE * reach.max(t).max(t_reference)) {
                        counts.distance_differs += 1;
                    } else if triangle != triangle_reference {
                        counts.triangle_differs += 1;
                    }
                }
                (ours, reference) => counts.hit_differs += u64::from(ours != reference),
            }
        }
        counts
    }

    /// Sums of two counts.
    pub fn merge(&mut self, other: &Agreement) {
        self.rays += other.rays;
        self.hit_differs += other.hit_differs;
        self.distance_differs += other.distance_differs;
        self.triangle_differs += other.triangle_differs;
    }

    /// Rays that differ in hit or in distance, of all.
    pub fn fraction(&self) -> f64 {
        (self.hit_differs + self.distance_differs) as f64 / self.rays.max(1) as f64
    }
}

/// Largest coordinate of each ray's origin.
fn reaches(batch: &Batch) -> impl Iterator<Item = f32> {
    (0..batch.len).map(|ray| batch.rays[ray / LANES].org(ray % LANES).abs().max_element())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::Coherence;
    use crate::backend::batch::RayBlock;
    use crate::bench::record::RayClass;
    use glam::Vec3;

    #[test]
    fn each_kind_of_difference_is_counted_once() {
        let mut rays = RayBlock::EMPTY;
        for lane in 0..6 {
            rays.set(lane, Vec3::new(0.0, -8.0, 0.0), Vec3::Z, f32::INFINITY);
        }
        let wave = [Batch { class: RayClass::Bounce, hint: Coherence::Incoherent, rays: vec![rays], len: 6 }];
        let hit = |t: f32, prim: u32| Outcome::Hit { t, triangle: [0, 0, prim] };
        let step = 8.0 * DISTANCE_TOLERANCE;
        let ours = [hit(1.0, 1), hit(1.0, 1), hit(1.0, 1), hit(1.0, 1), Outcome::Free, Outcome::Blocked];
        let theirs = [
            hit(1.0, 1),
            hit(1.0 + 0.9 * step, 2),
            hit(1.0 + 1.1 * step, 1),
            Outcome::Free,
            Outcome::Free,
            Outcome::Free,
        ];
        let expected = Agreement { rays: 6, hit_differs: 2, distance_differs: 1, triangle_differs: 1 };
        assert_eq!(Agreement::of(&[&wave], &ours, &theirs), expected);
        assert_eq!(expected.fraction(), 0.5);
    }
}
