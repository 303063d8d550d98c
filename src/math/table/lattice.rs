//! The lattice of 2^24 steps on which weights are apportioned (see the page of the folder).

/// Steps of [0,1) that a uniform f32 distinguishes: all multiples of 2^-24 are exact.
pub(super) const LATTICE: u32 = 1 << 24;
/// One step.
pub(super) const STEP: f32 = 1.0 / LATTICE as f32;
/// The largest f32 below 1.
pub(super) const BELOW_ONE: f32 = 1.0 - STEP;

/// Why no table could be made of some weights.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TableError {
    /// No weight is positive.
    #[error("no weight is above 0")]
    Empty,
    /// A weight is negative, NaN or infinite, or the sum overflows.
    #[error("weight {index} is {weight}, expected a finite number >= 0")]
    Invalid {
        /// Position of the weight.
        index: usize,
        /// The weight.
        weight: f64,
    },
    /// More cells than the lattice has steps.
    #[error("{count} cells, at most {LATTICE} are possible")]
    TooMany {
        /// Number of cells.
        count: usize,
    },
}

/// Step of the lattice that `u` in [0,1) falls into, and the rest of `u` within the step, in [0,1).
#[inline(always)]
pub(super) fn lattice_step(u: f32) -> (u32, f32) {
    debug_assert!((0.0..1.0).contains(&u), "u = {u} is not in [0,1)");
    let scaled = u * LATTICE as f32;
    // By way of i32, which converts in one instruction.
    let step = (scaled as i32 as u32).min(LATTICE - 1);
    (step, scaled - step as i32 as f32)
}

/// Cumulative steps: `out[i]..out[i + 1]` are the steps of cell i. `out` has one entry more than `weights`.
pub(super) fn apportion(weights: &[f64], out: &mut [u32]) -> Result<f64, TableError> {
    let mut total = 0.0;
    let mut positive = 0;
    let mut last_positive = 0;
    for (index, &weight) in weights.iter().enumerate() {
        total += weight;
        if !(weight >= 0.0 && total.is_finite()) {
            return Err(TableError::Invalid { index, weight });
        }
        if weight > 0.0 {
            positive += 1;
            last_positive = index;
        }
    }
    if positive == 0 {
        return Err(TableError::Empty);
    }
    if positive > LATTICE as usize {
        return Err(TableError::TooMany { count: positive });
    }

    // One step for each positive weight; the others go by the rounded running sum, so that errors do not add up.
    let shared = f64::from(LATTICE) - positive as f64;
    let mut running = 0.0;
    let mut granted = 0;
    out[0] = 0;
    for (index, &weight) in weights.iter().enumerate() {
        if weight > 0.0 {
            running += weight;
            granted += 1;
        }
        let steps = (running / total * shared + 0.5) as u32 + granted;
        out[index + 1] = if index >= last_positive { LATTICE } else { steps };
    }
    Ok(total)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::table::{AliasTable, Distribution2D};

    #[test]
    fn bad_weights_are_named() {
        assert_eq!(AliasTable::new(&[]).err(), Some(TableError::Empty));
        assert_eq!(AliasTable::new(&[0.0, 0.0]).err(), Some(TableError::Empty));
        assert_eq!(AliasTable::new(&[1.0, -1.0]).err(), Some(TableError::Invalid { index: 1, weight: -1.0 }));
        assert!(matches!(AliasTable::new(&[f64::NAN]), Err(TableError::Invalid { index: 0, .. })));
        assert!(matches!(AliasTable::new(&[1.0, f64::INFINITY]), Err(TableError::Invalid { index: 1, .. })));
        let negative_in_row_1 =
            Distribution2D::new(2, 2, |row, w| w.copy_from_slice(&[1.0, 1.0 - 2.0 * f64::from(row)]));
        assert_eq!(negative_in_row_1.err(), Some(TableError::Invalid { index: 3, weight: -1.0 }));
    }

    /// Oracle: the promise, summed up. Weights over 300 orders of magnitude; deterministic.
    #[test]
    fn the_lattice_is_given_out_whole_and_every_positive_weight_has_a_step() {
        let weights: Vec<f64> = (0..1000).map(|i| if i % 7 == 3 { 0.0 } else { 10f64.powi(i % 301 - 150) }).collect();
        let mut cumulative = vec![0; weights.len() + 1];
        apportion(&weights, &mut cumulative).expect("valid weights");
        assert_eq!((cumulative[0], cumulative[1000]), (0, LATTICE));
        for (i, steps) in cumulative.windows(2).enumerate() {
            assert_eq!(steps[1] > steps[0], weights[i] > 0.0, "cell {i}: {steps:?}");
        }
    }
}
