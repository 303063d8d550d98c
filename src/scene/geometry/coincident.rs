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
    /// Records of the same mesh, ascending.
    pub(super) partners: Vec<u32>,
    /// Whether some were not looked at.
    pub(super) crowded: bool,
}

impl Coincident {
    /// Whether there are none.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// Whether planes or placements were so crowded that some may have been missed.
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
        self.flags.get(record as usize / 64).is_some_and(|bits| bits >> (record % 64) & 1 == 1)
    }

    /// The triangles on the one of record `record`, ascending.
    #[inline(always)]
    pub fn of(&self, record: u32) -> &[u32] {
        if self.has(record) { self.partners_of(record) } else { &[] }
    }

    #[cold]
    fn partners_of(&self, record: u32) -> &[u32] {
        match self.records.binary_search(&record) {
            Ok(at) => &self.partners[self.first[at] as usize..self.first[at + 1] as usize],
            Err(_) => &[],
        }
    }
}
