//! Quadrature points of one part: its cells, merged where the density is smooth.
//!
//! A cell gives one point at its node with weight `blend(node) * cell volume`; a cell cut by the
//! boundary carries its average. Blocks of 2, 4, 8, 16 cells per side merge into one point that
//! keeps their total weight and centroid. The cost of a merge is the larger of
//!
//! - the standard deviation of the density within the block over the part's root mean square: the
//!   other part's density has its own ridges there when the two fit, and the product of the two
//!   deviations is what a merged point misses;
//! - a tenth of `side of the block / smallest distance to the boundary in it`, so that contact
//!   stays sharp: a wall that enters the block is felt over its side.
//!
//! Merges happen in the order of their cost, in all blocks of the same cost at once, which keeps
//! the symmetry of the parts. No weight is ever dropped. A merged point is looked up in a density
//! averaged over its block, so that a boundary that crosses the block does little harm.

use glam::DVec3;
use ndarray::Array3;
use num_complex::{Complex32, Complex64};
use sdf_grid::DensityField;

use crate::direct::terms::{Blend, Term};
use crate::pair::fields::Pair;
use crate::pair::reach::BLOCK;

/// Blocks of up to `2^LEVELS` cells per side merge.
const LEVELS: usize = 4;
/// Cost of a block as wide as its distance to the boundary.
const NEARNESS: f32 = 0.1;

/// A quadrature point: place (metres, the part's frame) and weight (density times volume).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Point {
    pub(super) position: DVec3,
    pub(super) weight: Complex64,
}

/// The blocks of one part's cells and their costs, from which point sets of any size follow.
pub(super) struct Blocks<'a> {
    field: &'a DensityField,
    blend: Blend,
    /// Cells that contribute.
    cells: usize,
    /// `levels[l]`: blocks of `2^(l+1)` cells per side.
    levels: Vec<Array3<Node>>,
    /// Root mean square density of the cells that contribute.
    rms: f64,
    /// `(cost, points saved)` of every block that holds at least two points of the level below.
    merges: Vec<(f32, u8)>,
}

/// A block of cells: sums of its densities, and the cost of making it one point.
#[derive(Debug, Clone, Copy)]
struct Node {
    cost: f32,
    /// Smallest distance to the boundary, metres; infinite if empty.
    distance: f32,
    sum: Complex64,
    square: f64,
}

impl Node {
    const EMPTY: Self = Self {
        cost: 0.0,
        distance: f32::INFINITY,
        sum: Complex64::ZERO,
        square: 0.0,
    };

    fn is_occupied(&self) -> bool {
        self.distance.is_finite()
    }
}

impl<'a> Blocks<'a> {
    pub(super) fn new(field: &'a DensityField, blend: Blend) -> Self {
        let mut blocks = Self {
            field,
            blend,
            cells: blend.count(field),
            levels: Vec::new(),
            rms: 0.0,
            merges: Vec::new(),
        };
        let cells =
            (0..field.lattice().len()).map(|f| blocks.cell_node(field.lattice().unravel(f)).square);
        blocks.rms = (cells.sum::<f64>() / blocks.cells.max(1) as f64).sqrt();
        for level in 1..=LEVELS {
            blocks.add_level(level);
        }
        blocks
    }

    /// Cells that contribute: the number of points before any merging.
    pub(super) fn cells(&self) -> usize {
        self.cells
    }

    /// `(cost, points saved)` of every possible merge.
    pub(super) fn merges(&self) -> &[(f32, u8)] {
        &self.merges
    }

    /// Sums over one cell; `points` is 0 if it does not contribute.
    fn cell_node(&self, index: [usize; 3]) -> Node {
        if self.blend.is_zero_at(self.field, index) {
            return Node::EMPTY;
        }
        let weight = self.cell(index).weight / self.field.lattice().cell_volume();
        let spacing = self.field.lattice().spacing() as f32;
        Node {
            cost: 0.0,
            // Cells on the boundary all count as a quarter of a spacing away, so that the smallest
            // blocks of them merge first if they must.
            distance: self.field.signed_distance[index].abs().max(0.25 * spacing),
            sum: weight,
            square: weight.norm_sqr(),
        }
    }

