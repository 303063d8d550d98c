//! Sums in pairs: samples 0 and 1, 2 and 3, then those pairs in pairs, and so on. The sum of a block of 2^k samples
//! is the sum of its two halves, so that it has the same bits whoever adds which half. Rounding errors grow with the
//! logarithm of the number of samples (Higham 1993, "The accuracy of floating point summation").

/// Sizes of blocks that may be open at once: at most 2^DEPTH − 1 rows are added.
const DEPTH: usize = 20;

/// The sum of rows 0 to `n` − 1, `n` < 2^20; zeros where there are none. Where `n` is no power of two, the blocks
/// that its binary digits name are added from the largest to the smallest.
#[inline(always)]
pub fn sum<const W: usize>(n: usize, mut row: impl FnMut(usize) -> [f64; W]) -> [f64; W] {
    debug_assert!(n < 1 << DEPTH, "{n} rows");
    let mut open = [[0.0; W]; DEPTH];
    let mut depth = 0;
    for i in 0..n {
        let mut block = row(i);
        for _ in 0..i.trailing_ones() {
            depth -= 1;
            block = add(open[depth], block);
        }
        open[depth] = block;
        depth += 1;
    }
    let (first, rest) = open[..depth.max(1)].split_first().expect("one at least");
    rest.iter().fold(*first, |total, &block| add(total, block))
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
