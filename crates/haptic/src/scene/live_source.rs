//! A sum of pairs that is exchanged while a loop reads it.
//!
//! Each reading thread owns the snapshot it reads, working memory included. A new snapshot comes
//! to it through a ring and the old one goes back through another, so the reader neither waits nor
//! allocates nor frees.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use fft_correlate::{EnergySource, Pose, Response, Scratch};
use glam::{DQuat, DVec3};
use rtrb::{Consumer, Producer, RingBuffer};

use crate::scene::sum::{SourceId, SumScratch, SumSource, add};

/// Snapshots under way to a reader, and back.
const RING: usize = 4;

/// A sum with a reader's working memory.
struct Snapshot {
    sum: SumSource,
    scratch: SumScratch,
    /// Whether each pair counts.
    counted: Vec<bool>,
}

impl Snapshot {
    /// All pairs count.
    fn new(sum: &SumSource) -> Box<Self> {
        Box::new(Self {
            scratch: sum.pair_scratches(),
            counted: vec![true; sum.len()],
            sum: sum.clone(),
        })
    }

    /// The sum over the pairs in reach that count.
    fn respond(&mut self, pose: &Pose) -> Response {
        let Self {
            sum,
            scratch,
            counted,
        } = self;
        sum.respond(pose, scratch, |i| counted[i])
    }

    /// Whether every pair in reach is loaded and counts.
    fn all_loaded(&self, pose: &Pose) -> bool {
        let mut pairs = self.sum.reached(pose);
        pairs.all(|(i, pair)| self.counted[i] && pair.has_source())
    }

    /// Takes the place of `old`: pairs that are the same count here if they counted there. Gives
    /// what this changes at `pose`; `None` if all pairs are the same, whatever of them is in
    /// memory. Pairs that are the same are not asked.
    fn replace(&mut self, old: &mut Self, pose: &Pose) -> Option<Response> {
        for i in 0..self.counted.len() {
            self.counted[i] = !self.has_same(old, i) || old.counted[i];
        }
        let count = self.sum.len();
        if count == old.sum.len() && (0..count).all(|i| self.has_same(old, i)) {
            return None;
        }
        let mut change = self.sum_without(old, pose);
        let gone = old.sum_without(self, pose);
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
    fn sum_without(&mut self, other: &Self, pose: &Pose) -> Response {
        let Self {
            sum,
            scratch,
            counted,
        } = self;
        let pairs = other.sum.pairs();
        let mut total = Response::default();
        for (i, pair) in sum.reached(pose) {
            let same = pairs.get(i).is_some_and(|p| p.is_same(pair));
            if counted[i] && !same {
                add(&mut total, &pair.evaluate(pose, &mut scratch.0[i]));
            }
        }
        total
    }

    /// Lets every pair in reach count if all that matters of it at `pose` is in memory, and gives
    /// what that changed; `None` if nothing.
    fn update_counted(&mut self, pose: &Pose) -> Option<Response> {
        let Self {
            sum,
            scratch,
            counted,
        } = self;
        let mut change: Option<Response> = None;
        for (i, pair) in sum.reached(pose) {
            let scratch = &mut scratch.0[i];
            let loaded = !pair.has_source() || pair.is_loaded(pose, scratch);
            if loaded != counted[i] {
                counted[i] = loaded;
                let answer = pair.evaluate(pose, scratch);
                let sign = if loaded { 1.0 } else { -1.0 };
                let part = Response {
                    energy: sign * answer.energy,
                    wrench: answer.wrench * sign,
                    coverage: if loaded { answer.coverage } else { 0.0 },
                };
                add(change.get_or_insert_default(), &part);
            }
        }
        change
    }
}

/// The newest [`SumSource`] for every reader.
///
/// A pair counts for a reader only while everything of it that matters at the pose is in memory.
/// Pairs come and go as sums are exchanged: in [`EnergySource::refresh`] only.
///
/// ```
/// use fft_correlate::{EnergySource, Placement, Pose};
/// use glam::DVec3;
/// use haptic::{LiveSource, PlacedSource, SumSource};
///
/// let live = LiveSource::new(SumSource::new(DVec3::ZERO, vec![]), &Pose::IDENTITY);
/// let mut scratch = live.scratch();
/// assert!(live.is_loaded(&Pose::IDENTITY, &scratch));
/// // A pair that matters everywhere, of which nothing is loaded yet.
/// let pair = PlacedSource { source: None, placement: Placement::IDENTITY, reach: None };
/// live.publish(SumSource::new(DVec3::ZERO, vec![pair]));
/// // Readers take it over when they are ready for a change.
/// assert!(live.is_loaded(&Pose::IDENTITY, &scratch));
/// live.refresh(&Pose::IDENTITY, &mut scratch);
/// assert!(!live.is_loaded(&Pose::IDENTITY, &scratch));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct LiveSource {
    id: SourceId,
    newest: Mutex<Shared>,
    /// The pose last asked for, metres and a quaternion, as bits. Torn reads are harmless: it only
    /// says what to load next.
    last_pose: [AtomicU64; 7],
}

