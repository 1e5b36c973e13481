//! Down the fixed part's octree, to cells in which both densities are smooth on every side.

use fft_correlate::Pose;
use glam::{DMat3, DVec3};

use super::sums::Sums;
use super::truth::Truth;
use crate::geometry::facet::{Faces, Facet, clipped, octants, planes};
use crate::table::octree::{Cell, Within};

/// Leaves of the moving part smaller than this many cells make the cell be cut.
const FINER: f64 = 0.75;

/// Planes of one part in a cell that make it be cut, unless it is among the smallest.
const PLANES: usize = 4;

/// The smallest cells that many planes make, in the smallest of the octrees.
const SMALLEST: f64 = 0.25;

/// Both parts at one pose.
pub(super) struct Walk<'a> {
    pub(super) truth: &'a Truth,
    pub(super) pose: Pose,
    pub(super) turn: DMat3,
    pub(super) back: DMat3,
    /// The moving part's faces in the fixed frame.
    pub(super) moved: Faces,
    /// Lengths below this are rounding, metres.
    pub(super) flat: f64,
    pub(super) sums: Sums,
}

/// A cell, the fixed part's leaf that it is or lies in, and the pieces of both surfaces in it.
pub(super) struct Place<'a> {
    pub(super) leaf: &'a Cell,
    pub(super) cell: Cell,
    pub(super) fixed: &'a [Facet],
    pub(super) moving: &'a [Facet],
}

impl<'a> Walk<'a> {
    /// The sums over all space.
    pub(super) fn over(truth: &'a Truth, pose: &Pose) -> Sums {
        let turn = DMat3::from_quat(pose.rotation);
        let moved = truth.moving.faces.moved(pose);
        let root = truth.fixed.table.root();
        let facets = clipped(&moved.facets, root.centre, root.half);
        let mut walk = Self {
            truth,
            pose: *pose,
            turn,
            back: turn.transpose(),
            moved,
            flat: 1e-8 * root.half,
            sums: Sums::default(),
        };
        walk.descend(&root, &facets);
        walk.sums
    }

    /// A point in the moving part's frame.
    pub(super) fn own(&self, p: DVec3) -> DVec3 {
        self.back * (p - self.pose.translation)
    }

    fn descend(&mut self, cell: &Cell, moving: &[Facet]) {
        let table = &self.truth.fixed.table;
        let node = table.node(cell.node);
        let within = self.within(cell);
        if !self.truth.weights.any(node.sides(), within.sides) {
            return;
        }
        if node.is_leaf() {
            let fixed = &node.facets;
            return self.cut(&Place {
                leaf: cell,
                cell: *cell,
                fixed,
                moving,
            });
        }
        let parts = octants(moving, cell.centre, self.rounding());
        for (index, part) in parts.iter().enumerate() {
            self.descend(&table.child(cell, index), part);
        }
    }

    /// Cuts a leaf until its densities are smooth and its planes few.
    fn cut(&mut self, place: &Place<'_>) {
        let Place {
            leaf,
            cell,
            fixed,
            moving,
        } = place;
        let within = self.within(cell);
        let sides = self.truth.fixed.table.node(leaf.node).sides();
        if !self.truth.weights.any(sides, within.sides) {
            return;
        }
        let many = |facets: &[Facet]| facets.len() >= PLANES && planes(facets).len() >= PLANES;
        let large = 2.0 * cell.half > SMALLEST * self.truth.cells.smallest;
        if !(within.deeper || large && (many(fixed) || many(moving))) {
            return self.sum(place);
        }
        let own = octants(fixed, cell.centre, self.rounding());
        let other = octants(moving, cell.centre, self.rounding());
        for (index, (fixed, moving)) in own.iter().zip(&other).enumerate() {
            self.cut(&Place {
                leaf,
                cell: cell.octant(index, leaf.node),
                fixed,
                moving,
            });
        }
    }

    fn rounding(&self) -> f64 {
        1e-4 * self.flat
    }

    /// What of the moving part's octree lies in a cell's bounds in its frame.
    fn within(&self, cell: &Cell) -> Within {
        let table = &self.truth.moving.table;
        let centre = self.own(cell.centre);
        let [x, y, z] = [self.back.x_axis, self.back.y_axis, self.back.z_axis];
        let half = (x.abs() + y.abs() + z.abs()) * cell.half;
        let depth = (table.root().half / (FINER * cell.half)).log2();
        table.within(centre, half, depth.clamp(0.0, 255.0) as u8)
    }
}
