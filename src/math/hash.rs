//! Digests of words: they keep no secrets; what differs by accident differs in them, but for one case in 2⁶⁴.

/// One step of a hash: a bijection of `value` for each state (Stafford's variant 13 of the SplitMix finaliser).
pub(crate) fn mix(state: u64, value: u64) -> u64 {
    let mut z = (state.rotate_left(5) ^ value).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Digest of many words: word i belongs to strand i mod 4, because the steps of one wait for each other; those are
/// joined in the end.
#[derive(Clone, Default)]
pub(crate) struct Strands([u64; Strands::COUNT]);

impl Strands {
    /// How many there are.
    pub const COUNT: usize = 4;

    /// Adds words, of which all before the last ones came in multiples of [`COUNT`](Self::COUNT).
    pub fn add(&mut self, words: &[u64]) {
        for row in words.chunks(Strands::COUNT) {
            for (strand, &word) in self.0.iter_mut().zip(row) {
                *strand = mix(*strand, word);
            }
        }
    }

    /// The digest.
    pub fn joined(&self) -> u64 {
        self.0.iter().fold(0, |digest, &strand| mix(digest, strand))
    }
}

/// Digest of plain numbers by their bits, of which four bytes at least make one.
pub(crate) fn digest_of<T: bytemuck::Pod>(numbers: &[T]) -> u64 {
    let halves: &[u32] = bytemuck::cast_slice(numbers);
    let mut strands = Strands::default();
    let mut row = [0u64; 256];
    for part in halves.chunks(2 * row.len()) {
        for (word, pair) in row.iter_mut().zip(part.chunks(2)) {
            *word = u64::from(pair[0]) | pair.get(1).map_or(0, |&high| u64::from(high) << 32);
        }
        strands.add(&row[..part.len().div_ceil(2)]);
    }
    mix(strands.joined(), halves.len() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every bit and the length count, also where words are not full. Oracle: no two of the digests agree.
    #[test]
    fn digests_differ_by_bit_and_length() {
        let numbers: Vec<f32> = (0..1031).map(|i| i as f32).collect();
        let mut seen = std::collections::HashSet::new();
        for length in [0, 1, 2, 511, 512, 513, 1030, 1031] {
            assert!(seen.insert(digest_of(&numbers[..length])), "{length}");
        }
        for (at, bit) in [(0, 0), (1, 31), (2, 5), (513, 7), (1030, 30)] {
            let mut other = numbers.clone();
            other[at] = f32::from_bits(other[at].to_bits() ^ 1 << bit);
            assert!(seen.insert(digest_of(&other)), "{at} {bit}");
        }
        let mut zeros = numbers.clone();
        zeros.push(0.0);
        assert!(seen.insert(digest_of(&zeros)));
    }
}