struct Shared {
    sum: SumSource,
    ports: Vec<ReaderPort>,
}

/// The publishing end of one reader's rings.
struct ReaderPort {
    updates: Producer<Box<Snapshot>>,
    retired: Consumer<Box<Snapshot>>,
    /// Not sent yet because the ring was full.
    waiting: Option<Box<Snapshot>>,
}

/// The reading end, kept in the reader's scratch.
struct Reader {
    /// The source whose snapshots these are.
    of: SourceId,
    current: Box<Snapshot>,
    updates: Consumer<Box<Snapshot>>,
    retired: Producer<Box<Snapshot>>,
}

impl Reader {
    /// Takes over the next snapshot, if there is one, and says what that changed at `pose`.
    fn exchange(&mut self, pose: &Pose) -> Option<Response> {
        if self.retired.is_full() {
            return None;
        }
        let mut next = self.updates.pop().ok()?;
        let change = next.replace(&mut self.current, pose);
        let old = std::mem::replace(&mut self.current, next);
        // There is room: this end alone fills the ring.
        let _ = self.retired.push(old);
        change
    }
}

impl LiveSource {
    /// Begins with `sum`; `start` is what [`LiveSource::last_pose`] says before the first
    /// evaluation.
    pub fn new(sum: SumSource, start: &Pose) -> Self {
        Self {
            id: SourceId::new(),
            newest: Mutex::new(Shared {
                sum,
                ports: Vec::new(),
            }),
            last_pose: numbers(start).map(|v| AtomicU64::new(v.to_bits())),
        }
    }

    /// Shows `sum` to every reader from its next [`EnergySource::refresh`] on.
    pub fn publish(&self, sum: SumSource) {
        let mut shared = self.shared();
        for port in &mut shared.ports {
            port.waiting = Some(Snapshot::new(&sum));
        }
        shared.sum = sum;
        shared.reclaim();
    }

    /// Frees what readers have given back and sends what did not fit before. To be called now and
    /// then by the publishing thread.
    pub fn reclaim(&self) {
        self.shared().reclaim();
    }

    /// The moving part's pose that was last asked for, in the scene.
    pub fn last_pose(&self) -> Pose {
        let at = |k: usize| f64::from_bits(self.last_pose[k].load(Ordering::Relaxed));
        let rotation = DQuat::from_xyzw(at(3), at(4), at(5), at(6));
        Pose::new(rotation, DVec3::new(at(0), at(1), at(2)))
    }

    fn reader<'a>(&self, scratch: &'a mut Scratch) -> &'a mut Reader {
        let reader = scratch.get_mut();
        self.check(reader);
        reader
    }

    /// Panics if the scratch is that of another live source.
    fn check(&self, reader: &Reader) {
        assert!(reader.of == self.id, "the scratch of another live source");
    }

    fn shared(&self) -> MutexGuard<'_, Shared> {
        // What is behind the lock is whole at every step: a panic elsewhere leaves it usable.
        self.newest.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn numbers(pose: &Pose) -> [f64; 7] {
    let ([x, y, z], [a, b, c, w]) = (pose.translation.to_array(), pose.rotation.to_array());
    [x, y, z, a, b, c, w]
}

impl Shared {
    fn reclaim(&mut self) {
        // A reader whose scratch is gone takes no more.
        self.ports.retain(|p| !p.updates.is_abandoned());
        for port in &mut self.ports {
            while let Ok(old) = port.retired.pop() {
                drop(old);
            }
            if let Some(snapshot) = port.waiting.take() {
                port.waiting = match port.updates.push(snapshot) {
                    Ok(()) => None,
                    Err(rtrb::PushError::Full(snapshot)) => Some(snapshot),
                };
            }
        }
    }
}

impl EnergySource for LiveSource {
    fn scratch(&self) -> Scratch {
        let (updates, take) = RingBuffer::new(RING);
        let (give, retired) = RingBuffer::new(RING);
        let mut shared = self.shared();
        shared.ports.push(ReaderPort {
            updates,
            retired,
            waiting: None,
        });
        Scratch::new(Reader {
            of: self.id,
            current: Snapshot::new(&shared.sum),
            updates: take,
            retired: give,
        })
    }

    fn evaluate(&self, pose: &Pose, scratch: &mut Scratch) -> Response {
        for (cell, value) in self.last_pose.iter().zip(numbers(pose)) {
            cell.store(value.to_bits(), Ordering::Relaxed);
        }
        self.reader(scratch).current.respond(pose)
    }

    fn refresh(&self, pose: &Pose, scratch: &mut Scratch) -> Option<Response> {
        let reader = self.reader(scratch);
        let exchanged = reader.exchange(pose);
        match (exchanged, reader.current.update_counted(pose)) {
            (Some(a), Some(b)) => Some(Response {
                energy: a.energy + b.energy,
                wrench: a.wrench + b.wrench,
                coverage: a.coverage.max(b.coverage),
            }),
            (a, b) => a.or(b),
        }
    }

