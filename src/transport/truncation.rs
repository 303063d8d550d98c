//! What the depth limit cut off: the light that capped paths could still have carried. Summed at the cap alone, so that
//! paths that end otherwise pay nothing.
//!
//! A path that ends at its last vertex with throughput β would have brought β·ρ·L more, ρ the reflectance there
//! and L the mean radiance that arrives. The sum of β·η²·ρ (η² as in `shading::roulette`) over all paths is
//! kept by channel in fixed point: integers make it the same for any order of the workers.

use glam::Vec3;

/// Fixed point: one is 2⁸⁰, so a throughput of 2⁻⁸⁰ still counts and 2⁴⁸ paths of throughput 1 fit.
const ONE: f64 = (1u128 << 80) as f64;

/// Sums over the paths that the depth limit ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Truncated {
    /// Paths that could still have carried something.
    pub paths: u64,
    sums: [u128; 3],
}

impl Truncated {
    /// From what [`sums`](Self::sums) gave.
    pub(crate) fn of_sums(paths: u64, sums: [u128; 3]) -> Self {
        Truncated { paths, sums }
    }

    /// The sums by channel in fixed point.
    pub(crate) fn sums(&self) -> [u128; 3] {
        self.sums
    }

    /// Adds one path: its throughput times the reflectance of the surface that it ends at.
    #[inline(always)]
    pub fn add(&mut self, carried: Vec3) {
        self.paths += u64::from(carried.max_element() > 0.0);
        for c in 0..3 {
            // The cast saturates, and makes 0 of NaN, which is counted where it enters the film.
            self.sums[c] = self.sums[c].saturating_add((f64::from(carried[c]) * ONE) as u128);
        }
    }

    /// Adds another worker's sums.
    pub fn merge(&mut self, other: &Truncated) {
        self.paths += other.paths;
        for c in 0..3 {
            self.sums[c] = self.sums[c].saturating_add(other.sums[c]);
        }
    }

    /// Throughput times reflectance by channel, summed over the paths.
    pub fn carried(&self) -> [f64; 3] {
        self.sums.map(|sum| sum as f64 / ONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: exact sums of powers of two, far apart; any order.
    #[test]
    fn sums_do_not_depend_on_their_order() {
        let terms = [Vec3::ONE, Vec3::new(0.5, 1e-20, 0.0), Vec3::splat(2f32.powi(-70)), Vec3::new(f32::NAN, 0.0, 0.0)];
        let (mut forward, mut parts) = (Truncated::default(), Truncated::default());
        terms.iter().for_each(|&t| forward.add(t));
        for &t in terms.iter().rev() {
            let mut part = Truncated::default();
            part.add(t);
            parts.merge(&part);
        }
        assert_eq!(forward, parts);
        assert_eq!(forward.paths, 3);
        assert_eq!(forward.carried()[2], 1.0 + 2f64.powi(-70));
        assert_eq!(forward.carried()[0], 1.5 + 2f64.powi(-70));
    }
}
