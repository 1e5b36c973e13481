//! Several fixed parts and one moving part: energies and wrenches added up.

use std::sync::Arc;

use fft_correlate::{EnergySource, Pose, Response, Scratch, Wrench};
use glam::DVec3;
use sdf_grid::Aabb;

use crate::box_tree::BoxTree;

/// One pair of a scene: a fixed part's source and where the fixed part stands.
#[derive(Clone)]
pub struct Placed {
    /// Energy of the moving part in the fixed part's frame; `None` while it is not loaded.
    pub source: Option<Arc<dyn EnergySource>>,
    /// Pose of the fixed part in the scene.
    pub placement: Pose,
    /// Where the moving part's pivot must be, in the fixed part's frame, for the pair to matter,
    /// metres. Outside, the source is not asked and counts as zero. `None`: everywhere.
    pub reach: Option<Aabb>,
}

/// The sum of several pairs. Pairs whose reach the moving part's pivot is not in are not looked at.
///
/// Among the pairs in reach the coverage is the greatest of those that are loaded, times the share
/// that is: a pair that is in reach and not loaded, in whole or in the part that matters, pulls it
/// below one and adds no force. Leaving a
/// box where the pair's energy is not near zero makes a step in the sum: make boxes as wide as the
/// source's own domain.
#[derive(Clone)]
pub struct SumSource {
    pivot: DVec3,
    pairs: Vec<Pair>,
    /// Over the pairs with a reach, by [`SumSource::bounded`].
    tree: BoxTree,
    bounded: Vec<usize>,
    unbounded: Vec<usize>,
}

#[derive(Clone)]
struct Pair {
    placed: Placed,
    /// Scene to fixed part.
    inverse: Pose,
}

impl SumSource {
    /// The sum of `pairs`; none give zero everywhere. `pivot` is the point of the moving part
    /// (metres, its frame) that reaches speak of.
    pub fn new(pivot: DVec3, pairs: Vec<Placed>) -> Self {
        let all = 0..pairs.len();
        let (bounded, unbounded): (Vec<_>, Vec<_>) = all.partition(|&i| pairs[i].reach.is_some());
        let boxes: Vec<Aabb> = bounded
            .iter()
            .filter_map(|&i| pairs[i].reach.map(|r| placed_box(&r, &pairs[i].placement)))
            .collect();
        let pairs = pairs.into_iter().map(|placed| Pair {
            inverse: placed.placement.inverse(),
            placed,
        });
        Self {
            pivot,
            pairs: pairs.collect(),
            tree: BoxTree::new(&boxes),
            bounded,
            unbounded,
        }
    }

    /// Pairs in the sum.
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }

    /// How many pairs are in reach at `pose`.
    pub fn in_reach(&self, pose: &Pose) -> usize {
        let mut count = 0;
        self.visit(pose, |_, _| count += 1);
        count
    }

    /// Working memory of pair `index`.
    pub(crate) fn pair_scratch(&self, index: usize) -> Scratch {
        let source = &self.pairs[index].placed.source;
        source.as_ref().map(|s| s.scratch()).unwrap_or_default()
    }

    /// What this sum gives beyond `old` at `pose`; `None` if all pairs are the same fields in both,
    /// whatever of them is in memory. Pairs that are the same are not asked. `on` and `old_on` say
    /// which pairs count.
    pub(crate) fn change_since(
        &self,
        old: &Self,
        pose: &Pose,
        (scratch, on): (&mut Scratch, &[bool]),
        (old_scratch, old_on): (&mut Scratch, &[bool]),
    ) -> Option<Response> {
        if self.len() == old.len() && (0..self.len()).all(|i| self.same_field(old, i)) {
            return None;
        }
        let mut change = Response::default();
        self.visit(pose, |i, pair| {
            if on[i] && !self.same_field(old, i) {
                add(&mut change, &pair.answer(pose, &mut scratch.nested[i]));
            }
        });
        let mut gone = Response::default();
        old.visit(pose, |i, pair| {
            if old_on[i] && !self.same_field(old, i) {
                add(&mut gone, &pair.answer(pose, &mut old_scratch.nested[i]));
            }
        });
        change.energy -= gone.energy;
        change.wrench += gone.wrench * -1.0;
        Some(change)
    }

    /// Whether pair `index` is the same field in both sums, whatever of it is in memory.
    pub(crate) fn same_field(&self, other: &Self, index: usize) -> bool {
        let pair = (self.pairs.get(index), other.pairs.get(index));
        matches!(pair, (Some(a), Some(b)) if a.same_field(b))
    }

    /// Lets every pair in reach count if all that matters of it at `pose` is in memory, and gives what
    /// that changed; `None` if nothing.
    pub(crate) fn switch(
        &self,
        pose: &Pose,
        scratch: &mut Scratch,
        on: &mut [bool],
    ) -> Option<Response> {
        let mut change: Option<Response> = None;
        self.visit(pose, |i, pair| {
            let scratch = &mut scratch.nested[i];
            let loaded = pair.placed.source.is_none() || pair.is_loaded(pose, scratch);
            if loaded != on[i] {
                on[i] = loaded;
                let answer = pair.answer(pose, scratch);
                let sign = if loaded { 1.0 } else { -1.0 };
                let part = Response {
                    energy: sign * answer.energy,
                    wrench: answer.wrench * sign,
                    coverage: if loaded { answer.coverage } else { 0.0 },
                };
                add(change.get_or_insert_default(), &part);
            }
        });
        change
    }

    /// Whether every pair in reach is loaded and counts.
    pub(crate) fn counts_all(&self, pose: &Pose, on: &[bool]) -> bool {
        let mut all = true;
        self.visit(pose, |i, pair| all &= on[i] && pair.placed.source.is_some());
        all
    }

    /// The sum over the pairs in reach for which `counts` holds; the others count as not loaded.
    pub(crate) fn respond(
        &self,
        pose: &Pose,
        scratch: &mut Scratch,
        counts: impl Fn(usize) -> bool,
    ) -> Response {
        let mut sum = Response::default();
        let (mut in_reach, mut loaded) = (0u32, 0u32);
        self.visit(pose, |i, pair| {
            in_reach += 1;
            if pair.placed.source.is_some() && counts(i) {
                loaded += 1;
                add(&mut sum, &pair.answer(pose, &mut scratch.nested[i]));
            }
        });
        if loaded < in_reach {
            sum.coverage *= f64::from(loaded) / f64::from(in_reach);
        }
        sum
    }

    /// The pairs in reach, in the order of their boxes.
    fn visit(&self, pose: &Pose, mut each: impl FnMut(usize, &Pair)) {
        let point = pose.apply(self.pivot);
        for &index in &self.unbounded {
            each(index, &self.pairs[index]);
        }
        self.tree.visit(point, |k| {
            let index = self.bounded[k];
            let pair = &self.pairs[index];
            if pair.reaches(point) {
                each(index, pair);
            }
        });
    }
}

