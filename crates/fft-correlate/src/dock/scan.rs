//! Scoring many rotations over a window and keeping the best local maxima of each.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use glam::DQuat;
use ndarray::Array3;
use rayon::prelude::*;
use sdf_grid::Monitor;
use serde::{Deserialize, Serialize};

use crate::correlate::Correlator;
use crate::dock::peaks::{half_width, top_peaks};
use crate::geometry::half_turn::{HalfTurn, HalfTurnGroup};
use crate::geometry::se3::Pose;
use crate::geometry::translation::TranslationWindow;
use crate::pair::fields::Pair;

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
    pub(super) correlator: &'a Correlator,
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
        let here = |g: &HalfTurnGroup| -> Vec<(HalfTurn, usize)> {
            let members = g.members.iter().copied();
            members.filter(|m| range.contains(&m.1)).collect()
        };
        let work: Vec<_> = groups
            .iter()
            .map(|g| (g.rotation, here(g)))
            .filter(|(_, members)| !members.is_empty())
            .collect();
        let next = AtomicUsize::new(0);
        let scored = AtomicUsize::new(0);
        let found = Mutex::new(Vec::new());
        let threads = rayon::current_num_threads().min(work.len());
        let most = work.iter().map(|w| w.1.len()).max().unwrap_or(0);
        // One scratch per thread, and groups handed out one by one.
        (0..threads).into_par_iter().for_each(|_| {
            let mut scratch = self.correlator.scratch();
            let mut scores = vec![Array3::zeros(self.window.shape()); most];
            let mut own = Vec::new();
            while !monitor.cancelled() {
                let Some((rotation, members)) = work.get(next.fetch_add(1, Ordering::Relaxed))
                else {
                    break;
                };
                let turns: Vec<_> = members.iter().map(|m| m.0).collect();
                let scores = &mut scores[..turns.len()];
                let mut outs: Vec<_> = scores.iter_mut().map(|s| s.view_mut()).collect();
                self.correlator
                    .score_half_turns(*rotation, &turns, &mut scratch, &mut outs);
                for (score, (_, place)) in scores.iter().zip(members) {
                    own.extend(self.candidates(*place, score));
                }
                scored.fetch_add(members.len(), Ordering::Relaxed);
                monitor.advance(members.len() as u64);
            }
            lock(&found).append(&mut own);
        });
        let candidates = std::mem::take(&mut *lock(&found));
        (candidates, scored.into_inner())
    }

    /// The best local maxima of one rotation.
    fn candidates(&self, rotation: usize, score: &Array3<f32>) -> impl Iterator<Item = Candidate> {
        let h = self.pair.spacing();
        let peaks = top_peaks(score.view(), self.per_rotation, self.distance / h);
        peaks.into_iter().map(move |peak| Candidate {
            rotation,
            index: peak.index,
            energy: -self.pair.model().gamma * f64::from(peak.score),
            half_width: half_width(score.view(), &peak).map(|w| w * h),
        })
    }

    pub(super) fn pose(&self, rotations: &[DQuat], candidate: &Candidate) -> Pose {
        let displacement = self.window.displacement(candidate.index);
        self.pair.pose(rotations[candidate.rotation], displacement)
    }
}

/// The list behind the lock; a panic elsewhere leaves it whole, because it is only appended to.
fn lock<T>(list: &Mutex<T>) -> MutexGuard<'_, T> {
    list.lock().unwrap_or_else(PoisonError::into_inner)
}
