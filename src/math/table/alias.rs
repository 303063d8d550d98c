//! Discrete distribution with draws in constant time: buckets of equal size, each shared by two cells at most. Source:
//! Walker 1977 (ACM TOMS 3:3), built as by Vose 1991 (IEEE Trans. Softw. Eng. 17:9), here in integers, so no cell is
//! left over. Limit: 2^24 cells.

use super::lattice::{LATTICE, STEP, TableError, apportion, lattice_step};

/// A cell drawn from an [`AliasTable`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// The cell.
    pub index: u32,
    /// Probability with which it is drawn.
    pub p: f32,
    /// The rest of the random number, rescaled to [0,1): uniform again, with as many bits as the cell had steps.
    pub u: f32,
}

/// One bucket: its steps below `threshold` belong to the cell of the same number, the others to `alias`.
#[derive(Clone, Copy, Debug, Default)]
struct Bucket {
    threshold: u32,
    alias: u32,
    own_steps: u32,
    alias_steps: u32,
}

/// Discrete distribution with constant-time draws.
#[derive(Clone, Debug)]
pub struct AliasTable {
    /// A power of two of them, so that each has the same number of steps; those past `len` own none.
    buckets: Vec<Bucket>,
    /// log2 of the steps of a bucket.
    shift: u32,
    len: usize,
}

impl AliasTable {
    /// The distribution proportional to `weights`.
    pub fn new(weights: &[f64]) -> Result<Self, TableError> {
        if weights.len() > LATTICE as usize {
            return Err(TableError::TooMany { count: weights.len() });
        }
        let mut cumulative = vec![0; weights.len() + 1];
        apportion(weights, &mut cumulative)?;

        let count = weights.len().next_power_of_two();
        let capacity = LATTICE / count as u32;
        let mut left: Vec<u32> = cumulative.windows(2).map(|c| c[1] - c[0]).collect();
        left.resize(count, 0);
        let mut buckets: Vec<Bucket> =
            left.iter().map(|&own_steps| Bucket { own_steps, ..Bucket::default() }).collect();

        // Fill each bucket that its own cell leaves partly empty from a cell that has too much for its own.
        let (mut poor, mut rich): (Vec<u32>, Vec<u32>) = (0..count as u32).partition(|&i| left[i as usize] < capacity);
        while let (Some(i), Some(&donor)) = (poor.pop(), rich.last()) {
            let (i, d) = (i as usize, donor as usize);
            buckets[i].threshold = left[i];
            buckets[i].alias = donor;
            buckets[i].alias_steps = buckets[d].own_steps;
            left[d] -= capacity - left[i];
            if left[d] < capacity {
                rich.pop();
                poor.push(donor);
            }
        }
        for i in rich {
            let bucket = &mut buckets[i as usize];
            (bucket.threshold, bucket.alias, bucket.alias_steps) = (capacity, i, bucket.own_steps);
        }
        Ok(AliasTable { buckets, shift: capacity.trailing_zeros(), len: weights.len() })
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Never: a table has at least one cell of positive weight.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Probability with which `index` is drawn; exactly 0 where the weight was 0, and where there is no such cell.
    #[inline]
    pub fn p(&self, index: u32) -> f32 {
        self.buckets.get(index as usize).map_or(0.0, |bucket| bucket.own_steps as f32 * STEP)
    }

    /// The cell that `u` in [0,1) falls into.
    #[inline]
    pub fn sample(&self, u: f32) -> Choice {
        let (step, rest) = lattice_step(u);
        let number = step >> self.shift;
        let within = step - (number << self.shift);
        let bucket = &self.buckets[number as usize];
        if within < bucket.threshold {
            let u = (within as f32 + rest) / bucket.threshold as f32;
            Choice { index: number, p: bucket.own_steps as f32 * STEP, u }
        } else {
            let width = (1 << self.shift) - bucket.threshold;
            let u = ((within - bucket.threshold) as f32 + rest) / width as f32;
            Choice { index: bucket.alias, p: bucket.alias_steps as f32 * STEP, u }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::table::lattice::BELOW_ONE;

    /// Draws every value of the lattice once, so counts must equal the reported probability: no statistics, no false
    /// alarms.
    fn draw_all(table: &AliasTable) -> Vec<u32> {
        let mut drawn = vec![0; table.len()];
        for step in 0..LATTICE {
            let choice = table.sample(step as f32 * STEP);
            drawn[choice.index as usize] += 1;
            assert!((0.0..1.0).contains(&choice.u), "remapped u = {}", choice.u);
            assert_eq!(choice.p, table.p(choice.index));
        }
        drawn
    }

    #[test]
    fn alias_draws_exactly_what_it_reports() {
        let weights = [0.5, 0.0, 3.0, 1e-12, 0.0, 7.25, 0.1];
        let table = AliasTable::new(&weights).expect("valid weights");
        let total: f64 = weights.iter().sum();
        for (i, &n) in draw_all(&table).iter().enumerate() {
            assert_eq!(n as f32 * STEP, table.p(i as u32), "cell {i}");
            assert_eq!(n == 0, weights[i] == 0.0, "cell {i}");
            // Rounding of the running sum moves each end of a cell by one step, the guaranteed steps by at most n.
            assert!((f64::from(n) * f64::from(STEP) - weights[i] / total).abs() < 9.0 * f64::from(STEP), "cell {i}");
        }
    }

    #[test]
    fn alias_of_one_cell_returns_the_number_itself() {
        let table = AliasTable::new(&[3.0]).expect("valid weights");
        for u in [0.0, 1e-30, 0.25, 0.7, BELOW_ONE] {
            assert_eq!(table.sample(u), Choice { index: 0, p: 1.0, u });
        }
    }
}
