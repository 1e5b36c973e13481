//! How densities are read between the nodes of their lattices.

use glam::DVec3;

/// How densities are read between the nodes of their lattices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reading {
    /// From eight nodes; passes through the values.
    Trilinear,
    /// By quadratic B-splines from 27 nodes: smooths by a quarter of a squared spacing per axis,
    /// everywhere alike.
    Quadratic,
}

impl Reading {
    /// Distance per axis beyond which a node counts for nothing, cells.
    pub(crate) fn reach(self) -> f64 {
        match self {
            Self::Trilinear => 1.0,
            Self::Quadratic => 1.5,
        }
    }

    /// Nodes per axis that are read.
    pub(crate) fn nodes(self) -> usize {
        match self {
            Self::Trilinear => 2,
            Self::Quadratic => 3,
        }
    }

    /// The first of them along each axis, for a place given as a fractional index.
    pub(crate) fn first(self, at: DVec3) -> DVec3 {
        match self {
            Self::Trilinear => at.floor(),
            Self::Quadratic => (at + 0.5).floor() - 1.0,
        }
    }

    /// Weight of the `n`th of them for a place `f` cells beyond the first, and its slope.
    pub(crate) fn tap(self, f: f64, n: usize) -> (f64, f64) {
        match (self, n) {
            (Self::Trilinear, 0) => (1.0 - f, -1.0),
            (Self::Trilinear, _) => (f, 1.0),
            (Self::Quadratic, 1) => (0.75 - (f - 1.0).powi(2), -2.0 * (f - 1.0)),
            (Self::Quadratic, _) => {
                let rest = 1.5 - (f - n as f64).abs();
                (0.5 * rest * rest, rest * (n as f64 - f).signum())
            }
        }
    }
}
