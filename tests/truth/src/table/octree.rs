//! Looking up one-sided densities.

use glam::DVec3;

use super::fit::{Density, Fit, evaluate};
use super::one_sided::Side;
use super::sharp::{Near, SharpEdges};
use crate::geometry::facet::Facet;

/// No children, or no fit.
pub(super) const NONE: u32 = u32::MAX;

/// Both unit densities of a part as quadratic fits in the cells of an octree, each side's continued
/// to the whole of a cell that the surface cuts.
#[derive(Debug, Clone)]
pub(crate) struct DensityTable {
    pub(super) centre: DVec3,
    /// Half the edge of the root, metres.
    pub(super) half: f64,
    pub(super) nodes: Vec<Node>,
    pub(super) fits: Vec<Fit>,
    pub(crate) edges: SharpEdges,
}

/// A cube of the octree.
#[derive(Debug, Clone)]
pub(crate) struct Node {
    /// The first of eight children, or [`NONE`].
    pub(super) first: u32,
    /// Depth of the deepest leaf below.
    pub(super) deepest: u8,
    /// Which sides have a density somewhere below: bit 0 outside, bit 1 inside.
    pub(super) sides: u8,
    /// Of a leaf, its fits.
    pub(super) fits: [u32; 2],
    /// Of a leaf, the pieces of the surface in it.
    pub(crate) facets: Vec<Facet>,
    /// Of a leaf, the sharp edges near it.
    pub(super) near: Near,
}

/// What of an octree lies in a box.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Within {
    /// As [`Node::sides`].
    pub(crate) sides: u8,
    /// Whether a leaf deeper than asked for is among it.
    pub(crate) deeper: bool,
}

/// A cube of the octree, or one that cuts a leaf further.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cell {
    pub(crate) node: u32,
    pub(crate) centre: DVec3,
    /// Half an edge, metres.
    pub(crate) half: f64,
}

impl Cell {
    /// Half the diagonal, metres.
    pub(crate) fn radius(&self) -> f64 {
        self.half * 3f64.sqrt()
    }

    /// Part `index` of eight, its bits telling the upper half along x, y, z.
    pub(crate) fn octant(&self, index: usize, node: u32) -> Self {
        let sign = |axis: usize| if index >> axis & 1 == 1 { 0.5 } else { -0.5 };
        let offset = DVec3::new(sign(0), sign(1), sign(2)) * self.half;
        Self {
            node,
            centre: self.centre + offset,
            half: 0.5 * self.half,
        }
    }
}

impl Node {
    pub(crate) fn is_leaf(&self) -> bool {
        self.first == NONE
    }

    pub(crate) fn sides(&self) -> u8 {
        self.sides
    }
}

impl DensityTable {
    /// How many cells there are.
    pub(crate) fn len(&self) -> usize {
        self.nodes.len()
    }

    pub(crate) fn root(&self) -> Cell {
        Cell {
            node: 0,
            centre: self.centre,
            half: self.half,
        }
    }

    pub(crate) fn node(&self, index: u32) -> &Node {
        &self.nodes[index as usize]
    }

    /// Child `index` of a cell whose node is no leaf.
    pub(crate) fn child(&self, cell: &Cell, index: usize) -> Cell {
        cell.octant(index, self.node(cell.node).first + index as u32)
    }

    /// The leaf that holds `p`, unless it lies beyond the root.
    pub(crate) fn leaf(&self, p: DVec3) -> Option<Cell> {
        let mut cell = self.root();
        if (p - cell.centre).abs().max_element() > cell.half {
            return None;
        }
        while !self.node(cell.node).is_leaf() {
            let above = p.cmpge(cell.centre);
            let index = above.bitmask() as usize;
            cell = self.child(&cell, index);
        }
        Some(cell)
    }

    /// A side's density at a point of a leaf; zero where that side has none.
    pub(crate) fn in_leaf(&self, leaf: &Cell, p: DVec3, side: Side) -> Density {
        let node = self.node(leaf.node);
        if !node.near.is_empty()
            && let Some((place, change)) = self.edges.outward(&node.near, p)
        {
            let read = self.leaf(place);
            let read = read.map_or_else(Density::default, |l| self.fitted(&l, place, side));
            return read.moved(&change);
        }
        self.fitted(leaf, p, side)
    }

    fn fitted(&self, leaf: &Cell, p: DVec3, side: Side) -> Density {
        let fit = self.node(leaf.node).fits[side as usize];
        if fit == NONE {
            return Density::default();
        }
        let u = (p - leaf.centre) / leaf.half;
        evaluate(&self.fits[fit as usize], u, leaf.half)
    }

    /// A side's density at any point; zero beyond the root.
    pub(crate) fn at(&self, p: DVec3, side: Side) -> Density {
        match self.leaf(p) {
            Some(leaf) => self.in_leaf(&leaf, p, side),
            None => Density::default(),
        }
    }

    /// What lies in the box around `centre` with half edges `half`.
    pub(crate) fn within(&self, centre: DVec3, half: DVec3, depth: u8) -> Within {
        let mut found = Within {
            sides: 0,
            deeper: false,
        };
        self.gather(&self.root(), (centre, half), depth, &mut found);
        found
    }

    fn gather(&self, cell: &Cell, bounds: (DVec3, DVec3), depth: u8, found: &mut Within) {
        let node = self.node(cell.node);
        let news = node.sides & !found.sides != 0 || (node.deepest > depth && !found.deeper);
        let gap = (bounds.0 - cell.centre).abs() - bounds.1;
        if !news || gap.max_element() >= cell.half {
            return;
        }
        if node.is_leaf() {
            found.sides |= node.sides;
            found.deeper |= node.deepest > depth;
            return;
        }
        for index in 0..8 {
            self.gather(&self.child(cell, index), bounds, depth, found);
        }
    }
}
