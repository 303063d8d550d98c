//! How much of a sum of many numbers its largest carry: counted in bins of an eighth of an octave, so that any number
//! of them takes the same memory. Sums are exact; where the largest end within a bin, its numbers count as equal, which
//! is off by less than 9 % of that bin.

/// Bins of an octave.
const PER_OCTAVE: f32 = 8.0;

/// Octaves on each side of 1; what lies beyond is in the outermost bins.
const OCTAVES: f32 = 100.0;

/// Numbers ≥ 0 in bins.
#[derive(Clone, Debug)]
pub struct Tail {
    bins: Vec<(u64, f64)>,
}

impl Default for Tail {
    fn default() -> Self {
        Tail { bins: vec![(0, 0.0); (2.0 * OCTAVES * PER_OCTAVE) as usize + 1] }
    }
}

impl Tail {
    /// One number more. Bins are added to in the order of the calls, so equal calls give equal bits.
    pub fn add(&mut self, value: f32) {
        let bin = (value.log2().clamp(-OCTAVES, OCTAVES) + OCTAVES) * PER_OCTAVE;
        let (count, sum) = &mut self.bins[bin as usize];
        *count += 1;
        *sum += f64::from(value);
    }

    /// How many there are.
    pub fn count(&self) -> u64 {
        self.bins.iter().map(|(count, _)| count).sum()
    }

    /// Share of the `worst` largest in the sum; 0 of nothing.
    pub fn share_of_worst(&self, worst: u64) -> f64 {
        let (mut left, mut carried) = (worst, 0.0);
        for &(count, sum) in self.bins.iter().rev().filter(|(count, _)| *count > 0) {
            let taken = left.min(count);
            carried += sum * taken as f64 / count as f64;
            left -= taken;
        }
        share(carried, self.bins.iter().map(|(_, sum)| sum).sum())
    }
}

/// `part` of `whole`; 0 of nothing.
pub fn share(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { part / whole } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: the sorted numbers. Exact where the largest fill their bins.
    #[test]
    fn the_worst_are_the_largest() {
        let mut tail = Tail::default();
        assert_eq!((tail.count(), tail.share_of_worst(10)), (0, 0.0));
        for (value, times) in [(1e-3, 1000), (0.5, 20), (64.0, 2), (0.0, 5)] {
            (0..times).for_each(|_| tail.add(value));
        }
        let sum = 1000.0 * f64::from(1e-3f32) + 10.0 + 128.0;
        assert_eq!(tail.count(), 1027);
        for (worst, expected) in [(0, 0.0), (1, 64.0), (2, 128.0), (12, 133.0), (22, 138.0), (5000, sum)] {
            let found = tail.share_of_worst(worst);
            assert!((found - expected / sum).abs() < 1e-12, "{worst}: {found} for {}", expected / sum);
        }
    }
}
