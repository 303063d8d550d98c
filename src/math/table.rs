//! Discrete distributions, drawn from one number in [0,1): [`AliasTable`] in constant time, [`Distribution2D`] by
//! inverting rows and columns (which keeps neighbouring numbers in neighbouring cells, as low-discrepancy points want).
//!
//! Weights are summed in f64 and then apportioned to the 2^24 steps of a lattice: the values that a uniform `f32` in
//! [0,1) distinguishes. Every positive weight gets at least one step, a zero weight none, and the steps add up to 2^24.
//! So the probability that is reported is the probability with which the cell is drawn, exactly, for any number of
//! cells and any spread of weights; rounding costs a little variance instead of a bias.
//! Source of the alias method: Vose 1991 (IEEE Trans. Softw. Eng. 17:9), here in integers, so no cell is left over.
//! Limit: 2^24 cells an axis.

/// Steps of [0,1) that a uniform f32 distinguishes: all multiples of 2^-24 are exact.
const LATTICE: u32 = 1 << 24;
/// One step.
const STEP: f32 = 1.0 / LATTICE as f32;
/// The largest f32 below 1.
const BELOW_ONE: f32 = 1.0 - STEP;

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
fn lattice_step(u: f32) -> (u32, f32) {
    debug_assert!((0.0..1.0).contains(&u), "u = {u} is not in [0,1)");
    let scaled = u * LATTICE as f32;
    // By way of i32, which converts in one instruction.
    let step = (scaled as i32 as u32).min(LATTICE - 1);
    (step, scaled - step as i32 as f32)
}

/// Cumulative steps: `out[i]..out[i + 1]` are the steps of cell i. `out` has one entry more than `weights`.
fn apportion(weights: &[f64], out: &mut [u32]) -> Result<f64, TableError> {
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

/// A cell drawn from an [`AliasTable`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// The cell.
    pub index: u32,
    /// Probability with which it is drawn.
    pub p: f32,
    /// What is left of the random number, in [0,1): uniform again, with as many bits as the cell had steps.
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

/// A cell drawn from a [`Distribution2D`], and a point in it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cell {
    /// Column, from 0.
    pub column: u32,
    /// Row, from 0.
    pub row: u32,
    /// Position within the cell, each in [0,1).
    pub within: [f32; 2],
    /// Probability with which the cell is drawn.
    pub p: f32,
}

/// A [`Cell`] for each of `N` points, as columns.
#[derive(Clone, Copy, Debug)]
pub struct Cells<const N: usize> {
    /// Columns, from 0.
    pub column: [u32; N],
    /// Rows, from 0.
    pub row: [u32; N],
    /// Positions within the cells along u and v, each in [0,1).
    pub within: [[f32; N]; 2],
    /// Probabilities with which the cells are drawn.
    pub p: [f32; N],
}

/// A point of the unit square and the density with which it is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SquarePoint {
    /// Columns run along u, rows along v.
    pub uv: [f32; 2],
    /// Per unit of area of the square.
    pub pdf_uv: f32,
}

/// Piecewise constant distribution over a grid of cells.
#[derive(Clone, Debug)]
pub struct Distribution2D {
    width: u32,
    height: u32,
    /// Cumulative steps of the rows, `height + 1`.
    rows: Vec<u32>,
    /// Cumulative steps of the columns of each row, `height × (width + 1)`; all 0 in a row without weight.
    columns: Vec<u32>,
    row_guide: Guide,
    /// One after the other, for each row.
    column_guide: Guide,
}

/// Where to look in cumulative steps: [0,1) cut into as many equal parts as there are cells, and the cell at the start of
/// each part. Inversion then searches between two neighbours: in constant time on the average, and as exact as before.
/// Source: Chen and Asau 1974 (AIIE Trans. 6:2).
#[derive(Clone, Debug, Default)]
struct Guide {
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
    fn new(cells: usize) -> Self {
        Guide { cells: Vec::new(), shift: LATTICE.trailing_zeros() - cells.next_power_of_two().trailing_zeros() }
    }

    /// Entries that a table has.
    fn stride(&self) -> usize {
        (LATTICE >> self.shift) as usize + 1
    }

    fn push(&mut self, cumulative: &[u32]) {
        let mut cell = 0;
        for part in 0..self.stride() as u32 {
            while cell + 2 < cumulative.len() && cumulative[cell + 1] <= part << self.shift {
                cell += 1;
            }
            self.cells.push(cell as u32);
        }
    }

