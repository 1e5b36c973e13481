//! The poses at which a stated error is measured.

use std::collections::HashSet;

use crate::common::*;
use fft_correlate::RotationDomain;
use fft_correlate::testing::random_pose;
use glam::DQuat;

/// A thousand poses are a thousand, whatever the rotations: a share of them that repeats says nothing
/// new, and one that another seed draws again confirms itself.
#[test]
fn held_out_poses_are_all_different_within_and_between_seeds() {
    let domains = [
        RotationDomain::single(DQuat::IDENTITY),
        RotationDomain::ball(20.0, 10.0),
        RotationDomain::Full {
            center: [0.0, 0.0, 0.0, 1.0],
            step_deg: 30.0,
        },
    ];
    for rotations in domains {
        let spec = spec(window(0.3, 0.1), rotations);
        let mut drawn = HashSet::new();
        let mut places = [(); 3].map(|()| HashSet::new());
        let seeds = [1, 2, 3, 17, 7_777];
        for seed in seeds {
            for index in 0..1000 {
                let pose = random_pose(&spec, seed, index);
                assert_eq!(pose, random_pose(&spec, seed, index));
                let turn = pose.rotation.to_array().map(f64::to_bits);
                let place = pose.translation.to_array().map(f64::to_bits);
                drawn.insert((turn, place));
                for (places, coordinate) in places.iter_mut().zip(place) {
                    places.insert(coordinate);
                }
            }
        }
        let all = 1000 * seeds.len();
        assert_eq!(drawn.len(), all, "{:?}", spec.rotations);
        assert_eq!(places.map(|p| p.len()), [all; 3], "{:?}", spec.rotations);
    }
}
