//! A sum of pairs as one reader sees it: which pairs count for it, and what an exchange changes.

use fft_correlate::{Pose, Response};

use crate::scene::sum::{PlacedPair, SumScratch, SumSource, add};

/// A sum with a reader's working memory.
pub(super) struct Snapshot {
    sum: SumSource,
    scratch: SumScratch,
    /// Whether each pair counts.
    on: Vec<bool>,
}

impl Snapshot {
    /// All pairs count.
    pub(super) fn new(sum: &SumSource) -> Box<Self> {
        Box::new(Self {
            scratch: sum.pair_scratches(),
            on: vec![true; sum.len()],
            sum: sum.clone(),
        })
    }

    /// The sum over the pairs in reach that count.
    pub(super) fn respond(&mut self, pose: &Pose) -> Response {
        let Self { sum, scratch, on } = self;
        sum.respond(pose, scratch, |i| on[i])
    }

    /// Whether every pair in reach is loaded and counts.
    pub(super) fn counts_all(&self, pose: &Pose) -> bool {
        let mut all = true;
        let count = |i: usize, pair: &PlacedPair| all &= self.on[i] && pair.is_there();
        self.sum.visit(pose, count);
        all
    }

    /// Takes the place of `old`: pairs that are the same count here if they counted there. Gives
    /// what this changes at `pose`; `None` if all pairs are the same, whatever of them is in
    /// memory. Pairs that are the same are not asked.
    pub(super) fn take_over(&mut self, old: &mut Self, pose: &Pose) -> Option<Response> {
        for i in 0..self.on.len() {
            self.on[i] = !self.has_same(old, i) || old.on[i];
        }
        let count = self.sum.len();
        if count == old.sum.len() && (0..count).all(|i| self.has_same(old, i)) {
            return None;
        }
        let mut change = self.without(old, pose);
        let gone = old.without(self, pose);
        change.energy -= gone.energy;
        change.wrench += gone.wrench * -1.0;
        Some(change)
    }

    /// Whether pair `index` is the same in both, whatever of it is in memory.
    fn has_same(&self, other: &Self, index: usize) -> bool {
        let pair = (self.sum.pairs().get(index), other.sum.pairs().get(index));
        matches!(pair, (Some(a), Some(b)) if a.is_same(b))
    }

    /// The sum over the pairs in reach that count and that `other` has not got.
    fn without(&mut self, other: &Self, pose: &Pose) -> Response {
        let Self { sum, scratch, on } = self;
        let pairs = other.sum.pairs();
        let mut total = Response::default();
        sum.visit(pose, |i, pair| {
            let same = pairs.get(i).is_some_and(|p| p.is_same(pair));
            if on[i] && !same {
                add(&mut total, &pair.answer(pose, &mut scratch.0[i]));
            }
        });
        total
    }

    /// Lets every pair in reach count if all that matters of it at `pose` is in memory, and gives
    /// what that changed; `None` if nothing.
    pub(super) fn switch(&mut self, pose: &Pose) -> Option<Response> {
        let Self { sum, scratch, on } = self;
        let mut change: Option<Response> = None;
        sum.visit(pose, |i, pair| {
            let scratch = &mut scratch.0[i];
            let loaded = !pair.is_there() || pair.is_loaded(pose, scratch);
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
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use fft_correlate::{EnergySource, Placement, Scratch, Wrench};
    use glam::DVec3;

    use super::*;
    use crate::scene::shared::SharedSource;
    use crate::scene::sum::Placed;

    /// Pulls towards its origin with `0` N/m; half covered.
    struct Spring(f64);

    impl EnergySource for Spring {
        fn scratch(&self) -> Scratch {
            Scratch::default()
        }

        fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
            let p = pose.translation;
            Response {
                energy: 0.5 * self.0 * p.length_squared(),
                wrench: Wrench {
                    force: -self.0 * p,
                    ..Wrench::ZERO
                },
                coverage: 0.5,
            }
        }
    }

    fn spring(stiffness: f64) -> SharedSource {
        SharedSource::new(Arc::new(Spring(stiffness)))
    }

    fn sum(sources: [Option<SharedSource>; 2]) -> SumSource {
        let placed = sources
            .into_iter()
            .zip([0.0, 1.0])
            .map(|(source, y)| Placed {
                source,
                placement: Placement::of_fixed(Pose::from_translation(DVec3::Y * y)),
                reach: None,
            });
        SumSource::new(DVec3::ZERO, placed.collect())
    }

    const HERE: Pose = Pose {
        translation: DVec3::new(0.2, 0.1, 0.0),
        ..Pose::IDENTITY
    };

    #[test]
    fn a_pair_that_is_not_loaded_says_so_and_pushes_nothing() {
        let both = [1.0, 2.0].map(|k| Some(spring(k)));
        let [first, _] = both.clone();
        let mut part = Snapshot::new(&sum([first, None]));
        let answer = part.respond(&HERE);
        assert_eq!(answer.coverage, 0.25, "half of the pairs in reach");
        assert!(!part.counts_all(&HERE));
        let whole = sum(both);
        let mut loaded = Snapshot::new(&whole);
        let change = loaded.take_over(&mut part, &HERE).unwrap();
        assert!(loaded.counts_all(&HERE));
        let after = loaded.respond(&HERE);
        assert_eq!(after, whole.evaluate(&HERE, &mut whole.scratch()));
        let expected = after.wrench + answer.wrench * -1.0;
        // One rounding of numbers of order one.
        assert!((change.wrench.force - expected.force).length() < 1e-14);
        assert!((change.energy - (after.energy - answer.energy)).abs() < 1e-14);
        assert!(change.wrench.force.length() > 0.1);
        let mut again = Snapshot::new(&whole);
        assert_eq!(again.take_over(&mut loaded, &HERE), None);
    }

    /// By address they would be one: the second comes to lie where the first one was.
    #[test]
    fn sources_one_after_the_other_in_one_place_are_two() {
        for _ in 0..64 {
            let first = spring(1.0);
            let (id, place) = (first.id(), first.place());
            drop(first);
            let second = spring(2.0);
            assert_ne!(second.id(), id);
            if second.place() == place {
                return;
            }
        }
        panic!("no source came to lie where another one was");
    }

    #[test]
    fn more_of_a_source_in_memory_is_no_change() {
        let source = spring(1.0);
        let more = source.with_part(Arc::new(Spring(1.0)));
        let mut old = Snapshot::new(&sum([Some(source.clone()), None]));
        let mut new = Snapshot::new(&sum([Some(more), None]));
        assert_eq!(new.take_over(&mut old, &HERE), None);
        let other = Some(SharedSource::new(Arc::new(Spring(1.0))));
        let mut newer = Snapshot::new(&sum([other, None]));
        assert!(newer.take_over(&mut new, &HERE).is_some());
    }
}