/// The box in the scene around a box of a placed part.
pub(crate) fn placed_box(reach: &Aabb, placement: &Pose) -> Aabb {
    let corner = |i: usize| {
        let pick = |axis: usize| {
            if i & (1 << axis) == 0 {
                reach.min[axis]
            } else {
                reach.max[axis]
            }
        };
        placement.apply(DVec3::new(pick(0), pick(1), pick(2)))
    };
    // Turning a point there and back may round it out of the box.
    let slack = 1e-12 * (1.0 + reach.diagonal() + placement.translation.length());
    Aabb::around((0..8).map(corner)).grown(slack)
}

fn add(sum: &mut Response, part: &Response) {
    sum.energy += part.energy;
    sum.wrench += part.wrench;
    sum.coverage = sum.coverage.max(part.coverage);
}

impl Pair {
    fn reaches(&self, pivot: DVec3) -> bool {
        let reach = self.placed.reach;
        reach.is_none_or(|r| r.contains(self.inverse.apply(pivot)))
    }

    fn is_loaded(&self, pose: &Pose, scratch: &Scratch) -> bool {
        let source = &self.placed.source;
        source
            .as_ref()
            .is_some_and(|s| s.is_loaded(&(self.inverse * *pose), scratch))
    }

    fn same_field(&self, other: &Self) -> bool {
        match (&self.placed.source, &other.placed.source) {
            (Some(a), Some(b)) => {
                a.field() == b.field()
                    && self.placed.placement == other.placed.placement
                    && self.placed.reach == other.placed.reach
            }
            (None, None) => true,
            _ => false,
        }
    }

    /// In the scene's frame; nothing while it is not loaded.
    fn answer(&self, pose: &Pose, scratch: &mut Scratch) -> Response {
        let Some(source) = &self.placed.source else {
            return Response::default();
        };
        let part = source.evaluate(&(self.inverse * *pose), scratch);
        // Both torques are about the moving part's origin: only the axes turn.
        let turn = self.placed.placement.rotation;
        Response {
            wrench: Wrench {
                torque: turn * part.wrench.torque,
                force: turn * part.wrench.force,
            },
            ..part
        }
    }
}

impl EnergySource for SumSource {
    fn scratch(&self) -> Scratch {
        Scratch {
            nested: (0..self.len()).map(|i| self.pair_scratch(i)).collect(),
            ..Scratch::default()
        }
    }

    fn evaluate(&self, pose: &Pose, scratch: &mut Scratch) -> Response {
        self.respond(pose, scratch, |_| true)
    }

