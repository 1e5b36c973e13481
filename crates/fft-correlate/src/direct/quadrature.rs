//! Quadrature points of one part: its cells, merged where the density is smooth.
//!
//! A cell gives one point at its node with weight `blend(node) * cell volume`; a cell cut by the
//! boundary carries its average. Blocks of 2, 4, 8, ... cells per side merge into one point that
//! keeps their total weight and centroid, in the order of their ratio
//! `block side / smallest distance to the boundary in the block`: the density is invariant under
//! scaling, so it varies over lengths proportional to that distance and the error of a merged
//! point grows with the square of the ratio. No weight is ever dropped.

use glam::DVec3;
use ndarray::Array3;
use num_complex::Complex64;
use sdf_grid::DensityField;

use super::plan::Blend;

/// Blocks of up to `2^LEVELS` cells per side merge.
const LEVELS: usize = 6;

/// A quadrature point: place (metres, the part's frame) and weight (density times volume).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Point {
    pub(super) position: DVec3,
    pub(super) weight: Complex64,
}

/// The blocks of one part's cells and their ratios, from which point sets of any size follow.
pub(super) struct Blocks<'a> {
    field: &'a DensityField,
    blend: Blend,
    /// Cells that contribute.
    cells: usize,
    /// `levels[l]`: for each block of `2^(l+1)` cells per side its ratio, negative if it holds no
    /// cell that contributes.
    levels: Vec<Array3<f32>>,
    /// `(ratio, points saved)` of every block that holds at least two points of the level below.
    merges: Vec<(f32, u8)>,
}

impl<'a> Blocks<'a> {
    pub(super) fn new(field: &'a DensityField, blend: Blend) -> Self {
        let mut blocks = Self {
            field,
            blend,
            cells: blend.count(field),
            levels: Vec::new(),
            merges: Vec::new(),
        };
        for level in 0..LEVELS {
            blocks.add_level(level);
            if blocks.levels[level].len() == 1 {
                break;
            }
        }
        blocks
    }

    /// Cells that contribute: the number of points before any merging.
    pub(super) fn cells(&self) -> usize {
        self.cells
    }

    /// `(ratio, points saved)` of every possible merge.
    pub(super) fn merges(&self) -> &[(f32, u8)] {
        &self.merges
    }

    /// Ratio of a single cell, `h / distance`, negative if it does not contribute.
    fn cell_ratio(&self, index: [usize; 3]) -> f32 {
        if self.blend.is_zero_at(self.field, index) {
            return -1.0;
        }
        let spacing = self.field.lattice.spacing() as f32;
        // Cells on the boundary all count as a quarter of a spacing away, so that the smallest
        // blocks of them merge first if they must.
        spacing / self.field.signed_distance[index].abs().max(0.25 * spacing)
    }

    fn add_level(&mut self, level: usize) {
        let below = match level {
            0 => self.field.lattice.shape(),
            _ => self.levels[level - 1].dim().into(),
        };
        let ratio_below = |index: [usize; 3]| match level {
            0 => self.cell_ratio(index),
            _ => self.levels[level - 1][index],
        };
        let shape = below.map(|n| n.div_ceil(2));
        let mut merges = Vec::new();
        let ratios = Array3::from_shape_fn(shape, |(i, j, k)| {
            let (mut ratio, mut points) = (-1.0f32, 0u8);
            for child in children([i, j, k], below) {
                let r = ratio_below(child);
                points += u8::from(r >= 0.0);
                ratio = ratio.max(2.0 * r);
            }
            if points == 0 {
                return -1.0;
            }
            if points > 1 {
                merges.push((ratio, points - 1));
            }
            ratio
        });
        self.levels.push(ratios);
        self.merges.append(&mut merges);
    }

    /// The points when every block with a ratio of at most `limit` is merged; in octree order, so
    /// that neighbours in the list are neighbours in space.
    pub(super) fn points(&self, limit: f32) -> Vec<Point> {
        let mut points = Vec::new();
        let top = self.levels.len() - 1;
        for ((i, j, k), _) in self.levels[top].indexed_iter() {
            self.collect(top + 1, [i, j, k], limit, &mut points);
        }
        points
    }

    fn collect(&self, level: usize, index: [usize; 3], limit: f32, points: &mut Vec<Point>) {
        if level == 0 {
            if !self.blend.is_zero_at(self.field, index) {
                points.push(self.cell(index));
            }
            return;
        }
        let ratio = self.levels[level - 1][index];
        if ratio < 0.0 {
            return;
        }
        if ratio <= limit {
            points.push(self.merged(level, index));
            return;
        }
        for child in children(index, self.shape(level - 1)) {
            self.collect(level - 1, child, limit, points);
        }
    }

    fn shape(&self, level: usize) -> [usize; 3] {
        match level {
            0 => self.field.lattice.shape(),
            _ => self.levels[level - 1].dim().into(),
        }
    }

    fn cell(&self, index: [usize; 3]) -> Point {
        let widen = |v: num_complex::Complex32| Complex64::new(v.re.into(), v.im.into());
        let rho = self.blend.exterior * widen(self.field.exterior[index])
            + self.blend.interior * widen(self.field.interior[index]);
        Point {
            position: self.field.lattice.position(index),
            weight: rho * self.field.lattice.cell_volume(),
        }
    }

    /// One point for all cells of a block: total weight at the centroid of the absolute weights.
    fn merged(&self, level: usize, index: [usize; 3]) -> Point {
        let shape = self.field.lattice.shape();
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

/// The smallest ratio, at least `accepted`, at which all sets together have at most `max_points`
/// points (or the ratio that merges everything, if even that leaves more).
pub(super) fn merge_limit(sets: &[Blocks], accepted: f32, max_points: Option<usize>) -> f32 {
    let mut merges: Vec<(f32, u8)> = sets.iter().flat_map(|s| s.merges()).copied().collect();
    merges.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut points: usize = sets.iter().map(Blocks::cells).sum();
    let mut limit = accepted;
    for (ratio, saved) in merges {
        if ratio > limit && max_points.is_none_or(|max| points <= max) {
            break;
        }
        limit = limit.max(ratio);
        points -= usize::from(saved);
    }
    limit
}