    /// For each lane the first cell of table `tables[i]` that ends after `steps[i]`. `cumulative` are the tables one after
    /// the other, `stride` entries each.
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

impl Distribution2D {
    /// The distribution proportional to the weights that `fill_row(row, weights)` writes; `weights` has `width` entries.
    pub fn new(width: u32, height: u32, mut fill_row: impl FnMut(u32, &mut [f64])) -> Result<Self, TableError> {
        let stride = width as usize + 1;
        let mut weights = vec![0.0; width as usize];
        let mut row_weights = vec![0.0; height as usize];
        let mut columns = vec![0; stride * height as usize];
        for row in 0..height {
            fill_row(row, &mut weights);
            let first = row as usize * stride;
            match apportion(&weights, &mut columns[first..first + stride]) {
                Ok(total) => row_weights[row as usize] = total,
                Err(TableError::Empty) => {}
                Err(TableError::Invalid { index, weight }) => {
                    return Err(TableError::Invalid { index: row as usize * width as usize + index, weight });
                }
                Err(error) => return Err(error),
            }
        }
        let mut rows = vec![0; height as usize + 1];
        apportion(&row_weights, &mut rows)?;
        let (mut row_guide, mut column_guide) = (Guide::new(height as usize), Guide::new(width as usize));
        row_guide.push(&rows);
        columns.chunks_exact(stride).for_each(|row| column_guide.push(row));
        Ok(Distribution2D { width, height, rows, columns, row_guide, column_guide })
    }

    /// Probability with which the cell is drawn; exactly 0 where the weight was 0.
    #[inline]
    pub fn p(&self, column: u32, row: u32) -> f32 {
        let first = row as usize * (self.width as usize + 1) + column as usize;
        let p_row = (self.rows[row as usize + 1] - self.rows[row as usize]) as f32 * STEP;
        p_row * ((self.columns[first + 1] - self.columns[first]) as f32 * STEP)
    }

    /// The cell that (u, v) in [0,1)² falls into, and where in the cell.
    #[inline]
    pub fn sample_cell(&self, u: f32, v: f32) -> Cell {
        let cells = self.sample_cells(&[u], &[v]);
        Cell {
            column: cells.column[0],
            row: cells.row[0],
            within: [cells.within[0][0], cells.within[1][0]],
            p: cells.p[0],
        }
    }

    /// [`sample_cell`](Self::sample_cell) for `N` points together. A search reads two tables one after the other, and each is a wait
    /// for memory where the grid is large: those of different points overlap.
    #[inline(always)]
    pub fn sample_cells<const N: usize>(&self, u: &[f32; N], v: &[f32; N]) -> Cells<N> {
        let rows = invert(&self.rows, self.height as usize + 1, &self.row_guide, &[0; N], v);
        let columns = invert(&self.columns, self.width as usize + 1, &self.column_guide, &rows.cell, u);
        let mut p = [0.0; N];
        for i in 0..N {
            p[i] = rows.p[i] * columns.p[i];
        }
        Cells { column: columns.cell, row: rows.cell, within: [columns.within, rows.within], p }
    }

    /// A point of the unit square, uniform within its cell.
    #[inline]
    pub fn sample(&self, u: f32, v: f32) -> SquarePoint {
        let cell = self.sample_cell(u, v);
        let along = |index: u32, within: f32, count: u32| ((index as f32 + within) / count as f32).min(BELOW_ONE);
        let uv = [along(cell.column, cell.within[0], self.width), along(cell.row, cell.within[1], self.height)];
        SquarePoint { uv, pdf_uv: cell.p * (self.width as f32 * self.height as f32) }
    }

