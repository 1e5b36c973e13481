//! The options, weights, domain and pairs of a search, and the provenance of all that its result depends
//! on.

use std::fmt;

use glam::{DQuat, DVec3};
use sdf_grid::{Aabb, LatticeError};
use serde::{Deserialize, Serialize};

use crate::correlate::CorrelatorPlan;
use crate::dock::error::DockingError;
use crate::geometry::se3::Pose;
use crate::geometry::translation::TranslationWindow;
use crate::pair::builder::PairPlan;
use crate::pair::fields::{Pair, PairError};
use crate::pair::model::{PairProvenance, ScoreModel};

/// How a search proceeds. The default suits parts of a few hundred cells' volume and more.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SearchOptions {
    /// Poses to return, at most.
    pub top: usize,
    /// Local maxima kept of each rotation.
    pub per_rotation: usize,
    /// Share of the rotations that goes on from the screening at least, 0 ..= 1.
    pub chosen_share: f64,
    /// Distinct poses that begin to descend on the coarse lattice, at most.
    pub coarse_poses: usize,
    /// Rotations whose best energy, as screened, and poses whose energy, as scored, is shallower than
    /// the lowest by up to this share of it go on: what cell averages may hide of a fit. 0 ..= 1.
    pub blur: f64,
    /// Distinct poses that descend on the fine lattice; at least `top`.
    pub fine_poses: usize,
    /// Interior weight over exterior weight; [`crate::dock::DOCKING_RATIO`] unless there is a
    /// reason.
    pub ratio: f64,
}

impl SearchOptions {
    /// Distinct poses that go on from the first steps of their descent on the coarse lattice.
    pub(super) fn going_on(&self) -> usize {
        4 * self.fine_poses.max(self.top)
    }
}

impl Default for SearchOptions {
    fn default() -> Self {
        Self {
            top: 10,
            per_rotation: 4,
            chosen_share: 0.15,
            coarse_poses: 1500,
            blur: 0.35,
            fine_poses: 12,
            ratio: DOCKING_RATIO,
        }
    }
}

/// Interior weight over exterior weight with which poses are found and ranked.
pub const DOCKING_RATIO: f64 = 12.0;

/// The pair under the docking weights: interiors at least `ratio` times as heavy as exteriors, no
/// separation.
pub(super) fn with_docking_weights(pair: &Pair, ratio: f64) -> Result<Pair, PairError> {
    pair.with_model(docking_weights(pair.model(), ratio))
}

/// The model with interiors at least `ratio` times as heavy as exteriors, and no separation.
pub(super) fn docking_weights(model: &ScoreModel, ratio: f64) -> ScoreModel {
    let own = model.lambda_interior / model.lambda_exterior;
    weights(model, ratio.max(own))
}

/// The pair with interiors `ratio` times as heavy as exteriors and no separation.
pub(super) fn with_weights(pair: &Pair, ratio: f64) -> Result<Pair, PairError> {
    pair.with_model(weights(pair.model(), ratio))
}

fn weights(model: &ScoreModel, ratio: f64) -> ScoreModel {
    ScoreModel {
        lambda_interior: ratio * model.lambda_exterior,
        separation_weight: 0.0,
        ..*model
    }
}

/// Where a search looks.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchDomain {
    /// Rotations scored (unit quaternions), for example by `search_rotations`.
    pub rotations: Vec<DQuat>,
    /// Angle between neighbouring rotations, radians.
    pub step: f64,
    /// Where the moving part's pivot may be, metres, fixed frame.
    pub places: Aabb,
    /// Motions that map the moving part onto itself ([`crate::symmetry_group`]): poses that differ
    /// by one count as the same.
    pub symmetries: Vec<Pose>,
}

