//! The edges of a triangle soup and the faces on each.

use rayon::slice::ParallelSliceMut;

/// One use of an edge by a face.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct EdgeUse {
    /// The end with the lower index.
    pub(super) low: u32,
    /// The end with the higher index.
    pub(super) high: u32,
    /// The face.
    pub(super) face: u32,
    /// Which of the face's edges it is: from corner `side` to the next.
    pub(super) side: u8,
    /// True if the face runs from `low` to `high`.
    pub(super) forward: bool,
}

/// All edges, each with its uses.
pub(super) struct Edges {
    uses: Vec<EdgeUse>,
}

impl Edges {
    /// The edges of triangles with three distinct corners each.
    pub(super) fn of(triangles: &[[u32; 3]]) -> Self {
        let mut uses = Vec::with_capacity(3 * triangles.len());
        for (face, t) in triangles.iter().enumerate() {
            for side in 0..3 {
                let (a, b) = (t[side], t[(side + 1) % 3]);
                uses.push(EdgeUse {
                    low: a.min(b),
                    high: a.max(b),
                    face: face as u32,
                    side: side as u8,
                    forward: a < b,
                });
            }
        }
        uses.par_sort_unstable();
        Self { uses }
    }

    /// The uses of each edge, edges in order of their ends, uses in order of faces.
    pub(super) fn iter(&self) -> impl Iterator<Item = &[EdgeUse]> {
        self.uses
            .chunk_by(|a, b| (a.low, a.high) == (b.low, b.high))
    }

    /// Number of edges for which `condition` holds.
    pub(super) fn count(&self, condition: impl Fn(&[EdgeUse]) -> bool) -> usize {
        self.iter().filter(|uses| condition(uses)).count()
    }

    /// The boundary of the oriented surface as directed edges: each edge as often as it is used
    /// more in one direction than in the other. As many of them enter each vertex as leave it.
    pub(super) fn boundary(&self) -> Vec<[u32; 2]> {
        let mut boundary = Vec::new();
        for uses in self.iter() {
            let net = net_uses(uses);
            let EdgeUse { low, high, .. } = uses[0];
            let edge = if net > 0 { [low, high] } else { [high, low] };
            boundary.extend(std::iter::repeat_n(edge, net.unsigned_abs()));
        }
        boundary
    }
}

/// How much more often an edge is used from its low to its high end than the other way.
pub(super) fn net_uses(uses: &[EdgeUse]) -> isize {
    uses.iter().map(|u| if u.forward { 1 } else { -1 }).sum()
}

/// True for an edge of two faces that run along it in the same direction.
pub(super) fn inconsistent(uses: &[EdgeUse]) -> bool {
    uses.len() == 2 && uses[0].forward == uses[1].forward
}
