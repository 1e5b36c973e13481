//! Tables kept in part, one step of the manager at a time.

use std::sync::Arc;
use std::time::Instant;

use fft_correlate::{
    EnergySource, EnergyTable, PartialTable, Placement, Pose, Scratch, TableFiles,
};
use glam::{DQuat, DVec3};

use crate::scene::event::PairState;
use crate::scene::event::SceneChange;
use crate::scene::pair::{Content, LoadedPair, PairSpec};
use crate::scene::residency::LiveSceneError;
use crate::scene::residency::ResidencyManager;
use crate::scene::residency::SceneOptions;

#[path = "../../tests/common/valleys.rs"]
mod valleys;

use valleys::{REACH, Valleys, open};

const VALLEYS: Valleys = Valleys {
    spring: 1e-3,
    depth: 1e-3,
};

fn pair(files: &TableFiles, x: f64) -> PairSpec {
    let files = files.clone();
    PairSpec {
        name: format!("part at {x}"),
        placement: Placement::of_fixed(Pose::from_translation(DVec3::new(x, 0.0, 0.0))),
        reach: REACH,
        bytes: 0,
        files: Vec::new(),
        same_as: None,
        load: Box::new(move |_| {
            Ok(LoadedPair {
                content: Content::Table(Box::new(PartialTable::new(open(&files))?)),
                reach: REACH,
                right: None,
            })
        }),
    }
}

fn options(memory: u64) -> SceneOptions {
    SceneOptions {
        memory,
        ahead: 0.05,
        ..SceneOptions::default()
    }
}

/// Somewhere in the well, turned by `angle` about an axis that is none of the chart's.
fn turned(angle: f64) -> Pose {
    let axis = DVec3::new(0.3, 0.8, -0.5).normalize();
    Pose::new(
        DQuat::from_axis_angle(axis, angle),
        DVec3::new(0.006, -0.003, 0.011),
    )
}

fn state(manager: &ResidencyManager) -> PairState {
    let mut states = Vec::new();
    manager.states(&mut states);
    states[0]
}

struct TestLoop {
    manager: ResidencyManager,
    source: Arc<crate::scene::live_source::LiveSource>,
    reader: Scratch,
    whole: EnergyTable,
}

impl TestLoop {
    fn new(files: &TableFiles, memory: u64, start: &Pose) -> Result<Self, LiveSceneError> {
        let (mut manager, source) =
            ResidencyManager::new(vec![pair(files, 0.0)], options(memory), start);
        manager.load_in_reach(start)?;
        Ok(Self {
            manager,
            reader: source.scratch(),
            source,
            whole: open(files).load(1 << 30).unwrap(),
        })
    }

    /// One tick of a loop and one step of the manager; whether the pose was loaded.
    fn tick(&mut self, pose: &Pose) -> bool {
        let change = self.source.refresh(pose, &mut self.reader);
        let found = self.source.evaluate(pose, &mut self.reader);
        let loaded = self.source.is_loaded(pose, &self.reader);
        let whole = self.whole.respond(pose);
        if loaded {
            assert_eq!(found.energy, whole.energy);
            // A sum turns wrenches into the scene's frame, here by nothing, which rounds.
            let off = found.wrench + whole.wrench * -1.0;
            assert!(off.torque.length() < 1e-16 && off.force.length() < 1e-16);
        } else {
            assert_eq!((found.energy, found.coverage), (0.0, 0.0));
        }
        if let Some(change) = change {
            // Taken is what was there before a jump left nothing to ask.
            let booked = match loaded {
                true => change.energy == whole.energy,
                false => change.energy == -whole.energy || change.energy == 0.0,
            };
            assert!(booked, "{change:?} {}", whole.energy);
        }
        self.manager.step(&self.source.last_pose(), Instant::now());
        loaded
    }
}

const ROUND: f64 = 2.0;

#[test]
fn a_hand_that_turns_takes_its_rotations_along_and_never_exceeds_the_budget() {
    let files = VALLEYS.bake();
    let parts = PartialTable::new(open(&files)).unwrap();
    let budget = parts.node_bytes() * (parts.nodes() as u64) / 4;
    let mut test = TestLoop::new(&files, budget, &turned(0.0)).unwrap();
    let mut unloaded = 0;
    for k in 0..6000 {
        // Forth and back through the whole domain, in steps of 0.06 degrees at most.
        let pose = turned((f64::from(k) * ROUND / 2000.0).sin());
        unloaded += u32::from(!test.tick(&pose));
        assert!(test.manager.tables.held_bytes() <= budget, "tick {k}");
    }
    assert_eq!(unloaded, 0, "the manager was ahead of the hand");
    assert!(matches!(state(&test.manager), PairState::Partly { .. }));
    assert!(
        test.manager.tables.held_bytes() > budget / 2,
        "and the room is used"
    );
    // A jump to where nothing is loaded: nothing for a while, then all of it.
    let there = turned(-0.95);
    test.tick(&turned(0.9));
    for _ in 0..200 {
        test.tick(&turned(0.9));
    }
    assert!(!test.tick(&there));
    let ticks = (0..200).take_while(|_| !test.tick(&there)).count();
    assert!((1..100).contains(&ticks), "{ticks}");
    assert!(test.manager.tables.held_bytes() <= budget);
    let told = test.manager.events.iter();
    assert_eq!(
        told.filter(|e| matches!(e.what, SceneChange::NoRoom { .. }))
            .count(),
        0
    );
}