    fn is_loaded(&self, pose: &Pose, scratch: &Scratch) -> bool {
        let reader: &Reader = scratch.get();
        self.check(reader);
        reader.current.all_loaded(pose)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::sum::PlacedSource;
    use crate::scene::sum::SharedSource;
    use fft_correlate::Placement;
    use std::sync::Arc;

    /// A constant energy that counts its drops.
    struct Level(f64, Arc<AtomicU64>);

    impl Drop for Level {
        fn drop(&mut self) {
            self.1.fetch_add(1, Ordering::Relaxed);
        }
    }

    impl EnergySource for Level {
        fn scratch(&self) -> Scratch {
            Scratch::default()
        }

        fn evaluate(&self, _: &Pose, _: &mut Scratch) -> Response {
            Response {
                energy: self.0,
                coverage: 1.0,
                ..Response::default()
            }
        }
    }

    fn sum(energy: f64, drops: &Arc<AtomicU64>) -> SumSource {
        let source: Arc<dyn EnergySource> = Arc::new(Level(energy, Arc::clone(drops)));
        let placed = PlacedSource {
            source: Some(SharedSource::new(source)),
            placement: Placement::IDENTITY,
            reach: None,
        };
        SumSource::new(DVec3::ZERO, vec![placed])
    }

    #[test]
    fn a_reader_sees_the_newest_only_after_it_refreshes_and_frees_nothing() {
        let drops = Arc::new(AtomicU64::new(0));
        let live = LiveSource::new(sum(1.0, &drops), &Pose::IDENTITY);
        let pose = Pose::from_translation(DVec3::X);
        let mut reader = live.scratch();
        assert_eq!(live.evaluate(&pose, &mut reader).energy, 1.0);
        assert_eq!(live.last_pose(), pose);
        assert!(live.refresh(&pose, &mut reader).is_none());
        live.publish(sum(3.5, &drops));
        assert_eq!(live.evaluate(&pose, &mut reader).energy, 1.0);
        assert_eq!(live.refresh(&pose, &mut reader).unwrap().energy, 2.5);
        assert_eq!(live.evaluate(&pose, &mut reader).energy, 3.5);
        assert_eq!(drops.load(Ordering::Relaxed), 0, "the reader kept it");
        live.reclaim();
        assert_eq!(drops.load(Ordering::Relaxed), 1);
    }

    #[test]
    fn a_reader_that_does_not_refresh_holds_nobody_up_and_ends_with_the_newest() {
        let drops = Arc::new(AtomicU64::new(0));
        let live = LiveSource::new(sum(0.0, &drops), &Pose::IDENTITY);
        let mut reader = live.scratch();
        for k in 1..=100 {
            live.publish(sum(f64::from(k), &drops));
        }
        let pose = Pose::IDENTITY;
        for _ in 0..2 * RING + 2 {
            live.refresh(&pose, &mut reader);
            live.reclaim();
        }
        assert_eq!(live.evaluate(&pose, &mut reader).energy, 100.0);
        assert_eq!(drops.load(Ordering::Relaxed), 100);
        drop(reader);
        live.reclaim();
        assert!(live.shared().ports.is_empty());
    }

    #[test]
    #[should_panic(expected = "another live source")]
    fn a_scratch_of_another_live_source_is_refused() {
        let drops = Arc::default();
        let [a, b] = [1.0, 2.0].map(|e| LiveSource::new(sum(e, &drops), &Pose::IDENTITY));
        a.evaluate(&Pose::IDENTITY, &mut b.scratch());
    }
}

#[cfg(test)]
mod snapshot_tests {
    use std::sync::Arc;

    use fft_correlate::{EnergySource, Placement, Scratch, Wrench};
    use glam::DVec3;

    use super::*;
    use crate::scene::sum::PlacedSource;
    use crate::scene::sum::SharedSource;

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
            .map(|(source, y)| PlacedSource {
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
        assert!(!part.all_loaded(&HERE));
        let whole = sum(both);
        let mut loaded = Snapshot::new(&whole);
        let change = loaded.replace(&mut part, &HERE).unwrap();
        assert!(loaded.all_loaded(&HERE));
        let after = loaded.respond(&HERE);
        assert_eq!(after, whole.evaluate(&HERE, &mut whole.scratch()));
        let expected = after.wrench + answer.wrench * -1.0;
        // One rounding of numbers of order one.
        assert!((change.wrench.force - expected.force).length() < 1e-14);
        assert!((change.energy - (after.energy - answer.energy)).abs() < 1e-14);
        assert!(change.wrench.force.length() > 0.1);
        let mut again = Snapshot::new(&whole);
        assert_eq!(again.replace(&mut loaded, &HERE), None);
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
        assert_eq!(new.replace(&mut old, &HERE), None);
        let other = Some(SharedSource::new(Arc::new(Spring(1.0))));
        let mut newer = Snapshot::new(&sum([other, None]));
        assert!(newer.replace(&mut new, &HERE).is_some());
    }
}
