use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

use fft_correlate::{EnergySource, Placement, Pose, Response, Scratch, Wrench};

use sdf_grid::Aabb;

use super::*;
use crate::scene::live_scene::LiveScene;
use crate::scene::pair::{Content, LoadedPair};

/// Pushes along x with `0` newtons.
struct Push(f64);

impl EnergySource for Push {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
        Response {
            energy: -self.0 * pose.translation.x,
            wrench: Wrench {
                torque: DVec3::ZERO,
                force: DVec3::new(self.0, 0.0, 0.0),
            },
            coverage: 1.0,
        }
    }
}

const REACH: Aabb = Aabb {
    min: DVec3::splat(-0.1),
    max: DVec3::splat(0.1),
};

/// Pair `k` stands at `x = k` metres, takes 100 bytes, pushes with `k + 1` newtons and counts its
/// loads.
fn pair(k: u32, loads: &Arc<AtomicU32>) -> PairSpec {
    let loads = Arc::clone(loads);
    PairSpec {
        name: format!("part {k}"),
        placement: Placement::of_fixed(Pose::from_translation(DVec3::new(f64::from(k), 0.0, 0.0))),
        reach: REACH,
        bytes: 100,
        files: Vec::new(),
        same_as: None,
        load: Box::new(move |_| {
            loads.fetch_add(1, Ordering::Relaxed);
            Ok(LoadedPair {
                content: Content::Whole {
                    source: Arc::new(Push(f64::from(k) + 1.0)),
                    bytes: 100,
                },
                reach: REACH,
                right: None,
            })
        }),
    }
}

fn options(memory: u64) -> SceneOptions {
    SceneOptions {
        memory,
        ahead: 0.5,
        watch: Duration::ZERO,
        ..SceneOptions::default()
    }
}

fn at(x: f64) -> Pose {
    Pose::from_translation(DVec3::new(x, 0.0, 0.0))
}

fn states(manager: &ResidencyManager) -> Vec<PairState> {
    let mut states = Vec::new();
    manager.states(&mut states);
    states
}

fn settle(manager: &mut ResidencyManager, x: f64) {
    for _ in 0..10 {
        manager.step(&at(x), Instant::now());
    }
}

use PairState::{Loaded as In, NoRoom, Waiting};

#[test]
fn only_near_pairs_are_loaded_and_far_ones_make_room() {
    let loads = Arc::new(AtomicU32::new(0));
    let pairs = (0..6).map(|k| pair(k, &loads)).collect();
    let (mut manager, _source) = ResidencyManager::new(pairs, options(200), &at(0.0));
    manager.load_in_reach(&at(0.0)).unwrap();
    settle(&mut manager, 0.0);
    assert_eq!(
        states(&manager),
        [In, Waiting, Waiting, Waiting, Waiting, Waiting]
    );
    // Within 0.5 m ahead of the reach: the next one comes in, the first stays while there is room.
    settle(&mut manager, 0.7);
    assert_eq!(states(&manager)[..3], [In, In, Waiting]);
    settle(&mut manager, 1.9);
    assert_eq!(states(&manager)[..3], [Waiting, In, In]);
    assert_eq!(loads.load(Ordering::Relaxed), 3);
    assert!(
        manager
            .events
            .iter()
            .any(|e| e.pair == "part 0" && e.what == SceneChange::Unloaded)
    );
}

#[test]
fn pairs_in_reach_are_not_unloaded_for_others() {
    let loads = Arc::default();
    let mut pairs: Vec<_> = (0..2).map(|k| pair(k, &loads)).collect();
    pairs[1].placement = Placement::of_fixed(at(0.25));
    let (mut manager, _source) = ResidencyManager::new(pairs, options(100), &at(0.0));
    manager.load_in_reach(&at(0.0)).unwrap();
    settle(&mut manager, 0.09);
    assert_eq!(states(&manager), [In, NoRoom]);
    let told = manager.events.iter().filter(|e| {
        e.what
            == SceneChange::NoRoom {
                needed: 100,
                free: 0,
            }
    });
    assert_eq!(told.count(), 1, "said once");
    // Out of reach of the first, in reach of the second: they change places.
    settle(&mut manager, 0.2);
    assert_eq!(states(&manager), [NoRoom, In]);
}

