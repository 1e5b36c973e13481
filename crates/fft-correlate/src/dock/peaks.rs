//! Peak calling: the best local maxima of scores over rotations and translations, and distinct poses
//! among many.

use std::cmp::Ordering;
use std::convert::Infallible;
use std::ops::Range;

use glam::DQuat;
use ndarray::ArrayView3;
use sdf_grid::Monitor;
use serde::{Deserialize, Serialize};

use crate::geometry::half_turn::HalfTurnGroup;
use crate::geometry::se3::Pose;
use crate::geometry::translation::TranslationWindow;
use crate::pair::fields::Pair;
use crate::sweep::{Consumer, Group, Member, PairEnergies, sweep};

/// A local maximum of a score over a translation window.
///
/// ```
/// use fft_correlate::top_peaks;
/// use ndarray::Array3;
///
/// let mut scores = Array3::zeros([8; 3]);
/// scores[[1, 1, 1]] = 2.0;
/// scores[[6, 6, 6]] = 3.0;
/// scores[[6, 6, 5]] = 2.5; // beside the highest
/// let peaks = top_peaks(scores.view(), 2, 2.0);
/// assert_eq!((peaks[0].index, peaks[0].score), ([6, 6, 6], 3.0));
/// assert_eq!((peaks[1].index, peaks[1].score), ([1, 1, 1], 2.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// Node of the window.
    pub index: [usize; 3],
    /// Score there, cubic metres.
    pub score: f32,
}

/// The `count` highest local maxima that lie more than `radius` nodes apart, highest first.
///
/// A local maximum is no lower than any of its 26 neighbours (of equal neighbours the first
/// counts), so a slope that leaves the window counts where it leaves. Where two are closer than
/// `radius` (Euclidean, in nodes) the lower one is left out.
pub fn top_peaks(score: ArrayView3<f32>, count: usize, radius: f64) -> Vec<Peak> {
    let mut found: Vec<Peak> = score
        .indexed_iter()
        .filter(|((i, j, k), _)| is_peak(&score, [*i, *j, *k]))
        .map(|((i, j, k), score)| Peak {
            index: [i, j, k],
            score: *score,
        })
        .collect();
    found.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.index.cmp(&b.index)));
    let mut kept: Vec<Peak> = Vec::with_capacity(count.min(found.len()));
    for peak in found {
        if kept.len() == count {
            break;
        }
        if kept
            .iter()
            .all(|k| node_distance(k.index, peak.index) > radius)
        {
            kept.push(peak);
        }
    }
    kept
}

fn node_distance(a: [usize; 3], b: [usize; 3]) -> f64 {
    let difference = |axis: usize| (a[axis] as f64 - b[axis] as f64).powi(2);
    (0..3).map(difference).sum::<f64>().sqrt()
}

fn is_peak(score: &ArrayView3<f32>, at: [usize; 3]) -> bool {
    let own = score[at];
    let shape = score.shape();
    let range = |a: usize| at[a].saturating_sub(1)..(at[a] + 2).min(shape[a]);
    // Neighbours along z first: they rerank most nodes and lie in the same cache line.
    for i in [at[0]].into_iter().chain(range(0).filter(|i| *i != at[0])) {
        for j in [at[1]].into_iter().chain(range(1).filter(|j| *j != at[1])) {
            for k in range(2) {
                let higher = match score[[i, j, k]].total_cmp(&own) {
                    Ordering::Greater => true,
                    Ordering::Equal => [i, j, k] < at,
                    Ordering::Less => false,
                };
                if higher {
                    return false;
                }
            }
        }
    }
    true
}

/// Half width of a peak, nodes: how far, along the lattice axis and sense in which it falls
/// fastest, the score takes to fall to half; `None` if it does not fall that far inside the window
/// along any.
fn half_width(score: ArrayView3<f32>, peak: &Peak) -> Option<f64> {
    let half = 0.5 * peak.score;
    let mut narrowest: Option<f64> = None;
    for axis in 0..3 {
        for sense in [-1i64, 1] {
            let at = |n: i64| {
                let mut index = peak.index;
                index[axis] = usize::try_from(index[axis] as i64 + sense * n).ok()?;
                score.get(index).copied()
            };
            let mut above = peak.score;
            let mut n = 1;
            while let Some(value) = at(n) {
                if value <= half {
                    let width = (n - 1) as f64 + ((above - half) / (above - value)) as f64;
                    narrowest = Some(narrowest.map_or(width, |w| w.min(width)));
                    break;
                }
                above = value;
                n += 1;
            }
        }
    }
    narrowest
}

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
pub(super) fn sort_candidates(candidates: &mut [Candidate]) {
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
        let best = || BestMaxima {
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
struct BestMaxima<'a> {
    scan: &'a Scan<'a>,
    found: Vec<Candidate>,
    scored: usize,
}

impl Consumer<()> for BestMaxima<'_> {
    type Error = Infallible;

    fn take(&mut self, node: Member, scores: &mut [f32]) -> Result<(), Infallible> {
        let scores = ArrayView3::from_shape(self.scan.window.shape(), scores);
        let scores = scores.expect("a score of each displacement");
        self.found.extend(self.scan.candidates(node.row, scores));
        self.scored += 1;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use ndarray::Array3;

    fn hills(hills: &[([f64; 3], f64)]) -> Array3<f32> {
        Array3::from_shape_fn((20, 21, 22), |(i, j, k)| {
            let at = DVec3::new(i as f64, j as f64, k as f64);
            let hill = |(c, h): &([f64; 3], f64)| {
                h * (-(at - DVec3::from_array(*c)).length_squared() / 8.0).exp()
            };
            hills.iter().map(hill).sum::<f64>() as f32
        })
    }

    #[test]
    fn peaks_come_in_order_and_close_ones_are_left_out() {
        let field = hills(&[
            ([3.0, 4.0, 5.0], 1.0),
            ([15.0, 15.0, 15.0], 2.0),
            ([15.0, 5.0, 15.0], 1.5),
            ([19.0, 0.0, 0.0], 0.5),
        ]);
        let all = top_peaks(field.view(), 10, 1.5);
        let indices: Vec<_> = all.iter().map(|p| p.index).collect();
        let expected = [[15, 15, 15], [15, 5, 15], [3, 4, 5], [19, 0, 0]];
        assert_eq!(indices, expected);
        let apart = top_peaks(field.view(), 2, 10.0);
        assert_eq!(
            apart.iter().map(|p| p.index).collect::<Vec<_>>(),
            [[15, 15, 15], [3, 4, 5]]
        );
        assert!(top_peaks(field.view(), 0, 1.0).is_empty());
    }

    #[test]
    fn a_plateau_is_one_peak() {
        let flat = Array3::from_elem((4, 4, 4), 1.0f32);
        assert_eq!(top_peaks(flat.view(), 9, 0.5).len(), 1);
    }

    #[test]
    fn half_width_of_a_gaussian() {
        let field = hills(&[([10.0, 10.0, 10.0], 1.0)]);
        let peak = top_peaks(field.view(), 1, 1.0)[0];
        let exact = (8.0 * 2f64.ln()).sqrt();
        let width = half_width(field.view(), &peak).unwrap();
        // Linear interpolation between nodes one apart.
        assert!((width - exact).abs() < 0.05, "{width} {exact}");
        let flat = Array3::from_elem((3, 3, 3), 1.0f32);
        assert_eq!(
            half_width(flat.view(), &top_peaks(flat.view(), 1, 0.0)[0]),
            None
        );
    }
}