#[test]
fn with_room_for_all_the_nearest_come_first_and_the_rest_follows() {
    let files = VALLEYS.bake();
    let start = turned(0.4);
    let mut test = TestLoop::new(&files, u64::MAX, &start).unwrap();
    let PairState::Partly { rotations, of } = state(&test.manager) else {
        panic!("{:?}", state(&test.manager));
    };
    assert!(
        rotations < of / 2,
        "{rotations} of {of} before the loop starts"
    );
    assert!(test.tick(&start), "and they are the ones that matter");
    let steps = (0..10_000).take_while(|_| {
        test.tick(&start);
        test.manager.load_rotations(&start)
    });
    assert!(steps.count() > 1);
    assert_eq!(state(&test.manager), PairState::Loaded);
    let complete = test.manager.events.iter();
    let complete = complete.filter(|e| matches!(e.what, SceneChange::Complete { .. }));
    assert_eq!(complete.count(), 1);
    assert!(test.tick(&turned(-0.9)));
}

#[test]
fn a_budget_below_what_a_pose_needs_is_refused_at_the_start_and_told_later() {
    let files = VALLEYS.bake();
    let parts = PartialTable::new(open(&files)).unwrap();
    let mut distances = vec![0.0; parts.nodes()];
    parts.distances(DQuat::IDENTITY, &mut distances);
    let needed = distances
        .iter()
        .filter(|d| **d < PartialTable::NEEDED)
        .count() as u64;
    let budget = needed * parts.node_bytes();
    let at = |turn: f64| Pose::from_translation(DVec3::new(turn, 0.0, 0.0));
    match TestLoop::new(&files, budget - 1, &at(0.0)) {
        Err(LiveSceneError::Memory { needed, .. }) => assert_eq!(needed, budget),
        other => panic!("{:?}", other.err()),
    }
    // A node needs its neighbours' neighbours; between nodes there are more of them.
    let mut test = TestLoop::new(&files, budget, &at(0.0)).unwrap();
    assert!(test.tick(&at(0.0)));
    let between = Pose::new(DQuat::from_scaled_axis(DVec3::splat(0.05)), DVec3::ZERO);
    for _ in 0..100 {
        test.tick(&between);
        assert!(test.manager.tables.held_bytes() <= budget);
    }
    let told = test.manager.events.iter();
    assert!(
        told.filter(|e| matches!(e.what, SceneChange::NoRoom { .. }))
            .count()
            <= 1
    );
}

#[test]
fn places_that_share_a_table_share_its_rotations() {
    let files = VALLEYS.bake();
    let mut pairs = vec![pair(&files, 0.0), pair(&files, 0.02)];
    pairs[1].placement.fixed.rotation = DQuat::from_rotation_z(0.7);
    pairs[1].same_as = Some(0);
    let (mut manager, source) = ResidencyManager::new(pairs, options(u64::MAX), &Pose::IDENTITY);
    manager.load_in_reach(&Pose::IDENTITY).unwrap();
    let mut reader = source.scratch();
    let pose = Pose::from_translation(DVec3::new(0.01, 0.0, 0.0));
    source.refresh(&pose, &mut reader);
    assert!(
        source.is_loaded(&pose, &reader),
        "both orientations were loaded"
    );
    let whole = open(&files).load(1 << 30).unwrap();
    let second = Pose::new(DQuat::from_rotation_z(0.7), DVec3::new(0.02, 0.0, 0.0));
    let expected = whole.respond(&pose).energy + whole.respond(&(second.inverse() * pose)).energy;
    let found = source.evaluate(&pose, &mut reader).energy;
    // Sums of two in either order.
    assert!((found - expected).abs() < 1e-15, "{found} {expected}");
}

#[test]
fn a_table_that_changes_is_opened_again_and_a_lost_rotation_is_told_once() {
    let files = VALLEYS.bake();
    let mut test = TestLoop::new(&files, u64::MAX, &turned(0.0)).unwrap();
    while test.manager.load_rotations(&turned(0.0)) {}
    test.manager.reload(0);
    test.tick(&turned(0.0));
    let opened =
        |e: &&crate::scene::event::SceneEvent| matches!(e.what, SceneChange::Opened { .. });
    assert_eq!(test.manager.events.iter().filter(opened).count(), 1);
    let ticks = (0..300).take_while(|_| !test.tick(&turned(0.0))).count();
    assert!(ticks < 299, "loaded again");
}