#[test]
fn a_start_beyond_the_budget_is_refused_by_name() {
    let loads = Arc::default();
    let mut pairs: Vec<_> = (0..2).map(|k| pair(k, &loads)).collect();
    pairs[1].placement = Placement::IDENTITY;
    let Err(error) = LiveScene::start(pairs, options(150), &Pose::IDENTITY) else {
        panic!("200 bytes in 150");
    };
    let text = error.to_string();
    assert!(
        text.contains("part 0, part 1") && text.contains("200") && text.contains("150"),
        "{text}"
    );
}

#[test]
fn a_changed_file_is_loaded_again_once_it_stands_still() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("part.obj");
    std::fs::write(&file, "1").unwrap();
    let loads = Arc::new(AtomicU32::new(0));
    let mut spec = pair(0, &loads);
    spec.files = vec![file.clone()];
    let (mut manager, _source) = ResidencyManager::new(vec![spec], options(1000), &at(0.0));
    manager.load_in_reach(&at(0.0)).unwrap();
    settle(&mut manager, 0.0);
    assert_eq!(loads.load(Ordering::Relaxed), 1);
    // Growing at every look: still being written.
    for size in 2..6 {
        std::fs::write(&file, "x".repeat(size)).unwrap();
        manager.step(&at(0.0), Instant::now());
    }
    assert_eq!(loads.load(Ordering::Relaxed), 1);
    settle(&mut manager, 0.0);
    assert_eq!(loads.load(Ordering::Relaxed), 2);
    let last = &manager.events.last().unwrap().what;
    assert!(
        matches!(last, SceneChange::Reloaded { bytes: 100, .. }),
        "{last:?}"
    );
}

#[test]
fn the_same_part_in_several_places_is_loaded_and_counted_once() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("part.obj");
    std::fs::write(&file, "1").unwrap();
    let loads = Arc::new(AtomicU32::new(0));
    let mut pairs: Vec<_> = (0..3).map(|k| pair(k, &loads)).collect();
    for (k, pair) in pairs.iter_mut().enumerate() {
        pair.placement = Placement::of_fixed(at(0.05 * k as f64));
        pair.files = vec![file.clone()];
        // By way of another one too.
        pair.same_as = k.checked_sub(1);
    }
    // Room for one.
    let (mut manager, source) = ResidencyManager::new(pairs, options(100), &at(0.0));
    manager.load_in_reach(&at(0.05)).unwrap();
    assert_eq!(states(&manager), [In, In, In]);
    assert_eq!(loads.load(Ordering::Relaxed), 1);
    let mut reader = source.scratch();
    let pose = at(0.05);
    let answer = source.evaluate(&pose, &mut reader);
    // Each pushes with one newton, from where it stands.
    assert_eq!(answer.wrench.force.x, 3.0);
    assert!(answer.energy.abs() < 1e-12);
    // A change of the file: loaded once more, again for all.
    std::fs::write(&file, "two").unwrap();
    settle(&mut manager, 0.05);
    assert_eq!(loads.load(Ordering::Relaxed), 2);
    let again = manager.events.iter();
    let again = again.filter(|e| matches!(e.what, SceneChange::Reloaded { .. }));
    assert_eq!(again.count(), 3);
    assert_eq!(states(&manager), [In, In, In]);
    manager.reload(1);
    settle(&mut manager, 0.05);
    assert_eq!(loads.load(Ordering::Relaxed), 3);
    let ids = manager.entries.iter();
    let ids: Vec<_> = ids
        .map(|s| s.loaded.as_ref().unwrap().source.id())
        .collect();
    assert!(ids.iter().all(|id| *id == ids[0]));
}

