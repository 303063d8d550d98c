//! A guide: directions from which light was seen to come, cell by cell, learnt once and frozen.
//!
//! Cells are the leaves of six kd-trees over positions, one for each axis that geometric normals are nearest to, split
//! at medians of what was recorded. A cell has a histogram over the octahedral map of the sphere, [`SIDE`]² bins.
//! Learnt is what a direction brings, f·cos·L, up to a multiple of the cell's mean, so that one record does not rule a
//! cell. (Measured in a room lit round a corner after all rounds, variance times rays: 0.60 with 600 records a cell and
//! a limit of 10; 0.62 with 1500 and 20; 0.78 if the root of the second moment is learnt, as in Rath et al. 2020.)
//! The share of a cell is chosen by records that its histogram has not seen; it is 0 where guiding does not pay. The
//! same records in the same order make the same guide.
//!
//! Limits: cells end abruptly, and bins have no light within them that is finer; both cost variance, never truth.

use glam::Vec3;

use super::directions::{Directions, mixed};

/// Bins along a side of the square.
pub const SIDE: usize = 16;

/// Most cells: 1.1 MB.
const MOST_CELLS: usize = 1024;

/// Records that a cell is worth.
const LEAST: usize = 600;

/// Most that a record counts, in means of its cell.
const LIMIT: f64 = 10.0;

/// Shares that a cell may have.
const SHARES: [f32; 3] = [0.25, 0.5, 0.75];

/// Share before cells have chosen.
const UNPROVEN: f32 = 0.5;

/// What a share must leave of the second moment.
const GAIN: f64 = 0.9;

/// A scattering of a path, and what came of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// Where, metres.
    pub p: Vec3,
    /// Geometric normal on the viewer's side.
    pub n: Vec3,
    /// Where the path went.
    pub wi: Vec3,
    /// Density with which the BSDF chooses that, sr⁻¹.
    pub bsdf_pdf_sa: f32,
    /// Density with which it was chosen.
    pub pdf_sa: f32,
    /// f·cos·L/pdf, grey.
    pub value: f32,
}

/// A node of a kd-tree.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// Axis that it splits; 3 for a leaf.
    axis: u32,
    /// Where, metres.
    at: f32,
    /// The node below `at` (the other one follows), or the cell.
    child: u32,
}

/// Axis of a leaf.
const LEAF: u32 = 3;

/// Numbers of a cell.
const CELL: usize = SIDE + SIDE * SIDE + 1;

/// A histogram, cumulated.
#[derive(Clone, Debug)]
struct Cell {
    share: f32,
    /// Probability of the rows up to each.
    rows: [f32; SIDE],
    /// Probability of the bins of each row up to each, within the row.
    bins: [[f32; SIDE]; SIDE],
}

/// See the module.
#[derive(Clone, Debug)]
pub struct Guide {
    /// Six roots first.
    nodes: Vec<Node>,
    cells: Vec<Cell>,
}

impl Directions for Guide {
    #[inline]
    fn cell(&self, p: Vec3, n: Vec3) -> u32 {
        let mut node = &self.nodes[side_of(n)];
        while node.axis != LEAF {
            let right = p[node.axis as usize] >= node.at;
            node = &self.nodes[(node.child + u32::from(right)) as usize];
        }
        node.child
    }

    #[inline]
    fn share(&self, cell: u32) -> f32 {
        self.cells[cell as usize].share
    }

    #[inline]
    fn draw(&self, cell: u32, u: [f32; 2]) -> Vec3 {
        let cell = &self.cells[cell as usize];
        let (row, y) = choose(&cell.rows, u[0]);
        let (bin, x) = choose(&cell.bins[row], u[1]);
        direction([bin as f32 + x, row as f32 + y].map(|x| x * (2.0 / SIDE as f32) - 1.0))
    }

    #[inline]
    fn pdf_sa(&self, cell: u32, wi: Vec3) -> f32 {
        let cell = &self.cells[cell as usize];
        let (bin, row) = bin_of(wi);
        let p = probability(&cell.rows, row) * probability(&cell.bins[row], bin);
        p * (SIDE * SIDE) as f32 * 0.25 * stretch(wi)
    }
}

/// The axis that a normal is nearest to, and its sign.
fn side_of(n: Vec3) -> usize {
    let a = n.abs();
    let axis = if a.x >= a.y && a.x >= a.z { 0 } else { 1 + usize::from(a.z > a.y) };
    2 * axis + usize::from(n[axis] < 0.0)
}