    fn node(&self, level: usize, index: [usize; 3]) -> Node {
        match level {
            0 => self.cell_node(index),
            _ => self.levels[level - 1][index],
        }
    }

    /// Blocks of `2^level` cells per side.
    fn add_level(&mut self, level: usize) {
        let below = self.shape(level - 1);
        let side = (1 << level) as f32 * self.field.lattice().spacing() as f32;
        let cells = (1u64 << (3 * level)) as f64;
        let mut merges = Vec::new();
        let nodes = Array3::from_shape_fn(below.map(|n| n.div_ceil(2)), |(i, j, k)| {
            let (mut block, mut points) = (Node::EMPTY, 0u8);
            for child in children([i, j, k], below) {
                let child = self.node(level - 1, child);
                points += u8::from(child.is_occupied());
                block.cost = block.cost.max(child.cost);
                block.distance = block.distance.min(child.distance);
                block.sum += child.sum;
                block.square += child.square;
            }
            if points > 0 {
                let variance = block.square / cells - (block.sum / cells).norm_sqr();
                let variation = (variance.max(0.0)).sqrt() / self.rms;
                let own = (variation as f32).max(NEARNESS * side / block.distance);
                block.cost = block.cost.max(own);
            }
            if points > 1 {
                merges.push((block.cost, points - 1));
            }
            block
        });
        self.levels.push(nodes);
        self.merges.append(&mut merges);
    }

    /// The points when every block of a cost of at most `limit` is merged, those that stand for
    /// `2^l` cells per side in the l-th list; in octree order, so that neighbours in a list are
    /// neighbours in space.
    pub(super) fn points(&self, limit: f32) -> Vec<Vec<Point>> {
        let mut points = vec![Vec::new(); self.levels.len() + 1];
        let top = self.levels.len() - 1;
        for ((i, j, k), _) in self.levels[top].indexed_iter() {
            self.collect(top + 1, [i, j, k], limit, &mut points);
        }
        points
    }

    fn collect(&self, level: usize, index: [usize; 3], limit: f32, points: &mut [Vec<Point>]) {
        if level == 0 {
            if !self.blend.is_zero_at(self.field, index) {
                points[0].push(self.cell(index));
            }
            return;
        }
        let block = self.levels[level - 1][index];
        if !block.is_occupied() {
            return;
        }
        if block.cost <= limit {
            points[level].push(self.merged(level, index));
            return;
        }
        for child in children(index, self.shape(level - 1)) {
            self.collect(level - 1, child, limit, points);
        }
    }

    fn shape(&self, level: usize) -> [usize; 3] {
        match level {
            0 => self.field.lattice().shape(),
            _ => self.levels[level - 1].dim().into(),
        }
    }

    fn cell(&self, index: [usize; 3]) -> Point {
        let widen = |v: num_complex::Complex32| Complex64::new(v.re.into(), v.im.into());
        let rho = self.blend.exterior * widen(self.field.exterior[index])
            + self.blend.interior * widen(self.field.interior[index]);
        Point {
            position: self.field.lattice().position(index),
            weight: rho * self.field.lattice().cell_volume(),
        }
    }

    /// One point for all cells of a block: total weight at the centroid of the absolute weights.
    fn merged(&self, level: usize, index: [usize; 3]) -> Point {
        let shape = self.field.lattice().shape();
        let range = |a: usize| index[a] << level..((index[a] + 1) << level).min(shape[a]);
        let (mut weight, mut mass, mut moment) = (Complex64::ZERO, 0.0, DVec3::ZERO);
        for i in range(0) {
            for j in range(1) {
                for k in range(2) {
                    let cell = self.cell([i, j, k]);
                    let m = cell.weight.norm();
                    weight += cell.weight;
                    mass += m;
                    moment += m * cell.position;
                }
            }
        }
        Point {
            position: moment / mass,
            weight,
        }
    }
}