#[test]
fn what_cannot_be_loaded_leaves_what_was_there() {
    let broken = Arc::new(AtomicBool::new(false));
    let loads = Arc::default();
    let mut spec = pair(0, &loads);
    let mut good = spec.load;
    let flag = Arc::clone(&broken);
    spec.load = Box::new(move |at| {
        assert!(!flag.load(Ordering::Relaxed), "the mesh has a hole");
        good(at)
    });
    let (mut manager, source) = ResidencyManager::new(vec![spec], options(1000), &at(0.0));
    manager.load_in_reach(&at(0.0)).unwrap();
    let mut reader = source.scratch();
    broken.store(true, Ordering::Relaxed);
    manager.reload(0);
    manager.step(&at(0.0), Instant::now());
    let what = &manager.events.last().unwrap().what;
    assert!(
        matches!(what, SceneChange::Failed(why) if why.contains("hole")),
        "{what:?}"
    );
    assert_eq!(states(&manager), [In]);
    source.refresh(&Pose::IDENTITY, &mut reader);
    assert_eq!(source.evaluate(&Pose::IDENTITY, &mut reader).coverage, 1.0);
}

#[test]
fn a_scene_loads_while_it_is_asked_and_ends_when_dropped() {
    let loads = Arc::new(AtomicU32::new(0));
    let pairs = (0..3).map(|k| pair(k, &loads)).collect();
    let scene = LiveScene::start(pairs, options(1000), &Pose::IDENTITY).unwrap();
    let source = scene.source();
    let mut reader = source.scratch();
    let pose = at(2.0);
    assert_eq!(
        source.evaluate(&pose, &mut reader).coverage,
        0.0,
        "not loaded yet"
    );
    let deadline = Instant::now() + Duration::from_secs(20);
    let change = loop {
        source.evaluate(&pose, &mut reader);
        match source.refresh(&pose, &mut reader) {
            Some(change) if change.coverage > 0.0 => break change,
            _ => assert!(Instant::now() < deadline, "{:?}", scene.events()),
        }
        std::thread::sleep(Duration::from_millis(1));
    };
    assert_eq!(change.wrench.force.x, 3.0);
    assert_eq!(source.evaluate(&pose, &mut reader).coverage, 1.0);
    scene.reload(2);
    while loads.load(Ordering::Relaxed) < 3 {
        assert!(Instant::now() < deadline);
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(scene.states(), [In, Waiting, In]);
}

/// A source that is right in a box about where it was loaded follows the part, and is loaded no more
/// often than that needs, even where loading fails.
#[test]
fn a_source_that_is_right_near_the_part_follows_it() {
    let loads = Arc::new(AtomicU32::new(0));
    let mut spec = pair(1, &loads);
    let counted = Arc::clone(&loads);
    spec.load = Box::new(move |place| {
        let count = counted.fetch_add(1, Ordering::Relaxed);
        if count == 3 {
            return Err("the disk is gone".into());
        }
        Ok(LoadedPair {
            content: Content::Whole {
                source: Arc::new(Push(1.0)),
                bytes: 100,
            },
            reach: REACH,
            right: Some(Aabb::around([place - 0.02, place + 0.02])),
        })
    });
    let (mut manager, _source) = ResidencyManager::new(vec![spec], options(200), &at(1.0));
    manager.load_in_reach(&at(1.0)).unwrap();
    // A quarter of the box, 0.01 m, from its middle; beyond the reach nothing is asked.
    for (x, expected) in [(1.009, 1), (1.011, 2), (1.02, 2), (1.03, 3), (1.2, 3)] {
        settle(&mut manager, x);
        assert_eq!(loads.load(Ordering::Relaxed), expected, "at {x}");
    }
    // A load that fails is not tried again until the part has moved on.
    for (x, expected) in [(1.05, 4), (1.055, 4), (1.061, 5)] {
        settle(&mut manager, x);
        assert_eq!(loads.load(Ordering::Relaxed), expected, "at {x}");
        assert_eq!(states(&manager), [In]);
    }
}
