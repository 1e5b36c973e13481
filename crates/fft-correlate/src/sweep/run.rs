//! The loop over rotations: groups of half turns handed out to all threads, one at a time.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};

use ndarray::ArrayViewMut3;
use rayon::prelude::*;
use sdf_grid::Monitor;

use crate::geometry::half_turn::{HalfTurn, HalfTurnGroup};
use crate::geometry::rotation_sum::RotationSum;
use crate::sweep::producer::NodeEnergies;

/// Rotations that differ by half turns, all or some of a [`HalfTurnGroup`], and what each is to be
/// done with.
pub(crate) struct Group<T = ()> {
    /// The sum that the turns follow.
    sum: RotationSum,
    members: Vec<Member<T>>,
}

/// One rotation of a group.
pub(crate) struct Member<T = ()> {
    turn: HalfTurn,
    /// Its place in the list of rotations.
    pub(crate) row: usize,
    /// Where its energies go, for those who need to be told.
    pub(crate) target: T,
}

impl<T> Group<T> {
    /// The members of a group for whose rows `target` gives something; `None` if there are none.
    pub(crate) fn of(
        group: &HalfTurnGroup,
        target: impl FnMut(usize) -> Option<T>,
    ) -> Option<Self> {
        Self::of_sums(group, RotationSum::one(group.rotation), target)
    }

    /// The same for sums of near rotations; `sum` is the first member's.
    pub(crate) fn of_sums(
        group: &HalfTurnGroup,
        sum: RotationSum,
        mut target: impl FnMut(usize) -> Option<T>,
    ) -> Option<Self> {
        let member = |&(turn, row): &(HalfTurn, usize)| {
            let target = target(row)?;
            Some(Member { turn, row, target })
        };
        let members: Vec<_> = group.members.iter().filter_map(member).collect();
        (!members.is_empty()).then_some(Self { sum, members })
    }

    /// Rotations in the group.
    pub(crate) fn len(&self) -> usize {
        self.members.len()
    }
}

/// What is done with the energies of rotations, by one thread.
pub(crate) trait Consumer<T>: Send {
    /// Why it cannot go on.
    type Error: Send;

    /// Whether a rotation's energies are wanted; asked once, right before they are computed.
    fn wants(&mut self, _member: &Member<T>) -> Result<bool, Self::Error> {
        Ok(true)
    }

    /// Takes the energies of a rotation, in the producer's unit, all translations of the window in C
    /// order; may change them.
    fn take(&mut self, member: Member<T>, energies: &mut [f32]) -> Result<(), Self::Error>;
}

/// What became of a sweep.
pub(crate) struct Swept<C> {
    /// What the threads had, in no particular order.
    pub(crate) consumers: Vec<C>,
    /// False if the monitor cancelled before all groups were done.
    pub(crate) complete: bool,
}

/// Computes the energies of all groups at the translations of a window of `shape` nodes, on all
/// threads of the current rayon pool, each with one scratch of the producer and a consumer of its
/// own. Groups are handed out in order, one by one, and begun ones are finished. The monitor
/// is told of every rotation, taken or not wanted, and asked to cancel before every group.
///
/// # Errors
/// The first of a consumer; groups not yet begun are then left undone.
pub(crate) fn sweep<P: NodeEnergies, T: Send, C: Consumer<T>>(
    producer: &P,
    shape: [usize; 3],
    groups: Vec<Group<T>>,
    consumer: impl Fn() -> C + Sync,
    monitor: &dyn Monitor,
) -> Result<Swept<C>, C::Error> {
    let threads = rayon::current_num_threads().min(groups.len());
    let left = Mutex::new(groups.into_iter());
    let failed = AtomicBool::new(false);
    let next = || left.lock().unwrap_or_else(PoisonError::into_inner).next();
    let work = |_| {
        let mut thread = None;
        while !failed.load(Relaxed) && !monitor.cancelled() {
            let Some(group) = next() else { break };
            let worker = thread.get_or_insert_with(|| Worker {
                producer,
                shape,
                scratch: producer.scratch(),
                energies: Vec::new(),
                consumer: consumer(),
            });
            worker
                .group(group, monitor)
                .inspect_err(|_| failed.store(true, Relaxed))?;
        }
        Ok(thread.map(|worker| worker.consumer))
    };
    // A piece of work per thread, which takes groups until there are none.
    let consumers = (0..threads).into_par_iter().with_max_len(1).map(work);
    let consumers: Vec<Option<C>> = consumers.collect::<Result<_, _>>()?;
    Ok(Swept {
        consumers: consumers.into_iter().flatten().collect(),
        complete: next().is_none(),
    })
}

/// One thread of a sweep.
struct Worker<'a, P: NodeEnergies, C> {
    producer: &'a P,
    shape: [usize; 3],
    scratch: P::Scratch,
    /// Of one group.
    energies: Vec<f32>,
    consumer: C,
}

impl<P: NodeEnergies, C> Worker<'_, P, C> {
    /// Computes and hands over what is wanted of a group.
    fn group<T>(&mut self, group: Group<T>, monitor: &dyn Monitor) -> Result<(), C::Error>
    where
        C: Consumer<T>,
    {
        let mut wanted = Vec::with_capacity(group.members.len());
        for member in group.members {
            match self.consumer.wants(&member)? {
                true => wanted.push(member),
                false => monitor.advance(1),
            }
        }
        if wanted.is_empty() {
            return Ok(());
        }
        let length = self.shape.iter().product();
        self.energies.resize(wanted.len() * length, 0.0);
        let turns: Vec<_> = wanted.iter().map(|m| m.turn).collect();
        let mut outs: Vec<_> = self
            .energies
            .chunks_exact_mut(length)
            .map(|out| {
                ArrayViewMut3::from_shape(self.shape, out).expect("a node's worth of energies")
            })
            .collect();
        let scratch = &mut self.scratch;
        self.producer.sums(&group.sum, &turns, scratch, &mut outs);
        for (energies, member) in self.energies.chunks_exact_mut(length).zip(wanted) {
            self.consumer.take(member, energies)?;
            monitor.advance(1);
        }
        Ok(())
    }
}

#[cfg(test)]
#[path = "run_tests.rs"]
mod tests;
