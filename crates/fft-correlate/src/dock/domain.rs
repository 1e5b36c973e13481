//! Where a search looks, and on which lattices.

use glam::{DQuat, DVec3};
use sdf_grid::{Aabb, LatticeError};

use crate::dock::error::SearchError;
use crate::geometry::se3::Pose;
use crate::geometry::translation::TranslationWindow;
use crate::pair::fields::Pair;

/// Where a search looks.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchDomain {
    /// Rotations scored (unit quaternions), for example by [`crate::search_rotations`].
    pub rotations: Vec<DQuat>,
    /// Angle between neighbouring rotations, radians.
    pub step: f64,
    /// Where the moving part's pivot may be, metres, fixed frame.
    pub places: Aabb,
    /// Motions that map the moving part onto itself ([`crate::symmetry_group`]): poses that differ
    /// by one count as the same.
    pub symmetries: Vec<Pose>,
}

/// The parts of a search on its lattices, with one pivot ([`crate::SearchLattices::plans`]).
#[derive(Debug, Clone, Copy)]
pub struct SearchPairs<'a> {
    /// Where rotations are chosen ([`crate::wants_sketch`]); none if all are to be scored.
    pub sketch: Option<&'a Pair>,
    /// Where rotations are scored.
    pub coarse: &'a Pair,
    /// Where poses are refined and ranked.
    pub fine: &'a Pair,
}

impl SearchDomain {
    /// The displacements to score for a pair with this pivot and spacing.
    pub(super) fn window(
        &self,
        pivot: DVec3,
        spacing: f64,
    ) -> Result<TranslationWindow, LatticeError> {
        let (min, max) = (self.places.min - pivot, self.places.max - pivot);
        TranslationWindow::new(min, max, spacing)
    }

    /// Refuses an empty list of rotations and those that are none.
    pub(super) fn check(&self) -> Result<(), SearchError> {
        if self.rotations.is_empty() {
            return Err(SearchError::NoRotations);
        }
        let valid = |q: &DQuat| q.is_finite() && (q.length() - 1.0).abs() < 1e-6;
        match self.rotations.iter().position(|q| !valid(q)) {
            Some(index) => Err(SearchError::Rotation {
                index,
                found: self.rotations[index],
            }),
            None => Ok(()),
        }
    }
}

impl SearchPairs<'_> {
    /// Refuses pairs of different parts.
    pub(super) fn check(&self) -> Result<(), SearchError> {
        let pivot = self.coarse.pivot();
        let others = self.sketch.into_iter().chain([self.fine]);
        match others.map(Pair::pivot).find(|p| *p != pivot) {
            Some(other) => Err(SearchError::Pivots {
                coarse: pivot,
                other,
            }),
            None => Ok(()),
        }
    }
}
