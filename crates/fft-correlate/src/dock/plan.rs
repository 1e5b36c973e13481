//! What docking will do and need, known before any field is computed.

use std::fmt;

use crate::correlate::CorrelatorPlan;
use crate::pair::builder::PairPlan;

/// What docking will do and need, known before any field is computed: data to print and compare.
#[derive(Debug, Clone, PartialEq)]
pub struct DockingPlan {
    /// The pairs of [`crate::SearchPairs`]: sketch (without which a search over few rotations does),
    /// coarse, fine.
    pub pairs: [PairPlan; 3],
    /// The pair under the setup's own halo, on the fine lattice, whose energies are reported; absent
    /// where the halo of the search is the setup's.
    pub own: Option<PairPlan>,
    /// Rotations to look at.
    pub rotations: usize,
    /// The scores on the coarse lattice: sizes, memory and time, those of the computed pair at most.
    pub scores: CorrelatorPlan,
}

impl DockingPlan {
    /// Bytes that scoring with this many threads takes at most.
    pub fn scoring_bytes(&self, threads: usize) -> u64 {
        self.scores.bytes(threads)
    }

    /// Bytes of the fields that are held at once.
    pub fn field_bytes(&self) -> u64 {
        self.pairs
            .iter()
            .chain(&self.own)
            .map(|pair| pair.bytes)
            .sum()
    }
}

impl fmt::Display for DockingPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, pair) in ["sketch", "coarse", "fine"].iter().zip(&self.pairs) {
            write!(f, "{name}: {pair}; ")?;
        }
        if let Some(own) = &self.own {
            write!(f, "own halo: {own}; ")?;
        }
        write!(f, "at most {} rotations x {}", self.rotations, self.scores)
    }
}