/// The interval that `u` falls into, and where within it, in [0,1).
#[inline]
fn choose(cumulated: &[f32; SIDE], u: f32) -> (usize, f32) {
    let mut number = 0;
    let mut step = SIDE / 2;
    while step > 0 {
        number += if cumulated[number + step - 1] <= u { step } else { 0 };
        step /= 2;
    }
    let below = if number == 0 { 0.0 } else { cumulated[number - 1] };
    (number, ((u - below) / (cumulated[number] - below)).clamp(0.0, 1.0))
}

#[inline]
fn probability(cumulated: &[f32; SIDE], number: usize) -> f32 {
    cumulated[number] - if number == 0 { 0.0 } else { cumulated[number - 1] }
}

/// Octahedral map: from [−1, 1]² to the unit sphere.
#[inline]
fn direction([x, y]: [f32; 2]) -> Vec3 {
    let z = 1.0 - x.abs() - y.abs();
    let fold = |a: f32, b: f32| (1.0 - b.abs()) * 1.0f32.copysign(a);
    let (x, y) = if z < 0.0 { (fold(x, y), fold(y, x)) } else { (x, y) };
    Vec3::new(x, y, z).normalize()
}

/// Its inverse.
#[inline]
fn square(d: Vec3) -> [f32; 2] {
    let d = d / (d.x.abs() + d.y.abs() + d.z.abs());
    let fold = |a: f32, b: f32| (1.0 - b.abs()) * 1.0f32.copysign(a);
    if d.z < 0.0 { [fold(d.x, d.y), fold(d.y, d.x)] } else { [d.x, d.y] }
}

/// Area of the square per solid angle: |p|³ of the point p of the octahedron.
#[inline]
fn stretch(d: Vec3) -> f32 {
    let sum = d.x.abs() + d.y.abs() + d.z.abs();
    1.0 / (sum * sum * sum)
}

/// Column and row.
#[inline]
fn bin_of(wi: Vec3) -> (usize, usize) {
    let [x, y] = square(wi).map(|x| (((x + 1.0) * (0.5 * SIDE as f32)) as usize).min(SIDE - 1));
    (x, y)
}

impl Guide {
    /// Learns from `records`.
    pub fn learn(records: &[Record]) -> Guide {
        let mut order: Vec<u32> = (0..records.len() as u32).collect();
        order.sort_by_key(|&i| side_of(records[i as usize].n));
        let mut guide = Guide { nodes: vec![Node { axis: LEAF, at: 0.0, child: 0 }; 6], cells: Vec::new() };
        let least = LEAST.max(records.len().div_ceil(MOST_CELLS - 6));
        let mut rest = &mut order[..];
        for side in 0..6 {
            let len = rest.partition_point(|&i| side_of(records[i as usize].n) == side);
            let (own, others) = rest.split_at_mut(len);
            guide.grow(side, own, records, least);
            rest = others;
        }
        guide
    }

