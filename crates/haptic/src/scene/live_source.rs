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

use crate::scene::shared::SourceId;
use crate::scene::snapshot::Snapshot;
use crate::scene::sum::SumSource;

/// Snapshots under way to a reader, and back.
const RING: usize = 4;

/// The newest [`SumSource`] for every reader.
///
/// A pair of which not all that matters at the pose is in memory does not count for a reader, and
/// its going and coming are changes like an exchange: they happen in [`EnergySource::refresh`]
/// only.
pub struct LiveSource {
    id: SourceId,
    newest: Mutex<Shared>,
    /// The pose last asked for, metres and a quaternion, as bits. Torn reads are harmless: it only
    /// says what to load next.
    asked: [AtomicU64; 7],
}

struct Shared {
    sum: SumSource,
    ports: Vec<Port>,
}

/// The publishing end of one reader's rings.
struct Port {
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
        let change = next.take_over(&mut self.current, pose);
        let old = std::mem::replace(&mut self.current, next);
        // There is room: this end alone fills the ring.
        let _ = self.retired.push(old);
        change
    }
}

impl LiveSource {
    /// Begins with `sum`; `start` is what [`LiveSource::asked`] says before the first evaluation.
    pub fn new(sum: SumSource, start: &Pose) -> Self {
        Self {
            id: SourceId::new(),
            newest: Mutex::new(Shared {
                sum,
                ports: Vec::new(),
            }),
            asked: numbers(start).map(|v| AtomicU64::new(v.to_bits())),
        }
    }

    /// Shows `sum` to every reader from its next [`EnergySource::refresh`] on.
    pub fn publish(&self, sum: SumSource) {
        let mut shared = self.shared();
        for port in &mut shared.ports {
            port.waiting = Some(Snapshot::new(&sum));
        }
        shared.sum = sum;
        shared.tend();
    }

    /// Frees what readers have given back and sends what did not fit before. To be called now and
    /// then by the publishing thread.
    pub fn tend(&self) {
        self.shared().tend();
    }

    /// The moving part's pose that was last asked for, in the scene.
    pub fn asked(&self) -> Pose {
        let at = |k: usize| f64::from_bits(self.asked[k].load(Ordering::Relaxed));
        let rotation = DQuat::from_xyzw(at(3), at(4), at(5), at(6));
        Pose::new(rotation, DVec3::new(at(0), at(1), at(2)))
    }

    fn reader_mut<'a>(&self, scratch: &'a mut Scratch) -> &'a mut Reader {
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
    fn tend(&mut self) {
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
        shared.ports.push(Port {
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
        for (cell, value) in self.asked.iter().zip(numbers(pose)) {
            cell.store(value.to_bits(), Ordering::Relaxed);
        }
        self.reader_mut(scratch).current.respond(pose)
    }

    fn refresh(&self, pose: &Pose, scratch: &mut Scratch) -> Option<Response> {
        let reader = self.reader_mut(scratch);
        let exchanged = reader.exchange(pose);
        match (exchanged, reader.current.switch(pose)) {
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
        reader.current.counts_all(pose)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::shared::SharedSource;
    use crate::scene::sum::Placed;
    use fft_correlate::Placement;
    use std::sync::Arc;

    /// A constant energy that tells when it is dropped.
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
        let placed = Placed {
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
        assert_eq!(live.asked(), pose);
        assert!(live.refresh(&pose, &mut reader).is_none());
        live.publish(sum(3.5, &drops));
        assert_eq!(live.evaluate(&pose, &mut reader).energy, 1.0);
        assert_eq!(live.refresh(&pose, &mut reader).unwrap().energy, 2.5);
        assert_eq!(live.evaluate(&pose, &mut reader).energy, 3.5);
        assert_eq!(drops.load(Ordering::Relaxed), 0, "the reader kept it");
        live.tend();
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
            live.tend();
        }
        assert_eq!(live.evaluate(&pose, &mut reader).energy, 100.0);
        assert_eq!(drops.load(Ordering::Relaxed), 100);
        drop(reader);
        live.tend();
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