    /// Density of [`sample`](Self::sample) at a point of the unit square, per unit of area.
    #[inline]
    pub fn pdf(&self, uv: [f32; 2]) -> f32 {
        let cell = |x: f32, count: u32| ((x * count as f32) as u32).min(count - 1);
        self.p(cell(uv[0], self.width), cell(uv[1], self.height)) * (self.width as f32 * self.height as f32)
    }
}

/// Cells along one axis.
struct Inverted<const N: usize> {
    cell: [u32; N],
    /// Position within the cell, in [0,1).
    within: [f32; N],
    p: [f32; N],
}

/// The cells of cumulative steps that the numbers `u` fall into. The position within takes the middle of each step: a cell of
/// few steps is then covered by a midpoint rule instead of its left edges.
#[inline(always)]
fn invert<const N: usize>(
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

#[cfg(test)]
mod tests {
    use super::*;

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

    /// Exhaustive along each axis; the joint law is the product because the two numbers are used apart.
    #[test]
    fn grid_draws_exactly_what_it_reports() {
        let weights = [[0.0, 1.0, 2.0, 0.0], [0.0; 4], [1e6, 1.0, 1e-3, 5.0]];
        let grid =
            Distribution2D::new(4, 3, |row, w| w.copy_from_slice(&weights[row as usize])).expect("valid weights");
        let mut rows = [0u32; 3];
        let mut columns = [[0u32; 4]; 3];
        for step in 0..LATTICE {
            let u = step as f32 * STEP;
            rows[grid.sample_cell(0.5, u).row as usize] += 1;
            for v in [0.0, BELOW_ONE] {
                let cell = grid.sample_cell(u, v);
                columns[cell.row as usize][cell.column as usize] += 1;
            }
        }
        assert_eq!(rows[1], 0);
        let total: f64 = weights.iter().flatten().sum();
        for (r, row) in weights.iter().enumerate() {
            for (c, &weight) in row.iter().enumerate() {
                let p = f64::from(rows[r]) / f64::from(LATTICE) * (f64::from(columns[r][c]) / f64::from(LATTICE));
                assert_eq!(p as f32, grid.p(c as u32, r as u32), "cell {c}, {r}");
                assert_eq!(p == 0.0, weight == 0.0, "cell {c}, {r}");
                assert!((p - weight / total).abs() < 8.0 * f64::from(STEP), "cell {c}, {r}");
            }
        }
    }

    /// Oracle: the cells in ascending order, one after the other. Weights from none to a cell that holds nearly everything, so
    /// that searches end at once and go far. Exact, deterministic.
    #[test]
    fn cells_of_many_points_are_those_of_a_linear_search() {
        let (width, height) = (100, 7);
        let weight = |row: usize, column: usize| match (row, column * 37 % 11) {
            (2, _) | (_, 0) => 0.0,
            (3, 1) => 1e9,
            (_, place) => place as f64 * 10f64.powi(row as i32 - place as i32),
        };
        let grid = Distribution2D::new(width as u32, height as u32, |row, weights| {
            (0..width).for_each(|column| weights[column] = weight(row as usize, column));
        });
        let grid = grid.expect("valid weights");
        let search = |cumulative: &[u32], u: f32| -> u32 {
            (1..cumulative.len()).find(|&i| cumulative[i] > lattice_step(u).0).expect("the last is above") as u32 - 1
        };
        for round in 0..5000u32 {
            let number = |i: usize, k: u32| {
                let mixed = (round * 32 + i as u32 * 2 + k).wrapping_mul(0x9E37_79B9) ^ k.wrapping_mul(0x85EB_CA6B);
                (mixed >> 8) as f32 * STEP
            };
            let u: [f32; 16] = std::array::from_fn(|i| if i == 0 { BELOW_ONE } else { number(i, 0) });
            let v: [f32; 16] = std::array::from_fn(|i| if i == 1 { BELOW_ONE } else { number(i, 1) });
            let cells = grid.sample_cells(&u, &v);
            for i in 0..16 {
                let row = search(&grid.rows, v[i]);
                let column = search(&grid.columns[row as usize * (width + 1)..][..width + 1], u[i]);
                assert_eq!((cells.column[i], cells.row[i]), (column, row));
                assert_eq!(cells.p[i], grid.p(column, row));
                let cell = grid.sample_cell(u[i], v[i]);
                assert_eq!((cell.column, cell.row, cell.p), (column, row, cells.p[i]));
                assert_eq!(cell.within, [cells.within[0][i], cells.within[1][i]]);
            }
        }
    }

    #[test]
    fn grid_points_have_the_density_of_their_cell() {
        let grid =
            Distribution2D::new(3, 2, |row, w| w.copy_from_slice(&[1.0, f64::from(row), 4.0])).expect("valid weights");
        for i in 0..1000 {
            let (u, v) = ((i as f32 + 0.5) / 1000.0, (i * 37 % 1000) as f32 / 1000.0);
            let point = grid.sample(u, v);
            assert_eq!(point.pdf_uv, grid.pdf(point.uv));
            assert!(point.pdf_uv > 0.0);
        }
        let integral: f32 =
            (0..6).map(|i| grid.pdf([(i % 3) as f32 / 3.0 + 0.1, (i / 3) as f32 / 2.0 + 0.1]) / 6.0).sum();
        assert!((integral - 1.0).abs() < 1e-6);
    }
}
