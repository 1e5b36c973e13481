//! Searches that were stopped go on where they ended.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use fft_correlate::Pose;
use glam::DVec3;
use pegfit_path::{Outcome, PathError, PathRequest, PathSearch, VisitedPoses};
use sdf_grid::Monitor;

use crate::common::Placed;

/// Cancels when it has been asked so often.
struct Patient(AtomicUsize);

impl Monitor for Patient {
    fn cancelled(&self) -> bool {
        let left = |n: usize| n.checked_sub(1);
        let update = (Ordering::Relaxed, Ordering::Relaxed);
        self.0.fetch_update(update.0, update.1, left).is_err()
    }
}

fn search(placed: &Placed, tolerance: Option<f64>) -> PathSearch {
    let options = PathRequest {
        tolerance,
        time_limit: Duration::from_secs(600),
        others: 0.0,
        ..PathRequest::default()
    };
    PathSearch::new(placed.fixed.clone(), placed.moving.clone(), options).unwrap()
}

/// As it would come out of a file.
fn written(visited: &VisitedPoses) -> VisitedPoses {
    serde_json::from_str(&serde_json::to_string(visited).unwrap()).unwrap()
}

#[test]
fn a_search_goes_on_where_it_was_stopped() {
    let placed = Placed::new(pegfit_fixtures::spool_in_slot(2e-4).unwrap(), 30);
    let mut visited = VisitedPoses::default();
    let (mut places, mut stops) = (0, 0);
    // Not enough to find the path at once; searches after the first begin far on.
    let answer = loop {
        let ready = search(&placed, None);
        let monitor = Patient(AtomicUsize::new(120));
        let found = ready.find_from(&placed.goal, None, &mut visited, &monitor);
        visited = written(&visited);
        match found {
            Err(PathError::Cancelled) if visited.count() > 0 => {
                assert!(visited.count() >= places);
                places = visited.count();
                stops += 1;
                assert!(stops < 60, "{places}");
            }
            Err(PathError::Cancelled) => panic!("nothing visited"),
            other => break other.unwrap(),
        }
        if stops == 4 {
            // With time it is found from there.
            let all = Patient(AtomicUsize::new(usize::MAX));
            break search(&placed, None)
                .find_from(&placed.goal, None, &mut visited, &all)
                .unwrap();
        }
    };
    assert!(stops > 1 && places > 2, "{stops} {places}");
    assert_eq!(answer.outcome, Outcome::Free);
    placed.check(&answer);
    let motions = placed.motions(&answer);
    let first = DVec3::from_array(motions[0].axis);
    assert!(first.y > 0.9, "{motions:?}");
}

#[test]
fn what_was_explored_for_another_way_is_refused() {
    let placed = Placed::new(pegfit_fixtures::dovetail(2e-4).unwrap(), 31);
    let stopped = |placed: &Placed, visited: &mut VisitedPoses| {
        let monitor = Patient(AtomicUsize::new(20));
        let found = search(placed, None).find_from(&placed.goal, None, visited, &monitor);
        assert!(matches!(found, Err(PathError::Cancelled)), "{found:?}");
    };
    let mut visited = VisitedPoses::default();
    stopped(&placed, &mut visited);
    assert!(visited.count() > 0);
    let refused = |ready: PathSearch, goal: &Pose, mut visited: VisitedPoses| {
        let all = Patient(AtomicUsize::new(usize::MAX));
        match ready.find_from(goal, None, &mut visited, &all) {
            Err(PathError::Visited { item }) => item,
            other => panic!("{other:?}"),
        }
    };
    let goal = Pose {
        translation: placed.goal.translation + DVec3::splat(1e-6),
        ..placed.goal
    };
    let of = |tolerance| search(&placed, tolerance);
    assert_eq!(refused(of(None), &goal, visited.clone()), "the goal");
    let finer = refused(of(Some(1e-6)), &placed.goal, visited.clone());
    assert_eq!(finer, "the tolerance");
    let other = Placed::new(pegfit_fixtures::dovetail(3e-4).unwrap(), 31);
    let other = refused(search(&other, None), &placed.goal, visited.clone());
    assert_eq!(other, "the fixed part");
    // A place that is reached from itself.
    let mut value = serde_json::to_value(&visited).unwrap();
    value["nodes"][0]["from"] = serde_json::json!([0, []]);
    let circle: VisitedPoses = serde_json::from_value(value.clone()).unwrap();
    let circle = refused(of(None), &placed.goal, circle);
    assert_eq!(circle, "what leads where");
    for (key, wrong) in [
        ("pose", serde_json::json!([0, 0, 0, 0, 0, 0, 2])),
        ("tried", serde_json::json!(1_000_000)),
        ("last", serde_json::json!([1, 2])),
    ] {
        let mut value = value.clone();
        value["nodes"][0][key] = wrong;
        assert!(
            serde_json::from_value::<VisitedPoses>(value).is_err(),
            "{key}"
        );
    }
}
