//! The loop over rotations, with which docking scores and tables are filled: groups of half turns are
//! handed out to all threads, one at a time. A producer ([`NodeEnergies`]) gives the energies of one
//! rotation at all translations of a window.

use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Mutex, PoisonError};

use glam::DQuat;
use ndarray::{Array3, ArrayViewMut3};
use rayon::prelude::*;
use sdf_grid::Monitor;

use crate::correlate::correlator::Correlator;
use crate::correlate::support::CorrelateError;
use crate::correlate::{CorrelatorPlan, CorrelatorScratch, PairSupport};
use crate::geometry::half_turn::{HalfTurn, HalfTurnGroup, RotationSum};
use crate::geometry::translation::TranslationWindow;
use crate::pair::fields::Pair;

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
    /// Where its energies go.
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

/// Takes the energies of rotations, on one thread.
pub(crate) trait Consumer<T>: Send {
    /// Why it cannot go on.
    type Error: Send;

    /// Whether a rotation's energies are wanted; asked once, right before they are computed.
    fn is_wanted(&mut self, _member: &Member<T>) -> Result<bool, Self::Error> {
        Ok(true)
    }

    /// Takes the energies of a rotation, in the producer's unit, all translations of the window in C
    /// order; may change them.
    fn take(&mut self, member: Member<T>, energies: &mut [f32]) -> Result<(), Self::Error>;
}

/// The result of a sweep.
pub(crate) struct SweepOutcome<C> {
    /// What the threads had, in no particular order.
    pub(crate) consumers: Vec<C>,
    /// False if the monitor cancelled before all groups were done.
    pub(crate) complete: bool,
}

