//! Pairs in frames of their own, and paths looked at by other means than those that found them.

use std::sync::Arc;
use std::time::Duration;

use fft_correlate::Pose;
use glam::{DQuat, DVec3};
use pegfit_path::{Motion, PathRequest, PathResult, PathSearch};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use sdf_grid::{Bvh, Silent, TriangleMesh};

/// Two parts, each turned and shifted by itself.
pub(crate) struct Placed {
    pub(crate) fixed: Arc<TriangleMesh>,
    pub(crate) moving: Arc<TriangleMesh>,
    /// The assembled pose.
    pub(crate) goal: Pose,
    /// Where the fixed part's frame was put.
    pub(crate) place: Pose,
}

pub(crate) fn random_pose(random: &mut SmallRng) -> Pose {
    let mut number = |half: f64| random.random_range(-half..half);
    let q = DQuat::from_xyzw(number(1.0), number(1.0), number(1.0), number(1.0));
    Pose::new(q, DVec3::new(number(0.05), number(0.05), number(0.05)))
}

impl Placed {
    pub(crate) fn new((fixed, moving): (TriangleMesh, TriangleMesh), seed: u64) -> Self {
        let mut random = SmallRng::seed_from_u64(seed);
        let [place, own] = [(); 2].map(|()| random_pose(&mut random));
        let put = |mesh: &TriangleMesh, pose: &Pose| {
            Arc::new(mesh.transformed(pose.rotation, pose.translation))
        };
        Self {
            fixed: put(&fixed, &place),
            moving: put(&moving, &own),
            goal: place * own.inverse(),
            place,
        }
    }

    pub(crate) fn find(&self, options: PathRequest) -> PathResult {
        let (fixed, moving) = (self.fixed.clone(), self.moving.clone());
        let search = PathSearch::new(fixed, moving, options).unwrap();
        search.find(&self.goal, None, &Silent).unwrap()
    }

    /// A path that is free, checked pose by pose.
    pub(crate) fn free(&self) -> PathResult {
        let answer = self.find(PathRequest {
            time_limit: Duration::from_secs(600),
            others: 0.0,
            ..PathRequest::default()
        });
        assert!(
            answer.is_free(),
            "{:?}: {:?}",
            answer.outcome,
            answer.effort
        );
        self.check(&answer);
        answer
    }

    /// The motions as they are in the frame in which the parts were made.
    pub(crate) fn motions(&self, answer: &PathResult) -> Vec<Motion> {
        let own = self.place.inverse();
        answer.motions.iter().map(|m| m.placed(&own)).collect()
    }

    /// Allowed winding numbers at random points: nothing lies deep in both solids at any pose; steps are
    /// equal and no longer than said, from outside to the goal.
    pub(crate) fn check(&self, answer: &PathResult) {
        let (fixed, moving) = (Bvh::build(&self.fixed), Bvh::build(&self.moving));
        let mut random = SmallRng::seed_from_u64(7);
        let bounds = self.moving.bounds();
        let unit = |random: &mut SmallRng| DVec3::from_array(random.random::<[f64; 3]>());
        let deep = -2.0 * answer.tolerance;
        let points: Vec<DVec3> = (0..4000)
            .map(|_| bounds.min + bounds.size() * unit(&mut random))
            .filter(|p| moving.signed_distance(*p) < deep)
            .collect();
        let count = answer.poses.len();
        for (i, at) in answer.poses.iter().enumerate() {
            assert!(
                at.depth <= answer.tolerance,
                "pose {i} of {count}: {}",
                at.depth
            );
            if i % (count / 40 + 1) != 0 {
                continue;
            }
            for q in &points {
                let distance = fixed.signed_distance(at.pose.apply(*q));
                assert!(distance > deep, "pose {i} of {count}: {distance}");
            }
        }
        let vertices = self.moving.vertices();
        for pair in answer.poses.windows(2) {
            let moved = |q: &DVec3| pair[0].pose.apply(*q).distance(pair[1].pose.apply(*q));
            let largest = vertices.iter().map(moved).fold(0.0, f64::max);
            assert!(
                largest < 1.02 * answer.step + 1e-12,
                "{largest} {}",
                answer.step
            );
        }
        let last = answer.poses[count - 1].pose;
        assert!((last.translation - self.goal.translation).length() < 1e-12);
        assert!(last.angle_to(&self.goal) < 1e-12);
        self.is_outside(&answer.poses[0].pose);
    }

    /// Both parts' vertices lie on either side of a plane: along one of many directions.
    fn is_outside(&self, pose: &Pose) {
        let moving: Vec<DVec3> = self
            .moving
            .vertices()
            .iter()
            .map(|q| pose.apply(*q))
            .collect();
        let centre = |points: &[DVec3]| points.iter().sum::<DVec3>() / points.len() as f64;
        let direction = centre(&moving) - centre(self.fixed.vertices());
        let apart = |u: DVec3| {
            let highest = self
                .fixed
                .vertices()
                .iter()
                .map(|p| p.dot(u))
                .fold(f64::MIN, f64::max);
            moving.iter().map(|p| p.dot(u)).fold(f64::MAX, f64::min) - highest
        };
        let axes = DVec3::AXES.map(|a| self.place.rotation * a);
        let tried = axes
            .iter()
            .flat_map(|a| [*a, -*a])
            .chain([direction.normalize()]);
        assert!(tried.into_iter().any(|u| apart(u) > 0.0));
    }
}
