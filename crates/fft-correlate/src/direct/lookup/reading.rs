//! How values between the nodes of a lattice are found.

/// How values between the nodes of a lattice are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::direct) enum Reading {
    /// From eight nodes; passes through the values.
    Trilinear,
    /// By quadratic B-splines from 27 nodes: smooths by a quarter of a squared spacing per axis,
    /// everywhere alike.
    Quadratic,
}

impl Reading {
    /// Padded index up to which nothing is met, when the first value stands at index
    /// [`super::grid::PAD`].
    pub(super) fn innermost(self) -> f32 {
        match self {
            Self::Trilinear => 1.0,
            Self::Quadratic => 0.5,
        }
    }

    /// Nodes per side of the box of nodes over which a point sees the mean that stands for `2^level`
    /// of them per side, when it looks at every `stride`-th node.
    ///
    /// Reading at a spacing of `s` cells smooths with variance s²/6 per axis trilinearly, in the
    /// mean over all places, s²/4 by B-splines; the block asks for `(4^level - 1) / 12` on top of
    /// what reading single cells does. A box of n nodes makes up the difference:
    /// `n² = 2 s² + 2`, or `s² + 3`. Cubes have isotropic covariance, so this holds for every
    /// rotation between the two.
    pub(super) fn box_nodes(self, stride: usize) -> usize {
        let squared = match self {
            Self::Trilinear => 2 * stride * stride + 2,
            Self::Quadratic => stride * stride + 3,
        };
        (squared as f64).sqrt().round() as usize
    }
}