/// Computes the energies of all groups at the translations of a window of `shape` nodes, on all
/// threads of the current rayon pool, each with one scratch of the producer and a consumer of its
/// own. Groups are handed out in order, one by one, and begun ones are finished. The monitor
/// advances with every rotation, taken or not, and may cancel before every group.
///
/// # Errors
/// The first of a consumer; groups not yet begun are then left undone.
pub(crate) fn sweep<P: NodeEnergies, T: Send, C: Consumer<T>>(
    producer: &P,
    shape: [usize; 3],
    groups: Vec<Group<T>>,
    consumer: impl Fn() -> C + Sync,
    monitor: &dyn Monitor,
) -> Result<SweepOutcome<C>, C::Error> {
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
    Ok(SweepOutcome {
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
            match self.consumer.is_wanted(&member)? {
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

/// Computes the energies of one rotation at all translations of a window.
///
/// [`PairEnergies`] does so by correlation; a closed form may, too. The same rotation must always
/// give the same bits, whatever the thread or process.
///
/// ```
/// use fft_correlate::{NodeEnergies, TranslationWindow};
/// use glam::DQuat;
/// use ndarray::{Array3, ArrayViewMut3};
///
/// /// A spring of 1000 N/m, whatever the rotation.
/// struct Spring(TranslationWindow);
///
/// impl NodeEnergies for Spring {
///     type Scratch = ();
///
///     fn scratch(&self) {}
///
///     fn energies(&self, _: DQuat, _: &mut (), mut out: ArrayViewMut3<'_, f32>) {
///         for ((i, j, k), energy) in out.indexed_iter_mut() {
///             *energy = 500.0 * self.0.displacement([i, j, k]).length_squared() as f32;
///         }
///     }
/// }
///
/// // `EnergyTable::compute` asks for them like this; here for 1 cm either way.
/// let window = TranslationWindow::cube(0.01, 0.002)?;
/// let mut energies = Array3::zeros(window.shape());
/// Spring(window).energies(DQuat::IDENTITY, &mut (), energies.view_mut());
/// assert!((energies[[0, 5, 5]] - 0.05).abs() < 1e-6 && energies[[5, 5, 5]] == 0.0);
/// # Ok::<(), sdf_grid::LatticeError>(())
/// ```
pub trait NodeEnergies: Sync {
    /// Working memory of one thread.
    type Scratch: Send;

    /// Makes working memory.
    fn scratch(&self) -> Self::Scratch;

    /// Joules of one unit of the energies: 1 unless they come in another one, as scores do, whose
    /// unit is `-gamma`.
    fn unit(&self) -> f32 {
        1.0
    }

    /// Writes to `out`, shaped as the window, the energies of the poses with this rotation, in
    /// units of [`NodeEnergies::unit`].
    fn energies(&self, rotation: DQuat, scratch: &mut Self::Scratch, out: ArrayViewMut3<'_, f32>);

    /// The same for sums of the energies of near rotations: for each of `turns`, `sum` with all its
    /// rotations followed by that half turn. What a turn gives may differ by rounding from the sum
    /// of [`NodeEnergies::energies`], but not with the other turns asked for.
    fn sums(
        &self,
        sum: &RotationSum,
        turns: &[HalfTurn],
        scratch: &mut Self::Scratch,
        outs: &mut [ArrayViewMut3<'_, f32>],
    ) {
        for (turn, out) in turns.iter().zip(outs) {
            let terms = sum.turned(*turn);
            let [(rotation, weight), more @ ..] = terms.terms() else {
                continue;
            };
            self.energies(*rotation, scratch, out.view_mut());
            if more.is_empty() {
                continue;
            }
            out.mapv_inplace(|e| *weight as f32 * e);
            let mut other = Array3::zeros(out.raw_dim());
            for (rotation, weight) in more {
                self.energies(*rotation, scratch, other.view_mut());
                out.scaled_add(*weight as f32, &other);
            }
        }
    }
}

/// A pair's energies by FFT correlation: its scores, in the unit `-gamma` (eq_6).
///
/// See the example of [`EnergyTable`](crate::EnergyTable).
pub struct PairEnergies {
    correlator: Correlator,
    gamma: f64,
}

impl PairEnergies {
    /// Plans the correlation of a pair over a window for single rotations.
    ///
    /// # Errors
    /// As [`Correlator::new`].
    pub fn plan(pair: &Pair, window: &TranslationWindow) -> Result<Self, CorrelateError> {
        let plan = CorrelatorPlan::new(&PairSupport::of(pair)?, window)?;
        Ok(Self::planned(plan.for_sums(), pair))
    }

    /// The same for the rotations of `groups`, which share work if they are large enough, without
    /// sums of near rotations.
    pub(crate) fn plan_for_groups(
        pair: &Pair,
        window: &TranslationWindow,
        groups: &[HalfTurnGroup],
    ) -> Result<Self, CorrelateError> {
        let plan = CorrelatorPlan::for_groups(&PairSupport::of(pair)?, window, groups)?;
        Ok(Self::planned(plan, pair))
    }

    /// The same as planned.
    ///
    /// # Errors
    /// As [`Correlator::build`].
    pub fn build(plan: &CorrelatorPlan, pair: &Pair) -> Result<Self, CorrelateError> {
        Ok(Self {
            correlator: Correlator::build(plan, pair)?,
            gamma: pair.model().gamma,
        })
    }

    /// For the pair that was planned for.
    fn planned(plan: CorrelatorPlan, pair: &Pair) -> Self {
        Self {
            correlator: Correlator::planned(plan, pair),
            gamma: pair.model().gamma,
        }
    }

    /// The correlator.
    pub fn correlator(&self) -> &Correlator {
        &self.correlator
    }
}

impl NodeEnergies for PairEnergies {
    type Scratch = CorrelatorScratch;

    fn scratch(&self) -> CorrelatorScratch {
        self.correlator.scratch()
    }

    fn unit(&self) -> f32 {
        -(self.gamma as f32)
    }

    fn energies(
        &self,
        rotation: DQuat,
        scratch: &mut CorrelatorScratch,
        out: ArrayViewMut3<'_, f32>,
    ) {
        self.correlator.score(rotation, scratch, out);
    }

    fn sums(
        &self,
        sum: &RotationSum,
        turns: &[HalfTurn],
        scratch: &mut CorrelatorScratch,
        outs: &mut [ArrayViewMut3<'_, f32>],
    ) {
        self.correlator.score_sums(sum, turns, scratch, outs);
    }
}

#[cfg(test)]
#[path = "sweep_tests.rs"]
mod tests;