    /// Makes `node` the tree of the records `order`.
    fn grow(&mut self, node: usize, order: &mut [u32], records: &[Record], least: usize) {
        let p = |i: &u32| records[*i as usize].p;
        let (low, high) =
            order.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), i| (l.min(p(i)), h.max(p(i))));
        let extent = high - low;
        let axis = if extent.x >= extent.y && extent.x >= extent.z { 0 } else { 1 + usize::from(extent.z > extent.y) };
        let middle = order.len() / 2;
        if order.len() >= 2 * least {
            order.select_nth_unstable_by(middle, |a, b| p(a)[axis].total_cmp(&p(b)[axis]).then(a.cmp(b)));
            let at = p(&order[middle])[axis];
            if at > low[axis] {
                let child = self.nodes.len();
                self.nodes.resize(child + 2, Node { axis: LEAF, at: 0.0, child: 0 });
                self.nodes[node] = Node { axis: axis as u32, at, child: child as u32 };
                let (below, above) = order.split_at_mut(middle);
                self.grow(child, below, records, least);
                self.grow(child + 1, above, records, least);
                return;
            }
        }
        self.nodes[node].child = self.cells.len() as u32;
        order.sort_unstable();
        self.cells.push(Cell::learn(order.iter().map(|&i| &records[i as usize])));
    }

    /// Chooses the share of each cell by `records` that it has not learnt from: the one of the least second moment,
    /// if that is less by a tenth than without.
    pub fn prove(&mut self, records: &[Record]) {
        let mut moments = vec![[0.0f64; 1 + SHARES.len()]; self.cells.len()];
        let mut means = vec![[0.0f64; 2]; self.cells.len()];
        for record in records {
            let mean = &mut means[self.cell(record.p, record.n) as usize];
            *mean = [mean[0] + f64::from(record.value), mean[1] + 1.0];
        }
        for record in records.iter().filter(|record| record.value > 0.0) {
            let cell = self.cell(record.p, record.n);
            let pdf_sa = self.pdf_sa(cell, record.wi);
            let [sum, count] = means[cell as usize];
            let value = f64::from(record.value).min(LIMIT * sum / count);
            let square = value * value * f64::from(record.pdf_sa);
            let moments = &mut moments[cell as usize];
            moments[0] += square / f64::from(record.bsdf_pdf_sa);
            for (moment, share) in moments[1..].iter_mut().zip(SHARES) {
                *moment += square / f64::from(mixed(share, pdf_sa, record.bsdf_pdf_sa));
            }
        }
        for (cell, moments) in self.cells.iter_mut().zip(moments) {
            let with = SHARES.into_iter().zip(&moments[1..]);
            let best = with.min_by(|a, b| a.1.total_cmp(b.1));
            cell.share = best.filter(|(_, moment)| **moment < GAIN * moments[0]).map_or(0.0, |(share, _)| share);
        }
    }

    /// The same with one share everywhere.
    pub fn with_share(mut self, share: f32) -> Guide {
        self.cells.iter_mut().for_each(|cell| cell.share = share);
        self
    }

    /// Number of cells, and of those that guide.
    pub fn cells(&self) -> (usize, usize) {
        (self.cells.len(), self.cells.iter().filter(|cell| cell.share > 0.0).count())
    }

    /// Nodes of its trees.
    pub fn nodes(&self) -> usize {
        self.nodes.len()
    }

    /// How many numbers a guide of so many nodes and cells has; `None` where there is none of that size.
    pub fn bits_of(nodes: usize, cells: usize) -> Option<usize> {
        let is_one = (6..=2 * MOST_CELLS).contains(&nodes) && (6..=MOST_CELLS).contains(&cells);
        is_one.then_some(3 * nodes + CELL * cells)
    }

    /// A guide of its [numbers](Self::bits), the first ones of `nodes` nodes; `None` where they are none.
    pub fn of_bits(nodes: usize, bits: &[u32]) -> Option<Guide> {
        let (of_nodes, of_cells) = bits.split_at_checked(3 * nodes)?;
        let (of_cells, []) = of_cells.as_chunks::<CELL>() else { return None };
        let node = |&[axis, at, child]: &[u32; 3]| Node { axis, at: f32::from_bits(at), child };
        let nodes: Vec<Node> = of_nodes.as_chunks::<3>().0.iter().map(node).collect();
        let cells = of_cells.iter().map(Cell::of_bits).collect::<Option<Vec<Cell>>>()?;
        // Children come behind their parents, so that every walk ends.
        let leads_on = |(number, node): (usize, &Node)| match node.axis {
            LEAF => (node.child as usize) < cells.len(),
            axis => axis < LEAF && node.child as usize > number && node.child as usize + 1 < nodes.len(),
        };
        let is_guide = nodes.len() >= 6 && nodes.iter().enumerate().all(leads_on);
        is_guide.then_some(Guide { nodes, cells })
    }

    /// Its numbers, by which guides are told apart.
    pub fn bits(&self) -> impl Iterator<Item = u32> + '_ {
        let nodes = self.nodes.iter().flat_map(|node| [node.axis, node.at.to_bits(), node.child]);
        let values = |cell: &'_ Cell| [&cell.rows[..], cell.bins.as_flattened(), &[cell.share]].concat();
        nodes.chain(self.cells.iter().flat_map(values).map(f32::to_bits).collect::<Vec<_>>())
    }
}

impl Cell {
    /// A cell of its numbers; `None` where they are none.
    fn of_bits(bits: &[u32; CELL]) -> Option<Cell> {
        let values = bits.map(f32::from_bits);
        let (cumulated, share) = (values[..CELL - 1].as_chunks::<SIDE>().0, values[CELL - 1]);
        let rises = |values: &[f32; SIDE]| values[0] >= 0.0 && values.is_sorted() && values[SIDE - 1] == 1.0;
        let is_cell = (share == 0.0 || SHARES.contains(&share)) && cumulated.iter().all(rises);
        let cell = || Cell { share, rows: cumulated[0], bins: std::array::from_fn(|row| cumulated[1 + row]) };
        is_cell.then(cell)
    }

