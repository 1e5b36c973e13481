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

use crate::SumSource;

/// Snapshots under way to a reader, and back.
const RING: usize = 4;

/// The newest [`SumSource`] for every reader.
///
/// A pair of which not all that matters at the pose is in memory does not count for a reader, and its
/// going and coming are changes like an exchange: they happen in [`EnergySource::refresh`] only.
pub struct LiveSource {
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
struct View {
    current: Box<Snapshot>,
    updates: Consumer<Box<Snapshot>>,
    retired: Producer<Box<Snapshot>>,
}

struct Snapshot {
    sum: SumSource,
    scratch: Scratch,
    /// Whether each pair counts.
    on: Vec<bool>,
}

impl Snapshot {
    fn new(sum: &SumSource) -> Box<Self> {
        Box::new(Self {
            scratch: sum.scratch(),
            on: vec![true; sum.len()],
            sum: sum.clone(),
        })
    }
}

impl View {
    /// Takes over the next snapshot, if there is one, and says what that changed at `pose`.
    fn exchange(&mut self, pose: &Pose) -> Option<Response> {
        if self.retired.is_full() {
            return None;
        }
        let mut next = self.updates.pop().ok()?;
        let old = &mut self.current;
        for (i, on) in next.on.iter_mut().enumerate() {
            *on = !next.sum.same_field(&old.sum, i) || old.on[i];
        }
        let change = next.sum.change_since(
            &old.sum,
            pose,
            (&mut next.scratch, &next.on),
            (&mut old.scratch, &old.on),
        );
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

fn view(scratch: &mut Scratch) -> Option<&mut View> {
    scratch.view.as_mut()?.downcast_mut()
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
        let view = View {
            current: Snapshot::new(&shared.sum),
            updates: take,
            retired: give,
        };
        Scratch {
            view: Some(Box::new(view)),
            ..Scratch::default()
        }
    }

    fn evaluate(&self, pose: &Pose, scratch: &mut Scratch) -> Response {
        for (cell, value) in self.asked.iter().zip(numbers(pose)) {
            cell.store(value.to_bits(), Ordering::Relaxed);
        }
        let Some(view) = view(scratch) else {
            debug_assert!(false, "scratch of another source");
            return Response::default();
        };
        let Snapshot { sum, scratch, on } = &mut *view.current;
        sum.respond(pose, scratch, |i| on[i])
    }

    fn refresh(&self, pose: &Pose, scratch: &mut Scratch) -> Option<Response> {
        let view = view(scratch)?;
        let exchanged = view.exchange(pose);
        let Snapshot { sum, scratch, on } = &mut *view.current;
        match (exchanged, sum.switch(pose, scratch, on)) {
            (Some(a), Some(b)) => Some(Response {
                energy: a.energy + b.energy,
                wrench: a.wrench + b.wrench,
                coverage: a.coverage.max(b.coverage),
            }),
            (a, b) => a.or(b),
        }
    }

    fn is_loaded(&self, pose: &Pose, scratch: &Scratch) -> bool {
        let view = scratch.view.as_ref().and_then(|v| v.downcast_ref::<View>());
        view.is_some_and(|v| v.current.sum.counts_all(pose, &v.current.on))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Placed;
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
            source: Some(source),
            placement: Pose::IDENTITY,
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
}
