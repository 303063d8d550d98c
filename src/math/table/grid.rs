//! Piecewise constant distribution over a grid of cells: a row is drawn by its sum, then a column within the row, each
//! by inversion, so that neighbouring numbers lie in neighbouring cells. Probabilities are those of cells, or densities
//! per unit of area of the unit square. Limit: 2^24 cells along each axis.

use super::guide::{Guide, invert};
use super::lattice::{BELOW_ONE, STEP, TableError, apportion};

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

impl Distribution2D {
    /// The distribution proportional to the weights that `fill_row(row, weights)` writes; `weights` has `width`
    /// entries.
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

    /// [`sample_cell`](Self::sample_cell) for `N` points together. A search reads two tables one after the other, and
    /// each is a wait for memory where the grid is large: those of different points overlap.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::table::lattice::{LATTICE, lattice_step};

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

    /// Oracle: the cells in ascending order, one after the other. Weights from none to a cell that holds nearly
    /// everything, so that searches end at once and go far. Exact, deterministic.
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
