//! Down the fixed part's octree, to cells in which both densities are smooth on every side.

use fft_correlate::Pose;
use glam::{DMat3, DVec3};

use super::blend::Blend;
use super::sums::Sums;
use super::truth::{TablePart, Truth};
use crate::geometry::facet::{Faces, Facet, clipped, octants, planes};
use crate::table::octree::{Cell, Within};

/// Leaves of the moving part smaller than this many cells make the cell be cut.
const FINER: f64 = 0.75;

/// Planes of one part in a cell that make it be cut, unless it is among the smallest.
const PLANES: usize = 4;

/// The smallest cells that many planes make, in the smallest of the octrees.
const SMALLEST: f64 = 0.25;

/// A cell nearer to a sharp edge than this many of its edges is cut.
const GRADED: f64 = 0.5;

/// The smallest cells where sharp edges of both parts meet, in the smallest of the octrees.
const MEETING: f64 = 0.25;

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
    pub(super) edges: &'a Edges,
}

/// Sharp edges of both parts near a cell, as indices.
#[derive(Debug, Clone)]
pub(super) struct Edges {
    fixed: Vec<u32>,
    moving: Vec<u32>,
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
        // Constant densities have no singular edges.
        let all = |n: usize| (0..if truth.varies { n as u32 } else { 0 }).collect();
        let edges = Edges {
            fixed: all(truth.fixed.table.edges.segments.len()),
            moving: all(truth.moving.table.edges.segments.len()),
        };
        walk.descend(&root, &facets, &edges);
        walk.sums
    }

    /// A point in the moving part's frame.
    pub(super) fn own(&self, p: DVec3) -> DVec3 {
        self.back * (p - self.pose.translation)
    }

    fn descend(&mut self, cell: &Cell, moving: &[Facet], edges: &Edges) {
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
                edges,
            });
        }
        let parts = octants(moving, cell.centre, self.rounding());
        for (index, part) in parts.iter().enumerate() {
            let child = table.child(cell, index);
            self.descend(&child, part, &self.near(edges, &child));
        }
    }

    /// Cuts a leaf until its densities are smooth and its planes few.
    fn cut(&mut self, place: &Place<'_>) {
        let Place {
            leaf,
            cell,
            fixed,
            moving,
            edges,
        } = place;
        let within = self.within(cell);
        let sides = self.truth.fixed.table.node(leaf.node).sides();
        if !self.truth.weights.any(sides, within.sides) {
            return;
        }
        let many = |facets: &[Facet]| facets.len() >= PLANES && planes(facets).len() >= PLANES;
        let large = 2.0 * cell.half > SMALLEST * self.truth.cells.smallest;
        let crowded = large && (many(fixed) || many(moving));
        if !(within.deeper || crowded || self.is_by_an_edge(edges, cell)) {
            return self.sum(place);
        }
        let own = octants(fixed, cell.centre, self.rounding());
        let other = octants(moving, cell.centre, self.rounding());
        for (index, (fixed, moving)) in own.iter().zip(&other).enumerate() {
            let cell = cell.octant(index, leaf.node);
            self.cut(&Place {
                leaf,
                cell,
                fixed,
                moving,
                edges: &self.near(edges, &cell),
            });
        }
    }

    /// The vectors from the fixed and the moving part's nearest sharp edge among `edges` to `p`, in
    /// the fixed frame.
    fn offsets(&self, edges: &Edges, p: DVec3) -> [Option<DVec3>; 2] {
        let nearest = |list: &[u32], part: &TablePart, p: DVec3| {
            let segments = &part.table.edges.segments;
            let offsets = list.iter().map(|e| segments[*e as usize].offset(p));
            offsets.min_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))
        };
        let moving = nearest(&edges.moving, &self.truth.moving, self.own(p));
        [
            nearest(&edges.fixed, &self.truth.fixed, p),
            moving.map(|d| self.turn * d),
        ]
    }

    /// How the gradients of both densities share in the force at `p`.
    pub(super) fn blend(&self, place: &Place<'_>, p: DVec3) -> Blend {
        let [fixed, moving] = self.offsets(place.edges, p);
        Blend::from_points(fixed, moving, self.truth.cells.tube)
    }

    /// Those of `edges` that are near a cell.
    fn near(&self, edges: &Edges, cell: &Cell) -> Edges {
        let reach = cell.radius() + self.truth.cells.tube;
        let own = self.own(cell.centre);
        let keep = |list: &[u32], part: &TablePart, p: DVec3| {
            let segments = &part.table.edges.segments;
            let near = |e: &u32| segments[*e as usize].offset(p).length() < reach;
            list.iter().copied().filter(near).collect()
        };
        Edges {
            fixed: keep(&edges.fixed, &self.truth.fixed, cell.centre),
            moving: keep(&edges.moving, &self.truth.moving, own),
        }
    }

    /// Whether a cell is too large for how near it is to sharp edges. Near edges of both parts the
    /// integrand of the force is singular, near one part's alone only discontinuous.
    fn is_by_an_edge(&self, edges: &Edges, cell: &Cell) -> bool {
        let edge = 2.0 * cell.half;
        let reach = cell.radius() + GRADED * edge;
        let offsets = self.offsets(edges, cell.centre);
        let least = match offsets {
            [Some(a), Some(b)] if a.distance(b) < edge => MEETING,
            _ => 1.0,
        };
        let near = offsets.iter().flatten().any(|d| d.length() < reach);
        near && edge > least * self.truth.cells.smallest
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