    fn is_loaded(&self, pose: &Pose, scratch: &Scratch) -> bool {
        let mut all = true;
        self.visit(pose, |i, pair| {
            all &= pair.is_loaded(pose, &scratch.nested[i])
        });
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fft_correlate::Twist;
    use glam::DQuat;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// `E = |p|² + p·q(x axis) `, turning with its frame; counts how often it is asked.
    #[derive(Default)]
    struct Spring(AtomicU32);

    impl EnergySource for Spring {
        fn scratch(&self) -> Scratch {
            Scratch::default()
        }

        fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
            self.0.fetch_add(1, Ordering::Relaxed);
            let (p, axis) = (pose.translation, pose.rotation * DVec3::X);
            Response {
                energy: p.length_squared() + p.dot(axis),
                wrench: Wrench {
                    torque: -axis.cross(p),
                    force: -2.0 * p - axis,
                },
                coverage: 0.5,
            }
        }
    }

    const PIVOT: DVec3 = DVec3::new(0.01, -0.02, 0.03);

    fn pairs(spring: &Arc<Spring>) -> Vec<Placed> {
        let at = |x: f64, reach| Placed {
            source: Some(Arc::clone(spring) as Arc<dyn EnergySource>),
            placement: Pose::new(DQuat::from_rotation_z(x), DVec3::new(x, 0.2, 0.0)),
            reach,
        };
        let near = Some(Aabb {
            min: DVec3::splat(-0.5),
            max: DVec3::splat(0.5),
        });
        let mut pairs = vec![at(0.1, None), at(0.3, near)];
        pairs.extend((0..62).map(|k| at(10.0 + f64::from(k), near)));
        pairs
    }

    fn scene() -> (Arc<Spring>, SumSource) {
        let spring = Arc::new(Spring::default());
        let pairs = pairs(&spring);
        (spring, SumSource::new(PIVOT, pairs))
    }

    #[test]
    fn the_wrench_is_minus_the_gradient_of_the_sum() {
        let (_, sum) = scene();
        let mut scratch = sum.scratch();
        let pose = Pose::new(DQuat::from_rotation_x(0.6), DVec3::new(0.1, 0.05, -0.2));
        let wrench = sum.evaluate(&pose, &mut scratch).wrench;
        let h = 1e-5;
        for k in 0..6 {
            let mut v = [0.0; 6];
            v[k] = h;
            let step = Twist {
                angular: DVec3::new(v[0], v[1], v[2]),
                linear: DVec3::new(v[3], v[4], v[5]),
            };
            let mut at = |t: &Twist| sum.evaluate(&pose.perturbed(t), &mut scratch).energy;
            let slope = (at(&step) - at(&(-step))) / (2.0 * h);
            // Central differences of order h²; numbers of order one.
            assert!(
                (slope + wrench.dot(&(step * (1.0 / h)))).abs() < 1e-8,
                "{k}"
            );
        }
    }

    #[test]
    fn pairs_out_of_reach_are_not_asked() {
        let (spring, sum) = scene();
        let mut scratch = sum.scratch();
        let here = Pose::from_translation(DVec3::new(0.2, 0.2, 0.0));
        assert_eq!((sum.len(), sum.in_reach(&here)), (64, 2));
        let response = sum.evaluate(&here, &mut scratch);
        assert_eq!(spring.0.load(Ordering::Relaxed), 2);
        assert_eq!(response.coverage, 0.5);
        assert!(SumSource::new(PIVOT, Vec::new()).is_empty());
    }

    #[test]
    fn a_pair_that_is_not_loaded_says_so_and_pushes_nothing() {
        let spring = Arc::new(Spring::default());
        let here = Pose::from_translation(DVec3::new(0.2, 0.2, 0.0));
        let mut pairs = pairs(&spring);
        let whole = SumSource::new(PIVOT, pairs.clone());
        pairs[1].source = None;
        let part = SumSource::new(PIVOT, pairs.clone());
        let mut scratch = part.scratch();
        let answer = part.evaluate(&here, &mut scratch);
        assert_eq!(answer.coverage, 0.25, "half of the pairs in reach");
        pairs[1].source = Some(spring);
        let loaded = SumSource::new(PIVOT, pairs);
        let mut fresh = loaded.scratch();
        let on = vec![true; 64];
        let change = loaded
            .change_since(&part, &here, (&mut fresh, &on), (&mut scratch, &on))
            .unwrap();
        let after = loaded.evaluate(&here, &mut fresh);
        assert_eq!(after, whole.evaluate(&here, &mut whole.scratch()));
        let expected = after.wrench + answer.wrench * -1.0;
        // One rounding of numbers of order one.
        assert!((change.wrench.force - expected.force).length() < 1e-14);
        assert!((change.energy - (after.energy - answer.energy)).abs() < 1e-14);
        assert!(change.wrench.force.length() > 0.1);
        let other = loaded.clone();
        let none = loaded.change_since(&other, &here, (&mut fresh, &on), (&mut scratch, &on));
        assert_eq!(none, None);
    }
}
