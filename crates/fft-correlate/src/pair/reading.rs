//! How densities are read between the nodes of their lattices.

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
}