/// The blocks (or cells) of the level below inside block `index`.
fn children(index: [usize; 3], below: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (0..8).filter_map(move |c| {
        let child = [
            2 * index[0] + (c >> 2),
            2 * index[1] + (c >> 1 & 1),
            2 * index[2] + (c & 1),
        ];
        (0..3).all(|a| child[a] < below[a]).then_some(child)
    })
}

/// The smallest cost, at least `accepted`, at which all sets together have at most `max_points`
/// points (or the cost that merges everything, if even that leaves more).
pub(super) fn merge_limit(sets: &[Blocks], accepted: f32, max_points: Option<usize>) -> f32 {
    let mut merges: Vec<(f32, u8)> = sets.iter().flat_map(|s| s.merges()).copied().collect();
    merges.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut points: usize = sets.iter().map(Blocks::cells).sum();
    let mut limit = accepted;
    for (cost, saved) in merges {
        if cost > limit && max_points.is_none_or(|max| points <= max) {
            break;
        }
        limit = limit.max(cost);
        points -= usize::from(saved);
    }
    limit
}

/// Nodes along the sides of the bricks in which points are listed, so that neighbours in the list
/// are neighbours in space.
const BRICK: usize = 4;

/// Values below this share of that at a large flat face, the outermost rim of what smoothing spreads,
/// are left out.
const NEGLIGIBLE: f64 = 1e-3;

/// Every cell of a part that counts, with its node and the blend there times its volume.
pub(super) struct Cells {
    points: Vec<Point>,
    /// Where the points of each block of [`BLOCK`] nodes per side end.
    ends: Vec<usize>,
}

impl Cells {
    /// Those that are the points of a term.
    pub(super) fn new(pair: &Pair, term: &Term) -> Self {
        let (field, blend) = (pair.part(term.points), term.weights);
        let widen = |v: Complex32| Complex64::new(v.re.into(), v.im.into());
        let value = |index: [usize; 3]| {
            blend.exterior * widen(field.exterior[index])
                + blend.interior * widen(field.interior[index])
        };
        let weight = blend.exterior.abs().max(blend.interior.abs());
        let least = (NEGLIGIBLE * weight * pair.face_density()).powi(2);
        let lattice = field.lattice();
        let volume = lattice.cell_volume();
        let whole = pair.whole_lattice(term.points);
        let (first, shape) = (pair.first_node(term.points), lattice.shape());
        let end: [usize; 3] = std::array::from_fn(|a| first[a] + shape[a]);
        let mut cells = Self {
            points: Vec::new(),
            ends: Vec::new(),
        };
        for block in boxes(first.map(|n| n / BLOCK), end.map(|n| n.div_ceil(BLOCK))) {
            let bricks = block.map(|n| n * BLOCK / BRICK);
            for brick in boxes(bricks, bricks.map(|n| n + BLOCK / BRICK)) {
                let nodes = brick.map(|n| n * BRICK);
                for node in boxes(nodes, nodes.map(|n| n + BRICK)) {
                    if (0..3).any(|a| node[a] < first[a] || node[a] >= end[a]) {
                        continue;
                    }
                    let index = std::array::from_fn(|a| node[a] - first[a]);
                    let weight = value(index);
                    if weight.norm_sqr() > least {
                        cells.points.push(Point {
                            position: whole.position(node),
                            weight: weight * volume,
                        });
                    }
                }
            }
            cells.ends.push(cells.points.len());
        }
        cells
    }

    pub(super) fn count(&self) -> usize {
        self.points.len()
    }

    /// The points of each block.
    pub(super) fn groups(&self) -> Vec<&[Point]> {
        let starts = std::iter::once(&0).chain(&self.ends);
        let ranges = starts.zip(&self.ends).map(|(from, to)| *from..*to);
        ranges.map(|range| &self.points[range]).collect()
    }
}

/// Indices from the first to before the last, the last direction fastest.
fn boxes(from: [usize; 3], to: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (from[0]..to[0]).flat_map(move |i| {
        (from[1]..to[1]).flat_map(move |j| (from[2]..to[2]).map(move |k| [i, j, k]))
    })
}
