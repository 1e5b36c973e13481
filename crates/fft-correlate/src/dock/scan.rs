//! Scoring many rotations over a window and keeping the best local maxima of each.

use std::convert::Infallible;
use std::ops::Range;

use glam::DQuat;
use ndarray::ArrayView3;
use sdf_grid::Monitor;
use serde::{Deserialize, Serialize};

use crate::dock::peaks::{half_width, top_peaks};
use crate::geometry::half_turn::HalfTurnGroup;
use crate::geometry::se3::Pose;
use crate::geometry::translation::TranslationWindow;
use crate::pair::fields::Pair;
use crate::sweep::pair_energies::PairEnergies;
use crate::sweep::run::{Consumer, Group, Member, sweep};

/// A pose on the lattice, before refinement.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Candidate {
    /// Index into the rotations scored.
    pub(super) rotation: usize,
    /// Node of the window.
    pub(super) index: [usize; 3],
    /// Joules.
    pub(super) energy: f64,
    /// Metres; none if the energy does not halve inside the window.
    pub(super) half_width: Option<f64>,
}

/// Lowest energy first; ties by place, so that the order does not depend on threads.
pub(super) fn sort(candidates: &mut [Candidate]) {
    candidates.sort_by(|a, b| {
        let order = a.energy.total_cmp(&b.energy);
        order.then((a.rotation, a.index).cmp(&(b.rotation, b.index)))
    });
}

/// What every rotation is scored with.
pub(super) struct Scan<'a> {
    pub(super) pair: &'a Pair,
    /// The pair's, of which only the maxima become energies.
    pub(super) scores: &'a PairEnergies,
    pub(super) window: &'a TranslationWindow,
    /// Local maxima kept of each rotation.
    pub(super) per_rotation: usize,
    /// Maxima of one rotation closer than this count as one, metres.
    pub(super) distance: f64,
}

impl Scan<'_> {
    /// The best local maxima of the rotations of `range`, in no particular order, and how many
    /// rotations were scored: fewer than asked for if the monitor cancelled. `groups` are those of
    /// the whole list, so that what a rotation gives does not depend on the range.
    pub(super) fn run(
        &self,
        groups: &[HalfTurnGroup],
        range: &Range<usize>,
        monitor: &dyn Monitor,
    ) -> (Vec<Candidate>, usize) {
        let here = |row| range.contains(&row).then_some(());
        let groups = groups.iter().filter_map(|g| Group::of(g, here));
        let best = || Best {
            scan: self,
            found: Vec::new(),
            scored: 0,
        };
        let shape = self.window.shape();
        let Ok(swept) = sweep(self.scores, shape, groups.collect(), best, monitor);
        let scored = swept.consumers.iter().map(|c| c.scored).sum();
        let found = swept.consumers.into_iter().flat_map(|c| c.found);
        (found.collect(), scored)
    }

    /// The best local maxima of one rotation.
    fn candidates(
        &self,
        rotation: usize,
        score: ArrayView3<'_, f32>,
    ) -> impl Iterator<Item = Candidate> {
        let h = self.pair.spacing();
        let peaks = top_peaks(score, self.per_rotation, self.distance / h);
        peaks.into_iter().map(move |peak| Candidate {
            rotation,
            index: peak.index,
            energy: -self.pair.model().gamma * f64::from(peak.score),
            half_width: half_width(score, &peak).map(|w| w * h),
        })
    }

    pub(super) fn pose(&self, rotations: &[DQuat], candidate: &Candidate) -> Pose {
        let displacement = self.window.displacement(candidate.index);
        self.pair.pose(rotations[candidate.rotation], displacement)
    }
}

/// What one thread has found.
struct Best<'a> {
    scan: &'a Scan<'a>,
    found: Vec<Candidate>,
    scored: usize,
}

impl Consumer<()> for Best<'_> {
    type Error = Infallible;

    fn take(&mut self, node: Member, scores: &mut [f32]) -> Result<(), Infallible> {
        let scores = ArrayView3::from_shape(self.scan.window.shape(), scores);
        let scores = scores.expect("a score of each displacement");
        self.found.extend(self.scan.candidates(node.row, scores));
        self.scored += 1;
        Ok(())
    }
}