/// The parts of a search on its lattices, with one pivot ([`crate::dock::GridLevels::plans`]).
#[derive(Debug, Clone, Copy)]
pub struct SearchPairs<'a> {
    /// Where rotations are screened; none if all are to be scored.
    pub screening: Option<&'a Pair>,
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
    pub(super) fn check(&self) -> Result<(), DockingError> {
        if self.rotations.is_empty() {
            return Err(DockingError::NoRotations);
        }
        let valid = |q: &DQuat| q.is_finite() && (q.length() - 1.0).abs() < 1e-6;
        match self.rotations.iter().position(|q| !valid(q)) {
            Some(index) => Err(DockingError::Rotation {
                index,
                found: self.rotations[index],
            }),
            None => Ok(()),
        }
    }
}

impl SearchPairs<'_> {
    /// Refuses pairs of different parts.
    pub(super) fn check(&self) -> Result<(), DockingError> {
        let pivot = self.coarse.pivot();
        let others = self.screening.into_iter().chain([self.fine]);
        match others.map(Pair::pivot).find(|p| *p != pivot) {
            Some(other) => Err(DockingError::Pivots {
                coarse: pivot,
                other,
            }),
            None => Ok(()),
        }
    }
}

/// Everything that a search's result depends on, as its state file holds it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SearchProvenance {
    /// How the search proceeds.
    pub(super) options: SearchOptions,
    /// The pair on which rotations are chosen, if any.
    #[serde(rename = "sketch")]
    pub(super) screening: Option<PairProvenance>,
    /// The pair on which they are scored, with the docking weights.
    pub(super) coarse: PairProvenance,
    /// The pair on which poses are refined and ranked, with the docking weights.
    pub(super) fine: PairProvenance,
    /// Where the pivot may be: least and greatest coordinates, metres, fixed frame.
    pub(super) places: [[f64; 3]; 2],
    /// Angle between neighbouring rotations, radians.
    pub(super) step: f64,
    /// The domain's rotations.
    pub(super) rotations: RotationList,
    /// Those to score.
    pub(super) chosen: RotationList,
    /// Motions of the moving part onto itself: translation x, y, z (metres), quaternion x, y, z, w.
    pub(super) symmetries: Vec<[f64; 7]>,
}

/// Rotations too many to be written out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RotationList {
    pub(super) count: usize,
    /// BLAKE3 hash of their components x, y, z, w as little-endian doubles, hexadecimal.
    pub(super) hash: String,
}

impl RotationList {
    fn of(rotations: &[DQuat]) -> Self {
        let mut hash = blake3::Hasher::new();
        for number in rotations.iter().flat_map(|q| q.to_array()) {
            hash.update(&number.to_le_bytes());
        }
        Self {
            count: rotations.len(),
            hash: hash.finalize().to_hex().to_string(),
        }
    }
}

impl SearchProvenance {
    /// `coarse` and `fine` have the docking weights; `chosen` are the rotations to score.
    pub(super) fn new(
        domain: &SearchDomain,
        options: &SearchOptions,
        screening: Option<&Pair>,
        [coarse, fine]: [&Pair; 2],
        chosen: &[DQuat],
    ) -> Self {
        let numbers = |pose: &Pose| {
            let ([x, y, z], [a, b, c, d]) = (pose.translation.to_array(), pose.rotation.to_array());
            [x, y, z, a, b, c, d]
        };
        Self {
            options: options.clone(),
            screening: screening.map(Pair::provenance),
            coarse: coarse.provenance(),
            fine: fine.provenance(),
            places: [domain.places.min.to_array(), domain.places.max.to_array()],
            step: domain.step,
            rotations: RotationList::of(&domain.rotations),
            chosen: RotationList::of(chosen),
            symmetries: domain.symmetries.iter().map(numbers).collect(),
        }
    }
}

/// The lattices, rotations, memory and time of a docking run, known before any field is computed.
#[derive(Debug, Clone, PartialEq)]
pub struct DockingPlan {
    /// The pairs of a search: screening (unused for few rotations), coarse, fine.
    pub pairs: [PairPlan; 3],
    /// The pair under the setup's own halo, on the fine lattice, whose energies are reported; absent
    /// where the halo of the search is the setup's.
    pub own: Option<PairPlan>,
    /// Rotations of the domain.
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
