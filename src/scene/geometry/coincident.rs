//! Triangles that lie on one another in one plane and are not the same to look at: the two sides of a sheet that an
//! exporter wrote as two faces, a liquid that touches its glass. A ray meets them at one distance, and which of them it
//! is then told is an accident of rounding and of the order in which a hierarchy is walked. They are known
//! beforehand, so that light transport can decide by rule.

/// The triangles of a scene that lie on others.
#[derive(Clone, Debug, Default)]
pub struct Coincident {
    /// A bit for each record; empty where there are none.
    pub(super) flags: Vec<u64>,
    /// Records with partners, ascending.
    pub(super) records: Vec<u32>,
    /// Where the partners of each begin, and the end.
    pub(super) first: Vec<u32>,
    /// Records of the same mesh: of each, those that face its way and may come before it, those that face the other
    /// way, and those that face its way and come after it; each ascending.
    pub(super) partners: Vec<u32>,
    /// Where the first and the second of these groups end.
    pub(super) ends: Vec<[u32; 2]>,
    /// A bit for each record with a partner in the first group.
    pub(super) contested: Vec<u64>,
    /// Whether some were not looked at.
    pub(super) crowded: bool,
    /// Whether those between instanced placements were not all looked for.
    pub(super) unsearched: bool,
    /// Whether placements that move have faces that lie on those of others that move.
    pub(super) moving: bool,
}

/// The triangles on one, by what a ray that meets it in front, or from behind, may meet in its place.
#[derive(Clone, Copy, Debug)]
pub struct Partners<'a> {
    /// All.
    pub all: &'a [u32],
    /// In front: those that face the same way and may come before it.
    pub before: &'a [u32],
    /// From behind: these and those that face the other way.
    pub behind: &'a [u32],
}

impl Coincident {
    /// Whether there are none.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// Whether there may be some between instanced placements, which were too many to be looked at.
    pub fn unsearched(&self) -> bool {
        self.unsearched
    }

    /// Whether there are some between placements that move; they are not among those that are known.
    pub fn moving(&self) -> bool {
        self.moving
    }

    /// Whether planes were so crowded that some may have been missed.
    pub fn crowded(&self) -> bool {
        self.crowded
    }

    /// The triangles that lie on others, ascending.
    pub fn records(&self) -> &[u32] {
        &self.records
    }

    /// Whether the triangle of record `record` lies on others.
    #[inline(always)]
    pub fn has(&self, record: u32) -> bool {
        bit(&self.flags, record)
    }

    /// Whether one of those that face its way may come before it.
    #[inline(always)]
    pub fn is_contested(&self, record: u32) -> bool {
        bit(&self.contested, record)
    }

    /// The triangles on the one of record `record`.
    #[cold]
    pub fn of(&self, record: u32) -> Partners<'_> {
        let Ok(at) = self.records.binary_search(&record) else {
            return Partners { all: &[], before: &[], behind: &[] };
        };
        let ([start, end], [first, second]) = ([self.first[at], self.first[at + 1]], self.ends[at]);
        let of = |end: u32| &self.partners[start as usize..end as usize];
        Partners { all: of(end), before: of(first), behind: of(second) }
    }
}

#[inline(always)]
fn bit(bits: &[u64], record: u32) -> bool {
    bits.get(record as usize / 64).is_some_and(|bits| bits >> (record % 64) & 1 == 1)
}
