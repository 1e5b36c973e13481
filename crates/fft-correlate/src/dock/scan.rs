//! Scoring many rotations over a window and keeping the best local maxima of each.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use glam::DQuat;
use ndarray::Array3;
use rayon::prelude::*;
use sdf_grid::Monitor;
use serde::{Deserialize, Serialize};

use crate::peaks::{half_width, top_peaks};
use crate::{Correlator, Pair, Pose, TranslationWindow};

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
    /// The best local maxima of `rotations[first..last]`, in no particular order, and how many
    /// rotations were scored: fewer than asked for if the monitor cancelled.
    pub(super) fn run(
        &self,
        rotations: &[DQuat],
        range: std::ops::Range<usize>,
        monitor: &dyn Monitor,
    ) -> (Vec<Candidate>, usize) {
        let next = AtomicUsize::new(range.start);
        let scored = AtomicUsize::new(0);
        let found = Mutex::new(Vec::new());
        let threads = rayon::current_num_threads().min(range.len());
        // One scratch per thread, and rotations handed out one by one.
        (0..threads).into_par_iter().for_each(|_| {
            let mut scratch = self.correlator.scratch();
            let mut score = Array3::zeros(self.window.shape());
            let mut own = Vec::new();
            while !monitor.cancelled() {
                let rotation = next.fetch_add(1, Ordering::Relaxed);
                if rotation >= range.end {
                    break;
                }
                let q = rotations[rotation];
                self.correlator.score(q, &mut scratch, score.view_mut());
                let radius = self.distance / self.pair.spacing();
                for peak in top_peaks(score.view(), self.per_rotation, radius) {
                    let width = half_width(score.view(), &peak);
                    own.push(Candidate {
                        rotation,
                        index: peak.index,
                        energy: -self.pair.model().gamma * f64::from(peak.score),
                        half_width: width.map(|w| w * self.pair.spacing()),
                    });
                }
                scored.fetch_add(1, Ordering::Relaxed);
                monitor.advance(1);
            }
            lock(&found).append(&mut own);
        });
        let candidates = std::mem::take(&mut *lock(&found));
        (candidates, scored.into_inner())
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