    fn learn<'r>(records: impl Iterator<Item = &'r Record> + Clone) -> Cell {
        let (sum, count) =
            records.clone().fold((0.0, 0.0), |(sum, n), record| (sum + f64::from(record.value), n + 1.0));
        let mut brought = [[0.0f64; SIDE]; SIDE];
        for record in records {
            let (bin, row) = bin_of(record.wi);
            brought[row][bin] += f64::from(record.value).min(LIMIT * sum / count);
        }
        let each = |of: &dyn Fn(usize, usize) -> f64| -> [[f64; SIDE]; SIDE] {
            std::array::from_fn(|row| std::array::from_fn(|bin| of(row, bin)))
        };
        let mut values = each(&|row, bin| smoothed(&brought, row, bin));
        if !(sum > 0.0 && sum < f64::INFINITY) {
            // Uniform, but for what the solid angle of a bin differs from that of its middle.
            let middle = |i: usize| (i as f32 + 0.5) * (2.0 / SIDE as f32) - 1.0;
            values = each(&|row, bin| f64::from(1.0 / stretch(direction([middle(bin), middle(row)]))));
        }
        let cumulated = |weights: [f64; SIDE]| {
            let sum: f64 = weights.iter().sum();
            let mut so_far = 0.0;
            let mut cumulated = weights.map(|weight| {
                so_far += weight;
                if sum > 0.0 { (so_far / sum) as f32 } else { 1.0 }
            });
            cumulated[SIDE - 1] = 1.0;
            cumulated
        };
        let rows = cumulated(values.map(|row| row.iter().sum()));
        Cell { share: UNPROVEN, rows, bins: values.map(cumulated) }
    }
}

/// Mean over a bin and those around it, which the octahedral map continues behind its edges.
fn smoothed(values: &[[f64; SIDE]; SIDE], row: usize, bin: usize) -> f64 {
    const LAST: isize = SIDE as isize - 1;
    let mut sum = 0.0;
    for (dy, across) in [(-1, 0.25), (0, 0.5), (1, 0.25)] {
        for (dx, along) in [(-1, 0.25), (0, 0.5), (1, 0.25)] {
            let (mut y, mut x) = (row as isize + dy, bin as isize + dx);
            if !(0..=LAST).contains(&y) {
                (y, x) = (y.clamp(0, LAST), LAST - x);
            }
            if !(0..=LAST).contains(&x) {
                (y, x) = (LAST - y, x.clamp(0, LAST));
            }
            sum += values[y as usize][x as usize] * across * along;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A guide is its numbers, and numbers that would lead a walk astray are none. Oracle: by hand.
    #[test]
    fn numbers_make_the_same_guide_or_none() {
        let record = |i: u32| {
            let at = i as f32 / 5000.0;
            let wi = direction([2.0 * at - 1.0, 0.25]);
            Record { p: Vec3::new(at, 0.5, 0.0), n: Vec3::Y, wi, bsdf_pdf_sa: 0.3, pdf_sa: 0.3, value: 1.0 + at }
        };
        let records: Vec<Record> = (0..5000).map(record).collect();
        let guide = Guide::learn(&records).with_share(0.25);
        let (nodes, bits): (usize, Vec<u32>) = (guide.nodes(), guide.bits().collect());
        assert!(nodes > 6 && Guide::bits_of(nodes, guide.cells().0) == Some(bits.len()));
        let same = Guide::of_bits(nodes, &bits).expect("a guide");
        assert!(same.bits().eq(guide.bits()));
        let wrong = |at: usize, value: u32| {
            let mut bits = bits.clone();
            bits[at] = value;
            Guide::of_bits(nodes, &bits).is_none()
        };
        let leaf = (0..nodes).find(|node| bits[3 * node] == LEAF).expect("a leaf");
        let split = (0..nodes).find(|node| bits[3 * node] < LEAF).expect("a split");
        assert!(wrong(3 * leaf + 2, u32::MAX) && wrong(3 * leaf, 4), "cells and axes that there are not");
        assert!(wrong(3 * split + 2, split as u32) && wrong(3 * split + 2, nodes as u32 - 1), "walks without end");
        let cell = 3 * nodes;
        assert!(
            wrong(cell, f32::NAN.to_bits()) && wrong(cell, 2f32.to_bits()) && wrong(cell + CELL - 1, 1f32.to_bits())
        );
        assert!(Guide::of_bits(nodes, &bits[1..]).is_none() && Guide::bits_of(5, 6).is_none());
    }
}
