use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DQuat;
use sdf_grid::Silent;

use super::*;
use crate::geometry::half_turn::half_turn_groups;

/// Energies that say which rotation they are of; counts the scratches.
#[derive(Default)]
struct Angles {
    scratches: AtomicUsize,
}

impl NodeEnergies for Angles {
    type Scratch = ();

    fn scratch(&self) {
        self.scratches.fetch_add(1, Ordering::Relaxed);
    }

    fn energies(&self, rotation: DQuat, (): &mut (), mut out: ArrayViewMut3<'_, f32>) {
        out.fill(angle(rotation));
    }
}

fn angle(rotation: DQuat) -> f32 {
    (2.0 * rotation.w.abs().min(1.0).acos()) as f32
}

/// Keeps what it takes; refuses one row, does not want another.
struct Keeper {
    kept: Vec<(usize, f32)>,
    refused: Option<usize>,
}

impl Consumer<()> for Keeper {
    type Error = usize;

    fn is_wanted(&mut self, member: &Member) -> Result<bool, usize> {
        Ok(member.row % 5 != 3)
    }

    fn take(&mut self, member: Member, energies: &mut [f32]) -> Result<(), usize> {
        assert_eq!(energies.len(), 8);
        assert!(energies.iter().all(|e| *e == energies[0]));
        self.kept.push((member.row, energies[0]));
        match self.refused == Some(member.row) {
            true => Err(member.row),
            false => Ok(()),
        }
    }
}

/// Counts rotations, and cancels at some number of them.
struct Count {
    seen: AtomicUsize,
    limit: usize,
}

impl Monitor for Count {
    fn advance(&self, steps: u64) {
        self.seen.fetch_add(steps as usize, Ordering::Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.seen.load(Ordering::Relaxed) >= self.limit
    }
}

/// Forty rotations about x, of which pairs differ by a half turn.
fn rotations() -> Vec<DQuat> {
    let alone = (0..20).map(|i| DQuat::from_rotation_x(0.1 * f64::from(i) + 0.05));
    alone
        .flat_map(|q| [q, HalfTurn::Y.rotation() * q])
        .collect()
}

fn run(
    producer: &Angles,
    refused: Option<usize>,
    threads: usize,
    monitor: &dyn Monitor,
) -> Result<SweepOutcome<Keeper>, usize> {
    let groups = half_turn_groups(&rotations());
    let groups = groups
        .iter()
        .filter_map(|g| Group::of(g, |row| (row != 7).then_some(())));
    let keeper = || Keeper {
        kept: Vec::new(),
        refused,
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.unwrap()
        .install(|| sweep(producer, [2; 3], groups.collect(), keeper, monitor))
}

#[test]
fn every_wanted_rotation_is_taken_once_whatever_the_threads() {
    let rotations = rotations();
    let wanted = (0..rotations.len()).filter(|row| *row != 7 && row % 5 != 3);
    let wanted: Vec<_> = wanted.map(|row| (row, angle(rotations[row]))).collect();
    for threads in [1, 3, 8] {
        let (producer, count) = (
            Angles::default(),
            Count {
                seen: AtomicUsize::new(0),
                limit: usize::MAX,
            },
        );
        let swept = run(&producer, None, threads, &count).unwrap();
        assert!(swept.complete);
        let mut kept: Vec<_> = swept.consumers.into_iter().flat_map(|c| c.kept).collect();
        kept.sort_by_key(|k| k.0);
        let rows = |list: &[(usize, f32)]| list.iter().map(|k| k.0).collect::<Vec<_>>();
        assert_eq!(rows(&kept), rows(&wanted));
        assert!(
            kept.iter()
                .zip(&wanted)
                .all(|(a, b)| (a.1 - b.1).abs() < 1e-6)
        );
        // What is not wanted counts as done; what is not in the groups does not.
        assert_eq!(count.seen.into_inner(), rotations.len() - 1);
        assert!(producer.scratches.into_inner() <= threads);
    }
}

#[test]
fn an_error_ends_it_and_so_does_the_monitor_between_groups() {
    for threads in [1, 4] {
        assert_eq!(
            run(&Angles::default(), Some(6), threads, &Silent).err(),
            Some(6)
        );
    }
    let stop = Count {
        seen: AtomicUsize::new(0),
        limit: 9,
    };
    let swept = run(&Angles::default(), None, 1, &stop).unwrap();
    assert!(!swept.complete);
    // The group begun before the ninth was finished.
    assert_eq!(stop.seen.into_inner(), 9);
    let never = Count {
        seen: AtomicUsize::new(0),
        limit: 0,
    };
    let swept = run(&Angles::default(), None, 2, &never).unwrap();
    assert!(!swept.complete && swept.consumers.is_empty());
}
