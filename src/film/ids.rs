//! Lists of ids: which things the samples of a pixel met, and how often. All of them are kept until a picture is
//! written, and weights are whole numbers, so that parts of a picture add up to the same lists whatever the split and
//! the order.
//!
//! A sample counts 1, or −1 where the pixel filter is negative: the weights of one filter have one magnitude
//! (`filter.rs`), which shares do not depend on. Memory: a list of at most min(samples, names + 1) entries a pixel, 16
//! bytes each, beside 24 for the list.

use std::cmp::Ordering;

/// "Nothing was met", as the id that no name has.
pub const NOTHING: u32 = 0;

/// One id of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Which: bits of an f32.
    pub id: u32,
    /// Samples that met it, those of negative weight taken off.
    pub samples: i64,
}

/// The ids of one pixel, ascending.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ids(Vec<Count>);

impl Ids {
    /// From entries of ascending ids; `None` where they are not.
    pub(super) fn from_counts(counts: Vec<Count>) -> Option<Ids> {
        counts.windows(2).all(|pair| pair[0].id < pair[1].id).then_some(Ids(counts))
    }

    /// All entries, ascending.
    pub fn counts(&self) -> &[Count] {
        &self.0
    }

    /// Forgets all samples.
    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }

    /// Adds a sample that met `id`.
    #[inline]
    pub(crate) fn add(&mut self, id: u32, samples: i64) {
        match self.0.binary_search_by_key(&id, |count| count.id) {
            Ok(at) => self.0[at].samples += samples,
            Err(at) => self.0.insert(at, Count { id, samples }),
        }
    }

    /// Adds the samples of another list.
    pub(crate) fn merge(&mut self, other: &Ids) {
        let more = other.0.iter().filter(|count| self.0.binary_search_by_key(&count.id, |own| own.id).is_err()).count();
        let (mut own, mut others) = (self.0.len(), other.0.len());
        self.0.reserve_exact(more);
        self.0.resize(own + more, Count::default());
        // From the largest down, in place.
        for at in (0..own + more).rev() {
            let (a, b) = (self.0[..own].last().copied(), other.0[..others].last().copied());
            let (taken, order) = match (a, b) {
                (Some(a), Some(b)) if a.id == b.id => (Count { samples: a.samples + b.samples, ..a }, Ordering::Equal),
                (Some(a), Some(b)) if a.id < b.id => (b, Ordering::Less),
                (None, Some(b)) => (b, Ordering::Less),
                (Some(a), _) => (a, Ordering::Greater),
                (None, None) => unreachable!("as many entries as the two lists name"),
            };
            self.0[at] = taken;
            own -= usize::from(order.is_ge());
            others -= usize::from(order.is_le());
        }
    }

    /// Every id but [`NOTHING`] with its share of the pixel, the largest first, of equal ones the smaller id. Empty
    /// where the weights cancel.
    pub fn ranked(&self) -> Vec<(u32, f64)> {
        let all: i64 = self.0.iter().map(|count| count.samples).sum();
        let met = self.0.iter().filter(|count| count.id != NOTHING && count.samples != 0 && all != 0);
        let mut shares: Vec<(u32, f64)> = met.map(|count| (count.id, count.samples as f64 / all as f64)).collect();
        shares.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        shares
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    /// Oracle: a map. Whatever the split of the samples, and whichever part comes first. Deterministic.
    #[test]
    fn lists_add_up_whatever_the_order() {
        let id = |i: u32| (i * i * 7 + i / 3) % 23;
        let sign = |i: u32| if i.is_multiple_of(5) { -1 } else { 1 };
        let list = |range: std::ops::Range<u32>| {
            let mut ids = Ids::default();
            range.for_each(|i| ids.add(id(i), sign(i)));
            ids
        };
        let mut map = BTreeMap::new();
        (0..200).for_each(|i| *map.entry(id(i)).or_insert(0) += sign(i));
        let whole = list(0..200);
        assert!(whole.counts().iter().map(|count| (count.id, count.samples)).eq(map));
        for cut in [0, 1, 3, 64, 199, 200] {
            let (first, second) = (list(0..cut), list(cut..200));
            let [mut forwards, mut backwards] = [first.clone(), second.clone()];
            forwards.merge(&second);
            backwards.merge(&first);
            assert_eq!((&forwards, &backwards), (&whole, &whole), "{cut}");
        }
    }

    /// Oracle: by hand.
    #[test]
    fn shares_are_ranked() {
        let ids = |counts: &[(u32, i64)]| {
            Ids::from_counts(counts.iter().map(|&(id, samples)| Count { id, samples }).collect()).expect("ascending")
        };
        let list = ids(&[(NOTHING, 2), (3, 1), (5, 4), (9, 1), (11, 0)]);
        assert_eq!(list.ranked(), [(5, 0.5), (3, 0.125), (9, 0.125)]);
        // A negative lobe at an edge, and samples that are all negative.
        assert_eq!(ids(&[(3, 5), (9, -1)]).ranked(), [(3, 1.25), (9, -0.25)]);
        assert_eq!(ids(&[(3, -2)]).ranked(), [(3, 1.0)]);
        assert_eq!(ids(&[(3, 1), (9, -1)]).ranked(), []);
        assert_eq!(Ids::from_counts(vec![Count { id: 2, samples: 1 }; 2]), None);
    }
}
