//! Sums in pairs: samples 0 and 1, 2 and 3, then those pairs in pairs, and so on. The sum of a block of 2^k samples
//! is the sum of its two halves, so that it has the same bits whoever adds which half. Rounding errors grow with the
//! logarithm of the number of samples (Higham 1993, "The accuracy of floating point summation").

/// The sum of rows 0 to `n` − 1; zeros where there are none. Where `n` is no power of two, the blocks that its binary
/// digits name are added from the largest to the smallest.
#[inline(always)]
pub fn sum<const W: usize>(n: usize, mut row: impl FnMut(usize) -> [f64; W]) -> [f64; W] {
    match n {
        0 => [0.0; W],
        // Passes of few samples are many.
        1 => row(0),
        _ => blocks(n, &mut row),
    }
}

/// [`sum`] of one row at least.
#[inline(never)]
fn blocks<const W: usize>(n: usize, row: &mut impl FnMut(usize) -> [f64; W]) -> [f64; W] {
    let size = 1 << n.ilog2();
    let mut total = block(0, size, row);
    let mut at = size;
    while at < n {
        let size = 1 << (n - at).ilog2();
        total = add(total, block(at, size, row));
        at += size;
    }
    total
}

/// The sum of `size` rows from `at` on, a power of two.
fn block<const W: usize>(at: usize, size: usize, row: &mut impl FnMut(usize) -> [f64; W]) -> [f64; W] {
    match size {
        1 => row(at),
        2 => add(row(at), row(at + 1)),
        _ => add(block(at, size / 2, row), block(at + size / 2, size / 2, row)),
    }
}

#[inline(always)]
fn add<const W: usize>(a: [f64; W], b: [f64; W]) -> [f64; W] {
    std::array::from_fn(|i| a[i] + b[i])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::noise::Pcg;

    /// Oracle: recursion over halves. Deterministic.
    #[test]
    fn blocks_are_the_sums_of_their_halves() {
        let mut random = Pcg(3);
        let values: Vec<[f64; 1]> = (0..64).map(|i| [f64::from(random.next()) * 3f64.powi(i % 40)]).collect();
        fn halves(values: &[[f64; 1]]) -> f64 {
            match values {
                [value] => value[0],
                _ => halves(&values[..values.len() / 2]) + halves(&values[values.len() / 2..]),
            }
        }
        for n in [1, 2, 4, 8, 16, 32, 64] {
            assert_eq!(sum(n, |i| values[i]), [halves(&values[..n])]);
        }
        let expected = (halves(&values[..32]) + halves(&values[32..40])) + values[40][0];
        assert_eq!(sum(41, |i| values[i]), [expected]);
        assert_eq!(sum(0, |i| values[i]), [0.0]);
        let in_order = values.iter().fold(0.0, |total, value| total + value[0]);
        assert_ne!(in_order, halves(&values), "values whose order of addition shows");
    }
}
