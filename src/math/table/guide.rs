//! Inversion of cumulative steps along one axis: which cell a number in [0,1) falls into, and where in the cell. A
//! guide says where to begin; `N` searches go side by side, since each waits for memory where tables are large.

use super::lattice::{BELOW_ONE, LATTICE, STEP, lattice_step};

/// Where to look in cumulative steps: [0,1) cut into as many equal parts as there are cells, and the cell at the start
/// of each part. Inversion then searches between two neighbours: in constant time on the average, and as exact as
/// before. Source: Chen and Asau 1974 (AIIE Trans. 6:2).
#[derive(Clone, Debug, Default)]
pub(super) struct Guide {
    /// For each table, its number of parts + 1 cells.
    cells: Vec<u32>,
    /// log2 of the steps of a part.
    shift: u32,
}

/// Cells of some lanes and the steps that are theirs: `begin..end`.
struct Found<const N: usize> {
    cell: [u32; N],
    begin: [u32; N],
    end: [u32; N],
}

impl Guide {
    /// Room for tables of `cells` cells each; none yet.
    pub fn new(cells: usize) -> Self {
        Guide { cells: Vec::new(), shift: LATTICE.trailing_zeros() - cells.next_power_of_two().trailing_zeros() }
    }

    /// Entries that a table has.
    fn stride(&self) -> usize {
        (LATTICE >> self.shift) as usize + 1
    }

    /// Adds the next table, cumulative steps of its cells.
    pub fn push(&mut self, cumulative: &[u32]) {
        let mut cell = 0;
        for part in 0..self.stride() as u32 {
            while cell + 2 < cumulative.len() && cumulative[cell + 1] <= part << self.shift {
                cell += 1;
            }
            self.cells.push(cell as u32);
        }
    }

    /// For each lane the first cell of table `tables[i]` that ends after `steps[i]`. `cumulative` are the tables one
    /// after the other, `stride` entries each.
    #[inline(always)]
    fn find<const N: usize>(&self, cumulative: &[u32], stride: usize, tables: &[u32; N], steps: &[u32; N]) -> Found<N> {
        let (mut first, mut last) = ([0; N], [0; N]);
        for i in 0..N {
            let at = tables[i] as usize * self.stride() + (steps[i] >> self.shift) as usize;
            (first[i], last[i]) = (self.cells[at], self.cells[at + 1]);
        }
        let mut found = Found { cell: first, begin: [0; N], end: [0; N] };
        for i in 0..N {
            let at = tables[i] as usize * stride + first[i] as usize;
            (found.begin[i], found.end[i]) = (cumulative[at], cumulative[at + 1]);
        }
        // Most often the first cell is the one.
        for i in 0..N {
            if found.end[i] <= steps[i] {
                let table = &cumulative[tables[i] as usize * stride..][..stride];
                let next = first[i] as usize + 1;
                let cell = next + table[next + 1..=last[i] as usize].partition_point(|&end| end <= steps[i]);
                found.cell[i] = cell as u32;
                (found.begin[i], found.end[i]) = (table[cell], table[cell + 1]);
            }
        }
        found
    }
}

/// Cells along one axis.
pub(super) struct Inverted<const N: usize> {
    /// The cells, from 0.
    pub cell: [u32; N],
    /// Positions within the cells, in [0,1).
    pub within: [f32; N],
    /// Probabilities of the cells.
    pub p: [f32; N],
}

/// The cells of cumulative steps that the numbers `u` fall into. The position within takes the middle of each step: a
/// cell of few steps is then covered by a midpoint rule instead of its left edges.
#[inline(always)]
pub(super) fn invert<const N: usize>(
    cumulative: &[u32],
    stride: usize,
    guide: &Guide,
    tables: &[u32; N],
    u: &[f32; N],
) -> Inverted<N> {
    let mut steps = [0; N];
    for i in 0..N {
        steps[i] = lattice_step(u[i]).0;
    }
    let found = guide.find(cumulative, stride, tables, &steps);
    let mut inverted = Inverted { cell: found.cell, within: [0.0; N], p: [0.0; N] };
    for i in 0..N {
        // Steps fit into an i32, and i32 converts in one instruction.
        let own = (found.end[i] - found.begin[i]) as i32 as f32;
        inverted.within[i] = (((steps[i] - found.begin[i]) as i32 as f32 + 0.5) / own).min(BELOW_ONE);
        inverted.p[i] = own * STEP;
    }
    inverted
}
