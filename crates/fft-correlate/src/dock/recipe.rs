//! Everything that a search's result depends on.

use glam::DQuat;
use serde::{Deserialize, Serialize};

use crate::dock::domain::SearchDomain;
use crate::dock::options::SearchOptions;
use crate::geometry::se3::Pose;
use crate::pair::fields::Pair;
use crate::pair::recipe::PairRecipe;

/// Everything that a search's result depends on, as its state file holds it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SearchRecipe {
    /// How the search proceeds.
    pub(super) options: SearchOptions,
    /// The pair on which rotations are chosen, if any.
    pub(super) sketch: Option<PairRecipe>,
    /// The pair on which they are scored, with the docking weights.
    pub(super) coarse: PairRecipe,
    /// The pair on which poses are refined and ranked, with the docking weights.
    pub(super) fine: PairRecipe,
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

impl SearchRecipe {
    /// `coarse` and `fine` have the docking weights; `chosen` are the rotations to score.
    pub(super) fn new(
        domain: &SearchDomain,
        options: &SearchOptions,
        sketch: Option<&Pair>,
        [coarse, fine]: [&Pair; 2],
        chosen: &[DQuat],
    ) -> Self {
        let numbers = |pose: &Pose| {
            let ([x, y, z], [a, b, c, d]) = (pose.translation.to_array(), pose.rotation.to_array());
            [x, y, z, a, b, c, d]
        };
        Self {
            options: options.clone(),
            sketch: sketch.map(Pair::recipe),
            coarse: coarse.recipe(),
            fine: fine.recipe(),
            places: [domain.places.min.to_array(), domain.places.max.to_array()],
            step: domain.step,
            rotations: RotationList::of(&domain.rotations),
            chosen: RotationList::of(chosen),
            symmetries: domain.symmetries.iter().map(numbers).collect(),
        }
    }
}
